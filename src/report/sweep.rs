//! The report of a sweep: Markdown for people, CSV for machines.

use super::ReportError;
use super::markdown;
use super::spreadsheet::cell;
use super::tables::Table;
use crate::experiment::sweep::{GAMMAS, Judged, SweepRecord, SweepRow};
use vernis_metric::io::counted;

/// Rows of the Markdown table; the CSV has all.
const SHOWN: usize = 40;

fn words(judged: impl Into<Option<Judged>>) -> String {
    let Some(judged) = judged.into() else { return "-".to_owned() };
    format!("{:.3} [{:.3}, {:.3}]", judged.value, judged.interval.low, judged.interval.high)
}

fn table(title: String, rows: &[SweepRow]) -> Table {
    Table {
        title,
        columns: ["metric", "PLCC, logistic", "SROCC", "PLCC, raw"].map(str::to_owned).into(),
        rows: rows.iter().map(|r| vec![r.name.clone(), words(r.plcc), words(r.srocc), words(r.plcc_raw)]).collect(),
    }
}

/// How many pairs were compared, and of how many.
fn pairs(SweepRecord { rows, rated, .. }: &SweepRecord) -> String {
    if rows < rated { format!("a subset of {rows} of {rated} pairs") } else { counted(*rows, "pair") }
}

/// The nested choice: what the sweep found that a reader may expect of other materials.
pub fn nested(record: &SweepRecord) -> Table {
    let SweepRecord { study, folds, .. } = record;
    let (rows, folds) = (pairs(record), counted(*folds, "fold"));
    table(format!("{study}, {rows}, out of fold ({folds} by material), 95 % intervals"), &record.nested)
}

/// The best in sample.
pub fn best(record: &SweepRecord, shown: usize) -> Table {
    let all = record.in_sample.len();
    let shown = shown.min(all);
    let title = format!(
        "{}, {}, grid {}, {} accuracy, the {shown} best of {all} in sample: chosen and mapped on the same rows on which they are judged, as in the \
         paper",
        record.study,
        pairs(record),
        record.grid,
        record.accuracy
    );
    table(title, &record.in_sample[..shown])
}

/// `found` of the combinations that `command` asks for are in the record, `asked` they are.
pub fn markdown(record: &SweepRecord, command: &str, [found, asked]: [usize; 2]) -> String {
    let mut text = format!(
        "# Sweep of the transport and kernel distances\n\n{}\n\n{found} of the {} that this command asks for, \
         {} of them refused and the others with {} powers gamma each; {} of materials, seed {}. Versions: {}.\n\n",
        markdown::code(command),
        counted(asked, "combination"),
        record.refused.len(),
        GAMMAS.len(),
        counted(record.resamples, "resample"),
        record.seed,
        record.versions.iter().map(|(name, version)| format!("{name} {version}")).collect::<Vec<_>>().join(", ")
    );
    if found < asked {
        text += "**Not all are computed yet**: a missing combination may be better than those below.\n\n";
    }
    if record.rows < record.rated {
        let SweepRecord { rows, rated, .. } = record;
        text += &format!(
            "**A subset**: {rows} of the study's {rated} rated pairs, evenly spaced when ordered by material and rating. Intervals are \
             wider than those of the whole study.\n\n"
        );
    }
    text += &nested(record).to_markdown();
    if record.nested.iter().any(|row| row.plcc_raw.is_none()) {
        text += "\nA raw PLCC is missing where the folds chose several distances: they have no unit in common.\n";
    }
    text += "\n";
    text += &best(record, SHOWN).to_markdown();
    if !record.refused.is_empty() {
        let were = if record.refused.len() == 1 { "was" } else { "were" };
        text += &format!("\n{} {were} refused:\n\n", counted(record.refused.len(), "combination"));
        for (reason, names) in by_reason(&record.refused) {
            let others = names.len() - 1;
            let others = match others {
                0 => String::new(),
                n => format!(" and {} to {}", counted(n, "other"), markdown::code(names[n])),
            };
            text += &format!("* {}{others}: {}\n", markdown::code(names[0]), markdown::text(reason));
        }
    }
    text
}

/// Names with one reason together, in their order.
fn by_reason(refused: &[(String, String)]) -> Vec<(&str, Vec<&str>)> {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for (name, reason) in refused {
        match reasons.iter_mut().find(|(known, _)| known == reason) {
            Some((_, names)) => names.push(name),
            None => reasons.push((reason, vec![name])),
        }
    }
    reasons
}

/// One line a combination and gamma, the nested choices first.
pub fn csv(record: &SweepRecord) -> Result<Vec<u8>, ReportError> {
    let failed = |reason: String| ReportError::Format { what: "sweep.csv", reason };
    let mut writer = csv::Writer::from_writer(Vec::new());
    let figures = ["plcc", "srocc", "plcc_raw"].map(|f| [f.to_owned(), format!("{f}_low"), format!("{f}_high")]);
    let header = ["split".to_owned(), "metric".to_owned()].into_iter().chain(figures.into_iter().flatten());
    writer.write_record(header).map_err(|e| failed(e.to_string()))?;
    let nested = record.nested.iter().map(|row| ("out of fold", row));
    for (split, row) in nested.chain(record.in_sample.iter().map(|row| ("in sample", row))) {
        let cells = |judged: Option<Judged>| {
            judged.map_or([const { String::new() }; 3], |j| {
                [j.value, j.interval.low, j.interval.high].map(|x| x.to_string())
            })
        };
        let numbers = [Some(row.plcc), Some(row.srocc), row.plcc_raw].into_iter().flat_map(cells);
        let line = [split.to_owned(), cell(&row.name).into_owned()].into_iter().chain(numbers);
        writer.write_record(line).map_err(|e| failed(e.to_string()))?;
    }
    writer.into_inner().map_err(|e| failed(e.to_string()))
}
