//! The published JSON Schema of scenes, `docs/scene.schema.json`, against the reader of scenes: both accept and refuse the same variants.

use boon::{Compiler, Schemas};
use serde_json::{Value, json};
use std::path::Path;
use vernis_image::scene::file::{DEFAULT_BOUNCES, DEFAULT_SAMPLES, SceneFile};
use vernis_image::scene::{MOST_BOUNCES, MOST_PIXELS_A_SIDE, MOST_SAMPLES};

const SCHEMA: &str = include_str!("../../../docs/scene.schema.json");
const PLACE: &str = "urn:vernis:scene:1";

fn whole() -> Value {
    json!({
        "shape": {"sphere": {"radius": 1.5, "center": [0, 1, 0]}},
        "brdf": {"model": "lambert", "kd": [0.5, 0.5, 0.5]},
        "table": {"half_side": 3, "brdf": "wood"},
        "camera": {"from": [0, 1, 6], "to": [0, 1, 0], "fov_deg": 24},
        "film": [4, 6], "light": "lamps", "light_scale": 0.5, "bounces": 3, "samples": 7, "seed": 5, "background": true,
    })
}

/// `whole` with the value at a JSON pointer replaced, or removed.
fn with(pointer: &str, value: Option<Value>) -> Value {
    let mut scene = whole();
    let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
    let object = scene.pointer_mut(parent).and_then(Value::as_object_mut).expect("an object");
    match value {
        Some(value) => object.insert(key.to_owned(), value),
        None => object.remove(key),
    };
    scene
}

#[test]
fn the_schema_and_the_reader_agree() {
    let (mut schemas, mut compiler) = (Schemas::new(), Compiler::new());
    compiler.add_resource(PLACE, serde_json::from_str(SCHEMA).expect("JSON")).expect("a schema");
    let index = compiler.compile(PLACE, &mut schemas).expect("a schema");
    let mut both = [0, 0];
    for (pointer, value) in [
        ("/seed", Some(json!(5))),
        ("/seed", None),
        ("/seed", Some(json!(-1))),
        ("/table", Some(Value::Null)),
        ("/table", None),
        ("/table/brdf", Some(json!({"model": "lambert", "kd": [0.1, 0.1, 0.1]}))),
        ("/table/brdf", None),
        ("/table/half_side", Some(json!(0))),
        ("/table/height", Some(json!(1))),
        ("/shape", Some(json!("sphere"))),
        ("/shape", Some(json!("blob"))),
        ("/shape", Some(json!("cube"))),
        ("/shape", Some(json!({}))),
        ("/shape", None),
        ("/shape/sphere/radius", Some(json!(-1))),
        ("/shape/sphere/radius", None),
        ("/shape/sphere/center", Some(json!([0, 1]))),
        ("/shape/scale", Some(json!(2))),
        ("/brdf", None),
        ("/brdf", Some(json!(3))),
        ("/camera/fov_deg", Some(json!(180))),
        ("/camera/up", Some(json!([0, 1, 0]))),
        ("/camera/from", None),
        ("/film", Some(json!([4]))),
        ("/film", Some(json!([0, 4]))),
        ("/film", Some(json!([4, MOST_PIXELS_A_SIDE + 1]))),
        ("/film", Some(json!([1.5, 4]))),
        ("/light", Some(json!("white"))),
        ("/light", Some(json!(1))),
        ("/light", None),
        ("/light_scale", Some(json!(0))),
        ("/bounces", Some(json!(0))),
        ("/bounces", Some(json!(MOST_BOUNCES))),
        ("/bounces", Some(json!(MOST_BOUNCES + 1))),
        ("/samples", Some(json!(MOST_SAMPLES))),
        ("/samples", Some(json!(MOST_SAMPLES + 1))),
        ("/samples", Some(json!("many"))),
        ("/background", Some(json!(0))),
        ("/colour", Some(json!(0))),
    ] {
        let scene = with(pointer, value);
        let follows = schemas.validate(&scene, index).map_err(|e| format!("{e:#}"));
        let reads = SceneFile::parse(Path::new("scene.json"), scene.to_string().as_bytes(), Path::new(""), None);
        let reads = reads.map(|_| ()).map_err(|e| e.to_string());
        assert_eq!(follows.is_ok(), reads.is_ok(), "{pointer}: {scene}\nschema: {follows:?}\nreader: {reads:?}");
        both[usize::from(reads.is_ok())] += 1;
    }
    assert!(both[0] > 20 && both[1] > 8, "{both:?}");
}

#[test]
fn the_schema_states_the_limits_and_defaults_of_the_reader() {
    let schema: Value = serde_json::from_str(SCHEMA).expect("JSON");
    let of = |name: &str, key: &str| schema["properties"][name][key].as_u64();
    assert_eq!(of("bounces", "maximum"), Some(MOST_BOUNCES as u64));
    assert_eq!(of("samples", "maximum"), Some(MOST_SAMPLES as u64));
    assert_eq!(of("bounces", "default"), Some(DEFAULT_BOUNCES as u64));
    assert_eq!(of("samples", "default"), Some(DEFAULT_SAMPLES as u64));
    assert_eq!(of("seed", "maximum"), Some(u64::MAX));
    assert_eq!(schema["properties"]["film"]["items"]["maximum"].as_u64(), Some(MOST_PIXELS_A_SIDE as u64));
}
