//! The curves phi that compress the values of a graph.
//!
//!   t, t^(1/2), t^(1/3), t^(1/4), ln(t + eta), each of max(t, 0), t = f cos theta_i in 1/sr, eta > 0 in 1/sr.

use crate::metric::MetricError;
use std::fmt;

/// One of the study's curves.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Tone {
    /// t
    Linear,
    /// t^(1/2)
    Sqrt,
    /// t^(1/3)
    Cbrt,
    /// t^(1/4)
    FourthRoot,
    /// ln(t + eta)
    Log {
        /// Added to t before the logarithm, 1/sr, greater than 0.
        eta: f64,
    },
}

const ALLOWED: &str = "t, t^1/2, t^1/3, t^1/4, or log:eta=E with E > 0";

impl Tone {
    /// The eight of the study.
    pub const STUDY: [Self; 8] = [
        Self::Linear,
        Self::Sqrt,
        Self::Cbrt,
        Self::FourthRoot,
        Self::Log { eta: 0.001 },
        Self::Log { eta: 0.01 },
        Self::Log { eta: 0.1 },
        Self::Log { eta: 1.0 },
    ];

    /// # Errors
    /// [`MetricError::Parameter`] unless `eta` is positive and finite.
    pub fn log(eta: f64) -> Result<Self, MetricError> {
        if eta > 0.0 && eta.is_finite() {
            return Ok(Self::Log { eta });
        }
        Err(MetricError::Parameter {
            what: "eta".into(),
            found: eta.to_string(),
            allowed: "a number greater than 0".into(),
        })
    }

    /// phi(max(t, 0)).
    pub fn value(self, t: f64) -> f64 {
        let t = t.max(0.0);
        match self {
            Self::Linear => t,
            Self::Sqrt => t.sqrt(),
            Self::Cbrt => t.cbrt(),
            Self::FourthRoot => t.sqrt().sqrt(),
            Self::Log { eta } => (t + eta).ln(),
        }
    }

    /// d phi / dt. Below 0, where the value does not change, 0; at 0 the derivative from above where that is finite, and 0
    /// for the roots, whose slope there is infinite: a black cell exerts no force rather than an endless one.
    pub fn derivative(self, t: f64) -> f64 {
        let root = |value: f64| if t > 0.0 { value } else { 0.0 };
        match self {
            _ if t < 0.0 => 0.0,
            Self::Linear => 1.0,
            Self::Sqrt => root(0.5 / t.sqrt()),
            Self::Cbrt => root(t.cbrt() / (3.0 * t)),
            Self::FourthRoot => root(t.sqrt().sqrt() / (4.0 * t)),
            Self::Log { eta } => 1.0 / (t + eta),
        }
    }

    /// The curve written `name`, as `Display` writes it; a bare `log` takes `eta` from elsewhere.
    ///
    /// # Errors
    /// [`MetricError::Parameter`] for any other text, for `log` without `eta`, and for `eta` beside a root.
    pub fn parse(name: &str, eta: Option<f64>) -> Result<Self, MetricError> {
        let wrong = |found: String, allowed: &str| {
            Err(MetricError::Parameter { what: "phi".into(), found, allowed: allowed.to_owned() })
        };
        let (name, inner) = match name.split_once(':') {
            None => (name, None),
            Some((curve, parameter)) => match parameter.split_once('=').map(|(k, v)| (k.trim(), v.trim().parse())) {
                Some(("eta", Ok(value))) => (curve, Some(value)),
                _ => return wrong(name.to_owned(), ALLOWED),
            },
        };
        let tone = match (name, inner.or(eta)) {
            ("log", Some(eta)) => return Self::log(eta),
            ("log", None) => {
                return wrong("log without eta".into(), "log:eta=E with E > 0 (the study uses 0.001, 0.01, 0.1, 1)");
            }
            ("t" | "linear", _) => Self::Linear,
            ("t^1/2" | "sqrt", _) => Self::Sqrt,
            ("t^1/3" | "cbrt", _) => Self::Cbrt,
            ("t^1/4", _) => Self::FourthRoot,
            _ => return wrong(name.to_owned(), ALLOWED),
        };
        match inner.or(eta) {
            Some(eta) => wrong(format!("{name} with eta={eta}"), "log where eta is given"),
            None => Ok(tone),
        }
    }
}

impl fmt::Display for Tone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Linear => f.write_str("t"),
            Self::Sqrt => f.write_str("t^1/2"),
            Self::Cbrt => f.write_str("t^1/3"),
            Self::FourthRoot => f.write_str("t^1/4"),
            Self::Log { eta } => write!(f, "log:eta={eta}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_the_curves() {
        for tone in Tone::STUDY {
            for t in [1e-6, 0.01, 0.3, 1.0, 77.0] {
                let h = 1e-5 * t;
                let difference = (tone.value(t + h) - tone.value(t - h)) / (2.0 * h);
                // Differences of numbers near -7 that are 1e-8 apart keep five digits or so.
                assert!((tone.derivative(t) / difference - 1.0).abs() < 2e-5, "{tone} at {t}");
            }
            assert_eq!(tone.value(-3.0), tone.value(0.0));
            assert_eq!(tone.derivative(-3.0), 0.0);
            assert!(tone.derivative(0.0).is_finite());
        }
        assert_eq!(Tone::FourthRoot.value(16.0), 2.0);
    }

    #[test]
    fn names_round_trip_and_wrong_ones_say_what_is_allowed() {
        for tone in Tone::STUDY {
            assert_eq!(Tone::parse(&tone.to_string(), None), Ok(tone));
        }
        assert_eq!(Tone::parse("log", Some(0.01)), Ok(Tone::Log { eta: 0.01 }));
        let refused = |name, eta| Tone::parse(name, eta).unwrap_err().to_string();
        assert!(refused("t^1/5", None).contains("phi is t^1/5; it must be t, t^1/2"));
        assert!(refused("log", None).contains("log without eta"));
        assert!(refused("log:eta=0", None).starts_with("eta is 0; it must be a number greater than 0"));
        assert!(refused("log:eta=x", None).contains("phi is log:eta=x"));
        assert!(refused("log", Some(f64::NAN)).contains("eta is NaN"));
        assert!(refused("t^1/4", Some(0.1)).contains("phi is t^1/4 with eta=0.1; it must be log where eta is given"));
    }
}
