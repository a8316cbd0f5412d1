//! Products and factors of complex 6 x 6 matrices.

use super::record::Complex6;
use nalgebra::{Complex, Matrix6};

type C = Complex<f64>;

/// The product of a complex matrix and a real one.
#[inline(always)]
pub(super) fn times_real(a: &Matrix6<C>, b: &Matrix6<f64>) -> Matrix6<C> {
    let mut product = Matrix6::<C>::zeros();
    for j in 0..6 {
        for l in 0..6 {
            let x = b[(l, j)];
            for i in 0..6 {
                product[(i, j)] += a[(i, l)] * x;
            }
        }
    }
    product
}

/// The product of a real matrix and a complex vector.
#[inline(always)]
pub(super) fn real_times(a: &Matrix6<f64>, x: &Complex6) -> Complex6 {
    let mut product = Complex6::zeros();
    for j in 0..6 {
        for i in 0..6 {
            product[i] += x[j] * a[(i, j)];
        }
    }
    product
}

/// The product with a lower triangular matrix.
#[inline(always)]
pub(super) fn lower_times(a: &Matrix6<C>, x: &Complex6) -> Complex6 {
    let mut product = Complex6::zeros();
    for j in 0..6 {
        for i in j..6 {
            product[i] += a[(i, j)] * x[j];
        }
    }
    product
}

/// The product with the adjoint of a lower triangular matrix.
#[inline(always)]
pub(super) fn upper_adjoint_times(a: &Matrix6<C>, x: &Complex6) -> Complex6 {
    Complex6::from_fn(|j, _| (j..6).map(|i| a[(i, j)].conj() * x[i]).sum())
}

/// The product with the adjoint of a matrix.
#[inline(always)]
pub(super) fn adjoint_times(a: &Matrix6<C>, x: &Complex6) -> Complex6 {
    Complex6::from_fn(|j, _| (0..6).map(|i| a[(i, j)].conj() * x[i]).sum())
}

/// G⁻¹ of a Hermitian matrix C = G G*, of which the lower triangle is read; `None` where C is not
/// positive definite.
#[inline(always)]
pub(super) fn inverse_factor(c: &Matrix6<C>) -> Option<Matrix6<C>> {
    let mut g = Matrix6::<C>::zeros();
    for j in 0..6 {
        let mut d = c[(j, j)].re;
        for l in 0..j {
            d -= g[(j, l)].norm_sqr();
        }
        if d.is_nan() || d <= 0.0 {
            return None;
        }
        let root = d.sqrt();
        g[(j, j)] = Complex::from(root);
        for i in j + 1..6 {
            let mut sum = c[(i, j)];
            for l in 0..j {
                sum -= g[(i, l)] * g[(j, l)].conj();
            }
            g[(i, j)] = sum / root;
        }
    }
    let mut inverse = Matrix6::<C>::zeros();
    for j in 0..6 {
        inverse[(j, j)] = Complex::from(1.0 / g[(j, j)].re);
        for i in j + 1..6 {
            let mut sum = Complex::new(0.0, 0.0);
            for l in j..i {
                sum -= g[(i, l)] * inverse[(l, j)];
            }
            inverse[(i, j)] = sum / g[(i, i)].re;
        }
    }
    Some(inverse)
}
