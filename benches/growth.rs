//! How CPU time grows: extraction over pairs (10, 100, 1,000) and over workers (1, 2), transport and energy over grid size, and
//! training over materials. Everything in one run without a cache, so that the ratios hold on a busy machine; a part that should be linear
//! says by how much it is not.
//!
//! `cargo bench --bench growth -- [pairs] [grid] [materials] [workers]`: all parts, or those named. With `VERNIS_DATA` trainings are on
//! the open study, else on the synthetic one. Linux only: it reads the process's CPU time from /proc.

#![allow(missing_docs, reason = "a bench has no interface")]

use anyhow::{Context, Result, anyhow, bail};
use std::collections::BTreeSet;
use std::hint::black_box;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Instant;
use vernis::brdf::models::Ggx;
use vernis::dataset::{Study, synthetic};
use vernis::descriptor::{DescriptorSet, Setup};
use vernis::metric::Metric;
use vernis::metric::graph::GraphGrid;
use vernis::metric::registry::Registry;
use vernis::samples::extraction::Extractor;
use vernis::samples::split::TrainingSet;
use vernis::train::recipe;

const PARTS: [&str; 4] = ["pairs", "grid", "materials", "workers"];

/// The argument of a process that [`workers`] starts.
const ALONE: &str = "--alone";

fn main() -> Result<()> {
    let mut named: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    if named == [ALONE] {
        return alone();
    }
    if let Some(unknown) = named.iter().find(|part| !PARTS.contains(&part.as_str())) {
        bail!("the part is `{unknown}`; it must be one of {}", PARTS.join(", "));
    }
    if named.is_empty() {
        named = PARTS.map(str::to_owned).to_vec();
    }
    for part in named {
        match part.as_str() {
            "pairs" => pairs()?,
            "grid" => grid()?,
            "materials" => materials()?,
            _ => workers()?,
        }
    }
    Ok(())
}

/// User and system time of all threads, s. They are told in hundredths of a second.
fn cpu_time() -> Result<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").context("CPU time is read from /proc")?;
    // The second field is the name in parentheses, which may hold spaces; times are the 14th and the 15th.
    let (_, after) = text.rsplit_once(')').context("/proc/self/stat has no name")?;
    let field = |k: usize| after.split_whitespace().nth(k).and_then(|ticks| ticks.parse::<f64>().ok());
    let ticks = field(11).zip(field(12)).context("/proc/self/stat has no times")?;
    Ok((ticks.0 + ticks.1) / 100.0)
}

/// CPU time and time of one run, s.
fn times<T>(run: impl FnOnce() -> Result<T>) -> Result<[f64; 2]> {
    let (cpu, start) = (cpu_time()?, Instant::now());
    black_box(run()?);
    Ok([cpu_time()? - cpu, start.elapsed().as_secs_f64()])
}

/// Times of one size each, and by how much the time of a unit differs from the first size's.
fn table(what: &str, unit: &str, sizes: &[(String, f64, f64)]) {
    println!("\n{what}\n{:>14}{:>12}{:>20}{:>14}", "size", "CPU s", format!("ms {unit}"), "off linear");
    let first = sizes.first().map_or(1.0, |(_, count, time)| time / count);
    for (size, count, time) in sizes {
        println!("{size:>14}{time:>12.2}{:>20.3}{:>12.0} %", 1e3 * time / count, 100.0 * (time / count / first - 1.0));
    }
}

/// `count` pairs of the synthetic study, again from the first where it ends.
fn study(count: usize) -> Result<Study> {
    let whole = Study::load(synthetic::NAME, None)?;
    let pairs = whole.pairs.iter().cycle().take(count).cloned().collect();
    Ok(Study { pairs, ..whole })
}

fn extract(study: &Study) -> Result<()> {
    let (set, setup, registry) = (DescriptorSet::all(), Setup::standard(), Registry::standard()?);
    let metrics: Vec<Arc<dyn Metric>> = registry.resolve("all-lp")?;
    let extractor =
        Extractor { set: &set, setup: &setup, metrics: &metrics, base: None, cache: None, progress: &|_| () };
    black_box(extractor.extract(study)?);
    Ok(())
}

fn pairs() -> Result<()> {
    // What is made once a process is made before.
    extract(&study(1)?)?;
    let time = |count: usize| -> Result<_> {
        let study = study(count)?;
        Ok((count.to_string(), count as f64, times(|| extract(&study))?[0]))
    };
    let sizes = [10, 100, 1000].into_iter().map(time).collect::<Result<Vec<_>>>()?;
    table("Descriptors and Lp distances, over pairs", "a pair", &sizes);
    Ok(())
}

fn grid() -> Result<()> {
    let metal = |alpha| Ggx { kd: [0.01; 3], f0: [0.95, 0.64, 0.54], alpha };
    let (reference, candidate) = (metal(0.15), metal(0.2));
    let registry = Registry::standard()?;
    for (name, options) in [("ot", ""), ("ot, p = 1", "p=1,"), ("energy", "")] {
        let family = name.split(',').next().unwrap_or(name);
        let mut sizes = Vec::new();
        for grid in ["15x15x60", "30x30x120", "45x45x180", "90x90x360"] {
            let metric = registry.get(&format!("{family}[{options}grid={grid}]"))?;
            let cells: usize = grid.parse::<GraphGrid>()?.len();
            let [cpu, _] = times(|| Ok(metric.distance(&reference, &candidate)?))?;
            sizes.push((grid.to_owned(), cells as f64 / 1000.0, cpu));
        }
        table(&format!("{name}, of two models, over cells"), "a 1,000 cells", &sizes);
    }
    Ok(())
}

fn materials() -> Result<()> {
    let data = std::env::var_os("VERNIS_DATA").map(PathBuf::from);
    let name = if data.is_some() { "lavoue2021-open" } else { synthetic::NAME };
    let study = Study::load(name, data.as_deref())?;
    let (set, setup) = (recipe::descriptors(), Setup::standard());
    let extractor =
        Extractor { set: &set, setup: &setup, metrics: &[], base: data.as_deref(), cache: None, progress: &|_| () };
    let samples = extractor.extract(&study)?.samples;
    let whole = TrainingSet::whole(&samples);
    let groups: Vec<&str> =
        study.pairs.iter().map(|pair| pair.group.as_str()).collect::<BTreeSet<_>>().into_iter().collect();
    for (what, trainer) in [
        ("vernis-loss", &recipe::distance() as &dyn vernis::train::Trainer),
        ("vernis", &recipe::metric(&recipe::distance())),
    ] {
        let mut sizes = Vec::new();
        for share in [4, 2, 1] {
            let taken: BTreeSet<&str> = groups.iter().copied().take(groups.len() / share).collect();
            let set = whole.filter(|row| taken.contains(row.group.as_str()));
            let [cpu, _] = times(|| Ok(trainer.train(&set, 1)?))?;
            sizes.push((taken.len().to_string(), taken.len() as f64, cpu));
        }
        table(&format!("Training {what} on {name}, without triplets, over materials"), "a material", &sizes);
    }
    Ok(())
}

fn workers() -> Result<()> {
    println!("\nDescriptors and Lp distances of 200 pairs, over workers\n{:>14}{:>12}{:>12}", "workers", "CPU s", "s");
    for threads in ["1", "2"] {
        // A process each: a worker hands the parts of its job to the threads that the process began with.
        let mut child = Command::new(std::env::current_exe()?);
        let output = child.arg(ALONE).env("RAYON_NUM_THREADS", threads).stderr(Stdio::inherit()).output()?;
        let [cpu, elapsed] = String::from_utf8(output.stdout)?
            .split_whitespace()
            .map(|number| Ok(number.parse::<f64>()?))
            .collect::<Result<Vec<_>>>()?
            .try_into()
            .map_err(|found| {
                anyhow!("the process of {threads} workers printed {found:?}; it must print two numbers")
            })?;
        println!("{threads:>14}{cpu:>12.2}{elapsed:>12.2}");
    }
    Ok(())
}

/// What a process of [`workers`] does: CPU time and time of 200 pairs.
fn alone() -> Result<()> {
    let study = study(200)?;
    let [cpu, elapsed] = times(|| extract(&study))?;
    println!("{cpu} {elapsed}");
    Ok(())
}
