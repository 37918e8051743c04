//! How different two pictures look to the simulated eye, and what an ideal observer would grade that.
//!
//! 1. Radiance is exposed, tone-mapped per channel x (1 + x/w^2)/(1 + x) (Reinhard et al. 2002, eq. 4,
//!    doi:10.1145/566654.566575, w = 4) and shown on a display of 0.5 to 200 cd/m^2.
//! 2. Display light becomes I, T = Ct/2, P = Cp in ITP units of one just noticeable difference (ITU-R BT.2100-2 table
//!    7; BT.2124-0: times 720).
//! 3. point: pixels are averaged over 3x3 neighbours (observers compare surfaces, not pixels), their Euclidean
//!    differences pooled by the third power; structure: 1 - mean of (2 cov + c)/(var + var + c) of I in 5x5 windows on
//!    two scales, c = 9; tint: difference of the mean T and P.
//! 4. D = sqrt(point^2 + (60 structure)^2 + (1.5 tint)^2); quality q = 5 - 4 D^k/(D^k + 17^k), k = 1.5.
//!
//! D is 0 for equal pictures, and q is then 5.

use super::studio::{Picture, SIDE};
use vernis_metric::math::Rgb;

/// A picture in ITP units; `None` outside the ball.
pub type Percept = Vec<Option<Rgb>>;

/// Exposure: a white diffuse ball under the studio's lights reaches about half of the display's range.
const EXPOSURE: f64 = 0.9;
const WHITE_POINT: f64 = 4.0;
/// Black and white of the display, cd/m^2.
const DISPLAY: (f64, f64) = (0.5, 200.0);

/// The difference in the middle of the scale, just noticeable differences.
const HALFWAY: f64 = 17.0;
/// k of the quality.
const STEEPNESS: f64 = 1.5;

/// What the eye makes of a picture.
pub fn perceive(picture: &Picture) -> Percept {
    picture.iter().map(|p| p.map(|rgb| itp(rgb.map(shown)))).collect()
}

/// Display luminance of a channel, cd/m^2.
fn shown(radiance: f64) -> f64 {
    let x = EXPOSURE * radiance;
    let mapped = (x * (1.0 + x / (WHITE_POINT * WHITE_POINT)) / (1.0 + x)).min(1.0);
    DISPLAY.0 + (DISPLAY.1 - DISPLAY.0) * mapped
}

/// ITP (in just noticeable differences) of display light with Rec. 709 primaries, cd/m^2.
fn itp(rgb: Rgb) -> Rgb {
    // ITU-R BT.2087-0, M2: Rec. 709 to Rec. 2020.
    const TO_2020: [Rgb; 3] = [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]];
    // ITU-R BT.2100-2, table 7, over 4096.
    const TO_LMS: [Rgb; 3] = [[1688.0, 2146.0, 262.0], [683.0, 2951.0, 462.0], [99.0, 309.0, 3688.0]];
    const TO_CT_CP: [Rgb; 2] = [[6610.0, -13613.0, 7003.0], [17933.0, -17390.0, -543.0]];
    let dot = |m: &Rgb, v: &Rgb| m[0] * v[0] + m[1] * v[1] + m[2] * v[2];
    let wide: Rgb = std::array::from_fn(|c| dot(&TO_2020[c], &rgb));
    let lms: Rgb = std::array::from_fn(|c| pq(dot(&TO_LMS[c], &wide) / 4096.0));
    let [ct, cp] = [0, 1].map(|k| dot(&TO_CT_CP[k], &lms) / 4096.0);
    [720.0 * 0.5 * (lms[0] + lms[1]), 720.0 * 0.5 * ct, 720.0 * cp]
}

/// The perceptual quantiser (SMPTE ST 2084) of a luminance in cd/m^2, 0 to 1.
fn pq(luminance: f64) -> f64 {
    let y = (luminance.max(0.0) / 10_000.0).powf(2610.0 / 16384.0);
    ((3424.0 / 4096.0 + 2413.0 / 128.0 * y) / (1.0 + 2392.0 / 128.0 * y)).powf(2523.0 / 32.0)
}

/// Parts of the perceived difference of two pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Just noticeable differences.
    pub point: f64,
    /// 0 to 2.
    pub structure: f64,
    /// Just noticeable differences.
    pub tint: f64,
}

impl Difference {
    /// The difference between two pictures of the same size.
    pub fn between(a: &Percept, b: &Percept) -> Self {
        let (a1, b1) = (halved(a), halved(b));
        let structure = 0.5 * (dissimilarity(a, b, SIDE) + dissimilarity(&a1, &b1, SIDE / 2));
        let (mean_a, mean_b) = (mean(a), mean(b));
        let tint = (mean_a[1] - mean_b[1]).hypot(mean_a[2] - mean_b[2]);
        Self { point: pooled_difference(a, b), structure, tint }
    }

    /// D, in about just noticeable differences.
    pub fn total(&self) -> f64 {
        (self.point.powi(2) + (60.0 * self.structure).powi(2) + (1.5 * self.tint).powi(2)).sqrt()
    }

    /// The grade of an ideal observer, 5 (no difference) towards 1.
    pub fn quality(&self) -> f64 {
        let d = (self.total() / HALFWAY).powf(STEEPNESS);
        5.0 - 4.0 * d / (d + 1.0)
    }
}

fn mean(percept: &Percept) -> Rgb {
    let n = percept.iter().flatten().count().max(1) as f64;
    let sum = percept.iter().flatten().fold([0.0; 3], |s, p| std::array::from_fn(|c| s[c] + p[c]));
    sum.map(|s: f64| s / n)
}

/// The pixels inside the ball among the `2 reach + 1` squared around pixel `k`, `k` itself first.
fn neighbours(side: usize, k: usize, reach: i64) -> impl Iterator<Item = usize> {
    let (row, column) = ((k / side) as i64, (k % side) as i64);
    let inside = move |x: i64| x >= 0 && x < side as i64;
    (-reach..=reach)
        .flat_map(move |dy| (-reach..=reach).map(move |dx| (row + dy, column + dx)))
        .filter(move |&(y, x)| inside(y) && inside(x))
        .map(move |(y, x)| (y as usize) * side + x as usize)
}

fn pooled_difference(a: &Percept, b: &Percept) -> f64 {
    let mut cubes = 0.0;
    let mut count = 0.0;
    for k in (0..a.len()).filter(|&k| a[k].is_some()) {
        let mut sum = [0.0; 3];
        let mut n = 0.0;
        for (p, q) in neighbours(SIDE, k, 1).filter_map(|j| a[j].zip(b[j])) {
            (0..3).for_each(|c| sum[c] += q[c] - p[c]);
            n += 1.0;
        }
        let length = (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]).sqrt() / n;
        cubes += length.powi(3);
        count += 1.0;
    }
    (cubes / f64::max(count, 1.0)).cbrt()
}

/// 1 - mean structural similarity of I in 5x5 windows of at least 9 pixels.
fn dissimilarity(a: &Percept, b: &Percept, side: usize) -> f64 {
    const C: f64 = 9.0;
    let mut sum = 0.0;
    let mut count = 0.0;
    for k in (0..a.len()).filter(|&k| a[k].is_some()) {
        let (mut n, mut sa, mut sb, mut saa, mut sbb, mut sab) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for (p, q) in neighbours(side, k, 2).filter_map(|j| a[j].zip(b[j])) {
            n += 1.0;
            sa += p[0];
            sb += q[0];
            saa += p[0] * p[0];
            sbb += q[0] * q[0];
            sab += p[0] * q[0];
        }
        if n < 9.0 {
            continue;
        }
        let cov = sab / n - sa * sb / (n * n);
        let (va, vb) = (saa / n - sa * sa / (n * n), sbb / n - sb * sb / (n * n));
        sum += 1.0 - (2.0 * cov + C) / (va + vb + C);
        count += 1.0;
    }
    sum / f64::max(count, 1.0)
}

/// Half the size: means of two by two pixels, where all four are inside.
fn halved(percept: &Percept) -> Percept {
    let half = SIDE / 2;
    (0..half * half)
        .map(|k| {
            let corner = 2 * (k / half) * SIDE + 2 * (k % half);
            let four = [corner, corner + 1, corner + SIDE, corner + SIDE + 1].map(|j| percept[j]);
            let sum = four.iter().try_fold([0.0; 3], |s: Rgb, p| p.map(|p| std::array::from_fn(|c| s[c] + p[c])));
            sum.map(|s| s.map(|x| 0.25 * x))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pq_meets_its_standard() {
        // SMPTE ST 2084: 10,000 cd/m^2 is 1; 100 cd/m^2 is 0.5081 (ITU-R BT.2408, table 1: 100 cd/m^2 at 50.8 %).
        assert!((pq(10_000.0) - 1.0).abs() < 1e-12);
        assert!((pq(100.0) - 0.5081).abs() < 1e-4);
    }

    #[test]
    fn grey_has_no_tint_and_equal_pictures_no_difference() {
        let [_, t, p] = itp([80.0; 3]);
        assert!(t.abs() < 0.1 && p.abs() < 0.1, "{t} {p}");
        let picture: Picture = (0..SIDE * SIDE).map(|k| Some([0.1 + (k % 7) as f64 * 0.05; 3])).collect();
        let percept = perceive(&picture);
        let d = Difference::between(&percept, &percept);
        assert_eq!((d.total(), d.quality()), (0.0, 5.0));
        let dimmer = perceive(&picture.iter().map(|p| p.map(|c| c.map(|x| 0.8 * x))).collect());
        let darker = perceive(&picture.iter().map(|p| p.map(|c| c.map(|x| 0.4 * x))).collect());
        assert!(Difference::between(&percept, &darker).total() > Difference::between(&percept, &dimmer).total());
    }
}
