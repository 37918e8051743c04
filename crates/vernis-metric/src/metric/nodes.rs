//! The directions at which a metric looks at a BRDF, values there, and derivatives with respect to these values.
//!
//! A fitting program of any kind evaluates its BRDF at the nodes and hands the values over; it gets back the distance and one
//! derivative a value and continues by the chain rule. Values are linear RGB, 1/sr, **cosine not included**; directions are unit
//! vectors with +z the normal, `wi` towards the light and `wo` towards the viewer.
//!
//! Memory: the directions of a grid are made from three short tables of sines and listed only when [`Nodes::wi`] or [`Nodes::wo`]
//! asks for them: 140 MB for the 90x90x360 cells of the Lp metrics. Prepared metrics of one process share one list.

use super::MetricError;
use crate::brdf::{Brdf, Grid, GridDirections, TabulatedBrdf};
use crate::math::parallel;
use crate::math::{Rgb, Vec3};
use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, LazyLock, Mutex, OnceLock, PoisonError, Weak};

/// Nodes that a thread handles at a time; sums of chunks are added up in order, so that no bit depends on the number of threads.
const CHUNK: usize = 4096;

/// What a missing measurement is on nodes.
const MISSING: Rgb = [f64::NAN; 3];

/// The directions at which a metric looks at a BRDF. A gradient lives on nodes.
pub struct Nodes {
    id: String,
    layout: Layout,
}

enum Layout {
    Listed(Vec<Vec3>, Vec<Vec3>),
    Cells(Box<Cells>),
}

/// The values of a table at the cells of a layout as its metric reads them, [`MISSING`] where there is none.
type ReadTable = Box<dyn Fn(&TabulatedBrdf) -> Result<Vec<Rgb>, MetricError> + Send + Sync>;

/// The first cells along each axis of a grid in standard coordinates.
struct Cells {
    directions: GridDirections,
    shape: [usize; 3],
    read_table: ReadTable,
    listed: OnceLock<(Vec<Vec3>, Vec<Vec3>)>,
}

impl Cells {
    /// The number of the node's circle (all azimuths of one pair of polar angles) in the whole grid, and its azimuth.
    fn place(&self, node: usize) -> (usize, usize) {
        let [_, polar, azimuths] = self.shape;
        let row = node / azimuths;
        (row / polar * self.directions.grid().shape()[1] + row % polar, node % azimuths)
    }

    fn directions(&self, node: usize) -> (Vec3, Vec3) {
        let (circle, azimuth) = self.place(node);
        self.directions.get(circle * self.shape[2] + azimuth)
    }

    fn len(&self) -> usize {
        self.shape.iter().product()
    }
}

impl Nodes {
    /// Any list of directions: `wi[k]` and `wo[k]` are those of node k. `id` names the layout and never changes with its content: values
    /// for one id fit every metric with nodes of that id.
    ///
    /// # Panics
    /// When the two lists have different lengths.
    pub fn new(id: impl Into<String>, wi: Vec<Vec3>, wo: Vec<Vec3>) -> Self {
        assert_eq!(wi.len(), wo.len(), "every node has two directions");
        Self { id: id.into(), layout: Layout::Listed(wi, wo) }
    }

    /// The first `shape` cells along each axis of a grid in standard coordinates, all along the last, row-major; `read_table` gives the
    /// values of a table at these cells as the metric reads it.
    pub(in crate::metric) fn of_cells(
        id: impl Into<String>,
        grid: Grid,
        shape: [usize; 3],
        read_table: impl Fn(&TabulatedBrdf) -> Result<Vec<Rgb>, MetricError> + Send + Sync + 'static,
    ) -> Self {
        let cells = Cells {
            directions: grid.all_directions(),
            shape,
            read_table: Box::new(read_table),
            listed: OnceLock::new(),
        };
        Self { id: id.into(), layout: Layout::Cells(Box::new(cells)) }
    }

    /// The nodes called `id` that this process has in use, or those that `make` makes.
    pub(in crate::metric) fn shared(id: &str, make: impl FnOnce(&str) -> Self) -> Arc<Self> {
        static IN_USE: LazyLock<Mutex<BTreeMap<String, Weak<Nodes>>>> = LazyLock::new(Mutex::default);
        // A map of weak pointers is whole whatever thread died over it.
        let mut in_use = IN_USE.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(nodes) = in_use.get(id).and_then(Weak::upgrade) {
            return nodes;
        }
        let nodes = Arc::new(make(id));
        in_use.insert(id.to_owned(), Arc::downgrade(&nodes));
        nodes
    }

    /// The name of the layout, such as `graph-45x45x180`.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        match &self.layout {
            Layout::Listed(wi, _) => wi.len(),
            Layout::Cells(cells) => cells.len(),
        }
    }

    /// Whether there is no node.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The directions towards the light, one a node.
    pub fn wi(&self) -> &[Vec3] {
        self.listed().0
    }

    /// The directions towards the viewer, one a node.
    pub fn wo(&self) -> &[Vec3] {
        self.listed().1
    }

    fn listed(&self) -> (&[Vec3], &[Vec3]) {
        match &self.layout {
            Layout::Listed(wi, wo) => (wi, wo),
            Layout::Cells(cells) => {
                let list = || (0..cells.len()).map(|node| cells.directions(node)).unzip();
                let (wi, wo) = cells.listed.get_or_init(list);
                (wi, wo)
            }
        }
    }

    /// `(wi, wo)` of one node, without listing all.
    ///
    /// # Panics
    /// Unless `node` is less than [`Nodes::len`].
    pub fn directions(&self, node: usize) -> (Vec3, Vec3) {
        match &self.layout {
            Layout::Listed(wi, wo) => (wi[node], wo[node]),
            Layout::Cells(cells) => cells.directions(node),
        }
    }

    /// The values of a BRDF on the nodes (linear RGB, 1/sr, no cosine), `[NaN; 3]` for a missing measurement. Colours outside the gamut
    /// lose their negative components. A table is read as the metric reads it, which on grids of cells is not the same as looking
    /// up each direction (cells at the pole share a direction; metrics on graphs interpolate).
    ///
    /// With the values of a BRDF without missing measurements, [`PreparedMetric::distance_at`](super::PreparedMetric::distance_at) is
    /// the distance to that BRDF.
    pub fn evaluate(&self, brdf: &dyn Brdf) -> Vec<Rgb> {
        match (&self.layout, brdf.as_table()) {
            (Layout::Cells(cells), Some(table)) => {
                (cells.read_table)(table).unwrap_or_else(|_| vec![MISSING; cells.len()])
            }
            (Layout::Cells(cells), None) => {
                let azimuths = cells.shape[2];
                let mut values = vec![MISSING; cells.len()];
                parallel::for_each_chunk(&mut values, azimuths, |row, values| {
                    let (circle, _) = cells.place(row * azimuths);
                    let found = cells.directions.evaluate_circle(brdf, circle);
                    for (k, value) in values.iter_mut().enumerate() {
                        *value = found[cells.directions.on_circle(k, found.len())].unwrap_or(MISSING);
                    }
                });
                values
            }
            (Layout::Listed(wi, wo), _) => {
                let mut values = vec![MISSING; wi.len()];
                parallel::for_each_chunk(&mut values, CHUNK, |k, values| {
                    let nodes = k * CHUNK..k * CHUNK + values.len();
                    let mut found = vec![None; values.len()];
                    brdf.eval_in_gamut(&wi[nodes.clone()], &wo[nodes], &mut found);
                    values.iter_mut().zip(found).for_each(|(value, found)| *value = found.unwrap_or(MISSING));
                });
                values
            }
        }
    }

    /// Whether `values` can be those of a candidate: one a node, finite, not negative. `metric` is named in errors.
    ///
    /// # Errors
    /// [`MetricError::ValueCount`], and [`MetricError::NodeValue`] for the first wrong value. A missing measurement (NaN) is one: what
    /// a metric leaves out is a matter of tables, which have masks.
    pub fn check(&self, metric: &str, values: &[Rgb]) -> Result<(), MetricError> {
        if values.len() != self.len() {
            let (metric, nodes) = (metric.to_owned(), self.id.clone());
            return Err(MetricError::ValueCount { metric, nodes, found: values.len(), expected: self.len() });
        }
        let is_wrong = |value: &f64| !value.is_finite() || *value < 0.0;
        let chunks: Vec<&[Rgb]> = values.chunks(CHUNK).collect();
        let wrong = |k: usize| chunks[k].iter().position(|rgb| rgb.iter().any(is_wrong)).map(|node| k * CHUNK + node);
        let Some(node) = parallel::map(chunks.len(), wrong).into_iter().flatten().next() else { return Ok(()) };
        let channel = values[node].iter().position(is_wrong).unwrap_or_default();
        let ((wi, wo), value) = (self.directions(node), values[node][channel]);
        Err(MetricError::NodeValue { nodes: self.id.clone(), node, wi, wo, channel, value })
    }

    /// sum over the nodes of `term(node, wi, wo)`, an array of `count` sums; nodes for which `takes_part` is false are left out. In
    /// parallel, in a fixed order.
    pub(crate) fn sums(
        &self,
        count: usize,
        takes_part: impl Fn(usize) -> bool + Sync,
        add: impl Fn(usize, Vec3, Vec3, &mut [f64]) + Sync,
    ) -> Vec<f64> {
        let chunk = |chunk: usize| {
            let mut sums = vec![0.0; count];
            let nodes = chunk * CHUNK..((chunk + 1) * CHUNK).min(self.len());
            for node in nodes.filter(|&node| takes_part(node)) {
                let (wi, wo) = self.directions(node);
                add(node, wi, wo, &mut sums);
            }
            sums
        };
        let chunks = parallel::map(self.len().div_ceil(CHUNK), chunk);
        let mut total = vec![0.0; count];
        chunks.iter().for_each(|sums| total.iter_mut().zip(sums).for_each(|(total, sum)| *total += sum));
        total
    }
}

impl fmt::Debug for Nodes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Nodes").field("id", &self.id).field("len", &self.len()).finish()
    }
}

/// How a distance changes with the values of the candidate on the nodes of the metric.
///
/// An optimiser of tables steps along `derivatives`. The derivative with respect to a parameter p of a model f is the chain
/// rule's: sum over nodes and channels of `derivatives[node][channel]` times df/dp at the directions of the node.
#[derive(Debug, Clone, PartialEq)]
pub struct Gradient {
    /// The distance itself, in the metric's unit.
    pub value: f64,
    /// d value/d f (R, G, B) for each node, f the BRDF there (1/sr, cosine not included): 0 for nodes that take no part, such as
    /// those where the reference has no measurement. Always finite; a metric says which derivative it takes at a kink.
    pub derivatives: Vec<[f64; 3]>,
}

impl Gradient {
    /// The derivative along a change of the candidate: `change(wi, wo)` is the derivative of its value (R, G, B) there.
    pub fn along(&self, nodes: &Nodes, change: impl Fn(Vec3, Vec3) -> Rgb + Sync) -> f64 {
        let takes_part = |node: usize| self.derivatives.get(node).is_some_and(|d| *d != [0.0; 3]);
        let term = |node: usize, wi: Vec3, wo: Vec3, sums: &mut [f64]| {
            let change = change(wi, wo);
            sums[0] += (0..3).map(|c| self.derivatives[node][c] * change[c]).sum::<f64>();
        };
        nodes.sums(1, takes_part, term)[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Anchor;
    use crate::brdf::models::Ggx;

    fn cells() -> Nodes {
        let grid = Grid::Standard { theta_i: 6, theta_o: 6, phi_d: 9, anchor: Anchor::Edge };
        Nodes::of_cells("test", grid, [4, 4, 9], |_| Ok(vec![[1.0; 3]; 4 * 4 * 9]))
    }

    #[test]
    fn cells_are_listed_in_order_and_mirrored_values_are_those_of_their_directions() {
        let nodes = cells();
        let grid = Grid::Standard { theta_i: 6, theta_o: 6, phi_d: 9, anchor: Anchor::Edge };
        assert_eq!((nodes.len(), nodes.wi().len(), nodes.wo().len()), (144, 144, 144));
        let brdf = Ggx::new([0.2, 0.1, 0.05], [0.04; 3], 0.3).unwrap();
        let values = nodes.evaluate(&brdf);
        for (node, cell) in [(0, 0), (5, 5), (3 * 9 + 7, 3 * 9 + 7), (4 * 9, 6 * 9), (15 * 9 + 8, (3 * 6 + 3) * 9 + 8)]
        {
            let (wi, wo) = grid.directions(cell);
            assert_eq!((nodes.wi()[node], nodes.wo()[node]), (wi, wo));
            let expected = brdf.eval(wi, wo).unwrap();
            (0..3).for_each(|c| assert!((values[node][c] / expected[c] - 1.0).abs() < 1e-12, "{node}"));
        }
        let listed = Nodes::new("listed", nodes.wi().to_vec(), nodes.wo().to_vec());
        for (a, b) in listed.evaluate(&brdf).iter().zip(&values) {
            (0..3).for_each(|c| assert!((a[c] / b[c] - 1.0).abs() < 1e-12));
        }
    }

    #[test]
    fn wrong_values_are_named_with_their_node() {
        let nodes = cells();
        let short = nodes.check("D1", &[[0.1; 3]; 143]).unwrap_err().to_string();
        assert_eq!(short, "D1: 143 values were given; the nodes `test` take 144, one RGB value a node");
        let mut values = vec![[0.1; 3]; 144];
        assert_eq!(nodes.check("D1", &values), Ok(()));
        for wrong in [f64::NAN, f64::INFINITY, -1e-3] {
            values[7][1] = wrong;
            let error = nodes.check("D1", &values).unwrap_err();
            assert!(error.is_about_candidate_values());
            assert!(matches!(error, MetricError::NodeValue { node: 7, channel: 1, .. }), "{error}");
        }
    }

    #[test]
    fn one_process_has_one_list() {
        let make = |id: &str| Nodes::new(id, Vec::new(), Vec::new());
        let first = Nodes::shared("one list", make);
        assert!(Arc::ptr_eq(&first, &Nodes::shared("one list", make)));
        assert!(!Arc::ptr_eq(&first, &Nodes::shared("another list", make)));
    }
}
