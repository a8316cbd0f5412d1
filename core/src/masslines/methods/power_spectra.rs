//! Method b: averaged power spectra, `M G_AF = G_FF` (13), without and with Cholesky.

use crate::algebra::{inverse_lower, lower, multiply_left, multiply_right, product};
use crate::cells::seen;
use crate::masslines::averaging::{RealMoments, Trend};
use crate::masslines::bands::Bands;
use crate::masslines::excitation::IDENTITY;
use crate::masslines::lines::{add_squares, indices};
use crate::masslines::moments::{Squares, add_scaled};
use crate::masslines::{Excitation, Lines, MasslineError, Masslines, Moments};
use core::ops::Range;
use nalgebra::{ArrayStorage, Matrix6, Vector6};

const NO_MATRIX: Matrix6<f64> = Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6]));

/// Treatment of the band averages of the power spectra.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Factorisation {
    /// The columns of `Re G_AF` and `Re G_FF` are the pairs. Only for structures whose
    /// first modes are negligible.
    None,
    /// `Re G_FF = RᵀR`; the columns of `Q = Re G_AF R⁻¹` and `Rᵀ` are the pairs.
    Cholesky,
}

/// Adds masslines from the real parts of the power spectra, summed over the runs and averaged
/// over the averaging band.
///
/// `lines` should carry accelerations from all accelerometers, equation (4), with the
/// weights of chapter 7 where wanted. With drive channels the spectra are products of
/// frequency responses and free of noise bias, which the paper's are not.
///
/// # Errors
/// [`MasslineError`] if the band is too short or nothing is excited or measured.
#[inline(never)] // One method's working memory at a time.
pub(super) fn power_spectra<L: Lines + ?Sized, const PAIRS: usize>(
    lines: &L,
    bands: &Bands,
    factorisation: Factorisation,
    set: &mut Masslines<PAIRS>,
) -> Result<(), MasslineError> {
    let band = indices(lines, bands.averaging)?;
    if set.equations.count() == 0 {
        return Err(MasslineError::NoResultant);
    }
    let mut excitation = Excitation::NONE;
    let mut columns = IDENTITY;
    look_at(lines, &band, factorisation, &mut excitation, &mut columns)?;
    let columns = &columns;
    let used = (0..6).filter(|&c| column(columns, c).norm_squared() > 0.0);
    let used: heapless::Vec<usize, 6> = used.collect();
    set.average(
        lines,
        &band,
        Trend::Constant,
        bands.equations,
        &excitation,
        used.len(),
        &mut |line, pairs| {
            let mut m = Moments::zero();
            for run in 0..lines.runs() {
                lines.add_moments(run, line, 1.0, &mut m);
            }
            for (pair, &c) in pairs.iter_mut().zip(&used) {
                let column = column(columns, c);
                let column = column.as_slice();
                let (fa, ff) = (seen(&m.fa), seen(&m.ff));
                let a = Vector6::from_fn(|i, _| product(|k| fa[(k, i)].re, column));
                let f = Vector6::from_fn(|i, _| product(|k| ff[(i, k)].re, column));
                *pair = (a, f);
            }
            Ok(())
        },
    )?;
    let used = used.iter().map(|&c| column(columns, c));
    set.set_averaged_noise(&noise_of_pairs(lines, &band, used));
    Ok(())
}

/// Leaves the directions that the runs excite in `excitation`, and what multiplies the spectra
/// from the right in `columns`.
#[inline(never)] // Its sums are off the stack when lines are averaged.
fn look_at<L: Lines + ?Sized>(
    lines: &L,
    band: &Range<usize>,
    factorisation: Factorisation,
    excitation: &mut Excitation,
    columns: &mut Matrix6<f64>,
) -> Result<(), MasslineError> {
    let spectra = RealMoments::new(lines, band);
    spectra.accelerations(excitation);
    if excitation.rank() == 0 {
        return Err(MasslineError::NoExcitation);
    }
    match factorisation {
        Factorisation::None => Ok(()),
        Factorisation::Cholesky => factor(&spectra, excitation.rank(), columns),
    }
}

/// Noise of the accelerations of each run times its forces, for these columns.
#[inline(never)] // One run's squares and noise on the stack.
fn noise_of_pairs<L: Lines + ?Sized>(
    lines: &L,
    band: &Range<usize>,
    columns: impl Iterator<Item = Vector6<f64>> + Clone,
) -> Matrix6<f64> {
    let mut noise = NO_MATRIX;
    for run in 0..lines.runs() {
        let mut squares = Squares::zero();
        for line in band.clone() {
            add_squares(lines, run, line, 1.0 / band.len() as f64, &mut squares);
        }
        let powers = columns.clone().map(|c| c.dot(&(squares.ff * c)));
        add_scaled(&mut noise, &lines.noise(run).acceleration, powers.sum());
    }
    noise
}

/// The matrix R⁻¹ that multiplies the spectra from the right, left in `inner`.
///
/// With fewer runs than degrees of freedom G_FF is singular. Then the factor is
/// taken in the subspace of the strongest forces, as many as there are independent
/// accelerations; least squares does not depend on which basis that subspace has.
#[inline(never)] // Its matrices are off the stack when lines are averaged.
fn factor(
    spectra: &RealMoments,
    rank: usize,
    inner: &mut Matrix6<f64>,
) -> Result<(), MasslineError> {
    let mut forces = Excitation::NONE;
    forces.decide(&spectra.squares.ff, &spectra.noise.force);
    let rank = rank.min(forces.rank());
    if rank == 0 {
        return Err(MasslineError::NoResultant);
    }
    // In noise units: V G Vᵀ = RᵀR, so R⁻¹ = Vᵀ (its own Cholesky factor)⁻ᵀ.
    let v = forces.coordinates();
    inner.copy_from(&spectra.squares.ff);
    *inner /= spectra.lines;
    multiply_left(v, inner);
    multiply_right(inner, &v.transpose());
    lower(inner, rank).ok_or(MasslineError::Singular)?;
    inverse_lower(inner, rank);
    inner.transpose_mut();
    multiply_left(&v.transpose(), inner);
    Ok(())
}

/// Column `c`.
fn column(matrix: &Matrix6<f64>, c: usize) -> Vector6<f64> {
    let matrix = seen(matrix);
    Vector6::from_fn(|j, _| matrix[(j, c)])
}
