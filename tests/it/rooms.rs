//! The house rules that the compiler does not keep: inside a package a room uses only rooms above it, `burn` is named where
//! networks are, and nothing but the program knows of a terminal. Between packages the compiler keeps the order.

use std::fs;
use std::path::{Path, PathBuf};

/// A package, the folder of its library, and its rooms, top to bottom; with rooms of `vernis-study` where `vernis` names them as its own.
const PACKAGES: [(&str, &str, &[&str]); 4] = [
    ("vernis-metric", "crates/vernis-metric/src", &["math", "io", "brdf", "light", "descriptor", "metric", "fit"]),
    ("vernis-image", "crates/vernis-image/src", &["picture", "scene", "trace", "display", "metric", "stimulus"]),
    ("vernis-study", "crates/vernis-study/src", &["dataset", "samples", "train", "evaluation", "panel"]),
    ("vernis", "src", &["dataset", "samples", "train", "evaluation", "experiment", "panel", "report", "cli"]),
];

/// Rooms beside each other, which neither use each other nor are meant to.
const STRANGERS: [[&str; 2]; 2] = [["panel", "train"], ["panel", "experiment"]];

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

/// (room, path inside the package, code lines) of every file of a package.
fn sources(folder: &str) -> Vec<(String, String, Vec<String>)> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    files.sort();
    files
        .iter()
        .map(|path| {
            let inside = path.strip_prefix(&src).unwrap().to_string_lossy().into_owned();
            let room = inside.split(['/', '\\', '.']).next().unwrap().to_owned();
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
fn named_rooms<'a>(line: &str, rooms: &[&'a str]) -> Vec<&'a str> {
    line.match_indices("crate::")
        .filter_map(|(at, _)| {
            let rest = &line[at + "crate::".len()..];
            let name = rest.split(|c: char| !c.is_alphanumeric() && c != '_').next()?;
            rooms.iter().copied().find(|room| *room == name)
        })
        .collect()
}

#[test]
fn a_room_uses_only_rooms_above_it() {
    for (package, folder, rooms) in PACKAGES {
        let position = |room: &str| rooms.iter().position(|r| *r == room);
        let mut uses = 0;
        for (room, inside, code) in sources(folder) {
            let Some(own) = position(&room) else { continue };
            for line in &code {
                for other in named_rooms(line, rooms) {
                    uses += 1;
                    let strangers = STRANGERS.contains(&[room.as_str(), other]);
                    assert!(
                        position(other).unwrap() <= own && !strangers,
                        "{package}, {inside}: `{}` reaches from {room} to {other}",
                        line.trim()
                    );
                }
                assert!(
                    !line.trim_start().starts_with("use crate::{"),
                    "{package}, {inside}: `{}`: name the rooms one `use` at a time, so that their order can be checked",
                    line.trim()
                );
            }
        }
        assert!(uses > 4, "{package}: only {uses} uses between rooms were seen: the reader of the sources is broken");
    }
}

#[test]
fn every_room_is_listed() {
    for (package, folder, rooms) in PACKAGES {
        for (room, inside, _) in sources(folder) {
            let known = ["main", "lib", "prelude"].contains(&room.as_str()) || rooms.contains(&room.as_str());
            assert!(known, "{package}: {inside} is in no known room");
        }
    }
}

#[test]
fn burn_is_named_where_networks_are() {
    let rooms = [("crates/vernis-study/src", "train/neural/"), ("crates/vernis-image/src", "metric/network/")];
    let mut seen = [0; 2];
    for (_, folder, _) in PACKAGES {
        for (_, inside, code) in sources(folder) {
            let names = |line: &String| line.contains("burn::") || line.contains("burn_");
            let room = rooms.iter().position(|(package, room)| folder == *package && inside.starts_with(room));
            if let Some(room) = room {
                seen[room] += code.iter().filter(|l| names(l)).count();
            } else if let Some(line) = code.iter().find(|l| names(l)) {
                panic!("{inside} names burn: `{}`", line.trim());
            }
        }
    }
    assert!(
        seen.iter().all(|n| *n > 0),
        "burn was seen {seen:?} times in {rooms:?}: the reader of the sources is broken"
    );
}

#[test]
fn only_the_program_knows_of_a_terminal() {
    const TERMINAL: [&str; 6] = ["println!", "eprintln!", "print!(", "clap::", "indicatif::", "anyhow::"];
    let mut seen = 0;
    for (_, folder, _) in PACKAGES {
        for (room, inside, code) in sources(folder) {
            // Tests at the end of a file may print.
            let library = code.iter().take_while(|line| !line.starts_with("#[cfg(test)]"));
            for line in library.filter(|line| TERMINAL.iter().any(|name| line.contains(name))) {
                seen += 1;
                assert!(room == "cli" || room == "main", "{inside} knows of a terminal: `{}`", line.trim());
            }
        }
    }
    assert!(seen > 20, "the program prints nothing: the reader of the sources is broken");
}

/// They are compiled for every loop; `math::parallel` is compiled once. `vernis` itself is compiled without optimisation.
#[test]
fn parallel_loops_are_those_of_one_file() {
    const LOOPS: [&str; 5] = ["par_iter", "par_chunks", "par_bridge", "rayon::join", "rayon::scope"];
    let mut seen = 0;
    for (package, folder, _) in PACKAGES.into_iter().filter(|(package, ..)| *package != "vernis") {
        for (_, inside, code) in sources(folder) {
            let library = code.iter().take_while(|line| !line.starts_with("#[cfg(test)]"));
            for line in library.filter(|line| LOOPS.iter().any(|name| line.contains(name))) {
                seen += 1;
                assert_eq!(
                    (package, inside.as_str()),
                    ("vernis-metric", "math/parallel.rs"),
                    "a parallel loop of its own: `{}`",
                    line.trim()
                );
            }
        }
    }
    assert!(seen > 1, "no parallel loop was seen: the reader of the sources is broken");
}
