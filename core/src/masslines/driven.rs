//! Runs referred to their drives, in the single precision that they are kept in: sums over their
//! lines without a product in double precision.
//!
//! Second moments have to be exact, since what a fit leaves is the difference of large ones. So
//! amplitudes are scaled by powers of two to whole numbers of some 26 bits, whose products are
//! summed in 64 bits without any rounding. What is lost is less than the rounding of the amplitudes
//! themselves, relative to the largest line of each column.

use super::MAX_RUNS;
use super::moments::Squares;
use crate::cells::cells;
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

    /// Leaves the amplitudes of a line times the root of the drive's power and `root` in `into`.
    #[inline]
    pub(super) fn scaled(
        &self,
        run: usize,
        line: usize,
        root: f32,
        into: &mut [Complex32; RESULTANTS],
    ) -> Option<()> {
        let (amplitudes, drive) = self.line(run, line)?;
        let root = root * libm::sqrtf(drive);
        for (scaled, z) in into.iter_mut().zip(amplitudes) {
            *scaled = z * root;
        }
        Some(())
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
        columns.visit_whole(&rigid, |whole| {
            for (half, sums) in whole.chunks_exact(6).zip(&mut sums) {
                let mut rest = &mut sums[..];
                for (i, column) in half.iter().enumerate() {
                    let Some((row, after)) = rest.split_at_mut_checked(i + 1) else {
                        return;
                    };
                    for (sum, other) in row.iter_mut().zip(half) {
                        *sum = column.add_products(other, *sum);
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
            let matrix = &mut cells(matrix);
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

/// Most terms: the rigid one, one for all modes above, and [`crate::modes::MAX_MODES`], of which the
/// pseudo-mode may be one.
pub(super) const MAX_TERMS: usize = 2 + crate::modes::MAX_MODES;

/// Columns of one line: six forces, and six accelerations times the function of each term.
pub(super) const COLUMNS: usize = 6 + 6 * MAX_TERMS;

/// Two complex numbers of a column, each of a run at a line, in units of the column.
///
/// Two at a time, since sums are read and written as often as products are made.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Whole {
    re: [i32; 2],
    im: [i32; 2],
}

impl Whole {
    /// Takes the first or the second one. Nothing is rounded but what is below the unit.
    #[inline]
    fn take(&mut self, second: bool, z: Complex32, per_unit: f32) {
        let place = usize::from(second);
        self.re[place] = (z.re * per_unit) as i32;
        self.im[place] = (z.im * per_unit) as i32;
    }

    /// Adds the real parts of the products with the conjugates of others.
    #[inline]
    pub(super) fn add_products(&self, other: &Self, sum: i64) -> i64 {
        let both = |x: i32, y: i32| i64::from(x) * i64::from(y);
        let sum = sum + both(self.re[0], other.re[0]);
        let sum = sum + both(self.im[0], other.im[0]);
        let sum = sum + both(self.re[1], other.re[1]);
        sum + both(self.im[1], other.im[1])
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
    /// Reciprocals of the units, powers of two.
    per_unit: [f32; COLUMNS],
}

/// Amplitudes of nothing.
const SILENT: [Complex32; RESULTANTS] = [Complex32::new(0.0, 0.0); RESULTANTS];

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
            per_unit: [1.0; COLUMNS],
        };
        let mut largest = [0; COLUMNS];
        let mut amplitudes = SILENT;
        for line in columns.band.clone() {
            // Accelerations lie before forces.
            let mut sizes = [0; RESULTANTS];
            for run in columns.runs.clone() {
                columns.amplitudes(run, line, &mut amplitudes)?;
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
            /// Least exponent whose numbers lose no digits before they are scaled.
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
    fn amplitudes(
        &self,
        run: usize,
        line: usize,
        into: &mut [Complex32; RESULTANTS],
    ) -> Option<()> {
        self.driven.scaled(run, line, *self.roots.get(run)?, into)
    }

    /// Unit of a column.
    pub(super) fn unit(&self, column: usize) -> f64 {
        // The reciprocal of a power of two is exact.
        f64::from(1.0 / self.per_unit.get(column).copied().unwrap_or(1.0))
    }

    /// Shows the amplitudes of every run at every line, and the functions there.
    #[inline]
    fn visit(
        &self,
        functions: &dyn Fn(usize) -> Functions,
        mut see: impl FnMut(usize, &[Complex32; RESULTANTS], &Functions),
    ) {
        let mut amplitudes = SILENT;
        for line in self.band.clone() {
            let functions = functions(line);
            for run in self.runs.clone() {
                if self.amplitudes(run, line, &mut amplitudes).is_some() {
                    see(run, &amplitudes, &functions);
                }
            }
        }
    }

    /// Shows the columns of every run at every line as whole numbers, two at a time. The last may be
    /// beside zeros.
    #[inline]
    pub(super) fn visit_whole(
        &self,
        functions: &dyn Fn(usize) -> Functions,
        mut see: impl FnMut(&[Whole]),
    ) {
        let mut whole = [Whole::default(); COLUMNS];
        let mut second = false;
        let used = self.count;
        self.visit(
            functions,
            |_, [a, b, c, d, e, f, forces @ ..], functions| {
                let accelerations = [a, b, c, d, e, f];
                let Some((of_forces, of_terms)) = whole.split_first_chunk_mut::<6>() else {
                    return;
                };
                let (per_force, per_terms) = self.per_unit.split_at(6);
                let (of_terms, _) = of_terms.as_chunks_mut::<6>();
                let (per_terms, _) = per_terms.as_chunks::<6>();
                for ((whole, z), per_unit) in of_forces.iter_mut().zip(forces).zip(per_force) {
                    whole.take(second, *z, *per_unit);
                }
                let terms = self.count / 6 - 1;
                let all = of_terms.iter_mut().zip(per_terms).zip(functions);
                for ((of_term, units), phi) in all.take(terms) {
                    for i in 0..6 {
                        of_term[i].take(second, accelerations[i] * phi, units[i]);
                    }
                }
                if second {
                    see(whole.get(..used).unwrap_or_default());
                }
                second = !second;
            },
        );
        if second {
            for whole in &mut whole {
                whole.take(true, Complex32::new(0.0, 0.0), 1.0);
            }
            see(whole.get(..used).unwrap_or_default());
        }
    }

    /// Leaves the power of the sums of the columns of forces and of `terms` terms with coefficients, `rows`,
    /// in each run in `powers`, without the weight of the run. `None` where single precision has no room for them.
    ///
    /// A run that is a thousandth of the others has all digits here.
    #[inline(never)] // Columns are on the stack only where they are needed.
    pub(super) fn powers_of(
        &self,
        functions: &dyn Fn(usize) -> Functions,
        terms: usize,
        rows: &[[f32; COLUMNS]; 6],
        powers: &mut [Vector6<f64>],
    ) -> Option<()> {
        let mut sums = [[0.0_f32; 6]; MAX_RUNS];
        let mut columns = [Complex32::new(0.0, 0.0); COLUMNS];
        for line in self.band.clone() {
            let functions = functions(line);
            for run in self.runs.clone() {
                let (Some((amplitudes, drive)), Some(sums)) =
                    (self.driven.line(run, line), sums.get_mut(run))
                else {
                    continue;
                };
                let [a, b, c, d, e, f, forces @ ..] = amplitudes;
                let accelerations = [a, b, c, d, e, f];
                let (of_forces, of_terms) = columns.split_first_chunk_mut()?;
                *of_forces = *forces;
                let (of_terms, _) = of_terms.as_chunks_mut::<6>();
                for (of_term, phi) in of_terms.iter_mut().zip(functions).take(terms) {
                    for i in 0..6 {
                        of_term[i] = accelerations[i] * phi;
                    }
                }
                let columns = columns.get(..6 + 6 * terms)?;
                for (sum, row) in sums.iter_mut().zip(rows) {
                    let left = combined(columns, row);
                    // The square alone could leave single precision's range.
                    *sum += left.re * drive * left.re + left.im * drive * left.im;
                }
            }
        }
        for (powers, sums) in powers.iter_mut().zip(&sums) {
            for (power, sum) in powers.iter_mut().zip(sums) {
                if !sum.is_finite() {
                    return None;
                }
                *power = f64::from(*sum);
            }
        }
        Some(())
    }
}

/// Sum of columns with coefficients.
#[inline]
fn combined(columns: &[Complex32], coefficients: &[f32]) -> Complex32 {
    let mut sum = Complex32::new(0.0, 0.0);
    let mut add = |z: &Complex32, c: &f32| {
        sum.re += z.re * c;
        sum.im += z.im * c;
    };
    // Three at a time, written out: a turn of the loop costs as much as a product. Columns come by
    // six.
    let (columns, _) = columns.as_chunks();
    let (coefficients, _) = coefficients.as_chunks();
    for ([x, y, z], [a, b, c]) in columns.iter().zip(coefficients) {
        add(x, a);
        add(y, b);
        add(z, c);
    }
    sum
}

#[cfg(test)]
mod tests;
