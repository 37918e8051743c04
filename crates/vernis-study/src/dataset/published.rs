//! Published studies in a data folder, as their manifests describe them.

use super::csv_table::MOST_BYTES;
use super::manifest::{Manifest, PinnedFile, RatedManifest, RebuiltManifest};
use super::opinions::{Scores, Stimulus, StudyOpinions};
use super::ratings::{Rating, read_ratings, read_types};
use super::{Completeness, DatasetError, Identical, RatedPair, Study, StudyFile, raw_ratings};
use std::cell::RefCell;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use vernis_metric::brdf::formats::materials;
use vernis_metric::brdf::{BrdfSource, ContentHash};
use vernis_metric::io::read_at_most;
use vernis_metric::math::rating_scale::RatingScale;

/// Loads the rated pairs whose ratings and BRDFs are in `data`.
pub fn load(manifest: &Manifest, data: Option<&Path>) -> Result<Study, DatasetError> {
    let Some(data) = data else {
        let needs: Vec<&str> = manifest.needed_files().iter().map(|f| f.path.as_str()).collect();
        return Err(DatasetError::NoDataFolder { study: manifest.name().into(), needs: needs.join(", ") });
    };
    let mut files = Vec::new();
    let mut contents = BTreeMap::new();
    for pinned in manifest.needed_files() {
        let (bytes, file) = read_pinned(manifest.name(), data, pinned)?;
        files.push(file);
        contents.insert(pinned.path.as_str(), bytes);
    }
    let rated = &manifest.rated;
    let bytes = |file: &str| contents.get(file).map_or(&[][..], |b| b.as_slice());
    let ratings = read_ratings(&data.join(&rated.ratings.file), bytes(&rated.ratings.file), rated)?;
    let types_file = &rated.ratings.material_types;
    let types = read_types(&data.join(types_file), bytes(types_file), rated)?;

    let pair = |rating: &Rating, (reference, candidate): (String, String), weight: f64| RatedPair {
        reference: BrdfSource::Notation(reference),
        candidate: BrdfSource::Notation(candidate),
        material: rating.material.clone(),
        group: rated.group(&rating.material),
        method: rating.method.clone(),
        method_family: manifest.family(&rating.method),
        material_type: types.get(&rating.material).cloned(),
        mos: rating.mos,
        weight,
    };
    let tables = Tables::new(data);
    let found = |r: &Rating| match &manifest.rebuilt {
        None => Ok(table_sources(rated, &tables, r)?.map(|sources| pair(r, sources, 1.0))),
        Some(m) => Ok(rebuilt_sources(m, r).map(|sources| pair(r, sources, m.reliability.weight(&r.material)))),
    };
    let pairs: Vec<RatedPair> =
        ratings.iter().filter_map(|r| found(r).transpose()).collect::<Result<_, DatasetError>>()?;
    if pairs.is_empty() {
        return Err(no_pairs(manifest, data, ratings.len()));
    }
    let completeness = Completeness { found: pairs.len(), known: manifest.pairs() };
    let scale = scale_of(rated)?;
    let identical = match Identical::of_pairs(&pairs) {
        Some(found) => Some(found),
        None => raw_of(rated, data)?.and_then(|raw| Identical::of_raw(&raw)).or_else(|| rated.stated_identical()),
    };
    let identical = identical.unwrap_or_else(|| Identical::assumed(scale));
    Ok(Study { name: manifest.name().into(), synthetic: false, completeness, scale, identical, files, pairs })
}

/// The scale of the means, which are given as shares of it.
fn scale_of(rated: &RatedManifest) -> Result<RatingScale, DatasetError> {
    let wrong = |reason| DatasetError::Manifest { study: rated.name.clone(), reason };
    rated.scale.of_ratings([]).map_err(wrong)
}

/// Raw ratings, where the manifest names a file of them that is in `data`.
fn raw_of(rated: &RatedManifest, data: &Path) -> Result<Option<StudyOpinions>, DatasetError> {
    let Some(layout) = &rated.raw_ratings else { return Ok(None) };
    let path = data.join(&layout.file);
    if path.is_file() { raw_ratings::load(&path, layout).map(Some) } else { Ok(None) }
}

/// The ratings in `data`, whatever BRDFs are there: raw ones where the manifest names a file of them that is.
pub fn opinions(manifest: &Manifest, data: Option<&Path>) -> Result<StudyOpinions, DatasetError> {
    let rated = &manifest.rated;
    let (file, types_file) = (&rated.ratings.file, &rated.ratings.material_types);
    let Some(data) = data else {
        return Err(DatasetError::NoDataFolder {
            study: manifest.name().into(),
            needs: format!("{file}, {types_file}"),
        });
    };
    let read = |path: &String| {
        let pinned = rated.files.iter().find(|f| f.path == *path);
        let listed = pinned.ok_or_else(|| DatasetError::Manifest {
            study: rated.name.clone(),
            reason: format!("{path} is used but not among the files"),
        })?;
        read_pinned(manifest.name(), data, listed)
    };
    let ((ratings, ratings_file), (types, types_of)) = (read(file)?, read(types_file)?);
    let ratings = read_ratings(&data.join(file), &ratings, rated)?;
    let types = read_types(&data.join(types_file), &types, rated)?;
    let scale = scale_of(rated)?;
    let used = |r: &&Rating| manifest.rebuilt.as_ref().is_none_or(|m| rebuilt_sources(m, r).is_some());
    let (stimuli, means): (Vec<Stimulus>, Vec<f64>) = ratings
        .iter()
        .filter(used)
        .map(|r| {
            let stimulus = Stimulus {
                material: r.material.clone(),
                method: r.method.clone(),
                method_family: rated.family(&r.method),
                illumination: None,
                group: rated.group(&r.material),
                material_type: types.get(&r.material).cloned(),
            };
            (stimulus, scale.stated(r.mos))
        })
        .unzip();
    if stimuli.is_empty() {
        return Err(no_pairs(manifest, data, ratings.len()));
    }
    let opinions = StudyOpinions {
        name: manifest.name().into(),
        synthetic: false,
        completeness: Completeness { found: stimuli.len(), known: manifest.pairs() },
        scale,
        files: vec![ratings_file, types_of],
        stimuli,
        scores: Scores::Means(means),
    };
    Ok(match raw_of(rated, data)? {
        Some(raw) => opinions.with_raw(raw),
        None => opinions,
    })
}

fn no_pairs(manifest: &Manifest, data: &Path, ratings: usize) -> DatasetError {
    let from: Vec<String> = manifest.collections().iter().map(|c| format!("{}: {}", c.what, c.origin())).collect();
    let reason = if ratings == 0 {
        "the file of ratings has no row".to_owned()
    } else if manifest.rebuilt.is_some() {
        format!("none of its {ratings} ratings is of a method that can be rebuilt")
    } else {
        format!("none of the BRDFs of its {ratings} ratings is in {}; get {}", data.display(), from.join("; "))
    };
    DatasetError::NoPairs { study: manifest.name().into(), reason }
}

fn read_pinned(study: &str, data: &Path, pinned: &PinnedFile) -> Result<(Vec<u8>, StudyFile), DatasetError> {
    let path = data.join(&pinned.path);
    let bytes = match read_at_most(&path, MOST_BYTES) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            return Err(DatasetError::MissingFile { study: study.into(), path, from: pinned.origin() });
        }
        Err(e) => return Err(DatasetError::Unreadable { path, reason: e.to_string() }),
    };
    let content = ContentHash::of(&bytes);
    let as_published = Some(content.to_string() == pinned.sha256);
    Ok((bytes, StudyFile { name: pinned.path.clone(), content, as_published }))
}

/// What of a study's tables is in a data folder.
struct Tables<'a> {
    data: &'a Path,
    /// The materials of archives that were looked into, by their paths; none where there is no archive.
    archives: RefCell<BTreeMap<String, BTreeSet<String>>>,
}

impl<'a> Tables<'a> {
    fn new(data: &'a Path) -> Self {
        Self { data, archives: RefCell::default() }
    }

    /// Whether a file, or a member of an archive in the notation of sources, is there.
    ///
    /// # Errors
    /// An archive that is there but cannot be read.
    fn has(&self, source: &str) -> Result<bool, DatasetError> {
        let Some((archive, material)) = source.split_once(".zip:") else {
            return Ok(self.data.join(source).is_file());
        };
        let path = self.data.join(format!("{archive}.zip"));
        let mut archives = self.archives.borrow_mut();
        let known = match archives.entry(archive.to_owned()) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(place) if path.is_file() => {
                let found = materials(&path).map_err(|e| DatasetError::Content {
                    place: self.data.display().to_string(),
                    found: format!("has an archive that cannot be read ({e})"),
                    allowed: "it must have a whole archive, or none".to_owned(),
                })?;
                place.insert(found.into_iter().collect())
            }
            Entry::Vacant(place) => place.insert(BTreeSet::new()),
        };
        Ok(known.contains(material))
    }

    /// The first of `sources` that is there.
    fn first(&self, sources: impl Iterator<Item = String>) -> Result<Option<String>, DatasetError> {
        for source in sources {
            if self.has(&source)? {
                return Ok(Some(source));
            }
        }
        Ok(None)
    }
}

/// The tables of a rated pair, when both are there: sources in the data folder.
fn table_sources(
    m: &RatedManifest,
    tables: &Tables<'_>,
    rating: &Rating,
) -> Result<Option<(String, String)>, DatasetError> {
    let Some(letter) = m.method(&rating.method).map(|method| &method.letter) else { return Ok(None) };
    let references = m.references.paths.iter().map(|p| p.replace("{material}", &rating.material));
    let candidates = m.tables.folders.iter().flat_map(|folder| {
        let tables = m.tables.extensions.iter();
        tables.map(move |e| format!("{folder}{}.{letter}.{e}", rating.material))
    });
    let Some(reference) = tables.first(references)? else { return Ok(None) };
    Ok(tables.first(candidates)?.map(|candidate| (reference, candidate)))
}

/// The sources that rebuild a rated pair, when the manifest says how: paths in the data folder.
fn rebuilt_sources(m: &RebuiltManifest, rating: &Rating) -> Option<(String, String)> {
    let candidate = m.candidates.iter().find(|c| c.method == rating.method)?;
    let source = |template: &str| template.replace("{material}", &rating.material);
    Some((source(&m.reference), source(&candidate.source)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Basis;
    use crate::dataset::raw_layout::RawLayout;
    use std::fs;

    /// A data folder of the full study with two materials, of which one has a candidate table.
    fn folder() -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir_all(dir.path().join("lavoue2021/tables")).unwrap();
        fs::create_dir_all(dir.path().join("merl")).unwrap();
        let write = |path: &str, text: &str| fs::write(dir.path().join(path), text).unwrap();
        write(
            "lavoue2021/PerceptualDistances.csv",
            "METHOD;BRDF;DISTANCE\nSGD;pink-fabric;0.5\nABC;pink-fabric;0.25\nSGD;steel;0\n",
        );
        write("lavoue2021/MaterialType.csv", "BRDF;Type\npink-fabric;Dielectric\nsteel;Metal\n");
        write("merl/pink-fabric.binary", "");
        write("merl/steel.binary", "");
        dir
    }

    fn load_full(data: Option<&Path>) -> Result<Study, DatasetError> {
        load(&Manifest::embedded("lavoue2021")?, data)
    }

    #[test]
    fn only_pairs_with_both_tables_are_found() {
        let dir = folder();
        let message = load_full(Some(dir.path())).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(message.contains("none of the BRDFs of its 3 ratings"), "{message}");
        fs::write(dir.path().join("lavoue2021/tables/pink-fabric.A.titopo"), "").unwrap();
        let study = load_full(Some(dir.path())).unwrap();
        assert_eq!(study.completeness, Completeness { found: 1, known: 1926 });
        assert!(!study.completeness.is_whole());
        let p = &study.pairs[0];
        assert_eq!((p.method.as_str(), p.mos, p.weight), ("ABC", 4.0, 1.0));
        assert_eq!((p.group.as_str(), p.material_type.as_deref()), ("pink-fabric", Some("Dielectric")));
        let BrdfSource::Notation(candidate) = &p.candidate else { panic!("a table is a notation") };
        assert_eq!(candidate, "lavoue2021/tables/pink-fabric.A.titopo");
        // The manifest pins the published files, which these are not.
        assert!(study.files.iter().all(|f| f.as_published == Some(false)));
    }

    #[test]
    fn identical_brdfs_are_known_by_raw_ratings_else_by_what_the_manifest_declares() {
        let dir = folder();
        fs::write(dir.path().join("lavoue2021/tables/pink-fabric.A.titopo"), "").unwrap();
        let mut manifest = Manifest::embedded("lavoue2021").unwrap();
        let declared = load(&manifest, Some(dir.path())).unwrap().identical;
        assert_eq!(declared.score, 4.39);
        assert!(
            declared.basis.to_string().contains("declared by the study: mean of the 100 hidden references under Grace")
        );
        // Under the light with the most stimuli; each reference counts once.
        let rows = "participant,material,method,score,illumination\np,steel,REFERENCE,5,grace\nq,steel,REFERENCE,4,grace\n\
                    p,nickel,REFERENCE,3,grace\np,steel,SGD,1,grace\np,steel,REFERENCE,1,uffizi\n";
        fs::write(dir.path().join("raw.csv"), rows).unwrap();
        manifest.rated.raw_ratings = Some(RawLayout { file: "raw.csv".into(), ..RawLayout::default() });
        let found = load(&manifest, Some(dir.path())).unwrap().identical;
        assert_eq!(found, Identical { score: 3.75, basis: Basis::RawRatings { stimuli: 2 } });
        manifest.rated.raw_ratings = None;
        manifest.rated.identical = None;
        let assumed = load(&manifest, Some(dir.path())).unwrap().identical;
        assert_eq!(assumed, Identical { score: 4.5, basis: Basis::Assumed });
    }

    #[test]
    fn references_are_found_in_the_archive_of_the_measured_materials() {
        use zip::write::{SimpleFileOptions, ZipWriter};
        let dir = folder();
        fs::remove_dir_all(dir.path().join("merl")).unwrap();
        fs::create_dir(dir.path().join("merl")).unwrap();
        fs::write(dir.path().join("lavoue2021/tables/pink-fabric.A.titopo"), "").unwrap();
        let archive = dir.path().join("merl/BRDFDatabase.zip");
        let mut zip = ZipWriter::new(fs::File::create(&archive).unwrap());
        zip.start_file("BRDFDatabase/brdfs/pink-fabric.binary", SimpleFileOptions::default()).unwrap();
        zip.finish().unwrap();
        let study = load_full(Some(dir.path())).unwrap();
        assert_eq!(study.pairs.len(), 1);
        assert_eq!(study.pairs[0].reference.notation(), "merl/BRDFDatabase.zip:pink-fabric");
        // One that is cut off is not taken for one that is not there.
        let bytes = fs::read(&archive).unwrap();
        fs::write(&archive, &bytes[..bytes.len() / 2]).unwrap();
        let message = load_full(Some(dir.path())).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(message.contains("BRDFDatabase.zip: not a valid archive") && message.contains("cut off"), "{message}");
    }

    #[test]
    fn a_missing_folder_or_file_is_named_with_its_source() {
        assert!(matches!(load_full(None), Err(DatasetError::NoDataFolder { .. })));
        let dir = folder();
        fs::remove_file(dir.path().join("lavoue2021/MaterialType.csv")).unwrap();
        let message = load_full(Some(dir.path())).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(message.contains("MaterialType.csv is missing"), "{message}");
        assert!(message.contains("d3a0c120ee1976c85008d1f7606cb1872f4bcd0b"), "{message}");
    }
}
