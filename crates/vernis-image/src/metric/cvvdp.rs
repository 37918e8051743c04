//! ColorVideoVDP: the loss of quality that people would report, from a model of contrast sensitivity in luminance and in colour.
//!
//!   JOD = 10 - a function of the differences in the bands of a Laplacian pyramid in DKL, weighted by sensitivity and masked
//!
//! JOD: just-objectionable differences; 10 is no visible difference, and of two pictures one JOD apart, three of four people prefer
//! the one with more. The distance is 10 - JOD.
//!
//! Source: Mantiuk, Hanji, Ashraf, Asano and Chapiro 2024 (doi:10.1145/3658144), calibration 0.5.7; the metric is the crate
//! `colorvideovdp` 0.1.1, a port that agrees with the authors' program within 1e-4 JOD.
//!
//! Display: one of [`Display`], which sets luminance, black, reflections and pixels a degree. Blind to: overall brightness. A quarter
//! more light everywhere is 10 JOD, because contrast stays what it was; people rate such a picture lower.

use super::contract::{
    Comparison, Conditions, DifferenceMap, ImageMetric, ImageMetricError, Need, PreparedReference, PreparedResult,
    Properties,
};
use crate::display::Display;
use crate::picture::{EncodedPicture, Encoding, MOST_PIXELS};
use colorvideovdp::{Color, Cvvdp as Evaluator, DisplayModel, Image, Options};

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// The best JOD.
const BEST: f64 = 10.0;

/// Bytes that the crate may take: its estimate for the largest picture that is compared.
const MOST_BYTES: usize = 4 << 30;

/// ColorVideoVDP of single pictures.
#[derive(Clone, Copy, Debug)]
pub struct Cvvdp;

impl ImageMetric for Cvvdp {
    fn name(&self) -> &'static str {
        "cvvdp"
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        let unit = "just-objectionable differences, at most 10";
        Properties {
            larger_is_better: true,
            distance: "10 - JOD",
            encodings: &[Encoding::Srgb, Encoding::Linear],
            smallest: 4,
            most_pixels: MOST_PIXELS / 4,
            needs: vec![Need::Display],
            ..Properties::new("quality in JOD", unit, "Mantiuk et al. 2024, doi:10.1145/3658144")
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, conditions: &Conditions) -> PreparedResult {
        let found = reference.encoding();
        let display = conditions.display.unwrap_or(Display::default_for(found));
        if display.shows() != found {
            return Err(ImageMetricError::Display { display: display.name(), shows: display.shows(), found });
        }
        let evaluator = evaluator(display, false).map_err(undefined)?;
        let reference = image(reference).map_err(undefined)?;
        Ok(Box::new(Reference { display, evaluator, reference }))
    }
}

/// The crate's evaluator for a display.
fn evaluator(display: Display, with_map: bool) -> colorvideovdp::Result<Evaluator> {
    let model = DisplayModel::from_name(match display {
        Display::StandardFhd => "standard_fhd",
        Display::Standard4k => "standard_4k",
        Display::StandardHdrLinear => "standard_hdr_linear",
    })?;
    Evaluator::new(model, Options::default().with_memory_limit_bytes(MOST_BYTES).with_distortion_map(with_map))
}

struct Reference {
    display: Display,
    /// Without a map, which takes more time.
    evaluator: Evaluator,
    reference: Image,
}

impl Reference {
    fn evaluate(&self, test: &EncodedPicture, with_map: bool) -> colorvideovdp::Result<Comparison> {
        let color = match self.display.shows() {
            Encoding::Srgb => Color::Srgb,
            Encoding::Linear => Color::Linear,
        };
        let test = image(test)?;
        let found = if with_map {
            evaluator(self.display, true)?.predict_image(&test, &self.reference, color)?
        } else {
            self.evaluator.predict_image(&test, &self.reference, color)?
        };
        let quality = f64::from(found.jod);
        let map = found.distortion_map.map(|map| DifferenceMap {
            width: map.width,
            height: map.height,
            values: map.data,
            white: 1.0,
        });
        let details = vec![("ppd", self.evaluator.display().geometry.pixels_per_degree())];
        Ok(Comparison { distance: BEST - quality, quality, details, map })
    }
}

impl PreparedReference for Reference {
    fn compare(&self, test: &EncodedPicture, with_map: bool) -> Result<Comparison, ImageMetricError> {
        self.evaluate(test, with_map).map_err(undefined)
    }
}

/// What the crate takes: codes from 0 to 1, or light in cd/m2.
fn image(picture: &EncodedPicture) -> colorvideovdp::Result<Image> {
    let most = if picture.encoding() == Encoding::Srgb { 255.0 } else { 1.0 };
    let data = picture.pixels().iter().flatten().map(|v| v / most).collect();
    Image::new(picture.width(), picture.height(), 3, data)
}

fn undefined(error: colorvideovdp::Error) -> ImageMetricError {
    ImageMetricError::Undefined { metric: "cvvdp", reason: error.to_string() }
}
