//! Graphs of analytic BRDFs as the golden values of GeomLoss define them, and the Sinkhorn divergence as its
//! `tensorized` backend computes it, written down with the standard library's functions: the independent side of tests
//! and of the benchmark.

use std::f64::consts::{FRAC_PI_2, PI};
use vernis_metric::metric::graph::GraphGrid;

/// The formulas of the golden pairs, one channel.
#[derive(Debug, Clone, Copy)]
pub enum Model {
    Ggx { a: f64, kd: f64, f0: f64 },
    Ward { a: f64, kd: f64, ks: f64 },
    Blinn { n: f64, kd: f64, ks: f64 },
    Lambert { kd: f64 },
}

impl Model {
    pub fn value(self, theta_i: f64, theta_o: f64, phi_d: f64) -> f64 {
        let (ci, co) = (theta_i.cos(), theta_o.cos());
        let wi = [theta_i.sin(), 0.0, ci];
        let wo = [theta_o.sin() * phi_d.cos(), theta_o.sin() * phi_d.sin(), co];
        let sum = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
        let length = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
        let nh = sum[2] / length;
        let vh = (0..3).map(|k| wi[k] * sum[k]).sum::<f64>() / length;
        match self {
            Self::Ggx { a, kd, f0 } => {
                let a2 = a * a;
                let d = a2 / (PI * (nh * nh * (a2 - 1.0) + 1.0).powi(2));
                let g1 = |c: f64| 2.0 * c / (c + (a2 + (1.0 - a2) * c * c).sqrt());
                let f = f0 + (1.0 - f0) * (1.0 - vh).powi(5);
                kd / PI + d * g1(ci) * g1(co) * f / (4.0 * ci * co)
            }
            Self::Ward { a, kd, ks } => {
                kd / PI + ks / (4.0 * PI * a * a * (ci * co).sqrt()) * (-(1.0 - nh * nh) / (nh * nh) / (a * a)).exp()
            }
            Self::Blinn { n, kd, ks } => kd / PI + ks * (n + 2.0) / (2.0 * PI) * nh.powf(n),
            Self::Lambert { kd } => kd / PI,
        }
    }

    /// phi(max(f cos theta_i, 0)) on `grid`.
    pub fn graph(self, grid: GraphGrid, phi: impl Fn(f64) -> f64) -> Vec<f64> {
        let [n_i, n_o, n_phi] = grid.shape();
        let centre = |k: usize, n: usize, span: f64| (k as f64 + 0.5) * span / n as f64;
        let mut values = Vec::with_capacity(n_i * n_o * n_phi);
        for i in 0..n_i {
            for o in 0..n_o {
                for k in 0..n_phi {
                    let theta_i = centre(i, n_i, FRAC_PI_2);
                    let f = self.value(theta_i, centre(o, n_o, FRAC_PI_2), centre(k, n_phi, 2.0 * PI));
                    values.push(phi((f * theta_i.cos()).max(0.0)));
                }
            }
        }
        values
    }
}

/// A point of a graph.
pub type Point = [f64; 4];

/// The points of a graph.
pub fn points(grid: GraphGrid, alpha: f64, values: &[f64]) -> Vec<Point> {
    let [n_i, n_o, n_phi] = grid.shape();
    let at = |k: usize, n: usize| alpha * (k as f64 + 0.5) / n as f64;
    let point = |(cell, &w): (usize, &f64)| {
        [at(cell / (n_o * n_phi), n_i), at(cell / n_phi % n_o, n_o), at(cell % n_phi, n_phi), w]
    };
    values.iter().enumerate().map(point).collect()
}

fn cost(p: i32, x: &Point, y: &Point) -> f64 {
    let square: f64 = x.iter().zip(y).map(|(x, y)| (x - y).powi(2)).sum();
    if p == 2 { square / 2.0 } else { square.sqrt() }
}

/// -epsilon ln sum_y exp((g(y) - C(x, y))/epsilon)/N at every x.
fn softmin(p: i32, epsilon: f64, targets: &[Point], sources: &[Point], g: &[f64]) -> Vec<f64> {
    let of_target = |x: &Point| {
        let exponents: Vec<f64> = sources.iter().zip(g).map(|(y, g)| (g - cost(p, x, y)) / epsilon).collect();
        let top = exponents.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = exponents.iter().map(|e| (e - top).exp()).sum();
        -epsilon * (top + (sum / sources.len() as f64).ln())
    };
    targets.iter().map(of_target).collect()
}

fn diameter(a: &[Point], b: &[Point]) -> f64 {
    let extent = |axis: usize| {
        let all = || a.iter().chain(b).map(|x| x[axis]);
        all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min)
    };
    (0..4).map(|axis| extent(axis).powi(2)).sum::<f64>().sqrt()
}

/// The divergence of two sets of equally heavy points, every step as in `sinkhorn_loop` of GeomLoss.
pub fn divergence(p: i32, blur: f64, scaling: f64, a: &[Point], b: &[Point]) -> f64 {
    let d = diameter(a, b);
    let mut epsilons = vec![d.powi(p)];
    let mut exponent = f64::from(p) * d.ln();
    while exponent > f64::from(p) * blur.ln() {
        epsilons.push(exponent.exp());
        exponent += f64::from(p) * scaling.ln();
    }
    epsilons.push(blur.powi(p));
    let zero = |x: &[Point]| vec![0.0; x.len()];
    let step = |epsilon: f64, [f_ba, g_ab, f_aa, g_bb]: &[Vec<f64>; 4]| {
        [
            softmin(p, epsilon, a, b, g_ab),
            softmin(p, epsilon, b, a, f_ba),
            softmin(p, epsilon, a, a, f_aa),
            softmin(p, epsilon, b, b, g_bb),
        ]
    };
    let mut all = step(epsilons[0], &[zero(a), zero(b), zero(a), zero(b)]);
    for &epsilon in &epsilons {
        let new = step(epsilon, &all);
        for (old, new) in all.iter_mut().zip(new) {
            old.iter_mut().zip(new).for_each(|(old, new)| *old = 0.5 * (*old + new));
        }
    }
    let [f_ba, g_ab, f_aa, g_bb] = step(blur.powi(p), &all);
    let mean = |f: &[f64], g: &[f64]| f.iter().zip(g).map(|(f, g)| f - g).sum::<f64>() / f.len() as f64;
    mean(&f_ba, &f_aa) + mean(&g_ab, &g_bb)
}
