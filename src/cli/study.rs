//! `vernis study`: the statistics of a study's ratings.

use super::{Shared, limits, print, user_error};
use anyhow::Result;
use clap::Args;
use std::path::{Path, PathBuf};
use vernis::dataset::opinions::StudyOpinions;
use vernis::dataset::{DatasetError, contradiction, synthetic};
use vernis::panel::screening::Criterion;
use vernis::panel::{Options, StudyRecord, describe as study_of};
use vernis::report::{OutputFolder, study};

/// The study that is used where the data folder has its ratings.
const HUMAN_STUDY: &str = "lavoue2021";

/// Statistics of a study's ratings: means, agreement, material types, illuminations, screening.
#[derive(Args)]
#[command(after_help = "\
Reads only ratings, no BRDF. --ratings takes raw ratings, one row per judgement: a CSV file with the columns
  participant, material, method (REFERENCE for a hidden reference), score (1 to 5)
and optionally
  illumination, seconds, gold (the expected score of a control question), group, material_type
or a TOML file that maps other columns to these; see datasets/README.md.

Examples:
  vernis study --study synthetic
  vernis study --study lavoue2021 --data ~/brdf-data --out out/ratings
  vernis study --ratings my-ratings.csv --reject gold,time,outlier --json")]
pub struct StudyArgs {
    #[command(flatten)]
    ratings: RatingsArgs,
    /// Folder for study.json and study.md [default: out/STUDY].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
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
    /// Seed of splits and resamples.
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
    let folder = args.out.clone().unwrap_or_else(|| Path::new("out").join(ratings.short_name()));
    let folder = OutputFolder::create(folder).map_err(user_error)?;
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
    let raw = args.ratings.as_deref().map(StudyOpinions::load_raw).transpose().map_err(user_error)?;
    match (&args.study, raw) {
        (Some(name), raw) => {
            let opinions = StudyOpinions::load(name, data).map_err(user_error)?;
            let opinions = match raw {
                None => opinions,
                Some(raw) => match contradiction::of_ratings(&opinions, &raw) {
                    None => opinions.with_raw(raw),
                    Some(differs) => {
                        let (study, ratings) = (&opinions.name, &raw.name);
                        return Err(user_error(format!("{ratings} contradicts the study {study}: {differs}")));
                    }
                },
            };
            Ok(Ratings { opinions, source: Some(name.clone()) })
        }
        (None, Some(opinions)) => Ok(Ratings { opinions, source: None }),
        (None, None) => match StudyOpinions::load(HUMAN_STUDY, data) {
            // Ratings that are there and wrong are no reason to go on with other ones.
            Err(missing @ (DatasetError::NoDataFolder { .. } | DatasetError::MissingFile { .. })) => {
                eprintln!("study {}: SYNTHETIC observers, generated by code.", synthetic::NAME);
                eprintln!("For human ratings name a data folder with --data DIR or VERNIS_DATA ({missing}).");
                let opinions = StudyOpinions::load(synthetic::NAME, data).map_err(user_error)?;
                Ok(Ratings { opinions, source: Some(synthetic::NAME.to_owned()) })
            }
            loaded => Ok(Ratings { opinions: loaded.map_err(user_error)?, source: Some(HUMAN_STUDY.to_owned()) }),
        },
    }
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
    format!("vernis study{study}{ratings} --reject {} --seed {}", args.reject.join(","), args.seed)
}
