//! The 36 Lp distances written down as in the documentation of `vernis_metric::metric::lp`, one cell at a time with the
//! standard library's functions and one pass a distance: the independent side of tests and of the benchmark.

use std::f64::consts::PI;
use vernis_metric::brdf::{Grid, TabulatedBrdf};
use vernis_metric::math::{Rgb, color};
use vernis_metric::metric::lp::{Formula, LpVariant};

/// The colour coordinates of the study's program.
fn study_lab(rgb: Rgb) -> [f64; 3] {
    const MATRIX: [[f64; 3]; 3] =
        [[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]];
    const WHITE: [f64; 3] = [95.047, 100.0, 108.883];
    // Not transposed: the row vector times the matrix.
    let t = [0, 1, 2].map(|j| (0..3).map(|i| rgb[i] * MATRIX[i][j]).sum::<f64>() / WHITE[j]);
    let f = |t: f64| if t < (24.0f64 / 116.0).powi(3) { t.cbrt() } else { 84.0 / 108.0 * t + 16.0 / 116.0 };
    [116.0 * t[1] - 16.0, 500.0 * (f(t[0]) - f(t[1])), 200.0 * (f(t[1]) - f(t[2]))]
}

/// The term of one cell, all channels together.
fn term(variant: LpVariant, theta_i: f64, theta_o: f64, reference: Rgb, candidate: Rgb) -> f64 {
    let (cos_i, cos_o, sin_o) = (theta_i.cos(), theta_o.cos(), theta_o.sin());
    let c = (cos_i * cos_o).max(1e-3);
    let root = |x: f64| if variant.cube_root { x.cbrt() } else { x };
    let log = |r: f64, a: f64| ((r * c + 1e-3) / (a * c + 1e-3)).ln();
    let colour = |r: [f64; 3], a: [f64; 3]| (0..3).map(|k| (a[k] - r[k]).powi(2)).sum::<f64>() * cos_o * cos_i;
    let (r, a) = (reference.map(root), candidate.map(root));
    let sum = |of: &dyn Fn(f64, f64) -> f64| (0..3).map(|k| of(r[k], a[k])).sum::<f64>();
    match variant.formula {
        Formula::D1 => sum(&|r, a| (a - r).powi(2)),
        Formula::D2 => sum(&|r, a| ((a - r) * cos_i).powi(2)),
        Formula::D3 => sum(&|r, a| ((a - r) * cos_i).powi(2).cbrt()),
        Formula::D4 => sum(&|r, a| (a - r).powi(2) * cos_o * sin_o),
        Formula::D5 => sum(&|r, a| (a - r).abs()),
        Formula::D6 => colour(study_lab(reference).map(root), study_lab(candidate).map(root)),
        Formula::D7 => sum(&|r, a| ((a - r) * c).powi(2).cbrt()),
        Formula::D8 => sum(&|r, a| log(r, a).abs()),
        Formula::D9 => sum(&|r, a| log(r, a).powi(2)),
        Formula::Lab => {
            let lab = |rgb: Rgb| color::cielab(rgb.map(|x| root(PI * x)));
            colour(lab(reference), lab(candidate))
        }
        other => panic!("no naive form of {other:?}"),
    }
}

/// One distance, in one pass of its own over the tables.
pub fn distance(variant: LpVariant, reference: &TabulatedBrdf, candidate: &TabulatedBrdf) -> f64 {
    assert_eq!((reference.grid(), candidate.grid()), (Grid::TITOPO, Grid::TITOPO));
    let limit = if variant.clamped { 80 } else { 90 };
    let (mut sum, mut cells) = (0.0, 0);
    for i in 0..limit {
        for o in 0..limit {
            let start = (i * 90 + o) * 360;
            let mut block = 0.0;
            for k in (start..start + 360).filter(|&k| reference.valid()[k] && candidate.valid()[k]) {
                let (r, a) = (reference.values()[k].map(f64::from), candidate.values()[k].map(f64::from));
                block += term(variant, (i as f64).to_radians(), (o as f64).to_radians(), r, a);
                cells += 1;
            }
            sum += block;
        }
    }
    let mean = sum / f64::from(cells);
    match variant.formula {
        Formula::D5 | Formula::D7 | Formula::D8 => mean,
        _ => mean.sqrt(),
    }
}
