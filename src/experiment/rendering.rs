//! How much of a distance between stimuli is the noise of rendering?
//!
//! The same pairs are rendered with several seeds. The noise of a distance is its standard deviation over the seeds, estimated on all
//! candidates of a reference; the gap of a candidate is the difference of its mean distance to that of the nearest other candidate of
//! the same reference. Where noise / gap is below a tenth, rendering does not decide which of the two is better.

use super::ExperimentError;
use super::losses::run::materials;
use crate::dataset::Study;
use crate::samples::further::further;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use vernis_metric::descriptor::{Cache, CacheWarning};
use vernis_metric::io::Observer;
use vernis_metric::math::quantile::quantile;
use vernis_metric::metric::Metric;

/// A noise below this share of a gap does not matter.
pub const SMALL: f64 = 0.1;

/// What is rendered.
pub struct RenderingOptions<'a> {
    /// Every metric by each seed.
    pub metrics: &'a [Vec<Arc<dyn Metric>>],
    /// References, one of each group of sisters.
    pub materials: usize,
    /// Of the order of the materials.
    pub seed: u64,
    /// Folder that relative sources are looked up in.
    pub data: Option<PathBuf>,
    /// Without a cache everything is rendered.
    pub cache: Option<Cache>,
}

/// The noise of one metric.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RenderingNoise {
    /// The metric, by its name with the first seed.
    pub metric: String,
    /// Candidates with a neighbour.
    pub candidates: usize,
    /// Median over references of the noise as a share of the mean distance.
    pub relative: f64,
    /// Median over candidates of noise / gap.
    pub median: f64,
    /// Share of candidates whose noise is below a tenth of the gap.
    pub small: f64,
}

/// The noise of each metric on the first `materials` of `study`.
///
/// # Errors
/// Fewer than two seeds; a BRDF that cannot be read or rendered.
pub fn rendering_noise(
    study: &Study,
    options: &RenderingOptions<'_>,
    progress: Observer<'_>,
) -> Result<(Vec<RenderingNoise>, Vec<CacheWarning>), ExperimentError> {
    let seeds = options.metrics.first().map_or(0, Vec::len);
    if seeds < 2 {
        return Err(ExperimentError::Setting { what: "the number of seeds", found: seeds, allowed: "at least 2" });
    }
    let chosen: BTreeSet<String> =
        materials(study, options.materials, options.seed).into_iter().map(|(material, _)| material).collect();
    let pairs = study.pairs.iter().filter(|pair| chosen.contains(&pair.material)).cloned().collect();
    let part = Study { pairs, ..study.clone() };
    let flat: Vec<Arc<dyn Metric>> = options.metrics.iter().flatten().cloned().collect();
    let told = |p| progress("pictures", p);
    let (samples, warnings) = further(&part, &flat, options.data.as_deref(), options.cache.as_ref(), &told)?;
    let references = part.by_reference();
    let of_metric = |(m, metric): (usize, &Vec<Arc<dyn Metric>>)| {
        let values =
            |row: usize| -> Vec<f64> { (0..seeds).map(|s| samples.features()[[row, m * seeds + s]]).collect() };
        let (mut relative, mut ratios) = (Vec::new(), Vec::new());
        for rows in &references {
            let of_rows: Vec<Vec<f64>> = rows.iter().map(|&row| values(row)).collect();
            let means: Vec<f64> = of_rows.iter().map(|v| v.iter().sum::<f64>() / seeds as f64).collect();
            let squares = of_rows.iter().zip(&means).flat_map(|(v, mean)| v.iter().map(move |x| (x - mean).powi(2)));
            let noise = (squares.sum::<f64>() / (rows.len() * (seeds - 1)) as f64).sqrt();
            relative.push(noise / (means.iter().sum::<f64>() / means.len() as f64).abs().max(f64::MIN_POSITIVE));
            for (k, mean) in means.iter().enumerate() {
                let others = means.iter().enumerate().filter(|(other, _)| *other != k);
                if let Some(gap) = others.map(|(_, other)| (other - mean).abs()).min_by(f64::total_cmp) {
                    ratios.push(if noise == 0.0 { 0.0 } else { noise / gap });
                }
            }
        }
        let median = |values: &mut Vec<f64>| {
            values.sort_by(f64::total_cmp);
            quantile(values, 0.5).unwrap_or(f64::NAN)
        };
        RenderingNoise {
            metric: metric.first().map_or(String::new(), |first| first.name().to_owned()),
            candidates: ratios.len(),
            relative: median(&mut relative),
            small: ratios.iter().filter(|ratio| **ratio < SMALL).count() as f64 / ratios.len().max(1) as f64,
            median: median(&mut ratios),
        }
    };
    Ok((options.metrics.iter().enumerate().map(of_metric).collect(), warnings))
}
