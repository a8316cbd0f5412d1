//! Symmetric systems of equations whose unknowns have units of their own.

use nalgebra::{DMatrix, DVector};

/// Scales a matrix to a diagonal of ones, rows and columns alike. Gives the scales; zero where the
/// diagonal is.
pub(super) fn to_unit_diagonal(matrix: &mut DMatrix<f64>) -> DVector<f64> {
    let n = matrix.nrows();
    let scale = DVector::from_fn(n, |i, _| {
        let d = matrix[(i, i)];
        if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 }
    });
    for j in 0..n {
        for i in 0..n {
            matrix[(i, j)] *= scale[i] * scale[j];
        }
    }
    scale
}

/// Rows times their scales.
pub(super) fn scaled(mut matrix: DMatrix<f64>, scale: &DVector<f64>) -> DMatrix<f64> {
    for mut column in matrix.column_iter_mut() {
        column.component_mul_assign(scale);
    }
    matrix
}

/// Solution of `matrix X = right` for a positive semidefinite matrix, columns scaled alike;
/// `None` where numbers are not finite.
pub(super) fn solve_symmetric(
    mut matrix: DMatrix<f64>,
    right: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let n = matrix.nrows();
    let scale = to_unit_diagonal(&mut matrix);
    let right = scaled(right.clone(), &scale);
    // What rounding leaves of columns that depend on others, from little to much.
    let factor = [1e-12, 1e-11, 1e-10, 1e-9, 1e-8]
        .into_iter()
        .find_map(|ridge| {
            let mut raised = matrix.clone();
            for j in 0..n {
                raised[(j, j)] += ridge;
            }
            raised.cholesky()
        });
    let solved = scaled(factor?.solve(&right), &scale);
    solved.iter().all(|x| x.is_finite()).then_some(solved)
}
