//! Mean opinion scores and how sure they are, from raw scores or from means and a model of their noise.
//!
//!   MOS_s = sum_i r_s^i / n_s,   interval MOS_s +- t_.975(n_s - 1) d_s / sqrt(n_s)
//!
//! r_s^i: score of participant i for stimulus s, a grade from 1 to 5; n_s: participants who rated it; d_s: sample standard
//! deviation of their scores. Source: equation 1 of Lavoue et al. 2021 (doi:10.1111/cgf.142636), which leaves the
//! interval's form open; Student's t is exact for normal scores. Intervals are not clipped to the scale.
//! Where a study has means alone, d_s^2 = a (-x^2 + 6x - 5) at x = MOS_s stands in, the SOS hypothesis (see
//! [`super::sos`]).
//!
//! Scores that are all equal have d_s = 0, and so has a mean at an end of the scale under the SOS hypothesis, where the largest
//! possible variance is 0; neither says that the mean of all people is known exactly. There stands Wilson's interval, the means x
//! that are not refused by their own variance, |MOS_s - x| <= z sqrt(a (x - 1)(5 - x)/n_s): with p = (MOS_s - 1)/4, m = n_s/a and
//! z = 1.96,
//!
//!   1 + 4 (p + z^2/2m -+ z sqrt(p (1 - p)/m + z^2/4m^2)) / (1 + z^2/m).
//!
//! Scores that are all equal take a = 1/4, the SOS parameter of a binomial score on five grades; means alone take the a that is
//! assumed of them, and on each side the wider of the two intervals. Sources: Wilson 1927 (doi:10.1080/01621459.1927.10502953);
//! Hossfeld, Heegaard, Skorin-Kapov & Varela 2018 (arXiv:1806.01126), who take intervals of binomial proportions for MOS by the
//! SOS hypothesis. Cost: linear.

use super::distribution::t_975;
use super::moments::{Moments, negligible};
use super::sos;
use serde::{Deserialize, Serialize};
use vernis_metric::math::quantile::Interval;
use vernis_metric::math::rating_scale::RatingScale;

/// The SOS parameter of scores that are a binomial number of four trials, plus 1.
const BINOMIAL_A: f64 = 0.25;
/// The value that a standard normal variable exceeds with probability 2.5 %.
const Z_975: f64 = 1.959963984540054;

/// The mean opinion score of one stimulus.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Opinion {
    /// Participants, or how many are assumed.
    pub raters: usize,
    /// A grade, 1 to 5; in a record, on the study's scale.
    pub mos: f64,
    /// Standard deviation of the scores, found or assumed; `None` for one score.
    pub deviation: Option<f64>,
    /// 95 %; `None` for one score.
    pub interval: Option<Interval>,
}

impl Opinion {
    /// From raw scores; `None` for no score.
    pub fn of_scores(scores: &[f64]) -> Option<Self> {
        let Moments { n, mean, variance } = Moments::of(scores)?;
        let found = Self::new(n, mean, variance);
        let interval = if found.is_unanimous() { Some(wilson(mean, BINOMIAL_A, n)) } else { found.interval };
        Some(Self { interval, ..found })
    }

    /// From the mean of `raters` scores whose variance follows the SOS hypothesis with `a`.
    pub fn of_mean(mos: f64, a: f64, raters: usize) -> Self {
        let found = Self::new(raters, mos, Some(a * sos::parabola(mos)));
        let own = wilson(mos, a, raters);
        let wider = |i: Interval| Interval { low: i.low.min(own.low), high: i.high.max(own.high) };
        Self { interval: found.interval.map(wider), ..found }
    }

    /// Whether several scores are all equal, so that their spread says nothing of how sure their mean is.
    pub fn is_unanimous(&self) -> bool {
        self.raters > 1 && self.deviation.is_some_and(|d| negligible(d * d, self.mos))
    }

    fn new(raters: usize, mos: f64, variance: Option<f64>) -> Self {
        let deviation = variance.map(f64::sqrt);
        let half = deviation.and_then(|d| Some(t_975(raters as f64 - 1.0)? * d / (raters as f64).sqrt()));
        Self { raters, mos, deviation, interval: half.map(|h| Interval { low: mos - h, high: mos + h }) }
    }

    /// A mean alone, of which nothing else is known.
    pub fn of_mean_alone(mos: f64) -> Self {
        Self { raters: 0, mos, deviation: None, interval: None }
    }

    /// An opinion in grades as one on `scale`.
    #[must_use]
    pub fn on_scale(self, scale: RatingScale) -> Self {
        if scale.is_grades() {
            return self;
        }
        let interval = self.interval.map(|i| {
            let [a, b] = [i.low, i.high].map(|end| scale.score(end));
            Interval { low: a.min(b), high: a.max(b) }
        });
        let (mos, deviation) = (scale.stated(self.mos), self.deviation.map(|d| scale.width(d)));
        Self { mos, deviation, interval, ..self }
    }

    /// Width of the interval.
    pub fn width(&self) -> Option<f64> {
        self.interval.map(|i| i.high - i.low)
    }
}

/// Wilson's interval of the mean of `raters` scores whose variance follows the SOS hypothesis with `a`.
fn wilson(mos: f64, a: f64, raters: usize) -> Interval {
    let (p, m, z2) = ((mos - 1.0) / 4.0, raters as f64 / a, Z_975 * Z_975);
    let centre = p + z2 / (2.0 * m);
    let half = Z_975 * (p * (1.0 - p) / m + z2 / (4.0 * m * m)).max(0.0).sqrt();
    let on_scale = |share: f64| 1.0 + 4.0 * share / (1.0 + z2 / m);
    // At the ends rounding would leave the scale, or the mean itself outside.
    let (low, high) = (on_scale(centre - half).max(1.0), on_scale(centre + half).min(5.0));
    Interval { low: low.min(mos), high: high.max(mos) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;
    use vernis_metric::math::seed;

    #[test]
    fn intervals_agree_with_scipy() {
        // scipy 1.17.1: s = [4,5,3,4,4,2,5,3]; stats.t.interval(0.95, 7, numpy.mean(s), stats.sem(s))
        let o = Opinion::of_scores(&[4.0, 5.0, 3.0, 4.0, 4.0, 2.0, 5.0, 3.0]).unwrap();
        let interval = o.interval.unwrap();
        assert_eq!((o.raters, o.mos), (8, 3.75));
        assert!(
            (interval.low - 2.8846361326405243).abs() < 1e-9 && (interval.high - 4.615363867359475).abs() < 1e-9,
            "{interval:?}"
        );
    }

    #[test]
    fn an_opinion_is_told_on_the_scale_of_the_study() {
        let grades = Opinion::of_scores(&[4.0, 5.0, 3.0, 2.0]).unwrap();
        for (worst, best) in [(0.0, 100.0), (100.0, 0.0)] {
            let scale = RatingScale::new(worst, best).unwrap();
            let scores = [4.0, 5.0, 3.0, 2.0].map(|g| scale.score(g));
            let direct = Opinion::of_scores(&scores).unwrap();
            let found = grades.on_scale(scale);
            let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
            assert!(near(found.mos, direct.mos) && near(found.deviation.unwrap(), direct.deviation.unwrap()));
            let [found, direct] = [found, direct].map(|o| o.interval.unwrap());
            assert!(near(found.low, direct.low) && near(found.high, direct.high), "{found:?} {direct:?}");
        }
    }

    #[test]
    fn a_single_score_has_no_interval() {
        let o = Opinion::of_scores(&[4.0]).unwrap();
        assert_eq!((o.mos, o.deviation, o.interval), (4.0, None, None));
        assert_eq!(Opinion::of_scores(&[]), None);
    }

    #[test]
    fn scores_that_are_all_equal_leave_the_mean_unsure() {
        // 1 + 4 times Wilson's limits for k of 120, k = 0, 30, 120, computed in Python: 30 scores of 1, 2, 5.
        for (score, low, high) in [
            (1.0, 1.0, 1.124076665674814),
            (2.0, 1.7243928662723826, 2.3376454665650246),
            (5.0, 4.875923334325186, 5.0),
        ] {
            let o = Opinion::of_scores(&[score; 30]).unwrap();
            let interval = o.interval.unwrap();
            assert!(
                (interval.low - low).abs() < 1e-12 && (interval.high - high).abs() < 1e-12,
                "{score}: {interval:?}"
            );
            assert!(o.is_unanimous() && o.deviation == Some(0.0) && interval.contains(score));
        }
        // Fewer scores leave more unsure; one that differs is a spread that was found.
        let width = |scores: &[f64]| Opinion::of_scores(scores).unwrap().width().unwrap();
        assert!(width(&[5.0; 3]) > width(&[5.0; 30]) && width(&[5.0; 3]) < 4.0);
        assert!(!Opinion::of_scores(&[1.0, 1.0, 2.0]).unwrap().is_unanimous());
    }

    #[test]
    fn intervals_hold_the_true_mean_as_often_as_they_say() {
        // Scores 1 + 0.8 K, K binomial(5, 0.6): mean 3.4.
        let mut rng = seed::stream(1, "opinion", 0);
        let covered = (0..2000)
            .filter(|_| {
                let mut score =
                    || 1.0 + 0.8 * f64::from((0..5).map(|_| u8::from(rng.random::<f64>() < 0.6)).sum::<u8>());
                let scores: Vec<f64> = (0..30).map(|_| score()).collect();
                Opinion::of_scores(&scores).and_then(|o| o.interval).is_some_and(|i| i.contains(3.4))
            })
            .count();
        // Binomial(2000, 0.95): 1875 to 1925 with probability > 0.99.
        assert!((1875..=1925).contains(&covered), "{covered}");
    }

    #[test]
    fn the_noise_model_gives_the_spread_of_real_ratings() {
        // a = 0.2, 30 raters, MOS 3: standard deviation sqrt 0.8, standard error 0.163.
        let o = Opinion::of_mean(3.0, 0.2, 30);
        assert!((o.deviation.unwrap() - 0.8f64.sqrt()).abs() < 1e-15);
        assert!((o.width().unwrap() - 2.0 * 2.045229642 * 0.8f64.sqrt() / 30f64.sqrt()).abs() < 1e-8);
        // At the ends of the scale z^2/(150 + z^2) of its 4 grades is left, and nowhere beside them is less.
        let end = 4.0 * 3.841458820694124 / (150.0 + 3.841458820694124);
        let high = |mos: f64| Opinion::of_mean(mos, 0.2, 30).interval.unwrap().high;
        assert!((high(1.0) - 1.0 - end).abs() < 1e-12 && high(1.0) < high(1.02) && high(1.02) < high(1.1));
        let top = Opinion::of_mean(5.0, 0.2, 30).interval.unwrap();
        assert!((top.low - 5.0 + end).abs() < 1e-12 && top.high == 5.0);
    }
}
