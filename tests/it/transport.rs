//! The Sinkhorn divergence against GeomLoss, against sums over all pairs, and against theory.

use crate::transport_pairs::{self as pairs, Model};
use serde_json::Value;
use vernis::metric::graph::GraphGrid;
use vernis::metric::transport::{Accuracy, GroundCost, PreparedChannel, SinkhornParameters, divergence};

/// The golden file: GeomLoss 0.3.1, `SamplesLoss("sinkhorn", p=2, blur=.05, scaling=.8, backend="tensorized")`, f64.
fn golden() -> Value {
    serde_json::from_str(include_str!("transport_golden.json")).unwrap()
}

fn study() -> SinkhornParameters {
    SinkhornParameters::new(GroundCost::SquaredDistance, 0.1, 0.05, 0.8).unwrap()
}

fn fourth_root(t: f64) -> f64 {
    t.sqrt().sqrt()
}

fn between(parameters: &SinkhornParameters, grid: GraphGrid, a: &[f64], b: &[f64]) -> f64 {
    let prepare = |values| PreparedChannel::new(parameters, grid, values, None).unwrap();
    divergence(parameters, &prepare(a), &prepare(b)).unwrap()
}

/// The largest relative error over the golden channels of one grid.
fn worst_golden(parameters: &SinkhornParameters, grid: GraphGrid) -> f64 {
    let mut worst: f64 = 0.0;
    for pair in golden()["pairs"].as_array().unwrap() {
        for channel in 0..3 {
            let expected = pair[format!("grid_{grid}")]["sinkhorn"][channel].as_f64().unwrap();
            let [a, b] = ["A", "B"].map(|side| Model::from_json(&pair[side], channel).graph(grid, fourth_root));
            let found = between(parameters, grid, &a, &b);
            println!("{grid} {} {channel}: {found:e} {expected:e} {:.1e}", pair["name"], found / expected - 1.0);
            if expected == 0.0 {
                assert_eq!(found, 0.0);
            } else {
                worst = worst.max((found / expected - 1.0).abs());
            }
        }
    }
    worst
}

#[test]
fn default_accuracy_is_within_one_per_cent_of_geomloss() {
    for grid in ["6x6x24", "9x9x36"] {
        let worst = worst_golden(&study(), grid.parse().unwrap());
        assert!(worst < 0.01, "{grid}: {worst}");
    }
}

#[test]
fn high_accuracy_is_within_a_thousandth_of_geomloss() {
    let parameters = study().with_accuracy(Accuracy::high(0.1, 0.05)).unwrap();
    for grid in ["6x6x24", "9x9x36"] {
        let worst = worst_golden(&parameters, grid.parse().unwrap());
        assert!(worst < 0.001, "{grid}: {worst}");
    }
}

#[test]
fn fast_accuracy_is_within_four_per_cent_of_geomloss() {
    let parameters = study().with_accuracy(Accuracy::fast(0.1, 0.05)).unwrap();
    for grid in ["6x6x24", "9x9x36"] {
        let worst = worst_golden(&parameters, grid.parse().unwrap());
        assert!(worst < 0.04, "{grid}: {worst}");
    }
}
