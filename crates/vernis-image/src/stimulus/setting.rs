//! How stimuli of a metric are made, and how a name says it.

use super::FAMILY;
use crate::display::Display;
use crate::display::tone::{DEFAULT_GAMMA, Tone};
use crate::metric::{ImageMetric, ImageRegistry};
use crate::scene::file::{film_allowed, is_film};
use crate::scene::study::{self, LightChoice, ShapeChoice};
use crate::scene::{Film, MOST_BOUNCES, MOST_SAMPLES};
use std::path::Path;
use std::sync::Arc;
use vernis_metric::io::{did_you_mean, nearest};
use vernis_metric::metric::MetricError;
use vernis_metric::metric::graph::Options;

/// Columns and rows: a third of the study's, the least that all metrics on pictures take.
const SIZE: [usize; 2] = [193, 300];
/// Samples a pixel.
const SAMPLES: usize = 64;
/// Surfaces of a path.
const BOUNCES: usize = 8;
/// The options, for messages.
const KNOWN: [&str; 13] = [
    "metric", "camera", "light", "shape", "size", "samples", "bounces", "seed", "tone", "gamma", "exposure", "ppd",
    "display",
];

/// From where reference and candidate are seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cameras {
    /// Both from the candidate's place.
    Same,
    /// Each from its own, as people saw them.
    Offset,
    /// As [`Cameras::Offset`], less the distance of the reference itself seen from the candidate's place.
    OffsetMinusHidden,
}

impl Cameras {
    /// All, the simplest first.
    pub const ALL: [Self; 3] = [Self::Same, Self::Offset, Self::OffsetMinusHidden];

    /// As options say it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::Offset => "offset",
            Self::OffsetMinusHidden => "offset-minus-hidden",
        }
    }

    fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|cameras| cameras.name() == name)
    }
}

/// What pictures depend on beside the BRDF and the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// The light.
    pub light: LightChoice,
    /// The shape on the table.
    pub shape: ShapeChoice,
    /// Size, samples, bounces, seed.
    pub film: Film,
    /// What the screen shows of the radiance.
    pub tone: Tone,
    /// In f-stops, before the tone curve.
    pub exposure: f64,
}

impl Setting {
    /// That of the study, as far as the data folder has it.
    pub fn of_study(data: Option<&Path>) -> Self {
        let [width, height] = SIZE;
        Self {
            light: LightChoice::default_of(data),
            shape: ShapeChoice::default_of(data),
            film: Film { width, height, samples: SAMPLES, bounces: BOUNCES, seed: 0 },
            tone: Tone::ExrDisplay { gamma: DEFAULT_GAMMA },
            exposure: 0.0,
        }
    }
}

/// The metric on pictures and the cameras of a name that says no more, such as `stimulus[ssim,camera=offset]`; `None` for other names.
pub fn plain(name: &str) -> Option<(&str, Cameras)> {
    let inner = name.strip_prefix(FAMILY)?.strip_prefix('[')?.strip_suffix(']')?;
    match inner.split_once(',') {
        None => (!inner.contains('=')).then_some((inner, Cameras::Same)),
        Some((metric, rest)) => Some((metric, Cameras::named(rest.strip_prefix("camera=")?)?)),
    }
}

/// All that a name says.
pub(super) struct Named {
    pub image: Arc<dyn ImageMetric>,
    pub cameras: Cameras,
    pub setting: Setting,
    pub ppd: Option<f64>,
    pub display: Option<Display>,
}

fn wrong(name: &str, key: &str, found: &str, allowed: impl Into<String>) -> MetricError {
    MetricError::Parameter { what: format!("{name}: {key}"), found: found.to_owned(), allowed: allowed.into() }
}

/// Reads `stimulus[METRIC,KEY=VALUE,...]`.
pub(super) fn parse(name: &str, data: Option<&Path>) -> Result<Named, MetricError> {
    // The metric stands first, with or without its key.
    let (family, inner) = name.split_once('[').unwrap_or((name, ""));
    let first = inner.split([',', ']']).next().unwrap_or_default().trim();
    let whole =
        if first.is_empty() || first.contains('=') { name.to_owned() } else { format!("{family}[metric={inner}") };
    let (_, mut options) = Options::split(&whole)?;
    let metric = options.take("metric");
    let metric = metric.ok_or_else(|| {
        let found = if first.is_empty() { "nothing" } else { first };
        wrong(name, "the first entry", found, "a metric on pictures, as in stimulus[ssim,camera=offset]")
    })?;
    let images = ImageRegistry::standard();
    let image = images.get(metric).map_err(|_| {
        let nearest = did_you_mean(&nearest(metric, images.names()));
        wrong(name, "the metric on pictures", metric, format!("one that `vernis metrics` lists; {nearest}"))
    })?;
    let mut setting = Setting::of_study(data);
    let cameras = match options.take("camera") {
        None => Cameras::Same,
        Some(text) => Cameras::named(text)
            .ok_or_else(|| wrong(name, "camera", text, Cameras::ALL.map(Cameras::name).join(", ")))?,
    };
    if let Some(text) = options.take("light") {
        let probe = |file: &str| {
            let path = data.map(|data| data.join(file)).filter(|path| path.is_file());
            let allowed = format!("a light that is there; the data folder has no {file}");
            path.map(LightChoice::Probe).ok_or_else(|| wrong(name, "light", text, allowed))
        };
        setting.light = match text {
            "study" => setting.light,
            "grace" => probe(study::PROBE)?,
            "uffizi" => probe(study::SECOND_PROBE)?,
            "white" => LightChoice::White,
            "lamps" => LightChoice::Lamps,
            path => LightChoice::Probe(path.into()),
        };
    }
    if let Some(text) = options.take("shape") {
        setting.shape = match text {
            "study" => setting.shape,
            "sphere" => ShapeChoice::Sphere,
            "blob" => ShapeChoice::Blob,
            path => ShapeChoice::Mesh(path.into()),
        };
    }
    if let Some(text) = options.take("size") {
        let sides = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
        let sides = sides.filter(|sides| is_film(*sides));
        let [width, height] = sides.ok_or_else(|| wrong(name, "size", text, format!("WxH: {}", film_allowed())))?;
        (setting.film.width, setting.film.height) = (width, height);
    }
    let mut count = |key: &str, low: usize, high: usize, place: &mut usize| match options.take(key) {
        None => Ok(()),
        Some(text) => {
            let number = text.parse().ok().filter(|n| (low..=high).contains(n));
            *place = number.ok_or_else(|| wrong(name, key, text, format!("a whole number from {low} to {high}")))?;
            Ok(())
        }
    };
    count("samples", 1, MOST_SAMPLES, &mut setting.film.samples)?;
    count("bounces", 1, MOST_BOUNCES, &mut setting.film.bounces)?;
    if let Some(text) = options.take("seed") {
        let seed = text.parse().map_err(|_| wrong(name, "seed", text, "a whole number from 0 to 2^64 - 1"))?;
        setting.film.seed = seed;
    }
    let gamma = options.number("gamma", |g| (0.05..=10.0).contains(&g), "0.05 to 10")?;
    setting.tone = match (options.take("tone"), gamma) {
        (None | Some("exrdisplay"), gamma) => Tone::ExrDisplay { gamma: gamma.unwrap_or(DEFAULT_GAMMA) },
        (Some("srgb"), None) => Tone::Srgb,
        (Some("none"), None) => Tone::Linear,
        (Some("srgb" | "none"), Some(gamma)) => {
            return Err(wrong(name, "gamma", &gamma.to_string(), "left out: it is the power of tone=exrdisplay"));
        }
        (Some(text), _) => return Err(wrong(name, "tone", text, "exrdisplay, srgb or none")),
    };
    if let Some(exposure) = options.number("exposure", |x| x.abs() <= 100.0, "-100 to 100 f-stops")? {
        setting.exposure = exposure;
    }
    let ppd = options.number("ppd", |x| (1.0..=1000.0).contains(&x), "1 to 1000 pixels a degree")?;
    let display = match options.take("display") {
        None => None,
        Some(text) => {
            let allowed = || Display::ALL.map(Display::name).join(", ");
            Some(Display::named(text).ok_or_else(|| wrong(name, "display", text, allowed()))?)
        }
    };
    options.finish(&KNOWN)?;
    Ok(Named { image, cameras, setting, ppd, display })
}
