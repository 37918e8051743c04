//! Functions on the unit square given at the nodes of a regular grid, bilinear between them, and the marginal-conditional
//! warp that flattens a density.
//!
//! For a density p(u, v) the warp takes (u, v) to
//!
//!   x = ∫_0^u p(t, v) dt / ∫_0^1 p(t, v) dt,   y = ∫_0^v ∫_0^1 p(t, s) dt ds / ∫∫ p,
//!
//! which is uniform on the unit square where (u, v) follows p: the way back of drawing a row by the marginal density and then
//! a place in it by the conditional one. p is bilinear, so both integrals are exact sums of quadratics.
//!
//! Source: Dupuy & Jakob 2018, section 4, doi:10.1145/3272127.3275059.
//! Cost: two look-ups a node of a patch.

/// Values at the nodes of a grid, u along a row and rows along v.
#[derive(Debug, Clone)]
pub struct Bilinear {
    columns: usize,
    rows: usize,
    values: Vec<f64>,
}

/// Where a point lies on a grid: the node below it along both axes and how far it is from there, 0 to 1.
struct Patch {
    column: usize,
    row: usize,
    s: f64,
    t: f64,
}

impl Patch {
    fn of(columns: usize, rows: usize, u: f64, v: f64) -> Self {
        let along = |x: f64, nodes: usize| {
            let x = x.clamp(0.0, 1.0) * (nodes - 1) as f64;
            let node = (x as usize).min(nodes - 2);
            (node, x - node as f64)
        };
        let ((column, s), (row, t)) = (along(u, columns), along(v, rows));
        Self { column, row, s, t }
    }
}

fn mix(t: f64, a: f64, b: f64) -> f64 {
    (1.0 - t) * a + t * b
}

impl Bilinear {
    /// Of `rows` times `columns` values, at least two of each.
    pub fn new(columns: usize, rows: usize, values: Vec<f64>) -> Self {
        debug_assert!(columns >= 2 && rows >= 2 && values.len() == columns * rows);
        Self { columns, rows, values }
    }

    /// The value at a point of the unit square; points beside it count as on its edge.
    pub fn at(&self, u: f64, v: f64) -> f64 {
        let Patch { column, row, s, t } = Patch::of(self.columns, self.rows, u, v);
        let near = row * self.columns + column;
        let far = near + self.columns;
        let at = |k: usize| mix(s, self.values[k], self.values[k + 1]);
        mix(t, at(near), at(far))
    }

    /// The mean of two functions on one grid.
    pub fn mean(&self, weight: f64, other: &Self) -> Self {
        let values = self.values.iter().zip(&other.values).map(|(a, b)| mix(weight, *a, *b)).collect();
        Self { values, ..*self }
    }
}

/// A density and its integrals, in units of patches.
#[derive(Debug, Clone)]
pub struct Density {
    /// Scaled so that its integral is 1.
    density: Bilinear,
    /// At each node, the integral of its row from the beginning.
    conditional: Vec<f64>,
    /// Of each row, the integral over all rows before.
    marginal: Vec<f64>,
}

impl Density {
    /// `None` for a density whose integral is zero or too large for a number.
    pub fn new(mut density: Bilinear) -> Option<Self> {
        let columns = density.columns;
        let mut conditional = Vec::with_capacity(density.values.len());
        let mut marginal = vec![0.0];
        for (row, values) in density.values.chunks(columns).enumerate() {
            let mut sum = 0.0;
            conditional.push(sum);
            for pair in values.windows(2) {
                sum += 0.5 * (pair[0] + pair[1]);
                conditional.push(sum);
            }
            if row > 0 {
                let before = conditional[row * columns - 1];
                marginal.push(marginal[row - 1] + 0.5 * (before + sum));
            }
        }
        let total = marginal[density.rows - 1];
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        for values in [&mut density.values, &mut conditional, &mut marginal] {
            values.iter_mut().for_each(|v| *v /= total);
        }
        Some(Self { density, conditional, marginal })
    }

    /// The mean of two densities on one grid.
    pub fn mean(&self, weight: f64, other: &Self) -> Self {
        let mean = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| mix(weight, *a, *b)).collect();
        Self {
            density: self.density.mean(weight, &other.density),
            conditional: mean(&self.conditional, &other.conditional),
            marginal: mean(&self.marginal, &other.marginal),
        }
    }
}

/// Where the warp of the density (1 - `weight`) `a` + `weight` `b` takes a point of the unit square; `None` on rows where the
/// density is zero, which nothing is drawn from.
pub fn flattened(weight: f64, a: &Density, b: &Density, u: f64, v: f64) -> Option<[f64; 2]> {
    let (columns, rows) = (a.density.columns, a.density.rows);
    let Patch { column, row, s, t } = Patch::of(columns, rows, u, v);
    let density = |k: usize| mix(weight, a.density.values[k], b.density.values[k]);
    let conditional = |k: usize| mix(weight, a.conditional[k], b.conditional[k]);
    let (near, far) = (row * columns + column, (row + 1) * columns + column);
    let (p0, p1) = (mix(t, density(near), density(far)), mix(t, density(near + 1), density(far + 1)));
    let before = mix(t, conditional(near), conditional(far));
    let (row0, row1) = (conditional((row + 1) * columns - 1), conditional((row + 2) * columns - 1));
    let whole = mix(t, row0, row1);
    if whole <= 0.0 {
        return None;
    }
    let x = (before + s * (p0 + 0.5 * s * (p1 - p0))) / whole;
    let y = mix(weight, a.marginal[row], b.marginal[row]) + t * (row0 + 0.5 * t * (row1 - row0));
    Some([x, y])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bumpy(columns: usize, rows: usize, phase: f64) -> Bilinear {
        let value = |k: usize| {
            let (i, j) = ((k % columns) as f64, (k / columns) as f64);
            1.2 + (1.7 * i + phase).sin() * (0.9 * j).cos()
        };
        Bilinear::new(columns, rows, (0..columns * rows).map(value).collect())
    }

    #[test]
    fn a_bilinear_function_is_met_between_its_nodes() {
        let values = (0..3 * 4).map(|k| f64::from(k % 3) + 10.0 * f64::from(k / 3)).collect();
        let plane = Bilinear::new(3, 4, values);
        for (u, v) in [(0.0, 0.0), (0.3, 0.9), (1.0, 1.0), (0.5, 1.0 / 3.0)] {
            assert!((plane.at(u, v) - (2.0 * u + 30.0 * v)).abs() < 1e-12);
        }
        assert_eq!(plane.at(-1.0, 2.0), plane.at(0.0, 1.0));
    }

    /// Against sums over many small cells.
    #[test]
    fn the_warp_is_the_pair_of_integrals() {
        let pair = [bumpy(7, 5, 0.0), bumpy(7, 5, 2.0)];
        let densities = pair.clone().map(|p| Density::new(p).expect("positive"));
        // Each is normalised alone, and then they are mixed.
        let total = pair.clone().map(|p| 24.0 * integral(|u, v| p.at(u, v), 1.0, 1.0));
        let p = |u: f64, v: f64| mix(0.3, pair[0].at(u, v) / total[0], pair[1].at(u, v) / total[1]);
        for (u, v) in [(0.11, 0.23), (0.5, 0.75), (0.97, 0.02), (1.0, 1.0)] {
            let [x, y] = flattened(0.3, &densities[0], &densities[1], u, v).expect("positive");
            let row = |end: f64| (0..4000).map(|k| p((f64::from(k) + 0.5) / 4000.0 * end, v)).sum::<f64>() * end;
            assert!((x - row(u) / row(1.0)).abs() < 1e-6, "{x}");
            assert!((y - integral(p, 1.0, v) / integral(p, 1.0, 1.0)).abs() < 1e-6, "{y}");
        }
        let mean = densities[0].mean(0.3, &densities[1]);
        let [a, b] = [flattened(0.3, &densities[0], &densities[1], 0.4, 0.6), flattened(0.7, &mean, &mean, 0.4, 0.6)];
        let (a, b) = (a.expect("positive"), b.expect("positive"));
        assert!((a[0] - b[0]).abs() < 1e-14 && (a[1] - b[1]).abs() < 1e-14);
    }

    fn integral(p: impl Fn(f64, f64) -> f64, u: f64, v: f64) -> f64 {
        let n = 1200;
        let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
        let sum: f64 = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).map(|(i, j)| p(u * at(i), v * at(j))).sum();
        sum * u * v / f64::from(n * n)
    }

    #[test]
    fn nothing_is_drawn_where_the_density_is_zero() {
        assert!(Density::new(Bilinear::new(2, 2, vec![0.0; 4])).is_none());
        assert!(Density::new(Bilinear::new(2, 2, vec![f64::MAX; 4])).is_none());
        let half = Density::new(Bilinear::new(2, 3, vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0])).expect("positive");
        assert_eq!(flattened(0.0, &half, &half, 0.5, 0.2), None);
        assert!(flattened(0.0, &half, &half, 0.5, 0.7).is_some());
    }
}
