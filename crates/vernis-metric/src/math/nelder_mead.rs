//! The simplex of Nelder and Mead: a minimum of a function without its gradient.
//!
//! n + 1 points. A step moves the worst, w, along the line through the centre c of the others, x(t) = c + t (c - w):
//!
//! * t = 1, the reflection; where that is the best point so far, t = expansion if that is better still;
//! * where the reflection is not better than the second worst, t = +-contraction, on the better side;
//! * where the contraction is not better than what it began with, all points shrink towards the best, b: b + s (x - b).
//!
//! Source: Nelder & Mead 1965, doi:10.1093/comjnl/7.4.308. Cost: one or two evaluations a step, n for a shrinkage.

/// A point and its value.
pub type Vertex = (Vec<f64>, f64);

/// How far a step goes, as a part of the way from the worst point to the centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Factors {
    /// t of an expansion.
    pub expansion: f64,
    /// t of a contraction, on either side of the centre.
    pub contraction: f64,
    /// s of a shrinkage: the part of the distance to the best point that is left.
    pub shrinkage: f64,
}

impl Factors {
    /// Those of Nelder and Mead.
    pub const CLASSIC: Self = Self { expansion: 2.0, contraction: 0.5, shrinkage: 0.5 };

    /// Those of Gao & Han 2012, doi:10.1007/s10589-010-9329-3, for `n` variables: with many variables the simplex keeps its
    /// shape for longer. For two variables or one they are the classic ones.
    pub fn adaptive(n: usize) -> Self {
        let n = n.max(2) as f64;
        Self { expansion: 1.0 + 2.0 / n, contraction: 0.75 - 0.5 / n, shrinkage: 1.0 - 1.0 / n }
    }
}

/// When a simplex has arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// No point is this far from the best along any variable.
    Size(f64),
    /// The values of the worst and the best differ by no more than this part of the best.
    Spread(f64),
}

impl Stop {
    /// For a simplex in ascending order.
    fn is_met(self, simplex: &[Vertex]) -> bool {
        match self {
            Self::Size(least) => size(simplex) < least,
            Self::Spread(part) => {
                let (best, worst) = (simplex[0].1, simplex[simplex.len() - 1].1);
                worst - best <= part * best
            }
        }
    }
}

/// How the mean of the points is rounded. Both are right to the last digits, which a long search makes visible: each
/// search keeps the one that its recorded results were made with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mean {
    /// The sum divided by the number of points.
    OfSum,
    /// m_k = m_(k-1) + (x_k - m_(k-1))/k, which cannot overflow.
    Running,
}

impl Mean {
    fn of(self, values: impl ExactSizeIterator<Item = f64>) -> f64 {
        let n = values.len() as f64;
        match self {
            Self::OfSum => values.sum::<f64>() / n,
            Self::Running => values.zip(1..).fold(0.0, |mean, (x, k)| mean + (x - mean) / f64::from(k)),
        }
    }
}

/// Rules of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// How far a step goes.
    pub factors: Factors,
    /// When the search has arrived.
    pub stop: Stop,
    /// How the mean of the points is rounded.
    pub mean: Mean,
    /// The search ends after this many steps, arrived or not.
    pub most_steps: usize,
}

/// The best vertex of the simplex that began with `start` and `start` moved by `edges[k]` along variable k.
///
/// `value` may first move the point that it is given, for example into a box; the simplex continues with the moved point.
/// Infinite values are allowed; NaN counts as worse than any number.
///
/// # Errors
/// The first one of `value`.
pub fn minimise<E>(
    start: Vec<f64>,
    edges: &[f64],
    settings: &Settings,
    mut value: impl FnMut(&mut [f64]) -> Result<f64, E>,
) -> Result<Vertex, E> {
    let mut valued = |mut point: Vec<f64>| value(&mut point).map(|value| (point, value));
    let neighbour = |(k, edge): (usize, &f64)| {
        let mut point = start.clone();
        point[k] += edge;
        point
    };
    let neighbours: Vec<Vec<f64>> = edges.iter().enumerate().map(neighbour).collect();
    let mut simplex = Vec::with_capacity(neighbours.len() + 1);
    for point in std::iter::once(start).chain(neighbours) {
        simplex.push(valued(point)?);
    }
    simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
    for _ in 0..settings.most_steps {
        if settings.stop.is_met(&simplex) {
            break;
        }
        step(&mut simplex, settings, &mut valued)?;
        simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
    }
    Ok(simplex.swap_remove(0))
}

/// One step of a simplex in ascending order, which it may leave unsorted.
fn step<E>(
    simplex: &mut [Vertex],
    settings: &Settings,
    valued: &mut impl FnMut(Vec<f64>) -> Result<Vertex, E>,
) -> Result<(), E> {
    let Settings { factors, mean, .. } = *settings;
    let n = simplex.len() - 1;
    let centre: Vec<f64> = (0..n).map(|k| mean.of(simplex[..n].iter().map(|v| v.0[k]))).collect();
    let (best, second, worst) = (simplex[0].1, simplex[n - 1].1, simplex[n].1);
    let mut at = |t: f64| valued(centre.iter().zip(&simplex[n].0).map(|(c, w)| c + t * (c - w)).collect());
    let reflected = at(1.0)?;
    let accepted = if reflected.1 < best {
        let expanded = at(factors.expansion)?;
        Some(if expanded.1 < reflected.1 { expanded } else { reflected })
    } else if reflected.1 < second {
        Some(reflected)
    } else {
        let outside = reflected.1 < worst;
        let contracted = at(if outside { factors.contraction } else { -factors.contraction })?;
        (contracted.1 < if outside { reflected.1 } else { worst }).then_some(contracted)
    };
    if let Some(vertex) = accepted {
        simplex[n] = vertex;
        return Ok(());
    }
    let (best, others) = simplex.split_at_mut(1);
    for vertex in others {
        let shrunk = vertex.0.iter().zip(&best[0].0).map(|(x, b)| b + factors.shrinkage * (x - b));
        *vertex = valued(shrunk.collect())?;
    }
    Ok(())
}

/// The largest distance from the best point along any variable.
fn size(simplex: &[Vertex]) -> f64 {
    let best = &simplex[0].0;
    let distance = |v: &Vertex| v.0.iter().zip(best).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    simplex.iter().map(distance).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    const RULES: Settings =
        Settings { factors: Factors::CLASSIC, stop: Stop::Size(1e-8), mean: Mean::OfSum, most_steps: 10_000 };

    /// Without errors.
    fn search(
        start: &[f64],
        edge: f64,
        settings: &Settings,
        mut value: impl FnMut(&mut [f64]) -> f64,
    ) -> (Vec<f64>, f64) {
        let Ok(found) = minimise(start.to_vec(), &vec![edge; start.len()], settings, |x| Ok::<_, Infallible>(value(x)));
        found
    }

    /// Minimum 0 at (1, 1), at the end of a curved valley: Rosenbrock 1960, doi:10.1093/comjnl/3.3.175.
    fn rosenbrock(x: &mut [f64]) -> f64 {
        100.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2)
    }

    #[test]
    fn every_setting_reaches_the_end_of_the_valley() {
        for stop in [Stop::Size(1e-8), Stop::Spread(1e-12)] {
            for mean in [Mean::OfSum, Mean::Running] {
                let (x, value) = search(&[-1.2, 1.0], 0.5, &Settings { stop, mean, ..RULES }, rosenbrock);
                assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-6) && value < 1e-12, "{stop:?} {mean:?}: {x:?}");
            }
        }
    }

    /// On x + y, worked by hand.
    #[test]
    fn the_first_steps_are_those_of_the_rules() {
        let mut seen = Vec::new();
        search(&[4.0, 4.0], 1.0, &Settings { most_steps: 2, ..RULES }, |x| {
            seen.push((x[0], x[1]));
            x[0] + x[1]
        });
        let expected = [
            (4.0, 4.0),
            (5.0, 4.0),
            (4.0, 5.0),
            // Centre (4.5, 4), worst (4, 5): the reflection has the value 8 of the best, below 9 of the second.
            (5.0, 3.0),
            // Centre (4.5, 3.5) of (4, 4) and (5, 3), worst (5, 4): better than all, so twice as far is tried.
            (4.0, 3.0),
            (3.5, 2.5),
        ];
        assert_eq!(seen, expected);
    }

    #[test]
    fn a_simplex_that_cannot_improve_shrinks() {
        // The start is the only finite point: reflection and contraction fail, and both others move to half the way.
        let mut seen = Vec::new();
        search(&[0.0, 0.0], 1.0, &Settings { most_steps: 1, ..RULES }, |x| {
            seen.push((x[0], x[1]));
            if *x == [0.0, 0.0] { 0.0 } else { f64::INFINITY }
        });
        assert_eq!(seen[3..], [(1.0, -1.0), (0.25, 0.5), (0.5, 0.0), (0.0, 0.5)]);
    }

    #[test]
    fn points_are_moved_where_the_function_says() {
        let (x, _) = search(&[0.5, 0.5], 0.2, &RULES, |x| {
            x[0] = x[0].max(0.3);
            x.iter().map(|x| x * x).sum()
        });
        assert!(x[0] == 0.3 && x[1].abs() < 1e-6, "{x:?}");
    }

    #[test]
    fn an_error_ends_the_search() {
        let mut left = 5;
        let found = minimise(vec![-1.2, 1.0], &[0.5; 2], &RULES, |x| {
            left -= 1;
            if left == 0 { Err("spent") } else { Ok(rosenbrock(x)) }
        });
        assert_eq!((found, left), (Err("spent"), 0));
    }

    #[test]
    fn two_variables_have_the_classic_factors() {
        assert_eq!(Factors::adaptive(2), Factors::CLASSIC);
        assert_eq!(Factors::adaptive(4), Factors { expansion: 1.5, contraction: 0.625, shrinkage: 0.75 });
    }
}
