//! Method b: averaged power spectra, `M G_AF = G_FF` (13), without and with Cholesky.

use super::averaging::{RealMoments, Trend};
use super::lines::indices;
use super::{EquationWeights, Excitation, Lines, MasslineError, Masslines, Moments};
use crate::algebra::{inverse_lower, lower, multiply_left, multiply_right, product};
use crate::cells::seen;
use crate::spectra::LineRange;
use nalgebra::{Matrix6, Vector6};

/// What is done with the band averages of the power spectra.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Factorisation {
    /// The columns of `Re G_AF` and `Re G_FF` are the pairs. Only for structures whose
    /// first modes are negligible.
    None,
    /// `Re G_FF = RᵀR`; the columns of `Q = Re G_AF R⁻¹` and `Rᵀ` are the pairs.
    Cholesky,
}

/// Adds masslines from the real parts of the power spectra, summed over the runs and averaged
/// over the lines `band`.
///
/// `lines` should carry accelerations from all accelerometers, equation (4), with the
/// weights of chapter 7 where wanted. With drive channels the spectra are products of
/// frequency responses and free of noise bias, which the paper's are not.
///
/// # Errors
/// [`MasslineError`] if the band is too short or nothing is excited or measured.
#[inline(never)] // One method's working memory at a time.
pub fn power_spectra<L: Lines + ?Sized, const PAIRS: usize>(
    lines: &L,
    band: LineRange,
    factorisation: Factorisation,
    equations: EquationWeights,
    set: &mut Masslines<PAIRS>,
) -> Result<(), MasslineError> {
    let band = indices(lines, band)?;
    if set.equations.count() == 0 {
        return Err(MasslineError::NoResultant);
    }
    let spectra = RealMoments::new(lines, &band);
    let excitation = Excitation::new(&spectra.aa, &spectra.noise.acceleration);
    if excitation.rank() == 0 {
        return Err(MasslineError::NoExcitation);
    }
    let columns = columns(&spectra, factorisation, excitation.rank());
    let columns = columns.as_ref().map_err(|error| *error)?;
    let used = (0..6).filter(|&c| column(columns, c).norm_squared() > 0.0);
    let used: heapless::Vec<usize, 6> = used.collect();
    set.average(
        lines,
        &band,
        Trend::Constant,
        equations,
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
    // Noise of the accelerations of a run times its forces.
    let mut of_lines = Matrix6::zeros();
    for run in 0..lines.runs() {
        let mut m = Moments::zero();
        for line in band.clone() {
            lines.add_moments(run, line, 1.0 / band.len() as f64, &mut m);
        }
        let forces: f64 = used
            .iter()
            .map(|&c| {
                let column = column(columns, c);
                column.dot(&(m.ff.map(|z| z.re) * column))
            })
            .sum();
        of_lines += lines.noise(run).acceleration * forces;
    }
    set.set_averaged_noise(&of_lines);
    Ok(())
}

/// What multiplies the spectra from the right: the identity, or R⁻¹.
///
/// With fewer runs than degrees of freedom G_FF is singular. Then the factor is
/// taken in the subspace of the strongest forces, as many as there are independent
/// accelerations; least squares does not depend on which basis that subspace has.
#[inline(never)] // Its matrices are off the stack when lines are averaged.
fn columns(
    spectra: &RealMoments,
    factorisation: Factorisation,
    rank: usize,
) -> Result<Matrix6<f64>, MasslineError> {
    if factorisation == Factorisation::None {
        return Ok(Matrix6::identity());
    }
    let forces = Excitation::new(&spectra.ff, &spectra.noise.force);
    let rank = rank.min(forces.rank());
    if rank == 0 {
        return Err(MasslineError::NoResultant);
    }
    // In noise units: V G Vᵀ = RᵀR, so R⁻¹ = Vᵀ (its own Cholesky factor)⁻ᵀ.
    let v = forces.coordinates();
    let mut inner = spectra.ff / spectra.lines;
    multiply_left(v, &mut inner);
    multiply_right(&mut inner, &v.transpose());
    lower(&mut inner, rank).ok_or(MasslineError::Singular)?;
    inverse_lower(&mut inner, rank);
    inner.transpose_mut();
    multiply_left(&v.transpose(), &mut inner);
    Ok(inner)
}

/// Column `c`.
fn column(matrix: &Matrix6<f64>, c: usize) -> Vector6<f64> {
    let matrix = seen(matrix);
    Vector6::from_fn(|j, _| matrix[(j, c)])
}
