//! `vernis sweep`: the study's transport and kernel distances, every combination of their parameters.

use super::judging::Judging;
use super::output::{self, Inputs, Replace};
use super::progress::Bar;
use super::scale::ScaleArgs;
use super::{Shared, print, signals, user_error, workspace};
use crate::dataset::Study;
use crate::experiment::sweep::{Combination, Family, SweepOptions, SweepProtocol, Swept};
use crate::experiment::{self, ExperimentError};
use crate::report::sweep;
use anyhow::Result;
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use vernis_metric::io::counted;
use vernis_metric::metric::graph::{GraphGrid, Tone};
use vernis_metric::metric::transport::Accuracy;

/// Sweep the parameters of the transport and energy distances over a study.
#[derive(Args)]
#[command(after_help = "\
Each finished combination is a file in OUT/combinations; after an interruption (Ctrl-C, exit code 130; SIGTERM, 143) the same
command continues with the next pair. Files of another study are refused.
Combinations that differ only in scaling share work and are computed together.
Options that select combinations take lists; without them the sweep covers all 992 of transport and 32 of the energy distance.
The results for gamma 0.25, 0.35 and 0.5 follow from the same divergences.

Examples:
  vernis sweep --data ~/brdf-data --family energy
  vernis sweep --data ~/brdf-data --family transport --p 2 --alpha 0.1 --blur 0.05,0.1 --scaling 0.8
  vernis sweep --data ~/brdf-data --p 2 --accuracy coarse
  vernis sweep --data ~/brdf-data --p 1 --scaling 0.8 --accuracy coarse --pairs 124
  vernis sweep --study synthetic --grid 15x15x60 --family transport --p 2 --alpha 0.1 --phi t^1/4,log:eta=0.01")]
pub struct SweepArgs {
    /// A study by name (lavoue2021-open, lavoue2021, synthetic) or a CSV file.
    #[arg(long, default_value = "lavoue2021-open")]
    study: String,
    #[command(flatten)]
    scale: ScaleArgs,
    /// Only so many pairs, evenly spaced when ordered by material and rating [default: all].
    #[arg(long, value_name = "N")]
    pairs: Option<usize>,
    /// Folder for results [default: out/sweep-STUDY].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Grid on which graphs are compared, THETA_IxTHETA_OxPHI_D.
    #[arg(long, default_value = "45x45x180")]
    grid: String,
    /// Accuracy of transport: coarse (errors up to 2 %), fast (4 % at worst, mostly 0.1 %), standard (1 %), high (0.1 %).
    #[arg(long, default_value = "standard")]
    accuracy: String,
    /// Report the results so far, without computing more.
    #[arg(long)]
    report: bool,
    /// Which distances [default: both].
    #[arg(long)]
    family: Option<FamilyName>,
    /// Ground costs: 2 (squared distance), 1 (distance).
    #[arg(long, value_delimiter = ',')]
    p: Vec<f64>,
    /// Weights of directions against values: 0.01, 0.05, 0.1, 1.
    #[arg(long, value_delimiter = ',')]
    alpha: Vec<f64>,
    /// Regularisations (the paper's epsilon): 0.01, 0.02, 0.05, 0.1.
    #[arg(long, value_delimiter = ',')]
    blur: Vec<f64>,
    /// Annealing factors (the paper's s): 0.8, 0.9, 0.95, 0.99.
    #[arg(long, value_delimiter = ',')]
    scaling: Vec<f64>,
    /// Curves: t, t^1/2, t^1/3, t^1/4, log:eta=E with E = 0.001, 0.01, 0.1, 1; log for all four.
    #[arg(long, value_delimiter = ',')]
    phi: Vec<String>,
    #[command(flatten)]
    judging: Judging,
    /// Memory for tables, in GiB; tables beyond it are recomputed for every combination.
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
                Err(user_error(format!("--{what} is {x}; it must be one of {known}")))
            }
        }
    };
    studied("p", &args.p, &|c| c.transport.map(|t| t.p))?;
    studied("alpha", &args.alpha, &|c| Some(c.alpha))?;
    studied("blur", &args.blur, &|c| c.transport.map(|t| t.blur))?;
    studied("scaling", &args.scaling, &|c| c.transport.map(|t| t.scaling))?;
    if let Some(tone) = tones.iter().find(|tone| !Tone::STUDY.contains(tone)) {
        let known = Tone::STUDY.map(|tone| tone.to_string()).join(", ");
        return Err(user_error(format!("--phi is {tone}; it must be one of {known}")));
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
        return Err(user_error(
            "the options leave no combination; the 992 do not include p 2 with alpha 1 and blur 0.01",
        ));
    }
    Ok(kept)
}

pub fn run(shared: &Shared, args: SweepArgs) -> Result<()> {
    let combinations = chosen(&args)?;
    let grid: GraphGrid = args.grid.parse().map_err(|e| user_error(format!("--grid: {e}")))?;
    if !Accuracy::NAMES.contains(&args.accuracy.as_str()) {
        let allowed = Accuracy::NAMES.join(", ");
        return Err(user_error(format!("--accuracy is {}; it must be one of {allowed}", args.accuracy)));
    }
    if !(args.memory >= 0.0 && args.memory <= 1e6) {
        return Err(user_error(format!("--memory is {}; it must be 0 to 1000000 GiB", args.memory)));
    }
    let study = Study::load_on(&args.study, shared.data.as_deref(), args.scale.declared).map_err(user_error)?;
    let rated = study.pairs.len();
    if let Some(pairs) = args.pairs.filter(|pairs| !(1..=rated).contains(pairs)) {
        return Err(user_error(format!("--pairs is {pairs}; it must be 1 to {rated}, all of the study's")));
    }
    let asked = args.pairs.map_or(String::new(), |pairs| format!("with --pairs {pairs}, "));
    let swept = study.clone().thinned(args.pairs.unwrap_or(rated));
    swept.validate(args.judging.folds).map_err(|error| user_error(format!("{asked}{error}")))?;
    let short = study.short_name();
    let default = || PathBuf::from(format!("out/sweep-{short}"));
    let (names, inputs) = (["sweep.csv", "sweep.md"], Inputs::default().file(&args.study));
    let folder = output::folder(args.out.as_deref(), default, &names, &inputs, Replace::CONTINUES)?;
    let options = SweepOptions {
        data: shared.data.clone(),
        folder: folder.path().join("combinations"),
        combinations,
        grid,
        accuracy: args.accuracy.clone(),
        memory: (args.memory * (1u64 << 30) as f64) as usize,
        compute: !args.report,
        pairs: args.pairs,
        protocol: SweepProtocol {
            folds: args.judging.folds,
            resamples: args.judging.resamples,
            seed: args.judging.seed,
        },
    };
    let bar = Bar::new();
    signals::resumable(
        &bar,
        format!(
            "the pairs that are finished are kept in {}; the same command continues from there",
            options.folder.display()
        ),
    )?;
    let found = experiment::sweep::sweep(&study, &options, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    let Swept { record, done, warnings } = found.map_err(|error| match error {
        ExperimentError::NothingKept { .. } => user_error(format!("{error}; without --report they are computed")),
        other => user_error(other),
    })?;
    workspace::warn(&warnings);
    folder.write("sweep.csv", &sweep::csv(&record)?)?;
    let numbers = [done, options.combinations.len()];
    let report =
        folder.write("sweep.md", sweep::markdown(&record, &command(&args, &study.name), numbers).as_bytes())?;
    if args.json {
        return print(serde_json::to_string_pretty(&record)? + "\n");
    }
    let mut text = sweep::nested(&record).to_text() + "\n" + &sweep::best(&record, 10).to_text();
    if study.synthetic {
        text += "SYNTHETIC: these ratings come from simulated observers and say nothing about people.\n";
    }
    print(format!(
        "{text}{} of {}, {} refused\nreport: {}\n",
        done,
        counted(options.combinations.len(), "combination"),
        record.refused.len(),
        report.display()
    ))
}

/// The command that makes the same report again.
fn command(args: &SweepArgs, study: &str) -> String {
    let scale = args.scale.option();
    let pairs = args.pairs.map_or(String::new(), |pairs| format!(" --pairs {pairs}"));
    let mut command =
        format!("vernis sweep --study {study}{scale}{pairs} --grid {} --accuracy {}", args.grid, args.accuracy);
    if let Some(family) = args.family.and_then(|family| family.to_possible_value()) {
        command += &format!(" --family {}", family.get_name());
    }
    let lists = [("p", &args.p), ("alpha", &args.alpha), ("blur", &args.blur), ("scaling", &args.scaling)];
    for (option, list) in lists.into_iter().filter(|(_, list)| !list.is_empty()) {
        command += &format!(" --{option} {}", list.iter().map(f64::to_string).collect::<Vec<_>>().join(","));
    }
    if !args.phi.is_empty() {
        command += &format!(" --phi {}", args.phi.join(","));
    }
    command
        + &format!(
            " --folds {} --resamples {} --seed {}",
            args.judging.folds, args.judging.resamples, args.judging.seed
        )
}
