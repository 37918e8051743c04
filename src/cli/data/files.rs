//! `vernis data fetch` and `vernis data verify`: the pinned files of a study.

use super::super::{Shared, print, user_error};
use crate::dataset::fetch::{self, Mirror, Outcome, Transfer};
use crate::dataset::manifest::{Manifest, NAMES, PinnedFile};
use crate::dataset::verify::{Checked, FileState};
use crate::dataset::{DatasetError, Study, synthetic};
use anyhow::Result;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::Path;
use std::time::Duration;
use vernis_metric::io::one_line;

#[derive(Args)]
#[command(after_help = "Examples:\n  vernis data fetch lavoue2021-open --data ~/brdf-data\n  \
                        vernis data fetch lavoue2021-open --data ~/brdf-data --mirror /mnt/share/brdf-data")]
pub struct FetchArgs {
    /// The study, as `vernis data list` names it.
    study: String,
    /// Copy from a folder or an address (http://, https:// or file://) that is laid out like a data folder.
    #[arg(long, value_name = "DIR|URL")]
    mirror: Option<String>,
    /// Replace files whose content is not the published one, once the published one has been received.
    #[arg(long)]
    replace: bool,
    /// Seconds that one file may take, all attempts together [default: 120, and one more per 250 kB of the file].
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..=604_800))]
    timeout: Option<u64>,
}

#[derive(Args)]
#[command(
    after_help = "Exit code: 0 if every file that is there is as published, 2 if one is not, or if none is there.\n\n\
                  Examples:\n  vernis data verify\n  vernis data verify lavoue2021-open --data ~/brdf-data --complete"
)]
pub struct VerifyArgs {
    /// The study [default: all].
    study: Option<String>,
    /// Treat a missing file as an error, unless the study loads without it.
    #[arg(long)]
    complete: bool,
}

/// A bar of bytes on standard error; silent where that is no terminal.
fn bytes_bar() -> ProgressBar {
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{msg:40} [{wide_bar}] {bytes}/{total_bytes}, {eta} left") {
        bar.set_style(style);
    }
    bar
}

fn data_folder(shared: &Shared) -> Result<&Path> {
    let missing = || user_error("no data folder: name one with --data DIR or VERNIS_DATA");
    shared.data.as_deref().ok_or_else(missing)
}

/// The manifest of a study; `None` for the one that needs no file.
fn manifest(name: &str) -> Result<Option<Manifest>> {
    if name == synthetic::NAME {
        return Ok(None);
    }
    if NAMES.contains(&name) {
        return Ok(Some(Manifest::embedded(name)?));
    }
    Err(user_error(Study::unknown(name)))
}

pub fn fetch(shared: &Shared, args: FetchArgs) -> Result<()> {
    let Some(manifest) = manifest(&args.study)? else {
        return print(format!("{}: part of vernis, nothing to fetch\n", args.study));
    };
    let data = data_folder(shared)?;
    let mirror = args.mirror.as_deref().map(Mirror::parse).transpose().map_err(user_error)?;
    let bar = bytes_bar();
    let mut failures: Vec<(&PinnedFile, DatasetError)> = Vec::new();
    for file in manifest.files() {
        bar.set_message(one_line(&file.path).into_owned());
        let mut progress = |t: Transfer| {
            bar.set_length(t.whole.unwrap_or(t.done));
            bar.set_position(t.done);
        };
        let time = args.timeout.map_or_else(|| fetch::time_for(file), Duration::from_secs);
        let outcome = fetch::fetch_within(time, file, data, mirror.as_ref(), args.replace, &mut progress);
        bar.suspend(|| print(file_line(&file.path, &fetched_text(&outcome), &file.licence)))?;
        match outcome {
            // The other files would meet the same.
            Err(error @ DatasetError::Write { .. }) => return Err(error.into()),
            Err(error) => failures.push((file, error)),
            Ok(_) => {}
        }
    }
    bar.finish_and_clear();
    print(rest_text(&manifest))?;
    let differs = |error: &DatasetError| matches!(error, DatasetError::Content { .. });
    let theirs = failures.iter().all(|(_, error)| differs(error));
    match summary(failures.into_iter().map(|(_, error)| error).collect()) {
        None => Ok(()),
        Some(message) if theirs => Err(user_error(message)),
        Some(message) => Err(anyhow::Error::msg(message)),
    }
}

fn fetched_text(outcome: &Result<Outcome, DatasetError>) -> String {
    match outcome {
        Ok(Outcome::Present) => "here already".into(),
        Ok(Outcome::Extract) => "here already, a part of it; --replace gets all of it".into(),
        Ok(Outcome::Fetched { bytes }) => format!("fetched, {bytes} bytes received"),
        Err(_) => "NOT fetched".into(),
    }
}

fn file_line(path: &str, state: &str, licence: &str) -> String {
    format!("{path:45} {state}; licence: {licence}\n")
}

/// What the study needs beside its pinned files.
fn rest_text(manifest: &Manifest) -> String {
    let lines = manifest
        .collections()
        .iter()
        .map(|c| format!("not pinned by file: {}\n    from {}; licence: {}\n", c.what, c.origin(), c.licence));
    lines.collect()
}

/// All failures in one line.
fn summary(failures: Vec<DatasetError>) -> Option<String> {
    let texts: Vec<String> = failures.iter().map(DatasetError::to_string).collect();
    (!texts.is_empty()).then(|| texts.join("; "))
}

pub fn verify(shared: &Shared, args: VerifyArgs) -> Result<()> {
    let names = args.study.as_deref().map_or(NAMES.to_vec(), |study| vec![study]);
    let (mut failures, mut here, mut looked_for) = (Vec::new(), 0, false);
    for name in &names {
        match manifest(name)? {
            None => print(format!("{name}: part of vernis, nothing to verify\n"))?,
            Some(manifest) => {
                let data = data_folder(shared)?;
                if !data.is_dir() {
                    return Err(user_error(format!(
                        "{}: no such folder; --data names the data folder",
                        data.display()
                    )));
                }
                let verified = verify_study(&manifest, data, args.complete)?;
                failures.extend(verified.failures);
                (here, looked_for) = (here + verified.here, true);
            }
        }
    }
    if looked_for && here == 0 && failures.is_empty() {
        let data = data_folder(shared)?.display();
        return Err(user_error(format!("{data}: no file of {} is there; nothing was verified", names.join(" or "))));
    }
    summary(failures).map_or(Ok(()), |message| Err(user_error(message)))
}

struct Verified {
    failures: Vec<DatasetError>,
    /// How many of the study's files are there, right or wrong.
    here: usize,
}

fn verify_study(manifest: &Manifest, data: &Path, complete: bool) -> Result<Verified> {
    let files = manifest.files();
    let size = |file: &&PinnedFile| data.join(&file.path).metadata().map_or(0, |m| m.len());
    let bar = bytes_bar();
    bar.set_length(files.iter().map(size).sum());
    print(format!("{} in {}\n", manifest.name(), data.display()))?;
    let (mut failures, mut here) = (Vec::new(), 0);
    for file in &files {
        bar.set_message(one_line(&file.path).into_owned());
        let checked = Checked::of(file, data, &mut |bytes| bar.inc(bytes));
        let state = match &checked.state {
            FileState::Missing if file.optional => "missing, but optional: the study loads without it",
            FileState::Missing => "missing",
            FileState::AsPublished => "as published",
            FileState::Extract => "a part of the published file",
            FileState::Different => "NOT the published content",
            FileState::Unreadable(_) => "cannot be read",
        };
        bar.suspend(|| print(format!("  {:45} {state}\n", file.path)))?;
        failures.extend(checked.problem(file, data));
        here += usize::from(checked.state != FileState::Missing);
        if complete && checked.state == FileState::Missing && !file.optional {
            failures.push(DatasetError::MissingFile {
                study: manifest.name().into(),
                path: data.join(&file.path),
                from: file.origin(),
            });
        }
    }
    bar.finish_and_clear();
    print(rest_text(manifest))?;
    Ok(Verified { failures, here })
}
