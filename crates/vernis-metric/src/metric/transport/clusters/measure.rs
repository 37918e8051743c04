//! Two graphs as clusters: one for each box of cells, with the same base on both sides.

use super::super::elementary::{LANES, Lanes};
use super::partition::{CellBox, Graphs};

/// Within a cluster cells vary; of their squared distances from the mean, what counts as distance between cells of different
/// clusters, for the base and for the values: about what lies across the way between them. Chosen on the pairs of the golden values,
/// on 9 x 9 x 36 cells, where (1/2, 1/2) and (1, 0) do nearly as well.
pub(super) const SPREAD: [f64; 2] = [0.7, 0.3];

/// The clusters of a pair of graphs.
pub(super) struct Clusters {
    /// Parts of the mass, 1 in all.
    pub weights: Vec<f64>,
    /// Number of cells of each.
    pub counts: Vec<f64>,
    pub a: Side,
    pub b: Side,
    /// The cells, cluster by cluster; where each cluster's begin, and the end.
    cells: Vec<u32>,
    starts: Vec<usize>,
    /// b - a of these cells.
    pub differences: Vec<f64>,
}

/// The clusters of one graph, [`LANES`] to an entry; entries that only fill up are 0.
pub(super) struct Side {
    /// Means of the base coordinates, alpha included, and of the values.
    pub coordinates: [Vec<Lanes>; 4],
    /// The part of the cells' squared distances from the mean that counts as distance.
    pub spread: Vec<Lanes>,
}

impl Side {
    pub fn point(&self, index: usize) -> ([f64; 4], f64) {
        let (entry, lane) = (index / LANES, index % LANES);
        ([0, 1, 2, 3].map(|axis| self.coordinates[axis][entry][lane]), self.spread[entry][lane])
    }
}

/// Numbers as entries of lanes, filled up with `filling`.
pub(super) fn lanes(values: impl IntoIterator<Item = f64>, filling: f64) -> Vec<Lanes> {
    let mut all: Vec<f64> = values.into_iter().collect();
    all.resize(all.len().next_multiple_of(LANES), filling);
    all.as_chunks().0.to_vec()
}

/// Mean and mean square about it.
fn moments(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    (mean, values.map(|x| (x - mean).powi(2)).sum::<f64>() / count)
}

impl Clusters {
    pub fn new(graphs: &Graphs<'_>, count: usize) -> Self {
        let boxes = graphs.boxes(count);
        let (mut cells, mut starts) = (Vec::new(), vec![0]);
        let mut columns: [Vec<f64>; 7] = Default::default();
        let mut cluster = |found: &CellBox| {
            let first = cells.len();
            let mut places: [Vec<f64>; 3] = Default::default();
            for (i, o, row) in found.rows(graphs.grid) {
                for (k, cell) in (found.ranges[2].start..).zip(row).filter(|(_, cell)| graphs.is_valid(*cell)) {
                    cells.push(cell as u32);
                    for (axis, index) in [i, o, k].into_iter().enumerate() {
                        places[axis].push(graphs.alpha * graphs.grid.position(axis, index));
                    }
                }
            }
            let mut base_spread = 0.0;
            for (axis, places) in places.iter().enumerate() {
                let (mean, variance) = moments(places.iter().copied());
                columns[axis].push(mean);
                base_spread += SPREAD[0] * variance;
            }
            for (side, values) in [graphs.a, graphs.b].into_iter().enumerate() {
                let (mean, variance) = moments(cells[first..].iter().map(|&cell| values[cell as usize]));
                columns[3 + 2 * side].push(mean);
                columns[4 + 2 * side].push(base_spread + SPREAD[1] * variance);
            }
            starts.push(cells.len());
        };
        boxes.iter().for_each(&mut cluster);
        let [x, y, z, a, a_spread, b, b_spread] = columns.map(|column| lanes(column, 0.0));
        let counts: Vec<f64> = starts.windows(2).map(|ends| (ends[1] - ends[0]) as f64).collect();
        let weights = counts.iter().map(|count| count / cells.len() as f64).collect();
        let differences = cells.iter().map(|&cell| graphs.b[cell as usize] - graphs.a[cell as usize]).collect();
        let a = Side { coordinates: [x.clone(), y.clone(), z.clone(), a], spread: a_spread };
        Self { weights, counts, a, b: Side { coordinates: [x, y, z, b], spread: b_spread }, cells, starts, differences }
    }

    /// Number of clusters.
    pub fn len(&self) -> usize {
        self.counts.len()
    }

    /// [`Clusters::differences`] of a cluster.
    pub fn differences_of(&self, cluster: usize) -> &[f64] {
        &self.differences[self.starts[cluster]..self.starts[cluster + 1]]
    }

    /// The cells of a cluster.
    pub fn cells_of(&self, cluster: usize) -> &[u32] {
        &self.cells[self.starts[cluster]..self.starts[cluster + 1]]
    }
}
