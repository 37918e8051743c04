//! Two graphs as clusters: one for each box of cells, with the same base on both sides.

use super::super::elementary::{LANES, Lanes};
use super::partition::{CellBox, Graphs};
use crate::metric::graph::GraphGrid;

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
    differences: Vec<f64>,
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

/// Mean and mean square about it of one value for each of some cells.
fn moments(cells: &[u32], value: impl Fn(usize) -> f64) -> (f64, f64) {
    let values = || cells.iter().map(|&cell| value(cell as usize));
    let mean = values().sum::<f64>() / cells.len() as f64;
    (mean, values().map(|x| (x - mean).powi(2)).sum::<f64>() / cells.len() as f64)
}

impl Clusters {
    pub fn new(graphs: &Graphs<'_>, boxes: Vec<CellBox>) -> Self {
        let [_, n_o, n_phi] = graphs.grid.shape();
        let places: [fn(usize, usize, usize) -> usize; 3] = [
            |cell, n_o, n_phi| cell / (n_o * n_phi),
            |cell, n_o, n_phi| cell / n_phi % n_o,
            |cell, _, n_phi| cell % n_phi,
        ];
        let (mut cells, mut starts) = (Vec::new(), vec![0]);
        let mut columns: [Vec<f64>; 7] = Default::default();
        for found in boxes {
            let first = cells.len();
            let of_box = found.rows(graphs.grid).flat_map(|(_, _, row)| row).filter(|&cell| graphs.is_valid(cell));
            cells.extend(of_box.map(|cell| cell as u32));
            let own = &cells[first..];
            let mut base_spread = 0.0;
            for (axis, place) in places.iter().enumerate() {
                let (mean, variance) =
                    moments(own, |cell| graphs.alpha * graphs.grid.position(axis, place(cell, n_o, n_phi)));
                columns[axis].push(mean);
                base_spread += SPREAD[0] * variance;
            }
            for (side, values) in [graphs.a, graphs.b].into_iter().enumerate() {
                let (mean, variance) = moments(own, |cell| values[cell]);
                columns[3 + 2 * side].push(mean);
                columns[4 + 2 * side].push(base_spread + SPREAD[1] * variance);
            }
            starts.push(cells.len());
        }
        let [x, y, z, a, a_spread, b, b_spread] = columns.map(|column| lanes(column, 0.0));
        let counts: Vec<f64> = starts.windows(2).map(|ends| (ends[1] - ends[0]) as f64).collect();
        let weights = counts.iter().map(|count| count / cells.len() as f64).collect();
        let differences = cells.iter().map(|&cell| graphs.b[cell as usize] - graphs.a[cell as usize]).collect();
        let a = Side { coordinates: [x.clone(), y.clone(), z.clone(), a], spread: a_spread };
        Self { weights, counts, a, b: Side { coordinates: [x, y, z, b], spread: b_spread }, cells, starts, differences }
    }

    /// Whether a and b are one graph.
    pub fn are_equal(&self) -> bool {
        self.differences.iter().all(|d| *d == 0.0)
    }

    /// Number of clusters.
    pub fn len(&self) -> usize {
        self.counts.len()
    }

    /// [`Clusters::differences`] of a cluster.
    pub fn differences_of(&self, cluster: usize) -> &[f64] {
        &self.differences[self.starts[cluster]..self.starts[cluster + 1]]
    }

    /// Of each cluster, the one of `coarser`, clusters of the same partition, that it is a part of.
    pub fn parents(&self, coarser: &Self, grid: GraphGrid) -> Vec<usize> {
        let mut owners = vec![0; grid.len()];
        for cluster in 0..coarser.len() {
            coarser.cells_of(cluster).iter().for_each(|&cell| owners[cell as usize] = cluster);
        }
        (0..self.len()).map(|cluster| owners[self.cells_of(cluster)[0] as usize]).collect()
    }

    /// The cells of a cluster.
    pub fn cells_of(&self, cluster: usize) -> &[u32] {
        &self.cells[self.starts[cluster]..self.starts[cluster + 1]]
    }
}
