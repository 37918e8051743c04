//! `vernis data`: studies and the files they need.

use super::Shared;
use crate::dataset::inventory::{FileState, StudyStatus, inventory};
use anyhow::Result;
use clap::{Args, Subcommand};

/// Studies and the files they need.
#[derive(Args)]
pub struct DataArgs {
    #[command(subcommand)]
    command: DataCommand,
}

#[derive(Subcommand)]
enum DataCommand {
    /// Every known study: what of it is here, under which licence, and where to get the rest.
    #[command(after_help = "Examples:\n  vernis data list\n  vernis data list --data ~/brdf-data --json")]
    List {
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
}

pub fn run(shared: &Shared, args: DataArgs) -> Result<()> {
    let DataCommand::List { json } = args.command;
    let studies = inventory(shared.data.as_deref());
    if json {
        println!("{}", serde_json::to_string_pretty(&studies)?);
        return Ok(());
    }
    match &shared.data {
        Some(folder) => println!("data folder: {}\n", folder.display()),
        None => println!("no data folder: name one with --data DIR or VERNIS_DATA\n"),
    }
    studies.iter().for_each(print_study);
    Ok(())
}

fn print_study(study: &StudyStatus) {
    println!("{}: {}", study.name, study.title);
    if let Some(doi) = &study.doi {
        println!("  doi:{doi}");
    }
    println!("  {} of {} rated pairs are here", study.pairs.found, study.pairs.known);
    if let Some(problem) = &study.problem {
        println!("  cannot be loaded: {problem}");
    }
    for file in &study.files {
        let state = match &file.state {
            FileState::Missing => "missing".to_owned(),
            FileState::AsPublished => "here, as published".to_owned(),
            FileState::Extract => "here, an extract of the published file".to_owned(),
            FileState::Different => "here, but NOT the published content".to_owned(),
            FileState::Unreadable(reason) => format!("unreadable: {reason}"),
        };
        println!("  {:45} {state}", file.path);
        println!("      {}; licence: {}", file.role, file.licence);
        if file.state != FileState::AsPublished {
            println!("      from {}", file.origin);
        }
    }
    for collection in &study.collections {
        println!("  {}\n      licence: {}; from {}", collection.what, collection.licence, collection.origin);
    }
    println!();
}
