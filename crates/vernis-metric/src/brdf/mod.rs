//! Reflectance functions: the trait, tabulated data, published models, file formats and the source notation.

mod cell_finder;
mod error;
pub mod formats;
mod grid;
mod interpolation;
pub mod models;
mod source;
mod tabulated;

pub use error::BrdfError;
pub use grid::{Anchor, Grid, GridDirections};
pub use interpolation::{ConversionLoss, on_grid};
pub use source::{BrdfSource, ContentHash, IdentifiedBrdf, OpenBrdf};
pub use tabulated::{TableError, TabulatedBrdf};

use crate::math::{Rgb, Vec3};

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

    /// The table behind this BRDF, if it is one: lets a reader of tables avoid evaluating cell by cell.
    fn as_table(&self) -> Option<&TabulatedBrdf> {
        None
    }
}
