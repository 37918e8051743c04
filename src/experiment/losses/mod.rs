//! Which loss should a fit have? Models are fitted to references under several losses, and each fit is judged by metrics
//! that were not its loss.
//!
//! [`unseen`] trains learned metrics that have not seen the references: three to fit with, another to judge with. [`run`] makes
//! and judges the fits, one file each. [`compare`] says which loss is better by which judge, paired over references; [`record`]
//! collects it.
//!
//! | judge | of the whole reference and the fit |
//! | --- | --- |
//! | `D1`, `D4.Cl`, `D4.Cl.CR`, `D9.Cl` | [`vernis_metric::metric::lp`] |
//! | `ot`, `energy` | transport and energy distance on the grid of the settings |
//! | `mos` | predicted mean opinion score (larger is better) of a metric that has seen neither reference nor fit |
//! | `PROBE.log` | descriptor `lights.dE4`: fourth-power mean difference of log pictures of a sphere under that light probe |
//! | `PROBE.ssim`, `PROBE.icid`, ... | metrics on pictures of the study's stimuli under that light ([`vernis_image::stimulus`]), by the same camera |
//! | `PROBE.screen` | descriptor `display.lamps.rms`: root mean square difference of the same pictures on a screen |

pub mod compare;
#[cfg(feature = "train")]
mod job;
mod judges;
pub mod record;
pub mod run;
pub mod unseen;

#[cfg(feature = "train")]
pub use job::{Found, LossesOptions, losses};

use serde::{Deserialize, Serialize};
use unseen::Role;
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
    /// `energy` on the grid of the settings.
    Energy,
    /// The recipe of version 1 of the metric, from a fit under D9.Cl.
    First,
    /// The recipe of `vernis`, from a fit under D9.Cl.
    Learned,
    /// The same from the same start, let in by degrees.
    Blended,
    /// The recipe of `vernis-loss`, as a fit begins by default.
    Distance,
    /// The same from a fit under D9.Cl, let in by degrees.
    BlendedDistance,
}

impl Loss {
    /// All losses, the baseline first.
    pub const ALL: [Self; 10] = [
        Self::Square,
        Self::Logarithm,
        Self::CubeRoot,
        Self::Transport,
        Self::Energy,
        Self::First,
        Self::Learned,
        Self::Blended,
        Self::Distance,
        Self::BlendedDistance,
    ];

    /// Losses that are let in by degrees, each with the one that is not.
    pub const BLENDS: [(Self, Self); 2] = [(Self::Blended, Self::Learned), (Self::BlendedDistance, Self::Distance)];

    /// The metric's own name where it is one of the judges; learned metrics have not seen the reference.
    pub fn name(self) -> &'static str {
        match self {
            Self::Square => "D4.Cl",
            Self::Logarithm => "D9.Cl",
            Self::CubeRoot => "D4.Cl.CR",
            Self::Transport => "ot",
            Self::Energy => "energy",
            Self::First => "vernis-1",
            Self::Learned => "vernis",
            Self::Blended => "vernis-blended",
            Self::Distance => "vernis-loss",
            Self::BlendedDistance => "vernis-loss-blended",
        }
    }

    /// Which learned metric is the loss, if one is.
    pub fn role(self) -> Option<Role> {
        match self {
            Self::First => Some(Role::First),
            Self::Learned | Self::Blended => Some(Role::Metric),
            Self::Distance | Self::BlendedDistance => Some(Role::Distance),
            _ => None,
        }
    }

    /// Whether an evaluation is so dear that their number is a setting.
    fn is_dear(self) -> bool {
        self.role().is_some() || matches!(self, Self::Transport | Self::Energy)
    }

    /// L-BFGS for the distances between graphs, where a gradient spares nine tenths of the evaluations, which are dear; else `default`.
    fn method(self, default: Method) -> Method {
        if matches!(self, Self::Transport | Self::Energy) { Method::Lbfgs } else { default }
    }

    /// `None`: as a fit under the metric begins by default.
    fn start(self) -> Option<Start> {
        match self {
            Self::First | Self::Learned => Some(Start::LogAtOnce),
            Self::Blended | Self::BlendedDistance => Some(Start::Log),
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
