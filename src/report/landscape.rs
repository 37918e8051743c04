//! The report of how metrics follow one parameter of a material: Markdown, text for a terminal, figures.

use super::markdown;
use super::tables::Table;
use super::{Figure, OutputFolder, ReportError};
use crate::experiment::landscape::record::{
    Answer, Course, Fall, LandscapeRecord, Line, MetricNote, OddPair, Sweep, Swept,
};
use crate::experiment::landscape::{ALLOWED, ALLOWED_HUE};
use std::path::PathBuf;

/// The files of the report, beside its figures.
pub const FILES: [&str; 2] = ["report.md", "record.json"];

/// The names of its figures, each an SVG and a PNG file.
pub const FIGURES: [&str; 3] = ["sweeps", "landscapes", "pairs"];

const SWEEPS: &str = "\
Each material is compared with itself, one parameter changed. On the way out from the reference a distance should grow. The table gives \
the largest fall of each distance on that way, towards smaller and towards larger values; 0 means that it only grows. \
The first figure is the fall within the range in which people rated, the figure in parentheses that along the whole sweep.";

const LANDSCAPES: &str = "\
A fit minimises a loss: for metrics learned from ratings the signed distance without the cut at zero, for others the distance. Each line of a \
parameter runs through the reference in fine steps. The last line of a material leads from the start of `ggx` to its fit under D4.Cl.CR, \
straight in the coordinates of a search; the reference there has a second lobe that the model lacks. Each loss is divided by its own value at \
the end of the line. *hollow* is the deepest dip beside the lowest point: a search that only descends stops there. *bend* is the largest change \
of slope between two neighbouring segments, with the length of the line as 1: large at kinks and steps. The corner of a distance at its lowest \
point does not count. *lowest at* is the value at which a loss is lowest, given where that is neither the reference nor the fit.";

const PAIRS: &str = "\
Pairs whose difference everybody can name. Mirrors of these three roughnesses look the same under all but the smallest lights.";

/// Why a metric of pictures says what it says of blacks and of metals; nothing here cures it.
const NO_CURE: &str = "\
Blacks and the colours of metals have no cure here. The learned metrics compare pictures by the logarithm of their values, over a floor of \
0.01: two surfaces differ by the ratio of their brightness, and the ratio of two blacks counts like that of two greys until both lie below \
the floor. People see a black of albedo 0.001 and one of 0.005 as black, because a screen and a room add light of their own; nobody rated \
such pairs, and the picture knows neither. For metals, people rated approximations whose hue is nearly right. Nothing in the ratings says how \
bad silver is in place of gold, and most of what a rater compares, shape and sharpness of the highlight, is the same in both.";

/// Writes `report.md`, `record.json` and each figure as SVG and PNG; `command` makes them again. Returns the path of the report.
///
/// # Errors
/// A figure that cannot be drawn; a file that cannot be written.
pub fn write(folder: &OutputFolder, record: &LandscapeRecord, command: &str) -> Result<PathBuf, ReportError> {
    let figures = draw(record)?;
    super::write_figures(folder, &figures)?;
    super::write_json(folder, FILES[1], record)?;
    folder.write(FILES[0], markdown(record, command, &figures).as_bytes())
}

#[cfg(feature = "train")]
fn draw(record: &LandscapeRecord) -> Result<Vec<Figure>, ReportError> {
    super::figures::landscape::all(record)
}

/// Figures need the `train` feature; without it the report has its tables alone.
#[cfg(not(feature = "train"))]
fn draw(_record: &LandscapeRecord) -> Result<Vec<Figure>, ReportError> {
    Ok(Vec::new())
}

/// The whole report; figures are the PNG files beside it.
pub fn markdown(record: &LandscapeRecord, command: &str, figures: &[Figure]) -> String {
    let metrics = record.metrics.iter().map(|m| format!("{} {} ({})", m.name, m.version, unit(m)));
    let mut text = format!(
        "# How metrics follow one parameter of a material\n\n{}\n\nMetrics, with their versions and the units of their distances: {}.\n\n",
        markdown::code(command),
        markdown::text(&metrics.collect::<Vec<_>>().join(", "))
    );
    let shown = |names: &[&str]| -> String {
        let named = figures.iter().filter(|figure| names.contains(&figure.name));
        named.map(|f| format!("![{0}]({0}.png)\n\n*{1}*\n\n", f.name, markdown::text(&f.caption))).collect()
    };
    text += &format!("## Sweeps\n\n{SWEEPS}\n\n{}\n", falls(record).to_markdown());
    text += &format!(
        "A metric in MOS should fall by no more than {ALLOWED} within the range of the ratings, by {ALLOWED_HUE} where the hue turns. {}\n\n{}",
        markdown::text(&verdict(record)),
        shown(&["sweeps"])
    );
    text +=
        &format!("## Landscapes\n\n{LANDSCAPES}\n\n{}\n{}", landscapes(record).to_markdown(), shown(&["landscapes"]));
    text += &format!("## Odd pairs\n\n{PAIRS}\n\n{}\n{NO_CURE}\n\n{}", pairs(record).to_markdown(), shown(&["pairs"]));
    text += &format!(
        "Sweeps have {} candidates between the reference and the end of what people rated, in each direction; landscapes have {} points.\n",
        record.points, record.steps
    );
    text
}

/// The verdicts and the odd pairs, for a terminal.
pub fn text(record: &LandscapeRecord) -> String {
    format!("{}\n{}\n{}\n", falls(record).to_text(), pairs(record).to_text(), verdict(record))
}

/// Which metrics in MOS fall by more than is allowed, a sentence or two.
fn verdict(record: &LandscapeRecord) -> String {
    let of_metric = |(k, metric): (usize, &MetricNote)| {
        let falls = record.sweeps.iter().filter_map(|sweep| {
            let fall = sweep.of_metric.get(k)?.rated_fall();
            (fall > sweep.allowed).then(|| format!("{:.3} on the {} of the {}", fall, sweep.parameter, sweep.material))
        });
        let falls: Vec<String> = falls.collect();
        match falls.is_empty() {
            true => format!("{} keeps to that on all {} sweeps.", metric.name, record.sweeps.len()),
            false => format!("{} does not: it falls by {}.", metric.name, falls.join(", ")),
        }
    };
    let in_mos = record.metrics.iter().enumerate().filter(|(_, metric)| metric.is_in_mos());
    let sentences: Vec<String> = in_mos.map(of_metric).collect();
    if sentences.is_empty() { "No metric here is in MOS.".to_owned() } else { sentences.join(" ") }
}

fn unit(metric: &MetricNote) -> &str {
    if metric.unit == "1" { "no unit" } else { &metric.unit }
}

fn columns(first: &[&str], record: &LandscapeRecord) -> Vec<String> {
    first.iter().map(|c| (*c).to_owned()).chain(record.metrics.iter().map(|m| m.name.clone())).collect()
}

fn falls(record: &LandscapeRecord) -> Table {
    let columns =
        columns(&["material, parameter", "direction", "from the reference to the end of the ratings"], record);
    let title = "Largest fall of the distance on the way out, in the unit of each metric".to_owned();
    let mut table = Table { title, columns, rows: Vec::new() };
    for sweep in &record.sweeps {
        let directions = [("down", sweep.rated.0), ("up", sweep.rated.1)];
        for (i, (direction, end)) in directions.into_iter().enumerate() {
            let of = |swept: &Swept| if i == 0 { swept.down } else { swept.up };
            if sweep.of_metric.iter().all(|swept| of(swept).is_none()) {
                continue;
            }
            let mut row = vec![format!("{}, {}", sweep.material, sweep.parameter), direction.to_owned()];
            row.push(format!("{} to {}{}", number(sweep.reference), number(end), words_of_unit(sweep)));
            row.extend(sweep.of_metric.iter().map(|swept| of(swept).map_or("-".to_owned(), fall)));
            table.rows.push(row);
        }
    }
    table
}

fn fall(fall: Fall) -> String {
    let number = |x: f64| if x == 0.0 { "0".to_owned() } else { format!("{x:.3}") };
    format!("{} ({})", number(fall.rated), number(fall.whole))
}

fn words_of_unit(sweep: &Sweep) -> String {
    if sweep.unit == "1" { String::new() } else { format!(" {}", sweep.unit) }
}

/// Two significant digits at least, and none that say nothing.
fn number(x: f64) -> String {
    format!("{}", if x.abs() < 0.1 { (x * 1e4).round() / 1e4 } else { (x * 100.0).round() / 100.0 })
}

fn landscapes(record: &LandscapeRecord) -> Table {
    let columns = columns(&["material, line"], record);
    let title = "Deepest hollow, as a share of the loss at the end of the line; largest bend; where the loss is lowest, if elsewhere".to_owned();
    let cell = |line: &Line, course: &Course| {
        let (Some(hollow), Some(bend)) = (course.hollow, course.bend) else { return "no loss at the end".to_owned() };
        let elsewhere = course.lowest_at != line.values[line.reference];
        let lowest = if elsewhere { format!("; lowest at {}", number(course.lowest_at)) } else { String::new() };
        format!("{hollow:.3}; {bend:.1}{lowest}")
    };
    let row = |line: &Line| {
        std::iter::once(format!("{}, {}", line.material, line.name))
            .chain(line.of_metric.iter().map(|c| cell(line, c)))
            .collect()
    };
    Table { title, columns, rows: record.lines.iter().map(row).collect() }
}

fn pairs(record: &LandscapeRecord) -> Table {
    let columns = columns(&["pair"], record);
    let units = record.metrics.iter().map(|m| format!("{} in {}", m.name, unit(m))).collect::<Vec<_>>().join(", ");
    let row = |pair: &OddPair| std::iter::once(pair.name.clone()).chain(pair.answers.iter().map(answer)).collect();
    Table { title: format!("Distances: {units}"), columns, rows: record.pairs.iter().map(row).collect() }
}

/// A distance with three digits, or the reason why there is none.
pub(super) fn answer(answer: &Answer) -> String {
    match answer {
        Answer::Distance(distance) => format!("{distance:.3}"),
        Answer::Refused(reason) => format!("refused: {reason}"),
    }
}
