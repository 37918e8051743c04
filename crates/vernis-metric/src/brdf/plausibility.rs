//! Whether values can be those of a material: how much light leaves, and whether a value is larger than a lobe can be.
//!
//!   albedo(theta) = ∫ f(wi, wo) cos theta_o dwo = ∫ f(wi, wo) cos theta_o 4 (wi·h) dwh,   wi at theta from the normal
//!
//! dimensionless, between 0 and 1 for a passive surface. The integral runs over half vectors h with rows of theta_h that are
//! dense around the normal (theta_h = x^2 90 deg, x in equal steps), so that narrow highlights are met: within 1 % for GGX down
//! to the smallest roughness that the models allow. What is not measured counts as 0 and is said to be missing, so that the
//! albedo of measured data is at least the number given.
//!
//! An albedo above 1.05 in any channel is implausible. Where colours may lie outside the gamut ([`Brdf::is_signed`]) a channel can
//! exceed 1 though no wavelength does, and the luminance is looked at instead.
//!
//! A table that lacks its scale, or has it twice, is off by a factor of about 1,500 in MERL's case, and nothing else in it looks
//! wrong. A value beyond what a lobe of albedo 1 has that is as narrow as the table's cells is a fault of the data:
//!
//!   f <= 10 / (omega min(cos theta_i, cos theta_o))
//!
//! omega: the smallest solid angle around wo that the grid tells apart, 4 (wi·h) 2 pi (1 - cos theta_1) with theta_1 the first step
//! of theta_h, or the square of a step of theta_o; 10: how much higher than its mean over such a cell the peak of a lobe may be.
//!
//! Cost: 49,152 evaluations, and one look at each cell of a table.

use super::{Brdf, Grid, TabulatedBrdf};
use crate::io::decimals;
use crate::math::color::luminance;
use crate::math::parallel;
use crate::math::{Rgb, Vec3};
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt;

/// Where the light stands, degrees from the normal.
pub const ANGLES: [f64; 3] = [0.0, 30.0, 60.0];
/// An albedo above this is implausible: 1 and what noise and interpolation add.
pub const BRIGHT: f64 = 1.05;
/// So is one below this in all channels, at all angles.
pub const DARK: f64 = 0.001;
/// A smaller share of the hemisphere says nothing about darkness.
const ENOUGH: f64 = 0.5;
/// The peak of a lobe and its mean over a cell.
const PEAK: f64 = 10.0;

const ROWS: usize = 256;
const AZIMUTHS: usize = 64;

/// How much of the light from one direction leaves again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Albedo {
    /// Where the light stands, degrees from the normal.
    pub theta_deg: f64,
    /// Of each channel; 1 sends everything back.
    pub rgb: Rgb,
    /// The share of the hemisphere, weighted with the cosine, that is measured; the rest counts as 0.
    pub measured: f64,
}

impl Albedo {
    /// For light from `theta_deg` degrees.
    pub fn of(brdf: &dyn Brdf, theta_deg: f64) -> Self {
        let theta = theta_deg.to_radians();
        let wi = Vec3::from_spherical(theta, 0.0);
        let rows = parallel::map(ROWS, |row| of_row(brdf, wi, row));
        let mut sums = [0.0; 5];
        rows.iter().for_each(|row| sums.iter_mut().zip(row).for_each(|(sum, part)| *sum += part));
        let [r, g, b, measured, all] = sums;
        Self { theta_deg, rgb: [r, g, b], measured: measured / all }
    }
}

impl fmt::Display for Albedo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.measured == 0.0 {
            return f.write_str("not measured");
        }
        f.write_str(&self.rgb.map(|v| decimals(v, 4)).join(" "))?;
        if self.measured < 0.995 { write!(f, " ({:.0} % not measured)", 100.0 * (1.0 - self.measured)) } else { Ok(()) }
    }
}

/// R, G and B of the integral over one row of half vectors, the weights of its measured directions and of all.
fn of_row(brdf: &dyn Brdf, wi: Vec3, row: usize) -> [f64; 5] {
    let x = (row as f64 + 0.5) / ROWS as f64;
    let theta_h = x * x * FRAC_PI_2;
    // d theta_h = pi x dx
    let solid = theta_h.sin() * PI * x / ROWS as f64 * 2.0 * PI / AZIMUTHS as f64;
    let (mut directions, mut weights) = (Vec::with_capacity(AZIMUTHS), Vec::with_capacity(AZIMUTHS));
    for k in 0..AZIMUTHS {
        let h = Vec3::from_spherical(theta_h, (k as f64 + 0.5) / AZIMUTHS as f64 * 2.0 * PI);
        let cos_d = wi.dot(h);
        let wo = h * (2.0 * cos_d) - wi;
        if cos_d > 0.0 && wo.z > 0.0 {
            directions.push(wo);
            weights.push(wo.z * 4.0 * cos_d * solid);
        }
    }
    let mut values = vec![None; directions.len()];
    brdf.eval_batch(&vec![wi; directions.len()], &directions, &mut values);
    let mut sums = [0.0; 5];
    for (value, weight) in values.into_iter().zip(weights) {
        sums[4] += weight;
        if let Some(value) = value {
            sums[3] += weight;
            (0..3).for_each(|c| sums[c] += weight * value[c]);
        }
    }
    sums
}

/// What cannot be of a material.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Implausible {
    /// More light leaves than arrives, or an albedo that is no number.
    Bright(Vec<Albedo>),
    /// Next to nothing leaves.
    Dark(Vec<Albedo>),
    /// Values that no lobe has.
    Values {
        /// How many cells have such values.
        cells: usize,
        /// The directions of the one that is furthest beyond.
        at: (Vec3, Vec3),
        /// Its largest component, 1/sr.
        value: f64,
        /// What a lobe has there at most.
        allowed: f64,
    },
}

impl fmt::Display for Implausible {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bright(all) => write!(
                f,
                "the albedo is above {BRIGHT}, more light leaves than arrives ({}): are scale and units right (1/sr without \
                 the cosine; MERL's stored numbers times 1/1500, 1.15/1500, 1.66/1500)?",
                listed(all)
            ),
            Self::Dark(all) => write!(
                f,
                "the albedo is below {DARK} in all channels ({}): black, or values without their scale (MERL's stored numbers \
                 are about 1,500 times a BRDF)?",
                listed(all)
            ),
            Self::Values { cells, at: (wi, wo), value, allowed } => {
                let degrees = |w: &Vec3| (w.x * w.x + w.y * w.y).sqrt().atan2(w.z).to_degrees();
                write!(
                    f,
                    "{cells} {} a value that no lobe has which is as narrow as the cells: {:e} 1/sr at theta_i {:.1}, theta_o \
                     {:.1} deg, where at most {:.1e} is plausible",
                    if *cells == 1 { "cell has" } else { "cells have" },
                    // Tables hold f32.
                    *value as f32,
                    degrees(wi),
                    degrees(wo),
                    allowed
                )
            }
        }
    }
}

fn listed(all: &[Albedo]) -> String {
    let each: Vec<String> = all.iter().map(|a| format!("{a} at {} deg", a.theta_deg)).collect();
    each.join(", ")
}

/// The albedo at [`ANGLES`], and what is implausible.
#[derive(Debug, Clone, PartialEq)]
pub struct Plausibility {
    /// For light from each of [`ANGLES`].
    pub albedo: [Albedo; 3],
    /// What to warn of; empty where nothing is wrong.
    pub warnings: Vec<Implausible>,
}

/// Of the numbers that are kept ([`Plausibility::to_numbers`]); raised when one changes by more than rounding, or gets another meaning.
pub const VERSION: u32 = 1;

/// Numbers that are kept of an albedo.
const OF_ALBEDO: usize = 4;

impl Plausibility {
    /// Looks at `brdf`.
    pub fn of(brdf: &dyn Brdf) -> Self {
        let albedo = ANGLES.map(|theta| Albedo::of(brdf, theta));
        Self::from_parts(albedo, brdf.is_signed(), brdf.as_table().and_then(values_beyond))
    }

    /// Numbers for a cache, from which [`Plausibility::from_numbers`] makes the same again.
    pub fn to_numbers(&self, is_signed: bool) -> Vec<f64> {
        let of_albedo = |a: &Albedo| [a.rgb[0], a.rgb[1], a.rgb[2], a.measured];
        let mut numbers: Vec<f64> = self.albedo.iter().flat_map(of_albedo).collect();
        numbers.push(f64::from(u8::from(is_signed)));
        for warning in &self.warnings {
            if let Implausible::Values { cells, at: (wi, wo), value, allowed } = warning {
                numbers.extend([*cells as f64, wi.x, wi.y, wi.z, wo.x, wo.y, wo.z, *value, *allowed]);
            }
        }
        numbers
    }

    /// `None` for numbers that are no plausibility.
    pub fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let (of_albedo, rest) = numbers.split_at_checked(OF_ALBEDO * ANGLES.len())?;
        let (is_signed, rest) = rest.split_first()?;
        let albedo = |k: usize| {
            let kept = &of_albedo[OF_ALBEDO * k..];
            Albedo { theta_deg: ANGLES[k], rgb: [kept[0], kept[1], kept[2]], measured: kept[3] }
        };
        let values = match *rest {
            [] => None,
            [cells, a, b, c, d, e, f, value, allowed] => {
                let at = (Vec3::new(a, b, c), Vec3::new(d, e, f));
                Some(Implausible::Values { cells: cells as usize, at, value, allowed })
            }
            _ => return None,
        };
        Some(Self::from_parts([albedo(0), albedo(1), albedo(2)], *is_signed == 1.0, values))
    }

    fn from_parts(albedo: [Albedo; 3], is_signed: bool, values: Option<Implausible>) -> Self {
        let mut warnings = Vec::new();
        let known = || albedo.iter().filter(|a| a.measured > ENOUGH);
        // What is no number is not below either.
        let possible = |a: &Albedo| match is_signed {
            true => luminance(a.rgb) <= BRIGHT,
            false => a.rgb.iter().all(|v| *v <= BRIGHT),
        };
        if !albedo.iter().all(possible) {
            warnings.push(Implausible::Bright(albedo.to_vec()));
        } else if known().count() > 0 && known().all(|a| a.rgb.iter().all(|v| *v < DARK)) {
            warnings.push(Implausible::Dark(albedo.to_vec()));
        }
        warnings.extend(values);
        Self { albedo, warnings }
    }
}

/// The values of a table that no lobe has.
fn values_beyond(table: &TabulatedBrdf) -> Option<Implausible> {
    let grid = table.grid();
    let directions = grid.all_directions();
    let step = |axis| grid.edge(axis, 1.0);
    // The solid angle around wo for wi = wo, and the smallest cosine that the grid tells from 0.
    let (omega, steepest) = match grid {
        Grid::HalfDifference { .. } => (8.0 * PI * (1.0 - step(0).cos()), (FRAC_PI_2 - step(1)).cos()),
        Grid::Standard { .. } => (step(1) * step(1), (FRAC_PI_2 - step(1)).cos()),
    };
    let allowed = |(wi, wo): (Vec3, Vec3)| {
        let narrow = if matches!(grid, Grid::HalfDifference { .. }) { 0.5 * (wi + wo).length() } else { 1.0 };
        PEAK / (omega * narrow.max(steepest) * wi.z.min(wo.z).max(steepest))
    };
    let mut worst: Option<(f64, Implausible)> = None;
    let mut cells = 0;
    for (index, (value, _)) in table.values().iter().zip(table.valid()).enumerate().filter(|(_, (_, valid))| **valid) {
        let value = f64::from(value.iter().copied().fold(0.0, f32::max));
        // No direction allows less.
        if value <= PEAK / omega {
            continue;
        }
        let at = directions.get(index);
        let allowed = allowed(at);
        if value > allowed {
            cells += 1;
            if worst.as_ref().is_none_or(|(excess, _)| value / allowed > *excess) {
                worst = Some((value / allowed, Implausible::Values { cells: 0, at, value, allowed }));
            }
        }
    }
    worst.map(|(_, worst)| match worst {
        Implausible::Values { at, value, allowed, .. } => Implausible::Values { cells, at, value, allowed },
        other => other,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::{Ggx, Lambert, build};

    #[test]
    fn the_albedo_of_a_lambertian_surface_is_its_own() {
        for theta in [0.0, 30.0, 60.0, 85.0] {
            let Albedo { rgb, measured, .. } = Albedo::of(&Lambert { kd: [0.5, 0.1, 1.0] }, theta);
            for (found, expected) in rgb.iter().zip([0.5, 0.1, 1.0]) {
                assert!((found / expected - 1.0).abs() < 1e-3, "{theta}: {found}");
            }
            assert_eq!(measured, 1.0);
        }
    }

    /// With F = 1 and a narrow lobe nearly nothing is masked: all of the light leaves.
    #[test]
    fn narrow_lobes_are_met() {
        for alpha in [0.001, 0.003, 0.01] {
            for theta in ANGLES {
                let mirror = Ggx { kd: [0.0; 3], f0: [1.0, 0.5, 0.04], alpha };
                let [one, half, _] = Albedo::of(&mirror, theta).rgb;
                assert!((one - 1.0).abs() < 0.015, "{alpha}, {theta}: {one}");
                assert!(half < one && half >= 0.5 * 0.985, "{alpha}, {theta}: {half}");
            }
        }
    }

    fn table(grid: Grid, scale: f32) -> TabulatedBrdf {
        let model = Ggx { kd: [0.2, 0.1, 0.05], f0: [0.04; 3], alpha: 0.15 };
        let table = TabulatedBrdf::tabulate(&model, grid).expect("finite model");
        let values = table.values().iter().map(|v| v.map(|x| x * scale)).collect();
        TabulatedBrdf::new(grid, values, table.valid().to_vec()).expect("finite")
    }

    #[test]
    fn tables_of_a_wrong_scale_are_noticed_and_right_ones_are_not() {
        for grid in [Grid::MERL, Grid::MERL_FULL, Grid::TITOPO, Grid::TITOPO_HALF] {
            assert_eq!(Plausibility::of(&table(grid, 1.0)).warnings, []);
        }
        for grid in [Grid::MERL, Grid::TITOPO] {
            let dark = Plausibility::of(&table(grid, 1.0 / 1500.0)).warnings;
            assert!(matches!(dark[..], [Implausible::Dark(_)]), "{dark:?}");
            let bright = Plausibility::of(&table(grid, 1500.0)).warnings;
            assert!(matches!(bright[..], [Implausible::Bright(_)]), "{bright:?}");
        }
        let black = Plausibility::of(&Lambert { kd: [0.0; 3] }).warnings;
        assert!(
            black[0]
                .to_string()
                .starts_with("the albedo is below 0.001 in all channels (0.0000 0.0000 0.0000 at 0 deg")
        );
    }

    #[test]
    fn what_is_kept_is_what_was_found() {
        let mut bad = table(Grid::TITOPO_HALF, 1500.0).values().to_vec();
        bad[1234] = [1e30; 3];
        let bad = TabulatedBrdf::new(Grid::TITOPO_HALF, bad, vec![true; Grid::TITOPO_HALF.len()]).expect("finite");
        for table in [table(Grid::MERL, 1.0), table(Grid::TITOPO_HALF, 1.0 / 1500.0), bad] {
            let found = Plausibility::of(&table);
            let numbers = found.to_numbers(table.is_signed());
            assert_eq!(Plausibility::from_numbers(&numbers).expect("kept"), found);
            assert_eq!(Plausibility::from_numbers(&numbers[1..]), None);
        }
    }

    #[test]
    fn a_value_that_no_lobe_has_is_noticed_wherever_it_stands() {
        for (grid, index) in
            [(Grid::MERL, (45 * 90 + 3) * 180 + 100), (Grid::MERL, 44 * 180), (Grid::TITOPO, (45 * 90 + 10) * 360)]
        {
            let good = table(grid, 1.0);
            assert!(good.valid()[index]);
            let mut values = good.values().to_vec();
            values[index][1] = 1e30;
            let bad = TabulatedBrdf::new(grid, values, good.valid().to_vec()).expect("finite");
            let warnings = Plausibility::of(&bad).warnings;
            let Some(Implausible::Values { cells: 1, value, .. }) = warnings.last() else { panic!("{warnings:?}") };
            assert!((value / 1e30 - 1.0).abs() < 1e-6);
            let text = warnings.last().map(ToString::to_string).unwrap_or_default();
            assert!(text.starts_with("1 cell has a value that no lobe has") && text.len() < 200, "{text}");
        }
        // The sharpest lobe that models have is no fault on MERL's grid.
        let sharp = build("ggx", &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.001]).expect("within bounds");
        let sharp = TabulatedBrdf::tabulate(&*sharp, Grid::MERL).expect("finite");
        assert_eq!(
            Plausibility::of(&sharp).warnings.iter().filter(|w| matches!(w, Implausible::Values { .. })).count(),
            0
        );
    }

    #[test]
    fn what_is_not_measured_is_said() {
        let good = table(Grid::TITOPO_HALF, 1.0);
        let valid = (0..good.valid().len()).map(|k| k / 180 % 45 < 15).collect();
        let part = TabulatedBrdf::new(good.grid(), good.values().to_vec(), valid).expect("valid cells");
        let albedo = Albedo::of(&part, 0.0);
        // sin^2 of 30 degrees.
        assert!((albedo.measured - 0.25).abs() < 0.01, "{albedo:?}");
        assert!(albedo.to_string().ends_with(" % not measured)"), "{albedo}");
    }
}
