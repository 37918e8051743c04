//! Pages in a real browser: as wide as a phone and as a desk, light and dark.
//!
//! The browser, one of Chromium's family, is named by `VERNIS_BROWSER` or found on PATH. It opens files, as a reader
//! of a report does, and writes its console to standard error, from which all that is known here comes.

use maud::{Markup, PreEscaped, html};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use vernis::report::OutputFolder;
use vernis::report::page::materials::{Candidate, Material};
use vernis::report::page::{Head, document};
use vernis::report::tables::Table;
use vernis::report::write_benchmark;

const PROBE: &str = include_str!("browser/probe.js");
const NAMES: [&str; 5] = ["chromium", "chromium-browser", "google-chrome", "chrome", "chrome-headless-shell"];
const WIDTHS: [u32; 2] = [380, 1280];
const PATIENCE: Duration = Duration::from_secs(120);

/// The browser to test with, or a word to say that there is none.
fn browser() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("VERNIS_BROWSER").filter(|name| !name.is_empty()) {
        return Some(named.into());
    }
    // What some systems install under such a name only says how to get a browser.
    let answers = |name: &&str| Command::new(name).arg("--version").output().is_ok_and(|o| o.status.success());
    let found = NAMES.into_iter().find(answers).map(PathBuf::from);
    if found.is_none() {
        eprintln!("skipped: VERNIS_BROWSER is not set, and none of {NAMES:?} is on PATH");
    }
    found
}

/// What a reader meets in a page at one width, in light or dark.
#[derive(Debug, Deserialize)]
struct Seen {
    width: u32,
    dark: bool,
    pictures: usize,
    /// Tables that are wider than the page.
    scrolling: usize,
    /// Everything that is wrong, in words.
    problems: Vec<String>,
    /// The cells of every column in the order of its first and of its second click, by caption and heading.
    columns: BTreeMap<String, [Vec<String>; 2]>,
    gallery: Option<SeenGallery>,
}

/// What a reader does in a gallery.
#[derive(Debug, Deserialize)]
struct SeenGallery {
    /// Material and method of every pair that is shown, by what they are sorted by, smallest and largest first.
    sorted: BTreeMap<String, [Vec<String>; 2]>,
    /// The same with the last material chosen, and with the last method.
    filtered: [Vec<String>; 2],
    /// The dialog of the pair with the lowest score, and after each key: left, right, h, left.
    opened: Vec<Opened>,
    /// Whether Escape closed the dialog, and the keyboard is where it was.
    closed: bool,
    back: bool,
}

#[derive(Debug, Deserialize)]
struct Opened {
    title: String,
    rows: Vec<Vec<String>>,
    /// The ends of the paths of both pictures.
    pictures: Vec<String>,
    /// Whether the page says that its pictures are not beside it.
    alone: bool,
}

/// Ends the browser with the test, however that ends.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What is seen of a page at each width in light and dark, and what else the console says.
fn look(browser: &Path, page: &str) -> Result<(Vec<Seen>, Vec<String>), String> {
    look_in(tempfile::tempdir().unwrap().path(), browser, page)
}

/// The same of a page that lies in `folder`, beside its files.
fn look_in(folder: &Path, browser: &Path, page: &str) -> Result<(Vec<Seen>, Vec<String>), String> {
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    // The encoding must be said in the first 1024 bytes, which the probe fills.
    let probed = page.replacen("<head>", &format!("<head><meta charset=\"utf-8\"><script>{PROBE}</script>"), 1);
    assert_ne!(probed, page, "a page has a head");
    write("page.html", &probed);
    // A window cannot be made as narrow as a phone everywhere; a frame can, and it hands its scheme down to its page.
    let frame = |width: u32, scheme: &str| {
        html! {
            iframe src="page.html" width=(width) height="900" style={ "border: 0; color-scheme: " (scheme) } {}
        }
    };
    let frames = html! { @for width in WIDTHS { @for scheme in ["light", "dark"] { (frame(width, scheme)) } } };
    write("frames.html", &format!("<!DOCTYPE html>{}", frames.into_string()));
    let log = folder.join("log");
    let started = Command::new(browser)
        // Pages of our own need no sandbox, which containers lack; without a profile no console is written.
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run"])
        .args(["--enable-logging=stderr"])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .arg(format!("file://{}", folder.join("frames.html").display()))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(fs::File::create(&log).unwrap())
        .spawn();
    let wrong = |what: &str, why: &dyn std::fmt::Display| format!("{}: {what}: {why}", browser.display());
    let mut running = Running(started.map_err(|e| wrong("cannot be started", &e))?);
    let start = Instant::now();
    loop {
        // Asked before the log is read, so that nothing is missed of one that ends.
        let ended = running.0.try_wait().unwrap();
        let text = read_whole_lines(&log).unwrap();
        let (seen, said) = understand(&text);
        if seen.len() == 2 * WIDTHS.len() {
            return Ok((seen, said));
        }
        if let Some(status) = ended {
            return Err(wrong("ended before it had shown the page", &format!("{status}\n{text}")));
        }
        if start.elapsed() > PATIENCE {
            return Err(wrong("has not shown the page in time", &text));
        }
        sleep(Duration::from_millis(50));
    }
}

/// A file up to its last end of line: the rest may still be written.
fn read_whole_lines(path: &Path) -> io::Result<String> {
    let text = String::from_utf8_lossy(&fs::read(path)?).into_owned();
    Ok(text[..text.rfind('\n').map_or(0, |end| end + 1)].to_owned())
}

/// What the probes told of the lines of the console in a log, and the other ones.
fn understand(log: &str) -> (Vec<Seen>, Vec<String>) {
    let (mut seen, mut said) = (Vec::new(), Vec::new());
    for line in log.lines().filter(|line| line.contains(":CONSOLE")) {
        match line.split_once("\"SEEN ").and_then(|(_, rest)| rest.rsplit_once("\", source:")) {
            Some((json, _)) => seen.push(serde_json::from_str(json).unwrap()),
            None => said.push(line.to_owned()),
        }
    }
    (seen, said)
}

/// Looks at a page that must be without fault.
fn look_without_fault(browser: &Path, page: &str) -> Vec<Seen> {
    without_fault(look(browser, page))
}

fn without_fault(found: Result<(Vec<Seen>, Vec<String>), String>) -> Vec<Seen> {
    let (seen, said) = found.unwrap_or_else(|message| panic!("{message}"));
    assert!(said.is_empty(), "{said:#?}");
    let mut ways: Vec<(u32, bool)> = seen.iter().map(|s| (s.width, s.dark)).collect();
    ways.sort_unstable();
    assert_eq!(ways, [(380, false), (380, true), (1280, false), (1280, true)]);
    for seen in &seen {
        assert!(seen.problems.is_empty(), "{} pixels, dark {}: {:#?}", seen.width, seen.dark, seen.problems);
    }
    seen
}

fn page(body: &Markup) -> String {
    let head = Head { title: "made-up".into(), synthetic: true, provenance: vec![("seed".into(), "1".into())] };
    document(&head, &html! {}, body)
}

fn table(title: &str, columns: &[&str], rows: &[&[&str]]) -> Table {
    let words = |cells: &[&str]| cells.iter().map(|cell| (*cell).to_owned()).collect();
    Table { title: title.into(), columns: words(columns), rows: rows.iter().map(|row| words(row)).collect() }
}

/// `vernis report` with a benchmark: every kind of section that a page can have.
#[test]
fn a_report_has_no_fault_in_a_browser() {
    let Some(browser) = browser() else { return };
    let dir = tempfile::tempdir().unwrap();
    let record = super::report::record_of_the_embedded_study();
    write_benchmark(&OutputFolder::create(dir.path().join("judged")).unwrap(), &record, &[], "lamps").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
    command.args(["report", "--study", "synthetic", "--benchmark", "judged", "--out", "page"]);
    let output = command.current_dir(dir.path()).env_remove("VERNIS_DATA").output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let html = fs::read_to_string(dir.path().join("page/report.html")).unwrap();
    for seen in look_without_fault(&browser, &html) {
        // 40 materials and 349 candidates.
        assert_eq!(seen.pictures, 40 + 349);
        let tables: BTreeSet<&str> = seen.columns.keys().map(|name| name.split_once(" | ").unwrap().0).collect();
        assert_eq!(tables.len(), html.matches("<caption>").count(), "{tables:?}");
    }
}

/// The page that `vernis train` and `vernis benchmark` write.
#[test]
fn a_benchmark_has_no_fault_in_a_browser() {
    let Some(browser) = browser() else { return };
    let dir = tempfile::tempdir().unwrap();
    let mut png = io::Cursor::new(Vec::new());
    image::RgbaImage::new(48, 48).write_to(&mut png, image::ImageOutputFormat::Png).unwrap();
    let picture = png.into_inner();
    let candidate = Candidate {
        method: "GGX <new>".into(),
        picture: picture.clone(),
        mos: 4.25,
        predicted: Some(3.5),
        stimulus: None,
    };
    let material = Material {
        name: "teflon".into(),
        reference: picture,
        candidates: vec![candidate],
        error: Some(0.75),
        stimuli: [None, None],
    };
    let folder = OutputFolder::create(dir.path()).unwrap();
    let path = write_benchmark(&folder, &super::report::record(false), &[material], "lamps").unwrap();
    let seen = look_without_fault(&browser, &fs::read_to_string(path).unwrap());
    assert!(seen.iter().all(|s| s.pictures == 2 && s.columns.len() > 30), "{seen:?}");
    // The tables of all metrics have eleven columns, which no page of 1,280 pixels has room for.
    assert!(seen.iter().all(|s| s.scrolling >= 2), "{seen:?}");
}

/// `gallery.html` as a reader uses it. The orders were written down by hand from the study in [`super::gallery`].
#[test]
fn a_gallery_is_sorted_filtered_opened_and_closed() {
    let Some(browser) = browser() else { return };
    let place = super::gallery::Place::rendered();
    let page = place.report(&["--benchmark", "judged", "--scores", "scores.csv"]);
    let html = fs::read_to_string(page.join("gallery.html")).unwrap();
    for seen in without_fault(look_in(&page, &browser, &html)) {
        // A reference, a hidden reference and two candidates of each of two materials.
        assert_eq!(seen.pictures, 8);
        let seen = seen.gallery.unwrap();
        let order = |names: [&str; 4]| names.map(str::to_owned).to_vec();
        let by_material = order(["stone WARD", "stone A/B", "wood WARD", "wood <new>"]);
        let expected = BTreeMap::from(
            [
                ("material", by_material.clone(), order(["wood WARD", "wood <new>", "stone WARD", "stone A/B"])),
                (
                    "MOS",
                    order(["wood WARD", "stone WARD", "wood <new>", "stone A/B"]),
                    order(["stone A/B", "wood <new>", "stone WARD", "wood WARD"]),
                ),
                (
                    "vernis",
                    order(["wood <new>", "stone WARD", "wood WARD", "stone A/B"]),
                    order(["stone A/B", "wood WARD", "stone WARD", "wood <new>"]),
                ),
                (
                    "D9.Cl",
                    order(["stone A/B", "wood WARD", "wood <new>", "stone WARD"]),
                    order(["stone WARD", "wood <new>", "wood WARD", "stone A/B"]),
                ),
                // What is missing comes last.
                (
                    "mine </script>",
                    order(["wood <new>", "stone WARD", "wood WARD", "stone A/B"]),
                    order(["wood WARD", "stone WARD", "wood <new>", "stone A/B"]),
                ),
            ]
            .map(|(by, up, down)| (by.to_owned(), [up, down])),
        );
        assert_eq!(seen.sorted, expected);
        assert_eq!(seen.filtered[0], by_material[2..]);
        assert_eq!(seen.filtered[1], [by_material[0].as_str(), by_material[2].as_str()]);
        let row = |name: &str, value: &str, what: &str| [name, value, what].map(str::to_owned).to_vec();
        let lowest = [
            row("MOS", "2.00", "as rated"),
            row("vernis", "3.50", "predicted MOS"),
            row("D9.Cl", "0.02", "distance"),
            row("mine </script>", "3000000", "scores.csv"),
        ];
        let titles: Vec<&str> = seen.opened.iter().map(|opened| opened.title.as_str()).collect();
        // There is nothing before the first.
        assert_eq!(titles, ["wood, WARD", "wood, WARD", "stone, WARD", "stone, WARD", "wood, WARD"]);
        assert_eq!(seen.opened[0].rows, lowest);
        assert_eq!(seen.opened[4].rows, lowest);
        let pictures: Vec<String> = seen.opened.iter().map(|opened| opened.pictures.join(" ")).collect();
        assert_eq!(
            pictures,
            [
                "wood/reference.png wood/WARD.png",
                "wood/reference.png wood/WARD.png",
                "stone/reference.png stone/WARD.png",
                "stone/hidden-reference.png stone/WARD.png",
                "wood/hidden-reference.png wood/WARD.png",
            ]
        );
        assert!(seen.closed && seen.back && seen.opened.iter().all(|opened| !opened.alone));
    }
    // The page alone shows its small pictures, and says so; the console tells what it did not find.
    let (seen, said) = look(&browser, &html).unwrap_or_else(|message| panic!("{message}"));
    assert!(said.iter().all(|line| line.contains("ERR_FILE_NOT_FOUND")), "{said:#?}");
    for Seen { gallery, problems, .. } in seen {
        let small = |opened: &Opened| opened.alone && opened.pictures == ["small", "small"];
        assert!(problems.is_empty() && gallery.unwrap().opened.iter().all(small), "{problems:#?}");
    }
}

/// The order was written down by hand.
#[test]
fn columns_are_sorted_by_their_numbers_and_what_is_missing_comes_last() {
    let Some(browser) = browser() else { return };
    let rows: [&[&str]; 5] = [
        &["b", "0.5 [0.1, 0.9]", "[-0.01, 0.2]", "0.02"],
        &["D", "10", "[+0.1, +0.2]", "-"],
        &["a", "-0.5", "[-0.3, -0.1]", "1e-5"],
        &["c", "\u{2212}2", "-", "< 1e-300"],
        &["E", "+9", "[-0.2, 0]", "1"],
    ];
    let body = table("of five", &["name", "value", "interval", "p"], &rows).to_html();
    let up_and_down: [(&str, [&str; 5], [&str; 5]); 4] = [
        ("name", ["a", "b", "c", "D", "E"], ["E", "D", "c", "b", "a"]),
        (
            "value",
            ["\u{2212}2", "-0.5", "0.5 [0.1, 0.9]", "+9", "10"],
            ["10", "+9", "0.5 [0.1, 0.9]", "-0.5", "\u{2212}2"],
        ),
        (
            "interval",
            ["[-0.3, -0.1]", "[-0.2, 0]", "[-0.01, 0.2]", "[+0.1, +0.2]", "-"],
            ["[+0.1, +0.2]", "[-0.01, 0.2]", "[-0.2, 0]", "[-0.3, -0.1]", "-"],
        ),
        ("p", ["< 1e-300", "1e-5", "0.02", "1", "-"], ["1", "0.02", "1e-5", "< 1e-300", "-"]),
    ];
    for seen in look_without_fault(&browser, &page(&body)) {
        assert_eq!(seen.columns.len(), 4);
        for (column, up, down) in &up_and_down {
            let [first, second] = &seen.columns[&format!("of five | {column}")];
            assert_eq!(
                (first.as_slice(), second.as_slice()),
                (&up.map(str::to_owned)[..], &down.map(str::to_owned)[..])
            );
        }
    }
}

/// The tests above can fail: each fault of a page is told.
#[test]
fn faults_are_seen_in_a_browser() {
    let Some(browser) = browser() else { return };
    let body = html! {
        div style="width: 2000px" { "wide" }
        img src="missing.png" alt="";
        link rel="stylesheet" href="http://elsewhere.invalid/style.css";
        p style="color: #777; background: #888" { "faint" }
        (table("stuck", &["name", "value"], &[&["a", "2"], &["b", "1"]]).to_html())
        (table("bare", &["name"], &[&["a"]]).to_html())
        (table("broad", &["name", "value"], &[&["a", "1"]]).to_html())
        style { "table { min-width: 90rem; } .table { background: none; } .table::before { content: none !important; }" }
        style { "th:first-child { min-width: 40rem; } dt { width: 30rem; }" }
        script { (PreEscaped("
            const [stuck, bare] = document.querySelectorAll('table');
            stuck.tHead.addEventListener('click', event => event.stopPropagation(), true);
            addEventListener('load', () => bare.querySelector('button').remove());
            console.error('told to the console');
            nothing.happens();
        ")) }
    };
    let (seen, said) = look(&browser, &page(&body)).unwrap_or_else(|message| panic!("{message}"));
    for part in ["told to the console", "nothing is not defined"] {
        assert!(said.iter().any(|line| line.contains(part)), "{part}: {said:#?}");
    }
    for Seen { width, problems, .. } in &seen {
        for part in [
            "too wide: 2",
            "no picture: <img src=\"missing.png\"",
            "asked for http://elsewhere.invalid/style.css",
            "contrast 1.3: <p",
            "not sorted, ascending: stuck | value",
            "not sorted, descending: stuck | value",
            "cannot be sorted: bare",
            "does not say that it scrolls: <div class=\"table\"",
            "does not show that it scrolls: <div class=\"table\"",
            "little room in a table: <div class=\"table\"",
            "little room in a list: <dd>",
        ] {
            let told = problems.iter().any(|problem| problem.contains(part));
            assert!(told || (*width > 380 && part.starts_with("little room")), "{part}: {problems:#?}");
        }
    }
    let message = look(Path::new("/no/such/browser"), &page(&html! {})).unwrap_err();
    assert!(message.contains("/no/such/browser: cannot be started"), "{message}");
    #[cfg(unix)]
    {
        let message = look(Path::new("false"), &page(&html! {})).unwrap_err();
        assert!(message.contains("false: ended before it had shown the page"), "{message}");
    }
}
