//! `vernis sweep`: the study's transport and kernel distances, every combination of their parameters.

use super::progress::Bar;
use super::{Shared, print, user_error};
use crate::dataset::Study;
use crate::descriptor::Progress;
use crate::evaluation::sweep::{
    Combination, CombinationRecord, Family, Outcome, StudyTables, SweepProtocol, compute, fingerprint, judge,
};
use crate::metric::graph::{GraphGrid, Tone};
use crate::metric::registry::Registry;
use crate::report::{OutputFolder, sweep};
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Sweep the parameters of the transport and energy distances over a study.
#[derive(Args)]
#[command(after_help = "\
Each combination that is done is a file under OUT/combinations; a sweep that was interrupted goes on with the next one.
Options that choose take lists; without them all 992 combinations of transport and 32 of the energy distance are swept.
gamma .25, .35 and .5 follow from the same divergences.

Examples:
  vernis sweep --data ~/brdf-data --family energy
  vernis sweep --data ~/brdf-data --family transport --p 2 --alpha .1 --blur .05,.1 --scaling .8
  vernis sweep --study synthetic --grid 15x15x60 --family transport --p 2 --alpha .1 --phi t^1/4,log:eta=.01")]
pub struct SweepArgs {
    /// A study by name (lavoue2021-open, lavoue2021, synthetic) or a CSV file.
    #[arg(long, default_value = "lavoue2021-open")]
    study: String,
    /// Folder for results [default: out/sweep-STUDY].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Cells that are compared, THETA_IxTHETA_OxPHI_D.
    #[arg(long, default_value = "45x45x180")]
    grid: String,
    /// Which distances [default: both].
    #[arg(long)]
    family: Option<FamilyName>,
    /// Ground costs: 2 (squared distance), 1 (distance).
    #[arg(long, value_delimiter = ',')]
    p: Vec<f64>,
    /// Weights of directions against values: .01, .05, .1, 1.
    #[arg(long, value_delimiter = ',')]
    alpha: Vec<f64>,
    /// Regularisations (the paper's epsilon): .01, .02, .05, .1.
    #[arg(long, value_delimiter = ',')]
    blur: Vec<f64>,
    /// Annealing factors (the paper's s): .8, .9, .95, .99.
    #[arg(long, value_delimiter = ',')]
    scaling: Vec<f64>,
    /// Curves: t, t^1/2, t^1/3, t^1/4, log:eta=E with E = .001, .01, .1, 1; log for all four.
    #[arg(long, value_delimiter = ',')]
    phi: Vec<String>,
    /// Folds by material of the nested choice.
    #[arg(long, default_value_t = 10)]
    folds: usize,
    /// Bootstrap resamples of materials.
    #[arg(long, default_value_t = 2000)]
    resamples: usize,
    /// Seed of splits and resamples.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Memory for tables, in GiB; tables beyond it are made again for every combination.
    #[arg(long, default_value_t = 4.0)]
    memory: f64,
    /// Print the record as JSON instead of tables.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum FamilyName {
    Transport,
    Energy,
}

/// The combinations that the options ask for.
fn chosen(args: &SweepArgs) -> Result<Vec<Combination>> {
    let mut tones = Vec::new();
    for name in &args.phi {
        match name.as_str() {
            "log" => tones.extend(Tone::STUDY.into_iter().filter(|tone| matches!(tone, Tone::Log { .. }))),
            other => tones.push(Tone::parse(other, None).map_err(user_error)?),
        }
    }
    let all = Combination::of_study();
    let studied = |what: &str, given: &[f64], of: &dyn Fn(&Combination) -> Option<f64>| -> Result<()> {
        match given.iter().find(|x| !all.iter().any(|c| of(c) == Some(**x))) {
            None => Ok(()),
            Some(x) => {
                let mut known: Vec<f64> = all.iter().filter_map(of).collect();
                known.sort_by(f64::total_cmp);
                known.dedup();
                let known = known.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
                Err(user_error(format!("--{what}: found {x}, allowed: {known}")))
            }
        }
    };
    studied("p", &args.p, &|c| c.transport.map(|t| t.p))?;
    studied("alpha", &args.alpha, &|c| Some(c.alpha))?;
    studied("blur", &args.blur, &|c| c.transport.map(|t| t.blur))?;
    studied("scaling", &args.scaling, &|c| c.transport.map(|t| t.scaling))?;
    if let Some(tone) = tones.iter().find(|tone| !Tone::STUDY.contains(tone)) {
        let known = Tone::STUDY.map(|tone| tone.to_string()).join(", ");
        return Err(user_error(format!("--phi: found {tone}, allowed: {known}")));
    }
    let listed = |list: &[f64], x: f64| list.is_empty() || list.contains(&x);
    let keep = |c: &Combination| {
        let family = match args.family {
            None => true,
            Some(FamilyName::Transport) => c.family() == Family::Transport,
            Some(FamilyName::Energy) => c.family() == Family::Energy,
        };
        let transport = c
            .transport
            .is_none_or(|t| listed(&args.p, t.p) && listed(&args.blur, t.blur) && listed(&args.scaling, t.scaling));
        family && transport && listed(&args.alpha, c.alpha) && (tones.is_empty() || tones.contains(&c.tone))
    };
    let kept: Vec<Combination> = all.iter().copied().filter(keep).collect();
    if kept.is_empty() {
        return Err(user_error("the options leave no combination; p 2 with alpha 1 and blur .01 is none of the 992"));
    }
    Ok(kept)
}

pub fn run(shared: &Shared, args: SweepArgs) -> Result<()> {
    let combinations = chosen(&args)?;
    let grid: GraphGrid = args.grid.parse().map_err(|e| user_error(format!("--grid: {e}")))?;
    if !(args.memory >= 0.0 && args.memory <= 1e6) {
        return Err(user_error(format!("--memory: found {}, allowed: 0 or more GiB", args.memory)));
    }
    let study = Study::load(&args.study, shared.data.as_deref()).map_err(user_error)?;
    study.validate(args.folds).map_err(user_error)?;
    let short = PathBuf::from(&study.name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from(format!("out/sweep-{short}")));
    let folder = OutputFolder::create(&out).map_err(user_error)?;
    let outcomes = outcomes(shared, &args, &study, grid, &combinations, &out)?;
    let rows: Vec<_> = study.pairs.iter().map(|p| p.row()).collect();
    let protocol = SweepProtocol { folds: args.folds, resamples: args.resamples, seed: args.seed };
    let record = judge(&short, &grid.to_string(), &rows, &outcomes, protocol).map_err(user_error)?;
    folder.write("sweep.csv", &sweep::csv(&record)?)?;
    let command = format!("vernis sweep --study {short} --grid {grid} --seed {}", args.seed);
    let report = folder.write("sweep.md", sweep::markdown(&record, &command).as_bytes())?;
    if args.json {
        return print(serde_json::to_string_pretty(&record)? + "\n");
    }
    let mut text = sweep::nested(&record).to_text() + "\n" + &sweep::best(&record, 10).to_text();
    if study.synthetic {
        text += "SYNTHETIC: these ratings come from simulated observers and say nothing about people.\n";
    }
    print(format!(
        "{text}{} combinations, {} refused\nreport: {}\n",
        outcomes.len(),
        record.refused.len(),
        report.display()
    ))
}

/// What every combination gave: read where an earlier run has left it, computed and kept elsewhere.
fn outcomes(
    shared: &Shared,
    args: &SweepArgs,
    study: &Study,
    grid: GraphGrid,
    combinations: &[Combination],
    out: &std::path::Path,
) -> Result<Vec<(Combination, Outcome)>> {
    let folder = OutputFolder::create(out.join("combinations")).map_err(user_error)?;
    let (grid_name, fingerprint) = (grid.to_string(), fingerprint(study));
    let file = |c: &Combination| format!("{}-{grid_name}.json", c.slug());
    let kept = |c: &Combination| {
        let bytes = std::fs::read(folder.path().join(file(c))).ok()?;
        CombinationRecord::outcome_of(&bytes, c, &grid_name, &fingerprint, study.pairs.len())
    };
    let mut outcomes: Vec<(Combination, Option<Outcome>)> = combinations.iter().map(|c| (*c, kept(c))).collect();
    let missing: usize = outcomes.iter().filter(|(_, o)| o.is_none()).map(|(c, _)| c.weight()).sum();
    if missing > 0 {
        let bar = Bar::new();
        let memory = (args.memory * (1u64 << 30) as f64) as usize;
        let told = |done, total| bar.update("tables", Progress { done, total });
        let tables = StudyTables::of(study, grid, shared.data.as_deref(), memory, &told).map_err(user_error)?;
        let registry = Registry::standard()?;
        let (done, total) = (AtomicUsize::new(0), missing * tables.len());
        let mut finished = 0;
        for (combination, outcome) in outcomes.iter_mut().filter(|(_, outcome)| outcome.is_none()) {
            let weight = combination.weight();
            let step = || {
                let done = done.fetch_add(weight, Ordering::Relaxed) + weight;
                bar.update("sweep", Progress { done: done.min(total), total });
            };
            let found = compute(combination, &registry, &tables, &step).map_err(user_error)?;
            let record = CombinationRecord::new(combination, &grid_name, &fingerprint, found.clone());
            folder.write(&file(combination), &serde_json::to_vec(&record)?)?;
            // A refused combination stops at its first pair.
            finished += weight * tables.len();
            done.store(finished, Ordering::Relaxed);
            *outcome = Some(found);
        }
        bar.finish();
    }
    let done = |(combination, outcome): (Combination, Option<Outcome>)| {
        Ok((combination, outcome.context("a combination was not computed")?))
    };
    outcomes.into_iter().map(done).collect()
}
