//! Metrics on BRDFs that judge what people would see: both are rendered in the study's scene, and a metric on pictures compares them.
//!
//! `stimulus[METRIC,KEY=VALUE,...]`, such as `stimulus[icid-cielab,camera=offset,light=uffizi]`. Options, with their defaults:
//!
//! | option | values | default |
//! | --- | --- | --- |
//! | `camera` | `same`: both by the camera of candidates; `offset`: the reference by its own camera, turned by 4 degrees, as people saw it; `offset-minus-hidden`: the same, less the distance of the reference in the candidate's camera | `same` |
//! | `light` | `study` (Grace of the data folder, else lamps), `grace`, `uffizi`, `white`, `lamps`, or a probe (.hdr) | `study` |
//! | `shape` | `study` (the Buddha of the data folder, else blob), `sphere`, `blob`, or a mesh (.ply, .obj) | `study` |
//! | `size` | columns x rows | 193x300, a third of the study's |
//! | `samples`, `bounces`, `seed` | of the path tracer | 64, 8, 0 |
//! | `tone`, `gamma`, `exposure` | what the screen shows: `exrdisplay`, `srgb`, `none` | `exrdisplay`, 1/2.2, 0 |
//! | `ppd`, `display` | of the metric on pictures | its own |
//!
//! A metric that takes sRGB codes gets those of the tone curve; one that takes light alone gets the radiance times 100 cd/m2 and 2^exposure.
//! Only with `camera=same` is the distance of identical BRDFs 0. With `offset-minus-hidden` it may be negative. The seed is the same for
//! both pictures, so that much of the noise is the same in both.
//!
//! Metrics of one setting share their pictures. Pictures are kept in the cache under what the surface reflects: a picture depends on
//! nothing else but the scene.
//!
//! Source: G. Lavoué et al. 2021, doi:10.1111/cgf.142636, sections 3.4 and 6.2.

mod metric;
mod setting;

pub use metric::StimulusMetric;
pub use setting::{Cameras, Setting, plain};

use crate::metric::{Conditions, ImageRegistry};
use crate::picture::Encoding;
use std::path::Path;
use std::sync::Arc;
use vernis_metric::metric::registry::Registry;
use vernis_metric::metric::{Metric, MetricError};

/// Family of these metrics.
pub const FAMILY: &str = "stimulus";

/// Names that stand for all metrics on pictures that take codes and have what they need, one a way to place the cameras.
pub const GROUPS: [(&str, Cameras); 3] = [
    ("all-stimulus", Cameras::Same),
    ("all-stimulus-offset", Cameras::Offset),
    ("all-stimulus-offset-minus-hidden", Cameras::OffsetMinusHidden),
];

/// Every metric of `vernis-metric`, and those on stimuli. `data` is the folder of the study's mesh and probes; `conditions` hold what
/// the user gives to metrics on pictures.
///
/// # Errors
/// Those of [`Registry::standard`].
pub fn registry(data: Option<&Path>, conditions: Conditions) -> Result<Registry, MetricError> {
    let mut registry = Registry::standard()?;
    let base = StimulusMetric::base(data, conditions.clone());
    for (group, cameras) in GROUPS {
        let metrics = ImageRegistry::standard().applicable(Encoding::Srgb, &conditions);
        let named = metrics.into_iter().map(|metric| Arc::new(base.with(metric, cameras)) as Arc<dyn Metric>);
        registry.add_group(group, named.collect())?;
    }
    registry.add(Arc::new(base))?;
    Ok(registry)
}
