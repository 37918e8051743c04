//! Metrics that somebody asks for beside those that always take part in a benchmark.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use vernis::dataset::Study;
use vernis::descriptor::Cache;
use vernis::experiment::further::Further;
use vernis::image::metric::Conditions;
use vernis::image::stimulus;
use vernis::metric::Metric;
use vernis::samples::further::further;

const SMALL: &str = "light=lamps,shape=sphere,size=16x24,samples=2,bounces=1";

fn metrics(names: &[&str]) -> Vec<Arc<dyn Metric>> {
    let registry = stimulus::registry(None, Conditions::default()).unwrap();
    names.iter().flat_map(|name| registry.resolve(name).unwrap()).collect()
}

/// Two references with two candidates each.
fn study(folder: &Path) -> Study {
    let mut rows = "reference,candidate,material,mos\n".to_owned();
    for m in 0..2 {
        for (k, alpha) in [0.1, 0.2, 0.4].into_iter().enumerate() {
            let text = format!(r#"{{"model":"ggx","kd":[0.2,0.{m}5,0.1],"f0":[0.05,0.05,0.05],"alpha":{alpha}}}"#);
            std::fs::write(folder.join(format!("m{m}-{k}.json")), text).unwrap();
        }
        rows += &format!("m{m}-0.json,m{m}-1.json,m{m},4.1\nm{m}-0.json,m{m}-2.json,m{m},2.2\n");
    }
    std::fs::write(folder.join("pairs.csv"), rows).unwrap();
    Study::load(folder.join("pairs.csv").to_str().unwrap(), None).unwrap()
}

#[test]
fn metrics_that_take_part_anyway_are_not_asked_for_twice_and_learned_ones_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let study = study(dir.path());
    let kept = |names: &[&str]| Further::new(metrics(names), &study).map_err(|e| e.to_string());
    let names = |further: &Further| further.metrics().iter().map(|m| m.name().to_owned()).collect::<Vec<_>>();
    let found = kept(&["D9.Cl", "stimulus[ssim]", "all-lp", "ot", "stimulus[ssim]", "mmd-gaussian"]).unwrap();
    assert_eq!(names(&found), ["stimulus[ssim]", "mmd-gaussian"]);
    let error = kept(&["vernis"]).unwrap_err();
    assert!(error.contains("vernis cannot be judged: it was learned from ratings"), "{error}");
    assert!(names(&Further::default()).is_empty());
}

#[test]
fn distances_are_those_of_the_metrics_and_kept_one_by_one() {
    let dir = tempfile::tempdir().unwrap();
    let study = study(dir.path());
    let cache = Cache::open(&dir.path().join("cache")).unwrap();
    let files = || {
        let entries = std::fs::read_dir(dir.path().join("cache")).unwrap();
        entries.map(|entry| entry.unwrap().file_name()).collect::<BTreeSet<_>>()
    };
    let ssim = format!("stimulus[ssim,{SMALL}]");
    let first = metrics(&[&ssim, "D5"]);
    let (samples, warnings) = further(&study, &first, None, Some(&cache), &|_| ()).unwrap();
    assert!(warnings.is_empty());
    for (row, pair) in study.pairs.iter().enumerate() {
        let [reference, candidate] = [&pair.reference, &pair.candidate].map(|source| source.open(None).unwrap());
        for (column, metric) in first.iter().enumerate() {
            let expected = metric.distance(&*reference.brdf, &*candidate.brdf).unwrap();
            assert_eq!(samples.features()[[row, column]], expected, "{} of row {row}", metric.name());
        }
    }
    // Eight distances and six pictures; another metric on the same pictures adds its distances alone, and nothing is made twice.
    let before = files();
    assert_eq!(before.len(), 8 + 6);
    let more = metrics(&["D5", &format!("stimulus[flip,{SMALL}]"), &ssim]);
    let (again, _) = further(&study, &more, None, Some(&cache), &|_| ()).unwrap();
    assert_eq!(files().difference(&before).count(), 4);
    assert_eq!(again.features().column(0), samples.features().column(1));
    assert_eq!(again.features().column(2), samples.features().column(0));
    let (whole, _) = further(&study, &more, None, None, &|_| ()).unwrap();
    assert_eq!(whole.features(), again.features());
}
