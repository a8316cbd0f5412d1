//! Runs referred to their drives, in the single precision that they are kept in: sums over their
//! lines without a product in double precision.
//!
//! Second moments have to be exact, since what a fit leaves is the difference of large ones. So
//! amplitudes are scaled by powers of two to whole numbers of some 26 bits, whose products are
//! summed in 64 bits without any rounding. What is lost is less than the rounding of the amplitudes
//! themselves, relative to the largest line of each column.

use super::MAX_RUNS;
use super::moments::Squares;
use super::regression::MAX_TERMS;
use crate::algebra::larger;
use crate::geometry::{RESULTANTS, move_accelerations, move_forces};
use crate::spectra::{Complex32, RunResponses};
use core::ops::Range;
use nalgebra::{Complex, Vector3, Vector6};

/// Runs that hold one pair of amplitudes a line, referred to their drives.
#[derive(Clone, Copy, Debug)]
pub struct Driven<'a> {
    runs: &'a [RunResponses<'a>],
    /// From the point of their amplitudes to that of the lines, m.
    shift: Vector3<f64>,
}

impl<'a> Driven<'a> {
    pub(super) fn new(runs: &'a [RunResponses<'a>]) -> Self {
        Self {
            runs,
            shift: Vector3::zeros(),
        }
    }

    /// The same runs as lines about a point `shift` (m) away.
    pub(super) fn moved(mut self, shift: &Vector3<f64>) -> Self {
        self.shift += shift;
        self
    }

    /// From the point of the amplitudes to that of the lines, m.
    pub(super) fn shift(&self) -> &Vector3<f64> {
        &self.shift
    }

    /// Amplitudes per unit of the drive, about the point they are kept at, and the drive's power.
    #[inline]
    fn line(&self, run: usize, line: usize) -> Option<(&'a [Complex32; RESULTANTS], f32)> {
        let run = self.runs.get(run)?;
        Some((run.responses.get(line)?, *run.drive.get(line)?))
    }

    /// Amplitudes of a line times the root of the drive's power and `root`.
    #[inline]
    pub(super) fn scaled(
        &self,
        run: usize,
        line: usize,
        root: f32,
    ) -> Option<[Complex32; RESULTANTS]> {
        let (amplitudes, drive) = self.line(run, line)?;
        let root = root * libm::sqrtf(drive);
        Some(core::array::from_fn(|j| amplitudes[j] * root))
    }

    /// Leaves the scalar `Σ_runs a*f / a*W a` of each of the lines `fit` in `into`. `None` where
    /// single precision has no room for it.
    pub(super) fn power_like(
        &self,
        fit: Range<usize>,
        w: &Vector6<f64>,
        into: &mut [Complex<f64>],
    ) -> Option<()> {
        /// Where squares keep all their digits.
        const ROOM: Range<f32> = 1e-30..1e30;
        let w: [f32; 6] = core::array::from_fn(|j| w[j] as f32);
        let shift = self.shift.map(|x| x as f32);
        for (line, t) in fit.zip(into) {
            let mut sum = Complex32::new(0.0, 0.0);
            for run in 0..self.runs.len() {
                let (amplitudes, _) = self.line(run, line)?;
                let [x, y, z, p, q, r, f @ ..] = amplitudes;
                // u_B = u_A - s x w. The power does not depend on the point.
                let moved = [
                    x - (r * shift.y - q * shift.z),
                    y - (p * shift.z - r * shift.x),
                    z - (q * shift.x - p * shift.y),
                ];
                let at_point = moved.iter().chain([p, q, r]);
                let norm: f32 = at_point.zip(&w).map(|(a, w)| w * a.norm_sqr()).sum();
                if !ROOM.contains(&norm) {
                    // A line on which nothing moves tells nothing.
                    if amplitudes.iter().all(|z| z.re == 0.0 && z.im == 0.0) {
                        continue;
                    }
                    return None;
                }
                let power: Complex32 = f.iter().zip(amplitudes).map(|(f, a)| f * a.conj()).sum();
                sum += power / norm;
            }
            *t = Complex::new(sum.re.into(), sum.im.into());
        }
        Some(())
    }

    /// Second moments of one run, summed over the lines `band`, about the point of the lines.
    /// `None` where whole numbers have no room for them.
    #[inline(never)] // Sums are off the stack when the caller goes on.
    pub(super) fn squares(&self, run: usize, band: &Range<usize>) -> Option<Squares> {
        const SUMS: usize = 21;
        let rigid = |_| [Complex32::new(1.0, 0.0); MAX_TERMS];
        let columns = Columns::new(*self, &[1.0; MAX_RUNS], run..run + 1, band, 1, &rigid)?;
        let mut sums = [[0; SUMS]; 2];
        columns.visit(&rigid, |_, whole| {
            for (half, sums) in whole.chunks_exact(6).zip(&mut sums) {
                let mut rest = &mut sums[..];
                for (i, column) in half.iter().enumerate() {
                    let Some((row, after)) = rest.split_at_mut_checked(i + 1) else {
                        return;
                    };
                    for (sum, other) in row.iter_mut().zip(half) {
                        *sum += column.product(other);
                    }
                    rest = after;
                }
            }
        });
        let [forces, accelerations] = &sums;
        let mut squares = Squares::zero();
        for (matrix, sums, first) in [
            (&mut squares.ff, forces, 0),
            (&mut squares.aa, accelerations, 6),
        ] {
            let entries = (0..6).flat_map(|i| (0..=i).map(move |j| (i, j)));
            for (sum, (i, j)) in sums.iter().zip(entries) {
                let value = *sum as f64 * columns.unit(first + i) * columns.unit(first + j);
                matrix[(i, j)] = value;
                matrix[(j, i)] = value;
            }
        }
        if self.shift != Vector3::zeros() {
            move_accelerations(&mut squares.aa, &self.shift);
            move_forces(&mut squares.ff, &self.shift);
        }
        Some(squares)
    }
}

/// Columns of one line: six forces, and six accelerations times the function of each term.
pub(super) const COLUMNS: usize = 6 + 6 * MAX_TERMS;

/// A complex number in units of its column.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Whole {
    re: i32,
    im: i32,
}

impl Whole {
    /// Nothing is rounded but what is below the unit.
    #[inline]
    fn of(z: Complex32, per_unit: f32) -> Self {
        Self {
            re: (z.re * per_unit) as i32,
            im: (z.im * per_unit) as i32,
        }
    }

    /// Sum of whole numbers with whole coefficients.
    #[inline]
    pub(super) fn combined(columns: &[Self], coefficients: &[i32]) -> Complex32 {
        let (mut re, mut im) = (0_i64, 0_i64);
        let mut add = |z: &Self, c: i32| {
            re += i64::from(z.re) * i64::from(c);
            im += i64::from(z.im) * i64::from(c);
        };
        // Three at a time, written out: a turn of the loop costs as much as a product. Columns come
        // by six.
        let (columns, _) = columns.as_chunks();
        let (coefficients, _) = coefficients.as_chunks();
        for ([x, y, z], [a, b, c]) in columns.iter().zip(coefficients) {
            add(x, *a);
            add(y, *b);
            add(z, *c);
        }
        Complex32::new(re as f32, im as f32)
    }

    /// Real part of the product with the conjugate of another one.
    #[inline]
    pub(super) fn product(&self, other: &Self) -> i64 {
        i64::from(self.re) * i64::from(other.re) + i64::from(self.im) * i64::from(other.im)
    }
}

/// Whole numbers for the columns of some runs over a band.
///
/// No sum of products overflows. With N lines of all runs and parts below 2^b in size it is below
/// `N 2^(2b + 1)`, and b is the largest one for which `2b + 1` and the bits of N are at most 63.
/// Rounding may take a part above 2^b by 2^-21 of it, which N lacks to its next power of two.
pub(super) struct Columns<'a> {
    driven: Driven<'a>,
    /// Root of the weight of each run.
    roots: [f32; MAX_RUNS],
    runs: Range<usize>,
    band: Range<usize>,
    /// Columns in use.
    count: usize,
    /// Bits of the largest part of a column.
    bits: u32,
    /// Reciprocals of the units, powers of two.
    per_unit: [f32; COLUMNS],
}

/// Values of the functions of all terms at a line.
pub(super) type Functions = [Complex32; MAX_TERMS];

/// Fewest bits of the largest part of a column: as many as single precision has, and one more.
const LEAST_BITS: u32 = 25;

/// Size of a number as bits, which are in the same order, and above all others where it is none.
#[inline]
fn size(x: f32) -> u32 {
    x.to_bits() & !(1 << 31)
}

impl<'a> Columns<'a> {
    /// Chooses the units. `None` if there are too many lines, or a number that is not finite or too
    /// small for single precision.
    #[inline(never)] // Its maxima are off the stack when sums are made.
    pub(super) fn new(
        driven: Driven<'a>,
        weights: &[f64; MAX_RUNS],
        runs: Range<usize>,
        band: &Range<usize>,
        terms: usize,
        functions: &dyn Fn(usize) -> Functions,
    ) -> Option<Self> {
        let lines = u32::try_from(runs.len().checked_mul(band.len())?).ok()?;
        let bits = lines.leading_zeros().checked_add(62 - u32::BITS)? / 2;
        if bits < LEAST_BITS {
            return None;
        }
        let mut columns = Self {
            driven,
            roots: weights.map(|weight| libm::sqrt(weight) as f32),
            runs,
            band: band.clone(),
            count: 6 + 6 * terms.min(MAX_TERMS),
            bits,
            per_unit: [1.0; COLUMNS],
        };
        let mut largest = [0; COLUMNS];
        for line in columns.band.clone() {
            // Accelerations lie before forces.
            let mut sizes = [0; RESULTANTS];
            for run in columns.runs.clone() {
                let amplitudes = columns.amplitudes(run, line)?;
                for (largest, z) in sizes.iter_mut().zip(&amplitudes) {
                    *largest = size(z.re).max(size(z.im)).max(*largest);
                }
            }
            let (accelerations, forces) = sizes.split_at(6);
            let (of_forces, of_accelerations) = largest.split_at_mut(6);
            for (largest, size) in of_forces.iter_mut().zip(forces) {
                *largest = (*largest).max(*size);
            }
            for (largest, phi) in of_accelerations.chunks_exact_mut(6).zip(functions(line)) {
                let most = phi.re.abs() + phi.im.abs();
                for (largest, acceleration) in largest.iter_mut().zip(accelerations) {
                    *largest = size(most * f32::from_bits(*acceleration)).max(*largest);
                }
            }
        }
        let used = largest.iter().take(columns.count);
        for (per_unit, largest) in columns.per_unit.iter_mut().zip(used) {
            /// What is below loses digits before it is scaled.
            const LEAST: u32 = 127 - 90;
            *per_unit = match largest >> 23 {
                _ if *largest == 0 => 1.0,
                // Below 2^(exponent - 126) in size.
                exponent @ LEAST..=254 => f32::from_bits((bits + 253 - exponent) << 23),
                _ => return None,
            };
        }
        Some(columns)
    }

    #[inline]
    fn amplitudes(&self, run: usize, line: usize) -> Option<[Complex32; RESULTANTS]> {
        self.driven.scaled(run, line, *self.roots.get(run)?)
    }

    /// Unit of a column.
    pub(super) fn unit(&self, column: usize) -> f64 {
        // The reciprocal of a power of two is exact.
        f64::from(1.0 / self.per_unit.get(column).copied().unwrap_or(1.0))
    }

    /// Weight of a run.
    pub(super) fn weight(&self, run: usize) -> f64 {
        let root = f64::from(self.roots.get(run).copied().unwrap_or(1.0));
        root * root
    }

    /// Leaves the coefficients of a sum over the columns as whole numbers in `row`, and returns the
    /// unit of the sum. `None` if they are not finite, or have no unit in single precision.
    ///
    /// A sum does not overflow: of at most 2^6 columns, with parts below 2^b and coefficients of at
    /// most `2^(56 - b)`, it stays below 2^62.
    pub(super) fn whole_coefficients(
        &self,
        coefficient: &dyn Fn(usize) -> Option<f64>,
        row: &mut [i32; COLUMNS],
    ) -> Option<f32> {
        let of = |column: usize| Some(coefficient(column)? * self.unit(column));
        let mut largest = 0.0_f64;
        for column in 0..self.count {
            largest = larger(of(column)?.abs(), largest);
        }
        if largest == 0.0 {
            row.fill(0);
            return Some(0.0);
        }
        // The power of two above it.
        let exponent = (largest.to_bits() >> 52) as u32;
        let room = 1023 + 56 - self.bits;
        // Of single precision, with squares.
        if !(1023 - 90..1023 + 60).contains(&exponent) {
            return None;
        }
        let per_unit = f64::from_bits(u64::from(1023 + room - 1 - exponent) << 52);
        for (column, row) in row.iter_mut().enumerate().take(self.count) {
            *row = (of(column)? * per_unit) as i32;
        }
        Some((1.0 / per_unit) as f32)
    }

    /// Shows the columns of every run at every line, and the number of the run.
    #[inline]
    pub(super) fn visit(
        &self,
        functions: &dyn Fn(usize) -> Functions,
        mut see: impl FnMut(usize, &[Whole]),
    ) {
        let mut whole = [Whole::default(); COLUMNS];
        for line in self.band.clone() {
            let functions = functions(line);
            for run in self.runs.clone() {
                let Some(amplitudes) = self.amplitudes(run, line) else {
                    return;
                };
                let (accelerations, forces) = amplitudes.split_at(6);
                let whole = whole.get_mut(..self.count).unwrap_or_default();
                let (of_forces, of_terms) = whole.split_at_mut(6);
                let (per_force, per_terms) = self.per_unit.split_at(6);
                for ((whole, z), per_unit) in of_forces.iter_mut().zip(forces).zip(per_force) {
                    *whole = Whole::of(*z, *per_unit);
                }
                let (of_terms, _) = of_terms.as_chunks_mut::<6>();
                let (units, _) = per_terms.as_chunks::<6>();
                let Some((accelerations, _)) = accelerations.split_first_chunk::<6>() else {
                    return;
                };
                for ((of_term, units), phi) in of_terms.iter_mut().zip(units).zip(&functions) {
                    for i in 0..6 {
                        of_term[i] = Whole::of(accelerations[i] * phi, units[i]);
                    }
                }
                see(run, whole);
            }
        }
    }
}
