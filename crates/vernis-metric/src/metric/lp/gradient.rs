//! The derivatives of an Lp distance with respect to the candidate's values.
//!
//!   distance = root(M),  M = sum w t(d)/cells,   d distance/d f_a = root'(M) w t'(d) g'(f_a)/cells,   d = g(f_a) - g(f_r)
//!
//! with the terms of [`super::formula`]. The number itself comes from the pass of the distance, so that both are the same bits.
//!
//! Cost: about the pass itself once more, and the derivatives' memory, 24 bytes a node.

use super::AZIMUTHS;
use super::block::{Block, Cells, Extent, NodeValues};
use super::formula::{CellFormula, Weights};
use super::kernel::Work;
use super::metric::{checked_distance, sums_of};
use super::variant::LpVariant;
use crate::math::Rgb;
use crate::math::parallel;
use crate::metric::{Gradient, MetricError};

/// The distance of `variant`, and its derivatives at the nodes of `polar` angles along both axes.
pub(super) fn gradient(
    variant: LpVariant,
    cell: CellFormula,
    polar: usize,
    reference: &dyn Cells,
    candidate: &NodeValues,
) -> Result<Gradient, MetricError> {
    let sums = sums_of(reference, candidate, &Work::for_variants([variant]))?;
    let value = checked_distance(&sums, variant)?;
    let outer = variant.formula.root_slope(value) / sums.cells(variant) as f64;
    let row = |i: usize| -> Result<Vec<Rgb>, MetricError> {
        let mut derivatives = vec![[0.0; 3]; polar * AZIMUTHS];
        let (mut of_reference, mut of_candidate) = (Block::new(), Block::new());
        let mut plane = [0.0; AZIMUTHS];
        for (o, derivatives) in derivatives.chunks_exact_mut(AZIMUTHS).enumerate() {
            reference.read(i, o, Extent::WHOLE, &mut of_reference)?;
            candidate.read(i, o, Extent::WHOLE, &mut of_candidate)?;
            // Cells that the reference lacks become equal, and their slopes 0.
            of_reference.mask(&mut of_candidate, Extent::WHOLE);
            let weights = Weights::at(i, o);
            let scale = outer * weights.of(variant.formula);
            for channel in 0..3 {
                let (r, a) = (&of_reference.rgb[channel], &of_candidate.rgb[channel]);
                cell.slopes(r, a, weights.cosine, &mut plane);
                derivatives.iter_mut().zip(&plane).for_each(|(d, slope)| d[channel] = scale * slope);
            }
        }
        Ok(derivatives)
    };
    Ok(Gradient { value, derivatives: parallel::try_map(polar, row)?.concat() })
}
