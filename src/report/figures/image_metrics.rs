//! The figure 13 of Lavoué et al. 2021: metrics on BRDFs and metrics on pictures side by side.

use super::benchmark::{BarRow, Bars, unseen};
use super::observed;
use crate::evaluation::records::{BenchmarkRecord, MetricKind};
use crate::report::image_metrics::of_record;
use vernis_image::stimulus::Cameras;

/// What the labels of the bars mean.
pub(super) const WORDS: &str = "on materials that neither they nor their logistic maps have seen. Pictures are rendered in the study's \
scene: by the same camera for both BRDFs (same camera), by the study's two cameras as people saw them (offset), and the same less the value \
of the hidden reference (offset - hidden)";

fn label(cameras: Cameras) -> &'static str {
    match cameras {
        Cameras::Same => "same camera",
        Cameras::Offset => "offset",
        Cameras::OffsetMinusHidden => "offset - hidden",
    }
}

/// The metrics on BRDFs of the headline, then those on pictures, a group a way to place the cameras; nothing where no picture was compared.
pub(super) fn bars(record: &BenchmarkRecord) -> Bars {
    let images = of_record(record);
    let mut rows: Vec<BarRow> = Vec::new();
    if !images.is_empty() {
        let of_brdfs = record.headline_metrics().into_iter().filter(|metric| metric.kind != MetricKind::Trivial);
        rows.extend(of_brdfs.filter_map(|metric| BarRow::of(metric.name.clone(), unseen(metric), false)));
    }
    for (place, cameras) in Cameras::ALL.into_iter().enumerate() {
        let mut group: Vec<BarRow> = images
            .iter()
            .filter_map(|(name, by)| BarRow::of(format!("{name} ({})", label(cameras)), unseen(by.get(&place)?), false))
            .collect();
        if let Some(first) = group.first_mut() {
            first.gap = true;
        }
        rows.extend(group);
    }
    Bars { title: observed("Metrics on BRDFs and on pictures, unseen materials", record.synthetic), rows, most: 1.0 }
}
