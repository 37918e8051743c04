//! The house rules of `src/`: a room uses only rooms above it, and `burn` is named in one room.

use std::fs;
use std::path::{Path, PathBuf};

const ROOMS: [&str; 12] = [
    "math",
    "brdf",
    "dataset",
    "descriptor",
    "metric",
    "fit",
    "train",
    "evaluation",
    "render",
    "study",
    "report",
    "cli",
];

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// (room, path inside src, code lines) of every file of the library.
fn sources() -> Vec<(String, String, Vec<String>)> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    files.sort();
    files
        .iter()
        .map(|path| {
            let inside = path.strip_prefix(&src).unwrap().to_string_lossy().into_owned();
            let room = inside.split(['/', '.']).next().unwrap().to_owned();
            let code = fs::read_to_string(path)
                .unwrap()
                .lines()
                .filter(|line| !line.trim_start().starts_with("//"))
                .map(str::to_owned)
                .collect();
            (room, inside, code)
        })
        .collect()
}

/// The rooms that a line of code names through `crate::room`.
fn named_rooms(line: &str) -> Vec<&str> {
    line.match_indices("crate::")
        .filter_map(|(at, _)| {
            let rest = &line[at + "crate::".len()..];
            let name = rest.split(|c: char| !c.is_alphanumeric() && c != '_').next()?;
            ROOMS.iter().copied().find(|room| *room == name)
        })
        .collect()
}

#[test]
fn a_room_uses_only_rooms_above_it() {
    let position = |room: &str| ROOMS.iter().position(|r| *r == room);
    let mut uses = 0;
    for (room, inside, code) in sources() {
        let Some(own) = position(&room) else { continue };
        for line in &code {
            for other in named_rooms(line) {
                uses += 1;
                let theirs = position(other).unwrap();
                let siblings = [room.as_str(), other] == ["train", "fit"];
                assert!(theirs <= own && !siblings, "{inside}: `{}` reaches from {room} down to {other}", line.trim());
            }
            assert!(
                !line.trim_start().starts_with("use crate::{"),
                "{inside}: `{}`: name the rooms one `use` at a time, so that their order can be checked",
                line.trim()
            );
        }
    }
    assert!(uses > 20, "only {uses} uses between rooms were seen: the reader of the sources is broken");
}

#[test]
fn every_room_of_the_library_is_listed() {
    for (room, inside, _) in sources() {
        assert!(room == "main" || room == "lib" || ROOMS.contains(&room.as_str()), "{inside} is in no known room");
    }
}

#[test]
fn burn_is_named_in_one_room() {
    let mut seen = 0;
    for (_, inside, code) in sources() {
        let names = |line: &String| line.contains("burn::") || line.contains("burn_");
        if inside.starts_with("train/neural/") {
            seen += code.iter().filter(|l| names(l)).count();
        } else if let Some(line) = code.iter().find(|l| names(l)) {
            panic!("{inside} names burn: `{}`", line.trim());
        }
    }
    assert!(seen > 0, "no use of burn was seen in train/neural: the reader of the sources is broken");
}
