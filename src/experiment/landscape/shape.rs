//! Figures of one curve of distances: how far it falls where it should rise.

/// The largest fall along a sequence that should rise: the largest of x_i - x_j over i <= j; 0 where it never falls.
pub fn largest_fall(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut highest = f64::NEG_INFINITY;
    let mut fall = 0.0f64;
    for value in values {
        highest = highest.max(value);
        fall = fall.max(highest - value);
    }
    fall
}

/// How deep the deepest hollow of a curve is, beside its lowest point: the largest fall on the way out from there, to either side.
/// A search that only descends stops in a hollow; one that allows for this rise leaves it.
pub fn hollow(values: &[f64]) -> f64 {
    let Some(lowest) = lowest(values) else { return 0.0 };
    let outwards = largest_fall(values[lowest..].iter().copied());
    outwards.max(largest_fall(values[..=lowest].iter().rev().copied()))
}

/// The largest change of slope between neighbouring segments of a curve whose points are `step` apart, in units of `values` a unit of
/// `step`: large at a kink and at a step. Three points around each index of `except`, where a distance has its corner, do not count.
pub fn largest_bend(values: &[f64], step: f64, except: &[usize]) -> f64 {
    let counts = |i: usize| except.iter().all(|e| e.abs_diff(i) > 1);
    let bend = |i: usize| (values[i + 1] - 2.0 * values[i] + values[i - 1]).abs() / step;
    (1..values.len().saturating_sub(1)).filter(|i| counts(*i)).map(bend).fold(0.0, f64::max)
}

/// The index of the lowest value, the first of several.
pub fn lowest(values: &[f64]) -> Option<usize> {
    (0..values.len()).min_by(|a, b| values[*a].total_cmp(&values[*b]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn falls_count_from_the_highest_point_before() {
        assert_eq!(largest_fall([0.0, 1.0, 2.0, 2.0]), 0.0);
        assert_eq!(largest_fall([0.0, 2.0, 1.75, 1.9, 1.5, 3.0, 2.9]), 0.5);
        assert_eq!(largest_fall([]), 0.0);
    }

    #[test]
    fn hollows_lie_beside_the_lowest_point() {
        // |x| has none; a dent of 0.25 on the left has that depth; the lowest point itself is no hollow.
        assert_eq!(hollow(&[2.0, 1.0, 0.0, 1.0, 2.0]), 0.0);
        assert_eq!(hollow(&[2.0, 0.75, 1.0, 0.0, 1.0]), 0.25);
        assert_eq!(hollow(&[1.0, 1.0, -0.5]), 0.0);
    }

    #[test]
    fn bends_are_those_of_kinks_and_steps_but_not_of_the_corner() {
        let corner: Vec<f64> = (-10..=10).map(|i| f64::from(i).abs() / 10.0).collect();
        assert!(largest_bend(&corner, 0.1, &[10]) < 1e-12);
        assert!((largest_bend(&corner, 0.1, &[]) - 2.0).abs() < 1e-12);
        // A step of 0.5 within a tenth is a slope of 5.
        let step: Vec<f64> = (0..=10).map(|i| if i > 5 { 0.5 } else { 0.0 }).collect();
        assert!((largest_bend(&step, 0.1, &[0]) - 5.0).abs() < 1e-12);
        assert_eq!(largest_bend(&[1.0], 0.1, &[]), 0.0);
    }
}
