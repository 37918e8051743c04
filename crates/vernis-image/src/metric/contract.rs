//! What every metric on pictures offers: [`ImageMetric`], which makes a [`Prepared`] reference, which compares.

use super::lab2000hl::{Lab2000HlTable, TableError};
use super::weights::{Weights, WeightsError, WeightsFile};
use crate::display::Display;
use crate::picture::{EncodedPicture, Encoding, MOST_PIXELS};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;
use vernis_metric::io::{did_you_mean, number, shown};

/// Names in messages are cut here.
const LONGEST_NAME: usize = 60;

/// How pictures are seen, and what the user gives beside them.
#[derive(Clone, Debug, Default)]
pub struct Conditions {
    /// Pixels a degree of visual angle, for metrics with [`Need::Ppd`]; without it each takes its own default.
    pub ppd: Option<f64>,
    /// The display, for metrics with [`Need::Display`]; without it [`Display::default_for`] the encoding.
    pub display: Option<Display>,
    /// The user's table, for metrics with [`Need::Lab2000HlTable`].
    pub table: Option<Arc<Lab2000HlTable>>,
    /// The user's folder of weights, for metrics with [`Need::Weights`].
    pub weights: Option<Arc<Weights>>,
}

/// Why a user's folder cannot be used.
#[derive(Debug, Error)]
pub enum FolderError {
    /// The table that is there is wrong.
    #[error(transparent)]
    Table(#[from] TableError),
    /// It is no folder.
    #[error(transparent)]
    Weights(#[from] WeightsError),
}

impl Conditions {
    /// With what a folder of the user's holds: the table of LAB2000HL where it is there, and weights, which are read when they are needed.
    ///
    /// # Errors
    /// It is no folder, or the table in it is wrong.
    pub fn of_folder(folder: &Path) -> Result<Self, FolderError> {
        let weights = Weights::in_folder(folder)?;
        let file = folder.join(Lab2000HlTable::FILE);
        let table = file.exists().then(|| Lab2000HlTable::read(&file).map(Arc::new)).transpose()?;
        Ok(Self { table, weights: Some(Arc::new(weights)), ..Self::default() })
    }

    /// Whether `need` is met.
    pub fn meet(&self, need: Need) -> bool {
        match need {
            Need::Lab2000HlTable { .. } => self.table.is_some(),
            Need::Weights { files } => self.weights.as_ref().is_some_and(|weights| weights.has(files)),
            Need::Ppd(_) | Need::Display => true,
        }
    }

    /// The SHA-256 of what the user gave for `needs`.
    pub fn contents(&self, needs: &[Need]) -> String {
        let Some(weights) = &self.weights else { return String::new() };
        let of_need = |need: &Need| match need {
            Need::Lab2000HlTable { .. } => weights.contents(&[Lab2000HlTable::FILE]),
            Need::Weights { files } => weights.contents(files),
            Need::Ppd(_) | Need::Display => String::new(),
        };
        needs.iter().map(of_need).collect()
    }
}

/// What a metric uses of [`Conditions`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Need {
    /// Pixels a degree, with the default.
    Ppd(f64),
    /// A model of a display.
    Display,
    /// The table of LAB2000HL. The metric cannot work without it; the named metric works in CIELAB instead.
    Lab2000HlTable {
        /// The metric that needs no table.
        fallback: &'static str,
    },
    /// Weights of a network. The metric cannot work without them.
    Weights {
        /// Names of the files, as in [`super::WEIGHTS_FILES`].
        files: &'static [&'static str],
    },
}

/// What a metric is, for lists and checks.
#[derive(Clone, Debug)]
pub struct Properties {
    /// What `quality` is, in a few words.
    pub quality: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Whether a larger `quality` means pictures that look more alike.
    pub larger_is_better: bool,
    /// How `distance` follows from it.
    pub distance: &'static str,
    /// Who published it.
    pub source: &'static str,
    /// What the numbers of pictures may mean.
    pub encodings: &'static [Encoding],
    /// Smallest side of a picture, in pixels.
    pub smallest: usize,
    /// Pixels of the largest picture; its memory follows from it.
    pub most_pixels: usize,
    /// What it uses of [`Conditions`].
    pub needs: Vec<Need>,
    /// Whether it can write a [`DifferenceMap`].
    pub has_map: bool,
}

impl Properties {
    /// Of a metric like most: its quality is its distance, it takes sRGB codes of any size, needs nothing of [`Conditions`] and has a
    /// map.
    pub fn new(quality: &'static str, unit: &'static str, source: &'static str) -> Self {
        Self {
            quality,
            unit,
            source,
            larger_is_better: false,
            distance: "the same",
            encodings: &[Encoding::Srgb],
            smallest: 1,
            most_pixels: MOST_PIXELS,
            needs: Vec::new(),
            has_map: true,
        }
    }
}

/// A value for every pixel, or for every place of the metric's window.
#[derive(Clone, Debug, PartialEq)]
pub struct DifferenceMap {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Row by row from the top left; 0 is no difference.
    pub values: Vec<f32>,
    /// The value that a picture of the map shows as white.
    pub white: f32,
}

/// What a metric says of a pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// 0 for identical pictures; larger is worse.
    pub distance: f64,
    /// The metric's own published number. It may be infinite: the PSNR of identical pictures is.
    pub quality: f64,
    /// Further numbers of the metric, and what it chose itself, by name.
    pub details: Vec<(&'static str, f64)>,
    /// Where the differences are, if it was asked for and the metric has one.
    pub map: Option<DifferenceMap>,
}

/// A fixed reference, or why a metric cannot take it.
pub type PreparedResult = Result<Box<dyn PreparedReference>, ImageMetricError>;

/// A metric that compares two pictures.
pub trait ImageMetric: Send + Sync {
    /// Its name in the registry.
    fn name(&self) -> &'static str;

    /// Raised when its numbers change by more than rounding.
    fn version(&self) -> u32;

    /// What it is.
    fn properties(&self) -> Properties;

    /// Does the work that depends on the reference alone. [`ImageMetric::prepare`] has checked that the metric takes such a picture.
    ///
    /// # Errors
    /// [`ImageMetricError`]: something of `conditions` is missing or unfit, or the metric is undefined for this reference.
    fn prepare_checked(&self, reference: &EncodedPicture, conditions: &Conditions) -> PreparedResult;

    /// Fixes the reference.
    ///
    /// # Errors
    /// [`ImageMetricError`]: the metric does not take such a picture, or those of [`ImageMetric::prepare_checked`].
    fn prepare(&self, reference: &EncodedPicture, conditions: &Conditions) -> Result<Prepared, ImageMetricError> {
        let properties = self.properties();
        let metric = self.name();
        let (width, height) = (reference.width(), reference.height());
        if !properties.encodings.contains(&reference.encoding()) {
            let (found, allowed) = (reference.encoding(), properties.encodings[0]);
            return Err(ImageMetricError::Encoding { metric, found, allowed });
        }
        if width.min(height) < properties.smallest {
            return Err(ImageMetricError::TooSmall { metric, width, height, smallest: properties.smallest });
        }
        if width * height > properties.most_pixels {
            return Err(ImageMetricError::TooLarge { metric, width, height, most: properties.most_pixels });
        }
        if let Some(ppd) = conditions.ppd.filter(|ppd| !(PPD_RANGE.0..=PPD_RANGE.1).contains(ppd)) {
            return Err(ImageMetricError::Ppd { ppd });
        }
        let inner = self.prepare_checked(reference, conditions)?;
        Ok(Prepared { metric, reference: reference.clone(), inner })
    }
}

/// Pixels a degree that make sense: from a picture seen through a keyhole to one pixel of a wall.
pub(super) const PPD_RANGE: (f64, f64) = (1.0, 1000.0);

/// The inner side of [`Prepared`]: what a metric implements.
pub trait PreparedReference: Send + Sync {
    /// Compares with a picture of the same size and encoding.
    ///
    /// # Errors
    /// [`ImageMetricError`] where the metric is undefined for this pair.
    fn compare(&self, test: &EncodedPicture, with_map: bool) -> Result<Comparison, ImageMetricError>;
}

/// The reference of a metric that takes the same `features` of both pictures and compares those; `compare` is told whether a map is
/// wanted.
pub(super) fn by_features<T: Send + Sync + 'static>(
    reference: &EncodedPicture,
    features: impl Fn(&EncodedPicture) -> T + Send + Sync + 'static,
    compare: impl Fn(&T, &T, bool) -> Comparison + Send + Sync + 'static,
) -> PreparedResult {
    Ok(Box::new(ByFeatures { reference: features(reference), features, compare }))
}

struct ByFeatures<T, F, C> {
    reference: T,
    features: F,
    compare: C,
}

impl<T, F, C> PreparedReference for ByFeatures<T, F, C>
where
    T: Send + Sync,
    F: Fn(&EncodedPicture) -> T + Send + Sync,
    C: Fn(&T, &T, bool) -> Comparison + Send + Sync,
{
    fn compare(&self, test: &EncodedPicture, with_map: bool) -> Result<Comparison, ImageMetricError> {
        Ok((self.compare)(&self.reference, &(self.features)(test), with_map))
    }
}

/// A metric with a fixed reference.
pub struct Prepared {
    metric: &'static str,
    reference: EncodedPicture,
    inner: Box<dyn PreparedReference>,
}

impl Prepared {
    /// Compares the reference with `test`.
    ///
    /// # Errors
    /// [`ImageMetricError`]: another size or encoding than the reference has, or the metric is undefined for this pair.
    pub fn compare(&self, test: &EncodedPicture, with_map: bool) -> Result<Comparison, ImageMetricError> {
        let size = |picture: &EncodedPicture| [picture.width(), picture.height()];
        if size(test) != size(&self.reference) {
            return Err(ImageMetricError::Sizes { reference: size(&self.reference), test: size(test) });
        }
        if test.encoding() != self.reference.encoding() {
            let (reference, test) = (self.reference.encoding(), test.encoding());
            return Err(ImageMetricError::Encodings { reference, test });
        }
        let mut found = self.inner.compare(test, with_map)?;
        // Rounding may leave 1e-16 of products and roots that cancel on paper.
        if test == &self.reference || found.distance < 0.0 {
            found.distance = 0.0;
        }
        if found.distance.is_nan() || found.quality.is_nan() {
            let reason = "its value is no number for this pair".to_owned();
            return Err(ImageMetricError::Undefined { metric: self.metric, reason });
        }
        Ok(found)
    }

    /// The distance to `test`.
    ///
    /// # Errors
    /// Those of [`Prepared::compare`].
    pub fn distance(&self, test: &EncodedPicture) -> Result<f64, ImageMetricError> {
        Ok(self.compare(test, false)?.distance)
    }

    /// The metric's own published number for `test`.
    ///
    /// # Errors
    /// Those of [`Prepared::compare`].
    pub fn quality(&self, test: &EncodedPicture) -> Result<f64, ImageMetricError> {
        Ok(self.compare(test, false)?.quality)
    }
}

/// Why pictures cannot be compared.
#[derive(Debug, Error)]
pub enum ImageMetricError {
    /// No metric is called so.
    #[error("no metric on pictures is called \"{}\"; {}", shown(name, LONGEST_NAME), did_you_mean(nearest))]
    Unknown {
        /// What was asked for.
        name: String,
        /// The most similar names.
        nearest: Vec<String>,
    },
    /// Two pictures of different sizes.
    #[error(
        "the test picture has {} x {} pixels; it must have as many as the reference, {} x {}",
        test[0], test[1], reference[0], reference[1]
    )]
    Sizes {
        /// Width and height of the reference.
        reference: [usize; 2],
        /// Width and height of the test picture.
        test: [usize; 2],
    },
    /// Numbers of two meanings.
    #[error("the reference holds {} and the test picture {}; both must hold the same", reference.words(), test.words())]
    Encodings {
        /// That of the reference.
        reference: Encoding,
        /// That of the test picture.
        test: Encoding,
    },
    /// Numbers that the metric has no use for.
    #[error("the pictures hold {}; {metric} needs {}", found.words(), allowed.words())]
    Encoding {
        /// The metric.
        metric: &'static str,
        /// What the pictures hold.
        found: Encoding,
        /// What it needs.
        allowed: Encoding,
    },
    /// Fewer pixels than the metric's window has.
    #[error("the pictures have {width} x {height} pixels; {metric} needs at least {smallest} x {smallest}")]
    TooSmall {
        /// The metric.
        metric: &'static str,
        /// Number of columns.
        width: usize,
        /// Number of rows.
        height: usize,
        /// Smallest side.
        smallest: usize,
    },
    /// More pixels than the metric's memory is bounded for.
    #[error(
        "the pictures have {width} x {height} pixels; {metric} takes at most {most} pixels: crop them or make them smaller"
    )]
    TooLarge {
        /// The metric.
        metric: &'static str,
        /// Number of columns.
        width: usize,
        /// Number of rows.
        height: usize,
        /// Largest number of pixels.
        most: usize,
    },
    /// An impossible angle.
    #[error("there are {} pixels a degree; there must be {} to {}", number(*ppd), PPD_RANGE.0, PPD_RANGE.1)]
    Ppd {
        /// Pixels a degree.
        ppd: f64,
    },
    /// No table.
    #[error(
        "{metric} needs the table of LAB2000HL, which may not be shipped{}; without it use {fallback}, the same metric in CIELAB",
        folder.as_ref().map_or(String::new(), |f| format!("; the folder {} has no {}", f.display(), Lab2000HlTable::FILE))
    )]
    NoTable {
        /// The metric.
        metric: &'static str,
        /// The metric that needs none.
        fallback: &'static str,
        /// The folder where it was looked for, if the user named one.
        folder: Option<PathBuf>,
    },
    /// No weights.
    #[error(
        "{metric} needs {}, which may not be shipped{}",
        file.names(),
        folder.as_ref().map_or(String::new(), |folder| format!("; the folder {} has no such file", folder.display()))
    )]
    NoWeights {
        /// The metric.
        metric: &'static str,
        /// The file that is missing.
        file: &'static WeightsFile,
        /// The folder where it was looked for, if the user named one.
        folder: Option<PathBuf>,
    },
    /// Weights that are wrong.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// A display that does not show such numbers.
    #[error("display {display} shows {}; the pictures hold {}", shows.words(), found.words())]
    Display {
        /// The display's name.
        display: &'static str,
        /// What it shows.
        shows: Encoding,
        /// What the pictures hold.
        found: Encoding,
    },
    /// The metric has no value here.
    #[error("{metric} is undefined: {reason}")]
    Undefined {
        /// The metric.
        metric: &'static str,
        /// Why.
        reason: String,
    },
}

impl ImageMetricError {
    /// Whether it is about the two pictures, so that no other metric could compare them either.
    pub fn is_of_the_pair(&self) -> bool {
        matches!(self, Self::Sizes { .. } | Self::Encodings { .. } | Self::Ppd { .. })
    }
}
