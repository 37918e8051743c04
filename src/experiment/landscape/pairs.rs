//! Pairs that any metric of BRDFs should be asked about: mirrors, blacks, metals of other colours, turned hues.

use super::record::{Answer, OddPair};
use super::surface::{MATERIALS, Parameter, Surface};
use std::sync::Arc;
use vernis_metric::math::Rgb;
use vernis_metric::metric::{Metric, MetricError};

/// Reflectance at normal incidence, linear RGB, as renderers commonly set it, rounded; gold's red, which lies outside the gamut, is 1.
const GOLD: Rgb = [1.0, 0.77, 0.34];
const SILVER: Rgb = [0.97, 0.96, 0.92];
/// Of both.
const METAL_ALPHA: f64 = 0.1;
/// Reflectance of the mirrors.
const MIRROR: f64 = 0.95;
/// Degrees.
const TURNS: [f64; 4] = [30.0, 60.0, 120.0, 180.0];

struct Pair {
    kind: &'static str,
    name: String,
    reference: Surface,
    candidate: Surface,
}

fn pairs() -> Vec<Pair> {
    let mirror = |alpha| Surface::ggx([0.0; 3], [MIRROR; 3], alpha);
    let metal = |f0| Surface::ggx([0.0; 3], f0, METAL_ALPHA);
    // Without a lobe: ks is 0.
    let matte = |albedo| Surface { ks: 0.0, ..Surface::ggx([albedo; 3], [0.0; 3], 1.0) };
    let mirrors = [(0.001, 0.002), (0.001, 0.005), (0.002, 0.005)].map(|(a, b)| Pair {
        kind: "mirrors",
        name: format!("mirrors, GGX f0 {MIRROR}, alpha {a} and {b}"),
        reference: mirror(a),
        candidate: mirror(b),
    });
    let blacks = [(0.001, 0.005), (0.0, 0.01), (0.4, 0.8)].map(|(a, b)| Pair {
        kind: "blacks",
        name: format!("Lambert, albedo {a} and {b}"),
        reference: matte(a),
        candidate: matte(b),
    });
    let metals = Pair {
        kind: "metals",
        name: format!("gold and silver, GGX alpha {METAL_ALPHA}"),
        reference: metal(GOLD),
        candidate: metal(SILVER),
    };
    let hues = MATERIALS.iter().flat_map(|material| {
        TURNS.map(|degrees| Pair {
            kind: "hue",
            name: format!("{}, hue turned by {degrees} deg", material.name),
            reference: material.reference(),
            candidate: material.with(Parameter::Hue, degrees),
        })
    });
    mirrors.into_iter().chain(blacks).chain([metals]).chain(hues).collect()
}

/// The distance of every metric for every pair. A metric may refuse a pair, such as black; its reason is then the answer.
pub fn all(metrics: &[Arc<dyn Metric>]) -> Vec<OddPair> {
    let answer = |pair: &Pair, metric: &Arc<dyn Metric>| -> Result<f64, MetricError> {
        metric.distance(&pair.reference, &pair.candidate)
    };
    let asked = |pair: Pair| OddPair {
        answers: metrics
            .iter()
            .map(|metric| match answer(&pair, metric) {
                Ok(distance) => Answer::Distance(distance),
                Err(reason) => Answer::Refused(reason.to_string()),
            })
            .collect(),
        name: pair.name,
        kind: pair.kind.to_owned(),
    };
    pairs().into_iter().map(asked).collect()
}
