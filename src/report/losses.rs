//! The report of the experiment on losses, in Markdown.

use super::markdown;
use super::tables::Table;
use crate::experiment::losses::compare::{Comparison, Verdict};
use crate::experiment::losses::record::{Blending, LossesRecord, Searches};
use crate::experiment::losses::{Loss, OPINION};
use std::collections::BTreeMap;
use vernis_metric::io::{counted, decimals};

/// The whole report; `command` makes it again.
pub fn markdown(record: &LossesRecord, command: &str) -> String {
    let mut text = format!("# Which loss should a fit have?\n\n{}\n\n", markdown::code(command));
    if record.synthetic {
        text += "**SYNTHETIC ratings: they come from simulated observers and say nothing about people.**\n\n";
    }
    text += &introduction(record);
    text += "\n## In short\n\n";
    text += &summary(record);
    text += "\n## All models together\n\n";
    for (baseline, comparisons) in &record.pooled {
        text += &differences(&format!("Against {}", baseline.name()), comparisons).to_markdown();
        text += "\n";
    }
    if let Some((baseline, comparisons)) = record.pooled.first() {
        let title =
            format!("Materials of {} on which a loss is better than {}", record.materials.len(), baseline.name());
        text += &wins(&title, comparisons).to_markdown();
        text += "\n";
    }
    for Blending { loss, parts } in &record.blending {
        text += &format!("## {}: let in by degrees, or from the first step on\n\n", loss.name());
        text += &blending(*loss, parts).to_markdown();
        text += "\n";
    }
    text += "\n## Each model\n\n";
    for (model, comparisons) in &record.by_model {
        let baseline = comparisons.first().map_or("", |c| c.baseline.name());
        text += &differences(&format!("{model}, against {baseline}"), comparisons).to_markdown();
        text += "\n";
    }
    text + &method(record)
}

/// The tables of the whole for a terminal.
pub fn text(record: &LossesRecord) -> String {
    let tables = record.pooled.iter().map(|(b, c)| differences(&format!("Against {}", b.name()), c).to_text() + "\n");
    tables.collect::<String>() + &summary(record)
}

fn introduction(record: &LossesRecord) -> String {
    // Every study is learned from in grades; who rated on another scale must know.
    let grades = match record.scale {
        scale if scale.is_grades() => String::new(),
        scale => format!("\nThe study's scale, {scale}, is mapped to 1 (worst) to 5 (best) here.\n"),
    };
    format!(
        "{}, one of each group of sisters, were fitted with {} under {}; {} judged each fit.\n\n\
         Each number is the change of the judge's distance against the baseline in per cent, 200 (a - b)/(a + b); less is \
         better. For `mos` it is the change of the predicted mean opinion score; more is better. Means over materials [95 % interval, \
         {} of materials]. *better* and *worse*: p < 0.05 after Holm's correction for all fair comparisons of a table. \
         (In parentheses: the judge is the loss or the baseline itself and does not count.)\n",
        counted(record.materials.len(), "material"),
        record.settings.models.join(", "),
        counted(record.searches.len(), "loss"),
        counted(record.judges.len(), "metric"),
        counted(record.resamples, "resample"),
    ) + &grades
}

/// In plain words: what each loss is worth against each baseline, and whether blending helps.
fn summary(record: &LossesRecord) -> String {
    let mut text = String::new();
    if let Some(least) = least_p(record).filter(|least| *least >= 0.05) {
        text += &format!(
            "* **These tables can decide nothing**: with {} and {}, the least p after Holm's correction is {}. The intervals are \
             not corrected.\n",
            counted(record.materials.len(), "material"),
            counted(record.resamples, "resample"),
            decimals(least.min(1.0), 2),
        );
    }
    for (baseline, comparisons) in &record.pooled {
        let tallies = tallies(comparisons);
        for (loss, tally) in &tallies {
            text += &format!("* `{}` against `{}`: {}.\n", loss.name(), baseline.name(), tally.words());
        }
        let most = tallies.values().map(Tally::balance).max().unwrap_or(0);
        let best: Vec<String> =
            tallies.iter().filter(|(_, t)| t.balance() == most).map(|(l, _)| format!("`{}`", l.name())).collect();
        text += &match most {
            ..=0 => format!("* **No loss is better than `{}` by more judges than it is worse.**\n", baseline.name()),
            _ => format!("* **Most often better than `{}`: {}.**\n", baseline.name(), best.join(" and ")),
        };
    }
    for Blending { loss, parts } in &record.blending {
        for tally in parts.first().map(|(_, comparisons)| tallies(comparisons)).unwrap_or_default().values() {
            let helps = match (tally.better.len(), tally.worse.len()) {
                (0, 0) => "makes no difference that these materials can show",
                (_, 0) => "helps",
                (0, _) => "harms",
                _ => "helps by some judges and harms by others",
            };
            let name = loss.name();
            text +=
                &format!("* **Blending {helps}** (`{name}`), against the same search without it: {}.\n", tally.words());
        }
    }
    text
}

/// The least p that a comparison of the tables can have after Holm's correction ([`crate::experiment::losses::compare`]).
fn least_p(record: &LossesRecord) -> Option<f64> {
    let fair = |comparisons: &Vec<Comparison>| comparisons.iter().filter(|c| c.verdict != Verdict::NotFair).count();
    let most = record.pooled.iter().map(|(_, comparisons)| fair(comparisons)).max()?;
    let of_materials = 0.5f64.powi(record.materials.len() as i32 - 1);
    Some(most as f64 * of_materials.max(2.0 / (record.resamples as f64 + 1.0)))
}

/// What the fair judges say of a loss.
#[derive(Default)]
struct Tally {
    better: Vec<String>,
    worse: Vec<String>,
    /// How many.
    undecided: usize,
}

impl Tally {
    fn balance(&self) -> i64 {
        self.better.len() as i64 - self.worse.len() as i64
    }

    fn words(&self) -> String {
        let part = |what: &str, judges: &[String]| match judges {
            [] => format!("{what} by none"),
            some => format!("{what} by {} ({})", some.len(), some.join(", ")),
        };
        let decided = [("better", &self.better), ("worse", &self.worse)].map(|(what, judges)| part(what, judges));
        format!("{}, undecided by {}", decided.join(", "), self.undecided)
    }
}

fn tallies(comparisons: &[Comparison]) -> BTreeMap<Loss, Tally> {
    let mut tallies: BTreeMap<Loss, Tally> = BTreeMap::new();
    for c in comparisons {
        let tally = tallies.entry(c.loss).or_default();
        match c.verdict {
            Verdict::Better => tally.better.push(c.judge.clone()),
            Verdict::Worse => tally.worse.push(c.judge.clone()),
            Verdict::Undecided => tally.undecided += 1,
            Verdict::NotFair => (),
        }
    }
    tallies
}

fn cell(c: &Comparison) -> String {
    let digits = if c.judge == OPINION { 2 } else { 1 };
    let (d, interval) = (c.difference.difference, c.difference.interval);
    let numbers = format!("{d:+.digits$} [{:+.digits$}, {:+.digits$}]", interval.low, interval.high);
    match c.verdict {
        Verdict::Better => format!("{numbers} *better*"),
        Verdict::Worse => format!("{numbers} *worse*"),
        Verdict::Undecided => numbers,
        Verdict::NotFair => format!("({numbers})"),
    }
}

/// Judges x losses.
fn table(title: &str, comparisons: &[Comparison], cell: impl Fn(&Comparison) -> String) -> Table {
    let mut columns = vec!["judge".to_owned()];
    let mut rows: Vec<Vec<String>> = Vec::new();
    for c in comparisons {
        if !columns.iter().any(|column| column == c.loss.name()) {
            columns.push(c.loss.name().to_owned());
        }
        match rows.last_mut().filter(|row| row[0] == c.judge) {
            Some(row) => row.push(cell(c)),
            None => rows.push(vec![c.judge.clone(), cell(c)]),
        }
    }
    Table { title: title.to_owned(), columns, rows }
}

fn differences(title: &str, comparisons: &[Comparison]) -> Table {
    table(title, comparisons, cell)
}

fn wins(title: &str, comparisons: &[Comparison]) -> Table {
    table(title, comparisons, |c| format!("{} [{:.0}, {:.0}]", c.wins, c.wins_interval.low, c.wins_interval.high))
}

/// Judges x models.
fn blending(blended: Loss, parts: &[(String, Vec<Comparison>)]) -> Table {
    let columns = std::iter::once("judge".to_owned()).chain(parts.iter().map(|(model, _)| model.clone())).collect();
    let judges = parts.first().map_or(&[][..], |(_, comparisons)| comparisons);
    let row = |(k, c): (usize, &Comparison)| {
        std::iter::once(c.judge.clone()).chain(parts.iter().filter_map(|(_, all)| all.get(k)).map(cell)).collect()
    };
    Table {
        title: format!("{} against the loss from the first step on", blended.name()),
        columns,
        rows: judges.iter().enumerate().map(row).collect(),
    }
}

fn method(record: &LossesRecord) -> String {
    let s = &record.settings;
    let mut text = format!(
        "## How it was made\n\n\
         * Losses are minimised as `vernis fit` does by default, `ot` and `energy` by L-BFGS. `D4.Cl`, `D9.Cl` and `D4.Cl.CR` (D4.Cl of cube roots) are searched \
         on every {0}th cell along each axis, then polished on all cells; `ot` is `{1}` and `energy` is `{5}`, on a coarse grid so that \
         a fit takes seconds. Of these and of learned losses a search takes at most {2} evaluations. `vernis-1`, `vernis` and \
         `vernis-loss` are the recipes of the two versions of the metric. `vernis-1` and `vernis` start from a fit under D9.Cl; those \
         called `-blended` start there as well and are let in by degrees.\n\
         * The learned metric of a material's fits comes from {3} folds by material of {4} and has seen neither the material nor \
         its sisters. `mos` comes from another metric of the same fold, trained by the recipe of `vernis` with another seed: it has not \
         seen them either, but it shares rows and descriptors with the learned losses, so it favours them.\n\
         * The judges `ot` and `energy` are the same as the losses. `PROBE.log` and `PROBE.screen` compare pictures of a \
         sphere under a light probe in five turns, in an opponent log space (fourth-power mean) and as a screen shows them \
         (root mean square). The learned metrics use such pictures, but under other lights. `PROBE.ssim` and the like compare rendered \
         stimuli by the same camera under that probe.\n\
         * Searches that reached their limit of evaluations, of all fits, and the median number of evaluations: ",
        s.coarsening,
        s.transport,
        s.max_evaluations,
        s.folds,
        markdown::text(&record.study),
        s.energy,
    );
    let ends = |e: &Searches| format!("`{}` {} of {}, {}", e.loss.name(), e.unfinished, e.fits, e.evaluations);
    text += &record.searches.iter().map(ends).collect::<Vec<_>>().join("; ");
    text += &format!(".\n* Materials: {}.\n", markdown::text(&record.materials.join(", ")));
    text += &format!("* Seed {}, vernis {}.", s.seed, env!("CARGO_PKG_VERSION"));
    for (name, sha256) in &record.data {
        let start: String = sha256.chars().take(16).collect();
        text += &format!(" {} {}.", markdown::code(name), markdown::text(&start));
    }
    text + "\n"
}
