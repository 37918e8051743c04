//! `vernis data weights`: what metrics on pictures need and vernis may not ship.

use super::super::{Shared, check_weights_folder, print, user_error};
use anyhow::Result;
use clap::Args;
use serde_json::json;
use std::path::Path;
use vernis_image::metric::{WEIGHTS_FILES, WeightsFile, WeightsState};

/// List the weights and tables that metrics on pictures need.
#[derive(Args)]
#[command(after_help = "\
Put the files into one folder under the names given here, and name it with --weights or VERNIS_WEIGHTS: this list then says what is
there, and whether it is as published. In place of a .pth file, a .safetensors file with the same tensors is read. Weights that you
trained yourself work too; a note says that their checksum is another.

Examples:
  vernis data weights
  vernis data weights --weights weights/ --json")]
pub struct WeightsArgs {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// A file, and what the folder has of it.
struct Row {
    file: &'static WeightsFile,
    state: Option<WeightsState>,
}

pub fn run(shared: &Shared, args: WeightsArgs) -> Result<()> {
    if let Some(folder) = &shared.weights {
        check_weights_folder(folder)?;
    }
    let rows = WEIGHTS_FILES.iter().map(|file| Ok(Row { file, state: state(file, shared.weights.as_deref())? }));
    let rows = rows.collect::<Result<Vec<_>>>()?;
    if args.json {
        let all: Vec<_> = rows.iter().map(to_json).collect();
        return print(serde_json::to_string_pretty(&all)? + "\n");
    }
    let mut text = match &shared.weights {
        Some(folder) => format!("folder: {}\n\n", folder.display()),
        None => String::new(),
    };
    text.extend(rows.iter().map(to_text));
    print(text)
}

fn state(file: &WeightsFile, folder: Option<&Path>) -> Result<Option<WeightsState>> {
    let wrong = |folder: &Path, error| {
        let path = file.find(folder).unwrap_or_else(|| folder.join(file.name));
        user_error(format!("{}: {error}", path.display()))
    };
    folder.map(|folder| file.state(folder).map_err(|error| wrong(folder, error))).transpose()
}

/// One word of what the folder has, the file, and its SHA-256 where that is not the published one.
fn words(state: &WeightsState) -> (&'static str, Option<&Path>, Option<&str>) {
    match state {
        WeightsState::Missing => ("missing", None, None),
        WeightsState::AsPublished { path } => ("as published", Some(path), None),
        WeightsState::Unchecked { path, sha256 } => ("not checked", Some(path), Some(sha256)),
        WeightsState::Different { path, sha256 } => ("different", Some(path), Some(sha256)),
    }
}

fn to_json(row: &Row) -> serde_json::Value {
    let file = row.file;
    let mut all = json!({
        "file": file.name, "safetensors": file.safetensors, "content": file.content, "metrics": file.metrics,
        "origin": file.origin, "licence": file.licence, "bytes": file.bytes, "size": file.size, "sha256": file.sha256,
    });
    if let Some(state) = &row.state {
        let (word, path, found) = words(state);
        all["state"] = json!(word);
        all["path"] = json!(path);
        all["found_sha256"] = json!(found);
    }
    all
}

fn to_text(row: &Row) -> String {
    let file = row.file;
    let mut text = format!("{}: {}\n", file.name, file.content);
    text += &format!("  for {}; {}; licence: {}\n", file.metrics.join(", "), file.size, file.licence);
    text += &format!("  from {}\n", file.origin);
    if let Some(name) = file.safetensors {
        text += &format!("  or {name}, with the same tensors\n");
    }
    text += &match file.sha256 {
        Some(sha256) if sha256.len() < 64 => format!("  SHA-256 begins with {sha256}\n"),
        Some(sha256) => format!("  SHA-256 {sha256}\n"),
        None => "  no published checksum is known\n".to_owned(),
    };
    if let Some(state) = &row.state {
        let name = |path: &Path| path.file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned());
        text += &match words(state) {
            (_, None, _) => "  missing\n".to_owned(),
            (_, Some(path), None) => format!("  here: {}, as published\n", name(path)),
            ("different", Some(path), Some(sha256)) => {
                format!("  here: {}, NOT the published content: SHA-256 {sha256}\n", name(path))
            }
            (_, Some(path), Some(sha256)) => format!("  here: {}, not checked: SHA-256 {sha256}\n", name(path)),
        };
    }
    text + "\n"
}
