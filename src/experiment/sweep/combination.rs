//! The combinations of parameters that the study tried, or could have tried.
//!
//! Transport: p in {1, 2}, alpha in {0.01, 0.05, 0.1, 1}, epsilon (blur) in {0.01, 0.02, 0.05, 0.1}, s (scaling) in {0.8, 0.9, 0.95, 0.99},
//! phi in {t, t^1/2, t^1/3, t^1/4, ln(t + eta)}, eta in {0.001, 0.01, 0.1, 1}: 2 x 4 x 4 x 4 x 8 = 1024. The paper counts 992 and
//! does not say which 32 it leaves out; without p 2, alpha 1, epsilon 0.01 (4 s x 8 phi = 32), where the squared distances
//! reach 10^4 epsilons and exponentials vanish, 992 are left, and those are swept here. What the metric refuses is a result. Energy:
//! alpha and phi, 4 x 8 = 32. The power gamma in {0.25, 0.35, 0.5} is applied afterwards, to the same divergences.
//!
//! Source: Lavoué et al. 2021, doi:10.1111/cgf.142636, section 6.1.

use std::fmt;
use vernis_metric::metric::graph::Tone;
use vernis_metric::metric::transport::GroundCost;

/// Lengths of the base axes (the paper's alpha).
pub const ALPHAS: [f64; 4] = [0.01, 0.05, 0.1, 1.0];
/// Length scales below which transport is smoothed (the paper's epsilon).
pub const BLURS: [f64; 4] = [0.01, 0.02, 0.05, 0.1];
/// Factors from one blur of the annealing to the next (the paper's s).
pub const SCALINGS: [f64; 4] = [0.8, 0.9, 0.95, 0.99];
/// Powers of the distance in the ground cost (the paper's p).
pub const POWERS: [f64; 2] = [2.0, 1.0];
/// Powers that are applied to the divergence.
pub const GAMMAS: [f64; 3] = [0.25, 0.35, 0.5];

/// The distances of the study's section 6.1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Family {
    /// The transport distance.
    Transport,
    /// The energy distance.
    Energy,
}

/// Parameters, but for gamma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Combination {
    /// Length of the base axes.
    pub alpha: f64,
    /// The curve phi that compresses the values of the graph.
    pub tone: Tone,
    /// `None`: the energy distance.
    pub transport: Option<Transport>,
}

/// Those of the transport distance alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transport {
    /// Power of the distance in the ground cost, 1 or 2.
    pub p: f64,
    /// Length scale below which transport is smoothed (the paper's epsilon).
    pub blur: f64,
    /// Factor from one blur of the annealing to the next (the paper's s).
    pub scaling: f64,
}

impl Combination {
    /// All of the study's: 992 of transport, 32 of the energy distance. Those of one alpha, blur and phi follow each other.
    pub fn of_study() -> Vec<Self> {
        let mut all = Vec::new();
        let with_tones =
            |transport: Option<Transport>, alpha: f64| Tone::STUDY.map(|tone| Self { alpha, tone, transport });
        for p in POWERS {
            for (alpha, blur) in ALPHAS.into_iter().flat_map(|alpha| BLURS.map(|blur| (alpha, blur))) {
                if (p, alpha, blur) != (2.0, 1.0, 0.01) {
                    all.extend(
                        SCALINGS
                            .into_iter()
                            .flat_map(|scaling| with_tones(Some(Transport { p, blur, scaling }), alpha)),
                    );
                }
            }
        }
        all.extend(ALPHAS.into_iter().flat_map(|alpha| with_tones(None, alpha)));
        all
    }

    /// Which of the two distances the parameters belong to.
    pub fn family(&self) -> Family {
        if self.transport.is_some() { Family::Transport } else { Family::Energy }
    }

    /// The version of the metric's numbers.
    pub fn version(&self) -> &'static str {
        match self.transport {
            Some(Transport { p: 1.0, .. }) => GroundCost::Distance.version(),
            Some(_) => GroundCost::SquaredDistance.version(),
            None => vernis_metric::metric::kernel::VERSION,
        }
    }

    /// The notation with one gamma: a metric of the registry.
    pub fn with_gamma(&self, gamma: f64) -> String {
        format!("{},gamma={gamma}]", self.to_string().trim_end_matches(']'))
    }

    /// A name for files: the notation without what file systems dislike.
    pub fn slug(&self) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
        self.to_string().trim_end_matches(']').chars().map(plain).collect()
    }

    /// Roughly how long it takes, in units of the study's best: the annealing's steps grow as 1/-ln(s).
    pub fn weight(&self) -> usize {
        self.transport.map_or(1, |t| (0.8f64.ln() / t.scaling.ln()).ceil() as usize)
    }
}

/// The notation that the registry understands, without gamma.
impl fmt::Display for Combination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { alpha, tone, transport } = self;
        match transport {
            Some(Transport { p, blur, scaling }) => {
                write!(f, "ot[p={p},alpha={alpha},blur={blur},scaling={scaling},phi={tone}]")
            }
            None => write!(f, "energy[alpha={alpha},phi={tone}]"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use vernis_metric::metric::registry::Registry;

    #[test]
    fn there_are_as_many_as_the_paper_says_and_the_registry_knows_them() {
        let all = Combination::of_study();
        assert_eq!(all.iter().filter(|c| c.family() == Family::Transport).count(), 992);
        assert_eq!(all.len(), 992 + 32);
        assert_eq!(all.iter().map(Combination::slug).collect::<BTreeSet<_>>().len(), all.len());
        let registry = Registry::standard().unwrap();
        for combination in &all {
            let name = combination.with_gamma(0.35);
            assert_eq!(registry.get(&name).unwrap().name(), name);
        }
    }
}
