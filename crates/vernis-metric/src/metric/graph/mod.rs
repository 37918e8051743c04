//! The graph of a BRDF: what the transport and kernel metrics compare.
//!
//! Every valid cell of the grid is a point of mass 1/N in four dimensions, one set of points a colour channel:
//!
//!   (alpha theta_i/(pi/2), alpha theta_o/(pi/2), alpha phi_d/(2 pi), phi(max(f cos theta_i, 0)))
//!
//! with f the BRDF (1/sr), alpha the weight of the directions against the values, and phi a [`Tone`] that compresses
//! highlights. [`GraphGrid`] holds the cells, [`CosineTable`] the products f cos theta_i; neither depends on alpha or phi, so
//! that all metrics of this kind share them.
//!
//! Source: G. Lavoué, N. Bonneel, J.-P. Farrugia, C. Soler, "Perceptual quality of BRDF approximations: dataset and
//! metrics", Computer Graphics Forum 40(2), 2021, doi:10.1111/cgf.142636, section 6.1; the cosine, which the paper leaves
//! out, stands in the authors' program.

mod grid;
mod metric;
mod notation;
mod spline;
mod table;
mod tone;

pub use grid::GraphGrid;
pub(in crate::metric) use metric::metric_methods;
pub use metric::{ChannelGradients, GraphMetric, PreparedGraph, PreparedTable, coarser, combine, on_grid, share};
pub use notation::Options;
pub use table::{CommonCells, CompactTable, CosineTable};
pub use tone::Tone;
