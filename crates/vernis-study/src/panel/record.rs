//! Everything that is known of a study's ratings, as plain data.

use super::anova::Anova;
use super::box_plot::BoxPlot;
use super::intraclass::Intraclass;
use super::moments::MeanAndDeviation;
use super::opinion::Opinion;
use super::reliability::{ExpectedReliability, SplitHalf};
use super::screening::{Criterion, Participant};
use super::sos::SosFit;
use super::t_test::TTest;
use crate::dataset::opinions::Stimulus;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use vernis_metric::math::quantile::Interval;
use vernis_metric::math::rating_scale::RatingScale;

/// The statistics of a study. What the study does not allow is `None` and named in `missing`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StudyRecord {
    /// Name of the study.
    pub study: String,
    /// How the record was asked for.
    pub command: String,
    /// Of this crate.
    pub version: String,
    /// SHA-256 of the files that were read, by name.
    pub data: BTreeMap<String, String>,
    /// Ratings come from simulated observers and say nothing about people.
    pub synthetic: bool,
    /// The scale of every score here.
    #[serde(default)]
    pub scale: RatingScale,
    /// Rated stimuli that were found, and those of the whole study.
    pub found: usize,
    /// Rated stimuli of the whole study.
    pub known: usize,
    /// Seed of splits and resamples.
    pub seed: u64,
    /// Where standard deviations and intervals of single means come from.
    pub spread: Spread,
    /// How the intervals of single means are computed, in words; empty in records of before it was kept, whose intervals had no
    /// width where all scores were equal or the mean was an end of the scale.
    #[serde(default)]
    pub intervals: String,
    /// By stimulus.
    pub opinions: Vec<RatedStimulus>,
    /// Number of materials.
    pub materials: usize,
    /// Number of approximation methods.
    pub methods: usize,
    /// Illuminations, that with the most stimuli first; statistics that do not compare illuminations use it alone.
    pub illuminations: Vec<String>,
    /// Who rated, where the study has raw scores.
    pub panel: Option<Panel>,
    /// Agreement of random halves of the panel.
    pub split_half: Option<SplitHalf>,
    /// Where there are means alone: what the noise model expects.
    pub expected_reliability: Option<ExpectedReliability>,
    /// ICC(1,1) and ICC(1,k).
    pub intraclass_one_way: Option<Intraclass>,
    /// ICC(2,1) and ICC(2,k).
    pub intraclass_two_way: Option<Intraclass>,
    /// How the spread of scores depends on their mean.
    pub sos: Option<SosFit>,
    /// The two types of material compared.
    pub material_types: Option<TypeComparison>,
    /// The two illuminations compared.
    pub illumination: Option<IlluminationComparison>,
    /// Material type x method, under the first illumination.
    pub anova_two_way: Option<Anova>,
    /// Illumination x material type x method, on what was rated under both.
    pub anova_three_way: Option<Anova>,
    /// Paired tests between models, under the first illumination.
    #[serde(default)]
    pub models: Option<ModelComparison>,
    /// How opinions of samples of a manifold follow their distance from the reference.
    #[serde(default)]
    pub manifold: Option<ManifoldCorrelation>,
    /// Box plots of the mean opinion scores.
    pub boxes: Vec<BoxSet>,
    /// Statistics that the study does not allow.
    pub missing: Vec<Missing>,
}

/// Where the spread of scores around a mean comes from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "source", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Spread {
    /// The scores themselves.
    Scores,
    /// Unknown: means alone, on a scale without a worst end.
    Unknown,
    /// Assumed: variance a (x - 1)(5 - x), x in grades, and a number of raters.
    NoiseModel {
        /// From 0 (everybody agrees) to 1 (only ends of the scale are used).
        a: f64,
        /// Scores of each stimulus.
        raters: usize,
    },
}

/// A stimulus and what the panel said of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RatedStimulus {
    /// What was rated.
    #[serde(flatten)]
    pub stimulus: Stimulus,
    /// Mean opinion score and spread.
    #[serde(flatten)]
    pub opinion: Opinion,
}

/// Who rated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Panel {
    /// Checks that reject.
    pub rejecting: Vec<Criterion>,
    /// Participants that are left, and their judgements: what every statistic rests on.
    pub participants: usize,
    /// Judgements of these participants.
    pub judgements: usize,
    /// Mean and standard deviation over the participants.
    pub judgements_each: Option<MeanAndDeviation>,
    /// Mean and standard deviation over the stimuli.
    pub raters_each: Option<MeanAndDeviation>,
    /// Everybody, rejected or not.
    pub screened: Vec<Participant>,
}

impl Panel {
    /// Participants that were rejected.
    pub fn rejected(&self) -> impl Iterator<Item = &Participant> {
        self.screened.iter().filter(|p| p.fails.iter().any(|c| self.rejecting.contains(c)))
    }

    /// How many participants fail a check.
    pub fn failing(&self, criterion: Criterion) -> usize {
        self.screened.iter().filter(|p| p.fails.contains(&criterion)).count()
    }
}

/// Two types of material, without hidden references but where they are named.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TypeComparison {
    /// In the order of the differences: first minus second.
    pub types: [String; 2],
    /// Welch's test of the mean opinion scores.
    pub mos: TTest,
    /// 95 % of the same difference, by bootstrap of materials, whose ratings hang together.
    pub by_material: Option<Interval>,
    /// Welch's test of the standard deviations.
    pub deviation: Option<TTest>,
    /// Welch's test of the mean opinion scores of hidden references.
    pub hidden_references: Option<TTest>,
}

/// Two illuminations, on what was rated under both.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IlluminationComparison {
    /// In the order of the differences: first minus second.
    pub illuminations: [String; 2],
    /// Paired test of the mean opinion scores of every stimulus, hidden references included.
    pub mos: TTest,
    /// Paired test of the standard deviations.
    pub deviation: Option<TTest>,
    /// Paired test of the mean opinion scores of hidden references.
    pub hidden_references: Option<TTest>,
    /// Pearson's r of the mean opinion scores under the two illuminations.
    pub pearson: f64,
    /// Spearman's rho of the mean opinion scores under the two illuminations.
    pub spearman: f64,
    /// 95 %, by bootstrap of materials.
    pub pearson_interval: Option<Interval>,
    /// 95 % of Spearman's rho, by bootstrap of materials.
    pub spearman_interval: Option<Interval>,
}

/// Models pair by pair, each with the better of its fits, on the materials that both were fitted to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelComparison {
    /// Names of the models, the best mean first.
    pub models: Vec<String>,
    /// Which models take no part, and why.
    pub left_out: Option<String>,
    /// Every pair, in the order of `models`.
    pub pairs: Vec<ModelPair>,
}

/// Two models.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelPair {
    /// In the order of the differences: first minus second.
    pub models: [String; 2],
    /// Paired test of the mean opinion scores; the pairs are materials.
    pub mos: TTest,
    /// Its p, corrected for all pairs (Holm 1979).
    pub holm_p: f64,
}

/// Samples of a manifold: mean opinion scores against the distance from the reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ManifoldCorrelation {
    /// Rated samples.
    pub stimuli: usize,
    /// N, the number of the last step; step i is (i/N)^5 of the diameter of the parameter space away from the reference.
    pub steps: usize,
    /// Pearson's r of distance and mean opinion score.
    pub pearson: f64,
    /// Spearman's rho of the same.
    pub spearman: f64,
    /// 95 %, by bootstrap of materials.
    pub pearson_interval: Option<Interval>,
    /// 95 % of Spearman's rho, by bootstrap of materials.
    pub spearman_interval: Option<Interval>,
}

/// Box plots side by side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BoxSet {
    /// Title of the figure.
    pub title: String,
    /// What tells the boxes apart, such as `method` and `material type`.
    pub factors: Vec<String>,
    /// What was left out, and why.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    /// One box for each combination of levels.
    pub boxes: Vec<NamedBox>,
}

/// The mean opinion scores of the stimuli at one combination of levels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NamedBox {
    /// One a factor.
    pub levels: Vec<String>,
    /// Box plot of the mean opinion scores.
    pub mos: BoxPlot,
    /// Mean of the mean opinion scores.
    pub mean: f64,
    /// 95 % of the mean, by bootstrap of materials.
    pub mean_interval: Option<Interval>,
    /// Widths of the intervals of the single means; `None` where they are assumed.
    pub interval_width: Option<BoxPlot>,
}

/// A statistic that the study does not allow.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Missing {
    /// The statistic, in words.
    pub what: String,
    /// What would have been needed.
    pub why: String,
}
