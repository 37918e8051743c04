//! `vernis study`: the statistics of a study's ratings.

use super::output::{self, Inputs, Replace};
use super::scale::ScaleArgs;
use super::{Shared, limits, note, print, user_error, workspace};
use crate::dataset::opinions::StudyOpinions;
use crate::dataset::{DatasetError, DeclaredScale, Study, contradiction, rating_differences, synthetic};
use crate::panel::screening::Criterion;
use crate::panel::{Options, StudyRecord, describe as study_of};
use crate::report::study;
use anyhow::Result;
use clap::Args;
use std::path::{Path, PathBuf};

/// The study that is used where the data folder has its ratings.
const HUMAN_STUDY: &str = "lavoue2021";

/// Statistics of a study's ratings: means, agreement, material types, illuminations, screening.
#[derive(Args)]
#[command(after_help = "\
Reads only ratings, no BRDF. --ratings takes raw ratings, one row per judgement: a CSV file with the columns
  participant, material, method (REFERENCE for a hidden reference), score (1 to 5, or as --scale says)
and optionally
  illumination, seconds, gold (the expected score of a control question), group, material_type
or a TOML file that maps other columns to these; see datasets/README.md.

Examples:
  vernis study --study synthetic
  vernis study --study lavoue2021 --data ~/brdf-data --out out/ratings
  vernis study --ratings my-ratings.csv --reject gold,time,outlier --json
  vernis study --study scores-of-100.csv --scale worst=0,best=100")]
pub struct StudyArgs {
    #[command(flatten)]
    ratings: RatingsArgs,
    /// Folder for study.json and study.md [default: out/STUDY].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    replace: Replace,
    /// Print study.json instead of the report.
    #[arg(long)]
    json: bool,
}

/// Which ratings, and how they are screened.
#[derive(Args)]
pub struct RatingsArgs {
    /// A study by name (lavoue2021, lavoue2021-open, synthetic) or a CSV file [default: that of --ratings, else lavoue2021
    /// if the data folder has its ratings, else synthetic].
    #[arg(long, value_name = "STUDY")]
    study: Option<String>,
    /// Raw ratings (.csv, or the .toml that describes one). With --study, ratings that contradict it are refused.
    #[arg(long, value_name = "FILE")]
    ratings: Option<PathBuf>,
    #[command(flatten)]
    scale: ScaleArgs,
    /// Checks that reject a participant.
    #[arg(long, value_delimiter = ',', default_value = "gold,time", value_parser = ["gold", "time", "outlier", "none"])]
    reject: Vec<String>,
    /// Seed of splits and resamples. The same seed gives the same bytes.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = limits::seed)]
    seed: u64,
}

/// The ratings that were asked for.
pub struct Ratings {
    pub opinions: StudyOpinions,
    /// What `Study::load` takes for their BRDFs; `None` for raw ratings alone, which do not say which BRDFs were rated.
    pub source: Option<String>,
}

impl RatingsArgs {
    /// The files that are read. Those that a TOML file leads to are never called as what is written.
    pub fn inputs(&self) -> Inputs {
        Inputs::default().files(&self.study).files(&self.ratings)
    }

    /// The scale of the study itself, where it is a file: a study by name declares its own.
    pub fn scale_of_study(&self) -> Option<DeclaredScale> {
        let own = self.study.as_ref().is_some_and(|name| !Study::known().contains(&name.as_str()));
        self.scale.declared.filter(|_| own)
    }

    /// Seed of splits and resamples.
    #[cfg(feature = "train")]
    pub fn seed(&self) -> u64 {
        self.seed
    }
}

impl Ratings {
    /// Their name for files and folders.
    pub fn short_name(&self) -> String {
        Path::new(&self.opinions.name).file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }
}

pub fn run(shared: &Shared, args: StudyArgs) -> Result<()> {
    let ratings = load(shared, &args.ratings)?;
    let (names, inputs) = (["study.json", "study.md"], args.ratings.inputs());
    let default = || Path::new("out").join(ratings.short_name());
    let folder = output::folder(args.out.as_deref(), default, &names, &inputs, args.replace)?;
    let record = describe(&ratings, &args.ratings)?;
    let json = serde_json::to_string_pretty(&record)? + "\n";
    folder.write("study.json", json.as_bytes())?;
    let page = folder.write("study.md", study::markdown(&record).as_bytes())?;
    if args.json {
        return print(json);
    }
    print(format!("{}\nreport: {}\n", study::text(&record), page.display()))
}

/// The statistics of the ratings.
pub fn describe(ratings: &Ratings, args: &RatingsArgs) -> Result<StudyRecord> {
    let opinions = &ratings.opinions;
    let options = Options {
        command: command(args, &opinions.name),
        seed: args.seed,
        rejecting: rejecting(&args.reject)?,
        ..Options::default()
    };
    study_of(opinions, &options).map_err(|e| user_error(format!("{}: {e}", opinions.name)))
}

/// Loads the ratings; a study is found again by what was asked for, never by the name of its file.
pub fn load(shared: &Shared, args: &RatingsArgs) -> Result<Ratings> {
    let data = shared.data.as_deref();
    let scale = args.scale.declared;
    let raw = args.ratings.as_deref().map(|path| StudyOpinions::load_raw_on(path, scale));
    let raw = raw.transpose().map_err(user_error)?;
    match (&args.study, raw) {
        (Some(name), raw) => {
            // With raw ratings, the declared scale is theirs.
            let of_study = if raw.is_some() { args.scale_of_study() } else { scale };
            let opinions = StudyOpinions::load_on(name, data, of_study).map_err(user_error)?;
            let opinions = match raw {
                None => opinions,
                Some(raw) => {
                    if let Some(differs) = contradiction::of_ratings(&opinions, &raw) {
                        let (study, ratings) = (&opinions.name, &raw.name);
                        return Err(user_error(format!("{ratings} contradicts the study {study}: {differs}")));
                    }
                    workspace::warn(contradictions(&opinions, &raw));
                    opinions.with_raw(raw)
                }
            };
            Ok(Ratings { opinions, source: Some(name.clone()) })
        }
        (None, Some(opinions)) => Ok(Ratings { opinions, source: None }),
        (None, None) if scale.is_some() => Err(user_error(format!(
            "--scale is {}, but neither --study nor --ratings was given; name the file whose ratings are on that scale",
            args.scale.declared.map_or(String::new(), |s| s.to_string())
        ))),
        (None, None) => match StudyOpinions::load(HUMAN_STUDY, data) {
            // Ratings that are there and wrong are no reason to go on with other ones.
            Err(missing @ (DatasetError::NoDataFolder { .. } | DatasetError::MissingFile { .. })) => {
                note(format_args!("study {}: SYNTHETIC observers, generated by code.", synthetic::NAME));
                note(format_args!("For human ratings name a data folder with --data DIR or VERNIS_DATA ({missing})."));
                let opinions = StudyOpinions::load(synthetic::NAME, data).map_err(user_error)?;
                Ok(Ratings { opinions, source: Some(synthetic::NAME.to_owned()) })
            }
            loaded => Ok(Ratings { opinions: loaded.map_err(user_error)?, source: Some(HUMAN_STUDY.to_owned()) }),
        },
    }
}

/// What the ratings and the study that they are said to be of do not agree on.
fn contradictions(study: &StudyOpinions, raw: &StudyOpinions) -> Vec<String> {
    const SHOWN: usize = 5;
    let Some(checked) = rating_differences::check(study, raw) else { return Vec::new() };
    let all = &checked.differences;
    if all.is_empty() {
        return Vec::new();
    }
    let shown: Vec<String> = all.iter().take(SHOWN).map(ToString::to_string).collect();
    let more = all.len().saturating_sub(SHOWN);
    let more = if more > 0 { format!("; and {more} more") } else { String::new() };
    vec![format!(
        "--ratings contradicts the study {} on {} of {} pairs, by more than {} grades: {}{more}; the ratings are used",
        study.name,
        all.len(),
        checked.common,
        rating_differences::TOLERANCE,
        shown.join("; ")
    )]
}

fn rejecting(names: &[String]) -> Result<Vec<Criterion>> {
    if names.iter().any(|n| n == "none") && names.len() > 1 {
        return Err(user_error(format!(
            "--reject is {}; it must be none alone, or checks without none",
            names.join(",")
        )));
    }
    let known = [("gold", Criterion::Gold), ("time", Criterion::Time), ("outlier", Criterion::Outlier)];
    Ok(known.into_iter().filter(|(name, _)| names.iter().any(|n| n == name)).map(|(_, c)| c).collect())
}

/// What asks for the same record again: without folders, which do not matter.
fn command(args: &RatingsArgs, study: &str) -> String {
    let file = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let ratings = args.ratings.as_ref().map(|r| format!(" --ratings {}", file(r))).unwrap_or_default();
    let study = match (&args.study, &args.ratings) {
        (None, Some(_)) => String::new(),
        _ => format!(" --study {study}"),
    };
    let scale = args.scale.option();
    format!("vernis study{study}{ratings}{scale} --reject {} --seed {}", args.reject.join(","), args.seed)
}
