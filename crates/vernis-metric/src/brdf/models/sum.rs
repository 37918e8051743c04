//! Sums of models: several lobes over one diffuse base, as in `ggx+blinn-phong`.
//!
//! f = f_1 + f_2 + ...
//!
//! Parameters carry the number of their term, `1.kd.r`, `2.alpha`. The diffuse albedo `kd` is that of the first term: the
//! `kd` of a later term, which would do the same again, is zero and no parameter. A later term starts 1.5 times as high in
//! every parameter as the one before, so that a fit of equal terms does not begin where they stay equal.
//! Reciprocal as its terms are. Source: Ngan et al. 2005, section 4.2 (several lobes), doi:10.2312/EGWR/EGSR05/117-126.
//! Cost: that of its terms.

use super::{AnalyticBrdf, DifferentiableBrdf, ModelError, Parameter, build, check, schema as schema_of};
use crate::math::{Rgb, Vec3};
use std::borrow::Cow;
use std::sync::Arc;

/// The fields at the head of a schema that only the first term keeps.
const DIFFUSE: [&str; 3] = ["kd.r", "kd.g", "kd.b"];

/// Several models added up.
pub struct Sum {
    id: String,
    terms: Vec<Term>,
}

struct Term {
    model: Arc<dyn AnalyticBrdf>,
    /// Number of its parameters.
    count: usize,
    /// How many parameters at the head of the model are fixed at zero.
    hidden: usize,
}

/// A term as the identifier of a sum names it.
struct Part<'a> {
    name: &'a str,
    schema: Vec<Parameter>,
    hidden: usize,
}

fn parts(id: &str) -> Result<Vec<Part<'_>>, ModelError> {
    let part = |(k, name)| {
        let schema = schema_of(name)?;
        let diffuse = schema.iter().zip(DIFFUSE).filter(|(p, name)| p.name == *name).count();
        let hidden = if k > 0 && diffuse == DIFFUSE.len() { diffuse } else { 0 };
        if hidden == schema.len() {
            return Err(ModelError::Term { model: id.to_owned(), term: name.to_owned() });
        }
        Ok(Part { name, schema, hidden })
    };
    id.split('+').enumerate().map(part).collect()
}

pub(super) fn schema(id: &str) -> Result<Vec<Parameter>, ModelError> {
    let mut all = Vec::new();
    for (k, Part { schema, hidden, .. }) in parts(id)?.into_iter().enumerate() {
        all.extend(schema.into_iter().skip(hidden).map(|p| Parameter {
            name: Cow::Owned(format!("{}.{}", k + 1, p.name)),
            start: (p.start * 1.5f64.powi(k as i32)).clamp(p.bounds.0, p.bounds.1),
            ..p
        }));
    }
    Ok(all)
}

/// The checked sum of a parameter vector of the schema's length.
pub(super) fn shared(id: &str, p: &[f64]) -> Result<Arc<dyn AnalyticBrdf>, ModelError> {
    check(id, &schema(id)?, p)?;
    let mut rest = p.iter().copied();
    let mut all = Vec::new();
    for Part { name, schema, hidden } in parts(id)? {
        let own: Vec<f64> = std::iter::repeat_n(0.0, hidden).chain(rest.by_ref().take(schema.len() - hidden)).collect();
        all.push(Term { model: build(name, &own)?, count: own.len(), hidden });
    }
    Ok(Arc::new(Sum { id: id.to_owned(), terms: all }))
}

impl AnalyticBrdf for Sum {
    fn model(&self) -> &str {
        &self.id
    }

    fn schema(&self) -> Vec<Parameter> {
        // The identifier was checked when the sum was made.
        schema(&self.id).unwrap_or_default()
    }

    fn parameters(&self) -> Vec<f64> {
        self.terms.iter().flat_map(|t| t.model.parameters().into_iter().skip(t.hidden)).collect()
    }

    fn value(&self, wi: Vec3, wo: Vec3) -> Rgb {
        let mut sum = [0.0; 3];
        // In the order of the gradient, so that both give the same bits.
        for term in self.terms.iter().rev() {
            add(&mut sum, term.model.value(wi, wo));
        }
        sum
    }

    fn reciprocal(&self) -> bool {
        self.terms.iter().all(|term| term.model.reciprocal())
    }

    fn as_differentiable(&self) -> Option<&dyn DifferentiableBrdf> {
        self.terms.iter().all(|t| t.model.as_differentiable().is_some()).then_some(self)
    }
}

impl DifferentiableBrdf for Sum {
    fn value_and_gradient(&self, wi: Vec3, wo: Vec3, d: &mut [Rgb]) -> Rgb {
        let mut values = [0.0; 3];
        let mut end = self.terms.iter().map(|t| t.count - t.hidden).sum::<usize>().min(d.len());
        // From the last term to the first: the derivatives by hidden parameters fall onto those of the term before,
        // which then overwrites them.
        for term in self.terms.iter().rev() {
            let begin = end.saturating_sub(term.count);
            if let Some(model) = term.model.as_differentiable() {
                add(&mut values, model.value_and_gradient(wi, wo, &mut d[begin..end]));
            }
            end = begin + term.hidden;
        }
        values
    }
}

fn add(sum: &mut Rgb, value: Rgb) {
    for c in 0..3 {
        sum[c] += value[c];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::coordinates::standard_directions;

    #[test]
    fn a_sum_is_its_terms_over_one_diffuse_base() {
        let (wi, wo) = standard_directions(0.4, 0.6, 3.0);
        let ggx = [0.1, 0.2, 0.3, 0.04, 0.05, 0.06, 0.3];
        let ward = [0.02, 0.03, 0.04, 0.1];
        let sum = build("ggx+ward", &[&ggx[..], &ward].concat()).expect("within bounds");
        let (a, b) = (build("ggx", &ggx), build("ward", &[&[0.0; 3][..], &ward].concat()));
        let (a, b) = (a.expect("valid").value(wi, wo), b.expect("valid").value(wi, wo));
        for (c, found) in sum.value(wi, wo).into_iter().enumerate() {
            assert!((found - a[c] - b[c]).abs() < 1e-15);
        }
        assert_eq!(sum.parameters(), [&ggx[..], &ward].concat());
        let names: Vec<_> = sum.schema().into_iter().map(|p| p.name.into_owned()).collect();
        assert_eq!(names[..3], ["1.kd.r", "1.kd.g", "1.kd.b"]);
        assert_eq!(names[6..], ["1.alpha", "2.ks.r", "2.ks.g", "2.ks.b", "2.alpha"]);
    }

    #[test]
    fn what_is_no_sum_says_so() {
        let message = |id: &str, p: &[f64]| build(id, p).err().expect("wrong").to_string();
        assert!(message("ggx+", &[]).contains("unknown model ``"));
        assert!(message("ggx+wart", &[]).contains("unknown model `wart`"));
        assert!(message("ggx+lambert", &[]).contains("lambert has no lobe"));
        assert!(message("lambert+ward", &[0.0; 4]).contains("4 parameters were given; the model has 7"));
        let text = message("lambert+ward", &[0.0, 0.0, 0.0, 0.1, 0.1, 0.1, 3.0]);
        assert_eq!(text, "lambert+ward: 2.alpha is 3; it must be 0.001 to 2");
    }
}
