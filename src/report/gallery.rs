//! What the gallery of a study shows: its rendered stimuli, small, and every value that is known of a pair.

use crate::dataset::Study;
use crate::evaluation::records::{BenchmarkRecord, PredictionRecord};
use crate::experiment::stimuli::{Found, FoundStimuli, Role, Sidecar};
use image::codecs::jpeg::JpegEncoder;
use image::imageops::{FilterType, resize};
use image::io::{Limits, Reader};
use image::{ImageFormat, Rgb, RgbImage};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use thiserror::Error;
use vernis_metric::io::counted;
use vernis_metric::math::rating_scale::RatingScale;

/// Columns and rows of a thumbnail at most: a fifth of the study's pictures.
const THUMBNAIL: [u32; 2] = [116, 180];
/// Of the JPEG file of a thumbnail, 1 to 100.
const QUALITY: u8 = 80;
/// Different settings of pictures that are told one by one.
const MOST_SETTINGS: usize = 3;
/// What stays as it is in a part of a URL (RFC 3986, section 2.3).
const ENCODED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');

/// Why stimuli cannot be shown.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum GalleryError {
    #[error("{}: {reason}; it must be the PNG file of a stimulus", path.display())]
    Picture { path: PathBuf, reason: String },
}

/// A small copy of a picture, a JPEG file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Thumbnail {
    /// The bytes of the file.
    pub jpeg: Vec<u8>,
    /// Columns and rows.
    pub size: [u32; 2],
}

/// A stimulus.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// URL of the PNG file, relative to the page.
    pub link: String,
    /// Columns and rows of the PNG file.
    pub size: [usize; 2],
    /// A small copy.
    pub thumbnail: Thumbnail,
}

/// What the values of a column are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Kind {
    /// Mean opinion scores that a metric predicts for materials that it has not seen.
    Predicted,
    /// Distances of a metric; larger is worse.
    Distance,
    /// Numbers from a file of this name.
    File(String),
}

/// Values of a metric, one a pair.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name of the metric.
    pub name: String,
    /// What its values are.
    pub kind: Kind,
    /// By the place of the pair in the study; `None` where it is not known.
    pub values: Vec<Option<f64>>,
}

/// A candidate whose picture is there, beside its reference.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// Its place in the study.
    pub place: usize,
    /// Name of the material.
    pub material: String,
    /// Name of the approximation method.
    pub method: String,
    /// Mean opinion score as rated, on the scale of the study.
    pub mos: f64,
    /// Its place among [`Gallery::pictures`].
    pub picture: usize,
}

/// A reference and its candidates.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Name of the material.
    pub material: String,
    /// The reference in its own camera, among [`Gallery::pictures`]; `None` if it is not rendered yet.
    pub reference: Option<usize>,
    /// The same in the camera of the candidates.
    pub hidden_reference: Option<usize>,
    /// Candidates in the order of the study.
    pub pairs: Vec<Pair>,
}

/// The rendered stimuli of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Gallery {
    /// Name of the study.
    pub study: String,
    /// The ratings come from simulated observers.
    pub synthetic: bool,
    /// The scale of ratings and predictions.
    pub scale: RatingScale,
    /// Every picture once.
    pub pictures: Vec<Picture>,
    /// By the name of the material.
    pub scenes: Vec<Scene>,
    /// What is known of pairs beside their ratings.
    pub columns: Vec<Column>,
    /// Sentences: what the pictures show.
    pub seen: Vec<String>,
    /// What is needed to make the page again: names and values.
    pub provenance: Vec<(String, String)>,
    /// Pictures of pairs and references by the place of a pair of theirs: candidate, reference, hidden reference.
    places: BTreeMap<usize, [Option<usize>; 3]>,
}

impl Gallery {
    /// The stimuli that were found, with predictions and distances of `benchmark` and the columns of `scores`, for a page in the
    /// folder `page`.
    ///
    /// # Errors
    /// A picture that cannot be decoded, or whose size is not that which is said of it.
    pub fn of(
        study: &Study,
        stimuli: &FoundStimuli,
        benchmark: Option<&BenchmarkRecord>,
        scores: Vec<Column>,
        page: &Path,
    ) -> Result<Self, GalleryError> {
        let base = relative_url(page, &stimuli.folder);
        let shown = |found: &Found| {
            let link = format!("{base}{}.png", url(&found.stimulus.name));
            Ok(Picture { link, size: found.sidecar.size, thumbnail: thumbnail(&found.png, found.sidecar.size)? })
        };
        // The first error in the order of the study.
        let pictures: Vec<Result<Picture, GalleryError>> = stimuli.found.par_iter().map(shown).collect();
        let pictures: Vec<Picture> = pictures.into_iter().collect::<Result<_, _>>()?;
        let of_role = |role: Role| -> BTreeMap<usize, usize> {
            let found = stimuli.found.iter().enumerate().filter(|(_, found)| found.stimulus.role == role);
            found.map(|(picture, found)| (found.stimulus.pair, picture)).collect()
        };
        let [references, hidden, candidates] = [Role::Reference, Role::HiddenReference, Role::Candidate].map(of_role);
        let (mut scenes, mut places) = (Vec::new(), BTreeMap::new());
        for of_reference in study.by_reference() {
            let Some(&first) = of_reference.first() else { continue };
            let (reference, hidden_reference) = (references.get(&first).copied(), hidden.get(&first).copied());
            let pair = |&place: &usize| {
                let (pair, &picture) = (&study.pairs[place], candidates.get(&place)?);
                let (material, method) = (pair.material.clone(), pair.method.clone());
                Some(Pair { place, material, method, mos: study.scale.stated(pair.mos), picture })
            };
            let pairs: Vec<Pair> = of_reference.iter().filter_map(pair).collect();
            for place in of_reference {
                places.insert(place, [candidates.get(&place).copied(), reference, hidden_reference]);
            }
            if reference.is_some() || hidden_reference.is_some() || !pairs.is_empty() {
                scenes.push(Scene {
                    material: study.pairs[first].material.clone(),
                    reference,
                    hidden_reference,
                    pairs,
                });
            }
        }
        scenes.sort_by(|a, b| a.material.cmp(&b.material));
        let mut columns = benchmark.map_or_else(Vec::new, |record| columns_of(study, record));
        columns.extend(scores);
        columns.retain(|column| candidates.keys().any(|&place| column.values.get(place).is_some_and(Option::is_some)));
        Ok(Self {
            study: study.name.clone(),
            synthetic: study.synthetic,
            scale: study.scale,
            pictures,
            scenes,
            columns,
            seen: seen(stimuli),
            provenance: benchmark.map_or_else(Vec::new, provenance),
            places,
        })
    }

    /// The small picture of the candidate of a pair, by its place in the study.
    pub fn candidate(&self, place: usize) -> Option<&Thumbnail> {
        self.thumbnail(place, 0)
    }

    /// The small pictures of the reference of a pair: in its own camera, and in that of the candidates.
    pub fn reference(&self, place: usize) -> [Option<&Thumbnail>; 2] {
        [1, 2].map(|of| self.thumbnail(place, of))
    }

    fn thumbnail(&self, place: usize, of: usize) -> Option<&Thumbnail> {
        self.places.get(&place)?[of].map(|picture| &self.pictures[picture].thumbnail)
    }

    /// Every pair in the order of the page.
    pub fn pairs(&self) -> impl Iterator<Item = (&Scene, &Pair)> {
        self.scenes.iter().flat_map(|scene| scene.pairs.iter().map(move |pair| (scene, pair)))
    }

    /// The names of all methods, each once.
    pub fn methods(&self) -> BTreeSet<&str> {
        self.pairs().map(|(_, pair)| pair.method.as_str()).collect()
    }

    /// The names of all materials, each once.
    pub fn materials(&self) -> BTreeSet<&str> {
        self.scenes.iter().map(|scene| scene.material.as_str()).collect()
    }
}

fn provenance(record: &BenchmarkRecord) -> Vec<(String, String)> {
    vec![("predictions and distances".to_owned(), record.command.clone())]
}

/// Sentences: which pictures are there, and what they show.
fn seen(stimuli: &FoundStimuli) -> Vec<String> {
    let mut lines = vec![
        "The stimuli are path traced. A reference is seen by its own camera, which is turned a little; its candidates, and the hidden \
         reference, which is the reference once more, by the test camera."
            .to_owned(),
    ];
    let mut settings: Vec<(String, usize)> = Vec::new();
    for found in &stimuli.found {
        let words = settings_of(&found.sidecar);
        match settings.iter_mut().find(|(known, _)| *known == words) {
            Some((_, count)) => *count += 1,
            None => settings.push((words, 1)),
        }
    }
    match settings.as_slice() {
        [(words, _)] => lines.push(format!("All pictures: {words}.")),
        several => {
            let told = several
                .iter()
                .take(MOST_SETTINGS)
                .map(|(words, count)| format!("{}: {words}", counted(*count, "picture")));
            let told = told.collect::<Vec<_>>().join("; ");
            let more = several.len().saturating_sub(MOST_SETTINGS);
            let more = if more > 0 { format!("; and {more} more") } else { String::new() };
            lines.push(format!(
                "The pictures were made in several ways, so that they cannot be compared with each other: {told}{more}."
            ));
        }
    }
    let missing = stimuli.looked_for - stimuli.found.len();
    if missing > 0 {
        let are = if missing == 1 { "is" } else { "are" };
        lines.push(format!("{missing} of {} {are} not rendered yet.", counted(stimuli.looked_for, "picture")));
    }
    lines
}

/// How a picture was made, in words.
fn settings_of(sidecar: &Sidecar) -> String {
    let [width, height] = sidecar.size;
    let (samples, bounces) = (counted(sidecar.samples, "sample"), counted(sidecar.bounces, "bounce"));
    let tone = match (sidecar.tone.as_deref(), sidecar.gamma) {
        (None, _) => String::new(),
        (Some("none"), _) => ", no tone curve".to_owned(),
        (Some(name), None) => format!(", tone curve {name}"),
        (Some(name), Some(gamma)) => format!(", tone curve {name} with the power {gamma:.4}"),
    };
    let exposure = sidecar.exposure.filter(|stops| *stops != 0.0);
    let exposure = exposure.map_or_else(String::new, |stops| format!(", exposure {stops:+} f-stops"));
    format!("{width}x{height} pixels, {samples} a pixel, at most {bounces}{tone}{exposure}")
}

/// Predictions of the headline's metrics, and distances of all that have any.
fn columns_of(study: &Study, record: &BenchmarkRecord) -> Vec<Column> {
    let rows = rows_of(study, &record.predictions);
    let column = |name: &str, kind: Kind, value: &dyn Fn(&PredictionRecord) -> Option<f64>| Column {
        name: name.to_owned(),
        kind,
        values: rows.iter().map(|row| row.and_then(value)).collect(),
    };
    let predicted = record.headline.iter().map(|name| {
        column(name, Kind::Predicted, &|row| row.predicted.get(name).map(|score| record.restated(*score, study.scale)))
    });
    let names: BTreeSet<&String> = record.predictions.iter().flat_map(|row| row.distances.keys()).collect();
    let distances = names.into_iter().map(|name| column(name, Kind::Distance, &|row| row.distances.get(name).copied()));
    predicted.chain(distances).collect()
}

/// The row of each pair: of several with the same names, the first is that of the first pair.
fn rows_of<'a>(study: &'a Study, rows: &'a [PredictionRecord]) -> Vec<Option<&'a PredictionRecord>> {
    let mut by_name: BTreeMap<[&str; 2], VecDeque<&PredictionRecord>> = BTreeMap::new();
    for row in rows {
        by_name.entry([&row.material, &row.method]).or_default().push_back(row);
    }
    let pairs = study.pairs.iter();
    pairs.map(|pair| by_name.get_mut(&[pair.material.as_str(), pair.method.as_str()])?.pop_front()).collect()
}

/// A small copy of the PNG file at `path`, which says to have so many columns and rows.
fn thumbnail(path: &Path, size: [usize; 2]) -> Result<Thumbnail, GalleryError> {
    let wrong = |reason: String| GalleryError::Picture { path: path.to_owned(), reason };
    let bytes = std::fs::read(path).map_err(|e| wrong(e.to_string()))?;
    let reader = || Reader::with_format(Cursor::new(&bytes), ImageFormat::Png);
    // Before a pixel is decoded.
    let [width, height] = size;
    let (found_width, found_height) = reader().into_dimensions().map_err(|e| wrong(e.to_string()))?;
    if [found_width as usize, found_height as usize] != size {
        return Err(wrong(format!(
            "it has {found_width}x{found_height} pixels, and the file beside it says {width}x{height}"
        )));
    }
    let mut reader = reader();
    reader.limits(Limits::default());
    let picture = reader.decode().map_err(|e| wrong(e.to_string()))?.into_rgb8();
    let small = shrunk(picture);
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, QUALITY).encode_image(&small).map_err(|e| wrong(e.to_string()))?;
    Ok(Thumbnail { jpeg, size: [small.width(), small.height()] })
}

/// A picture that fits into [`THUMBNAIL`]; one that does is left alone.
fn shrunk(picture: RgbImage) -> RgbImage {
    let sides = [picture.width(), picture.height()];
    let factor = (0..2).map(|i| f64::from(THUMBNAIL[i]) / f64::from(sides[i])).fold(1.0, f64::min);
    if factor >= 1.0 {
        return picture;
    }
    let [width, height] = sides.map(|side| ((f64::from(side) * factor).round() as u32).max(1));
    let small: image::ImageBuffer<Rgb<u8>, Vec<u8>> = resize(&picture, width, height, FilterType::Triangle);
    small
}

/// The parts of a path as parts of a URL.
fn url(path: &str) -> String {
    path.split('/').map(|part| utf8_percent_encode(part, ENCODED).to_string()).collect::<Vec<_>>().join("/")
}

/// The URL of the folder `to` from a page in the folder `from`, with a slash at its end; empty for the same folder. Links in the paths
/// are followed where the folders are there.
fn relative_url(from: &Path, to: &Path) -> String {
    let [from, to] = [from, to].map(|path| {
        let whole = path.canonicalize().or_else(|_| std::path::absolute(path));
        whole.unwrap_or_else(|_| path.to_owned())
    });
    let parts = |path: &Path| -> Vec<String> {
        path.components().map(|part| part.as_os_str().to_string_lossy().into_owned()).collect()
    };
    let (from, to) = (parts(&from), parts(&to));
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let up = std::iter::repeat_n("..".to_owned(), from.len() - common);
    let down = to[common..].iter().map(|part| utf8_percent_encode(part, ENCODED).to_string());
    up.chain(down).map(|part| part + "/").collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Completeness, Identical, RatedPair};
    use vernis_metric::brdf::BrdfSource;

    #[test]
    fn links_lead_from_the_page_to_the_stimuli() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["out/page", "out/stimuli", "a b#c?%"] {
            std::fs::create_dir_all(dir.path().join(name)).unwrap();
        }
        let link = |from: &str, to: &str| relative_url(&dir.path().join(from), &dir.path().join(to));
        assert_eq!(link("out", "out/stimuli"), "stimuli/");
        assert_eq!(link("out/page", "out/stimuli"), "../stimuli/");
        assert_eq!(link("out/page", "out/page/../stimuli"), "../stimuli/");
        assert_eq!(link("out/page", "a b#c?%"), "../../a%20b%23c%3F%25/");
        assert_eq!(link("out", "out"), "");
        assert_eq!(url("chrome/A_B+1.2"), "chrome/A_B%2B1.2");
    }

    #[test]
    fn thumbnails_keep_their_shape_and_grow_never() {
        let size = |width, height| {
            let small = shrunk(RgbImage::from_pixel(width, height, Rgb([10, 20, 30])));
            assert!(small.pixels().all(|p| p.0 == [10, 20, 30]));
            [small.width(), small.height()]
        };
        assert_eq!(size(580, 900), [116, 180]);
        assert_eq!(size(1160, 900), [116, 90]);
        assert_eq!(size(24, 36), [24, 36]);
        assert_eq!(size(5000, 1), [116, 1]);
    }

    #[test]
    fn rows_of_the_same_names_keep_their_order() {
        let source = || BrdfSource::Notation("a.json".into());
        let pair = |material: &str| RatedPair {
            reference: source(),
            candidate: source(),
            material: material.into(),
            group: material.into(),
            method: "m".into(),
            method_family: "m".into(),
            material_type: None,
            mos: 3.0,
            weight: 1.0,
        };
        let study = Study {
            name: "test".into(),
            synthetic: false,
            completeness: Completeness { found: 4, known: 4 },
            scale: RatingScale::GRADES,
            identical: Identical::default(),
            files: Vec::new(),
            pairs: ["a", "b", "a", "a"].map(pair).to_vec(),
        };
        let row = |(material, mos): (&str, f64)| PredictionRecord {
            material: material.into(),
            group: material.into(),
            method: "m".into(),
            method_family: "m".into(),
            mos,
            predicted: BTreeMap::new(),
            distances: BTreeMap::new(),
        };
        let rows = [("a", 1.0), ("a", 2.0), ("c", 3.0), ("b", 4.0)].map(row);
        let found: Vec<Option<f64>> = rows_of(&study, &rows).into_iter().map(|row| row.map(|row| row.mos)).collect();
        assert_eq!(found, [Some(1.0), Some(4.0), Some(2.0), None]);
    }

    #[test]
    fn a_gallery_of_simulated_observers_says_so() {
        let page = |synthetic| {
            let gallery = Gallery {
                study: "a study".into(),
                synthetic,
                scale: RatingScale::GRADES,
                pictures: Vec::new(),
                scenes: Vec::new(),
                columns: Vec::new(),
                seen: vec!["seen < all".into()],
                provenance: Vec::new(),
                places: BTreeMap::new(),
            };
            crate::report::page::gallery::page(&gallery).unwrap()
        };
        // In the title, the heading, and a banner.
        assert_eq!(page(true).matches("SYNTHETIC observers").count(), 3);
        let people = page(false);
        assert!(!people.contains("SYNTHETIC") && people.contains("seen &lt; all"));
    }

    #[test]
    fn settings_are_told_as_far_as_they_are_known() {
        let mut sidecar = Sidecar {
            format: 2,
            identity: String::new(),
            brdf: "a".into(),
            content: String::new(),
            camera: "test".into(),
            size: [580, 900],
            samples: 1,
            bounces: 8,
            seed: 0,
            tone: Some("exrdisplay".into()),
            gamma: Some(1.0 / 2.2),
            exposure: Some(0.5),
            tabulation_error: None,
            exr: String::new(),
            png: String::new(),
        };
        assert_eq!(
            settings_of(&sidecar),
            "580x900 pixels, 1 sample a pixel, at most 8 bounces, tone curve exrdisplay with the power 0.4545, exposure +0.5 f-stops"
        );
        (sidecar.tone, sidecar.gamma, sidecar.exposure) = (None, None, None);
        assert_eq!(settings_of(&sidecar), "580x900 pixels, 1 sample a pixel, at most 8 bounces");
    }
}
