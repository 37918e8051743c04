//! Getting files from folders and servers of every manner, and comparing what is there.

#[cfg(feature = "fetch")]
use super::server::{Manner, Server};
use super::{error, out, program, text, vernis_data};
use crate::data_folder;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;
use vernis::brdf::ContentHash;
use vernis::dataset::DatasetError;
#[cfg(feature = "fetch")]
use vernis::dataset::fetch::fetch_within;
use vernis::dataset::fetch::{Mirror, Outcome, fetch};
use vernis::dataset::manifest::{Manifest, PinnedFile};

const PATH: &str = "folder/numbers.bin";

/// 300,000 bytes without a pattern.
fn content() -> Vec<u8> {
    (0..300_000u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8).collect()
}

fn pinned() -> PinnedFile {
    PinnedFile {
        path: PATH.into(),
        role: "a test".into(),
        source: "https://github.com/owner/repository".into(),
        revision: "0".repeat(40),
        source_path: "numbers.bin".into(),
        bytes: Some(300_000),
        sha256: ContentHash::of(&content()).to_string(),
        licence: "none".into(),
        extract_allowed: false,
        optional: false,
    }
}

/// A data folder.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("temporary folder"))
    }

    fn target(&self) -> PathBuf {
        self.0.path().join(PATH)
    }

    fn part(&self) -> PathBuf {
        self.0.path().join("folder/numbers.bin.part")
    }

    fn put(&self, path: &Path, bytes: &[u8]) {
        fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        fs::write(path, bytes).expect("writable");
    }

    fn fetch(&self, mirror: &str) -> Result<Outcome, DatasetError> {
        self.fetch_file(&pinned(), mirror, false)
    }

    fn fetch_file(&self, file: &PinnedFile, mirror: &str, replace: bool) -> Result<Outcome, DatasetError> {
        let mirror = Mirror::parse(mirror).expect("a mirror");
        fetch(file, self.0.path(), Some(&mirror), replace, &mut |t| assert!(t.whole.is_none_or(|w| t.done <= w)))
    }

    /// Whether the folder holds the published file and nothing else.
    fn is_right(&self) -> bool {
        let files = fs::read_dir(self.0.path().join("folder")).expect("a folder").count();
        files == 1 && fs::read(self.target()).is_ok_and(|bytes| bytes == content())
    }
}

/// A folder that holds the file.
fn mirror(bytes: &[u8]) -> Place {
    let mirror = Place::new();
    mirror.put(&mirror.target(), bytes);
    mirror
}

const ALL: Outcome = Outcome::Fetched { bytes: 300_000 };

#[test]
fn a_folder_and_its_file_address_give_the_file_once() {
    let mirror = mirror(&content());
    let folder = text(mirror.0.path()).to_owned();
    for address in [folder.clone(), format!("file://{folder}")] {
        let place = Place::new();
        assert_eq!(place.fetch(&address).expect("there"), ALL);
        assert!(place.is_right());
        // The second time nothing is read: the mirror need not exist.
        assert_eq!(place.fetch("/no/such/mirror").expect("here already"), Outcome::Present);
    }
    // What an earlier run left is not received again.
    let place = Place::new();
    place.put(&place.part(), &content()[..100_000]);
    assert_eq!(place.fetch(&folder).expect("there"), Outcome::Fetched { bytes: 200_000 });
    assert!(place.is_right());
    place.put(&place.part(), &content());
    fs::remove_file(place.target()).expect("there");
    assert_eq!(place.fetch("/no/such/mirror").expect("complete"), Outcome::Fetched { bytes: 0 });
    assert!(place.is_right());
}

#[test]
fn what_is_no_beginning_of_the_file_is_received_anew() {
    let mirror = mirror(&content());
    let folder = text(mirror.0.path());
    for (left, received) in [(1000, 299_000 + 300_000), (300_000, 300_000), (300_001, 300_000)] {
        let place = Place::new();
        place.put(&place.part(), &vec![0; left]);
        assert_eq!(place.fetch(folder).expect("there"), Outcome::Fetched { bytes: received });
        assert!(place.is_right());
    }
}

/// Somebody who may write into the folder has put a link where the file grows: what it leads to is not touched.
#[cfg(unix)]
#[test]
fn a_link_in_the_place_of_the_part_is_not_followed() {
    let (mirror, place) = (mirror(&content()), Place::new());
    let victim = place.0.path().join("victim");
    place.put(&victim, b"mine");
    for target in [victim.clone(), place.0.path().join("not there")] {
        fs::create_dir_all(place.part().parent().expect("a folder")).expect("writable");
        std::os::unix::fs::symlink(&target, place.part()).expect("writable");
        let message = place.fetch(text(mirror.0.path())).expect_err("a link").to_string();
        assert!(message.contains(".part: cannot be written: it is no regular file"), "{message}");
        fs::remove_file(place.part()).expect("still a link");
    }
    assert_eq!(fs::read(&victim).expect("still here"), b"mine");
    assert!(!place.0.path().join("not there").exists());
}

#[test]
fn another_content_is_refused_and_leaves_nothing() {
    let mut wrong = content();
    wrong[123_456] ^= 1;
    for (bytes, expected) in [
        (&wrong[..], "300000 bytes, SHA-256"),
        (&wrong[..299_999], "has 299999 bytes, but it must have 300000 bytes"),
        (&[&wrong[..], &[0]].concat(), "has 300001 bytes, but it must have 300000 bytes"),
    ] {
        let (place, mirror) = (Place::new(), mirror(bytes));
        let message = place.fetch(text(mirror.0.path())).expect_err("another content").to_string();
        assert!(message.starts_with(text(&mirror.target())) && message.contains(expected), "{message}");
        assert!(!message.contains('\n') && message.contains("it must have 300000 bytes"), "{message}");
        assert_eq!(fs::read_dir(place.0.path().join("folder")).expect("a folder").count(), 0);
    }
    // Without a pinned size the hash decides.
    let unsized_file = PinnedFile { bytes: None, ..pinned() };
    let (place, mirror) = (Place::new(), mirror(&wrong));
    let message = place.fetch_file(&unsized_file, text(mirror.0.path()), false).expect_err("wrong").to_string();
    assert!(message.contains(&format!("it must have SHA-256 {}", pinned().sha256)), "{message}");
}

#[test]
fn a_file_that_is_here_is_replaced_only_when_asked_and_only_by_the_right_one() {
    let (right, wrong) = (mirror(&content()), mirror(b"wrong"));
    let place = Place::new();
    place.put(&place.target(), b"mine");
    let message = place.fetch(text(right.0.path())).expect_err("mine is here").to_string();
    assert!(message.starts_with(text(&place.target())) && message.contains("has 4 bytes"), "{message}");
    place.fetch_file(&pinned(), text(wrong.0.path()), true).expect_err("wrong bytes");
    assert_eq!(fs::read(place.target()).expect("still here"), b"mine");
    assert_eq!(place.fetch_file(&pinned(), text(right.0.path()), true).expect("there"), ALL);
    assert!(place.is_right());
    // A part of a file of which a part is of use is left as well, without an error.
    let ratings = PinnedFile { extract_allowed: true, ..pinned() };
    place.put(&place.target(), b"a part");
    assert_eq!(place.fetch_file(&ratings, text(right.0.path()), false).expect("of use"), Outcome::Extract);
    assert_eq!(place.fetch_file(&ratings, text(right.0.path()), true).expect("there"), ALL);
}

#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let mirror = mirror(&content());
    let place = Place::new();
    // A file where the folder should be stops even the superuser.
    place.put(&place.0.path().join("folder"), b"in the way");
    let error = place.fetch(text(mirror.0.path())).expect_err("in the way");
    assert!(matches!(error, DatasetError::Write { .. }) || matches!(error, DatasetError::Unreadable { .. }), "{error}");
    assert!(error.to_string().contains("numbers.bin"), "{error}");
    assert_eq!(fs::read(place.0.path().join("folder")).expect("still here"), b"in the way");
}

#[cfg(feature = "fetch")]
mod over_http {
    use super::*;

    #[test]
    fn a_server_gives_the_file_and_the_rest_of_a_file() {
        for manner in [Manner::Well, Manner::IgnoresRange, Manner::WithoutLength, Manner::Redirects] {
            let (server, place) = (Server::start(&content(), manner), Place::new());
            assert_eq!(place.fetch(&server.url).expect("served"), ALL);
            assert!(place.is_right());
            let requests = server.ranges().len();
            assert_eq!(place.fetch(&server.url).expect("here already"), Outcome::Present);
            assert_eq!(server.ranges().len(), requests, "the file is here already");
        }
        for (manner, received) in
            [(Manner::Well, 200_000), (Manner::IgnoresRange, 300_000), (Manner::Redirects, 200_000)]
        {
            let (server, place) = (Server::start(&content(), manner), Place::new());
            place.put(&place.part(), &content()[..100_000]);
            assert_eq!(place.fetch(&server.url).expect("served"), Outcome::Fetched { bytes: received });
            assert!(place.is_right());
            assert_eq!(server.ranges()[0], "bytes=100000-");
        }
        // A file of unknown size that is complete already: the server says that there is nothing beyond.
        let (server, place) = (Server::start(&content(), Manner::Well), Place::new());
        place.put(&place.part(), &content());
        let unsized_file = PinnedFile { bytes: None, ..pinned() };
        assert_eq!(place.fetch_file(&unsized_file, &server.url, false).expect("served"), ALL);
        assert!(place.is_right());
    }

    #[test]
    fn a_connection_that_is_cut_goes_on_where_it_ended() {
        // Three attempts of 120,000 bytes are enough.
        let (server, place) = (Server::start(&content(), Manner::CutsAfter(120_000)), Place::new());
        assert_eq!(place.fetch(&server.url).expect("in three attempts"), ALL);
        assert!(place.is_right());
        assert_eq!(server.ranges(), ["", "bytes=120000-", "bytes=240000-"]);
        // Three attempts of 50,000 are not: what came is kept, under another name, for the next run.
        let (server, place) = (Server::start(&content(), Manner::CutsAfter(50_000)), Place::new());
        let error = place.fetch(&server.url).expect_err("half of it");
        assert!(matches!(error, DatasetError::Fetch { .. }), "{error}");
        let message = error.to_string();
        assert!(
            message.starts_with(&server.url) && message.contains("ended after 150000 of 300000 bytes"),
            "{message}"
        );
        assert!(!place.target().exists());
        assert_eq!(fs::read(place.part()).expect("kept"), &content()[..150_000]);
        let well = Server::start(&content(), Manner::Well);
        assert_eq!(place.fetch(&well.url).expect("the rest"), Outcome::Fetched { bytes: 150_000 });
        assert_eq!(well.ranges(), ["bytes=150000-"]);
        assert!(place.is_right());
    }

    #[test]
    fn a_server_that_stalls_or_trickles_ends_after_the_stated_time() {
        for manner in [Manner::Stalls, Manner::Trickles, Manner::SaysNothing] {
            let (server, place) = (Server::start(&content(), manner), Place::new());
            let mirror = Mirror::parse(&server.url).expect("an address");
            let begun = std::time::Instant::now();
            let time = std::time::Duration::from_secs(2);
            let message = fetch_within(time, &pinned(), place.0.path(), Some(&mirror), false, &mut |_| ())
                .expect_err("never all of it")
                .to_string();
            assert!(begun.elapsed().as_secs() < 20, "{message}");
            assert!(message.contains("(the 2 s for one file are over)"), "{message}");
            assert!(!place.target().exists());
        }
    }

    #[test]
    fn passwords_are_given_to_the_server_alone() {
        let server = Server::start(b"", Manner::Status(404));
        let address = server.url.replace("http://", "http://somebody:secret@");
        for address in [address, "http://somebody:secret@127.0.0.1:1".to_owned()] {
            let message = Place::new().fetch(&address).expect_err("refused").to_string();
            assert!(message.contains("127.0.0.1") && !message.contains("secret"), "{message}");
        }
    }

    #[test]
    fn wrong_bytes_and_refusals_are_told() {
        let mut wrong = content();
        wrong[299_999] ^= 128;
        let (server, place) = (Server::start(&wrong, Manner::Well), Place::new());
        let message = place.fetch(&server.url).expect_err("wrong bytes").to_string();
        assert!(message.starts_with(&format!("{}/{PATH} has 300000 bytes", server.url)), "{message}");
        assert!(!place.target().exists() && !place.part().exists());
        // More than the pinned size is not even read to its end.
        let (server, place) = (Server::start(&content().repeat(40), Manner::WithoutLength), Place::new());
        let message = place.fetch(&server.url).expect_err("too much").to_string();
        assert!(message.contains("has more than 300000 bytes, but it must have 300000 bytes"), "{message}");
        assert!(!place.target().exists() && !place.part().exists());
        for (status, expected) in [(404, "the server answers 404 Not Found"), (503, "503 Service Unavailable")] {
            let (server, place) = (Server::start(b"", Manner::Status(status)), Place::new());
            let message = place.fetch(&server.url).expect_err("refused").to_string();
            assert!(message.contains(expected) && message.contains(PATH), "{message}");
            assert!(!place.target().exists() && !place.part().exists());
        }
        let gone = Server::start(b"", Manner::Well).url.clone();
        let message = Place::new().fetch(&gone).expect_err("nobody there").to_string();
        assert!(message.starts_with(&gone) && message.to_lowercase().contains("refused"), "{message}");
    }
}

/// The content of a pinned file cannot be made up: the program is run with a mirror of wrong files here, and with the
/// real ones below, where they are at hand.
#[test]
fn the_program_reports_every_file_and_keeps_what_is_there() {
    let (mirror, place) = (Place::new(), Place::new());
    let manifest = Manifest::embedded("lavoue2021").expect("embedded");
    let types = &manifest.rated.ratings.material_types;
    mirror.put(&mirror.0.path().join(types), b"BRDF;Type\n");
    let data = text(place.0.path());
    let output = vernis_data(&["fetch", "lavoue2021", "--data", data, "--mirror", text(mirror.0.path())]);
    let message = error(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("PerceptualDistances.csv: No such file"), "{message}");
    assert!(message.contains("MaterialType.csv has 10 bytes, but it must have 3332 bytes"), "{message}");
    let lines = out(&output);
    assert_eq!(lines.matches("NOT fetched; licence: none stated").count(), 2, "{lines}");
    assert!(lines.contains("https://zenodo.org/records/8101681"), "{lines}");
    assert!(!place.0.path().join(types).exists());
    // Wrong content alone is a mistake of who named the mirror.
    mirror.put(&mirror.0.path().join(&manifest.rated.ratings.file), b"METHOD;BRDF;DISTANCE\n");
    let output = vernis_data(&["fetch", "lavoue2021", "--data", data, "--mirror", text(mirror.0.path())]);
    assert_eq!(output.status.code(), Some(2), "{}", error(&output));
}

#[test]
fn verify_names_the_file_with_what_was_found_and_what_is_allowed() {
    let place = Place::new();
    let data = text(place.0.path());
    // Where nothing is there, nothing is verified: that is no success.
    let output = vernis_data(&["verify", "lavoue2021-open", "--data", data]);
    assert_eq!(output.status.code(), Some(2));
    assert!(error(&output).contains("no file of lavoue2021-open is there; nothing was verified"), "{}", error(&output));
    assert_eq!(out(&output).matches(" missing\n").count(), 9);
    for folder in ["/no/such/folder", text(&place.0.path().join("nothing"))] {
        let output = vernis_data(&["verify", "--data", folder]);
        assert_eq!(output.status.code(), Some(2));
        assert!(error(&output).contains(&format!("{folder}: no such folder")), "{}", error(&output));
    }
    let output = vernis_data(&["verify", "lavoue2021-open", "--data", data, "--complete"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(error(&output).contains("npf.bin is missing; get it from https://github.com/jdupuy/opengl-framework"));
    place.put(&place.0.path().join("bagher2016-npf/npf.bin"), b"abc");
    place.put(&place.0.path().join("lavoue2021/PerceptualDistances.csv"), b"a part");
    let output = vernis_data(&["verify", "--data", data]);
    let message = error(&output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    // The hash of "abc" is the example of FIPS 180-4.
    let found = "npf.bin has 3 bytes, SHA-256 ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
    assert!(message.contains(found) && message.contains("it must have 1572864 bytes, SHA-256 4d4b8b7f"), "{message}");
    assert!(
        out(&output).contains(&format!("{:45} a part of the published file", "lavoue2021/PerceptualDistances.csv"))
    );
    for (args, expected) in [
        (&["verify"][..], "no data folder: name one with --data DIR or VERNIS_DATA"),
        (&["fetch", "lavoue2021"], "no data folder: name one"),
        (&["fetch", "lavoue", "--data", data], "unknown study `lavoue`"),
        (&["fetch", "lavoue2021", "--data", data, "--mirror", "ftp://x/y"], "ftp://x/y: it must be a folder"),
    ] {
        let output = vernis_data(args);
        assert_eq!(output.status.code(), Some(2));
        assert!(error(&output).contains(expected), "{}", error(&output));
    }
    assert_eq!(out(&vernis_data(&["fetch", "synthetic"])), "synthetic: part of vernis, nothing to fetch\n");
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn the_open_study_comes_from_a_folder_by_one_command() {
    let real = data_folder();
    let real = real.to_str().expect("UTF-8");
    let place = Place::new();
    let data = text(place.0.path());
    let fetch = |extra: &[&str]| {
        vernis_data(&[&["fetch", "lavoue2021-open", "--data", data, "--mirror", real], extra].concat())
    };
    let lines = out(&fetch(&[]));
    // All but the ratings, of which the mirror may hold an extract.
    assert!(lines.matches("fetched, ").count() >= 8, "{lines}");
    let again = out(&fetch(&[]));
    assert_eq!(again.matches("here already").count(), lines.matches("fetched, ").count(), "{again}");
    let verified = vernis_data(&["verify", "lavoue2021-open", "--data", data]);
    assert_eq!(verified.status.code(), Some(0));
    assert!(out(&verified).matches(" as published\n").count() >= 8);
}

/// A limit on the size of files stands in for a full disk: writing fails in the middle of a file.
#[cfg(unix)]
#[test_with::env(VERNIS_DATA)]
#[test]
fn a_disk_that_takes_no_more_is_told_and_earlier_files_stay() {
    let real = data_folder();
    let place = Place::new();
    place.put(&place.0.path().join("nbrdf/LICENSE"), b"earlier");
    // 256 blocks of 512 bytes: enough for the tables of text, too little for the archive.
    let script = "trap '' XFSZ; ulimit -f 256; exec \"$@\"";
    let mut limited = Command::new("sh");
    limited.args(["-c", script, "sh", env!("CARGO_BIN_EXE_vernis"), "data", "fetch", "lavoue2021-open", "--data"]);
    let output = program(limited.arg(place.0.path()).arg("--mirror").arg(&real));
    let message = error(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("merl_nbrdf.zip.part: cannot be written: "), "{message}");
    assert!(!place.0.path().join("nbrdf/merl_nbrdf.zip").exists());
    assert_eq!(fs::read(place.0.path().join("nbrdf/LICENSE")).expect("still here"), b"earlier");
    // With room again, the same command goes on.
    let fetch = ["fetch", "lavoue2021-open", "--data", text(place.0.path()), "--mirror", real.to_str().expect("UTF-8")];
    let lines = out(&vernis_data(&fetch));
    assert!(lines.contains("merl_nbrdf.zip") && !lines.contains("fetched, 461136 bytes"), "{lines}");
    assert!(place.0.path().join("nbrdf/merl_nbrdf.zip").exists());
}
