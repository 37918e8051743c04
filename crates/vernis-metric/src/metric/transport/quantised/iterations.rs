//! The annealed Sinkhorn iterations on quantised measures.
//!
//! The three chains (a with itself, b with itself, a with b) share no state and run in parallel where threads are free;
//! each runs the same code in the same order, so that equal measures give exactly 0. Large epsilons are dealt with on
//! coarser versions of the measures (`levels.rs`), the same for all chains. Most nodes have no mass, and their potentials are
//! left as they are unless something depends on them ([`Update::nodes`]).
//!
//! Memory: 8 arrays of base nodes x value nodes x 8 bytes, about 2 MB for a metal at the default setting.

use super::super::annealing::{Annealing, Step};
use super::super::elementary::LANES;
use super::field::Field;
use super::gaussian::{Gaussian, Nodes, Sink, Spread};
use super::levels::Levels;
use super::measure::Measure;
use crate::math::parallel;

/// One update of the potentials, f <- keep f + (1 - keep) softmin_epsilon.
#[derive(Debug, Clone, Copy)]
pub(super) struct Update {
    pub epsilon: f64,
    pub keep: f64,
    /// Where it takes place, 0 for the finest.
    pub level: usize,
    /// The nodes of that level that it changes.
    pub nodes: Nodes,
}

/// See [`updates`].
const PER_LEVEL: usize = 6;

/// All updates between measures of which the one with fewer has `levels` levels, each on the coarsest that does for it, and on
/// level 0 of the nodes `finest`.
///
/// *Levels.* Of the updates whose epsilon asks for a level, the last [`PER_LEVEL`] take place on it: all at scaling 0.8. Those before
/// them, in slower annealings, lead there, and the next coarser level is good enough for that.
///
/// *Nodes without mass.* A finer level starts from all nodes of the coarser, massless or not. Those without mass take part from so
/// many updates before that, and on the coarsest level, where all starts from nothing. Earlier, and on level 0, no value depends on
/// them.
pub(super) fn updates(annealing: &Annealing, levels: usize, finest: Nodes) -> impl DoubleEndedIterator<Item = Update> {
    let last = annealing.last();
    // The level of the update that follows, and how many updates ask for it from there on.
    let mut following = (0, 0);
    // The level that it takes place on, and how many updates do from there on.
    let mut here = (0, 0);
    let from_the_end = annealing.updates().rev().map(|Step { epsilon, keep, listed }| {
        // Rounding must not decide about powers of two.
        let level = (0.5 * (listed / last).log2() + 1e-9).max(0.0) as usize;
        following = (level, if level == following.0 { following.1 + 1 } else { 1 });
        let leads_there = usize::from(following.1 > PER_LEVEL);
        let level = (level + leads_there).min(levels.saturating_sub(1));
        here = (level, if level == here.0 { here.1 + 1 } else { 1 });
        let nodes = match level {
            0 => finest,
            _ if level + 1 == levels || here.1 <= PER_LEVEL => Nodes::All,
            _ => Nodes::Support,
        };
        Update { epsilon, keep, level, nodes }
    });
    from_the_end.collect::<Vec<_>>().into_iter().rev()
}

/// <a, f_ba - f_aa> + <b, g_ab - g_bb>.
pub(in crate::metric::transport) fn divergence(alpha: f64, annealing: &Annealing, a: &Levels, b: &Levels) -> f64 {
    let levels = a.len().min(b.len());
    let alone = |measure| alone(alpha, annealing, measure, levels, Nodes::Support, |_| ());
    let both = || crossed(alpha, annealing, a, b, Nodes::Support, |_, _| ());
    let ((f_aa, g_bb), (f_ba, g_ab)) = parallel::join(|| parallel::join(|| alone(a), || alone(b)), both);
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

/// f_aa, on level 0 at `finest`; `seen` sees it before and after every update.
pub(super) fn alone(
    alpha: f64,
    annealing: &Annealing,
    a: &Levels,
    levels: usize,
    finest: Nodes,
    mut seen: impl FnMut(&Field),
) -> Field {
    let mut f_aa = Potential::new(a, levels);
    let mut spread = Spread::default();
    for Update { epsilon, keep, level, nodes } in updates(annealing, levels, finest) {
        let a = f_aa.go_to(level);
        seen(&f_aa.field);
        let gaussian = Gaussian::new(&a.lattice, alpha, epsilon);
        gaussian.spread(&a.mass, &a.support, &f_aa.field, &mut spread);
        gaussian.gather(a, &spread, a, nodes, Sink::Potential { potential: &mut f_aa.field, keep });
        seen(&f_aa.field);
    }
    f_aa.go_to(0);
    f_aa.field
}

/// (f_ba, g_ab), on level 0 at `finest`; `seen` sees them before and after every update.
pub(super) fn crossed(
    alpha: f64,
    annealing: &Annealing,
    a: &Levels,
    b: &Levels,
    finest: Nodes,
    mut seen: impl FnMut(&Field, &Field),
) -> (Field, Field) {
    let levels = a.len().min(b.len());
    let (mut f_ba, mut g_ab) = (Potential::new(a, levels), Potential::new(b, levels));
    let (mut of_a, mut of_b) = (Spread::default(), Spread::default());
    for Update { epsilon, keep, level, nodes } in updates(annealing, levels, finest) {
        let (a, b) = (f_ba.go_to(level), g_ab.go_to(level));
        seen(&f_ba.field, &g_ab.field);
        let gaussian = Gaussian::new(&a.lattice, alpha, epsilon);
        // Both from the old potentials.
        gaussian.spread(&a.mass, &a.support, &f_ba.field, &mut of_a);
        gaussian.spread(&b.mass, &b.support, &g_ab.field, &mut of_b);
        gaussian.gather(b, &of_b, a, nodes, Sink::Potential { potential: &mut f_ba.field, keep });
        gaussian.gather(a, &of_a, b, nodes, Sink::Potential { potential: &mut g_ab.field, keep });
        seen(&f_ba.field, &g_ab.field);
    }
    f_ba.go_to(0);
    g_ab.go_to(0);
    (f_ba.field, g_ab.field)
}

#[cfg(test)]
mod tests {
    use super::super::lattice::Lattice;
    use super::*;
    use crate::metric::graph::GraphGrid;
    use crate::metric::transport::{GroundCost, SinkhornParameters};

    #[test]
    fn no_value_depends_on_nodes_without_mass() {
        let grid = GraphGrid::new(9, 9, 36).unwrap();
        let levels = |shift: f64| {
            let cells: Vec<f64> =
                (0..grid.len()).map(|k| (k as f64 / 300.0) + shift * (k as f64 * 0.37).sin()).collect();
            Levels::new(Lattice::new(grid, [4; 3], 0.05 / 8.0), &cells, None).unwrap()
        };
        let (a, b) = (levels(0.1), levels(0.2));
        for scaling in [0.8, 0.95] {
            let parameters = SinkhornParameters::new(GroundCost::SquaredDistance, 0.1, 0.05, scaling).unwrap();
            let annealing = Annealing::new(&parameters, 10.0).unwrap();
            let all = crossed(0.1, &annealing, &a, &b, Nodes::All, |_, _| ());
            let some = crossed(0.1, &annealing, &a, &b, Nodes::Support, |_, _| ());
            assert_ne!(all.0, some.0, "there are no nodes without mass");
            let nothing = vec![[0.0; LANES]; some.0.len()];
            let sums = [&all.0, &some.0].map(|f| mean_difference(a.finest(), f, &nothing));
            assert_eq!(sums[0], sums[1]);
        }
    }

    #[test]
    fn slow_annealings_leave_nodes_without_mass_out_until_they_matter() {
        let parameters = SinkhornParameters::new(GroundCost::SquaredDistance, 0.1, 0.05, 0.95).unwrap();
        let annealing = Annealing::new(&parameters, 10.0).unwrap();
        let updates: Vec<Update> = updates(&annealing, 6, Nodes::Support).collect();
        let of_level = |level: usize| updates.iter().filter(move |update| update.level == level);
        assert_eq!(of_level(0).count(), PER_LEVEL);
        assert!(of_level(5).all(|update| update.nodes == Nodes::All));
        for level in 1..5 {
            let nodes: Vec<Nodes> = of_level(level).map(|update| update.nodes).collect();
            let (without, with) = nodes.split_at(nodes.len() - PER_LEVEL);
            assert!(without.len() > 3 && without.iter().all(|nodes| *nodes == Nodes::Support), "{nodes:?}");
            assert!(with.iter().all(|nodes| *nodes == Nodes::All), "{nodes:?}");
        }
    }
}
