//! `vernis data`: studies and the files they need.

mod convert;
mod files;
mod weights;

use super::{Shared, print};
use crate::dataset::inventory::{FileState, StudyStatus, inventory};
use anyhow::Result;
use clap::{Args, Subcommand};
use vernis_metric::io::counted;

/// Studies and the files they need.
#[derive(Args)]
pub struct DataArgs {
    #[command(subcommand)]
    command: DataCommand,
}

#[derive(Subcommand)]
enum DataCommand {
    /// List the known studies: which files are here, under which licence, and where to get the rest.
    #[command(after_help = "Examples:\n  vernis data list\n  vernis data list --data ~/brdf-data --json")]
    List {
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Get the pinned files of a study into the data folder; each is checked against its SHA-256 before use.
    Fetch(files::FetchArgs),
    /// Compare the files of studies in the data folder with their pinned sizes and SHA-256.
    Verify(files::VerifyArgs),
    /// List the weights and tables that metrics on pictures need: where to get each, its checksum, and which a folder has.
    Weights(weights::WeightsArgs),
    /// Write a BRDF as a table in another file format, and print the loss.
    Convert(convert::ConvertArgs),
}

pub fn run(shared: &Shared, args: DataArgs) -> Result<()> {
    match args.command {
        DataCommand::List { json } => list(shared, json),
        DataCommand::Fetch(args) => files::fetch(shared, args),
        DataCommand::Verify(args) => files::verify(shared, args),
        DataCommand::Weights(args) => weights::run(shared, args),
        DataCommand::Convert(args) => convert::run(shared, args),
    }
}

fn list(shared: &Shared, json: bool) -> Result<()> {
    let studies = inventory(shared.data.as_deref());
    if json {
        return print(serde_json::to_string_pretty(&studies)? + "\n");
    }
    let mut text = match &shared.data {
        Some(folder) if !folder.is_dir() => format!("data folder: {} (no such folder)\n\n", folder.display()),
        Some(folder) => format!("data folder: {}\n\n", folder.display()),
        None => "no data folder: name one with --data DIR or VERNIS_DATA\n\n".to_owned(),
    };
    text.extend(studies.iter().flat_map(|study| [study_text(study), "\n".to_owned()]));
    text += "Weights and tables of metrics on pictures: vernis data weights\n";
    print(text)
}

fn study_text(study: &StudyStatus) -> String {
    let mut text = format!("{}: {}\n", study.name, study.title);
    if let Some(doi) = &study.doi {
        text += &format!("  doi:{doi}\n");
    }
    text += &format!("  {} of {} are here\n", study.pairs.found, counted(study.pairs.known, "rated pair"));
    if let Some(problem) = &study.problem {
        text += &format!("  cannot be loaded: {problem}\n");
    }
    for file in &study.files {
        let state = match &file.state {
            FileState::Missing if file.optional => "missing, but optional".to_owned(),
            FileState::Missing => "missing".to_owned(),
            FileState::AsPublished => "here, as published".to_owned(),
            FileState::Extract => "here, an extract of the published file".to_owned(),
            FileState::Different => "here, but NOT the published content".to_owned(),
            FileState::Unreadable(reason) => format!("unreadable: {reason}"),
        };
        text += &format!("  {:45} {state}\n      {}; licence: {}\n", file.path, file.role, file.licence);
        if file.state != FileState::AsPublished {
            text += &format!("      from {}\n", file.origin);
        }
    }
    for collection in &study.collections {
        let (what, licence, origin) = (&collection.what, &collection.licence, &collection.origin);
        text += &format!("  {what}\n      licence: {licence}; from {origin}\n");
    }
    text
}
