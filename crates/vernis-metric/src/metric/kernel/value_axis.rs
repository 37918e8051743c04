//! The nodes of the value axis: the same for every side of every comparison.
//!
//! They lie h apart up to `EVEN` h from zero, and twice as far apart with every doubling of the value beyond: a highlight of 1e5
//! takes no more than a few thousand nodes to reach. Node 0 is 0, and every node is a multiple of h.

/// Nodes of one distance on either side of zero.
const EVEN: i64 = 512;
/// Nodes from there to the double of the value, and so on.
const OCTAVE: i64 = EVEN / 2;

/// A point among four nodes: cubic interpolation takes `weights` of the nodes from `first` on, and `slopes` for its derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    pub first: i64,
    pub weights: [f64; 4],
    pub slopes: [f64; 4],
}

/// Nodes along the value axis, h apart near zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ValueAxis {
    pub h: f64,
}

impl ValueAxis {
    /// The value of a node.
    pub fn node(self, index: i64) -> f64 {
        let above = index.abs() - EVEN;
        if above <= 0 {
            return self.h * index as f64;
        }
        let (octave, rest) = (above / OCTAVE, above % OCTAVE);
        let multiple = (OCTAVE + rest) as f64 * 2.0f64.powi(octave as i32 + 1);
        self.h * multiple.copysign(index as f64)
    }

    /// The last node at or below a value, but for rounding.
    #[inline(always)]
    pub fn below(self, w: f64) -> i64 {
        let x = w / self.h;
        if x.abs() < EVEN as f64 {
            let truncated = x as i64;
            return truncated - i64::from(truncated as f64 > x);
        }
        Self::below_far(x)
    }

    #[cold]
    fn below_far(x: f64) -> i64 {
        // The exponent of the quotient, which is at least 1: a logarithm might miss a power of two.
        let octave = ((x.abs() / EVEN as f64).to_bits() >> 52) as i64 - 1023;
        let place = x.abs() / 2.0f64.powi(octave as i32 + 1);
        let first = EVEN + (octave - 1) * OCTAVE;
        if x > 0.0 { first + place.floor() as i64 } else { -(first + place.ceil() as i64) }
    }

    /// The place of a value.
    #[inline(always)]
    pub fn place(self, w: f64) -> Place {
        let below = self.below(w);
        if (-EVEN < below) & (below < EVEN - 1) {
            let t = w / self.h - below as f64;
            let (a, b, c, d) = (t + 1.0, t, t - 1.0, t - 2.0);
            const SIXTH: f64 = 1.0 / 6.0;
            let weights = [-SIXTH * b * c * d, 0.5 * a * c * d, -0.5 * a * b * d, SIXTH * a * b * c];
            let slopes = [
                -SIXTH * (b * c + b * d + c * d),
                0.5 * (a * c + a * d + c * d),
                -0.5 * (a * b + a * d + b * d),
                SIXTH * (a * b + a * c + b * c),
            ];
            return Place { first: below - 1, weights, slopes: slopes.map(|slope| slope / self.h) };
        }
        self.place_far(w, below - 1)
    }

    /// Lagrange's cubic through nodes of any distance.
    #[cold]
    fn place_far(self, w: f64, first: i64) -> Place {
        let x = [0, 1, 2, 3].map(|k| self.node(first + k));
        let scale = [0, 1, 2, 3].map(|k| 1.0 / (0..4).filter(|j| *j != k).map(|j| x[k] - x[j]).product::<f64>());
        let [a, b, c, d] = x.map(|x| w - x);
        let weights = [b * c * d, a * c * d, a * b * d, a * b * c];
        let slopes = [b * c + b * d + c * d, a * c + a * d + c * d, a * b + a * d + b * d, a * b + a * c + b * c];
        Place {
            first,
            weights: [0, 1, 2, 3].map(|k| weights[k] * scale[k]),
            slopes: [0, 1, 2, 3].map(|k| slopes[k] * scale[k]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_lies_between_its_nodes() {
        let axis = ValueAxis { h: 0.004 };
        for w in (0..5000).map(|k| (f64::from(k) * 0.01 - 20.0).sinh() * 1e-3) {
            let place = axis.place(w);
            let nodes = [0, 1, 2, 3].map(|k| axis.node(place.first + k));
            let rounding = 1e-12 * w.abs();
            assert!(nodes[1] <= w + rounding && w <= nodes[2] + rounding, "{w} {nodes:?}");
            // Cubics, and their slopes, are reproduced.
            let cubic = |x: f64| 1.0 + (x - w) * (2.0 + (x - w) * (3.0 + (x - w)));
            let sum = |factors: [f64; 4]| nodes.iter().zip(factors).map(|(x, f)| f * cubic(*x)).sum::<f64>();
            let size = nodes.iter().map(|x| cubic(*x).abs()).fold(1.0, f64::max);
            assert!((sum(place.weights) - 1.0).abs() < 1e-12 * size, "{w} {}", sum(place.weights));
            assert!((sum(place.slopes) - 2.0).abs() < 1e-9 * size, "{w} {}", sum(place.slopes));
        }
    }

    #[test]
    fn nodes_are_multiples_and_know_their_place() {
        let axis = ValueAxis { h: 0.5 };
        for index in -5000i64..5000 {
            let (low, high) = (axis.node(index), axis.node(index + 1));
            assert!(low < high && (low / 0.5).fract() == 0.0);
            assert_eq!([axis.below(low), axis.below(0.5 * (low + high))], [index; 2], "{low}");
            // No more than a 256th of the value apart, or h.
            assert!(high - low <= (low.abs().max(high.abs()) / 256.0).max(0.5));
        }
    }

    /// Coarser axes take every second node.
    #[test]
    fn axes_are_nested() {
        let (fine, coarse) = (ValueAxis { h: 0.5 }, ValueAxis { h: 1.0 });
        assert!((-3000..3000).all(|index| fine.node(fine.below(coarse.node(index))) == coarse.node(index)));
    }
}
