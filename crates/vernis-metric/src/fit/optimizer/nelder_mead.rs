//! The simplex of Nelder and Mead, kept inside the box.
//!
//! The steps are those of [`crate::math::nelder_mead`], with factors that depend on the number of variables; the search ends
//! when the simplex is smaller than the tolerance. Points beyond a bound are moved onto it. A simplex that has collapsed is
//! rebuilt once around its best point, a tenth as large as the first: it may have collapsed onto a bound. Cost: one or two
//! evaluations a step.

use super::{Halt, Run, StopReason};
use crate::math::nelder_mead::{Factors, Mean, Settings, Stop, minimise};

pub(super) fn search(run: &mut Run<'_>, start: Vec<f64>) -> Result<StopReason, Halt> {
    let step = run.limits.step;
    collapse(run, start, step)?;
    if !run.best_value.is_finite() {
        // There is no best point to rebuild it around.
        return Ok(StopReason::Converged);
    }
    let best = run.best.clone();
    collapse(run, best, 0.1 * step)?;
    Ok(StopReason::Converged)
}

/// Moves a simplex of edge `step` until it is smaller than the tolerance. Its first points lie on the side of `start` where
/// there is more room.
fn collapse(run: &mut Run<'_>, start: Vec<f64>, step: f64) -> Result<(), Halt> {
    let roomy = |(x, &(low, high)): (&f64, &(f64, f64))| if high - x >= x - low { step } else { -step };
    let edges: Vec<f64> = start.iter().zip(run.objective.bounds()).map(roomy).collect();
    let settings = Settings {
        factors: Factors::adaptive(start.len()),
        stop: Stop::Size(run.limits.tolerance),
        mean: Mean::OfSum,
        // The evaluations end a search that does not settle.
        most_steps: usize::MAX,
    };
    minimise(start, &edges, &settings, |x| {
        run.move_inside(x);
        run.value(x)
    })?;
    Ok(())
}
