//! Reflectance functions: the trait, tabulated data, published models, file formats, the source notation, and whether values
//! can be those of a material.

mod cell_finder;
mod error;
pub mod formats;
mod found;
mod grid;
mod interpolation;
pub mod models;
mod notation;
pub mod plausibility;
mod source;
mod tabulated;

pub use error::BrdfError;
pub use grid::{Anchor, Grid, GridDirections};
pub use interpolation::{ConversionLoss, on_grid};
pub use notation::collection;
pub use source::{BrdfSource, ContentHash, IdentifiedBrdf, OpenBrdf};
pub use tabulated::{TableError, TabulatedBrdf};

use crate::math::{Rgb, Vec3};
use models::AnalyticBrdf;

/// An isotropic bidirectional reflectance distribution function.
///
/// Object-safe. There is neither sampling nor a density here: measured data cannot give them honestly.
pub trait Brdf: Send + Sync {
    /// The BRDF value for unit directions `wi` (towards the light) and `wo` (towards the viewer), both in the frame
    /// whose +z is the normal: linear RGB, 1/sr, **cosine not included**.
    ///
    /// `Some([0; 3])` when either direction is below the horizon; `None` where a measurement is missing, which is
    /// not the same as black and must be left out of every sum.
    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb>;

    /// `out[k] = eval(wi[k], wo[k])` for slices of one length. Networks override this with a vectorised form.
    fn eval_batch(&self, wi: &[Vec3], wo: &[Vec3], out: &mut [Option<Rgb>]) {
        for ((o, &i), &v) in out.iter_mut().zip(wi).zip(wo) {
            *o = self.eval(i, v);
        }
    }

    /// Whether the value stays the same when both directions are mirrored at the plane of incidence, phi_d to -phi_d: half
    /// of a table then tells the other half. Data may be otherwise; formulas of isotropic surfaces are not.
    fn is_mirror_symmetric(&self) -> bool {
        false
    }

    /// Whether the value stays the same, up to rounding, when the two directions are exchanged (Helmholtz reciprocity). Where a BRDF is
    /// its own mirror image too, readers then evaluate half of the pairs of polar angles.
    fn is_reciprocal(&self) -> bool {
        false
    }

    /// The table behind this BRDF, if it is one: lets a reader of tables avoid evaluating cell by cell.
    fn as_table(&self) -> Option<&TabulatedBrdf> {
        None
    }

    /// The model behind this BRDF, if it is one: its name and its parameters.
    fn as_model(&self) -> Option<&dyn AnalyticBrdf> {
        None
    }

    /// What the BRDF says of itself, for readers: one line, as its file has it.
    fn description(&self) -> Option<String> {
        None
    }

    /// Whether components may be below zero because they are colours outside the gamut of the primaries, and not a fault.
    fn is_signed(&self) -> bool {
        false
    }

    /// [`Brdf::eval_batch`] as tables and metrics need it: components outside the gamut ([`Brdf::is_signed`]) count as 0.
    /// Whatever else is below zero stays, for the caller to refuse.
    fn eval_in_gamut(&self, wi: &[Vec3], wo: &[Vec3], out: &mut [Option<Rgb>]) {
        self.eval_batch(wi, wo, out);
        if self.is_signed() {
            out.iter_mut().flatten().flatten().for_each(|v| *v = if *v < 0.0 { 0.0 } else { *v });
        }
    }
}
