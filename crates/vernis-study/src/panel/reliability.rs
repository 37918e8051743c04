//! Whether another panel would say the same: agreement of split halves.
//!
//! The scores of every stimulus are shuffled and cut into two equal halves (of an odd number one is left out); the
//! mean scores of the halves are correlated over the stimuli, and this is repeated: Ghadiyaram & Bovik 2016
//! (doi:10.1109/TIP.2015.2500021), as in section 5.2 of Lavoue et al. 2021 (doi:10.1111/cgf.142636).
//!
//! Where a study has means alone, what to expect follows from their variance V and the variance N of their noise, the
//! mean of a (x - 1)(5 - x)/n (see [`super::sos`]): a half of the panel has noise 2 N, so that halves correlate with
//! (V - N)/(V + N), and the part (V - N)/V of V is signal, as an intra-class correlation ICC(1,k) has it.
//! Cost: splits x scores, in parallel, the same bytes whatever the number of threads.

use super::error::{StudyError, at_least};
use super::moments::{MeanAndDeviation, Moments};
use super::sos::parabola;
use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};
use vernis_metric::math::correlation::{CorrelationError, pearson, spearman};
use vernis_metric::math::parallel;
use vernis_metric::math::seed;

/// Agreement of random halves of the panel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SplitHalf {
    /// Number of random splits.
    pub splits: usize,
    /// Stimuli with at least two scores.
    pub stimuli: usize,
    /// Mean and standard deviation over the splits.
    pub pearson: MeanAndDeviation,
    /// Mean and standard deviation over the splits, of Spearman's rho.
    pub spearman: MeanAndDeviation,
}

/// Agreement of halves of the scores of each stimulus, over `splits` random splits.
pub fn split_half(scores: &[Vec<f64>], splits: usize, seed: u64) -> Result<SplitHalf, StudyError> {
    at_least("random splits", splits, 2)?;
    let usable: Vec<&Vec<f64>> = scores.iter().filter(|s| s.len() >= 2).collect();
    at_least("stimuli with at least 2 scores for split halves", usable.len(), 3)?;
    let split = |index: usize| -> Result<[f64; 2], CorrelationError> {
        let mut rng = seed::stream(seed, "split-half", index as u64);
        let (mut first, mut second) = (Vec::with_capacity(usable.len()), Vec::with_capacity(usable.len()));
        for scores in &usable {
            let mut shuffled = (*scores).clone();
            shuffled.shuffle(&mut rng);
            let half = shuffled.len() / 2;
            let mean = |s: &[f64]| s.iter().sum::<f64>() / half as f64;
            first.push(mean(&shuffled[..half]));
            second.push(mean(&shuffled[half..2 * half]));
        }
        Ok([pearson(&first, &second)?, spearman(&first, &second)?])
    };
    let found = parallel::try_map(splits, split)?;
    let over = |k: usize| {
        let values: Vec<f64> = found.iter().map(|f| f[k]).collect();
        MeanAndDeviation::of(&values).ok_or(StudyError::TooFew { what: "random splits", found: splits, least: 2 })
    };
    Ok(SplitHalf { splits, stimuli: usable.len(), pearson: over(0)?, spearman: over(1)? })
}

/// What the noise model says of means whose scores are not at hand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ExpectedReliability {
    /// Pearson correlation between halves of the panel.
    pub split_half_pearson: f64,
    /// Part of the variance of the MOS that is signal, comparable with ICC(1,k).
    pub signal: f64,
}

/// Expected reliability of mean opinion scores, each of `raters` scores with SOS parameter `a`.
pub fn expected(means: &[f64], a: f64, raters: usize) -> Result<ExpectedReliability, StudyError> {
    at_least("stimuli for a reliability", means.len(), 3)?;
    let noise = means.iter().map(|&x| a * parabola(x)).sum::<f64>() / (means.len() * raters) as f64;
    match Moments::of(means).and_then(|m| m.variance) {
        Some(v) if v > noise => {
            Ok(ExpectedReliability { split_half_pearson: (v - noise) / (v + noise), signal: (v - noise) / v })
        }
        _ => Err(StudyError::NoSpread { what: "the mean opinion scores, beyond their noise," }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;

    /// Scores 1 + 0.8 K, K binomial(5, p), whose variance is 0.2 (x - 1)(5 - x), for p spread evenly.
    fn panel(stimuli: usize, raters: usize) -> Vec<Vec<f64>> {
        let mut rng = seed::stream(4, "reliability", 0);
        let stimulus = |i: usize| {
            let p = 0.2 + 0.6 * i as f64 / stimuli as f64;
            let mut score = || 1.0 + 0.8 * f64::from((0..5).map(|_| u8::from(rng.random::<f64>() < p)).sum::<u8>());
            (0..raters).map(|_| score()).collect()
        };
        (0..stimuli).map(stimulus).collect()
    }

    #[test]
    fn halves_agree_as_their_signal_and_noise_say() {
        let scores = panel(600, 30);
        let found = split_half(&scores, 100, 1).unwrap();
        // True means 1.8 to 4.2, uniform: variance 0.48; noise of a half 0.2 mean((x-1)(5-x))/15 = 0.2 * 3.52/15 = 0.0469.
        let truth = 0.48 / (0.48 + 0.0469);
        assert!((found.pearson.mean - truth).abs() < 0.01, "{found:?} {truth}");
        assert!(found.pearson.deviation > 0.0005 && found.pearson.deviation < 0.01, "{found:?}");
        assert!((found.spearman.mean - truth).abs() < 0.03);
        // The noise model, given the means alone, expects the same.
        let means: Vec<f64> = scores.iter().map(|s| s.iter().sum::<f64>() / 30.0).collect();
        let expected = expected(&means, 0.2, 30).unwrap();
        assert!((expected.split_half_pearson - found.pearson.mean).abs() < 0.01, "{expected:?}");
        assert!((expected.signal - 0.48 / (0.48 + 0.0469 / 2.0)).abs() < 0.01);
    }

    #[test]
    fn the_seed_is_the_splits_and_threads_change_nothing() {
        let scores = panel(40, 9);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let first = one.install(|| split_half(&scores, 20, 7)).unwrap();
        assert_eq!(first, split_half(&scores, 20, 7).unwrap());
        assert_ne!(first, split_half(&scores, 20, 8).unwrap());
    }

    #[test]
    fn too_little_to_split_is_refused() {
        let refused = split_half(&[vec![1.0], vec![2.0], vec![3.0, 4.0]], 10, 0);
        assert!(matches!(refused, Err(StudyError::TooFew { found: 1, least: 3, .. })));
        let constant = vec![vec![3.0; 4]; 5];
        assert!(matches!(split_half(&constant, 10, 0), Err(StudyError::Correlation(_))));
        assert!(matches!(expected(&[3.0; 5], 0.2, 30), Err(StudyError::NoSpread { .. })));
    }
}
