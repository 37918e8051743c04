//! The experiment on losses: metrics that have not seen a material, fits that are judged, runs that go on where they stopped.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Mutex;
use vernis::dataset::Study;
use vernis::descriptor::{DescriptorSet, Setup};
use vernis::experiment::ExperimentError;
use vernis::experiment::losses::Loss;
use vernis::experiment::losses::compare::Verdict;
use vernis::experiment::losses::record::LossesRecord;
use vernis::experiment::losses::run::{Experiment, FitRecord, Probe, Settings, materials};
use vernis::experiment::losses::unseen::{Lesson, Role, UnseenMetrics, UnseenTraining};
use vernis::image::metric::Conditions;
use vernis::image::stimulus;
use vernis::metric::registry::Registry;
use vernis::report::losses;
use vernis::samples::extraction::Extractor;
use vernis::train::kernel::KernelRidge;

/// Those that need no pass over all cells of the Lp metrics.
const LOSSES: [Loss; 3] = [Loss::Transport, Loss::Learned, Loss::Blended];

/// Six materials, each a GGX surface, with candidates that are ever rougher and ever worse. The last two are sisters.
fn study(folder: &Path) -> Study {
    let mut rows = "reference,candidate,material,group,method,mos\n".to_owned();
    for m in 0..6 {
        let group = if m < 4 { format!("group{m}") } else { "sisters".to_owned() };
        let alpha = 0.1 + 0.05 * f64::from(m);
        let write = |name: &str, alpha: f64| {
            let text = format!(r#"{{"model":"ggx","kd":[0.2,0.{m}5,0.1],"f0":[0.05,0.05,0.05],"alpha":{alpha}}}"#);
            std::fs::write(folder.join(name), text).expect("writable");
        };
        write(&format!("m{m}.json"), alpha);
        for (k, (factor, mos)) in [(1.05, 4.4), (1.5, 3.2), (3.0, 1.6)].into_iter().enumerate() {
            write(&format!("m{m}-{k}.json"), (factor * alpha).min(1.0));
            rows += &format!("m{m}.json,m{m}-{k}.json,m{m},{group},method{k},{mos}\n");
        }
    }
    std::fs::write(folder.join("pairs.csv"), rows).expect("writable");
    Study::load(folder.join("pairs.csv").to_str().expect("UTF-8"), None).expect("a study")
}

/// A folder, and the names of what was written to it.
struct Kept<'a> {
    folder: &'a Path,
    written: Mutex<Vec<String>>,
}

impl<'a> Kept<'a> {
    fn new(folder: &'a Path) -> Self {
        Self { folder, written: Mutex::new(Vec::new()) }
    }

    fn write(&self, name: &str, text: &str) -> Result<(), ExperimentError> {
        std::fs::write(self.folder.join(name), text).expect("writable");
        self.written.lock().expect("no panic").push(name.to_owned());
        Ok(())
    }

    fn take(&self) -> BTreeSet<String> {
        std::mem::take(&mut *self.written.lock().expect("no panic")).into_iter().collect()
    }
}

fn train(study: &Study, kept: &Kept<'_>) -> UnseenMetrics {
    trained(study, kept, 1).expect("metrics")
}

/// Those to fit with, and those that judge.
const ROLES: [Role; 2] = [Role::Metric, Role::Judge];

fn trained(study: &Study, kept: &Kept<'_>, seed: u64) -> Result<UnseenMetrics, ExperimentError> {
    let (set, setup) = (DescriptorSet::with_norms(), Setup::standard());
    let extractor = Extractor { set: &set, setup: &setup, metrics: &[], base: None, cache: None, progress: &|_| () };
    let samples = extractor.extract(study).expect("descriptors").samples;
    let trainer = KernelRidge::nystroem(8);
    let lesson =
        |role| Lesson { role, samples: samples.clone(), setup: setup.clone(), set: set.clone(), trainer: &trainer };
    let training = UnseenTraining {
        study,
        lessons: &ROLES.map(lesson),
        folds: 2,
        seed,
        folder: kept.folder,
        write: &|name, text| kept.write(name, text),
        progress: &|_, _| (),
    };
    training.run()
}

fn settings() -> Settings {
    Settings {
        models: vec!["blinn-phong".to_owned()],
        losses: LOSSES.to_vec(),
        coarsening: 12,
        max_evaluations: 30,
        transport: "ot[grid=4x4x8]".to_owned(),
        energy: "energy[grid=4x4x8]".to_owned(),
        seed: 1,
        folds: 2,
        images: BTreeMap::from([("lamps.cielab".to_owned(), images("cielab"))]),
    }
}

fn images(metric: &str) -> String {
    format!("stimulus[{metric},light=lamps,shape=sphere,size=16x24,samples=2,bounces=2]")
}

fn registry() -> Registry {
    stimulus::registry(None, Conditions::default()).expect("a registry")
}

#[test]
fn an_experiment_goes_on_where_it_stopped_and_judges_with_what_has_not_seen_the_material() {
    let dir = tempfile::tempdir().expect("a folder");
    let study = study(dir.path());
    let kept = Kept::new(dir.path());
    let unseen = train(&study, &kept);
    assert_eq!(kept.take().len(), 4, "two metrics for each of two folds");
    for pair in &study.pairs {
        let [loss, judge] = ROLES.map(|role| unseen.of(role, &pair.material).expect("a material").exported());
        for provenance in [&loss.provenance, &judge.provenance] {
            let unseen = provenance.command.strip_prefix("without ").expect("what was left out");
            assert!(unseen.split(", ").any(|group| group == pair.group), "{}: {unseen}", pair.material);
        }
        assert_ne!(loss.provenance.seed, judge.provenance.seed);
    }
    assert!(unseen.of(Role::Judge, "m9").is_none() && unseen.of(Role::Distance, "m1").is_none());
    train(&study, &kept);
    assert_eq!(kept.take().len(), 0, "metrics are kept");

    // One material a group, and the first ones stay the same when more are asked for.
    let all = materials(&study, 10, 1);
    assert_eq!(all.len(), 5);
    let two = &all[..2];
    assert_eq!(materials(&study, 2, 1).iter().map(|m| &m.0).collect::<Vec<_>>(), [&all[0].0, &all[1].0]);

    let settings = settings();
    let probes = [Probe { name: "lamps".to_owned(), setup: Setup::standard() }];
    let try_run = |unseen: &UnseenMetrics, settings: &Settings, only_kept: bool| {
        let experiment = Experiment {
            registry: &registry(),
            study: &study,
            settings,
            unseen,
            probes: &probes,
            base: None,
            folder: kept.folder,
            write: &|name, text| kept.write(name, text),
            progress: &|_| (),
            warn: &|warning| panic!("{warning}"),
        };
        experiment.run(two, only_kept)
    };
    let run = |unseen: &UnseenMetrics, only_kept: bool| -> Vec<Vec<FitRecord>> {
        try_run(unseen, &settings, only_kept).expect("fits")
    };
    assert!(run(&unseen, true).is_empty(), "nothing is finished");
    let first = run(&unseen, false);
    assert_eq!(kept.take().len(), 6);
    // A fit that is missing is made again, alone, and is the same.
    let lost = format!("{}.blinn-phong.vernis-blended.json", two[1].0);
    std::fs::remove_file(dir.path().join(&lost)).expect("a file of the first run");
    assert_eq!(run(&unseen, true).len(), 1, "of two materials one is finished");
    assert_eq!(run(&unseen, false), first);
    assert_eq!(kept.take(), BTreeSet::from([lost]));
    // Fits and metrics of other settings are refused with what differs, and left alone.
    let other = Settings { seed: 2, coarsening: 9, ..settings.clone() };
    let error = try_run(&unseen, &other, true).expect_err("of another run").to_string();
    assert!(
        error.contains(
            "is the result of another run: coarsening is 12 there and 9 here, seed is 1 there and 2 here; choose"
        ),
        "{error}"
    );
    let error = trained(&study, &kept, 2).err().expect("of another run").to_string();
    assert!(error.contains(".vernis.json is the result of another run: seed is 1 there and 2 here"), "{error}");
    assert!(kept.take().is_empty());
    // Other metrics on stimuli judge the kept fits again, and nothing is fitted.
    let others = BTreeMap::from([("lamps.flip".to_owned(), images("flip"))]);
    let judged = try_run(&unseen, &Settings { images: others, ..settings.clone() }, false).expect("judged");
    assert_eq!(kept.take().len(), 6);
    for (before, after) in first.iter().flatten().zip(judged.iter().flatten()) {
        assert_eq!(before.fit, after.fit);
        assert!(after.judged.contains_key("lamps.flip") && !after.judged.contains_key("lamps.cielab"));
        assert_eq!(before.judged["energy"], after.judged["energy"]);
    }
    assert!(run(&unseen, true).is_empty(), "none is judged as asked");
    for record in first.iter().flatten() {
        let judges: Vec<&str> = record.judged.keys().map(String::as_str).collect();
        let expected =
            ["D1", "D4.Cl", "D4.Cl.CR", "D9.Cl", "energy", "lamps.cielab", "lamps.log", "lamps.screen", "mos", "ot"];
        assert_eq!(judges, expected);
        assert!(record.judged.values().all(|v| v.is_finite() && *v >= 0.0));
        let expected = match (record.loss.role(), record.loss) {
            (Some(role), _) => unseen.of(role, &record.material).expect("a material").exported().name.as_str(),
            (None, Loss::Transport) => settings.transport.as_str(),
            (None, loss) => loss.name(),
        };
        assert_eq!(record.fit.metric.name, expected);
        // What the fit minimised and what the judge of that name says are the same number.
        if record.loss == Loss::Transport {
            assert!((record.judged["ot"] / record.fit.value - 1.0).abs() < 1e-9);
        }
    }

    // A baseline is made by hand: twice the distances of transport.
    let mut records = first;
    for all in &mut records {
        let mut baseline = all[0].clone();
        baseline.loss = Loss::Square;
        baseline.judged.values_mut().for_each(|v| *v *= 2.0);
        all.push(baseline);
    }
    let record = LossesRecord::new(&study, &settings, &records, 100).expect("a record");
    let (baseline, comparisons) = &record.pooled[0];
    let energy = comparisons.iter().find(|c| c.loss == Loss::Transport && c.judge == "energy").expect("a comparison");
    assert_eq!((*baseline, energy.wins), (Loss::Square, 2));
    // 200 (1 - 2) / (1 + 2), without any spread; two materials decide nothing all the same.
    assert!((energy.difference.difference + 200.0 / 3.0).abs() < 1e-9, "{energy:?}");
    assert_eq!(energy.verdict, Verdict::Undecided);
    let text = losses::markdown(&record, "vernis experiment losses");
    let nothing = "**These tables can decide nothing**: with 2 materials and ";
    for expected in
        [nothing, "## In short", "**Blending ", "| judge | ot | vernis | vernis-blended |", "\n* Materials: "]
    {
        assert!(text.contains(expected), "{expected} is missing in\n{text}");
    }
    assert!(LossesRecord::new(&study, &settings, &records[..1], 100).is_err(), "one material has no interval");
}
