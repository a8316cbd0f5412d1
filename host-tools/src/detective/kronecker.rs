//! Kronecker products with a unit matrix: six accelerations or resultants, each along the same motions.

use nalgebra::DMatrix;

/// Adds the lower triangle of `a aᵀ ⊗ c`, and perhaps some of the upper one, to a matrix.
pub(super) fn add_lower(into: &mut DMatrix<f64>, a: &[f64], c: &DMatrix<f64>) {
    let (rows, size) = (into.nrows(), c.nrows());
    if rows * size == 0 {
        return;
    }
    let columns = into.as_mut_slice().chunks_exact_mut(rows * size);
    for (j, columns) in columns.take(a.len()).enumerate() {
        for (column, c) in (columns.chunks_exact_mut(rows)).zip(c.as_slice().chunks_exact(size)) {
            add_scaled(&mut column[j * size..], &a[j..], a[j], c);
        }
    }
}

/// Adds `y a ⊗ c` to a column.
fn add_scaled(column: &mut [f64], a: &[f64], y: f64, c: &[f64]) {
    for (block, x) in column.chunks_exact_mut(c.len()).zip(a) {
        let weight = x * y;
        if weight != 0.0 {
            for (sum, c) in block.iter_mut().zip(c) {
                *sum += weight * c;
            }
        }
    }
}

/// `(m ⊗ 1) v (m ⊗ 1)ᵀ` with a unit matrix of this size.
pub(super) fn congruent(m: &DMatrix<f64>, v: &DMatrix<f64>, size: usize) -> DMatrix<f64> {
    let rows = m.nrows() * size;
    let mut half = DMatrix::<f64>::zeros(rows, v.ncols());
    for (c, mut column) in half.column_iter_mut().enumerate() {
        let from = v.column(c);
        for (m, from) in m
            .column_iter()
            .zip(from.as_slice().chunks_exact(size.max(1)))
        {
            add_scaled(column.as_mut_slice(), m.as_slice(), 1.0, from);
        }
    }
    let mut product = DMatrix::<f64>::zeros(rows, rows);
    for (m, from) in (m.column_iter()).zip(half.as_slice().chunks_exact((rows * size).max(1))) {
        add_scaled(product.as_mut_slice(), m.as_slice(), 1.0, from);
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    fn drawn(rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |i, j| {
            ((7 * i + 3 * j * j + i * j) as f64).sin()
        })
    }

    #[test]
    fn products_are_those_of_the_whole_matrices() {
        for (rows, columns, size) in [(6, 6, 6), (4, 6, 2), (1, 3, 5), (6, 2, 1), (2, 3, 0)] {
            let m = drawn(rows, columns);
            let v = drawn(columns * size, columns * size);
            let wide = m.kronecker(&DMatrix::identity(size, size));
            let expected = &wide * &v * wide.transpose();
            // Rounding of sums of 36 numbers of up to one.
            assert!((congruent(&m, &v, size) - expected).norm() < 1e-13);

            let a = DVector::from_fn(rows, |i, _| (i as f64).cos());
            let c = drawn(size, size);
            let mut sum = drawn(rows * size, rows * size);
            let expected = &sum + (&a * a.transpose()).kronecker(&c);
            add_lower(&mut sum, a.as_slice(), &c);
            assert!((sum - expected).lower_triangle().norm() < 1e-14);
        }
    }
}
