//! `.json`: a model and its parameters, as in `{"model": "ward", "kd": [0.2, 0.1, 0.05], "ks": [0.1, 0.1, 0.1],
//! "alpha": 0.15}`. The fields are those of the model's schema, colours as three numbers; all must be there. The fields of a
//! sum such as `"ggx+ward"` carry the number of their term: `"1.kd"`, `"2.alpha"`.
//!
//! A file of a fit, which has a `format`, holds the same fields under `parameters`, among other things:
//! `{"format": 1, "model": "ward", "parameters": {"kd": ...}, ...}`.

use crate::brdf::models::{FieldError, ModelError, NamedParameters, names};
use crate::brdf::{BrdfError, ContentHash, OpenBrdf};
use crate::io::{nearest, read_at_most, unique_keys};
use serde_json::Value;
use std::path::Path;

/// The format of files of fits that this version writes; older ones keep being read.
pub const FIT_FORMAT: u32 = 1;
/// The first version of vernis that reads this format.
pub const FIT_READABLE_FROM: &str = "0.1.0";
/// Far more than any model needs.
const MOST_BYTES: u64 = 1 << 20;

/// The parameters in the file at `path`, not yet checked against the model's bounds.
pub fn read(path: &Path) -> Result<NamedParameters, BrdfError> {
    let text = read_at_most(path, MOST_BYTES).map_err(super::io_error(path))?;
    parse(&path.display().to_string(), &text).map_err(|e| match e {
        // Only this error depends on where the text came from.
        ParseError::Json(reason) => BrdfError::Malformed { path: path.to_owned(), format: "model in JSON", reason },
        ParseError::Content(e) => *e,
    })
}

/// A model that is part of another file: `place` says where, for messages.
///
/// # Errors
/// What is no object, or no model and its parameters within their bounds.
pub fn from_value(place: &str, value: &Value) -> Result<OpenBrdf, BrdfError> {
    let Value::Object(object) = value else {
        return Err(BrdfError::Field {
            place: place.to_owned(),
            field: "the model".to_owned(),
            found: value.to_string(),
            allowed: "an object, `{...}`".to_owned(),
        });
    };
    let parameters = from_object(place, object)?;
    let brdf = parameters.build().map_err(|cause| BrdfError::Model { place: place.to_owned(), cause })?;
    let content = ContentHash::of(parameters.canonical().as_bytes());
    Ok(OpenBrdf { notation: place.to_owned(), content, brdf })
}

enum ParseError {
    Json(String),
    Content(Box<BrdfError>),
}

fn parse(place: &str, text: &[u8]) -> Result<NamedParameters, ParseError> {
    let json = match unique_keys(text).map_err(|e| ParseError::Json(e.to_string()))? {
        Value::Object(json) => json,
        _ => return Err(ParseError::Json("it must be an object, `{...}`".to_owned())),
    };
    from_object(place, &json).map_err(|e| ParseError::Content(Box::new(e)))
}

fn from_object(place: &str, json: &serde_json::Map<String, Value>) -> Result<NamedParameters, BrdfError> {
    let field_error = |field: &str, found: String, allowed: String| BrdfError::Field {
        place: place.to_owned(),
        field: field.to_owned(),
        found,
        allowed,
    };
    let fields = fields(json, &field_error)?;
    let model = match json.get("model") {
        Some(Value::String(model)) => model,
        other => {
            let found = other.map_or("missing".to_owned(), Value::to_string);
            return Err(field_error("model", found, format!("one of {}", names().join(", "))));
        }
    };
    let mut parameters = for_model(place, model)?;
    for (field, value) in fields {
        let entries: Option<Vec<f64>> = match value {
            Value::Array(items) => items.iter().map(Value::as_f64).collect(),
            number => number.as_f64().map(|n| vec![n]),
        };
        let entries = entries.unwrap_or_default();
        set(&mut parameters, place, field, &entries, &value.to_string())?;
    }
    match parameters.missing() {
        None => Ok(parameters),
        Some(field) => {
            let entries = parameters.fields().iter().find(|(f, _)| *f == field).map_or(1, |f| f.1);
            Err(field_error(field, "missing".to_owned(), numbers(entries)))
        }
    }
}

/// The fields of the model: those of the file, or of its `parameters` if it is that of a fit.
fn fields<'a>(
    json: &'a serde_json::Map<String, Value>,
    error: &impl Fn(&str, String, String) -> BrdfError,
) -> Result<Vec<(&'a String, &'a Value)>, BrdfError> {
    let Some(format) = json.get("format") else {
        return Ok(json.iter().filter(|(field, _)| *field != "model").collect());
    };
    // What is newer may look different: this comes first.
    if !format.as_u64().is_some_and(|f| (1..=u64::from(FIT_FORMAT)).contains(&f)) {
        let reader = json.get("readable_from").and_then(Value::as_str);
        let reader = reader.map_or("a newer vernis".to_owned(), |version| format!("vernis {version}"));
        let allowed = format!("1 to {FIT_FORMAT} in vernis {}; this file needs {reader}", env!("CARGO_PKG_VERSION"));
        return Err(error("format", format.to_string(), allowed));
    }
    match json.get("parameters") {
        Some(Value::Object(parameters)) => Ok(parameters.iter().collect()),
        other => {
            let found = other.map_or("missing".to_owned(), Value::to_string);
            Err(error("parameters", found, "an object of the model's fields".to_owned()))
        }
    }
}

/// The unset parameters of `model`.
pub(in crate::brdf) fn for_model(place: &str, model: &str) -> Result<NamedParameters, BrdfError> {
    NamedParameters::new(model).map_err(|cause| match cause {
        ModelError::UnknownModel { found } => BrdfError::UnknownModel {
            place: place.to_owned(),
            nearest: nearest(&found, names()),
            found,
            allowed: names().into_iter().map(str::to_owned).collect(),
        },
        cause => BrdfError::Model { place: place.to_owned(), cause },
    })
}

/// Sets a field, or says what is wrong with it; `found` is its text at `place`.
pub(in crate::brdf) fn set(
    parameters: &mut NamedParameters,
    place: &str,
    field: &str,
    entries: &[f64],
    found: &str,
) -> Result<(), BrdfError> {
    let allowed: Vec<String> = parameters.fields().iter().map(|(f, _)| (*f).to_owned()).collect();
    parameters.set(field, entries).map_err(|e| match e {
        FieldError::Unknown => BrdfError::UnknownField {
            place: place.to_owned(),
            model: parameters.model().to_owned(),
            found: field.to_owned(),
            nearest: nearest(field, &allowed),
            allowed,
        },
        FieldError::Entries { allowed } => BrdfError::Field {
            place: place.to_owned(),
            field: field.to_owned(),
            found: found.to_owned(),
            allowed: numbers(allowed),
        },
    })
}

fn numbers(count: usize) -> String {
    if count == 1 { "one number".to_owned() } else { format!("{count} numbers, one per colour channel") }
}
