//! Which loss should a fit have? Models are fitted to references under several losses, and each fit is judged by metrics
//! that were not its loss.
//!
//! [`unseen`] trains learned metrics that have not seen the references: one to fit with, another to judge with. [`run`] makes
//! and judges the fits, one file each. [`compare`] says which loss is better by which judge, paired over references; [`record`]
//! collects it.
//!
//! | judge | of the whole reference and the fit |
//! | --- | --- |
//! | `D1`, `D4.Cl`, `D4.Cl.CR`, `D9.Cl` | [`vernis_metric::metric::lp`] |
//! | `ot`, `energy` | transport and energy distance on the grid of the settings |
//! | `mos` | predicted mean opinion score (larger is better) of a metric that has seen neither reference nor fit |
//! | `PROBE.log` | descriptor `lights.dE4`: fourth-power mean difference of log pictures of a sphere under that light probe |
//! | `PROBE.screen` | descriptor `display.lamps.rms`: root mean square difference of the same pictures on a screen |

pub mod compare;
#[cfg(feature = "train")]
mod job;
pub mod record;
pub mod run;
pub mod unseen;

#[cfg(feature = "train")]
pub use job::{Found, LossesOptions, losses};

use serde::{Deserialize, Serialize};
use vernis_metric::fit::Start;
use vernis_metric::fit::optimizer::Method;

/// What a fit minimises, and from where.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Loss {
    /// D4.Cl, the study's own: the baseline.
    Square,
    /// D9.Cl.
    Logarithm,
    /// D4.Cl.CR: D4.Cl of cube roots.
    CubeRoot,
    /// `ot` on the grid of the settings.
    Transport,
    /// A learned metric that has not seen the reference, from a fit under D9.Cl.
    Learned,
    /// The same from the same start, let in by degrees.
    Blended,
}

impl Loss {
    /// All losses, the baseline first.
    pub const ALL: [Self; 6] =
        [Self::Square, Self::Logarithm, Self::CubeRoot, Self::Transport, Self::Learned, Self::Blended];

    /// The metric's own name where it is one of the judges.
    pub fn name(self) -> &'static str {
        match self {
            Self::Square => "D4.Cl",
            Self::Logarithm => "D9.Cl",
            Self::CubeRoot => "D4.Cl.CR",
            Self::Transport => "ot",
            Self::Learned => "learned",
            Self::Blended => "blended",
        }
    }

    /// Whether a learned metric is the loss.
    pub fn is_learned(self) -> bool {
        matches!(self, Self::Learned | Self::Blended)
    }

    /// Whether an evaluation is so dear that their number is a setting.
    fn is_dear(self) -> bool {
        self.is_learned() || self == Self::Transport
    }

    /// The study's method; L-BFGS for transport, where a gradient spares nine tenths of the evaluations, which are dear; `of_learned` for
    /// learned metrics.
    fn method(self, of_learned: Method) -> Method {
        match self {
            Self::Transport => Method::Lbfgs,
            Self::Learned | Self::Blended => of_learned,
            Self::Square | Self::Logarithm | Self::CubeRoot => Method::HookeJeeves,
        }
    }

    fn start(self) -> Option<Start> {
        match self {
            Self::Learned => Some(Start::LogAtOnce),
            Self::Blended => Some(Start::Log),
            _ => None,
        }
    }
}

/// The judge of which more is better.
pub const OPINION: &str = "mos";

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn losses_have_names_of_their_own() {
        assert_eq!(Loss::ALL.map(Loss::name).into_iter().collect::<BTreeSet<_>>().len(), Loss::ALL.len());
    }
}
