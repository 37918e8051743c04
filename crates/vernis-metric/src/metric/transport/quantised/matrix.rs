//! Small dense matrices, one a base axis.

use super::field::Field;

/// A small dense matrix.
#[derive(Debug, Clone)]
pub(super) struct Matrix {
    pub rows: usize,
    pub columns: usize,
    entries: Vec<f64>,
}

impl Matrix {
    /// `entry(row, column)`.
    pub fn new(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        Self { rows, columns, entries: (0..rows * columns).map(|k| entry(k / columns, k % columns)).collect() }
    }

    /// Lagrange interpolation from `coarse` equispaced nodes to `fine` ones with the same ends, through the nearest four.
    pub fn polynomials(fine: usize, coarse: usize) -> Self {
        let degree = coarse.min(4) - 1;
        let weight = |row: usize, column: usize| {
            let place = (row * (coarse - 1)) as f64 / (fine - 1) as f64;
            let first = (place as usize).saturating_sub(degree / 2).min(coarse - 1 - degree);
            let others = (first..=first + degree).filter(|&other| other != column);
            let factor = |other: usize| (place - other as f64) / (column as f64 - other as f64);
            if (first..=first + degree).contains(&column) { others.map(factor).product() } else { 0.0 }
        };
        Self::new(fine, coarse, weight)
    }

    #[cfg(test)]
    pub fn column_sum(&self, column: usize) -> f64 {
        self.entries.iter().skip(column).step_by(self.columns).sum()
    }

    pub fn transposed(&self) -> Self {
        Self::new(self.columns, self.rows, |row, column| self.entries[column * self.columns + row])
    }
}

/// Multiplies the three base axes of an array, base nodes x `columns`, by a matrix each.
pub(super) fn multiply(matrices: [&Matrix; 3], mut array: Vec<f64>, columns: usize) -> Field {
    let mut shape = matrices.map(|matrix| matrix.columns);
    for (axis, matrix) in matrices.into_iter().enumerate() {
        let inner = shape[axis + 1..].iter().product::<usize>() * columns;
        let outer: usize = shape[..axis].iter().product();
        let mut product = vec![0.0; outer * matrix.rows * inner];
        let blocks = array.chunks_exact(matrix.columns * inner).zip(product.chunks_exact_mut(matrix.rows * inner));
        for (from, to) in blocks {
            for (weights, to) in matrix.entries.chunks_exact(matrix.columns).zip(to.chunks_exact_mut(inner)) {
                for (&weight, from) in
                    weights.iter().zip(from.chunks_exact(inner)).filter(|(weight, _)| **weight != 0.0)
                {
                    from.iter().zip(&mut *to).for_each(|(from, to)| *to += weight * from);
                }
            }
        }
        array = product;
        shape[axis] = matrix.rows;
    }
    array.as_chunks().0.to_vec()
}
