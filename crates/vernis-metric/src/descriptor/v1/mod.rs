//! Descriptors of version 1. Metrics that were trained on them name it, so that nothing here changes.
//!
//! They are taken from the BRDF at the nodes, and some have kinks: moduli, quantiles, crossings.

mod angular;
mod compact;
mod context;
mod display;
mod picture;

use super::features::Stored;
use super::frame::Frame;
use super::names::NORMS;
use super::set::Family;
use crate::light::NodeTable;
use crate::math::Rgb;
use angular::AngularProfile;
use context::Context;
use display::Displayed;
use picture::Picture;

/// What comparisons use of one BRDF.
#[derive(Debug, Clone)]
pub(super) struct Derived {
    pictures: Vec<Picture>,
    displayed: Vec<Displayed>,
    angular: AngularProfile,
    context: Context,
}

impl Derived {
    pub fn new(stored: &Stored, frame: &Frame) -> Self {
        let of_light = |picture: &Vec<Rgb>| (Picture::new(frame, picture), Displayed::new(frame, picture));
        let (pictures, displayed) = stored.pictures.iter().map(of_light).unzip();
        let angular = AngularProfile::new(&stored.table);
        let context = context::context(&stored.table, &angular, stored.albedo);
        Self { pictures, displayed, angular, context }
    }

    /// What kind of material it is, in the order of [`super::names::CONTEXT`].
    pub fn context(&self) -> Context {
        self.context
    }
}

/// The descriptors of `families` of a candidate against a reference, in order. Embeddings, and distances of value distributions,
/// have nothing to do with the version.
pub(super) fn compare(
    families: &[Family],
    (reference, a): (&NodeTable, &Derived),
    (candidate, b): (&NodeTable, &Derived),
    frame: &Frame,
) -> Vec<Vec<f64>> {
    let uses = |wanted: &[Family]| families.iter().any(|f| wanted.contains(f));
    let pictures = uses(&[Family::Lights, Family::Slot]).then(|| compact::pictures(a, b, frame));
    let ratios = uses(&[Family::Angular, Family::AngularFull])
        .then(|| angular::ratios((reference, &a.angular), (candidate, &b.angular)));
    let of_family = |family: &Family| match family {
        Family::Lights => pictures.iter().flat_map(|p| p.0).collect(),
        Family::Slot => pictures.iter().flat_map(|p| p.1).collect(),
        Family::Angular => ratios.iter().flat_map(compact::angular).collect(),
        Family::Context => a.context.to_vec(),
        Family::SlotDetail => compact::slot_detail(a, b, frame).to_vec(),
        Family::Display => compact::display(a, b, frame).to_vec(),
        Family::Change => b.context.iter().zip(a.context).map(|(b, a)| b - a).collect(),
        Family::AngularFull => {
            let all = |r: &angular::RegionRatios| [r.luminance, r.absolute_luminance, r.red_green, r.blue_green];
            ratios.iter().flatten().flat_map(all).collect()
        }
        Family::Wasserstein => Vec::new(),
        // No descriptor of this version is rounded off.
        Family::Norms => norms((reference, a), (candidate, b), frame),
    };
    families.iter().map(of_family).collect()
}

/// The values that [`NORMS`] names, from the families that have them.
fn norms(reference: (&NodeTable, &Derived), candidate: (&NodeTable, &Derived), frame: &Frame) -> Vec<f64> {
    let families = [Family::Lights, Family::Slot, Family::SlotDetail, Family::Display, Family::Angular];
    let values = compare(&families, reference, candidate, frame);
    let names = families.iter().flat_map(|f| f.descriptions()).map(|d| d.column.name);
    let found: Vec<(String, f64)> = names.zip(values.into_iter().flatten()).collect();
    NORMS.iter().filter_map(|name| found.iter().find(|f| f.0 == *name)).map(|f| f.1).collect()
}
