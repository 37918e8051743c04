//! The schedule of epsilons of GeomLoss, which is part of the value: at scaling 0.8 the potentials have not converged
//! when it ends (the value is up to 27 % off the limit).
//!
//!   epsilon_0 = D^p;   epsilon_k = exp(p ln D + (k - 1) p ln s) as long as it exceeds b^p, k = 1, 2 ...;   last b^p
//!
//! D: diameter of the joint bounding box of both graphs; p: power of the cost; s: scaling; b: blur. D^p stands twice.
//!
//! Source: J. Feydy et al., "Interpolating between optimal transport and MMD using Sinkhorn divergences", AISTATS 2019;
//! `epsilon_schedule` and `sinkhorn_loop` of GeomLoss 0.3.1.

use super::{SinkhornParameters, TransportError};

/// More epsilons than this are refused: scaling 0.99999 over eight decades.
const MOST_STEPS: usize = 1_000_000;

/// The epsilons in their order.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Annealing {
    epsilons: Vec<f64>,
    /// By how much those that follow the diameter are larger than listed: all but the last.
    stretch: f64,
}

/// One update of the potentials, f <- keep f + (1 - keep) softmin_epsilon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    pub epsilon: f64,
    pub keep: f64,
    /// The epsilon of the schedule as it was made, which decides on what nodes the step takes place.
    pub listed: f64,
}

impl Annealing {
    /// The schedule for a positive `diameter`.
    pub fn new(parameters: &SinkhornParameters, diameter: f64) -> Result<Self, TransportError> {
        let p = parameters.cost().power();
        let (start, stop) = (p * diameter.ln(), p * parameters.blur().ln());
        // As numpy's `arange` steps: by the difference of the first two values.
        let step = (start + p * parameters.scaling().ln()) - start;
        let count = ((stop - start) / step).ceil();
        // A small diameter gives none, which a cast to usize makes of what is below 0; it would make 0 of a NaN as well.
        if count.is_nan() || count > MOST_STEPS as f64 {
            return Err(TransportError::TooManySteps { found: count, allowed: MOST_STEPS });
        }
        let falling = (0..count as usize).map(|k| (start + k as f64 * step).exp());
        let ends = (diameter.powf(p), parameters.blur().powf(p));
        let epsilons = std::iter::once(ends.0).chain(falling).chain([ends.1]).collect();
        Ok(Self { epsilons, stretch: 1.0 })
    }

    /// The schedule for a slightly larger diameter, `factor` times epsilon, with as many steps on the same nodes: for the derivative
    /// with respect to the diameter.
    pub fn stretched(&self, factor: f64) -> Self {
        Self { epsilons: self.epsilons.clone(), stretch: factor }
    }

    /// The last and smallest epsilon but for tiny diameters, b^p.
    pub fn last(&self) -> f64 {
        self.epsilons.last().copied().unwrap_or(1.0)
    }

    /// Every update of the potentials: one that starts from nothing, the averaged ones, and the last, which replaces.
    pub fn updates(&self) -> impl DoubleEndedIterator<Item = Step> {
        let count = self.epsilons.len();
        let step = move |k: usize, keep: f64| {
            let listed = self.epsilons[k];
            let epsilon = if k + 1 < count { self.stretch * listed } else { listed };
            Step { epsilon, keep, listed }
        };
        let start = (count > 0).then(|| step(0, 0.0)).into_iter();
        let end = (count > 0).then(|| step(count - 1, 0.0));
        start.chain((0..count).map(move |k| step(k, 0.5))).chain(end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::transport::GroundCost;

    #[test]
    fn epsilons_are_those_of_geomloss() {
        // geomloss.sinkhorn_divergence.epsilon_schedule(2, 1., 0.5, 0.8): [1, 1, 0.64, 0.4096, 0.262144, 0.25].
        let parameters = SinkhornParameters::new(GroundCost::SquaredDistance, 0.1, 0.5, 0.8).unwrap();
        let found = Annealing::new(&parameters, 1.0).unwrap().epsilons;
        let expected = [1.0, 1.0, 0.64, 0.4096, 0.262144, 0.25];
        assert_eq!(found.len(), expected.len());
        found.iter().zip(expected).for_each(|(a, b)| assert!((a - b).abs() < 1e-15, "{found:?}"));
    }

    #[test]
    fn a_diameter_below_the_blur_leaves_two_epsilons() {
        let parameters = SinkhornParameters::new(GroundCost::Distance, 0.1, 0.5, 0.8).unwrap();
        assert_eq!(Annealing::new(&parameters, 0.25).unwrap().epsilons, [0.25, 0.5]);
    }

    #[test]
    fn endless_schedules_are_refused() {
        let parameters = SinkhornParameters::new(GroundCost::Distance, 0.1, 0.5, 1.0 - 1e-12).unwrap();
        assert!(matches!(Annealing::new(&parameters, 2.0), Err(TransportError::TooManySteps { .. })));
    }
}
