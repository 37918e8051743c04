//! A model's parameters by name: what files, overrides and content hashes are made of.

use super::{AnalyticBrdf, ModelError, Parameter, build, schema};
use std::fmt::Write;
use std::sync::Arc;

/// The identifier of a model and its parameter vector, not yet checked against the bounds.
///
/// A *field* is a parameter without its channel: `kd` has three entries, `alpha` one.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedParameters {
    model: String,
    schema: Vec<Parameter>,
    values: Vec<Option<f64>>,
}

/// Why a field could not be set.
#[derive(Debug, Clone, PartialEq)]
pub enum FieldError {
    /// The model has no such field.
    Unknown,
    /// The field has this many entries.
    Entries {
        /// Number of entries that the field has.
        allowed: usize,
    },
}

impl NamedParameters {
    /// All fields of `model` unset.
    pub fn new(model: &str) -> Result<Self, ModelError> {
        let schema = schema(model)?;
        Ok(Self { model: model.to_owned(), values: vec![None; schema.len()], schema })
    }

    /// The identifier of the model, such as `ward`.
    pub fn model(&self) -> &str {
        &self.model
    }

    /// The fields in order, each with its number of entries.
    pub fn fields(&self) -> Vec<(&str, usize)> {
        let mut fields: Vec<(&str, usize)> = Vec::new();
        for parameter in &self.schema {
            let field = field_of(parameter);
            match fields.last_mut() {
                Some((last, count)) if *last == field => *count += 1,
                _ => fields.push((field, 1)),
            }
        }
        fields
    }

    /// Sets all entries of a field.
    pub fn set(&mut self, field: &str, entries: &[f64]) -> Result<(), FieldError> {
        let first = self.schema.iter().position(|p| field_of(p) == field).ok_or(FieldError::Unknown)?;
        let allowed = self.schema.iter().filter(|p| field_of(p) == field).count();
        if entries.len() != allowed {
            return Err(FieldError::Entries { allowed });
        }
        for (value, entry) in self.values[first..].iter_mut().zip(entries) {
            *value = Some(*entry);
        }
        Ok(())
    }

    /// The first field that is still unset.
    pub fn missing(&self) -> Option<&str> {
        self.schema.iter().zip(&self.values).find(|(_, v)| v.is_none()).map(|(p, _)| field_of(p))
    }

    /// The same parameters read as another model; `None` unless both have the same fields.
    pub fn with_model(&self, model: &str) -> Option<Self> {
        let other = Self::new(model).ok()?;
        (other.fields() == self.fields()).then(|| Self { values: self.values.clone(), ..other })
    }

    /// The checked model. Unset fields count as out of bounds.
    pub fn build(&self) -> Result<Arc<dyn AnalyticBrdf>, ModelError> {
        let values: Vec<f64> = self.values.iter().map(|v| v.unwrap_or(f64::NAN)).collect();
        build(&self.model, &values)
    }

    /// One text for one set of parameters, whatever file they came from.
    pub fn canonical(&self) -> String {
        let mut text = self.model.clone();
        for (parameter, value) in self.schema.iter().zip(&self.values) {
            // The shortest decimal form that reads back as the same number.
            let _ = write!(text, ";{}={:?}", parameter.name, value.unwrap_or(f64::NAN));
        }
        text
    }
}

/// The name of a parameter without its channel.
fn field_of(parameter: &Parameter) -> &str {
    let name: &str = &parameter.name;
    match name.rsplit_once('.') {
        Some((field, "r" | "g" | "b")) => field,
        _ => name,
    }
}

/// A parameter, or the three of a colour, as readers name them.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// `alpha`, `kd`; `2.alpha` for that of the second term of a sum.
    pub name: String,
    /// `"1"` for a dimensionless number.
    pub unit: &'static str,
    /// One number, or one a channel.
    pub values: Vec<f64>,
}

impl Field {
    /// The parameters of a model, in the order of its schema.
    pub fn all(model: &dyn AnalyticBrdf) -> Vec<Self> {
        let mut fields: Vec<Self> = Vec::new();
        for (parameter, value) in model.schema().iter().zip(model.parameters()) {
            let name = field_of(parameter);
            match fields.last_mut().filter(|last| last.name == name) {
                Some(last) => last.values.push(value),
                None => fields.push(Self { name: name.to_owned(), unit: parameter.unit, values: vec![value] }),
            }
        }
        fields
    }
}
