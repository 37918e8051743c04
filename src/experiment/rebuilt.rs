//! Which rebuilt candidates explain a method's ratings? Evidence about what people saw.
//!
//! The BRDFs of the open study are reconstructions, and for some methods there is more than one way to rebuild them. A judge,
//! the metric's own recipe, is trained without any row of the method's family and, fold by fold, without the material and its
//! sisters. It then predicts the method's ratings from each way's candidates. A way that people saw is predicted well; the
//! bias is the mean of prediction minus rating. Methods of one family are predicted by one judge, and together as well.
//!
//! Methods that the study does not rebuild can be asked for too, with candidates that were fitted again ([`super::trials`]); no judge
//! learns from them.
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
use vernis_metric::brdf::BrdfSource;
use vernis_metric::descriptor::{Cache, Setup};
use vernis_metric::io::{Count, Observer, Progress};
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

    /// The rated pairs of its method, with the candidates that it assumes.
    fn way(&self, study: &Study) -> Way {
        let rated = || study.pairs.iter().filter(|pair| pair.method == self.method);
        Way {
            method: self.method.clone(),
            assumes: self.assumes.clone(),
            used: rated().all(|pair| pair.candidate.notation() == source(pair, self)),
            pairs: rated().map(|pair| rebuild(pair, self)).collect(),
        }
    }
}

/// The rated pairs of a method with the candidates of one way to make them.
#[derive(Debug, Clone)]
pub struct Way {
    /// The method as the ratings name it.
    pub method: String,
    /// What is assumed, in a few words.
    pub assumes: String,
    /// Whether the study builds its candidates so.
    pub used: bool,
    /// The pairs, all of one method.
    pub pairs: Vec<RatedPair>,
}

impl Way {
    fn family(&self) -> &str {
        self.pairs.first().map_or("", |pair| pair.method_family.as_str())
    }
}

/// The ways of each family, families in the order of their first way; ways without a pair are left out.
fn by_family(ways: &[Way]) -> Vec<Vec<&Way>> {
    let mut families: Vec<Vec<&Way>> = Vec::new();
    for way in ways.iter().filter(|way| !way.pairs.is_empty()) {
        match families.iter_mut().find(|family| family.iter().any(|first| first.family() == way.family())) {
            Some(family) => family.push(way),
            None => families.push(vec![way]),
        }
    }
    families
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
    all.extend([("DUPUY", "dupuy"), ("GGX", "dupuy-ggx"), ("BECKMAN", "dupuy-beckmann")].map(|(method, model)| {
        let source = format!("nbrdf/merl_nbrdf.zip:{{material}}?fit={model}");
        Hypothesis::new(method, "power iteration on the reference's retro-reflection", &source)
    }));
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
    /// The method as the ratings name it; several for the figures of a family together.
    pub method: String,
    /// What is assumed.
    pub assumes: String,
    /// Whether the study builds its candidates so.
    pub used: bool,
    /// Rated pairs of the method that have such a candidate.
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
    /// One a way, families in the order of their first way; after a family of several methods, one for them together.
    pub verdicts: Vec<Verdict>,
    /// All rows first, then without each family that has more than one way, then without all of them.
    pub without: Vec<Without>,
    /// Of methods that the study does not rebuild, fitted again.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub refits: Vec<Verdict>,
}

/// Judges each of `ways` to rebuild candidates of `study`, and each of `refits`, candidates of methods that it has no row of. Ways of
/// methods without a row are left out.
///
/// # Errors
/// No way has a row; a BRDF that cannot be read; folds that cannot be made; training that fails.
pub fn rebuilt(
    study: &Study,
    ways: &[Hypothesis],
    refits: &[Way],
    options: &RebuiltOptions,
    progress: Observer<'_>,
) -> Result<RebuiltRecord, ExperimentError> {
    let ways: Vec<Way> = ways.iter().map(|way| way.way(study)).collect();
    let families = by_family(&ways);
    if families.is_empty() {
        return Err(ExperimentError::NoWay { study: study.name.clone() });
    }
    let job = Job { study, options, setup: Setup::standard(), trainer: recipe::metric(&recipe::distance()), progress };
    let verdicts = |families: &[Vec<&Way>]| -> Result<Vec<Verdict>, ExperimentError> {
        Ok(families.iter().map(|ways| job.verdicts(ways)).collect::<Result<Vec<_>, _>>()?.concat())
    };
    let of_ways = verdicts(&families)?;
    let of_refits = verdicts(&by_family(refits))?;
    let open: Vec<Vec<&str>> = families.iter().filter(|ways| ways.len() > 1).map(|ways| methods(ways)).collect();
    let mut left_out: Vec<Vec<&str>> = vec![Vec::new()];
    left_out.extend(open.iter().cloned());
    if open.len() > 1 {
        left_out.push(open.concat());
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
        verdicts: of_ways,
        without,
        refits: of_refits,
    })
}

/// The methods of `ways`, each once.
fn methods<'a>(ways: &[&'a Way]) -> Vec<&'a str> {
    let mut found: Vec<&str> = Vec::new();
    for way in ways {
        if !found.contains(&way.method.as_str()) {
            found.push(&way.method);
        }
    }
    found
}

/// Names in a sentence: `ABC`, `ABC and WARD`, `DUPUY, GGX and BECKMAN`.
pub fn listed(names: &[impl AsRef<str>]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match names.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => names.concat(),
    }
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

    /// The ways of one family of methods.
    fn verdicts(&self, ways: &[&Way]) -> Result<Vec<Verdict>, ExperimentError> {
        let family = ways.first().map_or("", |way| way.family());
        let mut pairs: Vec<RatedPair> =
            self.study.pairs.iter().filter(|pair| pair.method_family != family).cloned().collect();
        let mut rows: Vec<Vec<usize>> = Vec::new();
        for way in ways {
            rows.push((pairs.len()..pairs.len() + way.pairs.len()).collect());
            pairs.extend_from_slice(&way.pairs);
        }
        let untrained = Registry::standard().and_then(|registry| registry.get(UNTRAINED));
        let untrained =
            untrained.map_err(|e| ExperimentError::MetricNamed { name: UNTRAINED.to_owned(), source: Box::new(e) })?;
        let samples = self.samples(&Study { pairs, ..self.study.clone() }, &[untrained])?;
        let (predicted, training_rows) = self.predictions(&samples.select_columns(recipe::takes), family)?;
        let distances = samples.columns().iter().position(|column| column.name == UNTRAINED);
        let distances = distances.map(|column| samples.column(column).to_vec());
        let verdict = |method: String, assumes: &str, used: bool, rows: &[usize]| {
            let ratings = Ratings::of(rows.iter().map(|&row| &samples.rows()[row]));
            let resamples = bootstrap::draw(&ratings, self.options.resamples, self.options.seed)?;
            let figures = Against { ratings: ratings.mos(), resamples: &resamples };
            let predicted: Vec<f64> = rows.iter().map(|&row| predicted[row]).collect();
            let negated = |distances: &Vec<f64>| rows.iter().map(|&row| -distances[row]).collect::<Vec<f64>>();
            let none = Estimate { value: None, interval: None };
            Ok(Verdict {
                method,
                assumes: assumes.to_owned(),
                used,
                rows: rows.len(),
                training_rows,
                plcc: figures.pearson(&predicted),
                srocc: figures.spearman(&predicted),
                bias: figures.bias(&predicted),
                untrained_srocc: distances.as_ref().map_or(none, |d| figures.spearman(&negated(d))),
            })
        };
        let mut found: Vec<Verdict> = ways
            .iter()
            .zip(&rows)
            .map(|(way, rows)| verdict(way.method.clone(), &way.assumes, way.used, rows))
            .collect::<Result<_, ExperimentError>>()?;
        let (used, rows): (Vec<&Way>, Vec<&Vec<usize>>) =
            ways.iter().copied().zip(&rows).filter(|(way, _)| way.used).unzip();
        let together = methods(&used);
        if together.len() > 1 {
            let rows: Vec<usize> = rows.into_iter().flatten().copied().collect();
            found.push(verdict(listed(&together), "together", true, &rows)?);
        }
        Ok(found)
    }

    /// What the judge predicts for the rows of `family`, by row (0 for others), and the fewest rows that it learned from.
    fn predictions(&self, samples: &Samples, family: &str) -> Result<(Vec<f64>, usize), ExperimentError> {
        let is_family = |row: &Row| row.method_family == family;
        let mut folds = method_and_group_folds(samples, self.options.folds, self.options.seed)?;
        folds.retain(|fold| fold.held_out.rows().first().is_some_and(is_family));
        let done = Count::of(folds.len());
        let judge = |(index, fold): (usize, &Fold)| {
            let seed = seed::stream(self.options.seed, "rebuilt-candidates", index as u64).random();
            let failed = |source| EvaluationError::Training {
                metric: self.trainer.name().to_owned(),
                fold: index,
                training_rows: fold.training.rows().len(),
                source: Box::new(source),
            };
            let judge = self.trainer.train(&fold.training, seed).map_err(failed)?;
            done.one(|progress| (self.progress)(&format!("judges of {family}"), progress));
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
    fn a_family_is_judged_together() {
        let study = Study::load(crate::dataset::synthetic::NAME, None).expect("embedded");
        let way = |method: &str, family: &str, used: bool| {
            let mut pairs = study.pairs[..2].to_vec();
            pairs.iter_mut().for_each(|pair| family.clone_into(&mut pair.method_family));
            Way { method: method.to_owned(), assumes: String::new(), used, pairs }
        };
        let mut ways = vec![way("A", "F", true), way("B", "G", true), way("C", "F", false), way("A", "F", false)];
        ways.push(Way { pairs: Vec::new(), ..way("D", "H", true) });
        let families = by_family(&ways);
        assert_eq!(families.iter().map(|ways| methods(ways)).collect::<Vec<_>>(), [vec!["A", "C"], vec!["B"]]);
        assert_eq!(families.iter().map(Vec::len).collect::<Vec<_>>(), [3, 1]);
        assert_eq!([listed(&["A"]), listed(&["A", "B"]), listed(&["A", "B", "C"])], ["A", "A and B", "A, B and C"]);
    }

    #[test]
    fn ways_name_the_material_and_methods_of_the_open_study() {
        let ways = hypotheses();
        assert!(ways.iter().all(|way| way.source.contains("{material}")));
        let manifest = crate::dataset::manifest::Manifest::embedded(crate::dataset::manifest::OPEN).expect("embedded");
        let candidates = manifest.rebuilt.expect("the open study is rebuilt").candidates;
        // Each method is judged under the very source that the study uses, beside others.
        for method in ["ABC", "WARD", "BAGHER", "DUPUY", "GGX", "BECKMAN"] {
            let used = candidates.iter().find(|c| c.method == method).expect("a method of the study");
            assert!(ways.iter().any(|way| way.method == method && way.source == used.source), "{method}");
        }
    }
}
