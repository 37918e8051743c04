//! Several models as one: averages of different trainers, and members trained on resampled materials.
//!
//! The average of a kernel method and a network agrees better with people than either, for they err differently. The
//! members of a bootstrap by material group (Davison & Hinkley 1997, 3.8: resample whole clusters) spread as much as
//! the prediction depends on which materials happened to be rated.

use super::{Predictor, TrainError, Trainer};
use crate::samples::split::TrainingSet;
use ndarray::{ArrayView2, Axis};
use vernis_metric::descriptor::Column;
use vernis_metric::math::parallel;
use vernis_metric::metric::learned::Regressor;

/// The mean of what several trainers learn.
pub struct Average {
    /// Name of the average.
    pub name: String,
    /// The trainers, each with the same weight.
    pub trainers: Vec<Box<dyn Trainer>>,
}

impl Trainer for Average {
    fn name(&self) -> &str {
        &self.name
    }

    fn train(&self, set: &TrainingSet, seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        let members: Vec<_> = self.trainers.iter().map(|t| t.train(set, seed)).collect::<Result<_, _>>()?;
        if members.is_empty() {
            return Err(TrainError::Option {
                trainer: self.name.clone(),
                what: "the number of trainers",
                value: 0.0,
                allowed: "at least 1",
            });
        }
        let regressor = average_regressors(&members);
        Ok(Box::new(Mean { members, regressor }))
    }
}

/// The mean of several predictors.
struct Mean {
    members: Vec<Box<dyn Predictor>>,
    regressor: Option<Regressor>,
}

impl Predictor for Mean {
    fn predict(&self, features: ArrayView2<'_, f64>) -> Vec<f64> {
        let mut sum = vec![0.0; features.nrows()];
        for member in &self.members {
            sum.iter_mut().zip(member.predict(features)).for_each(|(s, p)| *s += p);
        }
        sum.iter_mut().for_each(|s| *s /= self.members.len() as f64);
        sum
    }

    fn regressor(&self) -> Option<&Regressor> {
        self.regressor.as_ref()
    }
}

/// One regressor whose value is the mean of the members', where all members are portable and agree on their inputs.
fn average_regressors(members: &[Box<dyn Predictor>]) -> Option<Regressor> {
    let all: Vec<&Regressor> = members.iter().map(|m| m.regressor()).collect::<Option<_>>()?;
    let first = all.first()?;
    if all.iter().any(|r| r.inputs != first.inputs) {
        return None;
    }
    let n = all.len() as f64;
    let mut terms: Vec<_> = all.iter().flat_map(|r| r.terms.iter().cloned()).collect();
    terms.iter_mut().for_each(|t| t.weight /= n);
    let identity_mos = if all.iter().all(|r| r.identity_mos == first.identity_mos) {
        first.identity_mos
    } else {
        all.iter().map(|r| r.identity_mos).sum::<f64>() / n
    };
    Some(Regressor { identity_mos, inputs: first.inputs.clone(), terms })
}

/// A trainer that sees only some columns; what it returns still takes rows of all.
pub struct OnColumns<T, F> {
    /// Name of the trainer with these columns.
    pub name: String,
    /// What learns from the columns.
    pub trainer: T,
    /// Which columns it sees.
    pub keep: F,
}

impl<T: Trainer, F: Fn(&Column) -> bool + Send + Sync> Trainer for OnColumns<T, F> {
    fn name(&self) -> &str {
        &self.name
    }

    fn train(&self, set: &TrainingSet, seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        let kept: Vec<usize> = (0..set.columns().len()).filter(|&i| (self.keep)(&set.columns()[i])).collect();
        let inner = self.trainer.train(&set.select_columns(&self.keep), seed)?;
        let regressor = inner.regressor().map(|r| {
            let mut r = r.clone();
            r.inputs = set.columns().iter().map(Into::into).collect();
            r.terms.iter_mut().flat_map(|t| &mut t.standardizer.features).for_each(|f| f.input = kept[f.input]);
            r
        });
        Ok(Box::new(SomeColumns { inner, kept, regressor }))
    }
}

struct SomeColumns {
    inner: Box<dyn Predictor>,
    kept: Vec<usize>,
    regressor: Option<Regressor>,
}

impl Predictor for SomeColumns {
    fn predict(&self, features: ArrayView2<'_, f64>) -> Vec<f64> {
        self.inner.predict(features.select(Axis(1), &self.kept).view())
    }

    fn regressor(&self) -> Option<&Regressor> {
        self.regressor.as_ref()
    }
}

/// Draws of one member before its error counts.
const MOST_DRAWS: u64 = 100;
/// Between the draws of one member: more than there are members.
const NEXT_DRAW: u64 = 1 << 20;

/// `n` models, each trained on as many material groups as the set has, drawn with replacement. A draw that nothing can be
/// learned from, such as one of equal ratings, is drawn again. Trained in parallel; the result does not depend on the number of
/// threads.
pub fn bootstrap_members(
    trainer: &dyn Trainer,
    set: &TrainingSet,
    n: usize,
    seed: u64,
) -> Result<Vec<Box<dyn Predictor>>, TrainError> {
    let member = |i: u64| {
        let mut draw = 0;
        loop {
            let found = trainer.train(&set.resample_groups(seed, i + draw * NEXT_DRAW), seed.wrapping_add(i));
            draw += 1;
            match found {
                Err(
                    TrainError::TooFewRows { .. } | TrainError::EqualRatings { .. } | TrainError::NoDifference { .. },
                ) if draw < MOST_DRAWS => {}
                found => return found,
            }
        }
    };
    parallel::try_map(n, |i| member(i as u64))
}
