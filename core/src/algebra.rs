//! The few pieces of small dense algebra that several chapters share: symmetric
//! eigenproblems that cannot fail to return, and triangular solves.

use nalgebra::allocator::Allocator;
use nalgebra::{Complex, DefaultAllocator, DimName, Matrix6, OMatrix, OVector, SMatrix, SVector};

/// Cyclic Jacobi sweeps; a 10 x 10 matrix is diagonal to rounding after six or seven.
const SWEEPS: usize = 24;

/// Eigenvalues (descending) and eigenvectors (columns) of a symmetric matrix.
///
/// Jacobi's rotations, because they find small eigenvalues of a graded matrix with
/// high relative accuracy, which a rank decision needs, and because they use nothing
/// but `+ - * /` and the square root, which round alike on every machine.
pub(crate) fn symmetric_eigen<D>(
    matrix: &OMatrix<f64, D, D>,
) -> (OVector<f64, D>, OMatrix<f64, D, D>)
where
    D: DimName,
    DefaultAllocator: Allocator<D, D> + Allocator<D>,
{
    let n = D::DIM;
    let mut a = matrix.clone();
    let mut v = OMatrix::<f64, D, D>::identity();
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for p in 0..n {
            for q in p + 1..n {
                let apq = a[(p, q)];
                // Negligible against the geometric mean of its diagonal partners.
                let scale = libm::sqrt((a[(p, p)] * a[(q, q)]).abs());
                if apq.abs() <= 1e-17 * scale || apq.abs() < f64::MIN_POSITIVE || apq.is_nan() {
                    continue;
                }
                rotated = true;
                rotate(&mut a, &mut v, p, q);
            }
        }
        if !rotated {
            break;
        }
    }
    sorted(&a, &v)
}

fn rotate<D>(a: &mut OMatrix<f64, D, D>, v: &mut OMatrix<f64, D, D>, p: usize, q: usize)
where
    D: DimName,
    DefaultAllocator: Allocator<D, D>,
{
    let n = D::DIM;
    let apq = a[(p, q)];
    let theta = (a[(q, q)] - a[(p, p)]) / (2.0 * apq);
    let t = {
        let t = 1.0 / (theta.abs() + libm::sqrt(theta * theta + 1.0));
        if theta < 0.0 { -t } else { t }
    };
    let c = 1.0 / libm::sqrt(t * t + 1.0);
    let s = t * c;
    a[(p, p)] -= t * apq;
    a[(q, q)] += t * apq;
    a[(p, q)] = 0.0;
    a[(q, p)] = 0.0;
    for k in 0..n {
        if k != p && k != q {
            let (akp, akq) = (a[(k, p)], a[(k, q)]);
            a[(k, p)] = c * akp - s * akq;
            a[(p, k)] = a[(k, p)];
            a[(k, q)] = s * akp + c * akq;
            a[(q, k)] = a[(k, q)];
        }
        let (vkp, vkq) = (v[(k, p)], v[(k, q)]);
        v[(k, p)] = c * vkp - s * vkq;
        v[(k, q)] = s * vkp + c * vkq;
    }
}

fn sorted<D>(
    a: &OMatrix<f64, D, D>,
    v: &OMatrix<f64, D, D>,
) -> (OVector<f64, D>, OMatrix<f64, D, D>)
where
    D: DimName,
    DefaultAllocator: Allocator<D, D> + Allocator<D>,
{
    let n = D::DIM;
    let mut values = a.diagonal();
    let mut vectors = v.clone();
    for i in 0..n {
        let mut largest = i;
        for j in i + 1..n {
            if values[j] > values[largest] {
                largest = j;
            }
        }
        if largest != i {
            values.swap_rows(i, largest);
            vectors.swap_columns(i, largest);
        }
    }
    (values, vectors)
}

/// Lower Cholesky factor of the leading `n` x `n` part, of which the lower triangle is
/// read. `None` if it is not positive definite.
pub(crate) fn lower<const N: usize>(
    matrix: &SMatrix<f64, N, N>,
    n: usize,
) -> Option<SMatrix<f64, N, N>> {
    let mut l = SMatrix::<f64, N, N>::zeros();
    for j in 0..n {
        for i in j..n {
            let mut sum = matrix[(i, j)];
            for k in 0..j {
                sum -= l[(i, k)] * l[(j, k)];
            }
            if i == j {
                if sum <= 0.0 || !sum.is_finite() {
                    return None;
                }
                l[(j, j)] = libm::sqrt(sum);
            } else {
                l[(i, j)] = sum / l[(j, j)];
            }
        }
    }
    Some(l)
}

/// Inverse of the leading `n` x `n` part of a lower factor.
pub(crate) fn inverse_lower<const N: usize>(
    l: &SMatrix<f64, N, N>,
    n: usize,
) -> SMatrix<f64, N, N> {
    let mut inverse = SMatrix::<f64, N, N>::zeros();
    for c in 0..n {
        for i in c..n {
            let mut sum = if i == c { 1.0 } else { 0.0 };
            for k in c..i {
                sum -= l[(i, k)] * inverse[(k, c)];
            }
            inverse[(i, c)] = sum / l[(i, i)];
        }
    }
    inverse
}

/// Solves the leading `n` equations of a positive definite system, of which the lower
/// triangle is read.
pub(crate) fn solve_positive<const N: usize>(
    matrix: &SMatrix<f64, N, N>,
    right: &SVector<f64, N>,
    n: usize,
) -> Option<SVector<f64, N>> {
    let l = lower(matrix, n)?;
    let mut x = SVector::<f64, N>::zeros();
    for i in 0..n {
        let mut sum = right[i];
        for k in 0..i {
            sum -= l[(i, k)] * x[k];
        }
        x[i] = sum / l[(i, i)];
    }
    for i in (0..n).rev() {
        let mut sum = x[i];
        for k in i + 1..n {
            sum -= l[(k, i)] * x[k];
        }
        x[i] = sum / l[(i, i)];
    }
    Some(x)
}

/// What the six channels `x` leave unexplained of the power of each of the six
/// channels `y`: `G_yy - G_yx G_xx⁻¹ G_xy` on the diagonal.
///
/// `explaining` is G_xx, `cross` is G_yx, `own` is G_yy. A channel x that depends on
/// those before it, to within rounding, is skipped.
pub(crate) fn incoherent_powers(
    explaining: &Matrix6<Complex<f64>>,
    cross: &Matrix6<Complex<f64>>,
    own: &Matrix6<Complex<f64>>,
) -> [f64; 6] {
    // A pivot this much below its diagonal is rounding, not signal: f32 spectra carry
    // relative errors of 1e-7, squared 1e-14, over thousands of terms.
    const DEPENDENT: f64 = 1e-10;
    let mut l = Matrix6::<Complex<f64>>::zeros();
    let mut d = [0.0; 6];
    for k in 0..6 {
        let full = explaining[(k, k)].re;
        let pivot = full - (0..k).map(|m| l[(k, m)].norm_sqr() * d[m]).sum::<f64>();
        if pivot <= DEPENDENT * full {
            continue;
        }
        d[k] = pivot;
        l[(k, k)] = Complex::new(1.0, 0.0);
        for i in k + 1..6 {
            let mut sum = explaining[(i, k)];
            for m in 0..k {
                sum -= l[(i, m)] * l[(k, m)].conj() * d[m];
            }
            l[(i, k)] = sum / pivot;
        }
    }
    core::array::from_fn(|j| {
        let mut left = own[(j, j)].re;
        let mut z = [Complex::new(0.0, 0.0); 6];
        for k in 0..6 {
            if d[k] > 0.0 {
                let mut sum = cross[(j, k)].conj();
                for m in 0..k {
                    sum -= l[(k, m)] * z[m];
                }
                z[k] = sum;
                left -= sum.norm_sqr() / d[k];
            }
        }
        left.max(0.0)
    })
}

/// `G = L D Lᴴ` of a Hermitian positive definite matrix in the leading rows and columns.
pub(crate) struct HermitianFactor {
    l: Matrix6<Complex<f64>>,
    d: [f64; 6],
    n: usize,
}

/// Factorises the leading `n` x `n` part. `None` if it is not positive definite to within
/// rounding.
pub(crate) fn factor_hermitian(g: &Matrix6<Complex<f64>>, n: usize) -> Option<HermitianFactor> {
    let mut l = Matrix6::<Complex<f64>>::identity();
    let mut d = [0.0; 6];
    for k in 0..n {
        let full = g[(k, k)].re;
        let pivot = full - (0..k).map(|m| l[(k, m)].norm_sqr() * d[m]).sum::<f64>();
        if pivot <= 1e-14 * full || !pivot.is_finite() {
            return None;
        }
        d[k] = pivot;
        for i in k + 1..n {
            let mut sum = g[(i, k)];
            for m in 0..k {
                sum -= l[(i, m)] * l[(k, m)].conj() * d[m];
            }
            l[(i, k)] = sum / pivot;
        }
    }
    Some(HermitianFactor { l, d, n })
}

impl HermitianFactor {
    /// `G⁻¹ B` in the leading rows; the others are zero.
    pub(crate) fn solve(&self, b: &Matrix6<Complex<f64>>) -> Matrix6<Complex<f64>> {
        let mut x = Matrix6::zeros();
        for c in 0..6 {
            for i in 0..self.n {
                let mut sum = b[(i, c)];
                for k in 0..i {
                    sum -= self.l[(i, k)] * x[(k, c)];
                }
                x[(i, c)] = sum;
            }
            for i in (0..self.n).rev() {
                let mut sum = x[(i, c)] / self.d[i];
                for k in i + 1..self.n {
                    sum -= self.l[(k, i)].conj() * x[(k, c)];
                }
                x[(i, c)] = sum;
            }
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hermitian_system_is_solved() {
        let random = |i: usize, j: usize| {
            let x = ((i * 7 + j * 13 + 3) % 11) as f64 - 5.0;
            let y = ((i * 5 + j * 3 + 1) % 7) as f64 - 3.0;
            Complex::new(x, y)
        };
        let a = Matrix6::from_fn(random) + Matrix6::identity() * Complex::new(9.0, 0.0);
        let g = a * a.adjoint();
        let b = Matrix6::from_fn(|i, j| random(j + 2, i));
        let x = factor_hermitian(&g, 6).unwrap().solve(&b);
        // Entries of order 100 with a condition of order 1e3.
        assert!((g * x - b).map(|z| z.norm_sqr()).sum() < 1e-20);
        assert!(factor_hermitian(&(g - g), 6).is_none());
    }

    #[test]
    fn what_is_explained_leaves_nothing() {
        let x = Matrix6::from_fn(|i, j| Complex::new((i + 2 * j) as f64 + 1.0, i as f64 - 3.0))
            + Matrix6::identity() * Complex::new(20.0, 0.0);
        let gxx = x * x.adjoint();
        let map = Matrix6::from_fn(|i, j| Complex::new(i as f64 - j as f64, 1.0));
        let (gyx, gyy) = (map * gxx, map * gxx * map.adjoint());
        let left = incoherent_powers(&gxx, &gyx, &gyy);
        for (j, left) in left.iter().enumerate() {
            assert!(left / gyy[(j, j)].re < 1e-12);
        }
    }
}
