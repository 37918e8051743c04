//! Statistics of ratings: the truth of the simulated panel is recovered, and the command says what it did.

use crate::data_folder;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::LazyLock;
use vernis::dataset::opinions::{Scores, StudyOpinions};
use vernis::dataset::synthetic::sessions::{OVERCAST, OVERCAST_SHIFT, STUDIO, Sessions, simulate};
use vernis::dataset::synthetic::{SEED, SyntheticStudy, generate};
use vernis::math::correlation::pearson;
use vernis::math::rating_scale::RatingScale;
use vernis::panel::record::{Spread, StudyRecord};
use vernis::panel::reliability::expected;
use vernis::panel::screening::{Criterion, screen};
use vernis::panel::t_test::paired;
use vernis::panel::{Options, StudyError, describe};

static MADE: LazyLock<SyntheticStudy> = LazyLock::new(|| generate(SEED).expect("the embedded study"));
static SESSIONS: LazyLock<Sessions> = LazyLock::new(|| simulate(&MADE, SEED));
static RECORD: LazyLock<StudyRecord> =
    LazyLock::new(|| describe(&SESSIONS.opinions, &Options::default()).expect("a panel that looks"));

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn raw() -> &'static vernis::dataset::raw_ratings::RawRatings {
    match &SESSIONS.opinions.scores {
        Scores::Raw(raw) => raw,
        Scores::Means(_) => panic!("the embedded study has raw ratings"),
    }
}

#[test]
fn screening_rejects_exactly_who_did_not_look() {
    let panel = RECORD.panel.as_ref().expect("raw ratings");
    let names = |of: &[usize]| of.iter().map(|&i| raw().participants[i].as_str()).collect::<Vec<_>>();
    assert_eq!(panel.rejected().map(|p| p.name.as_str()).collect::<Vec<_>>(), names(&SESSIONS.careless));
    assert_eq!((panel.participants, panel.judgements), (30, 30 * SESSIONS.quality.len()));
    assert_eq!((panel.failing(Criterion::Gold), panel.failing(Criterion::Time)), (3, 3));
    // Without gold and time, the outlier check sees them beyond more often than anybody else. It calls an outlier only
    // who is beyond on both sides alike, which at random is rare among stimuli that are mostly good.
    let mut blind = raw().clone();
    blind.gold.clear();
    blind.judgements.iter_mut().for_each(|j| j.seconds = None);
    let screened = screen(&blind, SESSIONS.quality.len());
    let beyond = |i: &usize| screened[*i].beyond.unwrap().iter().sum::<usize>();
    let careful = (0..33).filter(|i| !SESSIONS.careless.contains(i)).map(|i| beyond(&i)).max();
    let careless = SESSIONS.careless.iter().map(beyond).min();
    assert!(careless > careful.map(|c| 2 * c), "{careless:?} {careful:?}");
    let outliers: Vec<usize> = (0..33).filter(|&i| screened[i].fails == [Criterion::Outlier]).collect();
    assert!(!outliers.is_empty() && outliers.iter().all(|i| SESSIONS.careless.contains(i)), "{outliers:?}");
}

#[test]
fn of_several_fits_of_a_model_the_better_one_counts() {
    let boxes = |title: &str| &RECORD.boxes.iter().find(|set| set.title == title).expect("box plots").boxes;
    let mut best: BTreeMap<(&str, &str), f64> = BTreeMap::new();
    let first = RECORD.illuminations.first();
    for rated in RECORD.opinions.iter().filter(|o| o.stimulus.illumination.as_ref() == first) {
        let of = best.entry((&rated.stimulus.method_family, &rated.stimulus.material)).or_default();
        *of = of.max(rated.opinion.mos);
    }
    let models = boxes("By model, the better of several fits");
    assert!(models.len() > 3 && models.len() < boxes("By method").len());
    for model in models {
        let expected: Vec<f64> =
            best.iter().filter(|((family, _), _)| *family == model.levels[0]).map(|b| *b.1).collect();
        assert!((model.mean - mean(&expected)).abs() < 1e-12, "{:?}", model.levels);
    }
}

/// Four materials of two types; `scores(method, material)` are those of two raters.
fn designed(methods: &[(&str, &str)], scores: impl Fn(&str, usize) -> Option<[f64; 2]>) -> StudyOpinions {
    let mut text = "participant,material,method,score,material_type\n".to_owned();
    for material in 0..4 {
        for (method, _) in methods {
            for (who, score) in scores(method, material).into_iter().flatten().enumerate() {
                let kind = if material < 2 { "Metal" } else { "Dielectric" };
                text += &format!("p{who},m{material},{method},{score},{kind}\n");
            }
        }
    }
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("designed.csv");
    fs::write(&path, text).unwrap();
    let mut opinions = StudyOpinions::load_raw(&path).unwrap();
    for stimulus in &mut opinions.stimuli {
        let (_, family) = methods.iter().find(|(method, _)| *method == stimulus.method).unwrap();
        stimulus.method_family = (*family).to_owned();
    }
    opinions
}

/// Samples of a manifold are no fits, and a model that lacks a material has no place beside those that have all.
#[test]
fn models_are_compared_where_all_were_fitted_and_manifolds_are_none() {
    let methods = [
        ("WARD", "WARD"),
        ("WARD-OURS", "WARD"),
        ("SGD", "SGD"),
        ("CHEBYCHEV", "RATIONAL"),
        ("GPLVM_APPROX.1", "GPLVM"),
        ("GPLVM_APPROX.2", "GPLVM"),
        ("REFERENCE", "REFERENCE"),
    ];
    let opinions = designed(&methods, |method, material| {
        let wave = [0.0, 0.5, 0.25, 0.0][material];
        Some(match method {
            "WARD" => [1.0 + wave, 2.0],
            "WARD-OURS" => [2.0 + wave, 3.0],
            "SGD" => [3.0 + wave * wave, 4.0],
            "CHEBYCHEV" if material == 3 => return None,
            "CHEBYCHEV" => [4.0, 5.0],
            "GPLVM_APPROX.1" => [5.0, 4.5],
            "GPLVM_APPROX.2" => [2.0 - wave, 1.0],
            _ => [5.0, 4.5 + wave],
        })
    });
    let record = describe(&opinions, &Options::default()).unwrap();
    let set = record.boxes.iter().find(|set| set.title == vernis::panel::BY_MODEL).unwrap();
    assert_eq!(set.boxes.iter().map(|b| b.levels[0].as_str()).collect::<Vec<_>>(), ["REFERENCE", "SGD", "WARD"]);
    let note = set.note.as_deref().unwrap();
    assert!(
        note.ends_with("GPLVM (samples of a manifold, no fits of a model), RATIONAL (fitted to 3 of 4 materials)"),
        "{note}"
    );
    let models = record.models.as_ref().unwrap();
    assert_eq!((models.models.as_slice(), models.pairs.len()), (&["SGD".to_owned(), "WARD".to_owned()][..], 1));
    let test = paired(&[3.5, 3.625, 3.53125, 3.5], &[2.5, 2.75, 2.625, 2.5]).unwrap();
    assert_eq!((models.pairs[0].mos.difference, models.pairs[0].holm_p), (test.difference, test.p));
    // The samples: distance (1/2)^5 and 1.
    let found = record.manifold.as_ref().unwrap();
    let distances: Vec<f64> = [[1.0 / 32.0; 4], [1.0; 4]].concat();
    let mos = [4.75, 4.75, 4.75, 4.75, 1.5, 1.25, 1.375, 1.5];
    assert!((found.pearson - pearson(&distances, &mos).unwrap()).abs() < 1e-12, "{found:?}");
    assert!(found.pearson < -0.9 && (found.stimuli, found.steps) == (8, 2));
    let page = vernis::report::study::markdown(&record);
    for part in [note, "1 pair of models, paired t-tests", "Of 2 models, SGD has the best mean", "8 stimuli at (i/2)^5"]
    {
        assert!(page.contains(part), "{part}: {page}");
    }
    // The embedded study: its steps lead to another material, and one of its methods is for some materials alone.
    let set = RECORD.boxes.iter().find(|set| set.title == vernis::panel::BY_MODEL).unwrap();
    assert!(set.boxes.iter().all(|b| !["STEPS", "LOST-HAZE"].contains(&b.levels[0].as_str())));
    let models = RECORD.models.as_ref().unwrap();
    assert_eq!((models.models.len(), models.pairs.len()), (5, 10));
    assert!(models.pairs.iter().all(|pair| pair.holm_p >= pair.mos.p && pair.mos.numbers == [40; 2]));
}

#[test]
fn all_raters_alike_leave_an_interval() {
    let methods = [("A", "A"), ("B", "B")];
    let opinions = designed(&methods, |method, material| {
        Some(if method == "A" { [1.0; 2] } else { [2.0, material as f64 + 1.0] })
    });
    let record = describe(&opinions, &Options::default()).unwrap();
    let unanimous = record.opinions.iter().filter(|o| o.stimulus.method == "A").map(|o| o.opinion);
    assert!(unanimous.into_iter().all(|o| o.deviation == Some(0.0) && o.width().is_some_and(|w| w > 0.5)));
    let text = vernis::report::study::text(&record);
    assert!(
        record.intervals.contains("for 5 stimuli whose scores are all equal") && text.contains(&record.intervals),
        "{text}"
    );
    // One material, one method, and so on: one of a thing.
    let one = designed(&[("A", "A")], |_, material| (material == 0).then_some([1.0, 2.0]));
    let text = vernis::report::study::text(&describe(&one, &Options::default()).unwrap());
    assert!(text.contains("1 stimulus of 1 material and 1 method,"), "{text}");
}

#[test]
fn means_of_the_raw_ratings_are_those_of_the_study() {
    for ((o, pair), quality) in RECORD.opinions.iter().zip(&MADE.study.pairs).zip(&MADE.quality) {
        assert_eq!((&o.stimulus.material, &o.stimulus.method), (&pair.material, &pair.method));
        assert!((o.opinion.mos - pair.mos).abs() < 1e-12 && o.opinion.raters == 30);
        assert!((o.opinion.mos - quality).abs() < 0.9, "{} {quality}", o.opinion.mos);
    }
    let mos: Vec<f64> = RECORD.opinions.iter().map(|o| o.opinion.mos).collect();
    assert!(pearson(&mos, &SESSIONS.quality).unwrap() > 0.97);
    assert_eq!(RECORD.spread, Spread::Scores);
    assert!(RECORD.synthetic);
}

#[test]
fn agreement_by_halves_by_variance_and_by_spread_is_the_same() {
    let split = RECORD.split_half.as_ref().expect("split halves");
    let (one, two) = (RECORD.intraclass_one_way.as_ref().unwrap(), RECORD.intraclass_two_way.as_ref().unwrap());
    let sos = RECORD.sos.as_ref().expect("an SOS fit");
    // Three routes to the same variances: halves of the panel, mean squares, and the fitted spread of single scores.
    let mos: Vec<f64> = RECORD.opinions.iter().map(|o| o.opinion.mos).collect();
    let by_spread = expected(&mos, sos.a, 30).unwrap();
    assert!((split.pearson.mean - by_spread.split_half_pearson).abs() < 0.01, "{split:?} {by_spread:?}");
    assert!((one.average.value - by_spread.signal).abs() < 0.005, "{one:?} {by_spread:?}");
    let halves = one.average.value / (2.0 - one.average.value); // (V - N)/(V + N) from (V - N)/V
    assert!((split.pearson.mean - halves).abs() < 0.01, "{split:?} {halves}");
    // The part of the variance of the means that the truth explains.
    let truth = pearson(&mos, &SESSIONS.quality).unwrap().powi(2);
    assert!(truth < two.average.interval.high && truth > 0.9 * two.average.value, "{truth} {two:?}");
    // One observer: noise 0.65^2, bias 0.3^2 and rounding 1/12 leave the rest of the variance of the grades to the pairs.
    let variance = mean(&SESSIONS.quality.iter().map(|q| (q - mean(&SESSIONS.quality)).powi(2)).collect::<Vec<_>>());
    let single = variance / (variance + 0.4225 + 0.09 + 1.0 / 12.0);
    assert!((two.single.value - single).abs() < 0.06, "{single} {two:?}");
    assert!((0.15..0.25).contains(&sos.a) && sos.interval.unwrap().contains(sos.a), "{sos:?}");
}

#[test]
fn the_shift_between_illuminations_is_found_and_no_other_one() {
    let both = RECORD.illumination.as_ref().expect("two illuminations");
    assert_eq!(both.illuminations, [STUDIO, OVERCAST]);
    assert!(both.mos.p < 1e-6 && both.mos.difference < 0.0, "{:?}", both.mos);
    // Hidden references are of one quality under both.
    let hidden = both.hidden_references.as_ref().expect("hidden references");
    assert!(hidden.interval.contains(0.0) && hidden.numbers[0] > 10, "{hidden:?}");
    // Where the scale does not end, the shift is recovered.
    let mut pairs: BTreeMap<(&str, &str), [Option<usize>; 2]> = BTreeMap::new();
    for (i, o) in RECORD.opinions.iter().enumerate() {
        let side = usize::from(o.stimulus.illumination.as_deref() == Some(OVERCAST));
        pairs.entry((&o.stimulus.material, &o.stimulus.method)).or_default()[side] = Some(i);
    }
    let middle = |i: &usize| (2.0..4.0).contains(&SESSIONS.quality[*i]);
    let rows: Vec<[usize; 2]> = pairs.values().filter_map(|&[a, b]| Some([a.filter(middle)?, b?])).collect();
    let side = |k: usize| rows.iter().map(|r| RECORD.opinions[r[k]].opinion.mos).collect::<Vec<_>>();
    let test = paired(&side(1), &side(0)).unwrap();
    assert!(rows.len() > 20 && test.interval.contains(OVERCAST_SHIFT), "{} {test:?}", rows.len());
    // The shift does not depend on type or method.
    let three = RECORD.anova_three_way.as_ref().expect("a three-way ANOVA");
    for with in ["material type", "method"] {
        assert!(three.term(&["illumination", with]).unwrap().p > 0.01, "{three:?}");
    }
    assert!(three.term(&["method"]).unwrap().p < 1e-6);
}

#[test]
fn material_types_differ_as_their_true_quality_does() {
    let types = RECORD.material_types.as_ref().expect("two types");
    assert_eq!(types.types, ["Dielectric", "Metal"]);
    let of = |name: &str| -> Vec<f64> {
        let rows = MADE.study.pairs.iter().zip(&MADE.quality);
        rows.filter(|(p, _)| p.material_type.as_deref() == Some(name)).map(|(_, q)| *q).collect()
    };
    let truth = mean(&of("Dielectric")) - mean(&of("Metal"));
    assert!((types.mos.difference - truth).abs() < 0.1, "{truth} {types:?}");
    assert!(types.by_material.unwrap().contains(types.mos.difference));
    let hidden = types.hidden_references.as_ref().expect("hidden references");
    assert!(hidden.p > 0.01, "{hidden:?}");
    let table = RECORD.anova_two_way.as_ref().expect("a two-way ANOVA");
    assert_eq!((table.rows, table.sums_of_squares.as_str()), (MADE.study.pairs.len(), "II"));
}

#[test]
fn records_are_the_same_for_a_seed_and_survive_json() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let again = one.install(|| describe(&SESSIONS.opinions, &Options::default())).unwrap();
    assert_eq!(again, *RECORD);
    let other = describe(&SESSIONS.opinions, &Options { seed: 2, ..Options::default() }).unwrap();
    assert_ne!(other.split_half, RECORD.split_half);
    let text = serde_json::to_string(&*RECORD).unwrap();
    assert_eq!(serde_json::from_str::<StudyRecord>(&text).unwrap(), *RECORD);
}

#[test]
fn what_a_study_lacks_is_named() {
    // One judgement fewer: the two-way form needs a complete design, everything else goes on.
    let mut opinions = SESSIONS.opinions.clone();
    if let Scores::Raw(raw) = &mut opinions.scores {
        raw.judgements.remove(0);
    }
    let record = describe(&opinions, &Options::default()).unwrap();
    let why = |record: &StudyRecord, what: &str| {
        record.missing.iter().find(|m| m.what.contains(what)).map(|m| m.why.clone()).unwrap_or_default()
    };
    assert!(why(&record, "ICC(2,1)").contains("observer-01 did not rate 1 of"), "{:?}", record.missing);
    assert!(record.intraclass_two_way.is_none() && record.intraclass_one_way.is_some());
    // Means alone.
    let means = RECORD.opinions.iter().map(|o| o.opinion.mos).collect();
    let record = describe(&StudyOpinions { scores: Scores::Means(means), ..opinions }, &Options::default()).unwrap();
    assert_eq!(record.spread, Spread::NoiseModel { a: 0.2, raters: 30 });
    for what in ["rater screening", "split-half", "intra-class", "SOS", "standard deviations by material type"] {
        assert!(why(&record, what).starts_with("only mean scores are given"), "{what}: {:?}", record.missing);
    }
    assert!(record.boxes.iter().all(|set| set.boxes.iter().all(|b| b.interval_width.is_none())));
    // The noise model expects what the panel shows.
    let found = RECORD.split_half.as_ref().unwrap().pearson.mean;
    assert!((record.expected_reliability.unwrap().split_half_pearson - found).abs() < 0.015);
}

/// The same panel stated on 0 to 100 and as DMOS: what has a unit follows the map, the rest is the same.
#[test]
fn statistics_agree_on_whichever_scale_the_panel_rated() {
    for (worst, best) in [(0.0, 100.0), (100.0, 0.0)] {
        let scale = RatingScale::new(worst, best).unwrap();
        let mut opinions = SESSIONS.opinions.clone();
        opinions.scale = scale;
        if let Scores::Raw(raw) = &mut opinions.scores {
            raw.judgements.iter_mut().for_each(|j| j.score = scale.score(j.score));
            for answer in &mut raw.gold {
                (answer.score, answer.expected) = (scale.score(answer.score), scale.score(answer.expected));
            }
        }
        let found = describe(&opinions, &Options::default()).unwrap();
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9 * (1.0 + b.abs());
        assert_eq!(found.scale, scale);
        assert_eq!(found.panel, RECORD.panel);
        for (a, b) in found.opinions.iter().zip(&RECORD.opinions) {
            assert!(near(a.opinion.mos, scale.score(b.opinion.mos)));
            assert!(near(a.opinion.deviation.unwrap(), scale.width(b.opinion.deviation.unwrap())));
            assert!(near(a.opinion.width().unwrap(), scale.width(b.opinion.width().unwrap())));
        }
        let split = |r: &StudyRecord| r.split_half.as_ref().unwrap().pearson.mean;
        assert!(near(split(&found), split(&RECORD)));
        let icc = |r: &StudyRecord| r.intraclass_two_way.as_ref().unwrap().single.value;
        assert!(near(icc(&found), icc(&RECORD)));
        let sos = |r: &StudyRecord| (r.sos.as_ref().unwrap().a, r.sos.as_ref().unwrap().rmse);
        assert!(near(sos(&found).0, sos(&RECORD).0) && near(sos(&found).1, scale.width(sos(&RECORD).1)));
        let types = |r: &StudyRecord| r.material_types.as_ref().unwrap().mos.clone();
        assert!(near(types(&found).t, scale.direction() * types(&RECORD).t));
        assert!(near(types(&found).difference, scale.difference(types(&RECORD).difference)));
        let effect = |r: &StudyRecord| r.anova_two_way.as_ref().unwrap().terms.iter().map(|t| t.f).collect::<Vec<_>>();
        assert!(effect(&found).iter().zip(effect(&RECORD)).all(|(a, b)| (a / b - 1.0).abs() < 1e-6));
        let boxes = |r: &StudyRecord| r.boxes.iter().flat_map(|set| set.boxes.clone()).collect::<Vec<_>>();
        assert_eq!(boxes(&found).len(), boxes(&RECORD).len());
        for (a, b) in boxes(&found).iter().zip(boxes(&RECORD)) {
            assert_eq!((&a.levels, a.mos.n, a.mos.outliers.len()), (&b.levels, b.mos.n, b.mos.outliers.len()));
            assert!(near(a.mos.median, scale.score(b.mos.median)) && near(a.mean, scale.score(b.mean)));
        }
        let text = vernis::report::study::text(&found);
        assert!(
            text.contains(&format!("{worst} is worst, {best} best.")) && text.contains("within 25.0 points"),
            "{text}"
        );
        assert!(text.contains("(x - 0)(100 - x)"), "{text}");
        // Means alone: the spread is assumed in the unit of the scale.
        let means = |r: &StudyRecord| r.opinions.iter().map(|o| o.opinion.mos).collect::<Vec<f64>>();
        let alone = |opinions: &StudyOpinions, means: Vec<f64>| {
            let opinions = StudyOpinions { scores: Scores::Means(means), ..opinions.clone() };
            describe(&opinions, &Options::default()).unwrap()
        };
        let (a, b) = (alone(&opinions, means(&found)), alone(&SESSIONS.opinions, means(&RECORD)));
        assert!(near(a.opinions[0].opinion.width().unwrap(), scale.width(b.opinions[0].opinion.width().unwrap())));
        let expected = |r: &StudyRecord| r.expected_reliability.unwrap().split_half_pearson;
        assert!(near(expected(&a), expected(&b)));
    }
}

/// A scale without a worst end has no curve of spread over means; the rest goes on.
#[test]
fn a_scale_without_a_worst_end_has_statistics_too() {
    let scale = RatingScale::new(0.0, 10.0).unwrap().opened();
    let means: Vec<f64> = RECORD.opinions.iter().map(|o| scale.score(o.opinion.mos)).collect();
    let opinions = StudyOpinions { scores: Scores::Means(means.clone()), scale, ..SESSIONS.opinions.clone() };
    let record = describe(&opinions, &Options::default()).unwrap();
    assert_eq!((record.spread, record.opinions[0].opinion.mos), (Spread::Unknown, means[0]));
    assert!(record.expected_reliability.is_none() && record.material_types.is_some() && !record.boxes.is_empty());
    let text = vernis::report::study::text(&record);
    assert!(text.contains("10 is best; the scale has no worst end") && text.contains("no spread is assumed"), "{text}");
}

#[test]
fn ratings_on_other_scales_are_described_and_reported() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(dir.path().join(name), text).unwrap();
    let rows = |column: &str, scores: [f64; 4]| {
        let row = |(i, s): (usize, &f64)| format!("a{}.json,b{i}.json,{s},m{0},GGX\n", i / 2);
        let rows: String = scores.iter().enumerate().map(row).collect();
        format!("reference,candidate,{column},material,method\n{rows}")
    };
    write("percent.csv", &rows("mos", [82.0, 61.0, 20.0, 45.5]));
    write("dmos.csv", &rows("dmos", [1.2, 7.1, 4.0, 2.5]));
    write("raw.csv", "participant,material,method,score\np,m,A,40\nq,m,A,20\np,n,A,60\nq,n,A,90\n");
    write("raw.toml", "file = \"raw.csv\"\nscale = {worst = 0, best = 100}\n");
    let undeclared = run(dir.path(), &["--study", "percent.csv"]);
    let error = String::from_utf8(undeclared.stderr).unwrap();
    assert_eq!((undeclared.status.code(), error.lines().count()), (Some(2), 1), "{error}");
    assert!(
        error.contains("percent.csv, line 2: mos is `82`; it must be 1 (very poor) to 5 (excellent); if the study uses another scale, say so: --scale worst=0,best=100"),
        "{error}"
    );
    for (args, expected) in [
        (&["--study", "percent.csv", "--scale", "worst=0,best=100"][..], "0 is worst, 100 best."),
        (&["--study", "dmos.csv"], "0 is best; the scale has no worst end: 8 stands for it, the worst rating"),
        (&["--ratings", "raw.csv", "--scale", "worst=0,best=100"], "0 is worst, 100 best."),
        (&["--ratings", "raw.toml"], "0 is worst, 100 best."),
    ] {
        let output = run(dir.path(), args);
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success() && text.contains(expected), "{args:?}: {text}");
    }
    let found = run(dir.path(), &["--study", "percent.csv", "--scale", "worst=0,best=100", "--json"]);
    let found: serde_json::Value = serde_json::from_slice(&found.stdout).unwrap();
    assert_eq!(found["scale"], serde_json::json!({"worst": 0.0, "best": 100.0}));
    assert_eq!(found["opinions"][3]["mos"], 45.5);
    assert!(found["command"].as_str().unwrap().contains("--scale worst=0,best=100"), "{found}");
    for (args, expected) in [
        (
            &["--study", "synthetic", "--scale", "dmos"][..],
            "study synthetic declares its own scale, 1 (very poor) to 5",
        ),
        (&["--scale", "dmos"], "neither --study nor --ratings was given"),
        (&["--study", "percent.csv", "--scale", "0-100"], "such as worst=0,best=100"),
        (
            &["--ratings", "raw.toml", "--scale", "jod"],
            "raw.toml: it declares the scale worst=0,best=100, and --scale is jod",
        ),
        (&["--study", "dmos.csv", "--scale", "worst=0,best=10"], "column `dmos` is on the scale worst=0,best=10"),
    ] {
        let output = run(dir.path(), args);
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{args:?}: {error}");
        assert!(error.contains(expected) && output.stdout.is_empty(), "{args:?}: {error}");
    }
}

#[test]
fn a_panel_of_which_nobody_is_left_is_an_error() {
    let mut opinions = SESSIONS.opinions.clone();
    if let Scores::Raw(raw) = &mut opinions.scores {
        raw.judgements.iter_mut().for_each(|j| j.seconds = Some(0.1));
        raw.gold.clear();
    }
    let error = describe(&opinions, &Options::default()).unwrap_err();
    assert_eq!(error, StudyError::AllRejected { left: 0, participants: 33 });
    let kept = describe(&opinions, &Options { rejecting: vec![], ..Options::default() }).unwrap();
    assert_eq!(kept.panel.unwrap().participants, 33);
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn published_means_give_what_scipy_and_statsmodels_give() {
    let data = data_folder();
    let opinions = StudyOpinions::load("lavoue2021", Some(Path::new(&data))).unwrap();
    let record = describe(&opinions, &Options::default()).unwrap();
    let (types, table) = (record.material_types.clone().unwrap(), record.anova_two_way.clone().unwrap());
    let interaction = table.term(&["material type", "method"]).unwrap();
    // Section 5.3 of the paper: types differ, and the interaction is significant with p < 0.001.
    assert!(types.mos.difference > 0.0 && types.mos.p < 0.05 && interaction.p < 1e-3);
    // Sections 5.2: split halves 0.964 (SD 0.001) and ICC 0.981, which the noise model has to come near to.
    let reliability = record.expected_reliability.unwrap();
    assert!((reliability.split_half_pearson - 0.964).abs() < 0.008, "{reliability:?}");
    assert!((reliability.signal - 0.981).abs() < 0.004, "{reliability:?}");
    // Figures 9 and 10: nine models, of which section 5.5 counts the parameters, and neither manifold nor rational functions.
    let by_model = record.boxes.iter().find(|set| set.title == vernis::panel::BY_MODEL).unwrap();
    let names: Vec<&str> = by_model.boxes.iter().map(|b| b.levels[0].as_str()).collect();
    assert_eq!(names, ["ABC", "BAGHER", "BECKMAN", "BLINN-PHONG", "DUPUY", "GGX", "LAFORTUNE", "SGD", "WARD"]);
    let models = record.models.as_ref().unwrap();
    assert_eq!((models.pairs.len(), models.models[0].as_str()), (36, "BAGHER"));
    // Section 5.5: p < 1e-9 for all comparisons with Bagher's model, on all 100 materials.
    assert!(models.pairs.iter().filter(|pair| pair.models[0] == "BAGHER").all(|pair| pair.holm_p < 1e-6), "{models:?}");
    let page = vernis::report::study::markdown(&record);
    for row in ["| SGD | SGD | 33 |", "| Bagher et al. | BAGHER | - |", "| Lafortune | LAFORTUNE | 9 |"] {
        assert!(page.contains(row), "{row}: {page}");
    }
    if record.found == 1638 {
        // numpy: corrcoef((i/6)^5, MOS) of the 510 samples. The paper has 0.90 in size, of 600.
        let found = record.manifold.unwrap();
        assert!((found.pearson + 0.8899697416464492).abs() < 1e-9 && found.stimuli == 510, "{found:?}");
        // 85 of the 100 materials. scipy 1.17.1: ttest_ind(dielectric, metal, equal_var=False); statsmodels 0.15.0:
        // anova_lm(ols("mos ~ C(Type,Sum)*C(METHOD,Sum)", d).fit(), typ=2)
        assert!((types.mos.t - 2.424502076163892).abs() < 1e-9 && (types.mos.p - 0.015617491704844663).abs() < 1e-9);
        assert!((interaction.f - 12.984414).abs() < 1e-6 && interaction.freedom == 20);
        assert!((interaction.p / 4.789701e-40 - 1.0).abs() < 1e-5, "{}", interaction.p);
        assert!((table.term(&["method"]).unwrap().sum_of_squares - 728.342285).abs() < 1e-6);
    }
}

/// Runs the program in `folder` without a data folder.
fn run(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
    command.arg("study").args(args).current_dir(folder).env_remove("VERNIS_DATA").env_remove("VERNIS_CACHE");
    command.output().expect("the program starts")
}

/// Ratings that are said to be of a study and say something else are named, with their materials and methods.
#[test]
fn ratings_that_contradict_their_study_are_named() {
    let place = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(place.path().join(name), text).expect("writable");
    let pairs = |mos: [f64; 2]| {
        let [ggx, ward] = mos;
        write(
            "pairs.csv",
            &format!(
                "reference,candidate,material,method,mos\na.binary,b.binary,chalk,GGX,{ggx}\na.binary,c.binary,chalk,WARD,{ward}\n\
                 d.binary,e.binary,slate,GGX,{ggx}\nd.binary,f.binary,slate,WARD,{ward}\n"
            ),
        );
    };
    let mut rows = "participant,material,method,score\n".to_owned();
    for (participant, offset) in [("p", 0), ("q", 1), ("r", 2)] {
        for material in ["chalk", "slate"] {
            rows +=
                &format!("{participant},{material},GGX,{}\n{participant},{material},WARD,{}\n", 1 + offset, 3 + offset);
        }
    }
    write("raw.csv", &rows);
    let said = || {
        let output = run(place.path(), &["--study", "pairs.csv", "--ratings", "raw.csv", "--reject", "none"]);
        String::from_utf8(output.stderr).expect("UTF-8")
    };
    pairs([2.0, 4.1]);
    assert!(!said().contains("contradicts"), "{}", said());
    pairs([2.0, 3.2]);
    assert!(said().contains("--ratings contradicts the study pairs.csv on 2 of 4 pairs, by more than 0.25 grades: chalk, WARD: 4.00 is the mean of 3"), "{}", said());
    write("raw.csv", &rows.replace("chalk", "basalt").replace("slate", "quartz"));
    assert!(
        said().contains("raw.csv contradicts the study pairs.csv: no pair of material and method is in both"),
        "{}",
        said()
    );
}

/// Two materials of two types, two methods and hidden references, three participants, two illuminations.
fn ratings() -> String {
    let mut text = "who,BRDF,type,model,light,answer,time,control,note\n".to_owned();
    for (p, who) in ["ann", "bob", "cid"].iter().enumerate() {
        for (m, (material, kind)) in
            [("chalk", "Dielectric"), ("gold", "Metal"), ("clay", "Dielectric"), ("tin", "Metal")].iter().enumerate()
        {
            for (k, model) in ["GGX", "WARD", "REFERENCE"].iter().enumerate() {
                for (l, light) in ["grace", "uffizi"].iter().enumerate() {
                    let score = 1 + (p * 2 + m * 3 + k * 2 + l + p * m * k) % 5;
                    text += &format!("{who},{material},{kind},{model},{light},{score},2.5,,\"a, b\"\n");
                }
            }
        }
        text += &format!("{who},x,,y,grace,{},2,5,\n", if p == 2 { 1 } else { 5 });
    }
    text
}

const LAYOUT: &str = "file = \"export.csv\"\n[columns]\nparticipant = \"who\"\nmaterial = \"BRDF\"\nmethod = \"model\"\n\
    score = \"answer\"\nillumination = \"light\"\nseconds = \"time\"\ngold = \"control\"\nmaterial_type = \"type\"\n";

#[test]
fn the_command_reports_raw_ratings_of_a_users_own() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("export.csv"), ratings()).unwrap();
    fs::write(dir.path().join("mine.toml"), LAYOUT).unwrap();
    let output = run(dir.path(), &["--ratings", "mine.toml", "--out", "o"]);
    let (text, error) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!((output.status.code(), error.as_str()), (Some(0), ""));
    assert!(
        text.starts_with("Ratings of export.csv\n24 stimuli of 4 materials and 3 methods, under grace and uffizi"),
        "{text}"
    );
    assert!(
        text.contains("48 judgements of 2 participants, of 3 who took part") && text.contains("Rejected: cid."),
        "{text}"
    );
    assert!(!text.contains("SYNTHETIC"), "{text}");
    let record: StudyRecord =
        serde_json::from_str(&fs::read_to_string(dir.path().join("o/study.json")).unwrap()).unwrap();
    assert_eq!(record.command, "vernis study --ratings mine.toml --reject gold,time --seed 1");
    assert_eq!((record.panel.unwrap().participants, record.data.len()), (2, 1));
    let page = fs::read_to_string(dir.path().join("o/study.md")).unwrap();
    assert!(page.contains("# Ratings of export") && page.contains("SHA-256"), "{page}");
    // The same seed, the same bytes; nobody rejected, another panel.
    let json = |args: &[&str]| String::from_utf8(run(dir.path(), args).stdout).unwrap();
    let base = ["--ratings", "mine.toml", "--json"];
    assert_eq!(json(&base), fs::read_to_string(dir.path().join("o/study.json")).unwrap());
    let all: StudyRecord = serde_json::from_str(&json(&[&base[..], &["--reject", "none"]].concat())).unwrap();
    assert_eq!(all.panel.unwrap().participants, 3);
}

#[test]
fn the_command_marks_simulated_ratings() {
    let dir = tempfile::tempdir().unwrap();
    let output = run(dir.path(), &[]);
    let (text, error) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!(output.status.code(), Some(0), "{error}");
    assert!(text.starts_with("Ratings of synthetic (SYNTHETIC)\nSYNTHETIC observers"), "{text}");
    assert!(error.contains("For human ratings name a data folder"), "{error}");
    assert!(fs::read_to_string(dir.path().join("out/synthetic/study.md")).unwrap().contains("SYNTHETIC observers"));
}

#[test]
fn wrong_input_is_told_in_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(dir.path().join(name), text).unwrap();
    write("score.csv", "participant,material,method,score\na,m,S,7\n");
    write("one.csv", "participant,material,method,score\na,m,S,3\na,n,S,4\n");
    write("fast.csv", "participant,material,method,score,seconds\na,m,S,3,.1\nb,m,S,4,.1\n");
    write("good.csv", "participant,material,method,score\na,m,S,3\nb,m,S,4\n");
    write("file", "");
    fs::create_dir_all(dir.path().join("data/lavoue2021")).unwrap();
    write("data/lavoue2021/PerceptualDistances.csv", "METHOD;BRDF;DISTANCE\nSGD;teflon;2\n");
    write("data/lavoue2021/MaterialType.csv", "BRDF;Type\nteflon;Dielectric\n");
    for (args, expected) in [
        (&["--ratings", "none.csv"][..], "none.csv"),
        (&["--ratings", "score.csv"], "score.csv, line 2: score is `7`; it must be 1 (very poor) to 5 (excellent)"),
        (&["--ratings", "one.csv"], "one.csv: all scores are of one participant, a; there must be at least 2"),
        (
            &["--ratings", "fast.csv"],
            "fast.csv: screening rejects all but 0 of 2 participants; it must leave at least 2",
        ),
        (&["--ratings", "good.csv", "--reject", "none,gold"], "--reject is none,gold; it must be none alone"),
        (&["--ratings", "good.csv", "--out", "file/x"], "file/x: cannot write there"),
        (&["--study", "lavoue2022"], "unknown study `lavoue2022`"),
        (&["--study", "lavoue2021"], "needs a data folder"),
        // Ratings that are there and wrong are not replaced by simulated ones.
        (&["--data", "data"], "PerceptualDistances.csv, line 2: DISTANCE is `2`"),
    ] {
        let output = run(dir.path(), args);
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), error.lines().count()), (Some(2), 1), "{args:?}: {error}");
        assert!(error.contains(expected) && output.stdout.is_empty(), "{args:?}: {error}");
    }
    // As little as it can be: no statistic but the mean exists, and that is said.
    let output = run(dir.path(), &["--ratings", "good.csv"]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && text.contains("split-half agreement: the number of stimuli"), "{text}");
}
