//! Compact 48: 18 descriptors of pictures under lamps, 6 under the slot, 14 angular, 10 of context.

use super::angular::{self, RegionRatios};
use super::display::Displayed;
use super::features::BrdfFeatures;
use super::picture::PictureDifference;
use super::{Setup, context};

/// Number of descriptors.
pub const COLUMNS: usize = 48;

/// Names of the descriptors of pictures under lamps, without their family.
pub const LIGHTS: [&str; 18] = [
    "dE",
    "dE4",
    "adL",
    "dC",
    "sL",
    "mC",
    "sStd",
    "corr",
    "rms0",
    "q0-15",
    "q16-47",
    "q48-59",
    "q60-63",
    "struct0",
    "contrast0",
    "localstd0",
    "localstd2",
    "localmean3",
];
/// Names of the descriptors of pictures under the slot.
pub const SLOT: [&str; 6] = ["dE4", "dC", "sL", "rms0", "q48-59", "contrast0"];
/// Names of the further descriptors of pictures under the slot.
pub const SLOT_DETAIL: [&str; 8] = ["dE", "adL", "sStd", "corr", "q0-15", "q16-47", "q60-63", "w1"];
/// Regions whose mean log luminance ratio is used.
pub const SIGNED_REGIONS: [&str; 10] = ["1n", "3n", "5n", "7n", "2m", "6m", "2h", "5h", "3g", "7g"];
/// Regions whose mean absolute log luminance ratio is used.
pub const ABSOLUTE_REGIONS: [&str; 4] = ["2n", "5m", "7n", "3h"];

/// All 18 picture descriptors in the order of [`LIGHTS`].
fn picture_values(d: &PictureDifference) -> [f64; 18] {
    [
        d.mean,
        d.fourth_power_mean,
        d.absolute_lightness,
        d.chroma,
        d.signed_lightness,
        d.chroma_shift,
        d.deviation,
        d.decorrelation,
        d.centred_rms,
        d.quantiles[0],
        d.quantiles[1],
        d.quantiles[2],
        d.quantiles[3],
        d.structure,
        d.contrast,
        d.local_deviation[0],
        d.local_deviation[1],
        d.local_mean,
    ]
}

/// Descriptors under the lamps, averaged over their layouts, then those under the slot.
pub(super) fn pictures(reference: &BrdfFeatures, candidate: &BrdfFeatures, setup: &Setup) -> ([f64; 18], [f64; 6]) {
    let difference = |l: usize| PictureDifference::new(setup.frame(), &reference.pictures[l], &candidate.pictures[l]);
    let layouts = setup.lights() - 1;
    let mut lamps = [0.0; 18];
    for l in 0..layouts {
        lamps.iter_mut().zip(picture_values(&difference(l))).for_each(|(sum, v)| *sum += v);
    }
    let slot = difference(layouts);
    (
        lamps.map(|v| v / layouts as f64),
        [
            slot.fourth_power_mean,
            slot.chroma,
            slot.signed_lightness,
            slot.centred_rms,
            slot.quantiles[2],
            slot.contrast,
        ],
    )
}

/// What the pictures under the slot say beyond the six descriptors of compact 48.
pub(super) fn slot_detail(reference: &BrdfFeatures, candidate: &BrdfFeatures, setup: &Setup) -> [f64; 8] {
    let slot = setup.lights() - 1;
    let d = PictureDifference::new(setup.frame(), &reference.pictures[slot], &candidate.pictures[slot]);
    [
        d.mean,
        d.absolute_lightness,
        d.deviation,
        d.decorrelation,
        d.quantiles[0],
        d.quantiles[1],
        d.quantiles[3],
        d.quantile_distance,
    ]
}

/// The pictures as a screen shows them: under the lamps, averaged over their layouts, then under the slot.
pub(super) fn display(reference: &BrdfFeatures, candidate: &BrdfFeatures, setup: &Setup) -> [f64; 12] {
    let layouts = setup.lights() - 1;
    let mut out = [0.0; 12];
    for l in 0..setup.lights() {
        let d = Displayed::difference(setup.frame(), &reference.displayed[l], &candidate.displayed[l]);
        let (to, share) = if l < layouts { (&mut out[..6], 1.0 / layouts as f64) } else { (&mut out[6..], 1.0) };
        to.iter_mut().zip(d).for_each(|(sum, v)| *sum += share * v);
    }
    out
}

/// The 14 angular descriptors.
pub(super) fn angular(ratios: &[RegionRatios; angular::REGIONS]) -> [f64; 14] {
    let at = |name: &str| angular::region(name).map_or(RegionRatios::default(), |r| ratios[r]);
    std::array::from_fn(|k| match k.checked_sub(SIGNED_REGIONS.len()) {
        None => at(SIGNED_REGIONS[k]).luminance,
        Some(k) => at(ABSOLUTE_REGIONS[k]).absolute_luminance,
    })
}

/// Compact 48 of `candidate` against `reference`, in the order of the names: lights, slot, angular, context.
pub fn compare(reference: &BrdfFeatures, candidate: &BrdfFeatures, setup: &Setup) -> [f64; COLUMNS] {
    let (lamps, slot) = pictures(reference, candidate, setup);
    let ratios = angular::ratios(reference.angular_parts(), candidate.angular_parts());
    let mut out = [0.0; COLUMNS];
    out[..18].copy_from_slice(&lamps);
    out[18..24].copy_from_slice(&slot);
    out[24..38].copy_from_slice(&angular(&ratios));
    out[38..].copy_from_slice(&reference.context);
    out
}

/// Names of the 48 columns in order, with their families.
pub fn names() -> Vec<String> {
    let join = |family: &'static str| move |name: &&str| format!("{family}.{name}");
    let signed = SIGNED_REGIONS.iter().map(|r| format!("angular.sY.{r}"));
    let absolute = ABSOLUTE_REGIONS.iter().map(|r| format!("angular.aY.{r}"));
    let pictures = LIGHTS.iter().map(join("lights")).chain(SLOT.iter().map(join("slot")));
    pictures.chain(signed).chain(absolute).chain(context::NAMES.iter().map(join("context"))).collect()
}
