//! The few pieces of small dense algebra that several chapters share: symmetric
//! eigenproblems that cannot fail to return, triangular solves, and products.
//!
//! A chip's stack is small, so they work in place: a matrix of ten is 800 bytes, and one
//! that is returned by value lies there twice.

use crate::cells::{Collection, Entries, EntriesMut, cells, seen};
use core::ops::IndexMut;
use nalgebra::allocator::Allocator;
use nalgebra::{Complex, DefaultAllocator, DimName, Matrix6, OMatrix, OVector, SMatrix};

/// Cyclic Jacobi sweeps; a 10 x 10 matrix is diagonal to rounding after six or seven.
const SWEEPS: usize = 24;

/// Eigenvalues (descending) of a symmetric matrix, which is used up, and its eigenvectors,
/// which become the columns of `vectors`.
///
/// Jacobi's rotations, because they find small eigenvalues of a graded matrix with
/// high relative accuracy, which a rank decision needs, and because they use nothing
/// but `+ - * /` and the square root, which round alike on every machine.
pub(crate) fn symmetric_eigen<D>(
    a: &mut OMatrix<f64, D, D>,
    vectors: &mut OMatrix<f64, D, D>,
) -> OVector<f64, D>
where
    D: DimName,
    DefaultAllocator: Allocator<D, D> + Allocator<D>,
{
    // Negligible to the last bit.
    const NEGLIGIBLE: f64 = 1e-17;
    vectors.fill_with_identity();
    diagonalize(a, Some(&mut *vectors), NEGLIGIBLE);
    sorted(a.diagonal(), Some(vectors))
}

/// Eigenvalues (descending) of a symmetric matrix, which is used up, to seven digits or more: a fifth of the
/// work that their vectors take as well.
pub(crate) fn symmetric_values<D>(a: &mut OMatrix<f64, D, D>) -> OVector<f64, D>
where
    D: DimName,
    DefaultAllocator: Allocator<D, D> + Allocator<D>,
{
    const NEGLIGIBLE: f64 = 1e-8;
    diagonalize(a, None, NEGLIGIBLE);
    sorted(a.diagonal(), None)
}

/// Rotates until entries beside the diagonal are `negligible` against the geometric mean of their
/// diagonal partners.
#[inline(never)] // Once in the flash for each size.
fn diagonalize<D>(
    a: &mut OMatrix<f64, D, D>,
    mut vectors: Option<&mut OMatrix<f64, D, D>>,
    negligible: f64,
) where
    D: DimName,
    DefaultAllocator: Allocator<D, D>,
{
    let n = D::DIM;
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for p in 0..n {
            for q in p + 1..n {
                let (apq, app, aqq) = (a[(p, q)].abs(), a[(p, p)].abs(), a[(q, q)].abs());
                if apq < f64::MIN_POSITIVE || apq.is_nan() {
                    continue;
                }
                // A root is only taken where the mean decides.
                let (least, most) = (negligible * app.min(aqq), negligible * app.max(aqq));
                if apq <= least || (apq <= most && apq <= negligible * libm::sqrt(app * aqq)) {
                    continue;
                }
                rotated = true;
                rotate(a, vectors.as_deref_mut(), p, q);
            }
        }
        if !rotated {
            break;
        }
    }
}

fn rotate<D>(a: &mut OMatrix<f64, D, D>, v: Option<&mut OMatrix<f64, D, D>>, p: usize, q: usize)
where
    D: DimName,
    DefaultAllocator: Allocator<D, D>,
{
    /// Angles whose cosine is one to the last bit.
    const SMALL: f64 = 1.0 / (1 << 27) as f64;
    let n = D::DIM;
    let a = &mut cells(a);
    let apq = a[(p, q)];
    let theta = (a[(q, q)] - a[(p, p)]) / (2.0 * apq);
    let t = {
        let t = 1.0 / (theta.abs() + libm::sqrt(theta * theta + 1.0));
        if theta < 0.0 { -t } else { t }
    };
    let c = if t.abs() < SMALL {
        1.0
    } else {
        1.0 / libm::sqrt(t * t + 1.0)
    };
    let s = t * c;
    let turned = |x: f64, y: f64| {
        if c == 1.0 {
            (x - s * y, s * x + y)
        } else {
            (c * x - s * y, s * x + c * y)
        }
    };
    a[(p, p)] -= t * apq;
    a[(q, q)] += t * apq;
    a[(p, q)] = 0.0;
    a[(q, p)] = 0.0;
    for k in 0..n {
        if k != p && k != q {
            (a[(k, p)], a[(k, q)]) = turned(a[(k, p)], a[(k, q)]);
            a[(p, k)] = a[(k, p)];
            a[(q, k)] = a[(k, q)];
        }
    }
    if let Some(v) = v {
        let v = &mut cells(v);
        for k in 0..n {
            (v[(k, p)], v[(k, q)]) = turned(v[(k, p)], v[(k, q)]);
        }
    }
}

fn sorted<D>(
    mut values: OVector<f64, D>,
    mut vectors: Option<&mut OMatrix<f64, D, D>>,
) -> OVector<f64, D>
where
    D: DimName,
    DefaultAllocator: Allocator<D, D> + Allocator<D>,
{
    let n = D::DIM;
    for i in 0..n {
        let mut largest = i;
        for j in i + 1..n {
            if seen(&values)[j] > seen(&values)[largest] {
                largest = j;
            }
        }
        if largest != i {
            values.swap_rows(i, largest);
            if let Some(vectors) = &mut vectors {
                vectors.swap_columns(i, largest);
            }
        }
    }
    values
}

/// Replaces the leading `n` x `n` part, of which the lower triangle is read, by its lower
/// Cholesky factor, and all else by zero. `None` if it is not positive definite.
pub(crate) fn lower<const N: usize>(matrix: &mut SMatrix<f64, N, N>, n: usize) -> Option<()> {
    let matrix = &mut cells(matrix);
    factor(matrix, n)?;
    for j in 0..N {
        for i in 0..N {
            if i < j || i >= n {
                matrix[(i, j)] = 0.0;
            }
        }
    }
    Some(())
}

/// Cholesky's factorisation in place. An entry is read just before it is overwritten.
fn factor<M>(m: &mut M, n: usize) -> Option<()>
where
    M: IndexMut<(usize, usize), Output = f64>,
{
    for j in 0..n {
        for i in j..n {
            let mut sum = m[(i, j)];
            for k in 0..j {
                sum -= m[(i, k)] * m[(j, k)];
            }
            if i == j {
                if sum <= 0.0 || !sum.is_finite() {
                    return None;
                }
                m[(j, j)] = libm::sqrt(sum);
            } else {
                m[(i, j)] = sum / m[(j, j)];
            }
        }
    }
    Some(())
}

/// Replaces the leading `n` x `n` part of a lower factor by its inverse.
pub(crate) fn inverse_lower<const N: usize>(l: &mut SMatrix<f64, N, N>, n: usize) {
    let l = &mut cells(l);
    // Column after column: those that are still needed lie to the right.
    for c in 0..n {
        for i in c..n {
            let mut sum = if i == c { 1.0 } else { 0.0 };
            for k in c..i {
                sum -= l[(i, k)] * l[(k, c)];
            }
            l[(i, c)] = sum / l[(i, i)];
        }
    }
}

/// A lower triangle, row after row: half the memory of a square. `LEN` is
/// [`triangle_len`] of its rows.
#[derive(Clone, Debug)]
pub(crate) struct Triangle<const LEN: usize>([f64; LEN]);

/// Elements of a triangle of `rows` rows.
pub(crate) const fn triangle_len(rows: usize) -> usize {
    rows * (rows + 1) / 2
}

impl<const LEN: usize> Triangle<LEN> {
    /// All zero.
    pub(crate) const ZERO: Self = Self([0.0; LEN]);

    /// All entries, row after row.
    pub(crate) fn entries_mut(&mut self) -> &mut [f64] {
        &mut self.0
    }

    /// Takes the entries from numbers of single precision in the same order.
    pub(crate) fn copy_from(&mut self, entries: &[f32]) {
        for (own, entry) in self.0.iter_mut().zip(entries) {
            *own = f64::from(*entry);
        }
    }

    /// Makes it all zero.
    pub(crate) fn clear(&mut self) {
        self.0.fill(0.0);
    }

    /// A row up to the diagonal.
    #[inline]
    pub(crate) fn row(&self, i: usize) -> &[f64] {
        let from = self.0.get(triangle_len(i)..).unwrap_or_default();
        from.get(..=i).unwrap_or_default()
    }

    /// Row and column, the column not past the row.
    #[inline]
    pub(crate) fn get(&self, i: usize, j: usize) -> Option<&f64> {
        self.0.get(triangle_len(i) + j)
    }

    /// The same, to be changed.
    #[inline]
    pub(crate) fn get_mut(&mut self, i: usize, j: usize) -> Option<&mut f64> {
        self.0.get_mut(triangle_len(i) + j)
    }
}

impl<const LEN: usize> Collection for Triangle<LEN> {
    type Entry = f64;
}

impl<const LEN: usize> Entries<(usize, usize)> for Triangle<LEN> {
    #[inline]
    fn entry(&self, (i, j): (usize, usize)) -> Option<&f64> {
        self.get(i, j)
    }
}

impl<const LEN: usize> EntriesMut<(usize, usize)> for Triangle<LEN> {
    #[inline]
    fn entry_mut(&mut self, (i, j): (usize, usize)) -> Option<&mut f64> {
        self.get_mut(i, j)
    }
}

/// Solves the leading `n` equations of a positive definite system, whose matrix is replaced
/// by its factor, and whose right-hand side by the solution.
pub(crate) fn solve_positive<const LEN: usize>(
    l: &mut Triangle<LEN>,
    x: &mut [f64],
    n: usize,
) -> Option<()> {
    let (l, x) = (&mut cells(l), &mut cells(x));
    factor(l, n)?;
    for i in 0..n {
        let mut sum = x[i];
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
    Some(())
}

/// Replaces `m` by `left m`.
pub(crate) fn multiply_left<const N: usize>(left: &SMatrix<f64, N, N>, m: &mut SMatrix<f64, N, N>) {
    let left = seen(left);
    for j in 0..N {
        let column: [f64; N] = core::array::from_fn(|k| m[(k, j)]);
        for i in 0..N {
            m[(i, j)] = product(|k| left[(i, k)], &column);
        }
    }
}

/// Replaces `m` by `m right`.
pub(crate) fn multiply_right<const N: usize>(
    m: &mut SMatrix<f64, N, N>,
    right: &SMatrix<f64, N, N>,
) {
    let right = seen(right);
    for i in 0..N {
        let row: [f64; N] = core::array::from_fn(|k| m[(i, k)]);
        for j in 0..N {
            m[(i, j)] = product(|k| right[(k, j)], &row);
        }
    }
}

/// A sum of squares from which more was taken than rounding leaves is zero. What is no number
/// stays none: `f64::max` would make a perfect zero of it.
pub(crate) fn not_negative(x: f64) -> f64 {
    if x < 0.0 { 0.0 } else { x }
}

/// The larger of two; no number if either is none, of which `f64::max` would take the other.
pub(crate) fn larger(x: f64, y: f64) -> f64 {
    if x.is_nan() || x > y { x } else { y }
}

/// `Σ x y` in the order in which products of matrices are summed elsewhere.
pub(crate) fn product(x: impl Fn(usize) -> f64, y: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (k, y) in y.iter().enumerate() {
        let x = x(k);
        // Half of a triangular factor is zero, and a product with it costs as much as any other.
        if x != 0.0 {
            sum += x * y;
        }
    }
    sum
}

/// Second moments of the six channels `y` that the six channels `x` leave unexplained: the
/// real part of `G_yy - G_yx G_xx⁻¹ G_xy`.
///
/// `explaining` is G_xx, `cross` is G_yx, `own` is G_yy. A channel x that depends on
/// those before it, to within rounding, is skipped.
pub(crate) fn incoherent(
    explaining: &Matrix6<Complex<f64>>,
    cross: &Matrix6<Complex<f64>>,
    own: &Matrix6<Complex<f64>>,
) -> Matrix6<f64> {
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
    // Column j: L⁻¹ G_xy of channel y_j.
    let mut z = Matrix6::<Complex<f64>>::zeros();
    for j in 0..6 {
        for k in 0..6 {
            if d[k] > 0.0 {
                let mut sum = cross[(j, k)].conj();
                for m in 0..k {
                    sum -= l[(k, m)] * z[(m, j)];
                }
                z[(k, j)] = sum;
            }
        }
    }
    let mut left = own.map(|z| z.re);
    for i in 0..6 {
        for j in 0..6 {
            for k in 0..6 {
                if d[k] > 0.0 {
                    left[(i, j)] -= (z[(k, i)].conj() * z[(k, j)]).re / d[k];
                }
            }
        }
        left[(i, i)] = not_negative(left[(i, i)]);
    }
    left
}

/// A factor F of a symmetric matrix without negative directions, `F Fᵀ = C`: Cholesky's, with
/// a column of zeros where nothing but rounding is left.
pub(crate) fn half(c: &Matrix6<f64>) -> Matrix6<f64> {
    const NOTHING: f64 = 1e-13;
    let mut factor = Matrix6::zeros();
    let (c, l) = (seen(c), &mut cells(&mut factor));
    for j in 0..6 {
        let full = c[(j, j)];
        let mut pivot = full;
        for k in 0..j {
            pivot -= l[(j, k)] * l[(j, k)];
        }
        if pivot.is_nan() || pivot <= NOTHING * full || pivot.is_infinite() {
            continue;
        }
        let root = libm::sqrt(pivot);
        l[(j, j)] = root;
        for i in j + 1..6 {
            let mut sum = c[(i, j)];
            for k in 0..j {
                sum -= l[(i, k)] * l[(j, k)];
            }
            l[(i, j)] = sum / root;
        }
    }
    factor
}

/// Replaces the leading `n` x `n` part of a Hermitian positive definite matrix, of which
/// the lower triangle is read, by its factors `G = L D Lᴴ`: D on the diagonal, L below it.
/// `None` if it is not positive definite to within rounding.
pub(crate) fn factor_hermitian(g: &mut Matrix6<Complex<f64>>, n: usize) -> Option<()> {
    let g = &mut cells(g);
    for k in 0..n {
        let full = g[(k, k)].re;
        let explained = (0..k).map(|m| g[(k, m)].norm_sqr() * g[(m, m)].re);
        let pivot = full - explained.sum::<f64>();
        if pivot <= 1e-14 * full || !pivot.is_finite() {
            return None;
        }
        g[(k, k)] = Complex::new(pivot, 0.0);
        for i in k + 1..n {
            let mut sum = g[(i, k)];
            for m in 0..k {
                sum -= g[(i, m)] * g[(k, m)].conj() * g[(m, m)].re;
            }
            g[(i, k)] = sum / pivot;
        }
    }
    Some(())
}

/// Replaces `b` by `G⁻¹ B` in the leading `n` rows, and by zero in the others, where
/// `factors` are those of G.
pub(crate) fn solve_hermitian(
    factors: &Matrix6<Complex<f64>>,
    n: usize,
    b: &mut Matrix6<Complex<f64>>,
) {
    let (factors, b) = (seen(factors), &mut cells(b));
    for c in 0..6 {
        for i in 0..n {
            let mut sum = b[(i, c)];
            for k in 0..i {
                sum -= factors[(i, k)] * b[(k, c)];
            }
            b[(i, c)] = sum;
        }
        for i in (0..n).rev() {
            let mut sum = b[(i, c)] / factors[(i, i)].re;
            for k in i + 1..n {
                sum -= factors[(k, i)].conj() * b[(k, c)];
            }
            b[(i, c)] = sum;
        }
        for i in n..6 {
            b[(i, c)] = Complex::new(0.0, 0.0);
        }
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
        let (mut factors, mut x) = (g, b);
        factor_hermitian(&mut factors, 6).unwrap();
        solve_hermitian(&factors, 6, &mut x);
        // Entries of order 100 with a condition of order 1e3.
        assert!((g * x - b).map(|z| z.norm_sqr()).sum() < 1e-20);
        assert!(factor_hermitian(&mut (g - g), 6).is_none());
    }

    #[test]
    fn products_in_place_are_products() {
        let matrix = |seed: usize| {
            SMatrix::<f64, 10, 10>::from_fn(|i, j| {
                ((i * 17 + j * 29 + seed) % 23) as f64 / 7.0 - 1.5
            })
        };
        let (a, b) = (matrix(3), matrix(8));
        let (mut left, mut right) = (b, a);
        multiply_left(&a, &mut left);
        multiply_right(&mut right, &b);
        // To the last bit: results must not depend on which of them is used.
        assert_eq!(left, a * b);
        assert_eq!(right, a * b);
    }

    #[test]
    fn a_positive_system_is_solved_in_its_leading_part() {
        const ROWS: usize = 5;
        let b = SMatrix::<f64, ROWS, ROWS>::from_fn(|i, j| ((i * 5 + j * 3) % 7) as f64 - 3.0);
        let g = b * b.transpose() + SMatrix::identity() * 9.0;
        let mut triangle = Triangle::<{ triangle_len(ROWS) }>::ZERO;
        for i in 0..ROWS {
            for j in 0..=i {
                cells(&mut triangle)[(i, j)] = g[(i, j)];
            }
        }
        let mut x = [1.0, -2.0, 3.0, 40.0, 50.0];
        solve_positive(&mut triangle, &mut x, 3).unwrap();
        for (i, right) in [1.0, -2.0, 3.0].into_iter().enumerate() {
            let left: f64 = (0..3).map(|j| g[(i, j)] * x[j]).sum();
            // Numbers of order ten, a few dozen roundings.
            assert!((left - right).abs() < 1e-13);
        }
        assert_eq!(x[3..], [40.0, 50.0]);
        let mut inverse = g;
        lower(&mut inverse, 3).unwrap();
        let l = inverse;
        inverse_lower(&mut inverse, 3);
        let back = (l * inverse).fixed_view::<3, 3>(0, 0).into_owned();
        assert!((back - SMatrix::identity()).norm() < 1e-14);
        assert_eq!(
            inverse.rows(3, 2).norm() + inverse.columns(3, 2).norm(),
            0.0
        );
        assert!(lower(&mut (g - g), 3).is_none());
    }

    #[test]
    fn what_is_explained_leaves_nothing() {
        let x = Matrix6::from_fn(|i, j| Complex::new((i + 2 * j) as f64 + 1.0, i as f64 - 3.0))
            + Matrix6::identity() * Complex::new(20.0, 0.0);
        let gxx = x * x.adjoint();
        let map = Matrix6::from_fn(|i, j| Complex::new(i as f64 - j as f64, 1.0));
        let (gyx, gyy) = (map * gxx, map * gxx * map.adjoint());
        let left = incoherent(&gxx, &gyx, &gyy);
        for j in 0..6 {
            assert!(left[(j, j)] / gyy[(j, j)].re < 1e-12);
        }
    }

    #[test]
    fn independent_noise_is_what_the_others_do_not_explain() {
        let x = Matrix6::from_fn(|i, j| Complex::new((i + 2 * j) as f64 + 1.0, i as f64 - 3.0))
            + Matrix6::identity() * Complex::new(20.0, 0.0);
        let gxx = x * x.adjoint();
        let map = Matrix6::from_fn(|i, j| Complex::new(i as f64 - j as f64, 1.0));
        let noise = Matrix6::from_fn(|i, j| if i == j { 3.0 } else { 1.0 });
        let (gyx, mut gyy) = (map * gxx, map * gxx * map.adjoint());
        gyy += noise.map(|x| Complex::new(x, 0.0));
        let left = incoherent(&gxx, &gyx, &gyy);
        // Powers of 1e6, of which a few units are left.
        assert!((left - noise).norm() < 1e-6, "{left}");
        let factor = half(&noise);
        assert!((factor * factor.transpose() - noise).norm() < 1e-14);
    }
}
