//! Descriptors from a learned embedding of BRDFs: the difference of their coordinates.
//!
//!   x = log map of the node table; p = C (x - mean); z = dense layers (p), leaky ReLU between them; descriptor z_B - z_A.
//!
//! x: 3 x 3,840 numbers, ln(f + 0.001) of R, G, B at each node, or of the opponent triple (ln(Y + 0.001), ln((R + 0.001) /
//! (G + 0.001)), ln((B + 0.001) / (G + 0.001))). C: k x 11,520 principal components. Without layers this is the PCA of Nielsen
//! et al. 2015 (doi:10.1145/2816795.2818085) without their reference BRDF; with layers an encoder on its coordinates. Nodes
//! without a measurement carry their neighbour's value.
//!
//! Only the application is here; what is learned comes in as data. Cost: 11,520 k multiplications a BRDF.

use super::DescriptorError;
use crate::light::node_table::{NODES, NodeTable};
use crate::math::Rgb;
use crate::math::color::{LUMINANCE_REC709, luminance};
use crate::math::layers::{Activation, Dense, LayerMismatch, check_layers, forward};
use serde::{Deserialize, Serialize};

const FLOOR: f64 = 1e-3;

/// Largest magnitude of a number of an embedding.
const LARGEST: f64 = 1e6;
/// Most layers of an encoder.
const MOST_LAYERS: usize = 8;

/// Length of a log-mapped table.
pub const INPUTS: usize = 3 * NODES;

/// How three channels become logarithms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum LogSpace {
    /// ln(f + 0.001) of R, G and B.
    Rgb,
    /// ln(Y + 0.001), ln((R + 0.001) / (G + 0.001)) and ln((B + 0.001) / (G + 0.001)).
    Opponent,
}

/// The log-mapped table, three numbers a node, node by node.
pub fn log_map(table: &NodeTable, space: LogSpace) -> Vec<f64> {
    let node = |f: &Rgb| {
        let f = *f;
        let [r, g, b] = f.map(|v| (v + FLOOR).ln());
        match space {
            LogSpace::Rgb => [r, g, b],
            LogSpace::Opponent => [(luminance(f) + FLOOR).ln(), r - g, b - g],
        }
    };
    table.values().iter().flat_map(node).collect()
}

/// What an embedding consists of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EmbeddingParts {
    /// Family of its descriptors, such as `pca`; these are then `pca.0`, `pca.1`...
    pub name: String,
    /// Which three logarithms a node has.
    pub space: LogSpace,
    /// [`INPUTS`] numbers.
    pub mean: Vec<f32>,
    /// Each of [`INPUTS`] numbers.
    pub components: Vec<Vec<f32>>,
    /// None for a PCA.
    pub layers: Vec<Dense>,
    /// Slope of the leaky ReLU below 0.
    pub slope: f64,
}

/// A learned map from node tables to a few coordinates, checked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "EmbeddingParts", into = "EmbeddingParts")]
pub struct Embedding(EmbeddingParts);

impl Embedding {
    /// Errors: sizes that do not chain, numbers that are not finite or larger than any training gives.
    pub fn new(parts: EmbeddingParts) -> Result<Self, DescriptorError> {
        let wrong = |LayerMismatch { what, found, expected }| DescriptorError::Embedding {
            name: parts.name.clone(),
            what,
            found,
            expected,
        };
        let size = |what: String, found: usize, expected: usize| {
            if found == expected { Ok(()) } else { Err(wrong(LayerMismatch { what, found, expected })) }
        };
        size("values in the mean".into(), parts.mean.len(), INPUTS)?;
        for (k, component) in parts.components.iter().enumerate() {
            size(format!("values in component {k}"), component.len(), INPUTS)?;
        }
        let width = check_layers(&parts.layers, parts.components.len()).map_err(wrong)?;
        if width == 0 {
            return Err(wrong(LayerMismatch { what: "coordinates".into(), found: 0, expected: 1 }));
        }
        let stored = parts.mean.iter().chain(parts.components.iter().flatten()).filter(|v| !v.is_finite()).count();
        let numbers = parts.layers.iter().flat_map(Dense::numbers).chain([parts.slope]);
        size("values that are not finite".into(), stored + numbers.filter(|v| !v.is_finite()).count(), 0)?;
        // No sum of such numbers leaves the range of f64: coordinates are finite.
        let stored = parts.mean.iter().chain(parts.components.iter().flatten()).filter(|v| v.abs() > LARGEST as f32);
        let numbers = parts.layers.iter().flat_map(Dense::numbers).chain([parts.slope]).filter(|v| v.abs() > LARGEST);
        size(format!("values beyond {LARGEST} in magnitude"), stored.count() + numbers.count(), 0)?;
        size("layers too many".into(), parts.layers.len().saturating_sub(MOST_LAYERS), 0)?;
        Ok(Self(parts))
    }

    /// The numbers that the embedding consists of.
    pub fn parts(&self) -> &EmbeddingParts {
        &self.0
    }

    /// Number of coordinates.
    pub fn dimension(&self) -> usize {
        self.0.layers.last().map_or(self.0.components.len(), |l| l.outputs)
    }

    /// Coordinates of a BRDF.
    pub fn coordinates(&self, table: &NodeTable) -> Vec<f64> {
        forward(&self.0.layers, Activation::LeakyRelu { slope: self.0.slope }, &self.project(table))
    }

    /// C (x - mean).
    fn project(&self, table: &NodeTable) -> Vec<f64> {
        let x = log_map(table, self.0.space);
        let centred: Vec<f64> = x.iter().zip(&self.0.mean).map(|(x, m)| x - f64::from(*m)).collect();
        let project = |c: &Vec<f32>| -> f64 { c.iter().zip(&centred).map(|(c, x)| f64::from(*c) * x).sum() };
        self.0.components.iter().map(project).collect()
    }

    /// The derivative of a number by the values of a table, one triple a node, from its derivative by the coordinates. At the
    /// corner of the leaky ReLU the slope is the one above it.
    pub(super) fn transpose(&self, table: &NodeTable, by_coordinate: &[f64]) -> Vec<Rgb> {
        // What went into each layer, before the activation.
        let activation = Activation::LeakyRelu { slope: self.0.slope };
        let mut inputs = vec![self.project(table)];
        for (i, layer) in self.0.layers.iter().enumerate() {
            let x: Vec<f64> = inputs[i].iter().map(|x| if i > 0 { activation.apply(*x) } else { *x }).collect();
            inputs.push(layer.apply(&x));
        }
        let mut by = by_coordinate.to_vec();
        for (i, layer) in self.0.layers.iter().enumerate().rev() {
            let mut by_input = vec![0.0; layer.inputs];
            for (row, by) in layer.weights.chunks_exact(layer.inputs).zip(&by) {
                by_input.iter_mut().zip(row).for_each(|(to, w)| *to += w * by);
            }
            if i > 0 {
                let slope = |x: f64| if self.0.slope * x > x { self.0.slope } else { 1.0 };
                by_input.iter_mut().zip(&inputs[i]).for_each(|(to, x)| *to *= slope(*x));
            }
            by = by_input;
        }
        let mut by_log = vec![0.0; INPUTS];
        for (component, by) in self.0.components.iter().zip(by) {
            by_log.iter_mut().zip(component).for_each(|(to, c)| *to += f64::from(*c) * by);
        }
        let of_node = |(f, by): (&Rgb, &[f64; 3])| {
            let (by_y, of_channel) = match self.0.space {
                LogSpace::Rgb => (0.0, *by),
                LogSpace::Opponent => (by[0] / (luminance(*f) + FLOOR), [by[1], -by[1] - by[2], by[2]]),
            };
            std::array::from_fn(|c| by_y * LUMINANCE_REC709[c] + of_channel[c] / (f[c] + FLOOR))
        };
        table.values().iter().zip(by_log.as_chunks::<3>().0).map(of_node).collect()
    }

    /// Coordinates of the candidate minus those of the reference.
    pub fn differences(&self, reference: &NodeTable, candidate: &NodeTable) -> Vec<f64> {
        let (a, b) = (self.coordinates(reference), self.coordinates(candidate));
        b.iter().zip(&a).map(|(b, a)| b - a).collect()
    }
}

impl TryFrom<EmbeddingParts> for Embedding {
    type Error = DescriptorError;

    fn try_from(parts: EmbeddingParts) -> Result<Self, DescriptorError> {
        Self::new(parts)
    }
}

impl From<Embedding> for EmbeddingParts {
    fn from(embedding: Embedding) -> Self {
        embedding.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::descriptor::constant::Constant;
    use crate::light::Sampling;

    fn parts() -> EmbeddingParts {
        // The mean of each channel over the nodes.
        let component = |c: usize| (0..INPUTS).map(|i| if i % 3 == c { 1.0 / NODES as f32 } else { 0.0 }).collect();
        EmbeddingParts {
            name: "pca".into(),
            space: LogSpace::Rgb,
            mean: vec![0.0; INPUTS],
            components: (0..3).map(component).collect(),
            layers: vec![],
            slope: 0.1,
        }
    }

    #[test]
    fn a_projection_on_channel_means_reads_the_constants() {
        let table = |c| NodeTable::sample(&Constant(c), Sampling::Averages).unwrap();
        let (a, b) = (table([0.1, 0.2, 0.4]), table([0.2, 0.2, 0.1]));
        let pca = Embedding::new(parts()).unwrap();
        let d = pca.differences(&a, &b);
        for (d, expected) in d.iter().zip([(0.201f64 / 0.101).ln(), 0.0, (0.101f64 / 0.401).ln()]) {
            assert!((d - expected).abs() < 1e-5, "{d} {expected}");
        }
        assert_eq!(pca.differences(&a, &a), vec![0.0; 3]);
        let layer = |w: f64, b: f64| Dense { inputs: 1, outputs: 1, weights: vec![w], bias: vec![b] };
        let first = Dense { inputs: 3, outputs: 1, weights: vec![1.0, 0.0, 0.0], bias: vec![0.0] };
        let encoder = Embedding::new(EmbeddingParts { layers: vec![first, layer(2.0, 1.0)], ..parts() }).unwrap();
        // ln(0.101) is negative and passes the leaky ReLU with slope 0.1.
        assert!((encoder.coordinates(&a)[0] - (0.2 * 0.101f64.ln() + 1.0)).abs() < 1e-5);
    }

    #[test]
    fn slopes_are_those_of_central_differences() {
        let table = NodeTable::sample(&Constant([0.1, 0.2, 0.4]), Sampling::Averages).unwrap();
        let scaled = |step: f64| {
            let value = |n: usize, v: &Rgb| -> Rgb {
                std::array::from_fn(|c| v[c] * (1.0 + step * (n + c) as f64 / NODES as f64))
            };
            let values = table.values().iter().enumerate().map(|(n, v)| value(n, v)).collect();
            NodeTable::from_parts(values, table.sampled().to_vec()).unwrap()
        };
        let first = Dense { inputs: 3, outputs: 2, weights: vec![1.0, 0.0, 0.3, -1.0, 2.0, 0.1], bias: vec![0.0, 0.2] };
        let second = Dense { inputs: 2, outputs: 1, weights: vec![2.0, 0.7], bias: vec![0.0] };
        for space in [LogSpace::Rgb, LogSpace::Opponent] {
            for layers in [vec![], vec![first.clone(), second.clone()]] {
                let embedding = Embedding::new(EmbeddingParts { space, layers, ..parts() }).unwrap();
                let by: Vec<f64> = (0..embedding.dimension()).map(|k| 1.0 - 0.4 * k as f64).collect();
                let value = |step: f64| -> f64 {
                    embedding.coordinates(&scaled(step)).iter().zip(&by).map(|(z, by)| z * by).sum()
                };
                let slopes = embedding.transpose(&table, &by);
                let along = scaled(1.0);
                let moved = along.values().iter().flatten().zip(table.values().iter().flatten()).map(|(a, b)| a - b);
                let found: f64 = moved.zip(slopes.iter().flatten()).map(|(d, by)| d * by).sum();
                let expected = (value(1e-4) - value(-1e-4)) / 2e-4;
                assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
            }
        }
    }

    #[test]
    fn parts_that_do_not_fit_are_refused() {
        let short = EmbeddingParts { mean: vec![0.0; 3], ..parts() };
        assert!(matches!(Embedding::new(short), Err(DescriptorError::Embedding { found: 3, .. })));
        let empty = EmbeddingParts { components: vec![], ..parts() };
        assert!(Embedding::new(empty).is_err());
        let mut not_finite = parts();
        not_finite.components[1][7] = f32::NAN;
        assert!(Embedding::new(not_finite).is_err());
        let json = serde_json::to_string(&Embedding::new(parts()).unwrap()).unwrap();
        assert_eq!(serde_json::from_str::<Embedding>(&json).unwrap().parts(), &parts());
    }
}
