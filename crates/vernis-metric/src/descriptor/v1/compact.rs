//! Compact 48: 18 descriptors of pictures under lamps, 6 under the slot, 14 angular, 10 of context.

use super::Derived;
use super::angular::RegionRatios;
use super::display::Displayed;
use super::picture::PictureDifference;
use crate::descriptor::frame::Frame;
use crate::descriptor::names::{ABSOLUTE_REGIONS, SIGNED_REGIONS};
use crate::descriptor::regions::{REGIONS, region};

/// All 18 picture descriptors in the order of [`crate::descriptor::names::LIGHTS`].
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
pub(super) fn pictures(reference: &Derived, candidate: &Derived, frame: &Frame) -> ([f64; 18], [f64; 6]) {
    let difference = |l: usize| PictureDifference::new(frame, &reference.pictures[l], &candidate.pictures[l]);
    let layouts = reference.pictures.len() - 1;
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
pub(super) fn slot_detail(reference: &Derived, candidate: &Derived, frame: &Frame) -> [f64; 8] {
    let slot = reference.pictures.len() - 1;
    let d = PictureDifference::new(frame, &reference.pictures[slot], &candidate.pictures[slot]);
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
pub(super) fn display(reference: &Derived, candidate: &Derived, frame: &Frame) -> [f64; 12] {
    let layouts = reference.pictures.len() - 1;
    let mut out = [0.0; 12];
    for l in 0..=layouts {
        let d = Displayed::difference(frame, &reference.displayed[l], &candidate.displayed[l]);
        let (to, share) = if l < layouts { (&mut out[..6], 1.0 / layouts as f64) } else { (&mut out[6..], 1.0) };
        to.iter_mut().zip(d).for_each(|(sum, v)| *sum += share * v);
    }
    out
}

/// The 14 angular descriptors.
pub(super) fn angular(ratios: &[RegionRatios; REGIONS]) -> [f64; 14] {
    let at = |name: &str| region(name).map_or(RegionRatios::default(), |r| ratios[r]);
    std::array::from_fn(|k| match k.checked_sub(SIGNED_REGIONS.len()) {
        None => at(SIGNED_REGIONS[k]).luminance,
        Some(k) => at(ABSOLUTE_REGIONS[k]).absolute_luminance,
    })
}
