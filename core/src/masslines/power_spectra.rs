//! Method b: averaged power spectra, `M G_AF = G_FF` (13), without and with Cholesky.

use super::averaging::Trend;
use super::{Excitation, Lines, MasslineError, Masslines, Moments};
use crate::algebra::{inverse_lower, lower};
use core::ops::Range;
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
    band: Range<usize>,
    factorisation: Factorisation,
    set: &mut Masslines<PAIRS>,
) -> Result<(), MasslineError> {
    if set.equations.count() == 0 {
        return Err(MasslineError::NoResultant);
    }
    let spectra = Averaged::new(lines, &band);
    let excited = Excitation::new(&spectra.aa, &spectra.acceleration_noise);
    if excited.rank() == 0 {
        return Err(MasslineError::NoExcitation);
    }
    let columns = spectra.columns(factorisation, excited.rank())?;
    let used = (0..6).filter(|&c| columns.column(c).norm_squared() > 0.0);
    let used: heapless::Vec<usize, 6> = used.collect();
    set.average(lines, &band, Trend::Constant, used.len(), |line, pairs| {
        let m = summed(lines, line);
        let af = m.fa.adjoint().map(|z| z.re);
        let ff = m.ff.map(|z| z.re);
        for (pair, &c) in pairs.iter_mut().zip(&used) {
            let column: Vector6<f64> = columns.column(c).into();
            *pair = (excited.cleaner() * (af * column), ff * column);
        }
        Ok(())
    })?;
    set.share_noise(&spectra.aa.diagonal(), &spectra.acceleration_noise);
    Ok(())
}

fn summed<L: Lines + ?Sized>(lines: &L, line: usize) -> Moments {
    let mut m = Moments::zero();
    for run in 0..lines.runs() {
        lines.add_moments(run, line, 1.0, &mut m);
    }
    m
}

/// Real parts summed over runs and lines, with the noise in them.
struct Averaged {
    aa: Matrix6<f64>,
    ff: Matrix6<f64>,
    acceleration_noise: Vector6<f64>,
    force_noise: Vector6<f64>,
    lines: f64,
}

impl Averaged {
    fn new<L: Lines + ?Sized>(lines: &L, band: &Range<usize>) -> Self {
        let mut total = Moments::zero();
        let mut noise = [0.0; 12];
        for run in 0..lines.runs() {
            let per_line = lines.noise(run);
            for (sum, n) in noise.iter_mut().zip(per_line) {
                *sum += n * band.len() as f64;
            }
            for line in band.clone() {
                lines.add_moments(run, line, 1.0, &mut total);
            }
        }
        Self {
            aa: total.aa.map(|z| z.re),
            ff: total.ff.map(|z| z.re),
            acceleration_noise: Vector6::from_fn(|j, _| noise[j]),
            force_noise: Vector6::from_fn(|j, _| noise[6 + j]),
            lines: band.len() as f64,
        }
    }

    /// What multiplies the spectra from the right: the identity, or R⁻¹.
    ///
    /// With fewer runs than degrees of freedom G_FF is singular. Then the factor is
    /// taken in the subspace of the strongest forces, as many as there are independent
    /// accelerations; least squares does not depend on which basis that subspace has.
    fn columns(
        &self,
        factorisation: Factorisation,
        rank: usize,
    ) -> Result<Matrix6<f64>, MasslineError> {
        if factorisation == Factorisation::None {
            return Ok(Matrix6::identity());
        }
        let forces = Excitation::new(&self.ff, &self.force_noise);
        let rank = rank.min(forces.rank());
        if rank == 0 {
            return Err(MasslineError::NoResultant);
        }
        // In noise units: V G Vᵀ = RᵀR, so R⁻¹ = Vᵀ (its own Cholesky factor)⁻ᵀ.
        let v = forces.coordinates();
        let inner = v * (self.ff / self.lines) * v.transpose();
        let l = lower(&inner, rank).ok_or(MasslineError::Singular)?;
        let inverse = inverse_lower(&l, rank);
        Ok(v.transpose() * inverse.transpose())
    }
}
