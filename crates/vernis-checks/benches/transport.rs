//! The Sinkhorn divergence of three channels, as `ot` takes it, of the golden pairs (a second's throughput, so
//! that its inverse is the mean of a pair): three sizes, default and fast, prepared and not, beside sums
//! over all pairs with the standard library on a small size; clusters of cells, for p = 1; the energy distance; two workers beside one.
//!
//! `RAYON_NUM_THREADS=1 cargo bench --bench transport` for one thread.

#[path = "../../vernis-metric/tests/it/transport_golden.rs"]
#[allow(dead_code)]
mod transport_golden;
#[path = "../../vernis-metric/tests/it/transport_pairs.rs"]
#[allow(dead_code)]
mod transport_pairs;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rayon::prelude::*;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;
use transport_golden::GOLDEN;
use transport_pairs::{Model, Point};
use vernis_metric::brdf::models::Ggx;
use vernis_metric::metric::Side;
use vernis_metric::metric::graph::{CosineTable, GraphGrid, GraphMetric};
use vernis_metric::metric::kernel::KernelMetric;
use vernis_metric::metric::transport::{
    Accuracy, GroundCost, PreparedChannel, SinkhornParameters, divergence, divergence_and_gradient,
};

const ALPHA: f64 = 0.1;
const BLUR: f64 = 0.05;
const SCALING: f64 = 0.8;

/// The place of the pair of metals among the golden ones.
const METALS: usize = 3;

/// phi(f cos theta_i) of the channels of the golden pairs, reference and candidate.
fn graphs(grid: GraphGrid) -> Vec<[[Vec<f64>; 2]; 3]> {
    let graph = |model: Model| model.graph(grid, |t| t.sqrt().sqrt());
    GOLDEN.iter().map(|pair| [0, 1, 2].map(|c| pair.models.map(|models| graph(models[c])))).collect()
}

fn transport(criterion: &mut Criterion) {
    let study = SinkhornParameters::new(GroundCost::SquaredDistance, ALPHA, BLUR, SCALING).expect("parameters");
    let fast = study.with_accuracy(Accuracy::fast(ALPHA, BLUR)).expect("an accuracy");
    let mut group = criterion.benchmark_group("ot, three channels");
    group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(4));
    for size in ["9x9x36", "45x45x180", "90x90x360"] {
        let grid: GraphGrid = size.parse().expect("a grid");
        let mut graphs = graphs(grid);
        if size == "90x90x360" {
            // The metals, whose value axis is the longest, alone.
            graphs = graphs.split_off(METALS);
            graphs.truncate(1);
        }
        group.throughput(Throughput::Elements(graphs.len() as u64));
        for (accuracy, parameters) in [("default", study), ("fast", fast)] {
            let prepare = |values: &[f64]| PreparedChannel::new(&parameters, grid, values, None).expect("a channel");
            group.bench_function(BenchmarkId::new(accuracy, size), |bencher| {
                bencher.iter(|| {
                    for [a, b] in graphs.iter().flatten() {
                        black_box(divergence(&parameters, &prepare(a), &prepare(b)).expect("a divergence"));
                    }
                });
            });
        }
        let channel = |values: &Vec<f64>| PreparedChannel::new(&study, grid, values, None).expect("a channel");
        let prepared: Vec<[PreparedChannel; 2]> =
            graphs.iter().flatten().map(|pair| pair.each_ref().map(channel)).collect();
        group.bench_function(BenchmarkId::new("default, both prepared", size), |bencher| {
            bencher.iter(|| {
                for [a, b] in &prepared {
                    black_box(divergence(&study, a, b).expect("a divergence"));
                }
            });
        });
        group.bench_function(BenchmarkId::new("with gradient", size), |bencher| {
            bencher.iter(|| {
                for [a, b] in &prepared {
                    black_box(divergence_and_gradient(&study, a, b).expect("a gradient"));
                }
            });
        });
    }
    group.finish();
}

/// 4 x 4 x 16 cells: 130 times fewer pairs of cells than on 9 x 9 x 36, two million times fewer than on 45 x 45 x 180.
fn all_pairs(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sums over all pairs, three channels");
    group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(2));
    let grid: GraphGrid = "4x4x16".parse().expect("a grid");
    let points: Vec<[Vec<Point>; 2]> = graphs(grid)
        .iter()
        .flatten()
        .map(|pair| pair.each_ref().map(|v| transport_pairs::points(grid, ALPHA, v)))
        .collect();
    group.throughput(Throughput::Elements(points.len() as u64 / 3));
    group.bench_function("standard library, 4x4x16", |bencher| {
        bencher.iter(|| {
            for [a, b] in &points {
                black_box(transport_pairs::divergence(2, BLUR, SCALING, a, b));
            }
        });
    });
    group.finish();
}

/// The metric `energy`, its reference prepared, the candidate a table.
fn energy(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("energy, three channels");
    group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(4));
    let metal = |alpha| Ggx { kd: [0.01; 3], f0: [0.95, 0.64, 0.54], alpha };
    for size in ["9x9x36", "45x45x180", "90x90x360"] {
        let graph = KernelMetric::named(&format!("energy[grid={size}]")).expect("a metric");
        let table = |alpha| CosineTable::of(&metal(alpha), graph.grid(), Side::Alone).expect("a table");
        let (reference, candidate) = (table(0.02f64.sqrt()), table(0.03f64.sqrt()));
        let prepared = graph.prepare_table(Arc::new(reference)).expect("valid");
        group.bench_function(size, |bencher| {
            bencher.iter(|| black_box(prepared.channels(&candidate).expect("divergences")));
        });
    }
    group.finish();
}

/// The metals with p = 1, whose cells are clustered on the finer grids, with and without a gradient; and p = 2 with so long a base that its
/// cells are clustered as well.
fn clusters(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("ot in clusters, three channels");
    group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(4));
    for (name, cost, alpha) in
        [("p 1", GroundCost::Distance, ALPHA), ("p 2, alpha 2", GroundCost::SquaredDistance, 2.0)]
    {
        let parameters = SinkhornParameters::new(cost, alpha, BLUR, SCALING).expect("parameters");
        for size in ["9x9x36", "45x45x180"] {
            let grid: GraphGrid = size.parse().expect("a grid");
            let channels = graphs(grid).swap_remove(METALS);
            let prepare = |values: &Vec<f64>| PreparedChannel::new(&parameters, grid, values, None).expect("a channel");
            let channels = channels.each_ref().map(|pair| pair.each_ref().map(prepare));
            group.bench_function(BenchmarkId::new(name, size), |bencher| {
                bencher.iter(|| channels.each_ref().map(|[a, b]| divergence(&parameters, a, b).expect("a divergence")));
            });
            group.bench_function(BenchmarkId::new(format!("{name}, with gradient"), size), |bencher| {
                let gradient =
                    |[a, b]: &[PreparedChannel; 2]| divergence_and_gradient(&parameters, a, b).expect("a gradient");
                bencher.iter(|| channels.each_ref().map(gradient));
            });
        }
    }
    group.finish();
}

/// Eight divergences of one channel shared by one worker and by two.
fn workers(criterion: &mut Criterion) {
    let study = SinkhornParameters::new(GroundCost::SquaredDistance, ALPHA, BLUR, SCALING).expect("parameters");
    let [[pair, ..], ..] = &graphs(GraphGrid::STUDY)[..] else { return };
    let prepare = |values: &[f64]| PreparedChannel::new(&study, GraphGrid::STUDY, values, None).expect("a channel");
    let [a, b] = pair.each_ref().map(|values| prepare(values));
    let mut group = criterion.benchmark_group("ot, 8 channels of 45x45x180");
    group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(4));
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        group.bench_function(format!("{threads} workers"), |bencher| {
            let each = |_| black_box(divergence(&study, &a, &b).expect("a divergence"));
            bencher.iter(|| pool.install(|| (0..8).into_par_iter().map(each).sum::<f64>()));
        });
    }
    group.finish();
}

criterion_group!(benches, transport, clusters, all_pairs, energy, workers);
criterion_main!(benches);
