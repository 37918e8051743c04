//! What a fit costs: one value of every model, one loss, one whole fit.
//!
//! `cargo bench --bench fit` prints times on one thread.

use std::hint::black_box;
use std::time::Instant;
use vernis_metric::brdf::models::{Ggx, MODELS, Ward, WardForm, build, schema};
use vernis_metric::brdf::{Grid, TabulatedBrdf};
use vernis_metric::fit::Fitting;
use vernis_metric::fit::loss::{Loss, LpLoss};
use vernis_metric::math::Vec3;
use vernis_metric::math::coordinates::standard_directions;
use vernis_metric::metric::registry::Registry;

/// The shortest of several runs, seconds.
fn shortest(runs: usize, mut run: impl FnMut()) -> f64 {
    let timed = |_| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64()
    };
    (0..runs).map(timed).fold(f64::INFINITY, f64::min)
}

fn models(directions: &[(Vec3, Vec3)]) {
    println!("ns per evaluation of a model at its start");
    for id in MODELS {
        let p: Vec<f64> = schema(id).expect("a model").iter().map(|p| p.start).collect();
        let model = build(id, &p).expect("a start is valid");
        let time = shortest(5, || {
            directions.iter().for_each(|&(wi, wo)| {
                black_box(model.value(wi, wo));
            });
        });
        println!("  {id:30} {:8.1}", time / directions.len() as f64 * 1e9);
    }
}

fn fit() {
    let ward = Ward::new([0.1, 0.2, 0.05], [0.05, 0.04, 0.03], 0.12, WardForm::Duer).expect("within bounds");
    let reference = TabulatedBrdf::tabulate(&ward, Grid::MERL).expect("a valid BRDF");
    let candidate = Ggx::new([0.1; 3], [0.04; 3], 0.15).expect("within bounds");
    println!("D4.Cl of GGX against a 90x90x180 table, by coarsening");
    for n in [1, 2, 3, 4, 6] {
        let mut loss = None;
        let prepare =
            shortest(1, || loss = LpLoss::new(&reference, "D4.Cl".parse().expect("a name"), n).expect("valid"));
        let loss = loss.expect("no colour difference");
        let time = shortest(3, || drop(black_box(loss.value(&candidate))));
        let differentiable = loss.as_differentiable().expect("a gradient");
        let gradient = shortest(3, || drop(black_box(differentiable.gradient(&candidate))));
        println!(
            "  {n}: {:8} directions, prepared in {:6.1} ms, {:7.2} ms a value, {:7.2} ms a gradient",
            loss.directions(),
            prepare * 1e3,
            time * 1e3,
            gradient * 1e3
        );
    }
    let registry = Registry::standard().expect("the registry");
    println!("whole fits of GGX to the table");
    for name in ["D4.Cl", "D9.Cl", "vernis"] {
        let metric = registry.get(name).expect("a name");
        let _ = metric.distance(&reference, &candidate);
        let start = Instant::now();
        let fitted = Fitting::new("ggx", &*metric).run(&reference, &|_, _| ()).expect("a fit");
        println!(
            "  {name:8} {:6.2} s, {} + {} evaluations, {:.6} to {:.6}, {}",
            start.elapsed().as_secs_f64(),
            fitted.evaluations,
            fitted.polish_evaluations,
            fitted.value_at_start,
            fitted.value,
            fitted.stop.name()
        );
    }
}

fn main() {
    let angle = |k: usize, n: usize, span: f64| (k as f64 + 0.5) / n as f64 * span;
    let directions: Vec<_> = (0..16_384)
        .map(|k| {
            standard_directions(
                angle(k % 16, 16, 1.5),
                angle(k / 16 % 16, 16, 1.5),
                angle(k / 256, 64, std::f64::consts::TAU),
            )
        })
        .collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    pool.install(|| {
        models(&directions);
        fit();
    });
}
