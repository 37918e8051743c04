//! Studies from files, and what the embedded one promises.

use crate::data_folder;
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use vernis::brdf::BrdfSource;
use vernis::dataset::inventory::FileState;
use vernis::dataset::manifest::{Manifest, NAMES};
use vernis::dataset::{Completeness, DatasetError, Study, inventory};
use vernis::descriptor::{Column, Role};
use vernis::samples::Samples;
use vernis::samples::split::{grouped_folds, method_and_group_folds};

fn message<T>(result: Result<T, DatasetError>) -> String {
    result.err().map(|e| e.to_string()).unwrap_or_default()
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn the_open_study_rebuilds_what_the_ratings_hold() {
    let data = data_folder();
    let study = Study::load("lavoue2021-open", Some(&data)).unwrap();
    assert!(!study.synthetic);
    let mut by_method: BTreeMap<&str, usize> = BTreeMap::new();
    study.pairs.iter().for_each(|p| *by_method.entry(&p.method).or_default() += 1);
    let materials = study.pairs.iter().map(|p| p.material.as_str()).collect::<BTreeSet<_>>().len();
    assert_eq!(study.completeness.known, 858);
    assert_eq!(study.completeness.found, study.pairs.len());
    for method in ["SGD", "ABC", "BAGHER", "DUPUY", "GGX", "BECKMAN"] {
        assert_eq!(by_method[method], materials, "{method}");
    }
    let families: BTreeSet<&str> = study.pairs.iter().map(|p| p.method_family.as_str()).collect();
    assert_eq!((by_method.len(), families.len()), (9, 7));
    // The sets of rows part the study.
    let rows: Vec<_> = study.pairs.iter().map(|p| p.row()).collect();
    let sets: Vec<usize> =
        study.row_sets().unwrap().iter().map(|set| rows.iter().filter(|row| set.has(row)).count()).collect();
    assert_eq!((sets.iter().sum::<usize>(), sets[1]), (rows.len(), 3 * materials));
    // The extract that the project is developed on has 85 materials, 73 of them with the fits of Ngan et al. 2005.
    if materials == 85 {
        assert_eq!(study.completeness, Completeness { found: 85 * 3 + 73 * 3 + 85 * 3, known: 858 });
        assert_eq!(sets, [474, 255]);
        assert_eq!((by_method["WARD"], by_method["BLINN-PHONG"], by_method["LAFORTUNE"]), (73, 73, 73));
    }
    study.validate(10).unwrap();
    assert!(study.pairs.iter().all(|p| p.material_type.is_some() && (1.0..=5.0).contains(&p.mos)));
    let weights: BTreeMap<&str, f64> = study.pairs.iter().map(|p| (p.material.as_str(), p.weight)).collect();
    assert!(weights["steel"] < 0.35 && weights["teflon"] == 1.0);
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn every_source_of_the_open_study_opens() {
    let data = data_folder();
    let study = Study::load("lavoue2021-open", Some(&data)).unwrap();
    let mut contents = BTreeSet::new();
    for p in &study.pairs {
        let candidate = p.candidate.open(Some(&data)).unwrap_or_else(|e| panic!("{e}"));
        contents.insert((p.method.clone(), candidate.content));
    }
    // No two pairs share a candidate.
    assert_eq!(contents.len(), study.pairs.len());
    for material in ["teflon", "steel", "gold-metallic-paint2"] {
        let pair = study.pairs.iter().find(|p| p.material == material).unwrap();
        pair.reference.open(Some(&data)).unwrap_or_else(|e| panic!("{e}"));
    }
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn manifests_pin_the_files_that_are_here() {
    let data = data_folder();
    for name in NAMES {
        for file in Manifest::embedded(name).unwrap().files().into_iter().filter(|f| !f.extract_allowed) {
            let bytes = fs::read(data.join(&file.path)).unwrap();
            let sha256: String = Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect();
            assert_eq!((&file.sha256, file.bytes), (&sha256, Some(bytes.len() as u64)), "{}", file.path);
        }
    }
    let open = inventory(Some(&data)).into_iter().find(|s| s.name == "lavoue2021-open").unwrap();
    assert!(open.loads());
    assert_eq!(open.pairs.known, 858);
    assert!(open.files.iter().all(|f| matches!(f.state, FileState::AsPublished | FileState::Extract)));
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn the_full_study_without_tables_says_what_to_get() {
    let data = data_folder();
    let text = message(Study::load("lavoue2021", Some(&data)));
    // The folder that the project is developed on has ratings and no tables.
    if !text.is_empty() {
        assert!(text.contains("zenodo.org/records/8101681") && !text.contains('\n'), "{text}");
    }
}

#[test]
fn a_csv_file_round_trips_through_the_loader() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("mine.csv");
    fs::write(dir.path().join("ref.json"), r#"{"model":"lambert","kd":[0.2,0.2,0.2]}"#).unwrap();
    let rows = "reference,candidate,mos,weight,material,group,method,method_family,material_type\n\
                ref.json,a.binary,4.25,0.5,chalk,stones,GGX-2,GGX,Dielectric\n\
                ref.json,\"with, comma.binary\",1,1,slate,stones,WARD,,\n\
                x.zip:gold,npf.bin:gold,2,3,gold,,,,Metal\n";
    fs::write(&path, rows).unwrap();
    let study = Study::load(path.to_str().unwrap(), None).unwrap();
    assert_eq!((study.name.as_str(), study.short_name().as_str()), ("mine.csv", "mine"));
    assert_eq!((study.synthetic, study.pairs.len()), (false, 3));
    assert_eq!(study.completeness, Completeness { found: 3, known: 3 });
    let row = study.pairs[0].row();
    assert_eq!((row.mos, row.weight), (4.25, 0.5));
    assert_eq!([&row.material, &row.group, &row.method, &row.method_family], ["chalk", "stones", "GGX-2", "GGX"]);
    assert_eq!(study.pairs[1].method_family, "WARD");
    assert_eq!((study.pairs[2].group.as_str(), study.pairs[2].method.as_str()), ("gold", "unnamed"));
    assert_eq!(study.groups(), 2);
    assert!(study.row_sets().unwrap().is_empty());
    study.pairs[0].reference.open(None).unwrap();
    let BrdfSource::Notation(comma) = &study.pairs[1].candidate else { panic!("a CSV holds notations") };
    assert_eq!(comma, "with, comma.binary");
    assert!(message(study.validate(3)).contains("2 groups of materials; 3 folds need at least 3"));
}

#[test]
fn a_bad_csv_file_is_one_message_with_its_line() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("bad.csv");
    let load = |text: &str| {
        fs::write(&path, text).unwrap();
        message(Study::load(path.to_str().unwrap(), None))
    };
    for (text, expected) in [
        ("", "column `reference` is missing"),
        ("reference,candidate,mos\n", "has no row"),
        ("reference,candidate,mos\na.binary,b.binary,4\na.binary,c.binary\n", "line 3: the number of fields is 2"),
        ("reference,candidate,mos\na.binary,b.binary,six\n", "line 2: mos is `six`; it must be 1 (very poor) to 5"),
        ("reference,candidate,mos\na.binary,b.docx,4\n", "line 2: candidate: `b.docx` is not a BRDF source"),
    ] {
        let found = load(text);
        assert!(found.contains("bad.csv") && found.contains(expected) && !found.contains('\n'), "{found}");
    }
    let missing = message(Study::load("no/such/file.csv", None));
    assert!(missing.contains("no/such/file.csv"), "{missing}");
}

#[test]
fn ratings_of_a_folder_become_the_open_study() {
    // A folder with two materials: only files that the loader itself reads need content.
    let dir = tempfile::tempdir().unwrap();
    let write = |path: &str, text: &str| {
        let path = dir.path().join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    };
    for file in Manifest::embedded("lavoue2021-open").unwrap().files() {
        write(&file.path, "");
    }
    write("lavoue2021/MaterialType.csv", "BRDF;Type\nsteel;Metal\nred-fabric2;Dielectric\nsteel_ntheta=64;Metal\n");
    write(
        "lavoue2021/PerceptualDistances.csv",
        "\"METHOD\";\"BRDF\";\"DISTANCE\"\n\"WARD\";\"red-fabric2\";0.125\n\"GGX\";\"red-fabric2\";0.5\n\
         \"CHEBYCHEV\";\"red-fabric2\";0.5\n\
         \"ABC\";\"steel\";0.75\n",
    );
    let study = Study::load("lavoue2021-open", Some(dir.path())).unwrap();
    // CHEBYCHEV cannot be rebuilt.
    assert_eq!(study.completeness, Completeness { found: 3, known: 858 });
    let [ward, ggx, abc] = &study.pairs[..] else { panic!("three pairs") };
    assert_eq!((ggx.method.as_str(), ggx.method_family.as_str()), ("GGX", "DUPUY"));
    assert_eq!(ggx.candidate.notation(), "nbrdf/merl_nbrdf.zip:red-fabric2?fit=dupuy-ggx");
    assert_eq!(ggx.reference.notation(), "nbrdf/merl_nbrdf.zip:red-fabric2");
    assert_eq!((ward.mos, ward.group.as_str(), ward.weight), (4.5, "red-fabric", 1.0));
    assert_eq!((abc.mos, abc.method_family.as_str()), (2.0, "ABC"));
    assert!((abc.weight - 1.0 / (1.0 + (0.376f64 / 0.25).powi(2))).abs() < 1e-12);
    let notation = |s: &BrdfSource| format!("{s:?}");
    assert!(notation(&ward.candidate).contains("ngan_ward.fit:red-fabric2?model=ward-duer"));
    assert!(notation(&abc.candidate).contains("low_lowmicrofacet_E2.fit:steel?eta=2.5"));
    assert!(notation(&abc.reference).contains("merl_nbrdf.zip:steel"));
    assert!(study.files.iter().all(|f| f.as_published == Some(false)));
    assert_eq!(study.row_sets().unwrap().iter().map(|set| set.methods.len()).collect::<Vec<_>>(), [6, 3]);
    let status = inventory(Some(dir.path()));
    assert_eq!(status[1].pairs, study.completeness);
    assert_eq!(status[1].files[0].state, FileState::Extract);

    write("lavoue2021/PerceptualDistances.csv", "METHOD;BRDF;DISTANCE\nWARD;steel;0.1\nWARD;brass;\n");
    let text = message(Study::load("lavoue2021-open", Some(dir.path())));
    assert!(text.contains("PerceptualDistances.csv, line 3: DISTANCE is ``; it must be 0 to 1"), "{text}");
}

#[test]
fn candidates_of_a_study_can_be_replaced_where_it_is_rebuilt() {
    let one = |method: &str| {
        vec![vernis::dataset::manifest::Candidate {
            method: method.into(),
            family: None,
            source: "fits/{material}.json".into(),
        }]
    };
    let load = |name: &str, method: &str| message(Study::load_rebuilt(name, one(method), None));
    assert!(load("lavoue2021", "WARD-OURS").contains("its candidates are not rebuilt"));
    assert!(load("lavoue2021-open", "WARD-MINE").contains("lavoue2021 has no method WARD-MINE"));
    assert!(load("lavoue2021-opne", "WARD-OURS").contains("did you mean lavoue2021-open"));
    // What is wrong with method and study is said before the data folder is missed.
    assert!(load("lavoue2021-open", "WARD-OURS").contains("PerceptualDistances.csv"));
}

#[test]
fn the_embedded_study_needs_nothing_and_splits_without_leaks() {
    let study = Study::load("synthetic", None).unwrap();
    assert!(study.synthetic);
    let rows: Vec<_> = study.pairs.iter().map(|p| p.row()).collect();
    let features = ndarray::Array2::from_shape_fn((rows.len(), 1), |(i, _)| i as f64);
    let column = Column { name: "row".into(), family: "test".into(), role: Role::Difference };
    let samples = Samples::new(vec![column], rows, features).unwrap();
    let mut folds = grouped_folds(&samples, 10, 1).unwrap();
    folds.extend(method_and_group_folds(&samples, 4, 1).unwrap());
    let mut held = vec![0; samples.len()];
    for fold in &folds {
        let groups: BTreeSet<_> = fold.training.rows().iter().map(|r| &r.group).collect();
        assert!(fold.held_out.rows().iter().all(|r| !groups.contains(&r.group)));
        fold.held_out.indices().iter().for_each(|&i| held[i] += 1);
    }
    assert!(held.iter().all(|&n| n == 2));
}
