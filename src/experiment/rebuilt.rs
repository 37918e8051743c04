//! Which rebuilt candidates explain a method's ratings? Evidence about what people saw.
//!
//! The BRDFs of the open study are reconstructions, and for some methods there is more than one way to rebuild them. A judge,
//! the metric's own recipe, is trained without any row of the method's family and, fold by fold, without the material and its
//! sisters. It then predicts the method's ratings from each way's candidates. A way that people saw is predicted well; the
//! bias is the mean of prediction minus rating.
//!
//! The ratings that decide between two ways are those that the study trains and judges metrics with. What that can do to the
//! headline is measured as well: the metric's agreement out of fold on the study without the rows of such methods, in training and
//! in judging.
//!
//! Correlations and the bias have percentile intervals from resamples of groups of materials. The same seed gives the same bytes,
//! whatever the number of threads.
//! Cost: one training of the metric a fold for every method, and for every row left out; descriptors are cached.

use super::ExperimentError;
use crate::dataset::{RatedPair, Row, Study};
use crate::evaluation::EvaluationError;
use crate::evaluation::agreement::Ratings;
use crate::evaluation::bootstrap::{self, Bootstrapped, Interval, Resamples};
use crate::evaluation::cross_validation::cross_validate;
use crate::samples::Samples;
use crate::samples::extraction::Extractor;
use crate::samples::split::{Fold, grouped_folds, method_and_group_folds};
use crate::train::{Trainer, recipe};
use rand::Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use vernis_metric::brdf::BrdfSource;
use vernis_metric::descriptor::{Cache, Setup};
use vernis_metric::io::{Observer, Progress};
use vernis_metric::math::correlation::{Ranking, pearson_counted, spearman_counted};
use vernis_metric::math::seed;
use vernis_metric::metric::Metric;
use vernis_metric::metric::registry::Registry;

/// A metric that learns nothing, as a second opinion.
const UNTRAINED: &str = "D9.Cl";

/// One way to rebuild the candidates of a method.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Hypothesis {
    /// The method as the ratings name it.
    pub method: String,
    /// What is assumed, in a few words.
    pub assumes: String,
    /// Notation of a candidate, with `{material}` for the name of the material.
    pub source: String,
}

impl Hypothesis {
    fn new(method: &str, assumes: &str, source: &str) -> Self {
        Self { method: method.to_owned(), assumes: assumes.to_owned(), source: source.to_owned() }
    }
}

/// The ways to rebuild the methods of the open study that its README speaks of.
pub fn hypotheses() -> Vec<Hypothesis> {
    const ABC: &str = "published-fits/low_lowmicrofacet_E2.fit:{material}";
    const WARD: &str = "published-fits/ngan_ward.fit:{material}";
    let mut all = vec![Hypothesis::new("ABC", "each material's published index of refraction", ABC)];
    all.extend(["1.8", "2.0", "2.24", "2.35", "2.5", "3.0"].map(|eta| {
        Hypothesis::new("ABC", &format!("index of refraction {eta} for all materials"), &format!("{ABC}?eta={eta}"))
    }));
    all.push(Hypothesis::new("WARD", "Ward's form", WARD));
    all.push(Hypothesis::new("WARD", "Duer's form", &format!("{WARD}?model=ward-duer")));
    all.push(Hypothesis::new("BAGHER", "published factors", "bagher2016-npf/npf.bin:{material}"));
    all
}

/// How the ways are judged.
#[derive(Debug, Clone)]
pub struct RebuiltOptions {
    /// Folder that relative sources are looked up in.
    pub data: Option<PathBuf>,
    /// Without a cache every descriptor is computed.
    pub cache: Option<Cache>,
    /// Folds by material.
    pub folds: usize,
    /// Bootstrap resamples of materials.
    pub resamples: usize,
    /// Of folds, training and resamples.
    pub seed: u64,
}

/// A figure and its 95 % interval; `None` where it is not defined, as a correlation with equal numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// On all rows.
    pub value: Option<f64>,
    /// Over resamples of materials.
    pub interval: Option<Interval>,
}

/// How well one way explains the ratings of its method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The method as the ratings name it.
    pub method: String,
    /// What is assumed.
    pub assumes: String,
    /// Whether the study builds its candidates so.
    pub used: bool,
    /// Rated pairs of the method.
    pub rows: usize,
    /// Rows that the judge learned from in a fold, the fewest.
    pub training_rows: usize,
    /// Pearson's r of the judge's predictions and the ratings.
    pub plcc: Estimate,
    /// Spearman's rho of the judge's predictions and the ratings.
    pub srocc: Estimate,
    /// Mean of prediction minus rating.
    pub bias: Estimate,
    /// Spearman's rho of the negated distance of D9.Cl, which learns nothing, and the ratings.
    pub untrained_srocc: Estimate,
}

/// The metric's agreement out of fold on the study without the rows of some methods.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Without {
    /// The methods whose rows took part in nothing.
    pub methods: Vec<String>,
    /// Rows that did.
    pub rows: usize,
    /// Pearson's r after the logistic map.
    pub plcc: Estimate,
    /// Spearman's rho.
    pub srocc: Estimate,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RebuiltRecord {
    /// The study.
    pub study: String,
    /// Whether its observers are simulated.
    pub synthetic: bool,
    /// Version of the recipe that judged.
    pub metric_version: String,
    /// Folds by material.
    pub folds: usize,
    /// Bootstrap resamples of materials.
    pub resamples: usize,
    /// Of folds, training and resamples.
    pub seed: u64,
    /// One a way, in the order asked for.
    pub verdicts: Vec<Verdict>,
    /// All rows first, then without each method that has more than one way, then without all of them.
    pub without: Vec<Without>,
}

/// Judges each of `ways` to rebuild candidates of `study`. Ways of methods without a row are left out.
///
/// # Errors
/// No way has a row; a BRDF that cannot be read; folds that cannot be made; training that fails.
pub fn rebuilt(
    study: &Study,
    ways: &[Hypothesis],
    options: &RebuiltOptions,
    progress: Observer<'_>,
) -> Result<RebuiltRecord, ExperimentError> {
    let has_rows = |method: &str| study.pairs.iter().any(|pair| pair.method == method);
    let mut methods: Vec<&str> = Vec::new();
    for way in ways.iter().filter(|way| has_rows(&way.method)) {
        if !methods.contains(&way.method.as_str()) {
            methods.push(&way.method);
        }
    }
    if methods.is_empty() {
        return Err(ExperimentError::NoWay { study: study.name.clone() });
    }
    let job = Job { study, options, setup: Setup::standard(), trainer: recipe::metric(), progress };
    let ways_of = |method: &str| ways.iter().filter(|way| way.method == method).collect::<Vec<_>>();
    let mut verdicts = Vec::new();
    for &method in &methods {
        verdicts.extend(job.verdicts(&ways_of(method))?);
    }
    let open: Vec<&str> = methods.into_iter().filter(|method| ways_of(method).len() > 1).collect();
    let mut left_out: Vec<Vec<&str>> = vec![Vec::new()];
    left_out.extend(open.iter().map(|&method| vec![method]));
    if open.len() > 1 {
        left_out.push(open);
    }
    let samples = job.samples(study, &[])?;
    let without = left_out.iter().map(|methods| job.without(&samples, methods)).collect::<Result<_, _>>()?;
    Ok(RebuiltRecord {
        study: study.name.clone(),
        synthetic: study.synthetic,
        metric_version: recipe::METRIC_VERSION.to_owned(),
        folds: options.folds,
        resamples: options.resamples,
        seed: options.seed,
        verdicts,
        without,
    })
}

struct Job<'a, T> {
    study: &'a Study,
    options: &'a RebuiltOptions,
    setup: Arc<Setup>,
    trainer: T,
    progress: Observer<'a>,
}

impl<T: Trainer> Job<'_, T> {
    fn samples(&self, study: &Study, metrics: &[Arc<dyn Metric>]) -> Result<Samples, ExperimentError> {
        let progress = |p| (self.progress)("descriptors", p);
        let (base, cache) = (self.options.data.as_deref(), self.options.cache.as_ref());
        let set = recipe::descriptors();
        let extractor = Extractor { set: &set, setup: &self.setup, metrics, base, cache, progress: &progress };
        Ok(extractor.extract(study)?.samples)
    }

    /// The ways of one method.
    fn verdicts(&self, ways: &[&Hypothesis]) -> Result<Vec<Verdict>, ExperimentError> {
        let own = |pair: &&RatedPair| ways.iter().any(|way| way.method == pair.method);
        let rated: Vec<&RatedPair> = self.study.pairs.iter().filter(own).collect();
        let family = rated.first().map_or("", |pair| pair.method_family.as_str());
        let mut pairs: Vec<RatedPair> =
            self.study.pairs.iter().filter(|pair| pair.method_family != family).cloned().collect();
        let others = pairs.len();
        for way in ways {
            pairs.extend(rated.iter().map(|pair| rebuild(pair, way)));
        }
        let untrained = Registry::standard().and_then(|registry| registry.get(UNTRAINED));
        let untrained =
            untrained.map_err(|e| ExperimentError::MetricNamed { name: UNTRAINED.to_owned(), source: Box::new(e) })?;
        let all = Study { pairs, ..self.study.clone() };
        let samples = self.samples(&all, &[untrained])?;
        let (predicted, training_rows) = self.predictions(&samples.select_columns(recipe::takes), family)?;
        let distances = samples.columns().iter().position(|column| column.name == UNTRAINED);
        let distances = distances.map(|column| samples.column(column).to_vec());
        let verdict = |(k, way): (usize, &&Hypothesis)| {
            let rows = others + k * rated.len()..others + (k + 1) * rated.len();
            let ratings = Ratings::of(&samples.rows()[rows.clone()]);
            let resamples = bootstrap::draw(&ratings, self.options.resamples, self.options.seed)?;
            let figures = Against { ratings: ratings.mos(), resamples: &resamples };
            let negated = |distances: &Vec<f64>| distances[rows.clone()].iter().map(|d| -d).collect::<Vec<f64>>();
            let none = Estimate { value: None, interval: None };
            Ok(Verdict {
                method: way.method.clone(),
                assumes: way.assumes.clone(),
                used: rated.iter().all(|pair| pair.candidate.notation() == source(pair, way)),
                rows: rated.len(),
                training_rows,
                plcc: figures.pearson(&predicted[rows.clone()]),
                srocc: figures.spearman(&predicted[rows.clone()]),
                bias: figures.bias(&predicted[rows.clone()]),
                untrained_srocc: distances.as_ref().map_or(none, |d| figures.spearman(&negated(d))),
            })
        };
        ways.iter().enumerate().map(verdict).collect()
    }

    /// What the judge predicts for the rows of `family`, by row (0 for others), and the fewest rows that it learned from.
    fn predictions(&self, samples: &Samples, family: &str) -> Result<(Vec<f64>, usize), ExperimentError> {
        let is_family = |row: &Row| row.method_family == family;
        let mut folds = method_and_group_folds(samples, self.options.folds, self.options.seed)?;
        folds.retain(|fold| fold.held_out.rows().first().is_some_and(is_family));
        let done = AtomicUsize::new(0);
        let judge = |(index, fold): (usize, &Fold)| {
            let seed = seed::stream(self.options.seed, "rebuilt-candidates", index as u64).random();
            let failed = |source| EvaluationError::Training {
                metric: self.trainer.name().to_owned(),
                fold: index,
                training_rows: fold.training.rows().len(),
                source: Box::new(source),
            };
            let judge = self.trainer.train(&fold.training, seed).map_err(failed)?;
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            (self.progress)(&format!("judges of {family}"), Progress { done, total: folds.len() });
            Ok(judge.predict(fold.held_out.features()))
        };
        let found: Vec<Vec<f64>> = folds.par_iter().enumerate().map(judge).collect::<Result<_, EvaluationError>>()?;
        let mut predicted = vec![0.0; samples.len()];
        for (fold, values) in folds.iter().zip(found) {
            fold.held_out.indices().iter().zip(values).for_each(|(&row, value)| predicted[row] = value);
        }
        Ok((predicted, folds.iter().map(|fold| fold.training.rows().len()).min().unwrap_or(0)))
    }

    /// The metric's agreement out of fold on the rows of all methods but some.
    fn without(&self, samples: &Samples, methods: &[&str]) -> Result<Without, ExperimentError> {
        (self.progress)(&format!("study without {}", methods.join(", ")), Progress::BEGUN);
        let families: BTreeSet<&str> = samples
            .rows()
            .iter()
            .filter(|row| methods.contains(&row.method.as_str()))
            .map(|row| row.method_family.as_str())
            .collect();
        let kept = |&row: &usize| !families.contains(samples.rows()[row].method_family.as_str());
        let samples = samples.select_rows(&(0..samples.len()).filter(kept).collect::<Vec<_>>());
        let folds = grouped_folds(&samples, self.options.folds, self.options.seed)?;
        let found = cross_validate(&samples, &folds, &self.trainer, self.options.seed)?;
        let ratings = Ratings::of(samples.rows());
        let resamples = bootstrap::draw(&ratings, self.options.resamples, self.options.seed)?;
        let judged = Bootstrapped::of(self.trainer.name(), &ratings, &found.predictions, &resamples)?;
        let estimate = |value, interval| Estimate { value: Some(value), interval: Some(interval) };
        Ok(Without {
            methods: methods.iter().map(|method| (*method).to_owned()).collect(),
            rows: samples.len(),
            plcc: estimate(judged.agreement.plcc, judged.intervals.plcc),
            srocc: estimate(judged.agreement.srocc, judged.intervals.srocc),
        })
    }
}

/// The ratings of some rows, and resamples of their materials.
struct Against<'a> {
    ratings: &'a [f64],
    resamples: &'a Resamples,
}

impl Against<'_> {
    fn estimate(&self, statistic: impl Fn(&[u32]) -> Option<f64> + Sync) -> Estimate {
        Estimate { value: statistic(&vec![1; self.ratings.len()]), interval: self.resamples.interval(statistic) }
    }

    fn pearson(&self, predicted: &[f64]) -> Estimate {
        self.estimate(|counts| pearson_counted(predicted, self.ratings, counts).ok())
    }

    fn spearman(&self, predicted: &[f64]) -> Estimate {
        let (x, y) = (Ranking::of(predicted), Ranking::of(self.ratings));
        self.estimate(|counts| spearman_counted(&x, &y, counts).ok())
    }

    fn bias(&self, predicted: &[f64]) -> Estimate {
        self.estimate(|counts| {
            let rows: u32 = counts.iter().sum();
            let errors = predicted.iter().zip(self.ratings).zip(counts);
            let sum: f64 = errors.map(|((p, r), &count)| f64::from(count) * (p - r)).sum();
            (rows > 0).then(|| sum / f64::from(rows))
        })
    }
}

fn source(pair: &RatedPair, way: &Hypothesis) -> String {
    way.source.replace("{material}", &pair.material)
}

fn rebuild(pair: &RatedPair, way: &Hypothesis) -> RatedPair {
    RatedPair { candidate: BrdfSource::Notation(source(pair, way)), ..pair.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bias_is_the_mean_of_prediction_minus_rating_and_resamples_move_it() {
        let ratings = [1.0, 2.0, 3.0, 4.0];
        let resamples = Resamples::draw(&[vec![0, 1], vec![2, 3]], 200, 1, "test").expect("two groups");
        let figures = Against { ratings: &ratings, resamples: &resamples };
        let bias = figures.bias(&[2.0, 3.0, 3.0, 4.0]);
        assert_eq!(bias.value, Some(0.5));
        // Only the first group, only the second, or both.
        assert_eq!(bias.interval, Some(Interval { low: 0.0, high: 1.0 }));
        assert_eq!(figures.pearson(&[2.0, 4.0, 6.0, 8.0]).value, Some(1.0));
        assert_eq!(figures.spearman(&[0.0; 4]), Estimate { value: None, interval: None });
    }

    #[test]
    fn ways_name_the_material_and_methods_of_the_open_study() {
        let ways = hypotheses();
        assert!(ways.iter().all(|way| way.source.contains("{material}")));
        let manifest = crate::dataset::manifest::Manifest::embedded(crate::dataset::manifest::OPEN).expect("embedded");
        let candidates = manifest.rebuilt.expect("the open study is rebuilt").candidates;
        // Each method is judged under the very source that the study uses, beside others.
        for method in ["ABC", "WARD", "BAGHER"] {
            let used = candidates.iter().find(|c| c.method == method).expect("a method of the study");
            assert!(ways.iter().any(|way| way.method == method && way.source == used.source), "{method}");
        }
    }
}
