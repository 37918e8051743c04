//! A study of many tables of 35 MB, and how fast it streams: `write` makes one, `read` reads its files and does nothing else,
//! `extract` computes every descriptor and distance of it, as `vernis extract` does, without a cache.
//!
//! ```text
//! cargo run --release --no-default-features --example large_study -- write /tmp/large 40 10
//! cargo run --release --no-default-features --example large_study -- read /tmp/large
//! cargo run --release --no-default-features --example large_study -- extract /tmp/large
//! ```
//!
//! 40 materials with 10 candidates each are 440 files, 15.4 GB. Materials are a diffuse and a GGX lobe, candidates the same
//! but rougher; the scores are made up. Figures of `read` and `extract` are comparable where the files are not in memory
//! already.

use anyhow::{Context, Result, bail};
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;
use vernis::brdf::formats::titopo;
use vernis::brdf::models::Ggx;
use vernis::brdf::{Grid, TabulatedBrdf};
use vernis::dataset::Study;
use vernis::descriptor::{DescriptorSet, Setup};
use vernis::io::Progress;
use vernis::metric::registry::Registry;
use vernis::samples::extraction::Extractor;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["write", folder, materials, candidates] => write(Path::new(folder), materials.parse()?, candidates.parse()?),
        ["read", folder] => read(Path::new(folder)),
        ["extract", folder] => extract(Path::new(folder)),
        _ => bail!(
            "the arguments are {arguments:?}; they must be write DIR MATERIALS CANDIDATES, read DIR, or extract DIR"
        ),
    }
}

fn write(folder: &Path, materials: usize, candidates: usize) -> Result<()> {
    fs::create_dir_all(folder)?;
    let mut csv = "reference,candidate,mos,material,method\n".to_owned();
    for material in 0..materials {
        let reference = format!("{material:02}.titopo");
        table(&folder.join(&reference), material, 1.0)?;
        for k in 0..candidates {
            let (candidate, mos) = (format!("{material:02}.{k:02}.titopo"), 5.0 - 4.0 * k as f64 / candidates as f64);
            table(&folder.join(&candidate), material, 1.0 + 0.05 * k as f64)?;
            csv += &format!("{reference},{candidate},{mos},material-{material:02},method-{k:02}\n");
        }
        println!("{} of {materials} materials", material + 1);
    }
    fs::write(folder.join("study.csv"), csv)?;
    Ok(())
}

/// The same material as any other with its number, but `rougher`.
fn table(path: &Path, material: usize, rougher: f64) -> Result<()> {
    let step = (material % 40) as f64;
    let albedo = [0.05 + 0.01 * step, 0.2, 0.4 - 0.008 * step];
    let model = Ggx::new(albedo, [0.04, 0.05, 0.03], (0.04 * 1.06f64.powf(step) * rougher).min(1.0))?;
    Ok(titopo::write(path, &TabulatedBrdf::tabulate(&model, Grid::TITOPO)?)?)
}

fn read(folder: &Path) -> Result<()> {
    let (started, mut bytes) = (Instant::now(), 0);
    let mut buffer = vec![0; 1 << 20];
    for path in tables(folder)? {
        let mut file = fs::File::open(path)?;
        loop {
            match file.read(&mut buffer)? {
                0 => break,
                count => bytes += count,
            }
        }
    }
    report("read", bytes, started)
}

fn extract(folder: &Path) -> Result<()> {
    let study = Study::load(&folder.join("study.csv").to_string_lossy(), None)?;
    let bytes = tables(folder)?.iter().map(|path| Ok(fs::metadata(path)?.len() as usize)).sum::<Result<usize>>()?;
    let (set, setup, registry) = (DescriptorSet::all(), Setup::standard(), Registry::standard()?);
    let mut metrics = registry.resolve("all-lp")?;
    metrics.extend([registry.get("ot")?, registry.get("energy")?]);
    let shown = AtomicUsize::new(0);
    let progress = |p: Progress| {
        if p.done >= shown.load(Ordering::Relaxed) + 50 {
            shown.store(p.done, Ordering::Relaxed);
            eprintln!("{} of {} pairs", p.done, p.total);
        }
    };
    let extractor =
        Extractor { set: &set, setup: &setup, metrics: &metrics, base: None, cache: None, progress: &progress };
    let started = Instant::now();
    let numbers = extractor.extract(&study)?;
    println!("{} pairs, {} columns", numbers.samples.len(), numbers.samples.columns().len());
    report("extracted", bytes, started)
}

fn tables(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found: Vec<PathBuf> = fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    found.retain(|path| path.extension().is_some_and(|e| e == "titopo"));
    found.sort();
    Ok(found)
}

fn report(what: &str, bytes: usize, started: Instant) -> Result<()> {
    let (seconds, megabytes) = (started.elapsed().as_secs_f64(), bytes as f64 / 1e6);
    println!("{what} {megabytes:.0} MB in {seconds:.0} s: {:.0} MB/s", megabytes / seconds);
    // Linux tells a process how much memory it has used at most.
    let status = fs::read_to_string("/proc/self/status").context("peak memory is known on Linux only")?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).context("no VmHWM")?;
    println!("peak memory {}", peak.trim());
    Ok(())
}
