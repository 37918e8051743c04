//! An Lp metric as a loss, on its own cells or on fewer.
//!
//! With all cells it is the metric's number but for rounding; a [`Lattice`] of fewer cells weighs each by those it stands for.
//! Cost: one value of the model a direction, about 4 ms for GGX with a coarsening of 3, against 80 ms with all cells.

use super::lattice::{Lattice, Sample};
use super::{DifferentiableLoss, Loss};
use crate::brdf::Brdf;
use crate::brdf::models::{AnalyticBrdf, DifferentiableBrdf};
use crate::metric::MetricError;
use crate::metric::lp::{CellFormula, Formula, LpVariant, POLAR, POLAR_CLAMPED, Weights};

/// One Lp variant against one reference.
pub struct LpLoss {
    name: String,
    formula: Formula,
    cell: CellFormula,
    /// Its reference values are those after the formula's root.
    lattice: Lattice,
    /// Weight and cosine by [`POLAR`] theta_i + theta_o.
    weights: Vec<(f64, f64)>,
    cells: f64,
}

/// The model has a value there that no reflectance is.
struct BadValue;

impl LpLoss {
    /// `None` for the variants that compare colours.
    ///
    /// # Errors
    /// Those of [`Lattice::new`].
    pub fn new(reference: &dyn Brdf, variant: LpVariant, coarsening: usize) -> Result<Option<Self>, MetricError> {
        let Some(cell) = CellFormula::of(variant) else { return Ok(None) };
        let mut lattice = Lattice::new(reference, coarsening, if variant.clamped { POLAR_CLAMPED } else { POLAR })?;
        let weight = |k: usize| {
            let weights = Weights::at(k / POLAR, k % POLAR);
            (weights.of(variant.formula), weights.cosine)
        };
        let weights: Vec<(f64, f64)> = (0..POLAR * POLAR).map(weight).collect();
        for sample in &mut lattice.samples {
            sample.reference = sample.reference.map(|rgb| rgb.map(|f| cell.root(f)));
        }
        let cells = lattice.samples.iter().map(Sample::cells).sum();
        Ok(Some(Self { name: variant.to_string(), formula: variant.formula, cell, lattice, weights, cells }))
    }

    /// Whether `variant` can be had on fewer cells: all but those that compare colours.
    pub fn is_available(variant: LpVariant) -> bool {
        CellFormula::of(variant).is_some()
    }

    /// Number of directions at which a model is evaluated.
    pub fn directions(&self) -> usize {
        self.lattice.len()
    }

    fn chunk(&self, samples: &[Sample], candidate: &dyn AnalyticBrdf) -> Result<f64, BadValue> {
        let mut sum = 0.0;
        for sample in samples {
            let (wi, wo) = self.lattice.directions(sample);
            let value = checked(candidate.value(wi, wo))?;
            let (weight, cosine) = self.weights[sample.row()];
            let root = value.map(|f| self.cell.root(f));
            for side in (0..2).filter(|side| sample.count[*side] > 0.0) {
                let term = |c: usize| self.cell.term(self.cell.difference(sample.reference[side][c], root[c], cosine));
                sum += weight * f64::from(sample.count[side]) * (term(0) + term(1) + term(2));
            }
        }
        Ok(sum)
    }

    fn chunk_gradient(&self, samples: &[Sample], candidate: &dyn DifferentiableBrdf) -> Result<Vec<f64>, BadValue> {
        let count = candidate.parameters().len();
        let mut d = vec![[0.0; 3]; count];
        // The sum itself comes last.
        let mut sums = vec![0.0; count + 1];
        for sample in samples {
            let (wi, wo) = self.lattice.directions(sample);
            let value = checked(candidate.value_and_gradient(wi, wo, &mut d))?;
            let (weight, cosine) = self.weights[sample.row()];
            let mut outer = [0.0; 3];
            for c in 0..3 {
                let root = self.cell.root(value[c]);
                let slope = self.cell.curve_slope(root, cosine);
                for side in 0..2 {
                    let cells = f64::from(sample.count[side]);
                    let difference = self.cell.difference(sample.reference[side][c], root, cosine);
                    sums[count] += weight * cells * self.cell.term(difference);
                    outer[c] += weight * cells * self.cell.term_slope(difference) * slope;
                }
            }
            for (sum, d) in sums.iter_mut().zip(&d) {
                *sum += (0..3).map(|c| outer[c] * d[c]).sum::<f64>();
            }
        }
        Ok(sums)
    }
}

fn checked(value: [f64; 3]) -> Result<[f64; 3], BadValue> {
    if value.iter().all(|v| v.is_finite() && *v >= 0.0) { Ok(value) } else { Err(BadValue) }
}

impl Loss for LpLoss {
    fn name(&self) -> &str {
        &self.name
    }

    fn value(&self, candidate: &dyn AnalyticBrdf) -> Result<f64, MetricError> {
        let sum = self.lattice.reduce(0.0, |samples| self.chunk(samples, candidate), |total, part| *total += part);
        Ok(sum.map_or(f64::INFINITY, |sum| self.formula.of_mean(sum / self.cells)))
    }

    fn as_differentiable(&self) -> Option<&dyn DifferentiableLoss> {
        self.cell.has_bounded_slopes().then_some(self)
    }
}

impl DifferentiableLoss for LpLoss {
    fn gradient(&self, candidate: &dyn DifferentiableBrdf) -> Result<(f64, Vec<f64>), MetricError> {
        let count = candidate.parameters().len();
        let add = |total: &mut Vec<f64>, part: Vec<f64>| total.iter_mut().zip(part).for_each(|(t, p)| *t += p);
        let sums = self.lattice.reduce(vec![0.0; count + 1], |samples| self.chunk_gradient(samples, candidate), add);
        let Ok(mut sums) = sums else { return Ok((f64::INFINITY, vec![0.0; count])) };
        let mean = sums.pop().unwrap_or_default() / self.cells;
        let value = self.formula.of_mean(mean);
        let outer = self.formula.root_slope(value);
        sums.iter_mut().for_each(|s| *s *= outer / self.cells);
        Ok((value, sums))
    }

    fn smooth_power(&self) -> f64 {
        self.formula.smooth_power()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::{Ggx, Ward, WardForm};
    use crate::brdf::{Grid, TabulatedBrdf};
    use crate::metric::Metric;
    use crate::metric::lp::LpMetric;

    fn reference() -> TabulatedBrdf {
        let ward = Ward::new([0.1, 0.2, 0.05], [0.05, 0.04, 0.03], 0.12, WardForm::Duer).unwrap();
        TabulatedBrdf::tabulate(&ward, Grid::MERL).unwrap()
    }

    #[test]
    fn with_all_cells_it_is_the_metric_itself() {
        let reference = reference();
        let candidate = Ggx::new([0.12, 0.18, 0.06], [0.05; 3], 0.15).unwrap();
        for name in ["D1", "D2.Cl", "D3", "D4.Cl", "D5.CR", "D7.Cl.CR", "D8", "D9.Cl", "D9.CR", "D4.Cl.CR"] {
            let variant: LpVariant = name.parse().unwrap();
            let expected = LpMetric::new(variant).distance(&reference, &candidate).unwrap();
            let found = LpLoss::new(&reference, variant, 1).unwrap().unwrap().value(&candidate).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-10, "{name}: {found} {expected}");
        }
        for name in ["D6", "lab.Cl"] {
            assert!(LpLoss::new(&reference, name.parse().unwrap(), 3).unwrap().is_none());
        }
    }

    #[test]
    fn fewer_cells_give_nearly_the_same() {
        let reference = reference();
        for alpha in [0.03, 0.15] {
            let candidate = Ggx::new([0.12, 0.18, 0.06], [0.05; 3], alpha).unwrap();
            for name in ["D4.Cl", "D9.Cl", "D1.Cl.CR"] {
                let variant: LpVariant = name.parse().unwrap();
                let value = |n| LpLoss::new(&reference, variant, n).unwrap().unwrap().value(&candidate).unwrap();
                let (all, few) = (value(1), value(3));
                // Towards 80 degrees values grow by tenths from one degree to the next.
                assert!((few / all - 1.0).abs() < 0.04, "{name} {alpha}: {few} {all}");
            }
        }
    }

    #[test]
    fn gradients_are_limits_of_differences() {
        let reference = reference();
        let p = [0.12, 0.18, 0.06, 0.05, 0.06, 0.07, 0.15];
        let model = |p: &[f64]| crate::brdf::models::build("ggx", p).unwrap();
        for name in ["D4.Cl", "D9.Cl", "D9.Cl.CR", "D5.Cl", "D1.Cl.CR"] {
            let loss = LpLoss::new(&reference, name.parse().unwrap(), 6).unwrap().unwrap();
            let candidate = model(&p);
            let (value, gradient) =
                loss.as_differentiable().unwrap().gradient(candidate.as_differentiable().unwrap()).unwrap();
            assert!((value / loss.value(&*candidate).unwrap() - 1.0).abs() < 1e-12);
            for k in 0..p.len() {
                let at = |h: f64| {
                    let mut moved = p;
                    moved[k] += h;
                    loss.value(&*model(&moved)).unwrap()
                };
                let expected = (at(1e-6) - at(-1e-6)) / 2e-6;
                let scale = gradient.iter().fold(0.0f64, |m, g| m.max(g.abs()));
                assert!((gradient[k] - expected).abs() < 1e-4 * scale, "{name} {k}: {} {expected}", gradient[k]);
            }
        }
        let rooted = LpLoss::new(&reference, "D3".parse().unwrap(), 6).unwrap().unwrap();
        assert!(rooted.as_differentiable().is_none());
    }
}
