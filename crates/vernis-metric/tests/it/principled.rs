//! Models of renderers against values of a renderer: Mitsuba's `principled` at 200 pairs of directions.

use serde_json::{Map, Value};
use vernis_metric::brdf::models::{AnalyticBrdf, GgxConductor, OpenPbrDielectric, OpenPbrMetal, build, schema};
use vernis_metric::math::{Rgb, Vec3};

/// What `experiments/peers/principled.py` wrote.
const GOLDEN: &str = include_str!("principled_golden.json");
/// Mitsuba works in single precision: near a mirror direction its half vector is off by 1e-7, and a lobe of alpha 0.02 by 1e-3 of
/// its height.
const RELATIVE: f64 = 2e-3;

struct Case {
    parameters: Map<String, Value>,
    values: Vec<Rgb>,
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
}

fn golden() -> (Vec<(Vec3, Vec3)>, Vec<Case>) {
    let golden: Value = serde_json::from_str(GOLDEN).expect("JSON");
    let pair = |v: &Value| {
        let p = numbers(v);
        (Vec3::new(p[0], p[1], p[2]).normalized(), Vec3::new(p[3], p[4], p[5]).normalized())
    };
    let pairs: Vec<_> = golden["directions"].as_array().expect("a list").iter().map(pair).collect();
    let case = |c: &Value| Case {
        parameters: c["parameters"].as_object().expect("an object").clone(),
        values: c["values"].as_array().expect("a list").iter().map(|v| numbers(v).try_into().expect("RGB")).collect(),
    };
    let cases: Vec<_> = golden["cases"].as_array().expect("a list").iter().map(case).collect();
    assert!(pairs.len() == 200 && cases.len() == 9 && cases.iter().all(|c| c.values.len() == 200));
    (pairs, cases)
}

/// Parameters that a case does not name are 0, and `specular` is 0.5, as in Mitsuba.
fn principled(parameters: &Map<String, Value>) -> Vec<f64> {
    let of = |name: &str| match name.rsplit_once('.') {
        Some((field, channel)) => numbers(&parameters[field])["rgb".find(channel).expect("a channel")],
        None => parameters.get(name).and_then(Value::as_f64).unwrap_or(if name == "specular" { 0.5 } else { 0.0 }),
    };
    schema("principled").expect("a model").iter().map(|p| of(&p.name)).collect()
}

fn assert_near(model: &dyn AnalyticBrdf, pairs: &[(Vec3, Vec3)], expected: &[Rgb]) {
    for (&(wi, wo), expected) in pairs.iter().zip(expected) {
        for (found, expected) in model.value(wi, wo).into_iter().zip(expected) {
            let error = (found - expected).abs();
            assert!(
                error <= RELATIVE * expected.abs() + 1e-6,
                "{} at {wi:?} {wo:?}: {found}, Mitsuba has {expected}",
                model.model()
            );
        }
    }
}

#[test]
fn principled_has_the_values_of_mitsuba() {
    let (pairs, cases) = golden();
    for case in cases {
        let model = build("principled", &principled(&case.parameters)).expect("valid");
        assert_near(&*model, &pairs, &case.values);
    }
}

/// The metal of OpenPBR without a tint is that of `principled`, and so is the lobe of its dielectric.
#[test]
fn lobes_of_openpbr_have_the_values_of_mitsuba() {
    let (pairs, cases) = golden();
    let case = |which: &dyn Fn(&Map<String, Value>) -> bool| {
        cases.iter().find(|c| which(&c.parameters)).expect("the case is there")
    };
    let metal = case(&|p| p.get("metallic") == Some(&1.0.into()) && p.len() == 3);
    let base_color = numbers(&metal.parameters["base_color"]).try_into().expect("RGB");
    let specular_roughness = metal.parameters["roughness"].as_f64().expect("a number");
    let model = OpenPbrMetal { base_color, specular_weight: 1.0, specular_color: [1.0; 3], specular_roughness };
    assert_near(&model, &pairs, &metal.values);

    let black = case(&|p| numbers(&p["base_color"]) == [0.0; 3] && p.len() == 2);
    let model = OpenPbrDielectric {
        base_color: [0.0; 3],
        base_diffuse_roughness: 0.0,
        specular_weight: 1.0,
        specular_color: [1.0; 3],
        specular_roughness: black.parameters["roughness"].as_f64().expect("a number"),
        // specular 0.5 of `principled`.
        specular_ior: 1.5,
    };
    assert_near(&model, &pairs, &black.values);
}

/// With masking at one height pbrt's conductor reflects a little more than with independent masking, nowhere less.
#[test]
fn a_conductor_of_pbrt_is_that_of_mitsuba_with_other_masking() {
    let (pairs, _) = golden();
    let (eta, k) = ([0.2, 0.9, 1.1], [3.9, 2.4, 2.2]);
    for alpha in [0.1, 0.5] {
        let mitsuba = GgxConductor { kd: [0.0; 3], eta, k, alpha };
        let p: Vec<f64> = eta.into_iter().chain(k).chain([alpha]).collect();
        let pbrt = build("pbrt-conductor", &p).expect("valid");
        for &(wi, wo) in &pairs {
            let ratio = pbrt.value(wi, wo)[0] / mitsuba.value(wi, wo)[0];
            // G of one height is at most min(G1): 1/max(G1) times the product.
            assert!((1.0 - 1e-12..=4.0).contains(&ratio), "{alpha} {wi:?} {wo:?}: {ratio}");
        }
    }
}
