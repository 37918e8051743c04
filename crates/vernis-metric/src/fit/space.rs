//! The parameters of a model in the coordinates of a search.
//!
//! A step of 0.1 should mean about a tenth of a parameter, whether it is an exponent of thousands or an albedo. With the
//! bounds and the start p0 of the schema, a parameter p becomes
//!
//!   ln p                 where the lower bound is above zero (widths, refractive indices); ln -p where all is negative,
//!   ln(1 + p/s)          where it is zero (albedos, exponents), s = p0/10, or a hundredth if the start is zero,
//!   p/s                  elsewhere (coefficients of either sign), s = max(|p0|, 1).

use super::FitError;
use crate::brdf::models::{AnalyticBrdf, Parameter, build, schema};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Nearer to a bound than this, in the coordinates of a search, a parameter stands on it.
const ON_BOUND: f64 = 1e-3;

/// Which end of a parameter's range.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Bound {
    /// The smallest value.
    Lower,
    /// The largest value.
    Upper,
}

impl Bound {
    /// `lower` or `upper`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lower => "lower",
            Self::Upper => "upper",
        }
    }
}

/// A parameter that stands on a bound of its range: the fit might have gone on beyond.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AtBound {
    /// Name in the schema of the model, such as `kd.r`.
    pub parameter: String,
    /// Which bound.
    pub bound: Bound,
    /// The value of the bound, in the parameter's unit.
    pub value: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Axis {
    Log,
    LogOfNegative,
    SoftLog { scale: f64 },
    Linear { scale: f64 },
}

impl Axis {
    fn of(parameter: &Parameter) -> Self {
        let (low, high) = parameter.bounds;
        if low > 0.0 {
            Self::Log
        } else if high < 0.0 {
            Self::LogOfNegative
        } else if low == 0.0 {
            Self::SoftLog { scale: if parameter.start > 0.0 { 0.1 * parameter.start } else { 0.01 } }
        } else {
            Self::Linear { scale: parameter.start.abs().max(1.0) }
        }
    }

    fn scaled(self, p: f64) -> f64 {
        match self {
            Self::Log => p.ln(),
            Self::LogOfNegative => (-p).ln(),
            Self::SoftLog { scale } => (p / scale).ln_1p(),
            Self::Linear { scale } => p / scale,
        }
    }

    fn parameter(self, u: f64) -> f64 {
        match self {
            Self::Log => u.exp(),
            Self::LogOfNegative => -u.exp(),
            Self::SoftLog { scale } => scale * u.exp_m1(),
            Self::Linear { scale } => scale * u,
        }
    }

    /// dp/du.
    fn slope(self, p: f64) -> f64 {
        match self {
            Self::Log | Self::LogOfNegative => p,
            Self::SoftLog { scale } => p + scale,
            Self::Linear { scale } => scale,
        }
    }
}

/// The parameters of one model.
#[derive(Debug, Clone)]
pub struct Space {
    model: String,
    schema: Vec<Parameter>,
    axes: Vec<Axis>,
    bounds: Vec<(f64, f64)>,
}

impl Space {
    /// # Errors
    /// [`FitError::UnknownModel`] with the nearest names.
    pub fn of(model: &str) -> Result<Self, FitError> {
        let schema = schema(model).map_err(FitError::from_model)?;
        let axes: Vec<Axis> = schema.iter().map(Axis::of).collect();
        let bound = |(a, p): (&Axis, &Parameter)| {
            let (x, y) = (a.scaled(p.bounds.0), a.scaled(p.bounds.1));
            (x.min(y), x.max(y))
        };
        let bounds = axes.iter().zip(&schema).map(bound).collect();
        Ok(Self { model: model.to_owned(), schema, axes, bounds })
    }

    /// Identifier of the model.
    pub fn model(&self) -> &str {
        &self.model
    }

    /// Names, units, bounds and starts of the model's parameters.
    pub fn schema(&self) -> &[Parameter] {
        &self.schema
    }

    /// Smallest and largest value of each coordinate.
    pub fn bounds(&self) -> &[(f64, f64)] {
        &self.bounds
    }

    /// Where the schema lets a fit begin.
    pub fn start(&self) -> Vec<f64> {
        self.schema.iter().map(|p| p.start).collect()
    }

    /// Coordinates of a parameter vector, inside the box.
    pub fn scaled(&self, p: &[f64]) -> Vec<f64> {
        let scaled = self.axes.iter().zip(p).map(|(a, p)| a.scaled(*p));
        scaled.zip(&self.bounds).map(|(u, &(low, high))| u.clamp(low, high)).collect()
    }

    /// The parameter vector at coordinates `u`; rounding never leads out of the model's bounds.
    pub fn parameters(&self, u: &[f64]) -> Vec<f64> {
        let back = self.axes.iter().zip(u).map(|(a, u)| a.parameter(*u));
        back.zip(&self.schema).map(|(x, p)| x.clamp(p.bounds.0, p.bounds.1)).collect()
    }

    /// dp/du of each parameter, at the parameter vector `p`.
    pub fn slopes(&self, p: &[f64]) -> Vec<f64> {
        self.axes.iter().zip(p).map(|(a, p)| a.slope(*p)).collect()
    }

    /// The parameters of `p` that stand on a bound.
    pub fn at_bounds(&self, p: &[f64]) -> Vec<AtBound> {
        let at = |((u, parameter), &(low, high)): ((f64, &Parameter), &(f64, f64))| {
            let (bound, value) = match (u - low < ON_BOUND, high - u < ON_BOUND) {
                (false, false) => return None,
                // Coordinates of negative parameters run backwards.
                (lowest, _) if lowest != (parameter.bounds.1 < 0.0) => (Bound::Lower, parameter.bounds.0),
                _ => (Bound::Upper, parameter.bounds.1),
            };
            Some(AtBound { parameter: parameter.name.to_string(), bound, value })
        };
        self.scaled(p).into_iter().zip(&self.schema).zip(&self.bounds).filter_map(at).collect()
    }

    /// The model at a parameter vector.
    pub fn build(&self, p: &[f64]) -> Result<Arc<dyn AnalyticBrdf>, FitError> {
        build(&self.model, p).map_err(FitError::from_model)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::MODELS;

    #[test]
    fn coordinates_lead_back_for_every_model() {
        for model in MODELS.into_iter().chain(["ggx+ward"]) {
            let space = Space::of(model).unwrap();
            let p = space.start();
            let u = space.scaled(&p);
            for (k, (a, b)) in p.iter().zip(space.parameters(&u)).enumerate() {
                assert!((a - b).abs() <= 1e-13 * (1.0 + a.abs()), "{model} {}: {a} {b}", space.schema()[k].name);
            }
            let ends: Vec<f64> = space.bounds().iter().map(|b| b.1).collect();
            assert!(space.build(&space.parameters(&ends)).is_ok(), "{model} at its bounds");
        }
    }

    #[test]
    fn parameters_on_their_bounds_are_named() {
        for model in MODELS {
            let space = Space::of(model).unwrap();
            assert_eq!(
                space.at_bounds(&space.start()).iter().filter(|b| b.bound == Bound::Upper).count(),
                0,
                "{model}"
            );
            for (bound, end) in [(Bound::Lower, 0), (Bound::Upper, 1)] {
                let p: Vec<f64> = space.schema().iter().map(|p| [p.bounds.0, p.bounds.1][end]).collect();
                let found = space.at_bounds(&p);
                assert_eq!(found.len(), p.len(), "{model}");
                for (found, (parameter, value)) in found.iter().zip(space.schema().iter().zip(p)) {
                    assert_eq!((found.parameter.as_str(), found.value), (&*parameter.name, value), "{model}");
                    assert_eq!(found.bound, bound, "{model} {}", parameter.name);
                }
            }
        }
    }

    #[test]
    fn slopes_are_limits_of_differences() {
        for model in ["ggx", "lafortune", "abc", "rational-legendre"] {
            let space = Space::of(model).unwrap();
            let p = space.start();
            let (u, slopes) = (space.scaled(&p), space.slopes(&p));
            for k in 0..u.len() {
                let at = |h: f64| {
                    let mut moved = u.clone();
                    moved[k] += h;
                    space.parameters(&moved)[k]
                };
                let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
                assert!((difference / slopes[k] - 1.0).abs() < 1e-6, "{model} {k}: {difference} {}", slopes[k]);
            }
        }
    }
}
