//! Pattern search: try a step up and down along each variable in turn, then repeat what helped as one jump.
//!
//! From the base point b with step h: explore around b to p. While p is better, jump to 2 p - b, explore around it, and let p
//! be the new base. When a round of steps gains less than the given share of the value, halve h; end when h falls below the
//! tolerance.
//!
//! Source: Hooke & Jeeves 1961, doi:10.1145/321062.321069. Differences: points beyond a bound are moved onto it; a variable
//! is tried first in the direction that helped last; a round that gains a little moves the base, but is not repeated at the same
//! step. Cost: up to two evaluations a variable and step.

use super::{Halt, Run, StopReason};

pub(super) fn search(run: &mut Run<'_>, start: Vec<f64>) -> Result<StopReason, Halt> {
    let mut base_value = run.value(&start)?;
    let mut base = start;
    let mut step = run.limits.step;
    let mut signs = vec![1.0; base.len()];
    let gain = run.limits.gain;
    let improves = |value: f64, than: f64| value < than - gain * than.abs();
    while step >= run.limits.tolerance {
        let (mut point, mut value) = explore(run, base.clone(), base_value, step, &mut signs)?;
        if !improves(value, base_value) {
            if value < base_value {
                (base, base_value) = (point, value);
            }
            step *= 0.5;
            continue;
        }
        while improves(value, base_value) {
            let jump = run.inside(point.iter().zip(&base).map(|(p, b)| 2.0 * p - b).collect());
            (base, base_value) = (point, value);
            let jumped = run.value(&jump)?;
            (point, value) = explore(run, jump, jumped, step, &mut signs)?;
        }
        if value < base_value {
            (base, base_value) = (point, value);
        }
    }
    Ok(StopReason::Converged)
}

/// The point reached from `x` by one step along each variable that lowers the value.
fn explore(
    run: &mut Run<'_>,
    mut x: Vec<f64>,
    mut value: f64,
    step: f64,
    signs: &mut [f64],
) -> Result<(Vec<f64>, f64), Halt> {
    for k in 0..x.len() {
        let (low, high) = run.objective.bounds()[k];
        let here = x[k];
        for sign in [signs[k], -signs[k]] {
            let there = (here + sign * step).clamp(low, high);
            if there == here {
                continue;
            }
            x[k] = there;
            let found = run.value(&x)?;
            if found < value {
                (value, signs[k]) = (found, sign);
                break;
            }
            x[k] = here;
        }
    }
    Ok((x, value))
}
