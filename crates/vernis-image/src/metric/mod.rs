//! Metrics that compare two pictures, one file each.
//!
//! Every file opens with what the metric computes, its symbols, its source, the display that it assumes and what it does not see.
//! [`ImageRegistry::standard`] has them all by name. `quality` is the number that the authors publish, in their direction; `distance`
//! follows from it, is 0 for identical pictures, and larger is worse.
//!
//! Sums over pixels are taken row by row and then from the top row down, so that no number depends on the number of threads.

pub mod cid;
pub mod ciede2000;
pub mod cielab;
mod colour;
mod contract;
pub mod cvvdp;
pub mod delta_e_itp;
pub mod flip;
mod frequency;
pub mod hdr_flip;
pub mod hdr_vdp;
pub mod icid;
pub mod lab2000hl;
pub mod ms_ssim;
#[cfg(feature = "networks")]
pub mod network;
mod plane;
pub mod psnr;
pub mod pu21;
mod registry;
pub mod s_cielab;
pub mod ssim;
pub mod weights;

pub use cid::Cid;
pub use ciede2000::{Ciede2000, ciede2000};
pub use cielab::{Cielab, Mean};
pub use contract::{
    Comparison, Conditions, DifferenceMap, FolderError, ImageMetric, ImageMetricError, Need, Prepared,
    PreparedReference, PreparedResult, Properties,
};
pub use cvvdp::Cvvdp;
pub use delta_e_itp::DeltaEItp;
pub use flip::Flip;
pub use hdr_flip::HdrFlip;
pub use hdr_vdp::{HdrVdp, Receptors};
pub use icid::Icid;
pub use lab2000hl::{Lab2000HlTable, Space, TableError};
pub use ms_ssim::MsSsim;
#[cfg(feature = "networks")]
pub use network::{Backbone, Lpips, MatSim, ShiftTolerant, StLpips};
pub use psnr::Psnr;
pub use pu21::{Pu21Psnr, Pu21Ssim};
pub use registry::ImageRegistry;
pub use ssim::{Ssim, Values};
pub use weights::{WEIGHTS_FILES, Weights, WeightsError, WeightsFile, WeightsState};
