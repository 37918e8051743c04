//! `vernis score`: rows that fail, how tables are written, order, streams, interruption.

use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

struct Place(tempfile::TempDir);

impl Place {
    /// Six references with three candidates each, interleaved.
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        for k in 0..6 {
            place.write(&format!("r{k}.json"), ward(0.1 + 0.05 * f64::from(k)));
            for c in 0..3 {
                place.write(&format!("c{k}_{c}.json"), ward(0.12 + 0.05 * f64::from(k) + 0.02 * f64::from(c)));
            }
        }
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        fs::write(self.path(name), text).unwrap();
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
        command.arg("score").args(args).current_dir(self.0.path()).env_remove("VERNIS_DATA");
        command
    }

    fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    /// Standard output and standard error of a run that ends with `code`.
    fn said(&self, args: &[&str], code: i32) -> [String; 2] {
        let output = self.run(args);
        let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        assert_eq!(output.status.code(), Some(code), "{args:?}: {said:?}");
        said
    }
}

fn ward(alpha: f64) -> String {
    format!(r#"{{"model":"ward","kd":[0.2,0.1,0.05],"ks":[0.1,0.1,0.1],"alpha":{alpha}}}"#)
}

/// Pairs of [`Place::new`], each reference three times with others in between.
fn interleaved() -> String {
    let row = |(c, k): (usize, usize)| format!("r{k}.json,c{k}_{c}.json\n");
    let rows: String = (0..3).flat_map(|c| (0..6).map(move |k| (c, k))).map(row).collect();
    format!("reference,candidate\n{rows}")
}

fn rows(text: &str) -> (Vec<String>, Vec<Vec<String>>) {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let words = |record: &csv::StringRecord| record.iter().map(str::to_owned).collect::<Vec<_>>();
    let header = words(reader.headers().unwrap());
    (header, reader.records().map(|record| words(&record.unwrap())).collect())
}

/// A spreadsheet that opens the table computes nothing that the table's author did not write.
#[test]
fn reasons_are_no_formulas() {
    let place = Place::new();
    place.write("pairs.csv", "reference,candidate\nr0.json,c0_0.json\nr0.json,=1+1.json\n");
    let [out, _] = place.said(&["pairs.csv", "-m", "D1"], 2);
    let (_, rows) = rows(&out);
    assert!(rows[1][3].starts_with("'=1+1.json: no such file"), "{out}");
    assert_eq!(rows[1][1], "=1+1.json", "columns of the table stay as they are");
}

#[test]
fn a_bad_row_costs_that_row() {
    let place = Place::new();
    place.write("broken.json", "{");
    place.write("pairs.csv", interleaved() + "r0.json,nope.json\nr0.json,broken.json\nr1.json,\nr2.json,c2_0.json\n");
    let [out, error] = place.said(&["pairs.csv", "-m", "D9.Cl", "--out", "s.csv"], 2);
    assert_eq!(out, "22 pairs, 1 metric: s.csv\n");
    for (line, reason) in [(20, "nope.json: no such file"), (21, "broken.json"), (22, "`candidate` is empty")] {
        assert!(error.contains(&format!("vernis: pairs.csv, line {line}: {reason}")), "{error}");
    }
    assert!(error.ends_with("vernis: 3 of 22 rows could not be computed; the column `reason` says why\n"), "{error}");
    let (header, found) = rows(&fs::read_to_string(place.path("s.csv")).unwrap());
    assert_eq!(header, ["reference", "candidate", "D9.Cl", "reason"]);
    assert_eq!(found.len(), 22);
    for (k, row) in found.iter().enumerate() {
        let failed = (18..21).contains(&k);
        assert_eq!((row[2].is_empty(), row[3].is_empty()), (failed, !failed), "{row:?}");
    }
    assert_eq!(found[21][2], found[2][2]);
    assert!(!place.path("s.csv.partial").exists());
    // What is not there is known before the first distance, what is broken when it is read.
    let [_, error] = place.said(&["pairs.csv", "-m", "D9.Cl", "--out", "t.csv", "--strict"], 2);
    assert!(error.starts_with("vernis: pairs.csv, line 20: nope.json: no such file"), "{error}");
    assert!(error.ends_with("; so are 1 more of 22 rows\n") && !place.path("t.csv.partial").exists(), "{error}");
    place.write("pairs.csv", "reference,candidate\nr0.json,c0_0.json\nr0.json,broken.json\n");
    let [_, error] = place.said(&["pairs.csv", "-m", "D9.Cl", "--out", "t.csv", "--strict", "--threads", "1"], 2);
    assert!(error.starts_with("vernis: pairs.csv, line 3: broken.json"), "{error}");
    assert!(error.contains("; 1 finished rows are in t.csv.partial") && !place.path("t.csv").exists(), "{error}");
}

#[test]
fn no_row_at_all_is_no_result() {
    let place = Place::new();
    place.write("pairs.csv", "reference,candidate\nr0.json,a.json\nr9.json,c0_0.json\n");
    let [_, error] = place.said(&["pairs.csv", "-m", "D1", "--out", "s.csv"], 2);
    assert!(error.ends_with("; none of the 2 rows can be computed\n") && error.contains("line 2: a.json"), "{error}");
    assert!(!place.path("s.csv").exists());
}

#[test]
fn a_material_that_a_collection_lacks_is_known_before_the_work() {
    let place = Place::new();
    let fits = "teflon = Aggregate(Lambertian(albedo = [0.3, 0.3, 0.3]), NganWard(albedo = [0.1, 0.1, 0.1], roughness = 0.1))\n";
    place.write("some.fit", fits);
    place.write("pairs.csv", "reference,candidate\nsome.fit:teflon,r0.json\nsome.fit:teflom,r0.json\n");
    let [_, error] = place.said(&["pairs.csv", "-m", "D1", "--out", "s.csv", "--strict"], 2);
    assert!(error.contains("line 3: some.fit: ") && error.contains("teflom"), "{error}");
}

#[test]
fn rows_keep_their_order_and_numbers_whatever_the_number_of_threads() {
    let place = Place::new();
    place.write("pairs.csv", interleaved());
    let run = |threads: &str| place.said(&["pairs.csv", "-m", "D9.Cl", "-m", "D1", "--threads", threads], 0)[0].clone();
    let one = run("1");
    assert_eq!(one, run("3"));
    let (_, found) = rows(&one);
    let expected: Vec<String> = (0..3).flat_map(|c| (0..6).map(move |k| format!("c{k}_{c}.json"))).collect();
    assert_eq!(found.iter().map(|row| row[1].clone()).collect::<Vec<_>>(), expected);
    // The file has the bytes of the stream.
    place.said(&["pairs.csv", "-m", "D9.Cl", "-m", "D1", "--out", "s.csv"], 0);
    assert_eq!(fs::read_to_string(place.path("s.csv")).unwrap(), one);
}

#[test]
fn pairs_come_from_standard_input() {
    let place = Place::new();
    let mut command = place.command(&["-", "-m", "D1", "--out", "-"]);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    child.stdin.take().unwrap().write_all(b"reference,candidate\nr0.json,c0_0.json\nr0.json,no.json\n").unwrap();
    let output = child.wait_with_output().unwrap();
    let (_, found) = rows(&String::from_utf8(output.stdout).unwrap());
    assert_eq!((output.status.code(), found.len(), found[1][3].is_empty()), (Some(2), 2, false));
    assert!(
        String::from_utf8_lossy(&output.stderr).starts_with("vernis: standard input, line 3: no.json: no such file")
    );
}

#[test]
fn tables_are_read_as_the_world_writes_them() {
    let place = Place::new();
    place.write(
        "plain.csv",
        "reference,candidate,n\nr0.json,c0_0.json,\"1,5\"\nr1.json,\"c1_0.json?ks=0.1,0.1,0.1\",x\n",
    );
    let plain = place.said(&["plain.csv", "-m", "D1"], 0);
    assert_eq!(plain[1], "");
    let (_, expected) = rows(&plain[0]);
    for (text, note) in [
        (
            "Reference;CANDIDATE;n\r\nr0.json;c0_0.json;1,5\r\nr1.json;c1_0.json?ks=0.1,0.1,0.1;x\r\n",
            "p.csv: read with `;` between fields, `Reference` as reference and `CANDIDATE` as candidate\n",
        ),
        (
            "reference\tcandidate\tn\nr0.json\tc0_0.json\t1,5\nr1.json\tc1_0.json?ks=0.1,0.1,0.1\tx\n",
            "p.csv: read with tabs between fields\n",
        ),
        ("\u{feff}reference,candidate,n\nr0.json,c0_0.json,\"1,5\"\n\"r1.json\",\"c1_0.json?ks=0.1,0.1,0.1\",x\n", ""),
    ] {
        place.write("p.csv", text);
        let [out, error] = place.said(&["p.csv", "-m", "D1"], 0);
        assert_eq!(error, note);
        assert_eq!(rows(&out).1, expected, "{text}");
    }
    let wide: Vec<u8> = "\u{feff}reference,candidate\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    place.write("p.csv", wide);
    let [_, error] = place.said(&["p.csv", "-m", "D1"], 2);
    assert_eq!(error, "vernis: p.csv: the text is UTF-16; it must be UTF-8: save it as `CSV UTF-8`\n");
}

#[test]
fn names_of_columns_are_never_there_twice() {
    let place = Place::new();
    place.write("p.csv", "reference,candidate,D1,reason,x,x,,\nr0.json,c0_0.json,1,2,3,4,5,6\n");
    let [first, _] = place.said(&["p.csv", "-m", "D1"], 0);
    let header = ["reference", "candidate", "D1", "reason", "x", "x:2", "", "column 8", "D1:2", "reason:2"];
    assert_eq!(rows(&first).0, header);
    place.write("q.csv", first);
    let [second, _] = place.said(&["q.csv", "-m", "D1"], 0);
    assert_eq!(rows(&second).0[10..], ["D1:3", "reason:3"]);
    place.write("p.csv", "reference,reference,candidate\nr0.json,r0.json,c0_0.json\n");
    let [_, error] = place.said(&["p.csv", "-m", "D1"], 2);
    assert!(error.contains("p.csv, line 1: column `reference` is given twice"), "{error}");
}

/// A path starts at the folder of the file that names it, then where every command looks.
#[test]
fn relative_paths_start_at_the_folder_of_the_table() {
    let place = Place::new();
    fs::create_dir(place.path("sub")).unwrap();
    place.write("sub/r0.json", ward(0.4));
    place.write("sub/p.csv", "reference,candidate\nr0.json,sub/r0.json\nr0.json,r1.json\n");
    let [out, _] = place.said(&["sub/p.csv", "-m", "D1"], 0);
    let (_, found) = rows(&out);
    assert_eq!(found[0][2], "0", "both are the one beside the table");
    assert_ne!(found[1][2], "0");
}

#[test]
fn an_interrupted_run_keeps_its_finished_rows() {
    let place = Place::new();
    let rows_of_many: String =
        (0..4000).map(|k| format!("r{}.json,c0_0.json?alpha=0.{}\n", k / 1000, 1000 + k)).collect();
    place.write("many.csv", format!("reference,candidate\n{rows_of_many}"));
    let mut command = place.command(&["many.csv", "-m", "all-lp", "--out", "s.csv"]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let partial = place.path("s.csv.partial");
    let lines = || fs::read_to_string(&partial).map_or(0, |text| text.lines().count());
    let started = Instant::now();
    while lines() < 5 {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be killed");
        assert!(started.elapsed() < Duration::from_secs(120), "no row");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let text = fs::read_to_string(&partial).unwrap();
    let (header, found) = rows(&text);
    assert!(text.ends_with('\n') && found.len() >= 4 && found.iter().all(|row| row.len() == header.len()));
    assert!(found.iter().all(|row| !row[2].is_empty() && row[header.len() - 1].is_empty()));
    assert!(!place.path("s.csv").exists());
    place.write("pairs.csv", interleaved());
    let [_, error] = place.said(&["pairs.csv", "-m", "D1", "--out", "s.csv"], 2);
    assert!(error.contains("s.csv.partial exists already; use --replace"), "{error}");
    place.said(&["pairs.csv", "-m", "D1", "--out", "s.csv", "--replace"], 0);
    assert!(!partial.exists());
}
