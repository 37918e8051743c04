//! All metrics on one study: the list of contenders, the ablation, and the record of it all.

use super::ExperimentError;
use super::external::ExternalScores;
use crate::dataset::Study;
use crate::evaluation::protocol::{AblationCase, Bench, Contender, Protocol, Source};
use crate::evaluation::records::{AblationRecord, BenchmarkRecord, MetricKind, MetricRecord};
use crate::samples::Samples;
use crate::train::embedding_folds::EmbeddedFolds;
use crate::train::kernel::KernelRidge;
use crate::train::linear::ElasticNet;
use crate::train::lp_baseline::{BestOf, Criterion};
use crate::train::svr::SupportVectors;
use crate::train::trivial::MeanOf;
use crate::train::{Trainer, recipe};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use vernis_metric::descriptor::Column;
use vernis_metric::descriptor::Family;
use vernis_metric::math::rating_scale::RatingScale;
use vernis_metric::metric::Metric;
use vernis_metric::metric::kernel::FAMILY as ENERGY_FAMILY;
use vernis_metric::metric::learned::exported::Interval;
use vernis_metric::metric::lp::FAMILY as LP_FAMILY;
use vernis_metric::metric::lp::LpVariant;
use vernis_metric::metric::transport::FAMILY as TRANSPORT_FAMILY;

/// Method families of manifold-like and non-parametric candidates, which sit so close to the reference that rating them
/// is easy: the second set of rows leaves them out.
pub(super) const SET_ASIDE: [&str; 3] = ["BAGHER", "GPLVM", "manifold"];

/// The Lp metrics that the paper singles out, shown first.
const SHOWN_LP: [&str; 3] = ["D9.Cl", "D1.Cl.CR", "D4.Cl.CR"];

/// Those of them whose curve from distance to rating is drawn.
const CURVED_LP: [&str; 2] = ["D9.Cl", "D4.Cl.CR"];

/// Descriptors whose importance is told one by one.
const MOST_SINGLE: usize = 15;

/// Families of the distances between graphs.
const GRAPH_FAMILIES: [&str; 2] = [TRANSPORT_FAMILY, ENERGY_FAMILY];

/// What a benchmark found, and what an export of its metric needs.
pub struct StudyBenchmark {
    pub record: BenchmarkRecord,
    /// Of the learned metric's scores, in grades.
    pub interval: Interval,
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
}

/// The names of the metrics that take part beside `classical` ones.
pub(super) fn names(classical: &[Arc<dyn Metric>]) -> Vec<String> {
    let parts = parts().into_iter().map(|(trainer, _, _)| trainer.name().to_owned());
    let best = [Criterion::Plcc, Criterion::Srocc].map(|criterion| BestOf { columns: Vec::new(), criterion });
    let means = [MeanOf::Method, MeanOf::MethodAndMaterialType].map(|means| means.name().to_owned());
    let others = parts.chain([recipe::NAME.to_owned()]).chain(best.map(|best| best.name().to_owned())).chain(means);
    others.chain(classical.iter().map(|metric| metric.name().to_owned())).collect()
}

/// The protocol for a study.
pub fn protocol(study: &Study, folds: usize, resamples: usize, seed: u64) -> Protocol {
    let present: BTreeSet<&str> = study.pairs.iter().map(|p| p.method_family.as_str()).collect();
    let set_aside = SET_ASIDE.iter().filter(|f| present.contains(*f)).map(|f| (*f).to_owned()).collect();
    // The embedded study has many families of methods and little to say of unseen ones.
    let method_folds = if study.synthetic { folds.min(2) } else { folds };
    Protocol { folds, method_folds, resamples, seed, set_aside }
}

/// Runs every contender on the splits of `protocol`. `samples` are the columns of [`crate::samples::extraction`]; `embedded` the
/// folds with learned embeddings, by name; `stage` is told what comes next.
pub fn run(
    study: &Study,
    samples: &Samples,
    embedded: Vec<(&'static str, EmbeddedFolds)>,
    protocol: &Protocol,
    info: &RunInfo<'_>,
    stage: &(dyn Fn(&str) + Sync),
) -> Result<StudyBenchmark, ExperimentError> {
    let compact = samples.select_columns(recipe::uses);
    let lp = samples.select_columns(|c| c.family == LP_FAMILY);
    let graphs = samples.select_columns(|c| GRAPH_FAMILIES.contains(&c.family.as_str()));
    let mut bench = Bench::new(protocol.clone(), samples)?;
    let parts = parts();
    let best = BestOf { columns: LpVariant::of_study().map(|v| v.to_string()).collect(), criterion: Criterion::Plcc };
    let external = info.external.map(|scores| scores.samples(study)).transpose()?;
    let of_file = || info.external.iter().zip(&external).flat_map(|(scores, samples)| scores.contenders(samples));
    for contender in contenders(&parts, &best, &compact, &lp, &graphs).into_iter().chain(of_file()) {
        stage(&format!("cross-validation: {}", contender.name));
        bench.judge(&contender)?;
    }
    stage("interval of a score");
    let member = recipe::member();
    let (interval, calibration) = bench.intervals(recipe::NAME, &member, &compact, recipe::CALIBRATION_MEMBERS)?;
    let ablation_trainer = recipe::plain_kernel();
    let mut ablation = Vec::new();
    for case in ablation_cases(samples, embedded, protocol)? {
        stage(&format!("ablation: {}", case.name));
        ablation.push(bench.ablate(&case, &ablation_trainer, ablation_trainer.name())?);
    }
    stage("importance of descriptors");
    let importance = bench.importance(&ablation_trainer, ablation_trainer.name(), &compact, MOST_SINGLE)?;
    stage("learning curve");
    let learning_curve = bench.learning_curve(&ablation_trainer, &compact)?;
    let of_graphs = graphs.columns().iter().map(|column| bench.curve(&graphs, &column.name));
    let of_lp = CURVED_LP.iter().map(|name| bench.curve(&lp, name));
    let of_external = external.iter().flat_map(|s| s.columns().iter().map(|column| bench.curve(s, &column.name)));
    let curves = of_graphs.chain(of_lp).chain(of_external).collect::<Result<_, _>>()?;
    stage("differences");
    let mut headline = vec![recipe::NAME.to_owned()];
    headline.extend(parts.iter().map(|(trainer, _, _)| trainer.name().to_owned()));
    headline.push(best.name().to_owned());
    headline.extend(graphs.columns().iter().map(|column| column.name.clone()));
    headline.extend(of_file().map(|contender| contender.name));
    headline.extend(SHOWN_LP.map(str::to_owned));
    headline.extend([MeanOf::Method, MeanOf::MethodAndMaterialType].map(|m| m.name().to_owned()));
    let others: Vec<&str> = headline[1..].iter().map(String::as_str).collect();
    let differences = bench.differences(recipe::NAME, &others)?;
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
        metrics: bench.metrics().into_iter().map(versioned).collect(),
        differences,
        did_not_help: did_not_help(&ablation),
        retrained: ablation_trainer.name().to_owned(),
        ablation,
        importance,
        learning_curve,
        curves,
        residuals: bench.residuals(recipe::NAME)?,
        calibration: Some(calibration),
        predictions: bench.prediction_records(&headline),
        headline,
    };
    Ok(StudyBenchmark { record: record.on_scale(study.scale), interval })
}

/// The models beside the metric: trainer, kind, note.
fn parts() -> Vec<(Box<dyn Trainer>, MetricKind, &'static str)> {
    vec![
        (
            Box::new(KernelRidge::full()),
            MetricKind::Learned,
            "kernel ridge regression on all training rows; not exported, for the ratings could be solved for",
        ),
        (Box::new(recipe::kernel()), MetricKind::Learned, "the kernel part of the metric: few landmarks"),
        (Box::new(recipe::network()), MetricKind::Learned, "the network part of the metric: an ensemble in burn"),
        (
            Box::new(recipe::plain_kernel()),
            MetricKind::Learned,
            "the landmark kernel without exchanged pairs: what the ablation retrains",
        ),
        (Box::new(ElasticNet::mixed()), MetricKind::Baseline, "linear and sparse, same descriptors"),
        (
            Box::new(SupportVectors::default()),
            MetricKind::Baseline,
            "support-vector regression, same descriptors; not exact for identical BRDFs",
        ),
    ]
}

fn contenders<'a>(
    parts: &'a [(Box<dyn Trainer>, MetricKind, &'static str)],
    best: &'a BestOf,
    compact: &'a Samples,
    lp: &'a Samples,
    graphs: &'a Samples,
) -> Vec<Contender<'a>> {
    let contender =
        |name: &str, kind, note: &str, source| Contender { name: name.to_owned(), kind, note: note.to_owned(), source };
    let mut all: Vec<Contender<'a>> = parts
        .iter()
        .map(|(trainer, kind, note)| contender(trainer.name(), *kind, note, Source::Trainer(trainer.as_ref(), compact)))
        .collect();
    let note = "the exported metric: mean of the landmark kernel and the networks";
    all.push(contender(recipe::NAME, MetricKind::Learned, note, Source::MeanOf(&recipe::PARTS)));
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
    all.extend([MeanOf::Method, MeanOf::MethodAndMaterialType].map(|means| {
        contender(means.name(), MetricKind::Trivial, "knows who fitted it, nothing of appearance", Source::Means(means))
    }));
    all
}

/// Each family of the extended set left out and alone, and each other family added.
fn ablation_cases(
    samples: &Samples,
    embedded: Vec<(&'static str, EmbeddedFolds)>,
    protocol: &Protocol,
) -> Result<Vec<AblationCase>, ExperimentError> {
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
    let used = samples.select_columns(recipe::uses);
    cases.extend(embedded.into_iter().map(|(name, folds)| AblationCase {
        name: format!("with {name}"),
        columns: folds.columns,
        samples: used.clone(),
        by_material: folds.by_material,
        by_method: folds.by_method,
    }));
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
