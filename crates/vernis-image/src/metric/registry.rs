//! All metrics on pictures, by name.

use super::contract::{Conditions, ImageMetric, ImageMetricError, Need};
#[cfg(feature = "networks")]
use super::{Backbone, Lpips, MatSim, ShiftTolerant, StLpips};
use super::{
    Cid, Ciede2000, Cielab, Cvvdp, DeltaEItp, Flip, HdrFlip, HdrVdp, Icid, Mean, MsSsim, Psnr, Pu21Psnr, Pu21Ssim,
    Receptors, Ssim, Values,
};
use crate::picture::Encoding;
use std::sync::Arc;
use vernis_metric::io::nearest;

/// Metrics with unique names, in the order of lists.
#[derive(Clone)]
pub struct ImageRegistry {
    metrics: Vec<Arc<dyn ImageMetric>>,
}

impl ImageRegistry {
    /// Every metric of this library.
    pub fn standard() -> Self {
        let metrics: Vec<Arc<dyn ImageMetric>> = vec![
            Arc::new(Ssim(Values::LumaRec601)),
            Arc::new(Ssim(Values::LumaRec709)),
            Arc::new(Ssim(Values::Channels)),
            Arc::new(MsSsim),
            Arc::new(Psnr),
            Arc::new(Cielab(Mean::Arithmetic)),
            Arc::new(Cielab(Mean::Quadratic)),
            Arc::new(Ciede2000),
            Arc::new(DeltaEItp),
            Arc::new(Flip),
            Arc::new(HdrFlip),
            Arc::new(Pu21Psnr),
            Arc::new(Pu21Ssim),
            Arc::new(Cid { in_cielab: false }),
            Arc::new(Cid { in_cielab: true }),
            Arc::new(Icid::Lab2000Hl),
            Arc::new(Icid::InOctave),
            Arc::new(Icid::Cielab),
            Arc::new(HdrVdp(Receptors::Rgb)),
            Arc::new(HdrVdp(Receptors::Luminance)),
            Arc::new(Cvvdp),
            #[cfg(feature = "networks")]
            Arc::new(Lpips(Backbone::Alex)),
            #[cfg(feature = "networks")]
            Arc::new(Lpips(Backbone::Vgg)),
            #[cfg(feature = "networks")]
            Arc::new(Lpips(Backbone::Squeeze)),
            #[cfg(feature = "networks")]
            Arc::new(StLpips(ShiftTolerant::Alex)),
            #[cfg(feature = "networks")]
            Arc::new(StLpips(ShiftTolerant::Vgg)),
            #[cfg(feature = "networks")]
            Arc::new(MatSim),
        ];
        Self { metrics }
    }

    /// The metrics.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<dyn ImageMetric>> {
        self.metrics.iter()
    }

    /// Their names.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.metrics.iter().map(|metric| metric.name())
    }

    /// The metric called `name`.
    ///
    /// # Errors
    /// [`ImageMetricError::Unknown`] with the nearest names.
    pub fn get(&self, name: &str) -> Result<Arc<dyn ImageMetric>, ImageMetricError> {
        let found = self.metrics.iter().find(|metric| metric.name() == name);
        found
            .cloned()
            .ok_or_else(|| ImageMetricError::Unknown { name: name.to_owned(), nearest: nearest(name, self.names()) })
    }

    /// The metrics that take pictures of this encoding and have what they need: with a table those that need one, without it those
    /// that stand in for them; networks whose weights are in the user's folder.
    pub fn applicable(&self, encoding: Encoding, conditions: &Conditions) -> Vec<Arc<dyn ImageMetric>> {
        let fallbacks: Vec<&str> =
            self.metrics.iter().flat_map(|metric| metric.properties().needs).filter_map(fallback).collect();
        let fits = |metric: &&Arc<dyn ImageMetric>| {
            let properties = metric.properties();
            let stands_in = conditions.table.is_some() && fallbacks.contains(&metric.name());
            let met = properties.needs.iter().all(|need| conditions.meet(*need));
            properties.encodings.contains(&encoding) && met && !stands_in
        };
        self.metrics.iter().filter(fits).cloned().collect()
    }
}

fn fallback(need: Need) -> Option<&'static str> {
    match need {
        Need::Lab2000HlTable { fallback } => Some(fallback),
        Need::Ppd(_) | Need::Display | Need::Weights { .. } => None,
    }
}
