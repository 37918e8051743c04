//! `vernis report`: a study's ratings, and how metrics agree with them, as one page.

use super::output::{self, Replace};
use super::progress::Bar;
use super::study::{Ratings, RatingsArgs, describe, load};
use super::{Shared, print, user_error};
use crate::dataset::opinions::Scores;
use crate::dataset::pair_table::{Empty, PairTable};
use crate::dataset::{DatasetError, Study, contradiction, manifest};
use crate::evaluation::records::BenchmarkRecord;
use crate::experiment::stimuli::{FoundStimuli, found};
use crate::report::gallery::{Column, Gallery, Kind};
use crate::report::page::gallery::FILE as GALLERY;
use crate::report::{self, Whole, pictures, write_whole};
use anyhow::Result;
use clap::Args;
use std::path::{Path, PathBuf};
use vernis_image::scene::study::{PROBE, SECOND_PROBE};
use vernis_metric::io::read_at_most;
use vernis_metric::light::source::Light;

/// Far more than the record of the full study takes.
const MOST_BYTES: u64 = 1 << 30;
/// Light probes of the published study, in a data folder: name and file.
const PROBES: [(&str, &str); 2] = [("Grace", PROBE), ("Uffizi", SECOND_PROBE)];

/// One page of a study: statistics and figures of its ratings, pictures of its materials, and how metrics agree with them.
#[derive(Args)]
#[command(after_help = "\
Writes report.html, which needs no network, and its numbers and figures. How well metrics agree with the ratings comes from
an earlier `vernis train` or `vernis benchmark`; name its folder with --benchmark. Sections without data are omitted, with
the reason.

--stimuli names a folder of `vernis render --study`: report.html then shows small stimuli beside the spheres, and gallery.html shows every
rated pair whose candidate is rendered, sorted by rating or by any metric, two pictures at full size at a time, with all values of the
pair. Values are the predictions and distances of --benchmark, and the columns of --scores. Both pages hold the small pictures; the
full-size ones are read from the folder of the stimuli: keep it where it is beside the page, such as in OUT/stimuli.

Examples:
  vernis report --study synthetic
  vernis train --study lavoue2021-open --data ~/brdf-data --out out/open
  vernis report --study lavoue2021-open --data ~/brdf-data --benchmark out/open --out out/page
  vernis render --study lavoue2021-open --data ~/brdf-data --out out/page/stimuli
  vernis report --study lavoue2021-open --data ~/brdf-data --stimuli out/page/stimuli --benchmark out/open --out out/page --replace")]
pub struct ReportArgs {
    #[command(flatten)]
    ratings: RatingsArgs,
    /// Folder of an earlier `train` or `benchmark` of the same study, or its benchmark.json.
    #[arg(long, value_name = "DIR")]
    benchmark: Option<PathBuf>,
    /// Folder of `vernis render --study` for the same study, whole or in part: the pages show its pictures.
    #[arg(long, value_name = "DIR")]
    stimuli: Option<PathBuf>,
    /// With --stimuli: a CSV file of further values by pair, such as the output of `vernis score`; may be given several times. Its
    /// columns are `reference` and `candidate`, or `material` and `method`, as in the study, then one a metric. It has one row for every
    /// rated pair; an empty cell is a value that is not known.
    #[arg(long, value_name = "CSV", requires = "stimuli")]
    scores: Vec<PathBuf>,
    /// Folder for the page [default: out/report-STUDY].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    replace: Replace,
}

pub fn run(shared: &Shared, args: ReportArgs) -> Result<()> {
    let benchmark = args.benchmark.as_deref().map(read_benchmark).transpose()?;
    let ratings = load(shared, &args.ratings)?;
    if let (Some(record), Some(path)) = (&benchmark, &args.benchmark)
        && let Some(differs) = contradicts(record, &ratings)
    {
        let (path, study) = (path.display(), &ratings.opinions.name);
        return Err(user_error(format!("{path} belongs to another study than {study}: {differs}")));
    }
    let data = shared.data.as_deref();
    let study = ratings.source.as_deref().map(|source| Study::load_on(source, data, args.ratings.scale_of_study()));
    let rendered =
        args.stimuli.as_deref().map(|folder| rendered(study.as_ref(), folder, &args.scores, data)).transpose()?;
    let default = || Path::new("out").join(format!("report-{}", ratings.short_name()));
    let inputs = args.ratings.inputs().files(args.benchmark.as_deref().map(benchmark_file)).files(&args.scores);
    let names: Vec<&str> = report::FILES.into_iter().chain(rendered.is_some().then_some(GALLERY)).collect();
    let folder = output::folder(args.out.as_deref(), default, &names, &inputs, args.replace)?;
    let gallery = match (&study, rendered) {
        (Some(Ok(study)), Some(rendered)) => Some(rendered.gallery(study, benchmark.as_ref(), folder.path())?),
        _ => None,
    };
    let record = describe(&ratings, &args.ratings)?;
    let mut missing = Vec::new();
    let found = PROBES.map(|(name, file)| data.map(|d| (name, d.join(file))).filter(|(_, path)| path.is_file()));
    let (light, words) = match &found[0] {
        Some((name, path)) => (Light::probe(path).map_err(user_error)?, format!("the light probe {name}")),
        None => (pictures::lamps(), pictures::LAMPS_IN_WORDS.to_owned()),
    };
    let probed = manifest::NAMES.contains(&record.study.as_str());
    if !probed {
        missing.push(
            "Energy of the light probes Uffizi and Grace by degree: this study was not rated under them.".to_owned(),
        );
    }
    for ((name, file), _) in PROBES.iter().zip(&found).filter(|(_, found)| probed && found.is_none()) {
        missing.push(format!("Energy of the light probe {name} by degree: {file} is not in the data folder."));
    }
    let materials = match study.transpose() {
        Ok(Some(study)) => pictures::of_study(&study, data, benchmark.as_ref(), &light, usize::MAX, gallery.as_ref())
            .map_err(user_error)?,
        // Ratings alone have no BRDFs; a study that is wrong is another matter.
        Err(
            absent @ (DatasetError::NoDataFolder { .. }
            | DatasetError::MissingFile { .. }
            | DatasetError::NoPairs { .. }),
        ) => {
            missing.push(format!("Pictures of the materials: {absent}."));
            Vec::new()
        }
        Ok(None) => {
            missing.push("Pictures of the materials: the ratings do not say which BRDFs were rated.".to_owned());
            Vec::new()
        }
        Err(other) => return Err(user_error(other)),
    };
    if benchmark.is_none() {
        missing.push("How metrics agree with the ratings: no --benchmark was given.".to_owned());
    }
    #[cfg(feature = "train")]
    let probes = spectra(&found.into_iter().flatten().filter(|_| probed).collect::<Vec<_>>())?;
    let whole = Whole {
        study: &record,
        benchmark: benchmark.as_ref(),
        materials: &materials,
        light: &words,
        gallery: gallery.as_ref(),
        #[cfg(feature = "train")]
        probes: &probes,
        missing: &missing,
    };
    let page = write_whole(&folder, &whole)?;
    print(format!("report: {}\n", page.display()))?;
    match gallery {
        Some(_) => print(format!("gallery: {}\n", folder.path().join(GALLERY).display())),
        None => Ok(()),
    }
}

/// Stimuli and values of --stimuli and --scores, checked.
struct Rendered {
    stimuli: FoundStimuli,
    columns: Vec<Column>,
    /// Names and SHA-256 of the files of the columns.
    files: Vec<(String, String)>,
}

fn rendered(
    study: Option<&Result<Study, DatasetError>>,
    folder: &Path,
    scores: &[PathBuf],
    data: Option<&Path>,
) -> Result<Rendered> {
    let study = match study {
        Some(Ok(study)) => study,
        Some(Err(error)) => return Err(user_error(format!("--stimuli needs the BRDFs of the study: {error}"))),
        None => {
            return Err(user_error(
                "--stimuli needs a study, for --ratings does not say which BRDFs were rated; name it with --study",
            ));
        }
    };
    let (mut columns, mut files) = (Vec::new(), Vec::new());
    for path in scores {
        let (table, file) = PairTable::load(path).map_err(user_error)?;
        let values = table.values(study, Empty::Unknown).map_err(user_error)?;
        let kind = Kind::File(file.name.clone());
        columns.extend(table.names().zip(values).map(|(name, values)| Column {
            name: name.to_owned(),
            kind: kind.clone(),
            values,
        }));
        files.push((format!("SHA-256 of {}", file.name), file.content.to_string()));
    }
    let bar = Bar::new();
    let stimuli = found(study, folder, data, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    Ok(Rendered { stimuli: stimuli.map_err(user_error)?, columns, files })
}

impl Rendered {
    /// What a page in `folder` shows of them.
    fn gallery(self, study: &Study, benchmark: Option<&BenchmarkRecord>, folder: &Path) -> Result<Gallery> {
        let mut gallery = Gallery::of(study, &self.stimuli, benchmark, self.columns, folder).map_err(user_error)?;
        gallery.provenance.extend(self.files);
        Ok(gallery)
    }
}

fn benchmark_file(path: &Path) -> PathBuf {
    if path.is_dir() { path.join("benchmark.json") } else { path.to_owned() }
}

/// How a benchmark shows that it was made on other ratings.
fn contradicts(record: &BenchmarkRecord, ratings: &Ratings) -> Option<String> {
    let opinions = &ratings.opinions;
    if record.synthetic != opinions.synthetic {
        let observers = |synthetic| if synthetic { "simulated observers" } else { "people" };
        return Some(format!("its ratings are those of {}", observers(record.synthetic)));
    }
    let stem = |name: &str| Path::new(name).file_stem().map(|stem| stem.to_string_lossy().into_owned());
    // Raw ratings alone have no study that could be another.
    if ratings.source.is_some() && stem(&record.study) != stem(&opinions.name) {
        return Some(format!("its study is {}", record.study));
    }
    let hashes = record.data_hashes.iter().map(|(name, sha256)| (name.as_str(), sha256.as_str()));
    // Raw scores have means of their own.
    let known: Vec<contradiction::Rated<'_>> = match &opinions.scores {
        Scores::Means(means) => {
            opinions.stimuli.iter().zip(means).map(|(s, mos)| (&*s.material, &*s.method, Some(*mos))).collect()
        }
        Scores::Raw(_) => opinions.stimuli.iter().map(|s| (&*s.material, &*s.method, None)).collect(),
    };
    let rated = record.predictions.iter().map(|p| (p.material.as_str(), p.method.as_str(), Some(p.mos)));
    contradiction::of_pairs(rated, &known).or_else(|| contradiction::of_files(hashes, &opinions.files))
}

fn read_benchmark(path: &Path) -> Result<BenchmarkRecord> {
    let path = benchmark_file(path);
    let wrong = |reason: String| {
        user_error(format!("{}: {reason}; it must be the benchmark.json of a train or a benchmark", path.display()))
    };
    let bytes = read_at_most(&path, MOST_BYTES).map_err(|e| wrong(e.to_string()))?;
    serde_json::from_slice(&bytes).map_err(|e| wrong(e.to_string()))
}

/// Of each probe, the shares of all of its energy up to the degree of the study's figure.
#[cfg(feature = "train")]
fn spectra(probes: &[(&str, PathBuf)]) -> Result<Vec<crate::report::figures::spectrum::Spectrum>> {
    use vernis_metric::light::source::ProbePicture;
    use vernis_metric::math::color::luminance;
    use vernis_metric::math::spherical_harmonics::{energy_by_degree, total_energy};
    const DEGREE: usize = 130;
    let spectrum = |(name, path): &(&str, PathBuf)| {
        let probe = ProbePicture::read(path).map_err(user_error)?;
        let at = |x: usize, y: usize| luminance(probe.pixels[y * probe.width + x]);
        let energy = energy_by_degree(probe.width, probe.height, DEGREE, at);
        let total = total_energy(probe.width, probe.height, at);
        let shares = energy.into_iter().map(|e| e / total).collect();
        Ok(crate::report::figures::spectrum::Spectrum { name: (*name).to_owned(), shares })
    };
    probes.iter().map(spectrum).collect()
}
