//! All metrics on one study: the list of contenders, the ablation, and the record of it all.

use super::ExperimentError;
use super::external::ExternalScores;
use super::further::Further;
use super::plan::Plan;
use crate::dataset::Study;
use crate::evaluation::EvaluationError;
use crate::evaluation::protocol::{AblationCase, Bench, Contender, Protocol, Source};
use crate::evaluation::records::{AblationRecord, BenchmarkRecord, MetricKind, MetricRecord};
use crate::samples::Samples;
use crate::samples::triplets::TripletSamples;
use crate::train::embedding_folds::{EmbeddedFolds, EmbeddingError, Learner};
use crate::train::kernel::KernelRidge;
use crate::train::linear::ElasticNet;
use crate::train::lp_baseline::{BestOf, Criterion};
use crate::train::neural::SaturatedDistance;
use crate::train::svr::SupportVectors;
use crate::train::trivial::MeanOf;
use crate::train::{Trainer, recipe};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use vernis_image::stimulus::{self, Cameras, plain};
use vernis_metric::descriptor::Column;
use vernis_metric::descriptor::Family;
use vernis_metric::math::rating_scale::RatingScale;
use vernis_metric::metric::Metric;
use vernis_metric::metric::kernel::FAMILY as ENERGY_FAMILY;
use vernis_metric::metric::learned::exported::Interval;
use vernis_metric::metric::lp::FAMILY as LP_FAMILY;
use vernis_metric::metric::lp::LpVariant;
use vernis_metric::metric::transport::FAMILY as TRANSPORT_FAMILY;

/// The Lp metrics that the paper singles out, shown first.
const SHOWN_LP: [&str; 3] = ["D9.Cl", "D1.Cl.CR", "D4.Cl.CR"];

/// Those of them whose curve from distance to rating is drawn.
const CURVED_LP: [&str; 2] = ["D9.Cl", "D4.Cl.CR"];

/// Descriptors whose importance is told one by one.
const MOST_SINGLE: usize = 15;

/// Families of the distances between graphs.
const GRAPH_FAMILIES: [&str; 2] = [TRANSPORT_FAMILY, ENERGY_FAMILY];

/// Learns an embedding in each fold; `None` where there is nothing to learn it from.
pub type Embedder<'a> = &'a dyn Fn(&Samples, Learner) -> Result<Option<EmbeddedFolds>, EmbeddingError>;

/// Metrics that were judged on a study, what was found so far, and what an export of its metric needs.
pub struct StudyBenchmark {
    pub record: BenchmarkRecord,
    /// Of the learned metric's scores, in grades; `None` where it could not be judged.
    pub interval: Option<Interval>,
    /// The same of the metric to fit with.
    pub loss_interval: Option<Interval>,
    /// The metric to fit with, and what it learned in the folds.
    pub distance: SaturatedDistance,
    bench: Bench,
    /// The columns of [`crate::samples::extraction`].
    samples: Samples,
    /// Distances between pictures by the same camera, where some were asked for.
    images: Option<Samples>,
}

/// What the record says of the run.
#[derive(Debug, Clone)]
pub struct RunInfo<'a> {
    pub command: String,
    /// Of the program and of whatever else decides the numbers, by name.
    pub versions: BTreeMap<String, String>,
    /// Of the numbers of each metric, by name.
    pub metric_versions: BTreeMap<String, String>,
    /// Distances that were computed elsewhere, which take part.
    pub external: Option<&'a ExternalScores>,
    /// Metrics beside those that always take part, with their distances.
    pub further: Option<(&'a Further, &'a Samples)>,
    /// Whether [`recipe::variants`] take part.
    pub variants: bool,
}

/// The names of the metrics that take part beside `classical` ones.
pub(super) fn names(classical: &[Arc<dyn Metric>]) -> Vec<String> {
    let parts = parts().into_iter().map(|(trainer, _, _)| trainer.name().to_owned());
    let variants = recipe::variants(&recipe::distance()).into_iter().map(|(trainer, _)| trainer.name().to_owned());
    let parts = parts.chain(variants).chain([recipe::LOSS_NAME.to_owned(), WITH_NETWORKS.to_owned()]);
    let best = [Criterion::Plcc, Criterion::Srocc].map(|criterion| BestOf { columns: Vec::new(), criterion });
    let means = [MeanOf::Method, MeanOf::MethodAndMaterialType].map(|means| means.name().to_owned());
    let others = parts.chain([recipe::NAME.to_owned()]).chain(best.map(|best| best.name().to_owned())).chain(means);
    others.chain(classical.iter().map(|metric| metric.name().to_owned())).collect()
}

/// Runs every contender on the splits of `plan`. `samples` are the columns of [`crate::samples::extraction`]; `triplets` those that the
/// metric learns from as well; `stage` is told what comes next. A contender that cannot be judged is left out, with a sentence.
pub fn measure(
    study: &Study,
    samples: Samples,
    triplets: Option<&TripletSamples>,
    plan: &Plan,
    info: &RunInfo<'_>,
    stage: &(dyn Fn(&str) + Sync),
) -> Result<StudyBenchmark, ExperimentError> {
    let protocol = &plan.protocol;
    let compact = samples.select_columns(recipe::uses);
    let taken = taken(&samples, triplets)?;
    let lp = samples.select_columns(|c| c.family == LP_FAMILY);
    let graphs = samples.select_columns(|c| GRAPH_FAMILIES.contains(&c.family.as_str()));
    let mut bench = Bench::new(protocol.clone(), &samples)?;
    let mut left_out = plan.left_out.clone();
    let distance = recipe::distance();
    let variants = if info.variants { recipe::variants(&distance) } else { Vec::new() };
    let (parts, metrics) = (parts(), metrics(&distance));
    let best = BestOf { columns: LpVariant::of_study().map(|v| v.to_string()).collect(), criterion: Criterion::Plcc };
    let external = info.external.map(|scores| scores.samples(study)).transpose()?;
    let of_file = || info.external.iter().zip(&external).flat_map(|(scores, samples)| scores.contenders(samples));
    let asked = || info.further.into_iter().flat_map(|(metrics, samples)| metrics.contenders(samples));
    let learned = learned(&metrics, &variants, &parts, &taken, &compact);
    let classical = classical(&best, [&lp, &graphs], &plan.means);
    for contender in learned.into_iter().chain(classical).chain(asked()).chain(of_file()) {
        stage(&format!("cross-validation: {}", contender.name));
        match bench.judge(&contender) {
            Ok(failed) => left_out.extend(
                failed.iter().map(|(split, e)| format!("{}, {}, is left out: {e}.", contender.name, split.label())),
            ),
            Err(error) => left_out.push(format!("{} is left out: {error}.", contender.name)),
        }
    }
    stage("interval of a score");
    let mut keep = |what: &str, error: EvaluationError| left_out.push(format!("{what} is left out: {error}."));
    // As many members of the same kind as are exported.
    let judged = [recipe::NAME, recipe::LOSS_NAME].into_iter().any(|name| bench.has(name));
    let spreads = judged.then(|| bench.spreads(&recipe::member(&distance), &taken, recipe::MEMBERS)).transpose();
    let mut of_metric = |name: &str| match &spreads {
        Ok(Some(spreads)) if bench.has(name) => match bench.intervals(name, spreads) {
            Ok(found) => Some(found),
            Err(error) => {
                keep(&format!("The interval of a score of {name}"), error);
                None
            }
        },
        _ => None,
    };
    let (of_name, of_loss) = (of_metric(recipe::NAME), of_metric(recipe::LOSS_NAME));
    if let Err(error) = spreads {
        keep("The interval of a score", error);
    }
    let (interval, calibration) = of_name.unzip();
    let loss_interval = of_loss.map(|(interval, _)| interval);
    let mut judged_triplets = Vec::new();
    if taken.triplets().is_some() {
        stage("triplets of unseen references");
        let on_triplets = metrics.iter().chain(&variants).map(|(trainer, _)| trainer.as_ref());
        for trainer in on_triplets.filter(|trainer| bench.has(trainer.name())) {
            match bench.triplets(trainer, &taken) {
                Ok(found) => judged_triplets.extend(found),
                Err(error) => keep(&format!("The agreement of {} with triplets", trainer.name()), error),
            }
        }
    }
    let mut curves = Vec::new();
    let of_graphs = graphs.columns().iter().map(|column| (&graphs, column.name.as_str()));
    let of_external = external.iter().flat_map(|s| s.columns().iter().map(move |column| (s, column.name.as_str())));
    let asked_samples = info.further.into_iter().map(|(_, samples)| samples);
    let of_asked = asked_samples.flat_map(|s| s.columns().iter().map(move |column| (s, column.name.as_str())));
    for (samples, name) in of_graphs.chain(CURVED_LP.map(|name| (&lp, name))).chain(of_asked).chain(of_external) {
        match bench.curve(samples, name) {
            Ok(curve) => curves.push(curve),
            Err(error) => keep(&format!("The curve of {name}"), error),
        }
    }
    stage("differences");
    let mut headline = vec![recipe::NAME.to_owned(), recipe::LOSS_NAME.to_owned()];
    headline.extend(parts.iter().map(|(trainer, _, _)| trainer.name().to_owned()));
    headline.push(best.name().to_owned());
    headline.extend(graphs.columns().iter().map(|column| column.name.clone()));
    let is_image = |contender: &Contender<'_>| contender.kind == MetricKind::Image;
    headline.extend(asked().filter(|contender| !is_image(contender)).map(|contender| contender.name));
    headline.extend(of_file().map(|contender| contender.name));
    headline.extend(SHOWN_LP.map(str::to_owned));
    headline.extend(plan.means.iter().map(|m| m.name().to_owned()));
    headline.retain(|name| bench.has(name));
    let subject = headline.first().cloned().unwrap_or_default();
    let mut others: Vec<&str> = headline.iter().skip(1).map(String::as_str).collect();
    // Dozens of them have tables of their own.
    let images: Vec<String> = asked().filter(is_image).map(|contender| contender.name).collect();
    others.extend(images.iter().map(String::as_str).filter(|name| bench.has(name)));
    others.extend(
        variants.iter().map(|(trainer, _)| trainer.name()).chain([WITH_NETWORKS]).filter(|name| bench.has(name)),
    );
    let differences = bench.differences(&subject, &others)?;
    let versioned =
        |metric: MetricRecord| MetricRecord { version: info.metric_versions.get(&metric.name).cloned(), ..metric };
    let materials: BTreeSet<&str> = study.pairs.iter().map(|p| p.material.as_str()).collect();
    let record = BenchmarkRecord {
        study: study.name.clone(),
        synthetic: study.synthetic,
        scale: RatingScale::GRADES,
        identical: Some(study.identical.clone()),
        rows: samples.len(),
        materials: materials.len(),
        groups: study.groups(),
        folds: protocol.folds,
        resamples: protocol.resamples,
        seed: protocol.seed,
        command: info.command.clone(),
        versions: info.versions.clone(),
        data_hashes: data_hashes(study, info.external),
        set_aside: protocol.set_aside.clone(),
        row_sets: protocol.row_sets.clone(),
        metrics: bench.metrics().into_iter().map(versioned).collect(),
        differences,
        did_not_help: Vec::new(),
        retrained: recipe::plain_kernel().name().to_owned(),
        ablation: Vec::new(),
        importance: Vec::new(),
        learning_curve: Vec::new(),
        curves,
        residuals: if subject.is_empty() { Vec::new() } else { bench.residuals(&subject)? },
        method_residuals: bench.method_residuals(&subject),
        calibration,
        triplets: judged_triplets,
        predictions: bench.prediction_records(&headline),
        headline,
        left_out,
    };
    let by_one_camera = |c: &Column| plain(&c.name).is_some_and(|(_, cameras)| cameras == Cameras::Same);
    let images = info.further.map(|(_, distances)| distances.select_columns(by_one_camera));
    let images = images.filter(|distances| !distances.columns().is_empty());
    Ok(StudyBenchmark { record, interval, loss_interval, distance, bench, samples, images })
}

impl StudyBenchmark {
    /// How the metrics were judged.
    pub fn protocol(&self) -> &Protocol {
        self.bench.protocol()
    }

    /// Retrains the plain kernel with other descriptors, and with those embeddings that `embedded` learns, by name; each case that
    /// fails is left out, with a sentence.
    pub fn ablate(
        &mut self,
        learners: &[Learner],
        embedded: Embedder<'_>,
        stage: &(dyn Fn(&str) + Sync),
    ) -> Result<(), ExperimentError> {
        let trainer = recipe::plain_kernel();
        if !self.bench.has(trainer.name()) {
            return Ok(());
        }
        let mut cases = ablation_cases(&self.samples, self.bench.protocol())?;
        let compact = self.samples.select_columns(recipe::uses);
        if let Some(images) = &self.images {
            let with = format!("with {}", stimulus::FAMILY);
            cases.push(AblationCase::new(&with, compact.beside(images)?, self.bench.protocol())?);
            let only = format!("{} and context only", stimulus::FAMILY);
            let context = compact.select_columns(|c| c.family == Family::Context.name());
            cases.push(AblationCase::new(&only, context.beside(images)?, self.bench.protocol())?);
        }
        for &learner in learners {
            stage(&format!("embeddings: {}", learner.name()));
            match embedded(&compact, learner) {
                Ok(None) => {}
                Ok(Some(EmbeddedFolds { columns, by_material, by_method })) => {
                    let (name, samples) = (format!("with {}", learner.name()), compact.clone());
                    cases.push(AblationCase { name, columns, samples, by_material, by_method });
                }
                Err(error) => {
                    self.record.left_out.push(format!("Ablation: {} is left out: {error}.", learner.name()));
                }
            }
        }
        for case in cases {
            stage(&format!("ablation: {}", case.name));
            match self.bench.ablate(&case, &trainer, trainer.name()) {
                Ok(found) => self.record.ablation.push(found),
                Err(error) => self.record.left_out.push(format!("Ablation: {} is left out: {error}.", case.name)),
            }
        }
        self.record.did_not_help = did_not_help(&self.record.ablation);
        Ok(())
    }

    /// Exchanges descriptors between rows that the plain kernel has not seen.
    pub fn weigh(&mut self) {
        let trainer = recipe::plain_kernel();
        if self.bench.has(trainer.name()) {
            let compact = self.samples.select_columns(recipe::uses);
            match self.bench.importance(&trainer, trainer.name(), &compact, MOST_SINGLE) {
                Ok(found) => self.record.importance = found,
                Err(error) => {
                    self.record.left_out.push(format!("The importance of descriptors is left out: {error}."));
                }
            }
        }
    }

    /// Trains the plain kernel on fewer materials.
    pub fn learn_from_fewer(&mut self) {
        let trainer = recipe::plain_kernel();
        if self.bench.has(trainer.name()) {
            match self.bench.learning_curve(&trainer, &self.samples.select_columns(recipe::uses)) {
                Ok(found) => self.record.learning_curve = found,
                Err(error) => self.record.left_out.push(format!("The learning curve is left out: {error}.")),
            }
        }
    }
}

/// The models beside the metric: trainer, kind, note.
fn parts() -> Vec<(Box<dyn Trainer>, MetricKind, &'static str)> {
    vec![
        (
            Box::new(KernelRidge::full()),
            MetricKind::Learned,
            "kernel ridge regression on all training rows; not exported, for the ratings could be solved for",
        ),
        (
            Box::new(recipe::network()),
            MetricKind::Learned,
            "an ensemble of small networks in burn, once half of the metric: left out of it since version 2",
        ),
        (
            Box::new(recipe::plain_kernel()),
            MetricKind::Learned,
            "a landmark kernel, its parameters chosen on inner folds: what the ablation retrains",
        ),
        (Box::new(ElasticNet::mixed()), MetricKind::Baseline, "linear and sparse, same descriptors"),
        (
            Box::new(SupportVectors::default()),
            MetricKind::Baseline,
            "support-vector regression, same descriptors; not exact for identical BRDFs",
        ),
    ]
}

/// Mean of the metric and the networks.
const WITH_NETWORKS: &str = "vernis-and-networks";
const NETWORKS: &str = "neural-network";

/// The exported metrics, each with a note.
fn metrics(distance: &SaturatedDistance) -> Vec<(Box<dyn Trainer>, &'static str)> {
    vec![
        (
            Box::new(distance.clone()),
            "exported to fit with: a true metric, a saturated city-block distance of 60 differences",
        ),
        (
            Box::new(recipe::metric(distance)),
            "exported: the distance of vernis-loss and a landmark kernel on what it leaves over",
        ),
    ]
}

/// The descriptors that the metric takes, and the triplets that it learns from.
pub fn taken(samples: &Samples, triplets: Option<&TripletSamples>) -> Result<Samples, ExperimentError> {
    let taken = samples.select_columns(recipe::takes);
    Ok(match triplets {
        Some(triplets) => taken.with_triplets(triplets.clone())?,
        None => taken,
    })
}

/// The models beside the metric, the metric, and what changes where a part of it does.
fn learned<'a>(
    metrics: &'a [(Box<dyn Trainer>, &'static str)],
    variants: &'a [(Box<dyn Trainer>, &'static str)],
    parts: &'a [(Box<dyn Trainer>, MetricKind, &'static str)],
    taken: &'a Samples,
    compact: &'a Samples,
) -> Vec<Contender<'a>> {
    let contender = |trainer: &'a dyn Trainer, kind, note: &str, samples| Contender {
        name: trainer.name().to_owned(),
        kind,
        note: note.to_owned(),
        source: Source::Trainer(trainer, samples),
    };
    let mut all: Vec<Contender<'a>> =
        parts.iter().map(|(trainer, kind, note)| contender(trainer.as_ref(), *kind, note, compact)).collect();
    let of_recipe = metrics.iter().chain(variants);
    all.extend(of_recipe.map(|(trainer, note)| contender(trainer.as_ref(), MetricKind::Learned, note, taken)));
    all.push(Contender {
        name: WITH_NETWORKS.to_owned(),
        kind: MetricKind::Learned,
        note: "variant of vernis: the mean of it and the networks".to_owned(),
        source: Source::MeanOf(&[recipe::NAME, NETWORKS]),
    });
    all
}

/// What is not learned from descriptors.
fn classical<'a>(best: &'a BestOf, [lp, graphs]: [&'a Samples; 2], means: &[MeanOf]) -> Vec<Contender<'a>> {
    let contender =
        |name: &str, kind, note: &str, source| Contender { name: name.to_owned(), kind, note: note.to_owned(), source };
    let mut all = Vec::new();
    all.push(contender(
        best.name(),
        MetricKind::NestedBestLp,
        "the Lp variant that is best on the training side of each fold; its raw PLCC over all rows is left empty where the folds \
         choose several variants, whose distances have no unit in common",
        Source::Trainer(best, lp),
    ));
    all.extend(LpVariant::of_study().map(|variant| {
        contender(
            &variant.to_string(),
            MetricKind::Lp,
            "Lavoué et al. 2021, as computed by their program",
            Source::Distance(lp),
        )
    }));
    all.extend(graphs.columns().iter().map(|column| {
        let note = "Lavoué et al. 2021, section 6.1, computed deterministically";
        contender(&column.name, MetricKind::Graph, note, Source::Distance(graphs))
    }));
    all.extend(means.iter().map(|&means| {
        contender(means.name(), MetricKind::Trivial, "knows who fitted it, nothing of appearance", Source::Means(means))
    }));
    all
}

/// Each family of the extended set left out and alone, and each other family added.
fn ablation_cases(samples: &Samples, protocol: &Protocol) -> Result<Vec<AblationCase>, ExperimentError> {
    let mut cases = Vec::new();
    let mut case = |name: String, keep: &dyn Fn(&Column) -> bool| -> Result<(), ExperimentError> {
        cases.push(AblationCase::new(&name, samples.select_columns(keep), protocol)?);
        Ok(())
    };
    for left_out in Family::EXTENDED.map(Family::name) {
        case(format!("without {left_out}"), &|c| recipe::uses(c) && c.family != left_out)?;
    }
    let compact = [Family::Lights, Family::Slot, Family::Angular, Family::Context].map(Family::name);
    case("compact 48 only".to_owned(), &|c| compact.contains(&c.family.as_str()))?;
    for alone in [Family::Lights, Family::Angular].map(Family::name) {
        case(format!("{alone} and context only"), &|c| c.family == alone || c.family == Family::Context.name())?;
    }
    let present = |family: &&str| samples.columns().iter().any(|c| c.family == **family);
    let distances = GRAPH_FAMILIES.into_iter().filter(present);
    for added in [Family::AngularFull.name(), Family::Wasserstein.name(), LP_FAMILY].into_iter().chain(distances) {
        case(format!("with {added}"), &|c| recipe::uses(c) || c.family == added)?;
    }
    case(format!("{LP_FAMILY} only"), &|c| c.family == LP_FAMILY)?;
    Ok(cases)
}

/// The additions whose interval of change holds zero, or lies below.
fn did_not_help(ablation: &[AblationRecord]) -> Vec<String> {
    let added = ablation.iter().filter(|a| a.name.starts_with("with "));
    added
        .filter_map(|a| {
            let (plcc, srocc) = (a.plcc_change?, a.srocc_change?);
            let no_gain = plcc.interval.low <= 0.0 && srocc.interval.low <= 0.0;
            no_gain.then(|| {
                format!(
                    "{} descriptors, {} in all: PLCC {:+.3} [{:+.3}, {:+.3}], SROCC {:+.3} [{:+.3}, {:+.3}]",
                    a.name.replace("with ", "adding the "),
                    a.columns,
                    plcc.difference,
                    plcc.interval.low,
                    plcc.interval.high,
                    srocc.difference,
                    srocc.interval.low,
                    srocc.interval.high
                )
            })
        })
        .collect()
}

/// SHA-256 of the study's files, and of the one with distances of others, by name.
pub fn data_hashes(study: &Study, external: Option<&ExternalScores>) -> BTreeMap<String, String> {
    let external = external.map(|scores| (format!("--scores {}", scores.file.name), scores.file.content.to_string()));
    study.files.iter().map(|f| (f.name.clone(), f.content.to_string())).chain(external).collect()
}
