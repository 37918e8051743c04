//! Every model as a file of parameters.

use super::{message, open};
use std::fs;
use vernis_metric::brdf::models::{MODELS, build, schema};
use vernis_metric::math::coordinates::standard_directions;

/// A model and its parameters as a JSON object, colours as lists.
fn json(id: &str, p: &[f64]) -> String {
    let mut object = serde_json::Map::new();
    object.insert("model".to_owned(), id.into());
    for (parameter, value) in schema(id).expect("a model").iter().zip(p) {
        match parameter.name.rsplit_once('.') {
            Some((field, "r" | "g" | "b")) => {
                let channels = object.entry(field).or_insert_with(|| serde_json::Value::Array(Vec::new()));
                channels.as_array_mut().expect("a colour").push((*value).into());
            }
            _ => drop(object.insert(parameter.name.to_string(), (*value).into())),
        }
    }
    serde_json::Value::Object(object).to_string()
}

#[test]
fn every_model_and_sums_of_them_can_be_written_down() {
    let folder = tempfile::tempdir().expect("a folder");
    let (wi, wo) = standard_directions(0.5, 0.4, 3.0);
    for id in MODELS.into_iter().chain(["ggx+ward+ggx", "rational-legendre-6-3"]) {
        let p: Vec<f64> = schema(id).expect("a model").iter().map(|p| p.start).collect();
        fs::write(folder.path().join("model.json"), json(id, &p)).expect("writable");
        let value = open("model.json", folder.path()).expect("a valid file").eval(wi, wo);
        assert_eq!(value, Some(build(id, &p).expect("a start is valid").value(wi, wo)), "{id}");
    }
}

#[test]
fn terms_of_a_sum_are_overridden_by_number() {
    let folder = tempfile::tempdir().expect("a folder");
    let p: Vec<f64> = schema("ggx+ward").expect("a model").iter().map(|p| p.start).collect();
    fs::write(folder.path().join("sum.json"), json("ggx+ward", &p)).expect("writable");
    let (wi, wo) = standard_directions(0.5, 0.4, 3.0);
    let value = |notation: &str| open(notation, folder.path()).expect("valid").eval(wi, wo);
    assert_ne!(value("sum.json"), value("sum.json?2.alpha=0.3"));
    assert_eq!(value("sum.json?2.alpha=0.3"), value("sum.json?2.alpha=0.3&1.kd=0.2,0.2,0.2"));
    let text = message(open("sum.json?2.kd=0,0,0", folder.path()));
    assert!(text.contains("ggx+ward has no parameter `2.kd`") && text.contains("2.ks"), "{text}");
    let text = message(open("sum.json?1.alpha=2", folder.path()));
    assert!(text.ends_with("ggx+ward: 1.alpha is 2; it must be 0.001 to 1"), "{text}");
    fs::write(folder.path().join("bad.json"), r#"{"model": "ggx+wart"}"#).expect("writable");
    let text = message(open("bad.json", folder.path()));
    assert!(text.contains("unknown model `wart`; did you mean ward"), "{text}");
    fs::write(folder.path().join("bad.json"), r#"{"model": "ggx+lambert"}"#).expect("writable");
    assert!(message(open("bad.json", folder.path())).contains("lambert has no lobe"));
}
