//! What a study supports, decided from its rows before the first BRDF is read: hours of work never end in an error that its
//! rows foretold.
//!
//! Folds depend on the rows and the seed alone, so that [`Plan::of`] makes the very folds of the measurement and looks at each
//! training side. A study on which no metric can be measured for unseen materials is refused, with what is needed; all else that
//! it does not support is left out, with a sentence. [`Plan::with_numbers`] does the same once there are numbers: BRDFs that do
//! not differ show only there.

use super::ExperimentError;
use super::train::{BenchmarkOptions, folds_of, unrated};
use crate::dataset::{NamedRows, RatedPair, Row, Study};
use crate::evaluation::agreement::MIN_ROWS_PER_MATERIAL;
use crate::evaluation::bootstrap::{MAX_RESAMPLES, MIN_RESAMPLES};
use crate::evaluation::importance::{SHARES, groups_of_share};
use crate::evaluation::protocol::Protocol;
use crate::evaluation::records::Split;
use crate::samples::Samples;
use crate::samples::split::{Fold, TrainingSet, grouped_folds, material_type_folds, method_and_group_folds};
use crate::train::LEAST_ROWS;
use crate::train::trivial::MeanOf;
use ndarray::Array2;
use std::collections::{BTreeMap, BTreeSet};
use vernis_metric::descriptor::Role;
use vernis_metric::io::counted;

/// Groups of materials that a training side must have: choices are made on folds inside it.
const LEAST_GROUPS: usize = 2;
/// Tables that an embedding must be learned from.
const LEAST_TABLES: usize = 3;
/// Points without which there is no curve.
const LEAST_SHARES: usize = 2;

/// Method families of manifold-like and non-parametric candidates, which sit so close to the reference that rating them
/// is easy: the second set of rows leaves them out.
pub(super) const SET_ASIDE: [&str; 3] = ["BAGHER", "GPLVM", "manifold"];

/// What is done with a study, and what is left out.
#[derive(Debug, Clone)]
pub struct Plan {
    /// How metrics are judged: only splits and shares that the study supports.
    pub protocol: Protocol,
    /// The baselines that know only what a row belongs to, as far as the study names it.
    pub means: Vec<MeanOf>,
    /// Whether embeddings can be learned in each fold.
    pub embeddings: bool,
    /// What is left out, a sentence each.
    pub left_out: Vec<String>,
}

impl Plan {
    /// What `study` supports under `options`. Reads no BRDF.
    ///
    /// # Errors
    /// A study on which nothing can be measured, or options out of range: the message says what is needed.
    pub fn of(study: &Study, options: &BenchmarkOptions) -> Result<Self, ExperimentError> {
        study.validate(folds_of(options, study))?;
        let resamples = options.resamples;
        if !(MIN_RESAMPLES..=MAX_RESAMPLES).contains(&resamples) {
            let reason =
                format!("the number of resamples is {resamples}; it must be {MIN_RESAMPLES} to {MAX_RESAMPLES}");
            return Err(refused(study, reason));
        }
        if study.pairs.iter().all(|pair| pair.reference.identity() == pair.candidate.identity()) {
            let reason =
                "every candidate is its own reference; there is nothing to learn from pairs that do not differ";
            return Err(refused(study, reason.to_owned()));
        }
        let rows: Vec<Row> = study.pairs.iter().map(RatedPair::row).collect();
        let bare = Samples::new(Vec::new(), rows, Array2::zeros((study.pairs.len(), 0)))?;
        Self::on(study, options, &bare)
    }

    /// The same with the descriptors of every row, `compact`.
    ///
    /// # Errors
    /// As [`Plan::of`]; descriptors that do not differ between reference and candidate.
    pub fn with_numbers(study: &Study, options: &BenchmarkOptions, compact: &Samples) -> Result<Self, ExperimentError> {
        Self::on(study, options, compact)
    }

    fn on(study: &Study, options: &BenchmarkOptions, samples: &Samples) -> Result<Self, ExperimentError> {
        let (folds, seed) = (folds_of(options, study), options.seed);
        let by_material = grouped_folds(samples, folds, seed)?;
        if let Some((k, found)) = obstacle(&by_material) {
            let reason = format!(
                "fold {} of {folds} would train on {found}; the training side of every fold must have {NEEDED}; more rated \
                 pairs, more materials or another number of folds help",
                k + 1
            );
            return Err(refused(study, reason));
        }
        // The embedded study has many families of methods and little to say of unseen ones.
        let method_folds = if study.synthetic { folds.min(2) } else { folds };
        let mut left_out = Vec::new();
        let mut splits = vec![Split::UnseenMaterial];
        for (split, found) in [
            (Split::UnseenMaterialAndMethod, unseen_method(samples, method_folds, seed)),
            (Split::UnseenMaterialType, unseen_type(samples)),
        ] {
            match found {
                None => splits.push(split),
                Some(reason) => left_out.push(format!("The split by {} is left out: {reason}.", split.label())),
            }
        }
        let set_aside = set_aside(samples, &mut left_out);
        let row_sets = row_sets(study.row_sets()?, samples.rows(), &mut left_out);
        if !within_material(samples.rows()) {
            left_out.push(format!(
                "The correlation within materials is left out: no material has {MIN_ROWS_PER_MATERIAL} candidates whose ratings \
                 differ."
            ));
        }
        let means = means(samples.rows(), &mut left_out);
        let shares = shares(&by_material, seed, &mut left_out);
        let embeddings = embeddings(&by_material, options, &mut left_out)?;
        let resamples = options.resamples;
        let protocol = Protocol { folds, method_folds, resamples, seed, set_aside, row_sets, splits, shares };
        Ok(Self { protocol, means, embeddings, left_out })
    }
}

/// What [`obstacle`] looks for, in words.
const NEEDED: &str = "at least 8 rows of at least 2 groups of materials, with ratings and descriptors that differ";

fn refused(study: &Study, reason: String) -> ExperimentError {
    ExperimentError::Unsupported { study: study.name.clone(), reason }
}

fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> usize {
    names.collect::<BTreeSet<_>>().len()
}

/// The first fold on whose training side nothing can be learned, and what that side is.
fn obstacle(folds: &[Fold]) -> Option<(usize, String)> {
    folds.iter().enumerate().find_map(|(k, fold)| Some((k, of_training(&fold.training)?)))
}

/// Why nothing can be learned from the rows.
fn of_training(training: &TrainingSet) -> Option<String> {
    let rows = training.rows();
    let groups = distinct(rows.iter().map(|row| row.group.as_str()));
    let of_groups = || format!("{} of {}", counted(rows.len(), "row"), counted(groups, "group"));
    if rows.len() < LEAST_ROWS || groups < LEAST_GROUPS {
        return Some(of_groups() + " of materials");
    }
    if equal(rows.iter().map(|row| row.mos)) {
        return Some(format!("{} whose ratings are all {}", of_groups(), rows[0].mos));
    }
    let differs = |k: usize| {
        training.columns()[k].role == Role::Difference && !equal(training.features().column(k).iter().copied())
    };
    let columns = training.columns().len();
    (columns > 0 && !(0..columns).any(differs))
        .then(|| format!("{} whose descriptors do not differ from pair to pair", of_groups()))
}

fn equal(mut values: impl Iterator<Item = f64>) -> bool {
    let Some(first) = values.next() else { return true };
    values.all(|value| value == first)
}

/// Why methods that were not seen cannot be judged.
fn unseen_method(samples: &Samples, folds: usize, seed: u64) -> Option<String> {
    let families: BTreeSet<&str> = samples.rows().iter().map(|row| row.method_family.as_str()).collect();
    if families.len() < 2 {
        let only = families.into_iter().next().unwrap_or_default();
        return Some(format!("all rows name one family of methods, {only}; it needs at least 2"));
    }
    let of_folds = |found: Result<Vec<Fold>, _>| match found {
        Err(_) => Some("a family of methods would be judged without any row of another family and material".to_owned()),
        Ok(folds) => {
            let (k, found) = obstacle(&folds)?;
            let family = &folds[k].held_out.rows()[0].method_family;
            Some(format!("to judge {family}, a fold would train on {found}; it needs {NEEDED}"))
        }
    };
    of_folds(method_and_group_folds(samples, folds, seed))
}

/// Why a type of material that was not seen cannot be judged.
fn unseen_type(samples: &Samples) -> Option<String> {
    let rows = samples.rows();
    let types: BTreeSet<&str> = rows.iter().filter_map(|row| row.material_type.as_deref()).collect();
    let without = rows.iter().filter(|row| row.material_type.is_none()).count();
    if types.is_empty() {
        return Some("the study names no types of material".to_owned());
    }
    if without > 0 {
        return Some(format!("{without} of {} name no type of material", counted(rows.len(), "row")));
    }
    if types.len() < 2 {
        let only = types.into_iter().next().unwrap_or_default();
        return Some(format!("all materials are of one type, {only}; it needs at least 2"));
    }
    match material_type_folds(samples) {
        Err(_) => Some("every material of another type has a sister of the type that is judged".to_owned()),
        Ok(folds) => {
            let (k, found) = obstacle(&folds)?;
            let of_type = folds[k].held_out.rows()[0].material_type.clone().unwrap_or_default();
            Some(format!("to judge the type {of_type}, a fold would train on {found}; it needs {NEEDED}"))
        }
    }
}

/// The families that the second set of rows leaves out, where that set can be judged.
fn set_aside(samples: &Samples, left_out: &mut Vec<String>) -> Vec<String> {
    let is_aside = |row: &&Row| SET_ASIDE.contains(&row.method_family.as_str());
    let present: BTreeSet<&str> = samples.rows().iter().filter(is_aside).map(|r| r.method_family.as_str()).collect();
    let families: Vec<String> =
        SET_ASIDE.iter().filter(|family| present.contains(*family)).map(|family| (*family).to_owned()).collect();
    let kept: Vec<&Row> = samples.rows().iter().filter(|row| !is_aside(row)).collect();
    let groups = distinct(kept.iter().map(|row| row.group.as_str()));
    if families.is_empty() || (groups >= LEAST_GROUPS && !equal(kept.iter().map(|row| row.mos))) {
        return families;
    }
    left_out.push(format!(
        "The figures without {} are left out: they would rest on {} of {} of materials.",
        families.join(", "),
        counted(kept.len(), "row"),
        counted(groups, "group")
    ));
    Vec::new()
}

/// The sets of `declared` on which figures can stand: those of some rows, but not of all.
fn row_sets(declared: Vec<NamedRows>, rows: &[Row], left_out: &mut Vec<String>) -> Vec<NamedRows> {
    let mut stands = |set: &NamedRows| {
        let kept: Vec<&Row> = rows.iter().filter(|row| set.has(row)).collect();
        let groups = distinct(kept.iter().map(|row| row.group.as_str()));
        let enough = groups >= LEAST_GROUPS && !equal(kept.iter().map(|row| row.mos));
        if !enough {
            left_out.push(format!(
                "The figures on the rows of {} are left out: they would rest on {} of {} of materials.",
                set.name,
                counted(kept.len(), "row"),
                counted(groups, "group")
            ));
        }
        enough && kept.len() < rows.len()
    };
    declared.into_iter().filter(|set| stands(set)).collect()
}

/// Whether some material has enough candidates to be ordered.
fn within_material(rows: &[Row]) -> bool {
    let mut ratings: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for row in rows {
        ratings.entry(&row.material).or_default().push(row.mos);
    }
    ratings.values().any(|mos| mos.len() >= MIN_ROWS_PER_MATERIAL && !equal(mos.iter().copied()))
}

/// The means that say more than the mean of all rows.
fn means(rows: &[Row], left_out: &mut Vec<String>) -> Vec<MeanOf> {
    let mut groups: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for row in rows {
        groups.entry(&row.method).or_default().insert(&row.group);
    }
    let mut found = Vec::new();
    let reason = if groups.len() < 2 {
        Some("the study names one method")
    } else if groups.values().all(|of_method| of_method.len() < 2) {
        Some("no method is rated on two groups of materials")
    } else {
        found.push(MeanOf::Method);
        None
    };
    let types = distinct(rows.iter().filter_map(|row| row.material_type.as_deref()));
    let of_types = (types < 2).then_some("the study names fewer than two types of material");
    if let Some(reason) = reason {
        left_out.push(format!("The baseline {} is left out: {reason}.", MeanOf::Method.name()));
    }
    match reason.or(of_types) {
        None => found.push(MeanOf::MethodAndMaterialType),
        Some(reason) => {
            left_out.push(format!("The baseline {} is left out: {reason}.", MeanOf::MethodAndMaterialType.name()));
        }
    }
    found
}

/// The shares of the training materials from which something can be learned in every fold.
fn shares(folds: &[Fold], seed: u64, left_out: &mut Vec<String>) -> Vec<f64> {
    let obstacle = |share: f64| {
        let kept = groups_of_share(folds, seed, share);
        let of_fold = |(fold, kept): (&Fold, &BTreeSet<&str>)| {
            of_training(&fold.training.filter(|row: &Row| kept.contains(row.group.as_str())))
        };
        folds.iter().zip(&kept).find_map(of_fold)
    };
    let (mut found, mut first, mut sizes) = (Vec::new(), None, Vec::new());
    for share in SHARES {
        let size: Vec<usize> = groups_of_share(folds, seed, share).iter().map(BTreeSet::len).collect();
        match obstacle(share) {
            // Of few materials two shares may be the same.
            None if size == sizes => {}
            None => (found, sizes) = ([found, vec![share]].concat(), size),
            Some(reason) => first = first.or(Some((share, reason))),
        }
    }
    let Some((share, reason)) = first else { return found };
    let percent = 100.0 * share;
    let what = if found.len() < LEAST_SHARES {
        found.clear();
        "The learning curve is left out".to_owned()
    } else {
        format!("The learning curve has {} of {} points", found.len(), SHARES.len())
    };
    left_out.push(format!(
        "{what}: with {percent:.0} % of the training materials a fold would train on {reason}; it needs {NEEDED}."
    ));
    found
}

/// Whether every fold has tables to learn an embedding from.
fn embeddings(folds: &[Fold], options: &BenchmarkOptions, left_out: &mut Vec<String>) -> Result<bool, ExperimentError> {
    let of_fold = |fold: &Fold| distinct(fold.training.rows().iter().map(|row| row.material.as_str()));
    let fewest = folds.iter().map(of_fold).min().unwrap_or(0);
    let tables = if fewest < LEAST_TABLES { fewest + unrated(options.data.as_deref())?.len() } else { fewest };
    if tables < LEAST_TABLES {
        left_out.push(format!(
            "Learned embeddings are left out of the ablation: a fold would learn them from {}; they need at least {LEAST_TABLES}.",
            counted(tables, "material")
        ));
    }
    Ok(tables >= LEAST_TABLES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Completeness, Identical, synthetic};
    use vernis_metric::brdf::BrdfSource;
    use vernis_metric::math::rating_scale::RatingScale;

    /// `materials` materials of `per` candidates each, by `methods` methods in turn.
    fn study(materials: usize, per: usize, methods: usize) -> Study {
        let pair = |k: usize| RatedPair {
            reference: BrdfSource::Notation(format!("r{}.json", k / per)),
            candidate: BrdfSource::Notation(format!("c{k}.json")),
            material: format!("m{}", k / per),
            group: format!("m{}", k / per),
            method: format!("a{}", k % methods),
            method_family: format!("a{}", k % methods),
            material_type: None,
            mos: 1.0 + (k % 9) as f64 / 2.5,
            weight: 1.0,
        };
        let pairs: Vec<RatedPair> = (0..materials * per).map(pair).collect();
        let completeness = Completeness { found: pairs.len(), known: pairs.len() };
        let (scale, identical) = (RatingScale::GRADES, Identical::assumed(RatingScale::GRADES));
        Study { name: "s.csv".into(), synthetic: false, completeness, scale, identical, files: Vec::new(), pairs }
    }

    fn plan(study: &Study, folds: usize) -> Result<Plan, String> {
        let options = BenchmarkOptions { folds: Some(folds), ..BenchmarkOptions::default() };
        Plan::of(study, &options).map_err(|e| e.to_string())
    }

    #[test]
    fn the_embedded_study_supports_everything() {
        let study = Study::load(synthetic::NAME, None).unwrap();
        let plan = Plan::of(&study, &BenchmarkOptions::default()).unwrap();
        assert_eq!(plan.left_out, Vec::<String>::new());
        assert_eq!((plan.protocol.splits.len(), plan.protocol.shares.len(), plan.means.len()), (3, 5, 2));
    }

    #[test]
    fn one_method_leaves_out_what_compares_methods() {
        let plan = plan(&study(12, 4, 1), 4).unwrap();
        assert_eq!(plan.protocol.splits, [Split::UnseenMaterial]);
        assert!(plan.means.is_empty() && plan.embeddings);
        let text = plan.left_out.join("\n");
        assert!(
            text.contains("split by unseen material and method is left out: all rows name one family of methods, a0")
        );
        assert!(text.contains("unseen material type is left out: the study names no types of material"), "{text}");
    }

    #[test]
    fn small_training_sides_are_refused_with_what_is_needed() {
        for (materials, per, folds, found) in [
            (2, 20, 2, "fold 1 of 2 would train on 20 rows of 1 group of materials"),
            (3, 2, 3, "fold 1 of 3 would train on 4 rows of 2 groups of materials"),
        ] {
            let message = plan(&study(materials, per, 2), folds).unwrap_err();
            assert!(message.starts_with(&format!("study s.csv: {found}; ")) && message.contains(NEEDED), "{message}");
        }
        assert!(plan(&study(3, 4, 2), 3).is_ok());
        // Apart from one material, all ratings are the same.
        let mut equal = study(4, 8, 2);
        equal.pairs.iter_mut().skip(8).for_each(|pair| pair.mos = 3.0);
        let message = plan(&equal, 4).unwrap_err();
        assert!(message.contains("would train on 24 rows of 3 groups whose ratings are all 3;"), "{message}");
        let mut same = study(4, 8, 2);
        same.pairs.iter_mut().for_each(|pair| pair.candidate = pair.reference.clone());
        assert!(plan(&same, 4).unwrap_err().contains("every candidate is its own reference"));
    }

    #[test]
    fn a_learning_curve_begins_where_something_can_be_learned() {
        let whole = plan(&study(40, 4, 4), 4).unwrap();
        assert_eq!(whole.protocol.shares, SHARES);
        let some = plan(&study(8, 4, 4), 4).unwrap();
        assert_eq!(some.protocol.shares, SHARES);
        let few = plan(&study(6, 3, 3), 6).unwrap();
        assert_eq!(few.protocol.shares, [0.6, 0.8, 1.0]);
        assert!(few.left_out.iter().any(|line| line.starts_with("The learning curve has 3 of 5 points: with 20 % ")));
        let none = plan(&study(3, 4, 2), 3).unwrap();
        assert!(none.protocol.shares.is_empty());
        assert!(none.left_out.iter().any(|line| line.starts_with("The learning curve is left out: with 20 % of")));
        assert!(!none.embeddings);
    }

    #[test]
    fn types_count_where_every_row_has_one_and_both_sides_are_large_enough() {
        let typed = |of: &dyn Fn(usize) -> Option<&'static str>| {
            let mut study = study(12, 4, 4);
            study.pairs.iter_mut().enumerate().for_each(|(k, p)| p.material_type = of(k / 4).map(str::to_owned));
            plan(&study, 4).unwrap()
        };
        assert!(
            typed(&|m| Some(if m < 6 { "Metal" } else { "Wood" })).protocol.splits.contains(&Split::UnseenMaterialType)
        );
        for (found, reason) in [
            (
                typed(&|m| (m > 0).then_some(if m < 6 { "Metal" } else { "Wood" })),
                "4 of 48 rows name no type of material",
            ),
            (typed(&|_| Some("Metal")), "all materials are of one type, Metal"),
            (
                typed(&|m| Some(if m < 1 { "Metal" } else { "Wood" })),
                "to judge the type Wood, a fold would train on 4 rows of 1 group of materials",
            ),
        ] {
            assert!(!found.protocol.splits.contains(&Split::UnseenMaterialType));
            assert!(found.left_out.iter().any(|line| line.contains(reason)), "{:?}", found.left_out);
        }
    }

    #[test]
    fn a_named_set_of_rows_must_have_some_rows_and_not_all() {
        let rows: Vec<Row> = study(4, 8, 2).pairs.iter().map(RatedPair::row).collect();
        let set = |name: &str, methods: &[&str]| NamedRows {
            name: name.into(),
            methods: methods.iter().map(|method| (*method).to_owned()).collect(),
        };
        let mut left_out = Vec::new();
        let sets = vec![set("half", &["a0"]), set("whole", &["a0", "a1"]), set("absent", &["b"])];
        assert_eq!(row_sets(sets, &rows, &mut left_out), [set("half", &["a0"])]);
        assert_eq!(
            left_out,
            ["The figures on the rows of absent are left out: they would rest on 0 rows of 0 groups of materials."]
        );
    }

    #[test]
    fn rows_that_are_set_aside_must_leave_something() {
        let mut all = study(4, 8, 2);
        all.pairs.iter_mut().for_each(|pair| pair.method_family = "BAGHER".into());
        let found = plan(&all, 4).unwrap();
        assert!(found.protocol.set_aside.is_empty());
        assert!(
            found.left_out.iter().any(|line| line.contains("without BAGHER are left out: they would rest on 0 rows"))
        );
        let mut half = study(4, 8, 2);
        half.pairs.iter_mut().step_by(2).for_each(|pair| pair.method_family = "BAGHER".into());
        assert_eq!(plan(&half, 4).unwrap().protocol.set_aside, ["BAGHER"]);
    }
}
