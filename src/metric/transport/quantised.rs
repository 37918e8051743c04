//! The annealed Sinkhorn iterations on quantised measures.
//!
//! The three chains (a with itself, b with itself, a with b) share no state and run in parallel where threads are free;
//! each runs the same code in the same order, so that equal measures give exactly 0.
//!
//! Memory: 8 arrays of base nodes x value nodes x 8 bytes, about 2 MB for a metal at the default setting.

use super::annealing::Annealing;
use super::elementary::{LANES, Lanes};
use super::gaussian::{Gaussian, Sink, Spread};
use super::measure::Measure;

/// A potential, or anything else with one number a node of a measure.
pub(super) type Field = Vec<Lanes>;

/// <a, f_ba - f_aa> + <b, g_ab - g_bb>.
pub(super) fn divergence(alpha: f64, annealing: &Annealing, a: &Measure, b: &Measure) -> f64 {
    let alone = |measure| alone(alpha, annealing, measure, |_| ());
    let ((f_aa, g_bb), (f_ba, g_ab)) =
        rayon::join(|| rayon::join(|| alone(a), || alone(b)), || crossed(alpha, annealing, a, b, |_, _| ()));
    mean_difference(a, &f_ba, &f_aa) + mean_difference(b, &g_ab, &g_bb)
}

/// <measure, f - g>.
pub(super) fn mean_difference(measure: &Measure, f: &Field, g: &Field) -> f64 {
    let differences = f.as_flattened().iter().zip(g.as_flattened()).map(|(f, g)| f - g);
    measure.mass.as_flattened().iter().zip(differences).map(|(mass, difference)| mass * difference).sum()
}

/// f_aa; `before` sees it before every update.
pub(super) fn alone(alpha: f64, annealing: &Annealing, a: &Measure, mut before: impl FnMut(&Field)) -> Field {
    let mut f_aa = vec![[0.0; LANES]; a.mass.len()];
    let mut spread = Spread::default();
    for (epsilon, keep) in annealing.updates() {
        before(&f_aa);
        let gaussian = Gaussian::new(&a.lattice, alpha, epsilon);
        gaussian.spread(&a.mass, &f_aa, &mut spread);
        gaussian.gather(a, &spread, a, Sink::Potential { potential: &mut f_aa, keep });
    }
    f_aa
}

/// (f_ba, g_ab); `before` sees them before every update.
pub(super) fn crossed(
    alpha: f64,
    annealing: &Annealing,
    a: &Measure,
    b: &Measure,
    mut before: impl FnMut(&Field, &Field),
) -> (Field, Field) {
    let mut f_ba = vec![[0.0; LANES]; a.mass.len()];
    let mut g_ab = vec![[0.0; LANES]; b.mass.len()];
    let (mut of_a, mut of_b) = (Spread::default(), Spread::default());
    for (epsilon, keep) in annealing.updates() {
        before(&f_ba, &g_ab);
        let gaussian = Gaussian::new(&a.lattice, alpha, epsilon);
        // Both from the old potentials.
        gaussian.spread(&a.mass, &f_ba, &mut of_a);
        gaussian.spread(&b.mass, &g_ab, &mut of_b);
        gaussian.gather(b, &of_b, a, Sink::Potential { potential: &mut f_ba, keep });
        gaussian.gather(a, &of_a, b, Sink::Potential { potential: &mut g_ab, keep });
    }
    (f_ba, g_ab)
}
