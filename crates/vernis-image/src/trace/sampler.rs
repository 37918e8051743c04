//! Random numbers that depend on seed, pixel and sample alone, so that threads cannot change a picture.
//!
//! The first choices of a path are points of a (0,2)-sequence (van der Corput and Sobol), shuffled and scrambled for every pixel and
//! pair of dimensions (Owen 1995; the hash of Laine and Karras 2011, doi:10.1111/j.1467-8659.2011.01945.x, after Burley 2020,
//! "Practical Hash-based Owen Scrambling", JCGT 9:4): 2^k samples of a pixel are stratified. Later choices are independent
//! numbers (Steele, Lea and Flood 2014, doi:10.1145/2660193.2660195). Each sample alone is uniform, so every mean is unbiased.

/// Numbers of one path.
pub struct Sampler {
    /// Of the pixel.
    scramble: u32,
    /// Of the sample in its pixel.
    index: u32,
    /// Of the independent numbers.
    state: u64,
    /// Rays that the path has followed.
    pub rays: u32,
}

/// The mixing function of splitmix64.
fn mixed(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// An Owen scramble of the reversed bits of `x`.
#[inline]
fn scrambled(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x
}

/// Bits of the second Sobol dimension, lowest first: the matrix of Pascal's triangle modulo 2, a factor a line.
#[inline]
fn pascal(mut x: u32) -> u32 {
    x ^= (x >> 1) & 0x5555_5555;
    x ^= (x >> 2) & 0x3333_3333;
    x ^= (x >> 4) & 0x0f0f_0f0f;
    x ^= (x >> 8) & 0x00ff_00ff;
    x ^= (x >> 16) & 0x0000_ffff;
    x
}

/// A number from 0 to less than 1.
#[inline]
pub fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

impl Sampler {
    /// The numbers of a pixel under a seed, before its first sample.
    pub fn pixel(seed: u64, pixel: u64) -> u64 {
        mixed(mixed(seed ^ 0x6a09_e667_f3bc_c908).wrapping_add(pixel.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
    }

    /// The numbers of sample `index` of a [`Sampler::pixel`].
    #[inline]
    pub fn new(pixel: u64, index: u32) -> Self {
        let state = mixed(pixel ^ (u64::from(index) << 32 | u64::from(index)).wrapping_mul(0xd6e8_feb8_6659_fd93));
        Self { scramble: (pixel >> 32) as u32, index, state, rays: 0 }
    }

    /// Two stratified numbers, 32 bits each. Each `dimension` is to be asked for once.
    #[inline]
    pub fn pair(&self, dimension: u32) -> [u32; 2] {
        let seed = |k: u32| {
            let x = (self.scramble ^ dimension.wrapping_mul(0x9e37_79b9)).wrapping_add(k.wrapping_mul(0x85eb_ca6b));
            let x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
            let x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
            x ^ (x >> 16)
        };
        let index = scrambled(self.index.reverse_bits(), seed(0)).reverse_bits();
        [scrambled(index, seed(1)).reverse_bits(), scrambled(pascal(index), seed(2)).reverse_bits()]
    }

    /// 64 independent random bits.
    #[inline]
    pub fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mixed(self.state)
    }

    /// Two independent numbers, 32 bits each.
    #[inline]
    pub fn two(&mut self) -> [u32; 2] {
        let bits = self.next();
        [(bits >> 32) as u32, bits as u32]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_of_a_pixel_are_stratified_in_both_dimensions_and_together() {
        for (seed, pixel) in [(0, 0), (1, 77), (u64::MAX, 12345)] {
            for dimension in 0..3 {
                let pixel = Sampler::pixel(seed, pixel);
                let points: Vec<[u32; 2]> = (0..64).map(|k| Sampler::new(pixel, k).pair(dimension)).collect();
                for (columns, rows) in [(64, 1), (1, 64), (8, 8), (16, 4), (2, 32)] {
                    let cell = |p: &[u32; 2]| {
                        let at = |x: u32, n: u64| (u64::from(x) * n) >> 32;
                        at(p[0], columns) + columns * at(p[1], rows)
                    };
                    let mut cells: Vec<u64> = points.iter().map(cell).collect();
                    cells.sort_unstable();
                    cells.dedup();
                    assert_eq!(cells.len(), 64, "{columns} x {rows}");
                }
            }
        }
    }

    #[test]
    fn dimensions_pixels_and_seeds_are_independent() {
        let mean_product = |a: &dyn Fn(u32) -> u32, b: &dyn Fn(u32) -> u32| {
            let n = 4096;
            (0..n).map(|k| (f64::from(unit(a(k))) - 0.5) * (f64::from(unit(b(k))) - 0.5)).sum::<f64>() / f64::from(n)
        };
        let of = |seed: u64, pixel: u64, dimension: u32| {
            move |k: u32| Sampler::new(Sampler::pixel(seed, pixel), k).pair(dimension)[0]
        };
        // Standard deviation of a product of independent numbers: 1 / 12 / 64.
        for (a, b) in [((1, 2, 0), (1, 2, 1)), ((1, 2, 0), (1, 3, 0)), ((1, 2, 0), (2, 2, 0))] {
            let found = mean_product(&of(a.0, a.1, a.2), &of(b.0, b.1, b.2));
            assert!(found.abs() < 5.0 / 12.0 / 64.0, "{a:?} {b:?} {found}");
        }
        let independent = |k: u32| Sampler::new(Sampler::pixel(1, 2), k).two()[0];
        assert!(mean_product(&independent, &of(1, 2, 0)).abs() < 5.0 / 12.0 / 64.0);
        assert!((0..4096).map(|k| f64::from(unit(independent(k)))).sum::<f64>() / 4096.0 - 0.5 < 5.0 * 0.289 / 64.0);
    }
}
