//! How well two lists of numbers agree: Pearson, Spearman, Kendall's tau-b, root mean square difference.
//!
//! With x, y two lists of n numbers and every row i counted c_i times (1 outside a bootstrap), N = sum c_i:
//!
//! * Pearson: r = sum c (x - mx)(y - my) / sqrt(sum c (x - mx)^2 sum c (y - my)^2), mx and my the means;
//! * Spearman: r of the ranks, tied values sharing the mean of theirs (the tie-corrected form);
//! * Kendall: tau-b = (C - D) / sqrt((n0 - n1)(n0 - n2)), C and D the concordant and discordant pairs, n0 =
//!   N (N-1)/2, n1 and n2 the pairs tied in x and in y (Kendall 1945, doi:10.1093/biomet/33.3.239);
//! * RMSE: sqrt(sum c (x - y)^2 / N), in the unit of x and y.
//!
//! Multiplicities let a bootstrap rank its rows once: [`Ranking`] sorts, and every resample then costs O(n)
//! (Spearman) or O(n log n) (Kendall). Discordant pairs are counted as Knight (1966,
//! doi:10.1080/01621459.1966.10480879) does, in O(n log n), with a binary indexed tree (Fenwick 1994,
//! doi:10.1002/spe.4380240306) instead of his merge sort because a tree takes multiplicities.

use thiserror::Error;

/// Why two lists have no correlation.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum CorrelationError {
    #[error("the numbers of values in the lists are {x} and {y}; they must be the same")]
    Lengths { x: usize, y: usize },
    #[error("the number of values of a correlation is {found}; it must be at least 2")]
    TooFew { found: u64 },
    #[error("value {row} of the {side} list is {value}; every value must be finite")]
    NotFinite { side: &'static str, row: usize, value: f64 },
    #[error("all values of the {side} list are equal; they must differ to have a correlation")]
    Constant { side: &'static str },
}

/// Pearson's product-moment correlation, -1 to 1.
pub fn pearson(x: &[f64], y: &[f64]) -> Result<f64, CorrelationError> {
    check(x, y)?;
    pearson_counted(x, y, &vec![1; x.len()])
}

/// Spearman's rank correlation, -1 to 1, tied values sharing their mean rank.
pub fn spearman(x: &[f64], y: &[f64]) -> Result<f64, CorrelationError> {
    check(x, y)?;
    spearman_counted(&Ranking::of(x), &Ranking::of(y), &vec![1; x.len()])
}

/// Kendall's tau-b, -1 to 1.
pub fn kendall(x: &[f64], y: &[f64]) -> Result<f64, CorrelationError> {
    check(x, y)?;
    kendall_counted(&Ranking::of(x), &Ranking::of(y), &vec![1; x.len()])
}

/// Root mean square difference, in the unit of the lists.
pub fn rmse(x: &[f64], y: &[f64]) -> Result<f64, CorrelationError> {
    check(x, y)?;
    rmse_counted(x, y, &vec![1; x.len()])
}

/// Ranks from 1, tied values sharing the mean of theirs.
pub fn average_ranks(values: &[f64]) -> Vec<f64> {
    Ranking::of(values).average_ranks(&vec![1; values.len()])
}

/// The order of a list: sorted once, ranked under any multiplicities.
#[derive(Debug, Clone)]
pub struct Ranking {
    /// Rows by ascending value.
    order: Vec<usize>,
    /// For each row, how many distinct smaller values the list holds.
    level: Vec<usize>,
    levels: usize,
}

impl Ranking {
    /// Values must be finite; -0 and 0 are equal.
    pub fn of(values: &[f64]) -> Self {
        let mut order: Vec<usize> = (0..values.len()).collect();
        // Adding 0 turns -0 into 0, which `total_cmp` tells apart.
        order.sort_by(|&a, &b| (values[a] + 0.0).total_cmp(&(values[b] + 0.0)));
        let mut level = vec![0; values.len()];
        let mut levels = 0;
        for (place, &row) in order.iter().enumerate() {
            if place == 0 || values[row] != values[order[place - 1]] {
                levels += 1;
            }
            level[row] = levels - 1;
        }
        Self { order, level, levels }
    }

    /// Ranks from 1 of the list in which row i stands `counts[i]` times.
    pub fn average_ranks(&self, counts: &[u32]) -> Vec<f64> {
        let mut below = 0u64;
        let rank_of_level: Vec<f64> = self
            .sizes(counts)
            .into_iter()
            .map(|size| {
                let rank = below as f64 + 0.5 * (size as f64 + 1.0);
                below += size;
                rank
            })
            .collect();
        self.level.iter().map(|&l| rank_of_level[l]).collect()
    }

    /// How many values stand at each level.
    fn sizes(&self, counts: &[u32]) -> Vec<u64> {
        let mut sizes = vec![0; self.levels];
        for (&level, &count) in self.level.iter().zip(counts) {
            sizes[level] += u64::from(count);
        }
        sizes
    }
}

/// [`pearson`] of the lists in which row i stands `counts[i]` times. All three have the same length.
pub fn pearson_counted(x: &[f64], y: &[f64], counts: &[u32]) -> Result<f64, CorrelationError> {
    let n = total(counts)?;
    let (mx, scale_x) = centre_and_scale(x, counts, n).ok_or(CorrelationError::Constant { side: "first" })?;
    let (my, scale_y) = centre_and_scale(y, counts, n).ok_or(CorrelationError::Constant { side: "second" })?;
    let (mut sxx, mut syy, mut sxy) = (0.0, 0.0, 0.0);
    for ((&x, &y), &c) in x.iter().zip(y).zip(counts) {
        let (dx, dy, c) = ((x - mx) / scale_x, (y - my) / scale_y, f64::from(c));
        sxx += c * dx * dx;
        syy += c * dy * dy;
        sxy += c * dx * dy;
    }
    // Rounding can put a perfect correlation an ulp beyond 1.
    Ok((sxy / (sxx * syy).sqrt()).clamp(-1.0, 1.0))
}

/// [`spearman`] of the lists in which row i stands `counts[i]` times. All three have the same length.
pub fn spearman_counted(x: &Ranking, y: &Ranking, counts: &[u32]) -> Result<f64, CorrelationError> {
    pearson_counted(&x.average_ranks(counts), &y.average_ranks(counts), counts)
}

/// [`kendall`] of the lists in which row i stands `counts[i]` times. All three have the same length.
pub fn kendall_counted(x: &Ranking, y: &Ranking, counts: &[u32]) -> Result<f64, CorrelationError> {
    let n = total(counts)?;
    let pairs = |size: u64| size * size.saturating_sub(1) / 2;
    let tied = |ranking: &Ranking| ranking.sizes(counts).into_iter().map(pairs).sum::<u64>();
    let (n0, n1, n2) = (pairs(n), tied(x), tied(y));
    if n1 == n0 {
        return Err(CorrelationError::Constant { side: "first" });
    }
    if n2 == n0 {
        return Err(CorrelationError::Constant { side: "second" });
    }
    let mut seen = CountTree::new(y.levels);
    let mut surplus = 0i64; // concordant minus discordant pairs
    for group in x.order.chunk_by(|&a, &b| x.level[a] == x.level[b]) {
        // Rows tied in x are compared with the smaller ones only, then join them.
        for &row in group.iter().filter(|&&row| counts[row] > 0) {
            let smaller = seen.below(y.level[row]);
            let larger = seen.total - smaller - seen.at[y.level[row]];
            surplus += i64::from(counts[row]) * (smaller as i64 - larger as i64);
        }
        for &row in group.iter().filter(|&&row| counts[row] > 0) {
            seen.add(y.level[row], u64::from(counts[row]));
        }
    }
    Ok((surplus as f64 / ((n0 - n1) as f64 * (n0 - n2) as f64).sqrt()).clamp(-1.0, 1.0))
}

/// [`rmse`] of the lists in which row i stands `counts[i]` times. All three have the same length.
pub fn rmse_counted(x: &[f64], y: &[f64], counts: &[u32]) -> Result<f64, CorrelationError> {
    let n = total(counts)?;
    let sum: f64 = x.iter().zip(y).zip(counts).map(|((x, y), &c)| f64::from(c) * (x - y) * (x - y)).sum();
    Ok((sum / n as f64).sqrt())
}

fn check(x: &[f64], y: &[f64]) -> Result<(), CorrelationError> {
    if x.len() != y.len() {
        return Err(CorrelationError::Lengths { x: x.len(), y: y.len() });
    }
    for (side, list) in [("first", x), ("second", y)] {
        if let Some(row) = list.iter().position(|v| !v.is_finite()) {
            return Err(CorrelationError::NotFinite { side, row, value: list[row] });
        }
    }
    Ok(())
}

fn total(counts: &[u32]) -> Result<u64, CorrelationError> {
    let found = counts.iter().map(|&c| u64::from(c)).sum();
    if found < 2 { Err(CorrelationError::TooFew { found }) } else { Ok(found) }
}

/// Mean and largest deviation from it, by which deviations are divided so that their squares neither overflow nor
/// vanish; `None` for a constant list.
fn centre_and_scale(values: &[f64], counts: &[u32], n: u64) -> Option<(f64, f64)> {
    let (mut low, mut high, mut sum) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
    for (&v, &c) in values.iter().zip(counts).filter(|&(_, &c)| c > 0) {
        (low, high) = (low.min(v), high.max(v));
        sum += f64::from(c) * v;
    }
    let mean = sum / n as f64;
    // Compared with each other: the mean of equal numbers need not equal them in the last digit.
    (low < high).then(|| (mean, (high - mean).max(mean - low)))
}

/// Counts at levels 0.., their partial sums in O(log levels): a binary indexed tree.
struct CountTree {
    at: Vec<u64>,
    sums: Vec<u64>,
    total: u64,
}

impl CountTree {
    fn new(levels: usize) -> Self {
        Self { at: vec![0; levels], sums: vec![0; levels + 1], total: 0 }
    }

    fn add(&mut self, level: usize, count: u64) {
        self.total += count;
        self.at[level] += count;
        let mut node = level + 1;
        while node < self.sums.len() {
            self.sums[node] += count;
            node += node & node.wrapping_neg();
        }
    }

    /// The sum over all levels below `level`.
    fn below(&self, level: usize) -> u64 {
        let (mut node, mut sum) = (level, 0);
        while node > 0 {
            sum += self.sums[node];
            node &= node - 1;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const X: [f64; 10] = [2.1, 0.3, 0.3, 1.7, 4.4, 3.9, 3.9, 3.9, 5.0, 0.1];
    const Y: [f64; 10] = [1.9, 1.2, 1.0, 1.2, 3.1, 4.8, 3.1, 2.2, 4.1, 1.0];
    const COUNTS: [u32; 10] = [1, 0, 3, 2, 1, 0, 2, 1, 1, 2];

    fn assert_close(found: f64, expected: f64) {
        // A few roundings of numbers near 1.
        assert!((found - expected).abs() < 1e-14, "found {found}, expected {expected}");
    }

    #[test]
    fn agrees_with_scipy() {
        // SciPy 1.17.1: stats.pearsonr(X, Y)[0], stats.spearmanr(X, Y)[0], stats.kendalltau(X, Y)[0],
        // numpy.sqrt(numpy.mean((X - Y)**2))
        assert_close(pearson(&X, &Y).unwrap(), 0.8616590896633682);
        assert_close(spearman(&X, &Y).unwrap(), 0.9006384909374153);
        assert_close(kendall(&X, &Y).unwrap(), 0.8193365776101957);
        assert_close(rmse(&X, &Y).unwrap(), 0.9612491872558333);
        // SciPy 1.17.1: stats.rankdata(X)
        assert_eq!(average_ranks(&X), [5.0, 2.5, 2.5, 4.0, 9.0, 7.0, 7.0, 7.0, 10.0, 1.0]);
    }

    #[test]
    fn multiplicities_agree_with_scipy_on_repeated_rows() {
        // SciPy 1.17.1, the same calls on numpy.repeat(X, COUNTS) and numpy.repeat(Y, COUNTS)
        let (x, y) = (Ranking::of(&X), Ranking::of(&Y));
        assert_close(pearson_counted(&X, &Y, &COUNTS).unwrap(), 0.9460666168411125);
        assert_close(spearman_counted(&x, &y, &COUNTS).unwrap(), 0.9670375252566833);
        assert_close(kendall_counted(&x, &y, &COUNTS).unwrap(), 0.926302172234155);
        assert_close(rmse_counted(&X, &Y, &COUNTS).unwrap(), 0.8901166734241598);
    }

    #[test]
    fn many_rows_with_ties_agree_with_scipy() {
        // numpy: i = arange(2000); a = (7919 i % 2003) // 3; b = a + (104729 i % 1009) // 2
        // SciPy 1.17.1: stats.pearsonr(a, b)[0], stats.spearmanr(a, b)[0], stats.kendalltau(a, b)[0]
        let a: Vec<f64> = (0..2000u64).map(|i| ((7919 * i % 2003) / 3) as f64).collect();
        let b: Vec<f64> = (0..2000u64).zip(&a).map(|(i, a)| a + ((104_729 * i % 1009) / 2) as f64).collect();
        assert_close(pearson(&a, &b).unwrap(), 0.797787721351866);
        assert_close(spearman(&a, &b).unwrap(), 0.8006503022693501);
        assert_close(kendall(&a, &b).unwrap(), 0.5909073077414486);
    }

    #[test]
    fn extreme_magnitudes_neither_overflow_nor_vanish() {
        let scaled = |factor: f64| X.map(|v| v * factor);
        for factor in [1e-200, 1e200] {
            assert_close(pearson(&scaled(factor), &Y).unwrap(), 0.8616590896633682);
        }
        assert_close(pearson(&X, &X).unwrap(), 1.0);
        assert_close(pearson(&X, &X.map(|v| -v)).unwrap(), -1.0);
    }

    #[test]
    fn lists_without_a_correlation_say_why() {
        let constant = [0.1; 10];
        for f in [pearson, spearman, kendall] {
            assert_eq!(f(&constant, &Y), Err(CorrelationError::Constant { side: "first" }));
            assert_eq!(f(&X, &constant), Err(CorrelationError::Constant { side: "second" }));
            assert_eq!(f(&X, &Y[1..]), Err(CorrelationError::Lengths { x: 10, y: 9 }));
            assert_eq!(f(&X[..1], &Y[..1]), Err(CorrelationError::TooFew { found: 1 }));
            let error = f(&[1.0, f64::INFINITY], &[1.0, 2.0]);
            assert_eq!(error, Err(CorrelationError::NotFinite { side: "first", row: 1, value: f64::INFINITY }));
        }
    }

    /// Tau-b by its definition, over all pairs.
    fn kendall_by_pairs(x: &[f64], y: &[f64]) -> Option<f64> {
        let (mut surplus, mut untied_x, mut untied_y) = (0.0, 0.0, 0.0);
        for i in 0..x.len() {
            for j in 0..i {
                let sign = |v: &[f64]| (v[i] - v[j]).signum() * f64::from(u8::from(v[i] != v[j]));
                surplus += sign(x) * sign(y);
                untied_x += sign(x).abs();
                untied_y += sign(y).abs();
            }
        }
        (untied_x * untied_y > 0.0).then(|| surplus / (untied_x * untied_y).sqrt())
    }

    proptest! {
        #[test]
        fn kendall_counts_every_pair(rows in prop::collection::vec((-4i32..4, -4i32..4), 2..40)) {
            let (x, y): (Vec<f64>, Vec<f64>) = rows.iter().map(|&(x, y)| (f64::from(x), f64::from(y))).unzip();
            match (kendall(&x, &y), kendall_by_pairs(&x, &y)) {
                (Ok(found), Some(expected)) => prop_assert!((found - expected).abs() < 1e-12),
                (found, expected) => prop_assert!(found.is_err() && expected.is_none()),
            }
        }

        #[test]
        fn multiplicities_mean_repeated_rows(rows in prop::collection::vec((-9i32..9, -9i32..9, 0u32..4), 2..30)) {
            let (x, y): (Vec<f64>, Vec<f64>) = rows.iter().map(|r| (f64::from(r.0), f64::from(r.1))).unzip();
            let counts: Vec<u32> = rows.iter().map(|r| r.2).collect();
            let repeat = |v: &[f64]| -> Vec<f64> {
                v.iter().zip(&counts).flat_map(|(&v, &c)| std::iter::repeat_n(v, c as usize)).collect()
            };
            let (xs, ys) = (repeat(&x), repeat(&y));
            let (rx, ry) = (Ranking::of(&x), Ranking::of(&y));
            for (counted, repeated) in [
                (pearson_counted(&x, &y, &counts), pearson(&xs, &ys)),
                (spearman_counted(&rx, &ry, &counts), spearman(&xs, &ys)),
                (kendall_counted(&rx, &ry, &counts), kendall(&xs, &ys)),
            ] {
                match (counted, repeated) {
                    (Ok(a), Ok(b)) => prop_assert!((a - b).abs() < 1e-12),
                    (a, b) => prop_assert_eq!(a, b),
                }
            }
        }
    }
}
