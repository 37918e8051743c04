//! JSON that a person wrote: a key that is given twice is a mistake, and not the last one's win.

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};
use std::fmt;

/// The value in `text`, in which no object has a key twice.
///
/// # Errors
/// What is no JSON; a key that its object has already, with the line and column.
pub fn unique_keys(text: &[u8]) -> serde_json::Result<Value> {
    serde_json::from_slice::<Unique>(text).map(|unique| unique.0)
}

/// A value whose objects were watched while they were read.
struct Unique(Value);

impl<'de> Deserialize<'de> for Unique {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Watch).map(Self)
    }
}

struct Watch;

impl<'de> Visitor<'de> for Watch {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_string<E: Error>(self, value: String) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_unit<E: Error>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let mut all = Vec::new();
        while let Some(Unique(item)) = items.next_element()? {
            all.push(item);
        }
        Ok(Value::Array(all))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut fields: A) -> Result<Value, A::Error> {
        let mut all = Map::new();
        while let Some(key) = fields.next_key::<String>()? {
            if all.contains_key(&key) {
                return Err(A::Error::custom(format_args!("the key `{key}` is given twice")));
            }
            let Unique(value) = fields.next_value()?;
            all.insert(key, value);
        }
        Ok(Value::Object(all))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_what_it_is_elsewhere_unless_a_key_comes_twice() {
        let text = br#"{"a": [1, -2, 0.1, 1e300, 18446744073709551615], "b": {"a": null, "c": "x\n"}, "d": true}"#;
        assert_eq!(unique_keys(text).unwrap(), serde_json::from_slice::<Value>(text).unwrap());
        let message = |text: &str| unique_keys(text.as_bytes()).unwrap_err().to_string();
        let found = message("{\"kd\": 1,\n \"ks\": {\"r\": 1, \"r\": 2}}");
        assert!(found.starts_with("the key `r` is given twice at line 2 column "), "{found}");
        assert!(message(r#"[{"\u0061": 1, "a": 2}]"#).contains("the key `a` is given twice"));
        assert!(message("{\"a\": 1} x").contains("trailing characters"));
        assert!(message(&"[".repeat(500)).contains("recursion limit"));
    }
}
