//! The metric: pictures of the reference once, pictures of candidates as they come.

use super::FAMILY;
use super::setting::{Cameras, Named, Setting, parse};
use crate::metric::{Conditions, ImageMetric, Prepared, Ssim, Values};
use crate::picture::{EncodedPicture, Encoding, Picture};
use crate::scene::study::{self, View};
use crate::scene::{Reflectance, SceneError};
use crate::trace::{self, TraceError, Tracer};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use vernis_metric::brdf::models::Lambert;
use vernis_metric::brdf::{Brdf, ContentHash};
use vernis_metric::descriptor::{Cache, CacheWarning};
use vernis_metric::io::silent;
use vernis_metric::metric::{Measured, Metric, MetricError, PreparedMetric, PreparedShare, Properties, Share, Side};

/// Of how pictures are made and compared here; tracer and metric on pictures have versions of their own.
const VERSION: u32 = 1;
/// cd/m2 of radiance 1 for metrics that take light: 0.18, middle grey, is shown as 18 cd/m2.
const LIGHT: f32 = 100.0;

/// A metric on BRDFs by what they look like; [`super`] describes its names.
#[derive(Clone)]
pub struct StimulusMetric {
    name: String,
    version: String,
    image: Arc<dyn ImageMetric>,
    cameras: Cameras,
    setting: Setting,
    conditions: Conditions,
    common: Arc<Common>,
}

/// What all metrics of a registry have in common.
struct Common {
    data: Option<PathBuf>,
    conditions: Conditions,
    /// By setting.
    stages: Mutex<BTreeMap<String, Arc<Stage>>>,
    cache: Mutex<Option<Cache>>,
}

/// A scene that waits for its BRDF.
struct Stage {
    tracer: Tracer,
    /// Of the scene without BRDF and camera, and of the tracer.
    identity: String,
}

/// A view of a BRDF as it is traced.
struct Seen {
    tracer: Tracer,
    content: ContentHash,
}

impl StimulusMetric {
    /// The family by its plainest member, `stimulus`, which is `stimulus[ssim]`.
    pub fn base(data: Option<&Path>, conditions: Conditions) -> Self {
        let common = Common {
            data: data.map(Path::to_owned),
            conditions: conditions.clone(),
            stages: Mutex::default(),
            cache: Mutex::default(),
        };
        let image: Arc<dyn ImageMetric> = Arc::new(Ssim(Values::LumaRec601));
        Self {
            name: FAMILY.to_owned(),
            version: version(&*image),
            image,
            cameras: Cameras::Same,
            setting: Setting::of_study(data),
            conditions,
            common: Arc::new(common),
        }
    }

    /// The same for another metric on pictures, under its shortest name.
    pub fn with(&self, image: Arc<dyn ImageMetric>, cameras: Cameras) -> Self {
        let name = match cameras {
            Cameras::Same => format!("{FAMILY}[{}]", image.name()),
            other => format!("{FAMILY}[{},camera={}]", image.name(), other.name()),
        };
        Self { name, version: version(&*image), image, cameras, ..self.clone() }
    }

    /// The metric on pictures.
    pub fn image(&self) -> &Arc<dyn ImageMetric> {
        &self.image
    }

    /// From where the BRDFs are seen.
    pub fn cameras(&self) -> Cameras {
        self.cameras
    }

    /// How pictures are made.
    pub fn setting(&self) -> &Setting {
        &self.setting
    }

    /// What tells settings apart; files by their names.
    fn key(&self) -> String {
        let Setting { light, shape, film, .. } = &self.setting;
        format!("{light:?} {shape:?} {film:?}")
    }

    /// The scene of the setting, made once for all metrics.
    fn stage(&self) -> Result<Arc<Stage>, MetricError> {
        // Held while a scene is built: whoever asks for the same waits instead of building it again.
        let mut stages = self.common.stages.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(match stages.entry(self.key()) {
            Entry::Occupied(known) => known.get().clone(),
            Entry::Vacant(place) => place.insert(Arc::new(self.build()?)).clone(),
        })
    }

    fn build(&self) -> Result<Stage, MetricError> {
        let not_computed = |reason: String| MetricError::NotComputed { metric: self.name.clone(), reason };
        let unusable = |e: SceneError| not_computed(e.to_string());
        let light = self.setting.light.light().map_err(unusable)?;
        let shape = self.setting.shape.shape().map_err(unusable)?;
        let black = Reflectance::Brdf(Arc::new(Lambert { kd: [0.0; 3] }), ContentHash([0; 32]));
        let scene = study::scene(black, shape, light, View::Test, self.setting.film);
        let tracer = Tracer::new(&scene).map_err(|e| not_computed(e.to_string()))?;
        Ok(Stage { tracer, identity: format!("{} {}", trace::VERSION, scene.identity()) })
    }

    fn encoding(&self) -> Encoding {
        let takes_codes = self.image.properties().encodings.contains(&Encoding::Srgb);
        if takes_codes { Encoding::Srgb } else { Encoding::Linear }
    }
}

fn version(image: &dyn ImageMetric) -> String {
    format!("{VERSION}.{}.{}", trace::VERSION, image.version())
}

impl Metric for StimulusMetric {
    fn name(&self) -> &str {
        &self.name
    }

    fn version(&self) -> &str {
        &self.version
    }

    fn properties(&self) -> Properties {
        let of_image = self.image.properties();
        let seen = match self.cameras {
            Cameras::Same => "by the same camera",
            Cameras::Offset => "by the study's two cameras; identical BRDFs are not 0",
            Cameras::OffsetMinusHidden => "by the study's two cameras, less the value of the hidden reference",
        };
        Properties {
            family: FAMILY,
            unit: of_image.unit,
            summary: format!("{} of pictures in the study's scene, {seen}", self.image.name()),
            source: of_image.source,
            ..Properties::default()
        }
    }

    fn prepare(&self, reference: &dyn Brdf) -> Result<Box<dyn PreparedMetric>, MetricError> {
        Ok(Box::new(Alone(Together::new(vec![self.clone()], reference)?)))
    }

    fn identity(&self) -> String {
        let Setting { tone, exposure, .. } = self.setting;
        let Conditions { ppd, display, .. } = &self.conditions;
        // A scene that cannot be read ends whatever would use the identity.
        let scene = self.stage().map_or_else(|_| self.key(), |stage| stage.identity.clone());
        let given = self.conditions.contents(&self.image.properties().needs);
        let given = if given.is_empty() { given } else { format!(" {given}") };
        format!("{} {} {scene} {tone:?} {exposure:?} {ppd:?} {display:?}{given}", self.name, self.version)
    }

    fn share(&self) -> Option<Share> {
        let Setting { tone, exposure, .. } = self.setting;
        let name = format!("{FAMILY} {} {tone:?} {exposure:?}", self.key());
        Some(Share::new(name, self.clone(), |parts, reference| Ok(Box::new(Together::new(parts, reference)?))))
    }

    fn member(&self, name: &str) -> Result<Arc<dyn Metric>, MetricError> {
        let Named { image, cameras, setting, ppd, display } = parse(name, self.common.data.as_deref())?;
        let conditions = Conditions { ppd, display, ..self.common.conditions.clone() };
        if !image.properties().needs.iter().all(|need| conditions.meet(*need)) {
            return Err(MetricError::Parameter {
                what: name.to_owned(),
                found: format!("without the files that {} needs", image.name()),
                allowed:
                    "given a folder that has them, with --weights or VERNIS_WEIGHTS; `vernis data weights` lists them"
                        .to_owned(),
            });
        }
        let metric = Self {
            name: name.to_owned(),
            version: version(&*image),
            image,
            cameras,
            setting,
            conditions,
            common: self.common.clone(),
        };
        // What is wrong with light and shape is said before the first BRDF.
        metric.stage()?;
        Ok(Arc::new(metric))
    }

    fn warm_up(&self, cache: &Cache) -> Option<CacheWarning> {
        *self.common.cache.lock().unwrap_or_else(PoisonError::into_inner) = Some(cache.clone());
        None
    }
}

/// A pair of pictures by one metric.
struct Comparison {
    prepared: Prepared,
    encoding: Encoding,
    /// The distance of the hidden reference.
    hidden: f64,
}

/// All metrics of one setting with one reference.
struct Together {
    /// One of them, for scene and tone.
    first: StimulusMetric,
    comparisons: Vec<Comparison>,
    /// A metric each: which comparison, and whether that of the hidden reference is taken away.
    columns: Vec<(usize, bool)>,
}

impl Together {
    fn new(parts: Vec<StimulusMetric>, reference: &dyn Brdf) -> Result<Self, MetricError> {
        let Some(first) = parts.first().cloned() else {
            return Err(MetricError::NotComputed { metric: FAMILY.to_owned(), reason: "no metric".to_owned() });
        };
        let seen = first.seen(reference, Side::Reference)?;
        let hidden = first.picture(&seen, Side::Reference)?;
        let offset = parts.iter().any(|part| part.cameras != Cameras::Same);
        let own = if offset {
            let Seen { tracer, content } = seen;
            let seen =
                Seen { tracer: first.traced(tracer.seen_by(View::Reference.camera()), Side::Reference)?, content };
            Some(first.picture(&seen, Side::Reference)?)
        } else {
            None
        };
        let mut places: BTreeMap<String, usize> = BTreeMap::new();
        let (mut comparisons, mut columns) = (Vec::new(), Vec::new());
        for part in &parts {
            let same = part.cameras == Cameras::Same;
            let Conditions { ppd, display, .. } = &part.conditions;
            let key = format!("{} {same} {ppd:?} {display:?}", part.image.name());
            let place = match places.get(&key) {
                Some(&place) => place,
                None => {
                    let encoding = part.encoding();
                    let shown = first.encoded(&hidden, encoding, Side::Reference)?;
                    let failed = |e: crate::metric::ImageMetricError| MetricError::NotComputed {
                        metric: part.name.clone(),
                        reason: e.to_string(),
                    };
                    let seen = match &own {
                        Some(own) if !same => first.encoded(own, encoding, Side::Reference)?,
                        _ => shown.clone(),
                    };
                    let prepared = part.image.prepare(&seen, &part.conditions).map_err(failed)?;
                    let hidden = if same { 0.0 } else { prepared.distance(&shown).map_err(failed)? };
                    comparisons.push(Comparison { prepared, encoding, hidden });
                    places.insert(key, comparisons.len() - 1);
                    comparisons.len() - 1
                }
            };
            columns.push((place, part.cameras == Cameras::OffsetMinusHidden));
        }
        Ok(Self { first, comparisons, columns })
    }

    fn distances(&self, candidate: &dyn Brdf) -> Result<Vec<f64>, MetricError> {
        let seen = self.first.seen(candidate, Side::Candidate)?;
        let picture = self.first.picture(&seen, Side::Candidate)?;
        let mut encoded: BTreeMap<&'static str, EncodedPicture> = BTreeMap::new();
        let mut found = Vec::with_capacity(self.comparisons.len());
        for comparison in &self.comparisons {
            let key = comparison.encoding.words();
            if !encoded.contains_key(key) {
                encoded.insert(key, self.first.encoded(&picture, comparison.encoding, Side::Candidate)?);
            }
            let failed = |e: crate::metric::ImageMetricError| MetricError::Unusable {
                side: Side::Pair,
                reason: format!("{}: {e}", self.first.name),
            };
            found.push(comparison.prepared.distance(&encoded[key]).map_err(failed)?);
        }
        let column =
            |&(place, minus): &(usize, bool)| found[place] - if minus { self.comparisons[place].hidden } else { 0.0 };
        Ok(self.columns.iter().map(column).collect())
    }
}

impl PreparedShare for Together {
    fn measure(&self, candidate: &dyn Brdf) -> Result<Vec<Measured>, MetricError> {
        Ok(self.distances(candidate)?.into_iter().map(Measured::distance).collect())
    }
}

struct Alone(Together);

impl PreparedMetric for Alone {
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        // One part gives one column.
        Ok(self.0.distances(candidate)?[0])
    }
}

impl StimulusMetric {
    fn traced(&self, tracer: Result<Tracer, TraceError>, side: Side) -> Result<Tracer, MetricError> {
        tracer.map_err(|e| MetricError::Unusable { side, reason: e.to_string() })
    }

    /// By the candidate's camera.
    fn seen(&self, brdf: &dyn Brdf, side: Side) -> Result<Seen, MetricError> {
        let tracer = self.traced(self.stage()?.tracer.of_brdf(brdf, View::Test.camera()), side)?;
        let content = tracer.surface_content();
        Ok(Seen { tracer, content })
    }

    /// The picture, from the cache where it is there.
    fn picture(&self, seen: &Seen, side: Side) -> Result<Picture, MetricError> {
        let cache = self.common.cache.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let key = format!("stimulus {} {:?} {}", self.stage()?.identity, seen.tracer.camera(), seen.content);
        let [width, height] = [self.setting.film.width, self.setting.film.height];
        if let Some(bytes) = cache.as_ref().and_then(|cache| cache.load_bytes(&key)) {
            let (numbers, rest) = bytes.as_chunks::<12>();
            let channel =
                |b: &[u8; 12], c: usize| f32::from_le_bytes([b[4 * c], b[4 * c + 1], b[4 * c + 2], b[4 * c + 3]]);
            let pixels = numbers.iter().map(|b| [0, 1, 2].map(|c| channel(b, c))).collect();
            if let Some(picture) = Picture::new(width, height, pixels).filter(|_| rest.is_empty()) {
                return Ok(picture);
            }
        }
        let picture = seen.tracer.render(&silent).map_err(|e| MetricError::Unusable { side, reason: e.to_string() })?;
        if let Some(cache) = &cache {
            let bytes: Vec<u8> = picture.pixels().iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
            // What cannot be kept is rendered again.
            let _ = cache.store_bytes(&key, &bytes);
        }
        Ok(picture)
    }

    fn encoded(&self, picture: &Picture, encoding: Encoding, side: Side) -> Result<EncodedPicture, MetricError> {
        let Setting { tone, exposure, .. } = self.setting;
        let pixels: Vec<[f32; 3]> = match encoding {
            Encoding::Srgb => {
                let codes = tone.apply(picture, exposure);
                codes.as_chunks::<3>().0.iter().map(|code| code.map(f32::from)).collect()
            }
            Encoding::Linear => {
                let factor = LIGHT * (exposure as f32).exp2();
                picture.pixels().iter().map(|pixel| pixel.map(|v| factor * v)).collect()
            }
        };
        EncodedPicture::new(picture.width(), picture.height(), pixels, encoding)
            .map_err(|e| MetricError::Unusable { side, reason: e.to_string() })
    }
}
