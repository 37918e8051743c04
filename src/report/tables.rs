//! Tables of a benchmark, and their three forms: aligned text, Markdown, HTML.

use super::markdown;
use crate::evaluation::agreement::Figure;
use crate::evaluation::bootstrap::{Difference, Interval};
use crate::evaluation::records::{BenchmarkRecord, Judgement, MetricRecord, RowSet, Split};
use maud::{Markup, html};
use vernis_metric::io::counted;

/// A table of words; the first column is a label, the others are numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// What the rows are, and over what.
    pub title: String,
    /// Headings of the columns.
    pub columns: Vec<String>,
    /// The cells of each row.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub(super) fn new(title: impl Into<String>, columns: &[&str]) -> Self {
        Self { title: title.into(), columns: columns.iter().map(|c| (*c).to_owned()).collect(), rows: Vec::new() }
    }

    /// Columns padded to their widest cell, for a terminal.
    pub fn to_text(&self) -> String {
        let lines = || std::iter::once(&self.columns).chain(&self.rows);
        let widths: Vec<usize> = (0..self.columns.len())
            .map(|c| lines().filter_map(|line| line.get(c)).map(|cell| cell.chars().count()).max().unwrap_or(0))
            .collect();
        let mut text = format!("{}\n", self.title);
        for line in lines() {
            let cells =
                line.iter().zip(&widths).enumerate().map(|(c, (cell, &width))| {
                    if c == 0 { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
                });
            text.push_str(cells.collect::<Vec<_>>().join("  ").trim_end());
            text.push('\n');
        }
        text
    }

    /// The title and a Markdown table.
    pub fn to_markdown(&self) -> String {
        let line = |cells: &[String]| {
            let cells: Vec<String> = cells.iter().map(|c| markdown::text(c)).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let rule = vec![":---".to_owned(); 1].into_iter().chain(self.columns.iter().skip(1).map(|_| "---:".to_owned()));
        let rule = format!("| {} |\n", rule.collect::<Vec<_>>().join(" | "));
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        format!("**{}**\n\n{}{rule}{rows}", markdown::text(&self.title), line(&self.columns))
    }

    /// An HTML table with the title as its caption.
    pub fn to_html(&self) -> Markup {
        html! {
            div.table role="region" aria-label=(self.title) tabindex="0" {
                table {
                    caption { (self.title) }
                    thead { tr { @for column in &self.columns { th scope="col" { (column) } } } }
                    tbody {
                        @for row in &self.rows {
                            tr {
                                @for (c, cell) in row.iter().enumerate() {
                                    @if c == 0 { th scope="row" { (cell) } } @else { td { (cell) } }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

pub(super) const NONE: &str = "-";

/// Agreement of the metrics of the headline, as the last lines of a run show it: on all rows, then, where the study declares sets of
/// rows, on each of them.
pub fn headlines(record: &BenchmarkRecord) -> Vec<Table> {
    let title = format!(
        "Agreement with {} ratings, unseen material{} [95 % interval by material]",
        if record.synthetic { "SYNTHETIC" } else { "human" },
        on_all_rows(record)
    );
    let mut tables = vec![metrics_table(record, &record.headline_metrics(), title)];
    if !record.row_sets.is_empty() {
        let splits = [Split::UnseenMaterial, Split::UnseenMaterialAndMethod].map(|split| by_rows(record, split));
        tables.extend(splits.into_iter().filter(|table| !table.rows.is_empty()));
    }
    tables
}

/// Agreement of the metrics of the headline under one split, a column a set of rows.
fn by_rows(record: &BenchmarkRecord, split: Split) -> Table {
    let sets = record.named_row_sets();
    let metrics = record.headline_metrics();
    let heading = |set: &RowSet| {
        let rows = metrics.iter().find_map(|metric| metric.judgement(split, set)).map(|judgement| judgement.rows);
        rows.map_or_else(|| record.rows_in_words(set), |rows| format!("{} ({rows})", record.rows_in_words(set)))
    };
    let headings: Vec<String> = sets.iter().map(heading).collect();
    let columns: Vec<&str> = ["metric"].into_iter().chain(headings.iter().map(String::as_str)).collect();
    let title = format!("PLCC / SROCC by the rows that are judged, {} [95 % interval by material]", split.label());
    let mut table = Table::new(title, &columns);
    let judged = metrics.iter().filter(|metric| metric.judgement(split, RowSet::All).is_some());
    table.rows = judged
        .map(|metric| {
            let cells = sets.iter().map(|set| {
                let found = metric.judgement(split, set);
                let both = [Figure::Plcc, Figure::Srocc].map(|figure| with_interval(found, figure));
                if found.is_some() { both.join(" / ") } else { NONE.to_owned() }
            });
            std::iter::once(metric.name.clone()).chain(cells).collect()
        })
        .collect();
    table
}

/// For the titles of tables on all rows, where there are sets of rows to tell them from.
fn on_all_rows(record: &BenchmarkRecord) -> String {
    if record.row_sets.is_empty() { String::new() } else { format!(", all {} rows", record.rows) }
}

/// Agreement of every metric.
pub fn all_metrics(record: &BenchmarkRecord) -> Table {
    let title = format!("All metrics{}", on_all_rows(record));
    metrics_table(record, &record.metrics.iter().collect::<Vec<_>>(), title)
}

fn metrics_table(record: &BenchmarkRecord, metrics: &[&MetricRecord], title: String) -> Table {
    let aside = format!("without {}", record.set_aside.join(", "));
    let mut columns = vec!["metric", "PLCC", "SROCC", "mean of folds", "KROCC", "RMSE", "within material", "raw PLCC"];
    let with_aside = !record.set_aside.is_empty();
    if with_aside {
        columns.push(&aside);
    }
    columns.extend(["unseen method", "unseen type", "in sample"]);
    let mut table = Table::new(title, &columns);
    for metric in metrics {
        let at = |split, row_set| metric.judgement(split, row_set);
        let main = at(Split::UnseenMaterial, RowSet::All);
        let mut row = vec![
            metric.name.clone(),
            with_interval(main, Figure::Plcc),
            with_interval(main, Figure::Srocc),
            fold_means(main),
            value(main, Figure::Krocc),
            value(main, Figure::Rmse),
            value(main, Figure::WithinMaterialSrocc),
            value(main, Figure::PlccRaw),
        ];
        if with_aside {
            row.push(pair(at(Split::UnseenMaterial, RowSet::WithoutSetAside)));
        }
        row.push(pair(at(Split::UnseenMaterialAndMethod, RowSet::All)));
        row.push(pair(at(Split::UnseenMaterialType, RowSet::All)));
        row.push(pair(at(Split::InSample, RowSet::All)));
        table.rows.push(row);
    }
    table
}

/// Paired differences by split and rows; on a named set of rows for unseen materials and methods alone, for the others are in the
/// numbers of the report.
pub fn differences(record: &BenchmarkRecord) -> Table {
    let mut table = Table::new(
        "Paired differences on the same resamples of materials, p corrected by Holm",
        &["a - b", "figure", "rows", "difference", "95 % interval", "p", "Zou interval"],
    );
    for found in &record.differences {
        let shown = matches!(found.split, Split::UnseenMaterial | Split::UnseenMaterialAndMethod);
        let rows = match &found.row_set {
            RowSet::Named(_) if !shown => continue,
            RowSet::All if record.row_sets.is_empty() => found.split.label().to_owned(),
            set => format!("{}, {}", found.split.label(), record.rows_in_words(set)),
        };
        table.rows.push(vec![
            format!("{} - {}", found.a, found.b),
            found.figure.label().to_owned(),
            rows,
            signed(found.paired.difference),
            interval(found.paired.interval, signed),
            probability(found.holm_p),
            found.cross_check.map_or(NONE.to_owned(), |check| interval(check.zou, signed)),
        ]);
    }
    table
}

/// The model of the ablation, retrained on other sets of descriptors.
pub fn ablation(record: &BenchmarkRecord) -> Table {
    let mut table = Table::new(
        format!(
            "Ablation: {0} retrained with other descriptors, unseen material{1} (change against {0} with all of its own)",
            record.retrained,
            on_all_rows(record)
        ),
        &["descriptors", "number", "PLCC", "change", "SROCC", "change", "within material", "unseen method"],
    );
    let named = || record.row_sets.iter().map(|set| RowSet::Named(set.name.clone()));
    table.columns.extend(named().map(|set| format!("unseen method, {}", record.rows_in_words(&set))));
    for found in &record.ablation {
        let main = found.judgement(Split::UnseenMaterial, RowSet::All);
        let unseen_method = |set| pair(found.judgement(Split::UnseenMaterialAndMethod, set));
        let mut row = vec![
            found.name.clone(),
            found.columns.to_string(),
            value(main, Figure::Plcc),
            change(found.plcc_change),
            value(main, Figure::Srocc),
            change(found.srocc_change),
            value(main, Figure::WithinMaterialSrocc),
            unseen_method(RowSet::All),
        ];
        row.extend(named().map(unseen_method));
        table.rows.push(row);
    }
    table
}

/// What exchanging descriptors between rows costs.
pub fn importance(record: &BenchmarkRecord) -> Table {
    let mut table = Table::new(
        format!(
            "Permutation importance: change of {} when descriptors are exchanged between unseen rows, families first{}",
            record.retrained,
            on_all_rows(record)
        ),
        &["descriptors", "number", "PLCC", "SROCC"],
    );
    for found in &record.importance {
        let numbers = [found.columns.to_string(), change(found.plcc_change), change(found.srocc_change)];
        table.rows.push([found.name.clone()].into_iter().chain(numbers).collect());
    }
    table
}

/// Agreement by the number of materials that were trained on.
pub fn learning_curve(record: &BenchmarkRecord) -> Table {
    let mut table = Table::new(
        format!(
            "Learning curve: agreement of {} on unseen materials by the groups of materials trained on{}",
            record.retrained,
            on_all_rows(record)
        ),
        &["groups", "PLCC", "SROCC"],
    );
    let named = || record.row_sets.iter().map(|set| RowSet::Named(set.name.clone()));
    table.columns.extend(named().map(|set| record.rows_in_words(&set)));
    for point in &record.learning_curve {
        let main = point.judgement(Split::UnseenMaterial, RowSet::All);
        let numbers = [Figure::Plcc, Figure::Srocc].map(|figure| with_interval(main, figure));
        let sets = named().map(|set| pair(point.judgement(Split::UnseenMaterial, set)));
        table.rows.push([format!("{:.1}", point.groups)].into_iter().chain(numbers).chain(sets).collect());
    }
    table
}

/// The `most` materials with the largest errors.
pub fn residuals(record: &BenchmarkRecord, most: usize) -> Table {
    let on = if record.scale.is_grades() { String::new() } else { format!(" ({})", record.scale) };
    let digits = record.scale.decimals();
    let mut table = Table::new(
        format!("Materials with the largest errors of {}, predicted minus rated, in MOS{on}", subject(record)),
        &["material", "rows", "root mean square", "mean", "worst method", "its error"],
    );
    for found in record.residuals.iter().take(most) {
        table.rows.push(vec![
            found.material.clone(),
            found.rows.to_string(),
            format!("{:.digits$}", found.rms),
            format!("{:+.digits$}", found.bias),
            found.worst_method.clone(),
            format!("{:+.digits$}", found.worst_error),
        ]);
    }
    table
}

/// Errors by method: of predictions that had not seen the material, and of those that had not seen the method either.
pub fn method_residuals(record: &BenchmarkRecord) -> Table {
    let on = if record.scale.is_grades() { String::new() } else { format!(" ({})", record.scale) };
    let digits = record.scale.decimals();
    let mut table = Table::new(
        format!(
            "Errors of {} by method, predicted minus rated, in MOS{on} [95 % interval by material]",
            subject(record)
        ),
        &["method", "not seen", "rows", "mean", "root mean square"],
    );
    for found in &record.method_residuals {
        let range = found.interval.map_or(String::new(), |i| format!(" [{:+.digits$}, {:+.digits$}]", i.low, i.high));
        table.rows.push(vec![
            found.method.clone(),
            found.split.label().to_owned(),
            found.rows.to_string(),
            format!("{:+.digits$}{range}", found.bias),
            format!("{:.digits$}", found.rms),
        ]);
    }
    table
}

/// Agreement with triplets whose reference was not seen.
pub fn triplets(record: &BenchmarkRecord) -> Table {
    let judged = record.triplets.first().map_or(String::new(), |found| {
        format!(" ({} of {})", counted(found.triplets, "triplet"), counted(found.groups, "group of references"))
    });
    let mut table = Table::new(
        format!(
            "Share of majorities that a metric chooses{judged}: which of two materials looks more like a reference it has not seen"
        ),
        &["metric", "share [95 % interval by reference]"],
    );
    for found in &record.triplets {
        let range = found.interval.map_or(String::new(), |i| format!(" [{:.3}, {:.3}]", i.low, i.high));
        table.rows.push(vec![found.metric.clone(), format!("{:.3}{range}", found.majority)]);
    }
    table
}

/// What a run has to say where its metric, on unseen materials, agrees less well than one that was not learned: a sentence for its
/// last lines. `None` where nothing is better by either correlation.
pub fn defeat(record: &BenchmarkRecord) -> Option<String> {
    let unseen = |metric: &MetricRecord| {
        let judgement = metric.judgement(Split::UnseenMaterial, RowSet::All)?;
        Some([judgement.agreement.plcc, judgement.agreement.srocc])
    };
    let subject = record.headline_metrics().into_iter().next()?;
    let own = unseen(subject)?;
    let others: Vec<(&MetricRecord, [f64; 2])> = record
        .metrics
        .iter()
        .filter(|metric| !metric.kind.is_learned())
        .filter_map(|metric| Some((metric, unseen(metric)?)))
        .collect();
    let better: Vec<&(&MetricRecord, [f64; 2])> =
        others.iter().filter(|(_, theirs)| theirs[0] > own[0] || theirs[1] > own[1]).collect();
    let lead = |theirs: &[f64; 2]| theirs[0] - own[0] + (theirs[1] - own[1]);
    let (best, theirs) = better.iter().max_by(|a, b| lead(&a.1).total_cmp(&lead(&b.1)))?;
    Some(format!(
        "The learned metric {} loses under cross-validation to {} of {} that were not learned, above all to {}: PLCC {} against {}, \
         SROCC {} against {}, unseen material.",
        subject.name,
        better.len(),
        counted(others.len(), "metric"),
        best.name,
        plain(own[0]),
        plain(theirs[0]),
        plain(own[1]),
        plain(theirs[1]),
    ))
}

/// The metric that the run is about.
pub(super) fn subject(record: &BenchmarkRecord) -> &str {
    record.headline.first().map_or("the metric", String::as_str)
}

fn plain(x: f64) -> String {
    format!("{x:.3}")
}

fn signed(x: f64) -> String {
    format!("{x:+.3}")
}

fn interval(interval: Interval, number: fn(f64) -> String) -> String {
    format!("[{}, {}]", number(interval.low), number(interval.high))
}

fn probability(p: f64) -> String {
    if p < 0.001 { "<0.001".to_owned() } else { plain(p) }
}

pub(super) fn change(difference: Option<Difference>) -> String {
    difference.map_or(NONE.to_owned(), |d| format!("{} {}", signed(d.difference), interval(d.interval, signed)))
}

fn value(judgement: Option<&Judgement>, figure: Figure) -> String {
    judgement.and_then(|j| j.agreement.get(figure)).map_or(NONE.to_owned(), plain)
}

pub(super) fn with_interval(judgement: Option<&Judgement>, figure: Figure) -> String {
    let found = judgement.and_then(|j| Some((j.agreement.get(figure)?, j.intervals.get(figure)?)));
    found.map_or(NONE.to_owned(), |(value, range)| format!("{} {}", plain(value), interval(range, plain)))
}

/// PLCC and SROCC, each the mean of the folds' own.
fn fold_means(judgement: Option<&Judgement>) -> String {
    let found = judgement.and_then(|j| j.fold_means);
    found.map_or(NONE.to_owned(), |means| format!("{} / {}", plain(means.plcc), plain(means.srocc)))
}

/// PLCC and SROCC.
fn pair(judgement: Option<&Judgement>) -> String {
    judgement.map_or(NONE.to_owned(), |j| format!("{} / {}", plain(j.agreement.plcc), plain(j.agreement.srocc)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new("Title", &["name", "x"]);
        table.rows = vec![vec!["a|<b>".into(), "1".into()], vec!["long name".into(), "22".into()]];
        table
    }

    #[test]
    fn text_is_aligned() {
        assert_eq!(table().to_text(), "Title\nname        x\na|<b>       1\nlong name  22\n");
    }

    #[test]
    fn markdown_and_html_escape_what_they_must() {
        assert_eq!(
            table().to_markdown(),
            "**Title**\n\n| name | x |\n| :--- | ---: |\n| a\\|&lt;b> | 1 |\n| long name | 22 |\n"
        );
        assert!(table().to_html().into_string().contains("<th scope=\"row\">a|&lt;b&gt;</th><td>1</td>"));
    }
}
