//! A study as numbers in a Parquet file: what a trainer needs of it, without its BRDFs.
//!
//! One row a rated pair: its `place` in the study, what it belongs to, its score, where its BRDFs came from and the SHA-256 of
//! their contents, then a column a descriptor or distance, and the same again with reference and candidate exchanged, under
//! the name followed by `~exchanged`. Scores are grades, 1 to 5, and the header holds the scale of the study. The metadata hold a
//! header in JSON under the key `vernis`. A file holds a whole study or
//! one [`Shard`] of it; [`ExtractedStudy::merge`] joins shards.

use super::Samples;
use super::parquet::{self, Values};
use super::shard::Shard;
use crate::dataset::Row;
use crate::dataset::{Completeness, DatasetError, Identical, RatedPair, Study, StudyFile};
use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use vernis_metric::brdf::{BrdfSource, ContentHash};
use vernis_metric::descriptor::Column;
use vernis_metric::descriptor::{DescriptorSet, SetupId};
use vernis_metric::math::rating_scale::RatingScale;
use vernis_metric::metric::{Metric, kernel, lp, transport};

/// Of the layout of the file; older ones keep being read.
const FORMAT: u32 = 2;
/// The first version of vernis that reads this format.
const READABLE_FROM: &str = "0.1.0";
/// Of the header among the metadata.
const KEY: &str = "vernis";
/// After the name of a column, for reference and candidate exchanged.
const EXCHANGED: &str = "~exchanged";
/// What the rows belong to; descriptors have other names.
const TEXTS: [&str; 9] = [
    "material",
    "group",
    "method",
    "method_family",
    "material_type",
    "reference",
    "candidate",
    "reference_sha256",
    "candidate_sha256",
];

/// What all files of a study have in common, but for the shard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Header {
    format: u32,
    /// The first version of vernis that reads the file.
    #[serde(default)]
    readable_from: String,
    shard: Shard,
    study: String,
    /// Ratings come from simulated observers.
    synthetic: bool,
    /// Pairs at hand in the whole study, and pairs that it has.
    pairs: usize,
    known: usize,
    /// Of the ratings, whose scores here are grades; absent for 1 to 5.
    #[serde(default, skip_serializing_if = "RatingScale::is_grades")]
    scale: RatingScale,
    /// The score of identical BRDFs, a grade.
    #[serde(default)]
    identical: Identical,
    files: Vec<File>,
    /// What decides the numbers.
    versions: Versions,
    columns: Vec<Column>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct File {
    name: String,
    sha256: String,
    as_published: Option<bool>,
}

/// What decides the numbers of a file besides the BRDFs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Versions {
    /// Version of the descriptors, lights and shape, such as `v1-lamps-sphere`.
    pub setup: String,
    /// Versions of the metrics whose distances are columns, by name.
    #[serde(default)]
    pub metrics: BTreeMap<String, String>,
    /// In files of format 1, in place of `metrics`: such as `lp 2, graphs 4`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distances: Option<String>,
}

impl Versions {
    /// Versions of the descriptors in `setup` and of `metrics`.
    pub fn new(setup: &str, metrics: &[Arc<dyn Metric>]) -> Self {
        let version = |metric: &Arc<dyn Metric>| (metric.name().to_owned(), metric.version().to_owned());
        Self { setup: setup.to_owned(), metrics: metrics.iter().map(version).collect(), distances: None }
    }

    /// What a file of format 1 says of the columns, as later ones say it. `graphs N` was the version of transport; the energy
    /// distance has not changed since the first.
    fn modernised(mut self, columns: &[Column]) -> Self {
        let distances = self.distances.take().unwrap_or_default();
        let of = |kind: &str| {
            let parts = distances.split(',').filter_map(|part| part.trim().split_once(' '));
            parts.filter(|(name, _)| *name == kind).map(|(_, version)| version.to_owned()).next()
        };
        for column in columns {
            let version = match column.family.as_str() {
                lp::FAMILY => of("lp"),
                transport::FAMILY => of("graphs"),
                kernel::FAMILY => of("graphs").map(|_| "1".to_owned()),
                _ => None,
            };
            self.metrics.extend(version.map(|version| (column.name.clone(), version)));
        }
        self
    }
}

/// A study, or a shard of it, and its numbers.
#[derive(Debug, Clone)]
pub struct ExtractedStudy {
    /// Its pairs are those of the shard; they name their sources, which need not be there.
    pub study: Study,
    /// With the exchanged pairs.
    pub samples: Samples,
    /// Of reference and candidate of every pair.
    pub contents: Vec<[ContentHash; 2]>,
    /// Which part of the study it holds.
    pub shard: Shard,
    /// Of every pair in the whole study.
    pub places: Vec<usize>,
    /// Pairs of the whole study.
    pub whole: usize,
    /// What decides the numbers besides the BRDFs.
    pub versions: Versions,
}

impl ExtractedStudy {
    /// The bytes of a Parquet file, the same for the same study.
    ///
    /// # Errors
    /// Samples without exchanged pairs, or numbers that the format cannot hold.
    pub fn to_parquet(&self) -> Result<Vec<u8>, DatasetError> {
        let refused = |found: String| DatasetError::Content {
            place: format!("the numbers of {}", self.study.name),
            found,
            allowed: "they must be columns of one length, with exchanged pairs".to_owned(),
        };
        let pairs = &self.study.pairs;
        let text = |of: &dyn Fn(&RatedPair) -> Option<String>| Values::Text(pairs.iter().map(of).collect());
        let content = |side: usize| Values::Text(self.contents.iter().map(|c| Some(c[side].to_string())).collect());
        let texts = [
            text(&|p| Some(p.material.clone())),
            text(&|p| Some(p.group.clone())),
            text(&|p| Some(p.method.clone())),
            text(&|p| Some(p.method_family.clone())),
            text(&|p| p.material_type.clone()),
            text(&|p| Some(p.reference.notation().to_owned())),
            text(&|p| Some(p.candidate.notation().to_owned())),
            content(0),
            content(1),
        ];
        let mut columns = vec![("place".to_owned(), Values::Count(self.places.clone()))];
        columns.extend(TEXTS.map(str::to_owned).into_iter().zip(texts));
        columns.push(("mos".to_owned(), Values::Number(pairs.iter().map(|p| p.mos).collect())));
        columns.push(("weight".to_owned(), Values::Number(pairs.iter().map(|p| p.weight).collect())));
        let exchanged = self.samples.swapped().ok_or_else(|| refused("no exchanged pairs".to_owned()))?;
        for (features, suffix) in [(self.samples.features(), ""), (exchanged, EXCHANGED)] {
            let named = self.samples.columns().iter().zip(features.columns());
            columns.extend(named.map(|(c, v)| (format!("{}{suffix}", c.name), Values::Number(v.to_vec()))));
        }
        let header = serde_json::to_string(&self.header()).map_err(|e| refused(e.to_string()))?;
        parquet::write(KEY, &header, &columns).map_err(|e| refused(e.to_string()))
    }

    fn header(&self) -> Header {
        let file =
            |f: &StudyFile| File { name: f.name.clone(), sha256: f.content.to_string(), as_published: f.as_published };
        Header {
            format: FORMAT,
            readable_from: READABLE_FROM.to_owned(),
            shard: self.shard,
            study: self.study.name.clone(),
            synthetic: self.study.synthetic,
            pairs: self.whole,
            known: self.study.completeness.known,
            scale: self.study.scale,
            identical: self.study.identical.clone(),
            files: self.study.files.iter().map(file).collect(),
            versions: self.versions.clone(),
            columns: self.samples.columns().to_vec(),
        }
    }

    /// Reads a file of [`ExtractedStudy::to_parquet`].
    ///
    /// # Errors
    /// A file that is truncated, damaged, of another origin or of a newer format; columns that are missing; rows that cannot be.
    pub fn load(path: &Path) -> Result<Self, DatasetError> {
        let wrong = |found: String, allowed: String| DatasetError::Content {
            place: path.display().to_string(),
            found,
            allowed,
        };
        let (header, columns) = parquet::read(path, KEY)?;
        let header = Header::parse(&header).map_err(|(found, allowed)| wrong(found, allowed))?;
        let content = |text: &str| {
            let hash = ContentHash::from_hex(text);
            hash.ok_or_else(|| {
                wrong(format!("has the hash `{text}`"), "it must be a SHA-256 of 64 hexadecimal digits".into())
            })
        };
        let mut table = Table { path, columns };
        let (places, mos, weight) = (table.counts("place")?, table.numbers("mos")?, table.numbers("weight")?);
        let mut texts = BTreeMap::new();
        for name in TEXTS {
            texts.insert(name, table.texts(name)?);
        }
        let rows = places.len();
        let text = |name: &str, row: usize| texts.get(name).and_then(|t| t.get(row)).cloned().flatten();
        let needed = |name: &str, row: usize| {
            text(name, row)
                .ok_or_else(|| wrong(format!("has no {name} in row {row}"), "every row must have one".into()))
        };
        let pair = |row: usize| -> Result<RatedPair, DatasetError> {
            Ok(RatedPair {
                reference: BrdfSource::Notation(needed("reference", row)?),
                candidate: BrdfSource::Notation(needed("candidate", row)?),
                material: needed("material", row)?,
                group: needed("group", row)?,
                method: needed("method", row)?,
                method_family: needed("method_family", row)?,
                material_type: text("material_type", row),
                mos: mos[row],
                weight: weight[row],
            })
        };
        let pairs: Vec<RatedPair> = (0..rows).map(pair).collect::<Result<_, _>>()?;
        let contents = (0..rows)
            .map(|row| Ok([content(&needed("reference_sha256", row)?)?, content(&needed("candidate_sha256", row)?)?]))
            .collect::<Result<_, DatasetError>>()?;
        let mut matrix = |suffix: &str| -> Result<Array2<f64>, DatasetError> {
            let named = header.columns.iter().map(|column| table.numbers(&format!("{}{suffix}", column.name)));
            let columns: Vec<Vec<f64>> = named.collect::<Result<_, _>>()?;
            Ok(Array2::from_shape_fn((rows, columns.len()), |(row, column)| columns[column][row]))
        };
        let (values, exchanged) = (matrix("")?, matrix(EXCHANGED)?);
        let of_rows = |e: super::SamplesError| {
            wrong(format!("holds wrong numbers ({e})"), "it must hold the numbers of a study".into())
        };
        let samples = Samples::new(header.columns.clone(), pairs.iter().map(RatedPair::row).collect(), values)
            .and_then(|samples| samples.with_swapped(exchanged))
            .map_err(of_rows)?
            .with_identical(header.identical.clone(), header.scale);
        let distinct: BTreeSet<usize> = places.iter().copied().filter(|&place| place < header.pairs).collect();
        if distinct.len() != rows || (header.shard == Shard::WHOLE && rows != header.pairs) {
            let found = format!("has {rows} rows at {} places of {}", distinct.len(), header.pairs);
            return Err(wrong(found, "each row must have its own place, and a whole study all of its rows".into()));
        }
        let file = |f: &File| {
            Ok(StudyFile { name: f.name.clone(), content: content(&f.sha256)?, as_published: f.as_published })
        };
        let study = Study {
            name: header.study,
            synthetic: header.synthetic,
            completeness: Completeness { found: header.pairs, known: header.known },
            scale: header.scale,
            identical: header.identical,
            files: header.files.iter().map(file).collect::<Result<_, DatasetError>>()?,
            pairs,
        };
        let (shard, whole, versions) = (header.shard, header.pairs, header.versions);
        Ok(Self { study, samples, contents, shard, places, whole, versions })
    }

    /// That the numbers are those of a whole study; `place` names the file in errors.
    ///
    /// # Errors
    /// One of several shards.
    pub fn check_whole(&self, place: &str) -> Result<(), DatasetError> {
        let (shard, count) = (self.shard, self.shard.count());
        if count <= 1 {
            return Ok(());
        }
        Err(DatasetError::Content {
            place: place.to_owned(),
            found: format!("is shard {shard}"),
            allowed: format!("the whole study is needed: join all {count} with `vernis merge`"),
        })
    }

    /// That the numbers are those which this program would compute; `place` names the file in errors.
    ///
    /// # Errors
    /// Descriptors of a version that this program does not know, columns that are missing, distances of another version than
    /// those of `metrics`.
    pub fn check_versions(&self, metrics: &[Arc<dyn Metric>], place: &str) -> Result<(), DatasetError> {
        let wrong = |found: String, allowed: String| DatasetError::Content { place: place.to_owned(), found, allowed };
        SetupId::known(&self.versions.setup)
            .map_err(|e| wrong(format!("has other descriptors ({e})"), "it must have those of this program".into()))?;
        let columns = self.samples.columns();
        if let Some(missing) = DescriptorSet::extended().columns().iter().find(|column| !columns.contains(column)) {
            return Err(wrong(
                format!("has no column {}", missing.name),
                "it must have all of this version: extract again".into(),
            ));
        }
        for metric in metrics {
            let (name, version) = (metric.name(), metric.version());
            let found = self.versions.metrics.get(name).map(String::as_str);
            if found != Some(version) {
                let found =
                    found.map_or_else(|| format!("has no {name}"), |found| format!("has {name} of version {found}"));
                return Err(wrong(found, format!("it must have {name} of version {version}: extract again")));
            }
        }
        Ok(())
    }

    /// The whole study from all of its shards, each with the name of its file, in any order.
    ///
    /// # Errors
    /// No file, files of different studies or versions, a shard that is missing or given twice, pairs that are.
    pub fn merge(parts: Vec<(String, Self)>) -> Result<Self, DatasetError> {
        let wrong = |place: &str, found: String, allowed: String| DatasetError::Content {
            place: place.to_owned(),
            found,
            allowed,
        };
        let Some((first_name, first)) = parts.first() else {
            return Err(wrong(
                "merge",
                "was given no file".into(),
                "it needs the files of all shards of a study".into(),
            ));
        };
        let common = |part: &Self| Header { shard: Shard::WHOLE, ..part.header() };
        let expected = common(first);
        let mut seen: BTreeMap<usize, &str> = BTreeMap::new();
        for (name, part) in &parts {
            let found = common(part);
            if found != expected || part.shard.count() != first.shard.count() {
                let what = expected.difference(&found).unwrap_or("number of shards");
                let allowed = format!("all shards of a study must have the same {what}");
                return Err(wrong(name, format!("has another {what} than {first_name}"), allowed));
            }
            if let Some(other) = seen.insert(part.shard.number(), name) {
                return Err(wrong(
                    name,
                    format!("is shard {}, as is {other}", part.shard),
                    "each shard must be given once".into(),
                ));
            }
        }
        let missing: Vec<String> =
            (1..=first.shard.count()).filter(|k| !seen.contains_key(k)).map(|k| k.to_string()).collect();
        if !missing.is_empty() {
            let found = format!("was given no shard {} of {}", missing.join(", "), first.shard.count());
            return Err(wrong("merge", found, "it needs the files of all shards".into()));
        }
        let mut order: Vec<(usize, usize, usize)> = Vec::new();
        for (number, (_, part)) in parts.iter().enumerate() {
            order.extend(part.places.iter().enumerate().map(|(row, &place)| (place, number, row)));
        }
        order.sort_unstable();
        let whole = first.whole;
        if !order.iter().map(|(place, _, _)| *place).eq(0..whole) {
            let found = format!("was given {} rows, some missing or repeated", order.len());
            return Err(wrong("merge", found, format!("it needs one row for each of the {whole} pairs")));
        }
        let matrix = |of: &dyn Fn(&Samples) -> Option<ArrayView2<'_, f64>>| -> Option<Array2<f64>> {
            let views: Vec<ArrayView2<'_, f64>> = parts.iter().map(|(_, p)| of(&p.samples)).collect::<Option<_>>()?;
            let width = first.samples.columns().len();
            Some(Array2::from_shape_fn((whole, width), |(place, column)| {
                let (_, number, row) = order[place];
                views[number][(row, column)]
            }))
        };
        let refused = |e: String| {
            wrong("merge", format!("was given wrong numbers ({e})"), "it needs the numbers of a study".into())
        };
        let values = matrix(&|samples| Some(samples.features())).ok_or_else(|| refused("no numbers".into()))?;
        let exchanged = matrix(&|samples| samples.swapped()).ok_or_else(|| refused("no exchanged pairs".into()))?;
        let of = |&(_, number, row): &(usize, usize, usize)| (&parts[number].1, row);
        let pairs: Vec<RatedPair> = order.iter().map(of).map(|(part, row)| part.study.pairs[row].clone()).collect();
        let rows: Vec<Row> = pairs.iter().map(RatedPair::row).collect();
        let samples = Samples::new(first.samples.columns().to_vec(), rows, values)
            .and_then(|samples| samples.with_swapped(exchanged))
            .map_err(|e| refused(e.to_string()))?
            .with_identical(first.study.identical.clone(), first.study.scale);
        Ok(Self {
            study: Study { pairs, ..first.study.clone() },
            samples,
            contents: order.iter().map(of).map(|(part, row)| part.contents[row]).collect(),
            shard: Shard::WHOLE,
            places: (0..whole).collect(),
            whole,
            versions: first.versions.clone(),
        })
    }
}

impl Header {
    /// Reads the text of a header of any format so far; else what was found, and what is allowed.
    fn parse(text: &str) -> Result<Self, (String, String)> {
        #[derive(Deserialize)]
        struct Format {
            format: u32,
            #[serde(default)]
            readable_from: String,
        }
        let unreadable = |e: serde_json::Error| {
            (format!("has a header that cannot be read ({e})"), "it must be a file of `vernis extract`".to_owned())
        };
        let Format { format, readable_from } = serde_json::from_str(text).map_err(unreadable)?;
        match format {
            1..=FORMAT => {}
            newer => {
                let own = env!("CARGO_PKG_VERSION");
                let allowed = format!("vernis {own} reads up to format {FORMAT}: use vernis {readable_from} or later");
                return Err((format!("has format {newer}"), allowed));
            }
        }
        let header: Self = serde_json::from_str(text).map_err(unreadable)?;
        Ok(Self { versions: header.versions.modernised(&header.columns), ..header })
    }

    /// The first thing in which two headers differ.
    fn difference(&self, other: &Self) -> Option<&'static str> {
        [
            ("study", self.study != other.study || self.synthetic != other.synthetic),
            ("number of pairs", self.pairs != other.pairs || self.known != other.known),
            ("set of ratings", self.files != other.files || self.identical != other.identical),
            ("scale", self.scale != other.scale),
            ("version of the numbers", self.versions != other.versions),
            ("set of columns", self.columns != other.columns),
        ]
        .into_iter()
        .find_map(|(what, differs)| differs.then_some(what))
    }
}

/// Columns that are taken out by name.
struct Table<'a> {
    path: &'a Path,
    columns: BTreeMap<String, Values>,
}

impl Table<'_> {
    fn take<T>(&mut self, name: &str, kind: impl Fn(Values) -> Option<T>) -> Result<T, DatasetError> {
        let found = self.columns.remove(name);
        let missing = if found.is_some() { "another kind of column" } else { "no column" };
        found.and_then(kind).ok_or_else(|| DatasetError::Content {
            place: self.path.display().to_string(),
            found: format!("has {missing} {name}"),
            allowed: "it must have the columns that its header names".to_owned(),
        })
    }

    fn texts(&mut self, name: &str) -> Result<Vec<Option<String>>, DatasetError> {
        self.take(name, |values| if let Values::Text(texts) = values { Some(texts) } else { None })
    }

    fn numbers(&mut self, name: &str) -> Result<Vec<f64>, DatasetError> {
        self.take(name, |values| if let Values::Number(numbers) = values { Some(numbers) } else { None })
    }

    fn counts(&mut self, name: &str) -> Result<Vec<usize>, DatasetError> {
        self.take(name, |values| if let Values::Count(counts) = values { Some(counts) } else { None })
    }
}
