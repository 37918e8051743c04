//! The simulated panel: thirty observers who grade on five categories.
//!
//! r = 3 + g (q - 3) + b + s e,   grade = r rounded to 1..=5, or with probability l any grade
//!
//! q: quality of the pair, 1 to 5, from [`super::appearance`]; e: standard normal, new for each grade; of each
//! observer: slope g = exp(N(0, 0.15)), bias b = N(0, 0.3) grades, noise s = 0.65 grades, lapse rate l uniform in 0 to
//! 0.04. In the middle of the scale the variance of the grades of one pair is about 0.7 and the standard error of a mean
//! opinion score about 0.15, as in crowd-sourced studies. A mean of 30 clipped grades does not reach 1 or 5.

use super::candidates::normal;
use rand::Rng;
use vernis_metric::math::seed;

/// Number of observers; each grades every pair once.
pub const OBSERVERS: usize = 30;

/// The grades of one pair, by observer.
pub type Grades = [u8; OBSERVERS];

const NOISE: f64 = 0.65;

/// One observer's habits.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Observer {
    bias: f64,
    slope: f64,
    lapse: f64,
}

/// The grades of all observers for pairs of the given qualities (1 to 5). The same seed gives the same panel; a pair's
/// grades depend on its position and quality alone.
pub fn grade(qualities: &[f64], seed: u64) -> Vec<Grades> {
    let panel: Vec<Observer> = (0..OBSERVERS as u64)
        .map(|i| {
            let mut rng = seed::stream(seed, "synthetic-observer", i);
            Observer {
                bias: 0.3 * normal(&mut rng),
                slope: (0.15 * normal(&mut rng)).exp(),
                lapse: rng.random_range(0.0..0.04),
            }
        })
        .collect();
    let judge = |(i, &q): (usize, &f64)| {
        let mut rng = seed::stream(seed, "synthetic-grades", i as u64);
        let mut grades = [0u8; OBSERVERS];
        for (grade, observer) in grades.iter_mut().zip(&panel) {
            let response = 3.0 + observer.slope * (q - 3.0) + observer.bias + NOISE * normal(&mut rng);
            let lapsed = rng.random::<f64>() < observer.lapse;
            let any = rng.random_range(1..=5u8);
            *grade = if lapsed { any } else { response.round().clamp(1.0, 5.0) as u8 };
        }
        grades
    };
    qualities.iter().enumerate().map(judge).collect()
}

/// Mean opinion score, 1 to 5.
pub fn mean_opinion(grades: &Grades) -> f64 {
    grades.iter().map(|&g| f64::from(g)).sum::<f64>() / OBSERVERS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grades_follow_quality_with_the_stated_spread() {
        let grades = grade(&[1.0, 3.0, 5.0].repeat(200), 7);
        let of = |k: usize| -> Vec<f64> {
            grades.iter().skip(k).step_by(3).flatten().map(|&g| f64::from(g)).collect::<Vec<_>>()
        };
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let [low, middle, high] = [0, 1, 2].map(of);
        assert!(mean(&low) < 1.5 && mean(&high) > 4.5, "{} {}", mean(&low), mean(&high));
        // The panel's mean bias has a standard deviation of 0.3/sqrt 30 = 0.055.
        assert!((mean(&middle) - 3.0).abs() < 0.2, "{}", mean(&middle));
        let variance = mean(&middle.iter().map(|g| (g - mean(&middle)).powi(2)).collect::<Vec<_>>());
        // 0.65^2 + 0.3^2 + 1/12 of rounding, and lapses: 0.6 to 0.8.
        assert!((0.5..0.85).contains(&variance), "{variance}");
    }

    #[test]
    fn the_seed_is_the_panel() {
        let q: Vec<f64> = (0..50).map(|i| 1.0 + f64::from(i) * 0.08).collect();
        assert_eq!(grade(&q, 1), grade(&q, 1));
        assert_ne!(grade(&q, 1), grade(&q, 2));
        assert_eq!(grade(&q[..20], 1), grade(&q, 1)[..20]);
    }
}
