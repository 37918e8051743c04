//! Values that hold as long as versions do: a number that moves while its version stays fails here.
//!
//! `golden.json` has the distances of one Lp metric of each formula, `ot`, `energy`, both MMD and the shipped metric, and the
//! descriptors of every family, on pairs made by code. They are this program's own numbers, kept: that they are the right ones is
//! tested elsewhere against values from outside. Whoever changes a number on purpose raises the version beside the algorithm, adds a
//! line to the changelog, and writes the file anew:
//!
//! ```text
//! cargo test --release -p vernis-metric write_the_golden_values -- --ignored
//! ```

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use vernis_metric::brdf::models::{AnalyticBrdf, build};
use vernis_metric::brdf::{Brdf, Grid, TabulatedBrdf};
use vernis_metric::descriptor::{BrdfFeatures, DescriptorOptions, DescriptorSet, Family, Setup};
use vernis_metric::metric::registry::{Registry, distances};

const METRICS: [&str; 17] = [
    "D1",
    "D2.Cl",
    "D3.CR",
    "D4.Cl",
    "D5.Cl.CR",
    "D6",
    "D7.Cl",
    "D8.CR",
    "D9.Cl",
    "lab.Cl",
    "ot",
    "energy",
    "mmd-gaussian",
    "mmd-laplacian",
    "vernis",
    "vernis-loss",
    "vernis-1",
];

/// The setups that code alone defines, of every version that this program computes.
const SETUPS: [&str; 2] = ["v1-lamps-sphere", "v2-lamps-sphere"];

/// How far a number may be off that is the same: vector code of other instruction sets rounds otherwise.
const SAME: f64 = 1e-9;

#[derive(Debug, Serialize, Deserialize)]
struct Golden {
    /// By metric: its version, and a distance a pair.
    metrics: BTreeMap<String, (String, Vec<f64>)>,
    /// By the id of the setup that they belong to, and by family: the descriptors of each pair.
    descriptors: BTreeMap<String, BTreeMap<String, Vec<Vec<f64>>>>,
}

/// A plastic against a rougher one, a metal against another model, a fabric against a table with gaps.
fn pairs() -> Vec<(Arc<dyn Brdf>, Arc<dyn Brdf>)> {
    let model = |id: &str, p: &[f64]| -> Arc<dyn AnalyticBrdf> { build(id, p).unwrap() };
    let cloth = model("lafortune", &[0.15, 0.08, 0.06, 0.02, 0.02, 0.02, -0.4, 0.6, 3.0]);
    let grid = Grid::HalfDifference { theta_h: 30, theta_d: 15, phi_d: 20 };
    let whole = TabulatedBrdf::tabulate(&*model("ward", &[0.15, 0.08, 0.06, 0.03, 0.03, 0.03, 0.4]), grid).unwrap();
    let valid = whole.valid().iter().enumerate().map(|(cell, valid)| *valid && cell % 37 != 0).collect();
    let gaps = TabulatedBrdf::new(grid, whole.values().to_vec(), valid).unwrap();
    vec![
        (
            model("ggx", &[0.3, 0.1, 0.05, 0.04, 0.04, 0.04, 0.1]),
            model("ggx", &[0.28, 0.1, 0.06, 0.04, 0.04, 0.04, 0.18]),
        ),
        (
            model("ggx", &[0.0, 0.0, 0.0, 0.95, 0.64, 0.54, 0.25]),
            model("beckmann-schlick", &[0.02, 0.01, 0.01, 0.9, 0.6, 0.5, 0.22]),
        ),
        (cloth, Arc::new(gaps)),
    ]
}

fn computed() -> Golden {
    let registry = Registry::standard().unwrap();
    let metrics = METRICS.map(|name| registry.get(name).unwrap());
    let pairs = pairs();
    let mut found: BTreeMap<String, (String, Vec<f64>)> =
        metrics.iter().map(|m| (m.name().to_owned(), (m.version().to_owned(), Vec::new()))).collect();
    for (reference, candidate) in &pairs {
        for distance in distances(&metrics, &**reference, &**candidate).unwrap() {
            found.get_mut(&distance.metric).unwrap().1.push(distance.value);
        }
    }
    let of_setup = |id: &str| {
        let setup = Setup::find(id, &DescriptorOptions::default()).unwrap();
        let features = |brdf: &Arc<dyn Brdf>| BrdfFeatures::compute(&**brdf, &setup).unwrap();
        let pairs: Vec<_> = pairs.iter().map(|(r, c)| (features(r), features(c))).collect();
        let of_family = |family: Family| {
            let set = DescriptorSet::new(vec![family]);
            (family.name().to_owned(), pairs.iter().map(|(r, c)| set.compare(r, c, &setup)).collect())
        };
        (id.to_owned(), Family::ALL.into_iter().map(of_family).collect())
    };
    Golden { metrics: found, descriptors: SETUPS.into_iter().map(of_setup).collect() }
}

fn kept() -> Golden {
    serde_json::from_str(include_str!("golden.json")).unwrap()
}

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME * a.abs().max(b.abs()).max(1e-3)
}

#[test]
fn numbers_hold_as_long_as_versions_do() {
    let (kept, computed) = (kept(), computed());
    assert_eq!(kept.metrics.keys().collect::<Vec<_>>(), computed.metrics.keys().collect::<Vec<_>>());
    for (name, (version, values)) in &computed.metrics {
        let (old_version, old) = &kept.metrics[name];
        assert_eq!(
            version, old_version,
            "{name} has a new version: write golden.json anew, and a line into the changelog"
        );
        let holds = old.len() == values.len() && old.iter().zip(values).all(|(a, b)| same(*a, *b));
        assert!(holds, "{name} {version} was {old:?} and is {values:?}: raise its version, or find out what moved it");
        assert!(values.iter().all(|v| *v > 0.0), "{name}: pairs that differ have a distance");
    }
    for (id, families) in &computed.descriptors {
        for family in Family::ALL.map(Family::name) {
            for (pair, (old, new)) in kept.descriptors[id][family].iter().zip(&families[family]).enumerate() {
                assert_eq!(old.len(), new.len(), "{family}");
                for (column, (old, new)) in old.iter().zip(new).enumerate() {
                    let place = format!("{id}, {family}, pair {pair}, column {column}");
                    assert!(same(*old, *new), "{place}: was {old}, is {new}; raise VERSION");
                }
            }
        }
    }
}

#[test]
#[ignore = "writes golden.json anew, after a version was raised"]
fn write_the_golden_values() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/golden.json");
    std::fs::write(path, serde_json::to_string_pretty(&computed()).unwrap() + "\n").unwrap();
}
