//! The published JSON Schema of exported metrics, `docs/vernis-metric-file.schema.json`, against the reader of these files:
//! the shipped files follow it, it knows every family of descriptors, and both accept and refuse the same variants of a small file.

use boon::{Compiler, SchemaIndex, Schemas};
use serde_json::{Value, json};
use std::sync::LazyLock;
use vernis_metric::descriptor::embedding::{EmbeddingParts, INPUTS, LogSpace};
use vernis_metric::descriptor::{DescriptorSet, Embedding, Family, Role, Setup};
use vernis_metric::metric::learned::exported::{DataHash, Descriptors, Interval, Provenance, Reached};
use vernis_metric::metric::learned::{
    Activation, Clip, Dense, ExportedMetric, Feature, Function, Input, Kernel, Radial, Regressor, Standardizer, Term,
};

const SCHEMA: &str = include_str!("../../../docs/vernis-metric-file.schema.json");
const SHIPPED: [&str; 3] = [
    include_str!("../../vernis-metric/src/metric/learned/vernis.vernis.json"),
    include_str!("../../vernis-metric/src/metric/learned/vernis-loss.vernis.json"),
    include_str!("../../vernis-metric/src/metric/learned/vernis-1.vernis.json"),
];

/// The place of the schema among the validator's documents.
const PLACE: &str = "urn:vernis:metric-file:1";

static COMPILED: LazyLock<(Schemas, SchemaIndex)> = LazyLock::new(|| {
    let (mut schemas, mut compiler) = (Schemas::new(), Compiler::new());
    compiler.add_resource(PLACE, serde_json::from_str(SCHEMA).unwrap()).unwrap();
    let index = compiler.compile(PLACE, &mut schemas).unwrap();
    (schemas, index)
});

/// Whether a file follows the schema; if not, where and why.
fn follows(file: &Value) -> Result<(), String> {
    COMPILED.0.validate(file, COMPILED.1).map_err(|e| format!("{e:#}"))
}

/// Whether the library reads a file; if not, why.
fn reads(file: &Value) -> Result<(), String> {
    ExportedMetric::parse(&file.to_string(), "file").map(|_| ()).map_err(|e| e.to_string())
}

fn embedding() -> Embedding {
    let layer = Dense { inputs: 1, outputs: 1, bias: vec![0.0], weights: vec![2.0] };
    Embedding::new(EmbeddingParts {
        name: "encoder".into(),
        space: LogSpace::Opponent,
        mean: vec![0.0; INPUTS],
        components: vec![vec![1e-4; INPUTS]],
        layers: vec![layer],
        slope: 0.1,
    })
    .unwrap()
}

fn terms(features: usize) -> Vec<Term> {
    let ones = vec![1.0; features];
    let kernel = |radial| Function::Kernel {
        kernel: Kernel { radial, length: 1.0, linear: 0.2 },
        weights: vec![-1.0],
        landmarks: ones.clone(),
    };
    let layer = Dense { inputs: features, outputs: 1, bias: vec![0.5], weights: ones.clone() };
    let network =
        Function::Network { activation: Activation::LeakyRelu { slope: 0.1 }, members: vec![vec![layer.clone()]] };
    [
        Function::Linear { weights: ones.clone() },
        kernel(Radial::Exponential),
        kernel(Radial::Matern32),
        kernel(Radial::Gaussian),
        network,
    ]
    .map(|function| Term {
        weight: 0.2,
        standardizer: Standardizer {
            limit: 4.0,
            power: 0.7,
            clip: Clip::Smooth,
            features: (0..features)
                .map(|input| Feature { input, mean: 0.0, scale: 1.0, gain: 1.0, softening: 0.01 })
                .collect(),
        },
        function,
    })
    .into()
}

/// A small file, as the library writes it, that holds every kind of object there is. It follows the schema, so that a
/// variant that does not owes it to the change.
fn small() -> Value {
    let set = DescriptorSet::new(vec![Family::Slot, Family::Context]).with_embedding(embedding());
    let inputs: Vec<Input> = set.columns().iter().map(Input::from).collect();
    let mut terms = terms(inputs.len());
    let compared: Vec<usize> = (0..inputs.len()).filter(|&i| inputs[i].role == Role::Difference).collect();
    let weights = vec![0.5; compared.len()];
    terms.push(Term {
        weight: 1.0,
        standardizer: Standardizer::scaled(compared.into_iter().map(|input| (input, 2.0))),
        function: Function::Saturated { weights, limit: 3.5 },
    });
    let regressor = Regressor { identity_mos: 4.5, terms, inputs };
    let provenance = Provenance {
        study: "test".into(),
        synthetic: true,
        rows: 2,
        materials: 2,
        data: vec![DataHash { name: "a.csv".into(), sha256: "0123456789abcdef".repeat(4) }],
        seed: u64::MAX,
        command: "vernis train".into(),
        crate_version: "0.1.0".into(),
        agreement: vec![Reached { measure: "plcc".into(), rows: "all".into(), value: 0.9, low: 0.8, high: 1.0 }],
    };
    let interval = Interval { level: 0.95, factor: 2.0, offset: 0.1 };
    let descriptors = Descriptors { setup: Setup::standard().id().to_owned(), set };
    let members = vec![regressor.clone()];
    let metric = ExportedMetric::new("small", "1", descriptors, regressor, members, interval, provenance).unwrap();
    let file = serde_json::from_str(&metric.to_json().unwrap()).unwrap();
    follows(&file).unwrap();
    file
}

/// JSON pointers of every object inside `value`.
fn objects(value: &Value, at: &str, found: &mut Vec<String>) {
    match value {
        Value::Object(map) => {
            found.push(at.to_owned());
            map.iter().for_each(|(key, inner)| objects(inner, &format!("{at}/{key}"), found));
        }
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(i, inner)| objects(inner, &format!("{at}/{i}"), found));
        }
        _ => {}
    }
}

#[test]
fn the_shipped_files_follow_the_schema() {
    for shipped in SHIPPED {
        follows(&serde_json::from_str(shipped).unwrap()).unwrap();
    }
}

#[test]
fn the_schema_knows_every_family_of_descriptors() {
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    let known = &schema["$defs"]["set"]["properties"]["families"]["items"]["enum"];
    assert_eq!(*known, json!(Family::ALL.map(Family::name)));
}

/// Of equal items of a list, the first stands for all.
fn places(file: &Value) -> Vec<String> {
    let mut found = Vec::new();
    objects(file, "", &mut found);
    found.retain(|at| !["/inputs/", "/features/"].iter().any(|list| at.contains(list)) || at.ends_with("/0"));
    found
}

#[test]
fn a_missing_key_is_refused_by_schema_and_reader() {
    let whole = small();
    let mut removed = 0;
    for at in places(&whole) {
        for key in whole.pointer(&at).unwrap().as_object().unwrap().keys() {
            // Optional: without embeddings there are fewer columns, which only the reader can know; plain forms need no key.
            if ["embeddings", "clip", "softening"].contains(&key.as_str()) {
                continue;
            }
            let mut file = whole.clone();
            file.pointer_mut(&at).unwrap().as_object_mut().unwrap().remove(key);
            assert!(reads(&file).is_err(), "the reader takes a file without {at}/{key}");
            assert!(follows(&file).is_err(), "the schema takes a file without {at}/{key}");
            removed += 1;
        }
    }
    assert!(removed > 100, "only {removed} keys were removed");
}

#[test]
fn schema_and_reader_refuse_the_same_unknown_keys() {
    let whole = small();
    let (mut refused, mut taken) = (0, Vec::new());
    for at in places(&whole) {
        let mut file = whole.clone();
        file.pointer_mut(&at).unwrap()["unknown"] = json!(1);
        let reader = reads(&file);
        assert_eq!(follows(&file).is_ok(), reader.is_ok(), "{at}: {reader:?}");
        match reader {
            Ok(()) => taken.push(at),
            Err(_) => refused += 1,
        }
    }
    assert!(refused > 20, "only {refused} objects refuse an unknown key");
    assert!(taken.contains(&"/descriptors/set".to_owned()), "{taken:?}");
}

/// One value of the small file, and one that is not allowed there.
fn broken() -> Vec<(&'static str, Value)> {
    vec![
        ("/format", json!(3)),
        ("/name", json!(7)),
        ("/name", json!("")),
        ("/name", json!("a\u{1b}]0;b")),
        ("/name", json!("n".repeat(201))),
        ("/descriptors/setup", json!("v1-candles-sphere")),
        ("/descriptors/set/families/0", json!("sounds")),
        ("/descriptors/set/embeddings/0/space", json!("xyz")),
        ("/descriptors/set/embeddings/0/mean", json!([0.0])),
        ("/descriptors/set/embeddings/0/mean/0", json!(1e39)),
        ("/descriptors/set/embeddings/0/mean/0", json!(2e6)),
        ("/descriptors/set/embeddings/0/components/0", json!([1.0])),
        ("/descriptors/set/embeddings/0/components/0/7", json!(-2e6)),
        ("/descriptors/set/embeddings/0/layers/0/weights/0", json!(2e6)),
        ("/descriptors/set/embeddings/0/slope", json!(1e300)),
        ("/regressor/identity_mos", json!(5.5)),
        ("/regressor/identity_mos", json!(0.5)),
        ("/regressor/inputs/0/role", json!("reference")),
        ("/regressor/terms", json!([])),
        ("/regressor/terms/0/weight", json!(1e300)),
        ("/regressor/terms/0/standardizer/limit", json!(0.0)),
        ("/regressor/terms/0/standardizer/limit", json!(1e300)),
        ("/regressor/terms/0/standardizer/power", json!(9)),
        ("/regressor/terms/0/standardizer/clip", json!("round")),
        ("/regressor/terms/0/standardizer/features/0/softening", json!(-0.1)),
        ("/regressor/terms/0/standardizer/features/0/softening", json!(1e300)),
        ("/regressor/terms/0/standardizer/features/0/mean", json!(1e300)),
        ("/regressor/terms/0/standardizer/features/0/scale", json!(1e-300)),
        ("/regressor/terms/0/standardizer/features/0/gain", json!(1e300)),
        ("/regressor/terms/0/function/weights/0", json!(1.7e308)),
        ("/regressor/terms/1/function/weights/0", json!(-2e6)),
        ("/regressor/terms/1/function/landmarks/0", json!(2e6)),
        ("/regressor/terms/1/function/kernel/linear", json!(1e300)),
        ("/regressor/terms/1/function/kernel/length", json!(1e-300)),
        ("/regressor/terms/4/function/activation/slope", json!(1e300)),
        ("/regressor/terms/4/function/members/0/0/weights/0", json!(1e300)),
        ("/regressor/terms/4/function/members/0/0/bias/0", json!(-1e300)),
        ("/regressor/terms/0/standardizer/power", json!(-0.7)),
        ("/regressor/terms/0/standardizer/features", json!([])),
        ("/regressor/terms/0/standardizer/features/0/input", json!(-1)),
        ("/regressor/terms/0/standardizer/features/0/scale", json!(0.0)),
        ("/regressor/terms/0/standardizer/features/0/gain", json!(0.0)),
        ("/regressor/terms/0/function/kind", json!("quadratic")),
        ("/regressor/terms/0/function/kind", json!("kernel")),
        ("/regressor/terms/1/function/kernel/radial", json!("cauchy")),
        ("/regressor/terms/1/function/kernel/length", json!(0.0)),
        ("/regressor/terms/4/function/activation/kind", json!("tanh")),
        ("/regressor/terms/4/function/members", json!([])),
        ("/regressor/terms/4/function/members/0", json!([])),
        ("/regressor/terms/4/function/members/0/0/outputs", json!(0)),
        ("/regressor/terms/4/function/members/0/0/weights/0", Value::Null),
        ("/regressor/terms/5/function/weights/0", json!(-0.1)),
        ("/regressor/terms/5/function/limit", json!(0)),
        ("/regressor/terms/5/function/limit", json!(1e300)),
        ("/members/0", json!([])),
        ("/interval/level", json!(2.0)),
        ("/interval/level", json!(0.0)),
        ("/interval/level", json!(1.0)),
        ("/interval/factor", json!(-1.0)),
        ("/interval/factor", json!(1e300)),
        ("/interval/offset", json!(1e300)),
        ("/interval/offset", json!(-0.1)),
        ("/provenance/synthetic", json!("no")),
        ("/provenance/rows", json!(-2)),
        ("/provenance/seed", json!(1.5)),
        ("/provenance/agreement/0/value", Value::Null),
    ]
}

#[test]
fn a_value_that_is_not_allowed_is_refused_by_schema_and_reader() {
    let whole = small();
    for (at, value) in broken() {
        let mut file = whole.clone();
        *file.pointer_mut(at).unwrap_or_else(|| panic!("{at} is not in the small file")) = value.clone();
        assert!(reads(&file).is_err(), "the reader takes {value} at {at}");
        assert!(follows(&file).is_err(), "the schema takes {value} at {at}");
    }
}

/// The reader does not look at hashes, the schema does.
#[test]
fn a_hash_that_is_none_does_not_follow_the_schema() {
    let mut file = small();
    file["provenance"]["data"][0]["sha256"] = json!("0123");
    assert!(follows(&file).unwrap_err().contains("/provenance/data/0/sha256"));
}

#[test]
fn a_scale_widens_what_the_score_of_identical_brdfs_may_be() {
    for (scale, identity, takes) in [
        (json!({"worst": 0, "best": 100}), 87.5, true),
        (json!({"worst": 9.0, "best": 0, "open": true}), 0.0, true),
        (json!({"worst": 0}), 4.5, false),
        (json!({"worst": 0, "best": 100, "middle": 50}), 4.5, false),
        (json!({"worst": "0", "best": 100}), 4.5, false),
    ] {
        let mut file = small();
        file["scale"] = scale.clone();
        file["regressor"]["identity_mos"] = json!(identity);
        assert_eq!((reads(&file).is_ok(), follows(&file).is_ok()), (takes, takes), "{scale}: {:?}", reads(&file));
    }
}

#[test]
fn the_bounds_themselves_are_allowed() {
    let mut file = small();
    for (at, value) in [
        ("/regressor/identity_mos", json!(5)),
        ("/interval/factor", json!(0)),
        ("/interval/offset", json!(0)),
        ("/regressor/terms/0/weight", json!(1e6)),
        ("/regressor/terms/0/standardizer/limit", json!(1e6)),
        ("/regressor/terms/0/standardizer/power", json!(8)),
        ("/regressor/terms/0/standardizer/features/0/scale", json!(1e-30)),
        ("/regressor/terms/0/standardizer/features/0/gain", json!(1e-6)),
        ("/regressor/terms/1/function/kernel/length", json!(1e-6)),
        ("/regressor/terms/4/function/members/0/0/weights/0", json!(-1e6)),
        ("/provenance/rows", json!(0)),
        ("/members", json!([])),
    ] {
        *file.pointer_mut(at).unwrap() = value;
    }
    reads(&file).unwrap();
    follows(&file).unwrap();
}
