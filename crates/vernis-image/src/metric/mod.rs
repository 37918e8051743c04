//! Metrics that compare two pictures, one file each.
//!
//! Every file opens with what the metric computes, its symbols, its source, the display that it assumes and what it does not see.
//! [`ImageRegistry::standard`] has them all by name. `quality` is the number that the authors publish, in their direction; `distance`
//! follows from it, is 0 for identical pictures, and larger is worse.
//!
//! Sums over pixels are taken row by row and then from the top row down, so that no number depends on the number of threads.

mod cid;
mod ciede2000;
mod cielab;
mod colour;
mod contract;
mod cvvdp;
mod delta_e_itp;
mod flip;
mod frequency;
mod hdr_flip;
mod hdr_vdp;
mod icid;
mod lab2000hl;
mod ms_ssim;
mod plane;
mod psnr;
mod pu21;
mod registry;
mod s_cielab;
mod ssim;

pub use cid::Cid;
pub use ciede2000::{Ciede2000, ciede2000};
pub use cielab::{Cielab, Mean};
pub use contract::{
    Comparison, Conditions, DifferenceMap, ImageMetric, ImageMetricError, Need, Prepared, PreparedReference, Properties,
};
pub use cvvdp::Cvvdp;
pub use delta_e_itp::DeltaEItp;
pub use flip::Flip;
pub use hdr_flip::HdrFlip;
pub use hdr_vdp::{HdrVdp, Receptors};
pub use icid::{Clipping, Icid};
pub use lab2000hl::{Lab2000HlTable, Space, TableError};
pub use ms_ssim::MsSsim;
pub use psnr::Psnr;
pub use pu21::{Pu21Psnr, Pu21Ssim};
pub use registry::ImageRegistry;
pub use ssim::{Ssim, Values};
