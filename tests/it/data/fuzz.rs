//! Every kind of file that the library reads, damaged in every way: an error of one line that names the file, never a
//! panic, in bounded memory.

use crate::data_folder;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRng, TestRunner};
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use vernis::brdf::formats::{fit, materials, merl, nbrdf, npf, rgl, titopo};
use vernis::brdf::{BrdfSource, Grid};
use vernis::dataset::Study;
use vernis::dataset::opinions::StudyOpinions;
use vernis::metric::learned::LearnedMetric;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// One way to damage a file; places are shares of its length.
#[derive(Debug, Clone)]
enum Damage {
    Cut(f64),
    Put(f64, Vec<u8>),
    Insert(f64, Vec<u8>),
    Remove(f64, usize),
    /// Copies the bytes at the first place over those at the second.
    Copy(f64, f64, usize),
}

/// Bytes that parsers are known to stumble over.
fn bytes() -> impl Strategy<Value = Vec<u8>> {
    let known: [&[u8]; 18] = [
        &[0; 8],
        &[0xff; 8],
        b"\"",
        b"\"\"",
        b"\n",
        b";",
        b",",
        b"\0",
        b"NaN",
        b"-1e999",
        b"[[[[",
        b"{",
        b"../../x",
        b"\xef\xbb\xbf",
        &u32::MAX.to_le_bytes(),
        &(i32::MAX as u32).to_le_bytes(),
        &f64::NAN.to_le_bytes(),
        &f32::INFINITY.to_le_bytes(),
    ];
    prop_oneof![proptest::sample::select(known.map(<[u8]>::to_vec).to_vec()), vec(any::<u8>(), 1..9)]
}

fn damage() -> impl Strategy<Value = Damage> {
    let place = || 0.0..1.0f64;
    prop_oneof![
        place().prop_map(Damage::Cut),
        (place(), bytes()).prop_map(|(at, b)| Damage::Put(at, b)),
        (place(), bytes()).prop_map(|(at, b)| Damage::Put(at * 0.02, b)),
        (place(), bytes()).prop_map(|(at, b)| Damage::Insert(at, b)),
        (place(), 1..64usize).prop_map(|(at, n)| Damage::Remove(at, n)),
        (place(), place(), 1..200usize).prop_map(|(a, b, n)| Damage::Copy(a, b, n)),
    ]
}

fn damaged(good: &[u8], all: &[Damage]) -> Vec<u8> {
    let mut bytes = good.to_vec();
    for one in all {
        let n = bytes.len();
        let place = |share: &f64| (share * n as f64) as usize;
        let put = |bytes: &mut Vec<u8>, at: usize, new: &[u8]| {
            let room = new.len().min(n - at);
            bytes[at..at + room].copy_from_slice(&new[..room]);
        };
        match one {
            Damage::Cut(at) => bytes.truncate(place(at)),
            Damage::Put(at, new) => put(&mut bytes, place(at), new),
            Damage::Insert(at, new) => drop(bytes.splice(place(at)..place(at), new.iter().copied())),
            Damage::Remove(at, len) => drop(bytes.drain(place(at)..(place(at) + len).min(n))),
            Damage::Copy(from, to, len) => {
                let piece = bytes[place(from)..(place(from) + len).min(n)].to_vec();
                put(&mut bytes, place(to), &piece);
            }
        }
    }
    bytes
}

/// Damages `good` in `cases` ways, always the same ones, and reads each. What is still readable is no failure; a message
/// must be one line of bounded length that names `file`.
fn fuzz(cases: u32, file: &str, good: &[u8], read: impl Fn(&[u8]) -> Result<(), String>) {
    assert_eq!(read(good), Ok(()), "the undamaged file");
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let rng = TestRng::deterministic_rng(config.rng_algorithm);
    let refused = std::cell::Cell::new(0);
    let result = TestRunner::new_with_rng(config, rng).run(&vec(damage(), 1..4), |all| {
        if let Err(message) = read(&damaged(good, &all)) {
            refused.set(refused.get() + 1);
            prop_assert!(message.contains(file), "does not name {}: {}", file, message);
            prop_assert!(!message.contains('\n') && message.len() < 4000, "{}", message);
        }
        Ok(())
    });
    result.unwrap_or_else(|e| panic!("{file}: {e}"));
    assert!(refused.get() > cases / 8, "{file}: only {} of {cases} damaged files were refused", refused.get());
}

fn outcome<T, E: std::fmt::Display>(result: Result<T, E>) -> Result<(), String> {
    result.map(drop).map_err(|e| e.to_string())
}

/// A reader of bytes that needs a file.
fn through_a_file<'a, T, E: std::fmt::Display>(
    path: &'a Path,
    read: impl Fn(&Path) -> Result<T, E> + 'a,
) -> impl Fn(&[u8]) -> Result<(), String> + 'a {
    move |bytes| {
        fs::write(path, bytes).expect("writable");
        outcome(read(path))
    }
}

#[test]
fn tables() {
    let half: Vec<u8> = 0.25f32.to_le_bytes().repeat(3 * Grid::TITOPO_HALF.len());
    fuzz(48, "x.titopoh", &half, |bytes| outcome(titopo::decode(Path::new("x.titopoh"), bytes)));
    let header = [90i32, 90, 180].map(i32::to_le_bytes).concat();
    let full = [header, 150f64.to_le_bytes().repeat(3 * Grid::MERL.len())].concat();
    fuzz(16, "x.binary", &full, |bytes| outcome(merl::decode(Path::new("x.binary"), bytes)));
    // Headers of every size before a body of none.
    for n in [0i32, 1, -1, 90, 180, 181, 360, i32::MAX, i32::MIN] {
        let header = [n, 90, n].map(i32::to_le_bytes).concat();
        assert!(merl::decode(Path::new("x.binary"), &header).is_err());
        assert!(merl::decode(Path::new("x.binary"), &[&header[..], &[0; 8]].concat()).is_err());
    }
}

#[test]
fn factors() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let good = 0.5f32.to_le_bytes().repeat(256 * 512 * 3);
    let path = folder.path().join("npf.bin");
    fuzz(48, "npf.bin", &good, through_a_file(&path, |p| npf::read(p, "teflon")));
}

#[test]
fn fits_and_models() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let line = |name: &str| {
        format!(
            "{name} = Aggregate(Lambertian(albedo = [0.1, 0.2, 0.3]), Bagher(albedo = [1, 1, 1], eta = [[0.1, 0.1, 0.1], \
             [0, 0, 0]], alpha = [0.1, 0.1, 0.1], p = [1, 1, 1], K = [1, 1, 1], Lambda = [1, 1, 1], c = [0, 0, 0], \
             k = [1, 1, 1], theta0 = [0, 0, 0]))\n"
        )
    };
    let good = format!("# fits\n{}{}", line("teflon"), line("nylon"));
    let path = folder.path().join("x.fit");
    fuzz(600, "x.fit", good.as_bytes(), through_a_file(&path, |p| fit::read(p, "teflon")));
    let model = br#"{"model":"ggx+ward","1.kd":[0.2,0.1,0.05],"1.f0":[0.04,0.04,0.04],"1.alpha":0.15,"2.ks":[0,0,0],"2.alpha":0.2}"#;
    let path = folder.path().join("m.json");
    let open = |p: &Path| BrdfSource::parse(p.to_str().expect("UTF-8")).and_then(|s| s.open(None));
    fuzz(600, "m.json", model, through_a_file(&path, open));
    // Deeper than any stack, and larger than any model.
    for (text, expected) in [
        (format!("{{\"model\":{}", "[".repeat(1 << 19)), "m.json: not a valid model in JSON: recursion limit"),
        (" ".repeat((1 << 20) + 1), "m.json: it has at least 1048577 bytes; it must have at most 1048576"),
    ] {
        fs::write(&path, text).expect("writable");
        let message = outcome(open(&path)).expect_err("no model");
        assert!(message.contains(expected) && message.len() < 400, "{message}");
    }
}

/// A network as Keras stores it, all weights 0.01.
fn network() -> Vec<u8> {
    let mut file = hdf5_pure::FileBuilder::new();
    for (layer, rows, columns) in [("dense_1", 6, 21), ("dense_2", 21, 21), ("dense_3", 21, 3)] {
        let mut outer = file.create_group(layer);
        let mut inner = outer.create_group(layer);
        inner
            .create_dataset("kernel:0")
            .with_f32_data(&vec![0.01; rows * columns])
            .with_shape(&[rows as u64, columns as u64]);
        inner.create_dataset("bias:0").with_f32_data(&vec![0.01; columns]).with_shape(&[columns as u64]);
        outer.add_group(inner.finish());
        file.add_group(outer.finish());
    }
    file.finish().expect("a valid file")
}

fn archive(members: &[(&str, &[u8])]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut zip = ZipWriter::new(&mut bytes);
    for (name, content) in members {
        zip.start_file(*name, SimpleFileOptions::default()).expect("a name");
        zip.write_all(content).expect("in memory");
    }
    zip.finish().expect("in memory");
    bytes.into_inner()
}

#[test]
fn networks() {
    let file = Path::new("x.zip");
    let good = network();
    fuzz(600, "x.zip", &good, |bytes| outcome(nbrdf::decode(file, "teflon", bytes.to_vec())));
    let alone = Path::new("x.h5");
    fuzz(200, "x.h5", &good, |bytes| outcome(nbrdf::decode_file(alone, bytes.to_vec())));
}

/// A small file as RGL's are: the named arrays, then their numbers.
fn measurement() -> Vec<u8> {
    let arrays: [(&str, u8, &[u64]); 7] = [
        ("phi_i", 10, &[1]),
        ("theta_i", 10, &[2]),
        ("ndf", 10, &[2, 3]),
        ("sigma", 10, &[2, 3]),
        ("vndf", 10, &[1, 2, 3, 4]),
        ("rgb", 10, &[1, 2, 3, 3, 3]),
        ("jacobian", 1, &[1]),
    ];
    let mut head = [&b"tensor_file\0\x01\0"[..], &(arrays.len() as u32).to_le_bytes()].concat();
    let size: usize = arrays.iter().map(|(name, _, shape)| 2 + name.len() + 2 + 1 + 8 + 8 * shape.len()).sum();
    let mut data = Vec::new();
    let start = head.len() + size;
    for (name, kind, shape) in arrays {
        head.extend((name.len() as u16).to_le_bytes());
        head.extend(name.as_bytes());
        head.extend((shape.len() as u16).to_le_bytes());
        head.push(kind);
        head.extend(((start + data.len()) as u64).to_le_bytes());
        shape.iter().for_each(|n| head.extend(n.to_le_bytes()));
        for k in 0..shape.iter().product() {
            if kind == 1 { data.push(1) } else { data.extend((k as f32).to_le_bytes()) }
        }
    }
    [head, data].concat()
}

#[test]
fn measurements_of_rgl() {
    fuzz(1000, "x.bsdf", &measurement(), |bytes| outcome(rgl::decode(Path::new("x.bsdf"), bytes)));
}

/// The file of a real material, with every feature that Keras uses.
#[test_with::env(VERNIS_DATA)]
#[test]
fn a_real_network() {
    let path = data_folder().join("nbrdf/merl_nbrdf.zip");
    let real = vernis::brdf::formats::archive::member(&path, "teflon").expect("in the archive").bytes;
    fuzz(600, "x.zip", &real, |bytes| outcome(nbrdf::decode(Path::new("x.zip"), "teflon", bytes.to_vec())));
}

#[test]
fn archives() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("x.zip");
    let good = archive(&[("a/nylon.h5", &network()), ("a/teflon.h5", &network())]);
    let read = through_a_file(&path, |p| nbrdf::read(p, "teflon"));
    fuzz(400, "x.zip", &good, read);
    fuzz(200, "x.zip", &good, through_a_file(&path, materials));
    let message = |bytes: &[u8]| {
        fs::write(&path, bytes).expect("writable");
        outcome(nbrdf::read(&path, "teflon")).expect_err("refused")
    };
    // 64 MiB of zeros in 64 kB.
    let bomb = archive(&[("teflon.h5", &vec![0; 64 << 20])]);
    assert!(bomb.len() < 200_000);
    let text = message(&bomb);
    assert!(text.contains("teflon.h5 has more than 1048576 bytes; it must have at most that many"), "{text}");
    // Tables in an archive are held to the size of a table.
    fs::write(&path, archive(&[("teflon.titopo", &vec![0; 64 << 20])])).expect("writable");
    let source = BrdfSource::parse(&format!("{}:teflon", path.display())).expect("a notation");
    let text = source.open(None).expect_err("too large").to_string();
    assert!(text.contains("teflon.titopo has more than 34992000 bytes; it must have at most that many"), "{text}");
    fs::write(&path, archive(&[("teflon.titopoh", &[0; 99])])).expect("writable");
    let text = source.open(None).expect_err("too small").to_string();
    assert!(text.contains("x.zip:teflon.titopoh: the file has 99 bytes"), "{text}");
    let text = message(&archive(&[("a/teflon.h5", &network()), ("b/teflon.h5", &network())]));
    assert!(text.contains("a/teflon.h5 and b/teflon.h5 are both of teflon; there must be one member"), "{text}");
    // A name that leads out of the folder is a name like any other: members are read in place, none is ever written.
    fs::write(&path, archive(&[("../../teflon.h5", &network())])).expect("writable");
    nbrdf::read(&path, "teflon").expect("a member");
    let before = fs::read_dir(folder.path()).expect("a folder").count();
    assert_eq!((before, folder.path().join("../../teflon.h5").exists()), (1, false));
}

#[test]
fn studies() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("s.csv");
    let load = |p: &Path| Study::load(p.to_str().expect("UTF-8"), None);
    let good = "reference,candidate,mos,weight,material,group,method,method_family,material_type\n\
                a.binary,b.binary,4.5,1,chalk,stones,GGX,GGX,Dielectric\n\
                \"a.binary\",\"c.binary\",2.5,.5,chalk,stones,WARD,WARD,Dielectric\n\
                g.binary,x.fit:gold?eta=2,3,1,gold,gold,GGX,GGX,Metal\n";
    fuzz(600, "s.csv", good.as_bytes(), through_a_file(&path, load));
    let message = |text: &str| {
        fs::write(&path, text).expect("writable");
        outcome(load(&path)).expect_err("refused")
    };
    for (text, expected) in [
        (good.replace("\"c.binary\",", "\"c.binary,"), "line 3: "),
        (good.replace("chalk,stones,WARD", "\"chalk\nchalk\",stones,WARD"), "line 3: material is `chalk\\nchalk`"),
        (
            format!("{good}a.binary,b.binary,4,1,chalk,stones,GGX,GGX,Dielectric\n"),
            "line 5: the pair is `a.binary`, `b.binary` again",
        ),
        (good.replace("4.5", &"9".repeat(1 << 20)), "line 2: mos is `999"),
        (good.replace("b.binary", &"b".repeat(1 << 20)), "line 2: candidate: `bbb"),
    ] {
        let found = message(&text);
        assert!(found.contains("s.csv") && found.contains(expected) && found.len() < 1500, "{found}");
    }
    let path = folder.path().join("r.csv");
    let good = "participant,material,method,score,illumination,seconds,gold\n\
                w17,chalk,GGX,4,grace,3.2,\nw17,\"chalk\",WARD,2,grace,2.9,\nw18,chalk,REFERENCE,5,grace,2.1,5\n\
                w18,chalk,GGX,3,grace,1,\n";
    fuzz(600, "r.csv", good.as_bytes(), through_a_file(&path, StudyOpinions::load_raw));
}

#[test]
fn exported_metrics() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("x.vernis.json");
    let shipped =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/vernis-metric/src/metric/learned/vernis.vernis.json");
    let good = fs::read(shipped).expect("part of the source");
    fuzz(60, "x.vernis.json", &good, through_a_file(&path, LearnedMetric::load));
}

/// Files of many gigabytes (sparse ones) are refused in little memory.
#[cfg(unix)]
#[test]
fn large_files_are_not_read() {
    let folder = tempfile::tempdir().expect("temporary folder");
    for (name, arguments) in [
        ("a.binary", &["describe", "a.binary"][..]),
        ("a.titopo", &["describe", "a.titopo"]),
        ("a.json", &["describe", "a.json"]),
        ("a.fit", &["describe", "a.fit:teflon"]),
        ("a.bin", &["describe", "a.bin:teflon"]),
        ("a.zip", &["describe", "a.zip:teflon"]),
        ("a.bsdf", &["describe", "a.bsdf"]),
        ("a.h5", &["describe", "a.h5"]),
        ("at.csv", &["evaluate", "b.json", "--at", "at.csv"]),
        ("a.csv", &["study", "--study", "a.csv"]),
        ("raw.csv", &["study", "--ratings", "raw.csv"]),
        ("a.vernis.json", &["compare", "b.json", "b.json", "--metric", "a.vernis.json"]),
    ] {
        fs::write(folder.path().join("b.json"), r#"{"model":"lambert","kd":[0.2,0.2,0.2]}"#).expect("writable");
        let path = folder.path().join(name);
        fs::File::create(&path).and_then(|f| f.set_len(20 << 30)).expect("a sparse file");
        // A map of 20 GiB needs addresses, not memory: the limit is on data.
        let script = "ulimit -d 700000; exec \"$@\"";
        let mut limited = Command::new("sh");
        limited.args(["-c", script, "sh", env!("CARGO_BIN_EXE_vernis"), "--threads", "1"]).args(arguments);
        let output = super::program(limited.current_dir(folder.path()));
        let message = super::error(&output);
        assert_eq!(output.status.code(), Some(2), "{name}: {message}");
        assert!(message.contains(name) && message.len() < 1000, "{message}");
        fs::remove_file(path).expect("ours");
    }
}
