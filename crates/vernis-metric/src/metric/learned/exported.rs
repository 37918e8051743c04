//! The exported metric: one self-describing JSON file (`*.vernis.json`) that evaluates without any training library.
//!
//! ```text
//! format         2; a reader refuses newer ones, and reads older ones
//! name           such as "vernis"
//! metric_version of the numbers; quote it with any score
//! scale          {worst, best, open}: the scale of the ratings and of every score here; absent for 1 (worst) to 5 (best)
//! descriptors    {setup, set: {families, embeddings}}: which descriptors, computed how
//! regressor      {identity_mos, inputs: [{name, role}], terms: [{weight, standardizer, function}]}, see `Regressor`
//! members        [[term, ...], ...]: the same trained on resampled materials, for the spread of a prediction
//! interval       {level, factor, offset}, see `Interval`
//! provenance     study, synthetic, rows, materials, data [{name, sha256}], seed, command, crate_version,
//!                agreement [{measure, rows, value, low, high}]
//! ```
//!
//! Keys keep this order and numbers their shortest form that reads back as the same f64, so that the same metric gives
//! the same bytes. With p = `regressor.predict` a pair gets
//!
//!   distance = max(0, d (identity_mos - p)),   mos = clip(p),   low, high = clip(p -+ factor (spread + offset)),
//!
//! spread being the standard deviation of the members' predictions, d 1 where larger scores are better and -1 where they are
//! worse, clip the end of the scale for what lies beyond. Identical BRDFs get a distance of exactly 0.

use super::regressor::{Input, Regressor, RegressorError, Term, difference};
use crate::brdf::ContentHash;
use crate::descriptor::{DescriptorError, DescriptorSet, Family, SetupId};
use crate::io::shown;
use crate::math::rating_scale::RatingScale;
use crate::metric::Score;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Of files written by this version; older ones keep loading.
pub const FORMAT: u32 = 2;

/// Characters of the name of a metric.
const LONGEST_NAME: usize = 200;
/// Largest factor and offset of an interval.
const LARGEST_INTERVAL: f64 = 1e6;

/// Significant digits of exported weights: about those of an f32.
const DIGITS: usize = 7;

/// Why there is no exported metric.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum ExportedError {
    #[error("{file}, line {line}, column {column}: not an exported metric: {reason}")]
    Json { file: String, line: usize, column: usize, reason: String },
    #[error("{file}: cannot be read: {reason}")]
    Read { file: String, reason: String },
    #[error("{file}: format {found}, written by vernis {writer}; this is vernis {program}, which reads up to format {supported}: use vernis {writer} or later", program = env!("CARGO_PKG_VERSION"))]
    NewerFormat { file: String, found: u32, supported: u32, writer: String },
    #[error("{file}: unknown descriptors: {source}")]
    UnknownFamily { file: String, source: Box<DescriptorError> },
    #[error("{file}: {source}")]
    Setup { file: String, source: Box<DescriptorError> },
    #[error("{file}: input {index} is {found}; it must be {expected}, as in the descriptors")]
    Columns { file: String, index: usize, found: String, expected: String },
    #[error("{file}: {what} is {found}; it must be {allowed}")]
    Value { file: String, what: &'static str, found: String, allowed: &'static str },
    #[error("{file}: {part}: {source}")]
    Regressor { file: String, part: String, source: RegressorError },
    #[error("the exported metric {name} cannot be written: {reason}")]
    Write { name: String, reason: String },
    #[error("the metric {name} was given {found} descriptors; it takes {expected}")]
    Inputs { name: String, found: usize, expected: usize },
    #[error("{name}: descriptor {column} is {value}; it must be a finite number")]
    NotFinite { name: String, column: String, value: f64 },
    #[error("{name}: {what} is {value}; it must be a finite number")]
    Prediction { name: String, what: &'static str, value: f64 },
}

/// Which descriptors a metric takes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Descriptors {
    /// Version and options of what computes them, see [`SetupId`].
    pub setup: String,
    /// Families and embeddings, in order.
    pub set: DescriptorSet,
}

/// How wide the interval about a prediction is: half-width = factor (spread + offset), in MOS.
///
/// Normalised split conformal prediction (Papadopoulos, Gammerman & Vovk 2008; Lei et al. 2018,
/// doi:10.1080/01621459.2017.1307116, 5.2): the factor is the quantile of |residual| / (spread + offset) over rows that
/// the model has not seen. Coverage holds on average over pairs like those of the study, not for each pair.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interval {
    /// Share of ratings inside, 0 to 1.
    pub level: f64,
    /// Half-width for each MOS of spread + offset.
    pub factor: f64,
    /// In MOS; keeps the interval honest where all members agree.
    pub offset: f64,
}

impl Interval {
    /// From out-of-fold residuals (MOS) and the members' spreads on the same rows; zeros where there are no members.
    /// `None` without rows, or where the level lies outside 0 to 1.
    pub fn calibrate(residuals: &[f64], spreads: &[f64], level: f64) -> Option<Self> {
        if residuals.is_empty() || residuals.len() != spreads.len() || !(level > 0.0 && level < 1.0) {
            return None;
        }
        let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let offset = sizes[sizes.len() / 2].max(1e-3);
        let mut ratios: Vec<f64> = residuals.iter().zip(spreads).map(|(r, s)| r.abs() / (s + offset)).collect();
        ratios.sort_by(f64::total_cmp);
        let rank = ((ratios.len() + 1) as f64 * level).ceil() as usize;
        Some(Self { level, factor: ratios[rank.clamp(1, ratios.len()) - 1], offset })
    }
}

/// A file that the metric was trained on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DataHash {
    /// Name of the file, as the study lists it.
    pub name: String,
    /// SHA-256 of its content, 64 hexadecimal digits.
    pub sha256: String,
}

/// Agreement with people that the same recipe reached on rows it had not seen, with its 95 % interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reached {
    /// Such as `srocc`.
    pub measure: String,
    /// Such as `all` or `without the manifold samples`.
    pub rows: String,
    /// The measured agreement.
    pub value: f64,
    /// Lower end of its 95 % interval.
    pub low: f64,
    /// Upper end of its 95 % interval.
    pub high: f64,
}

/// Where a metric comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Name of the study that it was trained on.
    pub study: String,
    /// Ratings came from simulated observers.
    pub synthetic: bool,
    /// Rated pairs that it was trained on.
    pub rows: usize,
    /// Reference materials among them.
    pub materials: usize,
    /// The files of the study.
    pub data: Vec<DataHash>,
    /// Seed of the training.
    pub seed: u64,
    /// The command that trains it again.
    pub command: String,
    /// Version of the package that wrote the file.
    pub crate_version: String,
    /// Agreement with people for rows that were held out.
    pub agreement: Vec<Reached>,
}

/// Everything that a file holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExportedMetric {
    format: u32,
    /// Name of the metric, such as `vernis`.
    pub name: String,
    /// Version of its numbers; quote it with any score.
    pub metric_version: String,
    /// The scale of its scores.
    #[serde(default, skip_serializing_if = "RatingScale::is_grades")]
    pub scale: RatingScale,
    /// Which descriptors it takes.
    pub descriptors: Descriptors,
    /// From descriptors to a mean opinion score.
    pub regressor: Regressor,
    /// The terms of models trained on resampled materials, for the spread of a prediction.
    pub members: Vec<Vec<Term>>,
    /// How wide the interval about a prediction is.
    pub interval: Interval,
    /// Where the metric comes from.
    pub provenance: Provenance,
}

impl ExportedMetric {
    /// Weights are rounded to seven significant digits here, so that the file holds exactly what this value computes. Members must
    /// share the regressor's inputs and identity.
    pub fn new(
        name: &str,
        metric_version: &str,
        descriptors: Descriptors,
        regressor: Regressor,
        members: Vec<Regressor>,
        interval: Interval,
        provenance: Provenance,
    ) -> Result<Self, ExportedError> {
        for (i, member) in members.iter().enumerate() {
            if member.inputs != regressor.inputs || member.identity_mos != regressor.identity_mos {
                return Err(ExportedError::Write {
                    name: name.to_owned(),
                    reason: format!("member {i} has other inputs or another identity than the regressor"),
                });
            }
        }
        let metric = Self {
            format: FORMAT,
            name: name.to_owned(),
            metric_version: metric_version.to_owned(),
            scale: RatingScale::GRADES,
            descriptors,
            regressor: regressor.rounded(DIGITS),
            members: members.into_iter().map(|m| m.rounded(DIGITS).terms).collect(),
            interval,
            provenance,
        };
        metric.check(name)?;
        Ok(metric)
    }

    /// A metric in grades, 1 to 5, as one whose scores, distances and intervals are on `scale`.
    ///
    /// # Errors
    /// A metric that is on another scale already; numbers that leave their range.
    pub fn on_scale(mut self, scale: RatingScale) -> Result<Self, ExportedError> {
        if !self.scale.is_grades() {
            let reason = format!("its scores are on the scale {}, not in grades", self.scale);
            return Err(ExportedError::Write { name: self.name, reason });
        }
        self.scale = scale;
        // Terms are differences of scores, so that their weights carry the unit.
        self.regressor.identity_mos = scale.clamp(scale.score(self.regressor.identity_mos));
        let terms = self.regressor.terms.iter_mut().chain(self.members.iter_mut().flatten());
        terms.for_each(|term| term.weight = scale.difference(term.weight));
        self.interval.offset = scale.width(self.interval.offset);
        self.check(&self.name)?;
        Ok(self)
    }

    /// Reads the text of a file; `file` names it in errors.
    ///
    /// # Errors
    /// A text that is no exported metric, or one of a newer format or version of the descriptors; weights and shapes that
    /// cannot be.
    pub fn parse(text: &str, file: &str) -> Result<Self, ExportedError> {
        // What a newer file, or one of other descriptors, is refused by comes first: the rest may not be readable.
        #[derive(Deserialize)]
        struct Header {
            format: u32,
        }
        #[derive(Deserialize)]
        struct Families {
            families: Vec<String>,
        }
        #[derive(Deserialize)]
        struct Names {
            setup: String,
            set: Families,
        }
        #[derive(Deserialize)]
        struct Contents {
            descriptors: Names,
        }
        #[derive(Deserialize)]
        struct Program {
            crate_version: String,
        }
        #[derive(Deserialize)]
        struct Written {
            provenance: Program,
        }
        let found = json::<Header>(text, file)?.format;
        if found > FORMAT {
            let writer = json::<Written>(text, file)
                .map_or_else(|_| "of another version".to_owned(), |w| w.provenance.crate_version);
            return Err(ExportedError::NewerFormat { file: file.to_owned(), found, supported: FORMAT, writer });
        }
        let names = json::<Contents>(text, file)?.descriptors;
        for family in &names.set.families {
            Family::named(family)
                .map_err(|e| ExportedError::UnknownFamily { file: file.to_owned(), source: Box::new(e) })?;
        }
        SetupId::known(&names.setup)
            .map_err(|e| ExportedError::Setup { file: file.to_owned(), source: Box::new(e) })?;
        let metric: Self = json(text, file)?;
        metric.check(file)?;
        Ok(metric)
    }

    /// The text of the file, ending in a line break.
    pub fn to_json(&self) -> Result<String, ExportedError> {
        let text = serde_json::to_string(self)
            .map_err(|e| ExportedError::Write { name: self.name.clone(), reason: e.to_string() })?;
        Ok(text + "\n")
    }

    /// A hash of what the file holds, but for its name and provenance: what decides the numbers.
    pub fn content(&self) -> ContentHash {
        let parts = (&self.metric_version, &self.descriptors, &self.regressor, &self.members, &self.interval);
        // Numbers, texts and lists have a form in JSON.
        if self.scale.is_grades() {
            return ContentHash::of(&serde_json::to_vec(&parts).unwrap_or_default());
        }
        ContentHash::of(&serde_json::to_vec(&(parts, self.scale)).unwrap_or_default())
    }

    /// The score of a pair from its descriptors, in the order of `regressor.inputs`.
    pub fn score(&self, raw: &[f64]) -> Result<Score, ExportedError> {
        let prediction = self.prediction(raw)?;
        let half = self.interval.factor * (self.spread(raw) + self.interval.offset);
        self.finite("the half-width of the interval", half)?;
        let clip = |mos: f64| self.scale.clamp(mos);
        Ok(Score {
            distance: self.below_identical(prediction).max(0.0),
            mos: clip(prediction),
            low: clip(prediction - half),
            high: clip(prediction + half),
            scale: self.scale,
        })
    }

    /// The distance of [`ExportedMetric::score`] before it is cut off at zero: a fit needs the slope there.
    pub fn signed_distance(&self, raw: &[f64]) -> Result<f64, ExportedError> {
        Ok(self.below_identical(self.prediction(raw)?))
    }

    /// [`ExportedMetric::signed_distance`] and its derivative by every descriptor, in the order of `regressor.inputs`. At kinks one
    /// subgradient is taken: see [`Regressor::gradient`].
    ///
    /// # Errors
    /// Another number of descriptors; one that is not finite; a value or derivative that is not.
    pub fn signed_distance_and_gradient(&self, raw: &[f64]) -> Result<(f64, Vec<f64>), ExportedError> {
        self.check_raw(raw)?;
        self.distance_of(self.regressor.gradient(raw))
    }

    /// What a fit by gradients minimises: the signed distance with saturated distances in their smooth form
    /// ([`Regressor::smooth_gradient`]), and its derivative by every descriptor. Exactly 0 for identical BRDFs; the same as
    /// [`ExportedMetric::signed_distance_and_gradient`] for a metric without such a distance.
    ///
    /// # Errors
    /// Those of [`ExportedMetric::signed_distance_and_gradient`].
    pub fn loss_and_gradient(&self, raw: &[f64]) -> Result<(f64, Vec<f64>), ExportedError> {
        self.check_raw(raw)?;
        self.distance_of(self.regressor.smooth_gradient(raw))
    }

    fn distance_of(&self, (prediction, mut gradient): (f64, Vec<f64>)) -> Result<(f64, Vec<f64>), ExportedError> {
        let prediction = self.finite("the predicted score", prediction)?;
        gradient.iter_mut().for_each(|g| *g *= -self.scale.direction());
        gradient.iter().try_for_each(|&g| self.finite("a derivative of the distance", g).map(|_| ()))?;
        Ok((self.below_identical(prediction), gradient))
    }

    /// How much worse a prediction is than that of identical BRDFs.
    fn below_identical(&self, prediction: f64) -> f64 {
        self.scale.direction() * (self.regressor.identity_mos - prediction)
    }

    fn prediction(&self, raw: &[f64]) -> Result<f64, ExportedError> {
        self.check_raw(raw)?;
        // Where a number is none, `max` and `clamp` would make a score of it.
        self.finite("the predicted score", self.regressor.predict(raw))
    }

    fn check_raw(&self, raw: &[f64]) -> Result<(), ExportedError> {
        let inputs = &self.regressor.inputs;
        if raw.len() != inputs.len() {
            let (found, expected) = (raw.len(), inputs.len());
            return Err(ExportedError::Inputs { name: self.name.clone(), found, expected });
        }
        if let Some((input, &value)) = inputs.iter().zip(raw).find(|(_, v)| !v.is_finite()) {
            return Err(ExportedError::NotFinite { name: self.name.clone(), column: input.name.clone(), value });
        }
        Ok(())
    }

    fn finite(&self, what: &'static str, value: f64) -> Result<f64, ExportedError> {
        if value.is_finite() {
            Ok(value)
        } else {
            Err(ExportedError::Prediction { name: self.name.clone(), what, value })
        }
    }

    /// Standard deviation of the members' predictions, in MOS; 0 for fewer than two members.
    pub fn spread(&self, raw: &[f64]) -> f64 {
        if self.members.len() < 2 {
            return 0.0;
        }
        let inputs = &self.regressor.inputs;
        let predictions: Vec<f64> = self.members.iter().map(|terms| difference(terms, inputs, raw)).collect();
        let n = predictions.len() as f64;
        let mean = predictions.iter().sum::<f64>() / n;
        (predictions.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()
    }

    fn check(&self, file: &str) -> Result<(), ExportedError> {
        let value =
            |what, found: String, allowed| Err(ExportedError::Value { file: file.to_owned(), what, found, allowed });
        let characters = self.name.chars().count();
        if !(1..=LONGEST_NAME).contains(&characters) || self.name.chars().any(char::is_control) {
            return value("the name", format!("`{}`", shown(&self.name, 50)), "1 to 200 characters without controls");
        }
        let Interval { level, factor, offset } = self.interval;
        if !(level > 0.0 && level < 1.0) {
            return value("the level of the interval", level.to_string(), "between 0 and 1");
        }
        for (what, x) in [("the factor of the interval", factor), ("the offset of the interval", offset)] {
            if !(0.0..=LARGEST_INTERVAL).contains(&x) {
                return value(what, x.to_string(), "0 or more, and at most 1000000");
            }
        }
        if !self.scale.contains(self.regressor.identity_mos) {
            let allowed = if self.scale.is_grades() { "1 to 5" } else { "on the scale of the file" };
            return value("identity_mos", self.regressor.identity_mos.to_string(), allowed);
        }
        let expected: Vec<Input> = self.descriptors.set.columns().iter().map(Input::from).collect();
        let shown = |inputs: &[Input], i: usize| match inputs.get(i) {
            Some(Input { name, role }) => format!("{name} ({role:?})"),
            None => "nothing".to_owned(),
        };
        let inputs = &self.regressor.inputs;
        if let Some(index) = (0..inputs.len().max(expected.len())).find(|&i| inputs.get(i) != expected.get(i)) {
            return Err(ExportedError::Columns {
                file: file.to_owned(),
                index,
                found: shown(inputs, index),
                expected: shown(&expected, index),
            });
        }
        let invalid = |part: String| move |source| ExportedError::Regressor { file: file.to_owned(), part, source };
        self.regressor.check().map_err(invalid("regressor".into()))?;
        for (i, terms) in self.members.iter().enumerate() {
            Regressor::check_terms(terms, &self.regressor.inputs).map_err(invalid(format!("member {i}")))?;
        }
        Ok(())
    }
}

fn json<'a, T: Deserialize<'a>>(text: &'a str, file: &str) -> Result<T, ExportedError> {
    serde_json::from_str(text).map_err(|e| ExportedError::Json {
        file: file.to_owned(),
        line: e.line(),
        column: e.column(),
        reason: e.to_string(),
    })
}
