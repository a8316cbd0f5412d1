//! Sums over lines that a regression of forces on accelerations is solved from.

use crate::algebra::{Triangle, multiply_right, triangle_len};
use crate::cells::{cells, seen};
use crate::geometry::transfer;
use crate::masslines::Moments;
use crate::masslines::driven::{Columns, Functions, MAX_TERMS, Whole};
use core::ops::{AddAssign, Mul};
use nalgebra::{ArrayStorage, Complex, Matrix6, SMatrix, Scalar, Vector3};

/// Accelerations times the functions of all terms.
pub(in crate::masslines) const SIZE: usize = 6 * MAX_TERMS;

pub(super) type Normal = Triangle<{ triangle_len(SIZE) }>;
pub(super) type Right = SMatrix<f64, SIZE, 6>;

const NO_MATRIX: Matrix6<f64> = Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6]));
pub(super) const NO_RIGHT: Right = Right::from_array_storage(ArrayStorage([[0.0; SIZE]; 6]));

/// Sums over all lines of the products of accelerations times functions, and of forces.
#[derive(Clone, Debug)]
pub(super) struct Sums {
    terms: usize,
    /// Of accelerations with each other.
    pub(super) normal: Normal,
    /// Of accelerations with forces.
    pub(super) right: Right,
    /// Of forces with each other.
    pub(super) power: Matrix6<f64>,
    /// Real equations per row of f.
    pub(super) count: f64,
}

impl Sums {
    /// A place for some, all zero.
    pub(super) const EMPTY: Self = Self {
        terms: 0,
        normal: Normal::ZERO,
        right: NO_RIGHT,
        power: NO_MATRIX,
        count: 0.0,
    };

    /// Begins those of so many terms.
    pub(super) fn begin(&mut self, terms: usize) {
        self.terms = terms.clamp(1, MAX_TERMS);
    }

    /// Number of terms.
    pub(super) fn terms(&self) -> usize {
        self.terms
    }

    /// Makes them all zero.
    pub(super) fn clear(&mut self) {
        self.normal.clear();
        self.right.fill(0.0);
        self.power.fill(0.0);
        self.count = 0.0;
    }

    /// Adds the moments of one line, where term t has the value `phi[t]`, that hold
    /// `equations` real equations.
    pub(super) fn add(&mut self, moments: &Moments, phi: &[Complex<f64>], equations: f64) {
        let Moments { aa, fa, ff } = moments;
        let (aa, fa) = (seen(aa), seen(fa));
        let (normal, right) = (&mut cells(&mut self.normal), &mut cells(&mut self.right));
        for (t, phi_t) in phi.iter().enumerate().take(self.terms) {
            for (u, phi_u) in phi.iter().enumerate().take(t + 1) {
                // Re conj(φ_t a_i) φ_u a_j
                let factor = Factor::of(phi_t.conj() * phi_u);
                for i in 0..6 {
                    let columns = if t == u { i + 1 } else { 6 };
                    for j in 0..columns {
                        normal[(6 * t + i, 6 * u + j)] += factor.real_product(&aa[(j, i)]);
                    }
                }
            }
            let factor = Factor::of(phi_t.conj());
            for i in 0..6 {
                for j in 0..6 {
                    right[(6 * t + i, j)] += factor.real_product(&fa[(j, i)]);
                }
            }
        }
        for (sum, z) in self.power.iter_mut().zip(ff) {
            *sum += z.re;
        }
        self.count += equations;
    }

    /// Adds all lines of `columns`, where the terms have the values of `functions`, that hold
    /// `equations` real equations, to empty sums.
    ///
    /// Whole numbers are summed as they are, in the memory of the sums that they become at last.
    pub(super) fn add_columns(
        &mut self,
        columns: &Columns<'_>,
        functions: &dyn Fn(usize) -> Functions,
        equations: f64,
    ) {
        let Self {
            normal,
            right,
            power,
            ..
        } = self;
        columns.visit_whole(functions, |whole| {
            let (forces, terms) = whole.split_at(6.min(whole.len()));
            let mut rest = normal.entries_mut();
            for (i, column) in terms.iter().enumerate() {
                let Some((row, after)) = rest.split_at_mut_checked(i + 1) else {
                    return;
                };
                add_whole(row, column, terms);
                rest = after;
            }
            for (sums, force) in right.data.0.iter_mut().zip(forces) {
                add_whole(sums, force, terms);
            }
            for (sums, force) in power.data.0.iter_mut().zip(forces) {
                add_whole(sums, force, forces);
            }
        });
        let mut rest = normal.entries_mut();
        for i in 0..6 * self.terms {
            let Some((row, after)) = rest.split_at_mut_checked(i + 1) else {
                break;
            };
            settle(row, columns, 6 + i, 6);
            rest = after;
        }
        for (j, sums) in right.data.0.iter_mut().enumerate() {
            let used = sums.get_mut(..6 * self.terms).unwrap_or_default();
            settle(used, columns, j, 6);
        }
        for (j, sums) in power.data.0.iter_mut().enumerate() {
            settle(sums, columns, j, 0);
        }
        self.count += equations;
    }

    /// Takes the sums over all lines to coordinates of accelerations and to combinations of the
    /// resultants, the rows of two matrices: once, and not for each line. With a `shift`, m,
    /// amplitudes were those about the point from which that of the rows lies so far away.
    #[inline(never)] // Its matrices are off the stack when it is solved.
    pub(super) fn turn(
        &mut self,
        coordinates: &Matrix6<f64>,
        equations: &Matrix6<f64>,
        shift: Option<&Vector3<f64>>,
    ) {
        let mut p = *coordinates;
        let mut e = *equations;
        if let Some(shift) = shift {
            // Of accelerations, T, and of resultants, T⁻ᵀ.
            multiply_right(&mut p, &transfer(shift));
            multiply_right(&mut e, &transfer(&-shift).transpose());
        }
        let (p, e) = (&p, &e);
        let mut block = NO_MATRIX;
        for t in 0..self.terms {
            for u in 0..=t {
                let normal = &mut cells(&mut self.normal);
                for i in 0..6 {
                    for j in 0..6 {
                        // Of a term with itself there is one half.
                        let (k, l) = if t == u && j > i { (j, i) } else { (i, j) };
                        block[(i, j)] = normal[(6 * t + k, 6 * u + l)];
                    }
                }
                between(p, &mut block, p);
                for i in 0..6 {
                    let columns = if t == u { i + 1 } else { 6 };
                    for j in 0..columns {
                        normal[(6 * t + i, 6 * u + j)] = seen(&block)[(i, j)];
                    }
                }
            }
            let right = &mut cells(&mut self.right);
            for i in 0..6 {
                for j in 0..6 {
                    block[(i, j)] = right[(6 * t + i, j)];
                }
            }
            between(p, &mut block, e);
            for i in 0..6 {
                for j in 0..6 {
                    right[(6 * t + i, j)] = block[(i, j)];
                }
            }
        }
        between(e, &mut self.power, e);
    }
}

/// A factor that often is real: what is zero costs nothing then.
enum Factor {
    One,
    Real(f64),
    Complex(Complex<f64>),
}

impl Factor {
    fn of(x: Complex<f64>) -> Self {
        if x.im == 0.0 && x.re == 1.0 {
            Self::One
        } else if x.im == 0.0 {
            Self::Real(x.re)
        } else {
            Self::Complex(x)
        }
    }

    /// Real part of the product with it.
    fn real_product(&self, y: &Complex<f64>) -> f64 {
        match self {
            Self::One => y.re,
            Self::Real(x) => x * y.re,
            Self::Complex(x) => x.re * y.re - x.im * y.im,
        }
    }
}

/// Replaces `m` by `left m rightᵀ`, for factors most of which are zeros and ones.
#[inline(never)] // Its matrices are off the stack when the caller goes on.
pub(in crate::masslines) fn between<T>(
    left: &Matrix6<f64>,
    m: &mut Matrix6<T>,
    right: &Matrix6<f64>,
) where
    T: Scalar + Copy + Default + AddAssign + Mul<f64, Output = T>,
{
    let identity = |m: &Matrix6<f64>| (0..36).all(|k| m[k] == f64::from(u8::from(k % 7 == 0)));
    if identity(left) && identity(right) {
        return;
    }
    let mut half = Matrix6::from_element(T::default());
    for j in 0..6 {
        for k in 0..6 {
            let r = right[(j, k)];
            if r == 1.0 {
                for i in 0..6 {
                    half[(i, j)] += m[(i, k)];
                }
            } else if r != 0.0 {
                for i in 0..6 {
                    half[(i, j)] += m[(i, k)] * r;
                }
            }
        }
    }
    m.fill(T::default());
    for k in 0..6 {
        for i in 0..6 {
            let l = left[(i, k)];
            if l == 1.0 {
                for j in 0..6 {
                    m[(i, j)] += half[(k, j)];
                }
            } else if l != 0.0 {
                for j in 0..6 {
                    m[(i, j)] += half[(k, j)] * l;
                }
            }
        }
    }
}

/// Adds the products of `column` with others to whole numbers that lie in `sums` bit by bit.
#[inline(never)] // In a loop of its own it has registers enough.
fn add_whole(sums: &mut [f64], column: &Whole, others: &[Whole]) {
    for (sum, other) in sums.iter_mut().zip(others) {
        let whole = column.add_products(other, sum.to_bits().cast_signed());
        *sum = f64::from_bits(whole.cast_unsigned());
    }
}

/// Makes the sums of whole numbers those of the numbers: of the column `own` with those from
/// `first` on.
#[inline(never)] // Once in the flash.
fn settle(sums: &mut [f64], columns: &Columns<'_>, own: usize, first: usize) {
    let unit = columns.unit(own);
    for (j, sum) in sums.iter_mut().enumerate() {
        let whole = sum.to_bits().cast_signed() as f64;
        *sum = whole * unit * columns.unit(first + j);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::masslines::excitation::IDENTITY;
    use crate::masslines::lines::Internals;
    use crate::masslines::samples::{LINES, RUNS, Samples, functions, in_single, weights};
    use crate::masslines::{DriveLines, Lines};
    use crate::spectra::Window;

    const TERMS: usize = 3;

    fn begun() -> Sums {
        let mut sums = Sums::EMPTY;
        sums.begin(TERMS);
        sums
    }

    /// The sums of double precision about a point `shift` (m) away.
    fn line_by_line(lines: &DriveLines<'_>, shift: &Vector3<f64>) -> Sums {
        let mut sums = begun();
        for line in 0..LINES {
            let mut m = Moments::zero();
            for (run, weight) in weights().iter().enumerate().take(RUNS) {
                lines.add_moments(run, line, *weight, &mut m);
            }
            sums.add(&m, &functions(line)[..TERMS], 2.0 * RUNS as f64);
        }
        sums.turn(&IDENTITY, &IDENTITY, Some(shift));
        sums
    }

    /// Whole numbers add up to the sums of double precision, for any reference point.
    ///
    /// A column is off by the roundings of its numbers, some eight of 2^-24, and by less than a unit
    /// in each of its 240 parts, where the largest part is above 2^24 units: by less than
    /// `2^-21 + 16 · 2^-24` of its norm. Sums of products are off by no more than that of the product
    /// of norms (Cauchy and Schwarz), for both columns. The point is moved after that, in double
    /// precision: what is far away has the rounding of the lever.
    #[test]
    fn whole_numbers_add_up_to_the_sums_of_double_precision() {
        let samples = Samples::new();
        let runs = samples.runs();
        let lines = DriveLines::new(&runs, Window::Hann).unwrap();
        let here = line_by_line(&lines, &Vector3::zeros());
        let off = 2.0 * (0.5_f64.powi(21) + 0.5_f64.powi(20));
        for shift in [
            Vector3::zeros(),
            Vector3::new(0.1, -0.2, 0.4),
            Vector3::new(40.0, -70.0, 15.0),
        ] {
            let expected = line_by_line(&lines, &shift);
            let driven = lines.driven().unwrap();
            let columns =
                Columns::new(driven, &weights(), 0..RUNS, &(0..LINES), TERMS, &in_single).unwrap();
            let mut found = begun();
            found.add_columns(&columns, &in_single, (2 * RUNS * LINES) as f64);
            found.turn(&IDENTITY, &IDENTITY, Some(&shift));
            assert_eq!(found.count, expected.count);
            let t = transfer(&shift).abs();
            let back = transfer(&-shift).transpose().abs();
            let norm = |column: usize| -> f64 {
                let (term, i) = (column / 6, column % 6);
                let own = |k: usize| here.normal.get(6 * term + k, 6 * term + k).unwrap().sqrt();
                (0..6).map(|k| t[(i, k)] * own(k)).sum()
            };
            let force = |i: usize| -> f64 {
                (0..6)
                    .map(|k| back[(i, k)] * here.power[(k, k)].sqrt())
                    .sum()
            };
            let mut largest = 0.0_f64;
            for i in 0..6 * TERMS {
                for j in 0..=i {
                    let error =
                        found.normal.get(i, j).unwrap() - expected.normal.get(i, j).unwrap();
                    largest = largest.max(error.abs() / (norm(i) * norm(j)));
                }
                for j in 0..6 {
                    let error = found.right[(i, j)] - expected.right[(i, j)];
                    largest = largest.max(error.abs() / (norm(i) * force(j)));
                }
            }
            for i in 0..6 {
                for j in 0..6 {
                    let error = found.power[(i, j)] - expected.power[(i, j)];
                    largest = largest.max(error.abs() / (force(i) * force(j)));
                }
            }
            assert!(largest < off, "{shift}: {largest} {off}");
        }
    }
}
