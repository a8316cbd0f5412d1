//! Method b: averaged power spectra, `M G_AF = G_FF` (13), without and with Cholesky.

use super::apparent_mass::MIN_LINES;
use super::{Excitation, Lines, MasslineError, Masslines, Moments};
use crate::geometry::Equations;
use core::ops::Range;
use nalgebra::{Matrix6, Vector3, Vector6};

/// What is done with the band averages of the power spectra.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Factorisation {
    /// The columns of `Re G_AF` and `Re G_FF` are the pairs. Only for structures whose
    /// first modes are negligible.
    None,
    /// `Re G_FF = RᵀR`; the columns of `Q = Re G_AF R⁻¹` and `Rᵀ` are the pairs.
    Cholesky,
}

/// Masslines from the real parts of the power spectra, summed over the runs and averaged
/// over the lines `band`.
///
/// `lines` should carry accelerations from all accelerometers, equation (4), with the
/// weights of chapter 7 where wanted. With drive channels the spectra are products of
/// frequency responses and free of noise bias, which the paper's are not.
///
/// # Errors
/// [`MasslineError`] if the band is too short or nothing is excited or measured.
pub fn power_spectra<L: Lines>(
    lines: &L,
    band: Range<usize>,
    factorisation: Factorisation,
    reference: Vector3<f64>,
    equations: &Equations,
) -> Result<Masslines, MasslineError> {
    if band.len() < MIN_LINES {
        return Err(MasslineError::TooFewLines(band.len()));
    }
    if equations.count() == 0 {
        return Err(MasslineError::NoResultant);
    }
    let spectra = Averaged::new(lines, &band);
    let excited = Excitation::new(&spectra.aa, &spectra.acceleration_noise);
    if excited.rank() == 0 {
        return Err(MasslineError::NoExcitation);
    }
    let columns = spectra.columns(factorisation, excited.rank())?;
    let pairs = |m: &Moments, p: usize| {
        let column: Vector6<f64> = columns.column(p).into();
        let af = m.fa.adjoint().map(|z| z.re);
        (
            excited.cleaner() * (af * column),
            m.ff.map(|z| z.re) * column,
        )
    };
    let mut set = Masslines::new(reference, *equations);
    let scale = 1.0 / band.len() as f64;
    for p in 0..6 {
        if columns.column(p).norm_squared() == 0.0 {
            continue;
        }
        let (mut a, mut f) = (Vector6::zeros(), Vector6::zeros());
        for line in band.clone() {
            let (al, fl) = pairs(&summed(lines, line), p);
            a += al * scale;
            f += fl * scale;
        }
        set.push(a, f, Vector6::zeros())?;
    }
    // The pairs are linear in the spectra, so noise has the same share in both.
    for j in 0..6 {
        let (noise, power) = (spectra.acceleration_noise[j], spectra.aa[(j, j)]);
        let in_pairs: f64 = set
            .pairs
            .iter()
            .map(|p| p.acceleration[j] * p.acceleration[j])
            .sum();
        if power > 0.0 {
            set.noise[(j, j)] = libm::sqrt(noise / power * in_pairs);
        }
    }
    set.scatter_over_lines(&band, lines.correlation(), |line, p| {
        let m = summed(lines, line);
        let mut used = (0..6).filter(|&c| columns.column(c).norm_squared() > 0.0);
        used.nth(p).map(|c| pairs(&m, c))
    });
    Ok(set)
}

fn summed<L: Lines>(lines: &L, line: usize) -> Moments {
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
    fn new<L: Lines>(lines: &L, band: &Range<usize>) -> Self {
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
        let l = super::regression::lower(&inner, rank).ok_or(MasslineError::Singular)?;
        let mut inverse = Matrix6::zeros();
        for c in 0..rank {
            for i in c..rank {
                let mut sum = if i == c { 1.0 } else { 0.0 };
                for k in c..i {
                    sum -= l[(i, k)] * inverse[(k, c)];
                }
                inverse[(i, c)] = sum / l[(i, i)];
            }
        }
        Ok(v.transpose() * inverse.transpose())
    }
}
