//! The derivative of the quantised divergence with respect to the candidate's values, by reverse differentiation of the
//! annealed iterations.
//!
//! The usual envelope formula, which reads the gradient off the last potentials, assumes that they have converged; at
//! scaling 0.8 they have not, and it is 1 to 40 % off. Here every update is differentiated. For
//! f(t) = -epsilon ln sum_s m(s) exp((g(s) - C(s, t))/epsilon) and the derivative r(t) of the value with respect to f(t),
//!
//!   E(s) = e^(g(s)/epsilon) sum_t r(t) exp((f(t) - C(s, t))/epsilon),   d value/dg(s) = -m(s) E(s),   d value/dm(s) = -epsilon E(s),
//!
//! a Gaussian sum of the same kind as the update itself. The splat follows by the chain rule ([`pull_back`]).
//!
//! It is the gradient of the very number that `divergence` returns, with the schedule of epsilons held: what the schedule adds, by way
//! of the largest and smallest values, is added by [`divergence_and_gradient`](super::super::divergence_and_gradient). Where two
//! limits of the anti-diffusion tie, one of the two one-sided derivatives is taken.
//!
//! Coarser levels (`levels.rs`) are linear in the finer ones' masses but for the limits of their anti-diffusion, and so are
//! finer levels' potentials in the coarser ones'.
//!
//! Cost: 2.5 divergences, and one more where the schedule adds something. Memory: the potentials before and after every
//! update, base nodes x value nodes x 48 bytes an update on level 0 (about 5 MB for a metal at the default setting).

use super::super::annealing::Annealing;
use super::super::elementary::{LANES, Lanes};
use super::field::Field;
use super::gaussian::{Gaussian, Nodes, Sink, Spread};
use super::iterations::{Update, alone, crossed, mean_difference, updates};
use super::levels::Levels;
use super::measure::{Measure, Support};
use super::splat::pull_back;
use crate::math::parallel;

/// The divergence of `a` and `b`, and its derivative with respect to the values `cells` that `b` was made of.
pub(in crate::metric::transport) fn divergence_and_gradient(
    alpha: f64,
    annealing: &Annealing,
    a: &Levels,
    b: &Levels,
    cells: &[f64],
    valid: impl Fn(usize) -> bool,
) -> (f64, Vec<f64>) {
    let (value, of_mass) = value_and_masses(alpha, annealing, a, b);
    (value, pull_back(b.finest(), cells, valid, &of_mass))
}

/// The divergence, and its derivative with respect to the masses of `b`.
fn value_and_masses(alpha: f64, annealing: &Annealing, a: &Levels, b: &Levels) -> (f64, Field) {
    let levels = a.len().min(b.len());
    // On level 0 all nodes: the derivative asks what mass would cost where there is none.
    let of_candidate = || {
        let mut history = Vec::new();
        let last = alone(alpha, annealing, b, levels, Nodes::All, |g| history.push(g.clone()));
        let of_mass = of_alone(alpha, annealing, b, levels, &history);
        (last, of_mass)
    };
    let of_both = || {
        let (mut of_a, mut of_b) = (Vec::new(), Vec::new());
        let (f, g) = crossed(alpha, annealing, a, b, Nodes::All, |f, g| {
            of_a.push(f.clone());
            of_b.push(g.clone());
        });
        let of_mass = of_crossed(alpha, annealing, [a, b], [&of_a, &of_b]);
        (f, g, of_mass)
    };
    let of_reference = || alone(alpha, annealing, a, levels, Nodes::Support, |_| ());
    let ((f_aa, (g_bb, of_bb)), (f_ba, g_ab, of_ab)) =
        parallel::join(|| parallel::join(of_reference, of_candidate), of_both);
    let value = mean_difference(a.finest(), &f_ba, &f_aa) + mean_difference(b.finest(), &g_ab, &g_bb);
    let of_masses = |f: &Field, of_chain: Vec<Field>, sign: f64| {
        let mut of_mass = b.coarsen_back(of_chain);
        of_mass
            .as_flattened_mut()
            .iter_mut()
            .zip(f.as_flattened())
            .for_each(|(of_mass, f)| *of_mass = sign * (*of_mass + f));
        of_mass
    };
    (value, combine(&of_masses(&g_ab, of_ab, 1.0), 1.0, &of_masses(&g_bb, of_bb, -1.0), 1.0))
}

/// x a + y b.
fn combine(a: &[Lanes], x: f64, b: &[Lanes], y: f64) -> Field {
    let mut sum = vec![[0.0; LANES]; a.len()];
    let terms = a.as_flattened().iter().zip(b.as_flattened());
    sum.as_flattened_mut().iter_mut().zip(terms).for_each(|(sum, (a, b))| *sum = x * a + y * b);
    sum
}

/// One update f <- keep f + (1 - keep) softmin(g), seen backwards.
struct Backwards<'a> {
    gaussian: &'a Gaussian,
    keep: f64,
    /// Where f lives, and where g lives.
    target: &'a Measure,
    source: &'a Measure,
    /// Which nodes of both took part; the others kept their potentials.
    nodes: Nodes,
    /// f before and after, and g before.
    f: &'a [Field; 2],
    g: &'a Field,
}

impl Backwards<'_> {
    /// E, given the derivative with respect to f after the update.
    fn factor(&self, of_f: &Field) -> Field {
        let [old, new] = self.f;
        let share = 1.0 / (1.0 - self.keep);
        let softmin = combine(new, share, old, -share * self.keep);
        let mut of_softmin = combine(of_f, 1.0 - self.keep, of_f, 0.0);
        self.bystanders(self.target).into_iter().for_each(|node| of_softmin[node] = [0.0; LANES]);
        let (mut spread, mut factor) = (Spread::default(), vec![[0.0; LANES]; self.g.len()]);
        let support = Support::of(&of_softmin, self.target.values.len());
        self.gaussian.spread(&of_softmin, &support, &softmin, &mut spread);
        let sink = Sink::Sum { sum: &mut factor, potential: self.g };
        self.gaussian.gather(self.target, &spread, self.source, Nodes::All, sink);
        factor
    }

    /// keep `of` - m E: the derivative with respect to a potential before, of which `of` is the one after.
    fn through(&self, of: &Field, factor: &Field) -> Field {
        let mut before = combine(of, self.keep, of, 0.0);
        self.bystanders(self.source).into_iter().for_each(|node| before[node] = of[node]);
        let terms = self.source.mass.as_flattened().iter().zip(factor.as_flattened());
        before.as_flattened_mut().iter_mut().zip(terms).for_each(|(before, (mass, factor))| *before -= mass * factor);
        before
    }

    /// The places in a potential of `measure` that did not take part.
    fn bystanders(&self, measure: &Measure) -> Vec<usize> {
        if self.nodes == Nodes::All {
            return Vec::new();
        }
        let base = measure.lattice.base_len();
        let mut bystanders = vec![true; measure.mass.len()];
        for (entry, bystanders) in bystanders.chunks_exact_mut(base).enumerate() {
            measure.support.at(entry).iter().for_each(|&node| bystanders[node as usize] = false);
        }
        (0..bystanders.len()).filter(|&node| bystanders[node]).collect()
    }
}

/// No derivative yet, with respect to the masses of each of `levels` levels.
fn nothing(measures: &Levels, levels: usize) -> Vec<Field> {
    (0..levels).map(|level| vec![[0.0; LANES]; measures.level(level).mass.len()]).collect()
}

/// The derivative of <b, g_bb> with respect to the masses of every level of b by way of g_bb; `history`: g_bb before and after
/// every update.
fn of_alone(alpha: f64, annealing: &Annealing, b: &Levels, levels: usize, history: &[Field]) -> Vec<Field> {
    let mut of_masses = nothing(b, levels);
    let (mut of_g, mut at) = (b.finest().mass.clone(), 0);
    let steps: Vec<_> = updates(annealing, levels, Nodes::All).zip(history.as_chunks().0).collect();
    for (Update { epsilon, keep, level, nodes }, g) in steps.into_iter().rev() {
        of_g = b.refine_back(of_g, at, level);
        at = level;
        let measure = b.level(level);
        let gaussian = Gaussian::new(&measure.lattice, alpha, epsilon);
        let update = Backwards { gaussian: &gaussian, keep, target: measure, source: measure, nodes, f: g, g: &g[0] };
        let factor = update.factor(&of_g);
        of_masses[level] = combine(&of_masses[level], 1.0, &factor, -epsilon);
        of_g = update.through(&of_g, &factor);
    }
    of_masses
}

/// The derivative of <a, f_ba> + <b, g_ab> as in [`of_alone`]; histories of f_ba and g_ab.
fn of_crossed(alpha: f64, annealing: &Annealing, [a, b]: [&Levels; 2], [f, g]: [&[Field]; 2]) -> Vec<Field> {
    let levels = a.len().min(b.len());
    let mut of_masses = nothing(b, levels);
    let (mut of_f, mut of_g, mut at) = (a.finest().mass.clone(), b.finest().mass.clone(), 0);
    let steps: Vec<_> =
        updates(annealing, levels, Nodes::All).zip(f.as_chunks().0.iter().zip(g.as_chunks().0)).collect();
    for (Update { epsilon, keep, level, nodes }, (f, g)) in steps.into_iter().rev() {
        (of_f, of_g) = (a.refine_back(of_f, at, level), b.refine_back(of_g, at, level));
        at = level;
        let (a, b) = (a.level(level), b.level(level));
        let gaussian = Gaussian::new(&b.lattice, alpha, epsilon);
        let of_a = Backwards { gaussian: &gaussian, keep, target: a, source: b, nodes, f, g: &g[0] };
        let of_b = Backwards { gaussian: &gaussian, keep, target: b, source: a, nodes, f: g, g: &f[0] };
        let (to_b, to_a) = (of_a.factor(&of_f), of_b.factor(&of_g));
        of_masses[level] = combine(&of_masses[level], 1.0, &to_b, -epsilon);
        (of_f, of_g) = (of_b.through(&of_f, &to_a), of_a.through(&of_g, &to_b));
    }
    of_masses
}
