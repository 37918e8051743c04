//! What every command that writes has in common. One rule: an input is never replaced, whatever its path is spelled like or
//! linked from, and an earlier result only with --replace, or where the command continues it.

use super::user_error;
use super::view::View;
use crate::report::OutputFolder;
use anyhow::Result;
use clap::Args;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use vernis_metric::brdf::BrdfSource;

/// What stands for standard input or output in the place of a file.
pub const STANDARD: &str = "-";

/// May what an earlier run wrote be replaced?
#[derive(Args, Clone, Copy)]
pub struct Replace {
    /// Replace earlier results. Inputs are never replaced.
    #[arg(long)]
    replace: bool,
    /// Whether the command goes on with what it finds.
    #[arg(skip)]
    continues: bool,
}

impl Replace {
    /// Of a command that continues what it finds: its own earlier results are part of the work.
    pub const CONTINUES: Self = Self { replace: true, continues: true };
}

/// The files that a command reads.
#[derive(Default)]
pub struct Inputs {
    /// As they were named.
    named: BTreeSet<PathBuf>,
    /// The same by where they lie, links followed.
    placed: BTreeMap<PathBuf, PathBuf>,
    /// And by what the system calls them, for hard links.
    numbered: BTreeMap<(u64, u64), PathBuf>,
}

impl Inputs {
    /// A file; a name that is no file is none.
    pub fn file(mut self, path: impl AsRef<Path>) -> Self {
        let path = path.as_ref();
        if path.is_file() && self.named.insert(path.to_owned()) {
            self.placed.insert(place(path), path.to_owned());
            self.numbered.extend(number(path).map(|number| (number, path.to_owned())));
        }
        self
    }

    /// Several files or names.
    pub fn files<P: AsRef<Path>>(self, paths: impl IntoIterator<Item = P>) -> Self {
        paths.into_iter().fold(self, Self::file)
    }

    /// The files of BRDFs.
    pub fn sources<'a>(self, sources: impl IntoIterator<Item = &'a BrdfSource>, data: Option<&Path>) -> Self {
        // One that cannot be found is told when it is opened.
        self.files(sources.into_iter().filter_map(|source| source.locate(data).ok().flatten()))
    }

    /// The file of a BRDF in the source notation.
    pub fn notation(self, notation: &str, data: Option<&Path>) -> Self {
        self.sources(BrdfSource::parse(notation).iter(), data)
    }

    /// The light probe and the mesh.
    pub fn view(self, view: &View) -> Self {
        self.files(view.files())
    }

    /// That `path` is none of them.
    fn spare(&self, path: &Path) -> Result<()> {
        match self.placed.get(&place(path)).or_else(|| self.numbered.get(&number(path)?)) {
            Some(input) => {
                let same = if input == path { String::new() } else { format!("{}, ", input.display()) };
                let article = if same.is_empty() { "an" } else { "which is an" };
                Err(user_error(format!(
                    "{} is {same}{article} input of this command; inputs are never replaced: write to another file",
                    path.display()
                )))
            }
            None => Ok(()),
        }
    }
}

/// Where a path leads: links are followed as far as it exists.
fn place(path: &Path) -> PathBuf {
    let in_folder = || {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Some(fs::canonicalize(folder).ok()?.join(path.file_name()?))
    };
    fs::canonicalize(path).ok().or_else(in_folder).unwrap_or_else(|| path.to_owned())
}

/// Device and number of a file: the same for all hard links of one.
#[cfg(unix)]
fn number(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    fs::metadata(path).ok().map(|m| (m.dev(), m.ino()))
}

#[cfg(not(unix))]
fn number(_path: &Path) -> Option<(u64, u64)> {
    None
}

/// The folder and name of a file to write, found unwritable before the work.
pub fn file(path: &Path, inputs: &Inputs, replace: Replace) -> Result<(OutputFolder, String)> {
    let name = path.file_name().and_then(|n| n.to_str()).filter(|_| !path.is_dir());
    let name = name.ok_or_else(|| {
        user_error(format!("--out {} is a folder or has no name; it must be the name of a file", path.display()))
    })?;
    inputs.spare(path)?;
    refuse_earlier(path, replace)?;
    let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Ok((OutputFolder::create(parent).map_err(user_error)?, name.to_owned()))
}

/// That nothing is called `path` yet, or that it may be replaced.
pub fn refuse_earlier(path: &Path, replace: Replace) -> Result<()> {
    // A link that leads nowhere is something as well.
    if replace.replace || path.symlink_metadata().is_err() {
        return Ok(());
    }
    Err(user_error(format!("{} exists already; use --replace to replace it", path.display())))
}

/// A folder for the files called `names`, found unwritable before the work. What an earlier run wrote into a folder that the user
/// named stays without --replace; one that vernis named itself, such as out/synthetic, is vernis's to replace.
pub fn folder<N: AsRef<str>>(
    named: Option<&Path>,
    default: impl FnOnce() -> PathBuf,
    names: &[N],
    inputs: &Inputs,
    replace: Replace,
) -> Result<OutputFolder> {
    let path = named.map_or_else(default, Path::to_owned);
    for name in names {
        let file = path.join(name.as_ref());
        inputs.spare(&file)?;
        if named.is_some() {
            refuse_earlier(&file, replace)?;
        }
    }
    // Files that belong together are of one run; a command that continues has locks of its own, or shares its folder.
    let made = if replace.continues { OutputFolder::create(path) } else { OutputFolder::claim(path) };
    made.map_err(user_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(result: Result<OutputFolder>) -> String {
        result.err().map(|e| e.to_string()).unwrap_or_default()
    }

    #[test]
    fn inputs_stay_however_they_are_spelled() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        fs::create_dir(at("sub")).unwrap();
        for name in ["in.csv", "other.csv"] {
            fs::write(at(name), "kept").unwrap();
        }
        fs::hard_link(at("in.csv"), at("hard.csv")).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(at("in.csv"), at("soft.csv")).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(place.path(), at("link")).unwrap();
        let inputs = || Inputs::default().file(at("in.csv")).file(at("missing.csv"));
        let mut spellings = vec!["in.csv", "sub/../in.csv", "./in.csv", "hard.csv"];
        if cfg!(unix) {
            spellings.extend(["soft.csv", "link/in.csv"]);
        }
        for name in spellings {
            let error =
                file(&at(name), &inputs(), Replace { replace: true, continues: false }).unwrap_err().to_string();
            assert!(error.contains("input of this command; inputs are never replaced"), "{name}: {error}");
        }
        assert!(file(&at("missing.csv"), &inputs(), Replace { replace: false, continues: false }).is_ok());
        let error =
            file(&at("other.csv"), &inputs(), Replace { replace: false, continues: false }).unwrap_err().to_string();
        assert!(error.ends_with("other.csv exists already; use --replace to replace it"), "{error}");
        assert!(file(&at("other.csv"), &inputs(), Replace { replace: true, continues: false }).is_ok());
        assert_eq!(fs::read(at("in.csv")).unwrap(), b"kept");
    }

    #[test]
    fn folders_that_vernis_names_are_its_own() {
        let place = tempfile::tempdir().unwrap();
        let own = place.path().join("own");
        fs::create_dir(&own).unwrap();
        fs::write(own.join("report.html"), "earlier").unwrap();
        let of = |named: Option<&Path>, inputs: &Inputs, replace: bool| {
            refused(folder(
                named,
                || own.clone(),
                &["a.csv", "report.html"],
                inputs,
                Replace { replace, continues: false },
            ))
        };
        let none = Inputs::default();
        assert_eq!(of(None, &none, false), "");
        assert_eq!(of(Some(&own), &none, true), "");
        assert!(of(Some(&own), &none, false).contains("report.html exists already; use --replace"));
        let read = Inputs::default().file(own.join("report.html"));
        assert!(of(None, &read, true).contains("inputs are never replaced"));
    }
}
