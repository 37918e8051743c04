//! Metrics on pictures in a benchmark: each by the three ways to place the cameras.

use super::tables::{NONE, Table, change, subject, with_interval};
use crate::evaluation::agreement::Figure;
use crate::evaluation::records::{BenchmarkRecord, MetricRecord, RowSet, Split};
use std::collections::BTreeMap;
use vernis_image::stimulus::{Cameras, plain};

/// Of one metric on pictures, the records by cameras.
pub(super) type ByCameras<'a> = BTreeMap<usize, &'a MetricRecord>;

/// How a heading calls the cameras.
pub(super) fn heading(cameras: Cameras) -> &'static str {
    match cameras {
        Cameras::Same => "same camera",
        Cameras::Offset => "the study's two cameras",
        Cameras::OffsetMinusHidden => "the same, less the hidden reference",
    }
}

/// The metrics on pictures of `record` that are judged under their plain names, the best Spearman correlation by one camera first.
pub(super) fn of_record(record: &BenchmarkRecord) -> Vec<(&str, ByCameras<'_>)> {
    let mut found: BTreeMap<&str, ByCameras<'_>> = BTreeMap::new();
    for metric in &record.metrics {
        if let Some((name, cameras)) = plain(&metric.name) {
            let place = Cameras::ALL.iter().position(|known| *known == cameras).unwrap_or(Cameras::ALL.len());
            found.entry(name).or_default().insert(place, metric);
        }
    }
    let srocc = |by: &ByCameras<'_>| {
        let first = by.values().next();
        first
            .and_then(|m| m.judgement(Split::UnseenMaterial, RowSet::All))
            .map_or(f64::NEG_INFINITY, |j| j.agreement.srocc)
    };
    let mut all: Vec<(&str, ByCameras<'_>)> = found.into_iter().collect();
    all.sort_by(|a, b| srocc(&b.1).total_cmp(&srocc(&a.1)).then_with(|| a.0.cmp(b.0)));
    all
}

/// PLCC and SROCC of each, a column a way to place the cameras, and how much the metric of the run agrees better than it.
pub fn table(record: &BenchmarkRecord) -> Table {
    let subject = subject(record);
    let ahead = format!("SROCC of {subject} minus its own, same camera");
    let mut columns = vec!["metric on pictures"];
    let headings: Vec<String> =
        Cameras::ALL.iter().flat_map(|c| ["PLCC", "SROCC"].map(|f| format!("{f}, {}", heading(*c)))).collect();
    columns.extend(headings.iter().map(String::as_str));
    columns.push(&ahead);
    let mut table = Table::new("Metrics on pictures, unseen material [95 % interval by material]", &columns);
    for (name, by_cameras) in of_record(record) {
        let mut row = vec![name.to_owned()];
        for place in 0..Cameras::ALL.len() {
            let judged = by_cameras.get(&place).and_then(|m| m.judgement(Split::UnseenMaterial, RowSet::All));
            row.extend([Figure::Plcc, Figure::Srocc].map(|figure| with_interval(judged, figure)));
        }
        let same = by_cameras.get(&0).map(|metric| metric.name.as_str());
        let difference = record.differences.iter().find(|d| {
            d.a == subject
                && Some(d.b.as_str()) == same
                && d.figure == Figure::Srocc
                && d.split == Split::UnseenMaterial
                && d.row_set == RowSet::All
        });
        row.push(difference.map_or(NONE.to_owned(), |d| change(Some(d.paired))));
        table.rows.push(row);
    }
    table
}

/// SROCC on each named set of rows, a column a set and a way to place the cameras; the metric of the run stands first. Without rows where
/// the study names no sets, or no picture was compared.
pub fn by_rows(record: &BenchmarkRecord) -> Table {
    let images = of_record(record);
    let sets: Vec<RowSet> = record.row_sets.iter().map(|set| RowSet::Named(set.name.clone())).collect();
    let mut columns = vec!["metric".to_owned()];
    for set in &sets {
        columns.extend(Cameras::ALL.map(|cameras| format!("{}, {}", record.rows_in_words(set), heading(cameras))));
    }
    let names: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut table =
        Table::new("SROCC by the rows that are judged, unseen material [95 % interval by material]", &names);
    if images.is_empty() || sets.is_empty() {
        return table;
    }
    let cell = |metric: Option<&MetricRecord>, set: &RowSet| {
        with_interval(metric.and_then(|m| m.judgement(Split::UnseenMaterial, set)), Figure::Srocc)
    };
    // A metric on BRDFs knows no camera: its number stands once a set.
    let own = record.metric(subject(record));
    let mut first = vec![subject(record).to_owned()];
    first.extend(sets.iter().flat_map(|set| [cell(own, set), NONE.to_owned(), NONE.to_owned()]));
    table.rows.push(first);
    for (name, by_cameras) in &images {
        let mut row = vec![(*name).to_owned()];
        for set in &sets {
            row.extend((0..Cameras::ALL.len()).map(|place| cell(by_cameras.get(&place).copied(), set)));
        }
        table.rows.push(row);
    }
    table
}
