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
use std::sync::Arc;

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
