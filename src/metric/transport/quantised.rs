//! The annealed Sinkhorn iterations on quantised measures.
//!
//! The three chains (a with itself, b with itself, a with b) share no state and run in parallel where threads are free;
//! each runs the same code in the same order, so that equal measures give exactly 0. Large epsilons are dealt with on
//! coarser versions of the measures (`levels.rs`), the same for all chains.
//!
//! Memory: 8 arrays of base nodes x value nodes x 8 bytes, about 2 MB for a metal at the default setting.

use super::annealing::Annealing;
use super::elementary::{LANES, Lanes};
use super::gaussian::{Gaussian, Sink, Spread};
use super::levels::Levels;
use super::measure::Measure;

/// A potential, or anything else with one number a node of a measure.
pub(super) type Field = Vec<Lanes>;

/// One update of the potentials, f <- keep f + (1 - keep) softmin_epsilon.
#[derive(Debug, Clone, Copy)]
pub(super) struct Update {
    pub epsilon: f64,
    pub keep: f64,
    /// Where it takes place, 0 for all nodes.
    pub level: usize,
}

/// Of the updates whose epsilon asks for a level, the last so many take place on it. All of them do at scaling .8; those before
/// them, in slower annealings, lead there, and the next coarser level is good enough for that.
const ON_THEIR_LEVEL: usize = 6;

/// All updates between measures of which the one with fewer has `levels` levels, each on the coarsest that does for it.
pub(super) fn updates(annealing: &Annealing, levels: usize) -> impl DoubleEndedIterator<Item = Update> {
    let last = annealing.last();
    // The level of the update that follows, and how many updates ask for it from there on.
    let mut following = (0, 0);
    let from_the_end = annealing.updates().rev().map(|(epsilon, keep)| {
        // Rounding must not decide about powers of two.
        let level = (0.5 * (epsilon / last).log2() + 1e-9).max(0.0) as usize;
        following = (level, if level == following.0 { following.1 + 1 } else { 1 });
        let leads_there = usize::from(following.1 > ON_THEIR_LEVEL);
        Update { epsilon, keep, level: (level + leads_there).min(levels.saturating_sub(1)) }
    });
    from_the_end.collect::<Vec<_>>().into_iter().rev()
}

/// <a, f_ba - f_aa> + <b, g_ab - g_bb>.
pub(super) fn divergence(alpha: f64, annealing: &Annealing, a: &Levels, b: &Levels) -> f64 {
    let levels = a.len().min(b.len());
    let alone = |measure| alone(alpha, annealing, measure, levels, |_| ());
    let ((f_aa, g_bb), (f_ba, g_ab)) =
        rayon::join(|| rayon::join(|| alone(a), || alone(b)), || crossed(alpha, annealing, a, b, |_, _| ()));
    mean_difference(a.finest(), &f_ba, &f_aa) + mean_difference(b.finest(), &g_ab, &g_bb)
}

/// <measure, f - g>.
pub(super) fn mean_difference(measure: &Measure, f: &Field, g: &Field) -> f64 {
    let differences = f.as_flattened().iter().zip(g.as_flattened()).map(|(f, g)| f - g);
    measure.mass.as_flattened().iter().zip(differences).map(|(mass, difference)| mass * difference).sum()
}

/// A potential on the level that it was last updated on.
struct Potential<'a> {
    measures: &'a Levels,
    level: usize,
    field: Field,
}

impl<'a> Potential<'a> {
    /// Nothing, on the coarsest of `levels` levels.
    fn new(measures: &'a Levels, levels: usize) -> Self {
        let level = levels.saturating_sub(1);
        Self { measures, level, field: vec![[0.0; LANES]; measures.level(level).mass.len()] }
    }

    /// Goes to `level`, which is finer or the same; the masses there.
    fn go_to(&mut self, level: usize) -> &'a Measure {
        if level != self.level {
            self.field = self.measures.refine(std::mem::take(&mut self.field), self.level, level);
            self.level = level;
        }
        self.measures.level(level)
    }
}

/// f_aa; `seen` sees it before and after every update.
pub(super) fn alone(
    alpha: f64,
    annealing: &Annealing,
    a: &Levels,
    levels: usize,
    mut seen: impl FnMut(&Field),
) -> Field {
    let mut f_aa = Potential::new(a, levels);
    let mut spread = Spread::default();
    for Update { epsilon, keep, level } in updates(annealing, levels) {
        let a = f_aa.go_to(level);
        seen(&f_aa.field);
        let gaussian = Gaussian::new(&a.lattice, alpha, epsilon);
        gaussian.spread(&a.mass, &f_aa.field, &mut spread);
        gaussian.gather(a, &spread, a, Sink::Potential { potential: &mut f_aa.field, keep });
        seen(&f_aa.field);
    }
    f_aa.go_to(0);
    f_aa.field
}

/// (f_ba, g_ab); `seen` sees them before and after every update.
pub(super) fn crossed(
    alpha: f64,
    annealing: &Annealing,
    a: &Levels,
    b: &Levels,
    mut seen: impl FnMut(&Field, &Field),
) -> (Field, Field) {
    let levels = a.len().min(b.len());
    let (mut f_ba, mut g_ab) = (Potential::new(a, levels), Potential::new(b, levels));
    let (mut of_a, mut of_b) = (Spread::default(), Spread::default());
    for Update { epsilon, keep, level } in updates(annealing, levels) {
        let (a, b) = (f_ba.go_to(level), g_ab.go_to(level));
        seen(&f_ba.field, &g_ab.field);
        let gaussian = Gaussian::new(&a.lattice, alpha, epsilon);
        // Both from the old potentials.
        gaussian.spread(&a.mass, &f_ba.field, &mut of_a);
        gaussian.spread(&b.mass, &g_ab.field, &mut of_b);
        gaussian.gather(b, &of_b, a, Sink::Potential { potential: &mut f_ba.field, keep });
        gaussian.gather(a, &of_a, b, Sink::Potential { potential: &mut g_ab.field, keep });
        seen(&f_ba.field, &g_ab.field);
    }
    f_ba.go_to(0);
    g_ab.go_to(0);
    (f_ba.field, g_ab.field)
}
