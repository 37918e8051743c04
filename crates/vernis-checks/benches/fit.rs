//! What a fit costs: one value of every model, one loss, value and gradient of metrics, one whole fit.
//!
//! `cargo bench --bench fit [models] [gradients] [fit]` prints times on one thread: all parts, or those named.

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

/// Of the values at a metric's nodes: what a fit by gradients asks for in every step.
fn gradients() {
    let reference = Ggx::new([0.2, 0.1, 0.05], [0.04; 3], 0.1).expect("within bounds");
    let candidate = Ggx::new([0.1; 3], [0.05; 3], 0.15).expect("within bounds");
    let registry = Registry::standard().expect("the registry");
    println!("value and gradient at the nodes, against a prepared reference");
    for name in ["D4.Cl", "D4.Cl.CR", "D9.Cl", "energy", "ot", "vernis-loss", "vernis"] {
        let prepared = registry.get(name).and_then(|metric| metric.prepare(&reference)).expect("a name");
        let values = prepared.nodes().expect("a gradient").evaluate(&candidate);
        // The first makes what is made once a process.
        let _ = prepared.gradient_at(&values);
        let value = shortest(7, || drop(black_box(prepared.distance_at(&values))));
        let both = shortest(7, || drop(black_box(prepared.gradient_at(&values))));
        println!(
            "  {name:12} {:8.2} ms a value, {:8.2} ms value and gradient: {:.1} values",
            value * 1e3,
            both * 1e3,
            both / value
        );
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
    let named: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let wanted = |part: &str| named.is_empty() || named.iter().any(|name| name == part);
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
        if wanted("models") {
            models(&directions);
        }
        if wanted("gradients") {
            gradients();
        }
        if wanted("fit") {
            fit();
        }
    });
}
