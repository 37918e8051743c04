//! L-BFGS over a box: quasi-Newton steps among the variables that are free to move, projected onto the bounds.
//!
//! A variable is held where it stands at a bound that the gradient pushes against. For the others the direction is d = -H g, H
//! from the last ten pairs s = x' - x, y = g' - g with s.y > 0. Without pairs the first step is of the given length. With P the
//! projection, the step t is taken at P(x + t d) that fulfils the weak Wolfe conditions: the value falls by at least
//! 1e-4 g.(P(x + t d) - x), and the slope along the path is at least 0.9 g.d. It is found by doubling while the slope is too steep,
//! by the lowest point of a parabola while no value is low enough, and by halving between the two ends.
//! It ends when the projected gradient step P(x - g/|f|) - x, f the value, or the step taken is shorter than the tolerance.
//!
//! The weak conditions, not the strong ones, also lead a search along the edges of a function that is not smooth: they keep s.y
//! positive across an edge, so that H learns how steep the edge is (Lewis & Overton 2013, algorithm 2.6,
//! doi:10.1007/s10107-012-0514-2).
//!
//! Source: Liu & Nocedal 1989, algorithm 2.1 and the two-loop recursion, doi:10.1007/BF01589116; the projection of Bertsekas
//! 1982, doi:10.1137/0320018, with held variables. Difference: L-BFGS-B (Byrd et al. 1995, doi:10.1137/0916069) looks for the
//! held variables along the whole projected path; for the few of a model's parameters that lie at a bound this is not needed.
//! Cost: one evaluation of value and gradient a step, seldom more.

use super::{Halt, Run, StopReason};
use std::collections::VecDeque;

const PAIRS: usize = 10;
/// Of the weak Wolfe conditions: the share of the expected fall, and of the first slope that may be left.
const DECREASE: f64 = 1e-4;
const CURVATURE: f64 = 0.9;
/// Points along a direction before it is given up.
const TRIALS: usize = 30;

/// A step and the change of the gradient along it.
struct Pair {
    s: Vec<f64>,
    y: Vec<f64>,
    sy: f64,
}

struct Point {
    x: Vec<f64>,
    value: f64,
    gradient: Vec<f64>,
}

pub(super) fn search(run: &mut Run<'_>, start: Vec<f64>) -> Result<StopReason, Halt> {
    let (value, gradient) = run.gradient(&start)?;
    let mut point = Point { x: start, value, gradient };
    let mut pairs: VecDeque<Pair> = VecDeque::new();
    loop {
        if projected_step(run, &point) < run.limits.tolerance {
            return Ok(StopReason::Converged);
        }
        let free = free_variables(run, &point);
        let direction = direction(&point.gradient, &free, &pairs, run.limits.step);
        let Some(next) = descend(run, &point, &direction)? else {
            // Old curvature may mislead; the plain gradient is the last word.
            if pairs.is_empty() {
                return Ok(StopReason::NoDescent);
            }
            pairs.clear();
            continue;
        };
        let difference = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
        let pair = (difference(&next.x, &point.x), difference(&next.gradient, &point.gradient));
        let length = pair.0.iter().fold(0.0f64, |m, s| m.max(s.abs()));
        let sy = dot(&pair.0, &pair.1);
        if sy > 1e-12 * dot(&pair.1, &pair.1).sqrt() * dot(&pair.0, &pair.0).sqrt() {
            pairs.push_back(Pair { s: pair.0, y: pair.1, sy });
            if pairs.len() > PAIRS {
                pairs.pop_front();
            }
        }
        point = next;
        if length < run.limits.tolerance {
            return Ok(StopReason::Converged);
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The largest component of P(x - g/|f|) - x: free of the scale of f.
fn projected_step(run: &Run<'_>, point: &Point) -> f64 {
    let scale = point.value.abs().max(f64::MIN_POSITIVE);
    let stepped = run.inside(point.x.iter().zip(&point.gradient).map(|(x, g)| x - g / scale).collect());
    stepped.iter().zip(&point.x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn free_variables(run: &Run<'_>, point: &Point) -> Vec<bool> {
    let at =
        |((x, g), &(low, high)): ((&f64, &f64), &(f64, f64))| !((*x <= low && *g > 0.0) || (*x >= high && *g < 0.0));
    point.x.iter().zip(&point.gradient).zip(run.objective.bounds()).map(at).collect()
}

/// -H g among the free variables, zero in the others.
fn direction(gradient: &[f64], free: &[bool], pairs: &VecDeque<Pair>, step: f64) -> Vec<f64> {
    let masked = |v: &[f64]| -> Vec<f64> { v.iter().zip(free).map(|(v, free)| if *free { *v } else { 0.0 }).collect() };
    let mut q = masked(gradient);
    let mut weights = Vec::with_capacity(pairs.len());
    for pair in pairs.iter().rev() {
        let weight = dot(&pair.s, &q) / pair.sy;
        q.iter_mut().zip(&pair.y).for_each(|(q, y)| *q -= weight * y);
        weights.push(weight);
    }
    let scale = match pairs.back() {
        Some(last) => last.sy / dot(&last.y, &last.y),
        None => step / dot(&q, &q).sqrt().max(f64::MIN_POSITIVE),
    };
    q.iter_mut().for_each(|q| *q *= scale);
    for (pair, weight) in pairs.iter().zip(weights.into_iter().rev()) {
        let correction = weight - dot(&pair.y, &q) / pair.sy;
        q.iter_mut().zip(&pair.s).for_each(|(q, s)| *q += correction * s);
    }
    let downhill = masked(&q);
    // A held variable may turn the direction uphill; the gradient itself never does.
    let direction = if dot(&downhill, gradient) > 0.0 { downhill } else { masked(gradient) };
    direction.into_iter().map(|d| -d).collect()
}

/// A point along the projected direction that fulfils the weak Wolfe conditions; where none is found, the farthest that is known
/// to be low enough.
fn descend(run: &mut Run<'_>, from: &Point, direction: &[f64]) -> Result<Option<Point>, Halt> {
    let falls = dot(direction, &from.gradient);
    let longest = direction.iter().fold(0.0f64, |m, d| m.max(d.abs()));
    let (mut low, mut high, mut t) = (0.0, f64::INFINITY, 1.0);
    let mut found: Option<Point> = None;
    for _ in 0..TRIALS {
        let x = run.inside(from.x.iter().zip(direction).map(|(x, d)| x + t * d).collect());
        let slope: f64 = x.iter().zip(&from.x).zip(&from.gradient).map(|((a, b), g)| (a - b) * g).sum();
        let trial = if slope < 0.0 { Some(run.gradient(&x)?) } else { None };
        match trial {
            Some((value, gradient)) if value <= from.value + DECREASE * slope => {
                // Along the path, a variable at its bound stands still.
                let moving = |(i, d): (usize, &f64)| if x[i] == from.x[i] + t * d { d * gradient[i] } else { 0.0 };
                let still_falls: f64 = direction.iter().enumerate().map(moving).sum();
                let enough = still_falls >= CURVATURE * falls;
                found = Some(Point { x, value, gradient });
                if enough {
                    return Ok(found);
                }
                low = t;
                t = if high.is_finite() { 0.5 * (low + high) } else { 2.0 * t };
            }
            Some((value, _)) if low == 0.0 => {
                high = t;
                // The lowest point of the parabola through what is known, between a tenth and a half of the step.
                let fitted = -0.5 * slope / (value - from.value - slope);
                t *= if fitted.is_finite() { fitted.clamp(0.1, 0.5) } else { 0.1 };
            }
            _ => {
                high = t;
                t = 0.5 * (low + high);
            }
        }
        let left = if high.is_finite() { high - low } else { t };
        if left * longest < 1e-3 * run.limits.tolerance {
            break;
        }
    }
    Ok(found)
}
