//! The numbers of a box plot: quartiles, whiskers, outliers.
//!
//! Quartiles are type-7 quantiles; a whisker ends at the last value within 1.5 (q3 - q1) of its quartile (Tukey
//! 1977), and what lies beyond is an outlier. Cost: one sort.

use serde::{Deserialize, Serialize};
use vernis_metric::math::quantile::quantile;

/// Reach of the whiskers, in interquartile ranges.
const REACH: f64 = 1.5;

/// A box plot, in the unit of its values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BoxPlot {
    /// Number of values.
    pub n: usize,
    /// The median.
    pub median: f64,
    /// First and third.
    pub quartiles: [f64; 2],
    /// Lower and upper end.
    pub whiskers: [f64; 2],
    /// Ascending.
    pub outliers: Vec<f64>,
}

impl BoxPlot {
    /// `None` for no value. Values are finite.
    pub fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (q1, q3) = (quantile(&sorted, 0.25)?, quantile(&sorted, 0.75)?);
        let reach = REACH * (q3 - q1);
        let inside = |v: f64| q1 - reach <= v && v <= q3 + reach;
        let low = sorted.iter().copied().find(|&v| inside(v))?;
        let high = sorted.iter().rev().copied().find(|&v| inside(v))?;
        Some(Self {
            n: sorted.len(),
            median: quantile(&sorted, 0.5)?,
            quartiles: [q1, q3],
            // A quartile between two values can lie beyond the nearest one that a whisker may reach.
            whiskers: [low.min(q1), high.max(q3)],
            outliers: sorted.into_iter().filter(|&v| !inside(v)).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_agree_with_matplotlib() {
        // matplotlib 3.11.2: matplotlib.cbook.boxplot_stats([3, 1, 4, 1, 5, 9, 2, 6, 5, 3, 15, -7])
        let plot = BoxPlot::of(&[3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0, 6.0, 5.0, 3.0, 15.0, -7.0]).unwrap();
        assert_eq!((plot.n, plot.median, plot.quartiles), (12, 3.5, [1.75, 5.25]));
        assert_eq!((plot.whiskers, plot.outliers), ([1.0, 9.0], vec![-7.0, 15.0]));
        // matplotlib.cbook.boxplot_stats([1, 2, 3, 100]): the upper whisker is q3.
        assert_eq!(BoxPlot::of(&[1.0, 2.0, 3.0, 100.0]).unwrap().whiskers, [1.0, 27.25]);
    }

    #[test]
    fn one_value_is_its_own_box() {
        let plot = BoxPlot::of(&[2.0]).unwrap();
        assert_eq!((plot.median, plot.quartiles, plot.whiskers), (2.0, [2.0; 2], [2.0; 2]));
        assert_eq!(BoxPlot::of(&[]), None);
    }
}
