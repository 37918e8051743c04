//! Quantiles of a sample and the 95 % interval between two of them.
//!
//! The quantile q of n sorted values x_0 .. x_(n-1) lies at the place q (n - 1), interpolated linearly between its
//! neighbours: type 7 of Hyndman & Fan 1996 (doi:10.2307/2684934), the default of R and NumPy. Cost: one sort.

use serde::{Deserialize, Serialize};

/// A 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Lower end: the 2.5 % quantile.
    pub low: f64,
    /// Upper end: the 97.5 % quantile.
    pub high: f64,
}

impl Interval {
    /// The central 95 % of `values`, which need not be sorted; `None` for no value.
    pub fn percentile(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        Some(Self { low: quantile(&values, 0.025)?, high: quantile(&values, 0.975)? })
    }

    /// Whether `value` lies inside, ends included.
    pub fn contains(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}

/// The quantile `q`, 0 to 1, of values in ascending order; `None` for no value or a `q` outside.
pub fn quantile(sorted: &[f64], q: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    if !(0.0..=1.0).contains(&q) {
        return None;
    }
    let at = q * last as f64;
    let (below, above) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
    Some(below + (above - below) * at.fract())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_interpolate_as_numpy() {
        // numpy.quantile([1, 2, 4, 8, 16], [0.025, 0.975]) = [1.1, 15.2]
        let interval = Interval::percentile(vec![16.0, 1.0, 8.0, 2.0, 4.0]).unwrap();
        assert!((interval.low - 1.1).abs() < 1e-14 && (interval.high - 15.2).abs() < 1e-14);
        assert_eq!(Interval::percentile(vec![]), None);
        assert_eq!(quantile(&[1.0, 2.0], 1.1), None);
        assert_eq!((quantile(&[3.0], 0.4), quantile(&[1.0, 5.0], 1.0)), (Some(3.0), Some(5.0)));
    }
}
