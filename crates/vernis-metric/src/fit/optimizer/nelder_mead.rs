//! The simplex of Nelder and Mead, kept inside the box.
//!
//! n + 1 points; the worst is reflected at the centre of the others, further out if that is the best so far, and else drawn
//! in; if that fails too, all shrink towards the best. With n variables the factors are: reflection 1, expansion 1 + 2/n,
//! contraction 3/4 - 1/(2 n), shrinkage 1 - 1/n. It ends when the simplex is smaller than the tolerance.
//!
//! Source: Nelder & Mead 1965, doi:10.1093/comjnl/7.4.308; the factors: Gao & Han 2012, doi:10.1007/s10589-010-9329-3.
//! Differences: points beyond a bound are moved onto it. A simplex that has collapsed is rebuilt once around its best point,
//! a tenth as large as the first: it may have collapsed onto a bound. Cost: one or two evaluations a step.

use super::{Halt, Run, StopReason};

/// A point and its value.
type Vertex = (Vec<f64>, f64);

pub(super) fn search(run: &mut Run<'_>, start: Vec<f64>) -> Result<StopReason, Halt> {
    let step = run.limits.step;
    collapse(run, start, step)?;
    let best = run.best.clone();
    collapse(run, best, 0.1 * step)?;
    Ok(StopReason::Converged)
}

/// Moves a simplex of edge `step` until it is smaller than the tolerance.
fn collapse(run: &mut Run<'_>, start: Vec<f64>, step: f64) -> Result<(), Halt> {
    let mut simplex = simplex(run, start, step)?;
    let n = simplex.len() - 1;
    let factor = (n.max(2)) as f64;
    let (expansion, contraction) = (1.0 + 2.0 / factor, 0.75 - 0.5 / factor);
    loop {
        simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
        if size(&simplex) < run.limits.tolerance {
            return Ok(());
        }
        let centre: Vec<f64> = (0..n).map(|k| simplex[..n].iter().map(|v| v.0[k]).sum::<f64>() / n as f64).collect();
        let (best, second, worst) = (simplex[0].1, simplex[n - 1].1, simplex[n].1);
        let mut at = |t: f64| -> Result<Vertex, Halt> {
            let worst = &simplex[n].0;
            let point = run.inside(centre.iter().zip(worst).map(|(c, w)| c + t * (c - w)).collect());
            let value = run.value(&point)?;
            Ok((point, value))
        };
        let reflected = at(1.0)?;
        let accepted = if reflected.1 < best {
            let expanded = at(expansion)?;
            Some(if expanded.1 < reflected.1 { expanded } else { reflected })
        } else if reflected.1 < second {
            Some(reflected)
        } else {
            let outside = reflected.1 < worst;
            let contracted = at(if outside { contraction } else { -contraction })?;
            (contracted.1 < if outside { reflected.1 } else { worst }).then_some(contracted)
        };
        match accepted {
            Some(vertex) => simplex[n] = vertex,
            None => shrink(run, &mut simplex, 1.0 - 1.0 / factor)?,
        }
    }
}

/// `start` and its neighbours, one a variable, on the side where there is more room.
fn simplex(run: &mut Run<'_>, start: Vec<f64>, step: f64) -> Result<Vec<Vertex>, Halt> {
    let mut points = vec![start.clone()];
    for (k, &(low, high)) in run.objective.bounds().iter().enumerate() {
        let mut point = start.clone();
        point[k] += if high - point[k] >= point[k] - low { step } else { -step };
        points.push(run.inside(point));
    }
    points.into_iter().map(|p| run.value(&p).map(|value| (p, value))).collect()
}

/// The largest distance from the best point along any variable.
fn size(simplex: &[Vertex]) -> f64 {
    let best = &simplex[0].0;
    let distance = |v: &Vertex| v.0.iter().zip(best).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    simplex.iter().map(distance).fold(0.0, f64::max)
}

fn shrink(run: &mut Run<'_>, simplex: &mut [Vertex], factor: f64) -> Result<(), Halt> {
    let best = simplex[0].0.clone();
    for (point, value) in &mut simplex[1..] {
        point.iter_mut().zip(&best).for_each(|(x, b)| *x = b + factor * (*x - b));
        *value = run.value(point)?;
    }
    Ok(())
}
