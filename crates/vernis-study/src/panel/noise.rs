//! What the noise of the ratings leaves for any metric to reach.
//!
//! A mean of n scores misses the true mean t by an error of variance a (t - 1)(5 - t)/n (see [`super::sos`]), so that even a metric
//! that knows t does not correlate perfectly with the ratings. By simulation: with V the variance of the study's means and N that
//! of their errors, the true means are drawn in to t = m + sqrt((V - N)/V) (x - m), m the mean of the means x, for their variance
//! is V - N; a panel is t plus normal errors, cut to 1..5; the bound is the correlation of t and the panel, a mean over panels. Its
//! interval is that of single panels, each on resampled groups of materials. Cost: simulations x stimuli, in parallel, the same
//! bytes whatever the number of threads.

use super::error::{StudyError, at_least};
use super::moments::Moments;
use super::record::{Spread, StudyRecord};
use super::sos::{ASSUMED_A, ASSUMED_RATERS, parabola};
use rand::Rng;
use serde::{Deserialize, Serialize};
use vernis_metric::math::correlation::{CorrelationError, Ranking, pearson_counted, spearman_counted};
use vernis_metric::math::parallel;
use vernis_metric::math::quantile::Interval;
use vernis_metric::math::resampling::{Resamples, rows_by_name};
use vernis_metric::math::seed;

/// How the bound is simulated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseOptions {
    /// Of the SOS model; `None`: that of the study's scores, else [`ASSUMED_A`].
    pub a: Option<f64>,
    /// Scores of each stimulus; `None`: those that the study has, else [`ASSUMED_RATERS`].
    pub raters: Option<f64>,
    /// Simulated panels.
    pub simulations: usize,
    /// Of panels and resamples.
    pub seed: u64,
}

/// The bound that noise puts on any metric.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NoiseBound {
    /// Name of the study.
    pub study: String,
    /// Ratings come from simulated observers.
    pub synthetic: bool,
    /// Rated stimuli, without hidden references.
    pub stimuli: usize,
    /// Groups of materials.
    pub groups: usize,
    /// Of the SOS model.
    pub a: f64,
    /// Whether `a` is that of the study's own scores.
    pub a_is_found: bool,
    /// Scores of each stimulus.
    pub raters: f64,
    /// Variance of the means, in grades squared.
    pub variance: f64,
    /// Variance of their errors, the mean over stimuli, in grades squared.
    pub noise: f64,
    /// Of Pearson's correlation.
    pub plcc: Bound,
    /// Of Spearman's correlation.
    pub srocc: Bound,
    /// Simulated panels.
    pub simulations: usize,
    /// Of panels and resamples.
    pub seed: u64,
}

/// The mean over panels and the central 95 % of single ones.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bound {
    /// The mean over panels.
    pub value: f64,
    /// 95 % of panels on resampled materials.
    pub interval: Interval,
}

/// The bound on the study of `record`.
///
/// # Errors
/// Fewer than three stimuli, a scale without a worst end, one group of materials, fewer simulations than an interval needs, means
/// that differ by no more than
/// their noise.
pub fn bound(record: &StudyRecord, options: &NoiseOptions) -> Result<NoiseBound, StudyError> {
    let rated: Vec<_> = record.opinions.iter().filter(|o| !o.stimulus.is_reference()).collect();
    at_least("rated stimuli", rated.len(), 3)?;
    if record.scale.is_open() {
        return Err(StudyError::OpenScale);
    }
    let found = record.sos.as_ref().filter(|_| record.spread == Spread::Scores).map(|sos| sos.a);
    let a = options.a.or(found).unwrap_or(ASSUMED_A);
    let counted = record.panel.as_ref().and_then(|panel| panel.raters_each).map(|each| each.mean);
    let raters = options.raters.or(counted).unwrap_or(ASSUMED_RATERS as f64);
    let means: Vec<f64> = rated.iter().map(|o| record.scale.grade(o.opinion.mos)).collect();
    let noise = means.iter().map(|&x| a * parabola(x) / raters).sum::<f64>() / means.len() as f64;
    let none = StudyError::NoSpread { what: "the mean opinion scores, beyond their noise," };
    let Some(Moments { mean, variance: Some(variance), .. }) = Moments::of(&means) else { return Err(none) };
    if variance <= noise {
        return Err(none);
    }
    let drawn_in = ((variance - noise) / variance).sqrt();
    let truth: Vec<f64> = means.iter().map(|x| (mean + drawn_in * (x - mean)).clamp(1.0, 5.0)).collect();
    let groups = rows_by_name(rated.iter().map(|o| o.stimulus.group.as_str()));
    let resamples = Resamples::draw(&groups, options.simulations, options.seed, "noise bound")?;
    let (ranking, ones) = (Ranking::of(&truth), vec![1; truth.len()]);
    let simulate = |index: usize| -> Result<([f64; 2], Option<[f64; 2]>), CorrelationError> {
        let mut rng = seed::stream(options.seed, "noise panel", index as u64);
        let score = |&t: &f64| (t + (a * parabola(t) / raters).sqrt() * normal(&mut rng)).clamp(1.0, 5.0);
        let panel: Vec<f64> = truth.iter().map(score).collect();
        let order = Ranking::of(&panel);
        let of = |counts: &[u32]| {
            Ok([pearson_counted(&truth, &panel, counts)?, spearman_counted(&ranking, &order, counts)?])
        };
        // A resample of one material with equal ratings has no correlation.
        Ok((of(&ones)?, of(&resamples.counts()[index]).ok()))
    };
    let panels = parallel::try_map(resamples.counts().len(), simulate)?;
    let bound = |k: usize| {
        let value = panels.iter().map(|(whole, _)| whole[k]).sum::<f64>() / panels.len() as f64;
        let single: Vec<f64> = panels.iter().filter_map(|(_, resampled)| Some((*resampled)?[k])).collect();
        let interval = Interval::percentile(single).ok_or(StudyError::NoSpread { what: "the resampled scores" })?;
        Ok::<_, StudyError>(Bound { value, interval })
    };
    Ok(NoiseBound {
        study: record.study.clone(),
        synthetic: record.synthetic,
        stimuli: means.len(),
        groups: groups.len(),
        a,
        a_is_found: options.a.is_none() && found.is_some(),
        raters,
        variance,
        noise,
        plcc: bound(0)?,
        srocc: bound(1)?,
        simulations: options.simulations,
        seed: options.seed,
    })
}

/// A standard normal number (Box & Muller 1958, doi:10.1214/aoms/1177706645).
fn normal(rng: &mut impl Rng) -> f64 {
    let (u, v): (f64, f64) = (rng.random(), rng.random());
    // 1 - u lies in (0, 1], where the logarithm is finite.
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::opinions::{Scores, Stimulus, StudyOpinions};
    use crate::dataset::{Completeness, StudyFile};
    use crate::panel::{Options, describe};
    use vernis_metric::math::rating_scale::RatingScale;

    /// `stimuli` means, spread evenly from `low` to `high`, of ten materials.
    fn record(stimuli: usize, low: f64, high: f64) -> StudyRecord {
        let stimulus = |i: usize| Stimulus {
            material: format!("m{}", i % 10),
            method: format!("k{}", i / 10),
            method_family: format!("k{}", i / 10),
            illumination: None,
            group: format!("m{}", i % 10),
            material_type: None,
        };
        let means = (0..stimuli).map(|i| low + (high - low) * (i as f64 + 0.5) / stimuli as f64).collect();
        let opinions = StudyOpinions {
            name: "even".into(),
            synthetic: false,
            completeness: Completeness { found: stimuli, known: stimuli },
            scale: RatingScale::GRADES,
            files: Vec::<StudyFile>::new(),
            stimuli: (0..stimuli).map(stimulus).collect(),
            scores: Scores::Means(means),
        };
        describe(&opinions, &Options { resamples: 40, splits: 2, ..Options::default() }).unwrap()
    }

    const OPTIONS: NoiseOptions = NoiseOptions { a: None, raters: None, simulations: 400, seed: 1 };

    #[test]
    fn the_bound_is_the_root_of_the_signal() {
        // Means 2 to 4, uniform: V = 1/3, N = 0.2 (4 - 1/3)/30 = 0.0244; a metric that knows the truth reaches sqrt((V - N)/V).
        let found = bound(&record(1000, 2.0, 4.0), &OPTIONS).unwrap();
        let expected = ((found.variance - found.noise) / found.variance).sqrt();
        assert!((found.variance - 1.0 / 3.0).abs() < 1e-3 && (found.noise - 0.0244).abs() < 1e-3, "{found:?}");
        assert!((found.plcc.value - expected).abs() < 2e-3, "{found:?} {expected}");
        assert!(found.plcc.interval.contains(found.plcc.value) && found.srocc.interval.contains(found.srocc.value));
        assert!((found.a, found.raters, found.a_is_found) == (ASSUMED_A, 30.0, false));
        // Fewer raters, more noise, a lower bound.
        let fewer = bound(&record(1000, 2.0, 4.0), &NoiseOptions { raters: Some(5.0), ..OPTIONS }).unwrap();
        let expected = ((fewer.variance - fewer.noise) / fewer.variance).sqrt();
        assert!((fewer.plcc.value - expected).abs() < 0.01 && fewer.plcc.value < found.plcc.value - 0.05, "{fewer:?}");
        let none = bound(&record(1000, 2.0, 4.0), &NoiseOptions { a: Some(0.0), ..OPTIONS }).unwrap();
        assert!((none.plcc.value - 1.0).abs() < 1e-12 && (none.srocc.value - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_seed_decides_and_threads_change_nothing() {
        let record = record(60, 1.5, 4.5);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let first = one.install(|| bound(&record, &OPTIONS)).unwrap();
        assert_eq!(first, bound(&record, &OPTIONS).unwrap());
        assert_ne!(first.plcc, bound(&record, &NoiseOptions { seed: 2, ..OPTIONS }).unwrap().plcc);
    }

    #[test]
    fn means_that_are_only_noise_are_refused() {
        assert!(matches!(bound(&record(20, 2.99, 3.01), &OPTIONS), Err(StudyError::NoSpread { .. })));
        assert!(bound(&record(60, 1.5, 4.5), &NoiseOptions { simulations: 39, ..OPTIONS }).is_err());
    }
}
