//! Method a: averaged frequency responses of base acceleration and interface force.

use super::averaging::{Trend, noise_of_runs};
use super::lines::indices;
use super::{EquationWeights, Excitation, Lines, MasslineError, Masslines, Powers};
use crate::cells::seen;
use crate::spectra::LineRange;
use nalgebra::{Complex, Matrix6};

/// Adds masslines from the real parts of the measured frequency responses, averaged over the
/// lines `band`: one pair per run, which needs a drive or a stepped sine.
///
/// Real parts mean something only where the base moves in phase with what the responses
/// are referred to. A drive signal reaches the table late, so every line is first turned
/// to the phase of the strongest base acceleration.
///
/// # Errors
/// [`MasslineError`] if the band is too short, nothing is excited or measured, or the
/// runs have no common reference.
#[inline(never)] // One method's working memory at a time.
pub fn frequency_responses<L: Lines + ?Sized, const PAIRS: usize>(
    lines: &L,
    band: LineRange,
    equations: EquationWeights,
    set: &mut Masslines<PAIRS>,
) -> Result<(), MasslineError> {
    let band = indices(lines, band)?;
    if set.equations.count() == 0 {
        return Err(MasslineError::NoResultant);
    }
    let mut energy = Powers::zero();
    for run in 0..lines.runs() {
        for line in band.clone() {
            if lines.pair(run, line).is_none() {
                return Err(MasslineError::NoReference);
            }
            lines.add_powers(run, line, 1.0, &mut energy);
        }
    }
    let noise = noise_of_runs(lines, band.len()).acceleration;
    let excitation = Excitation::new(&energy.aa, &noise);
    if excitation.rank() == 0 {
        return Err(MasslineError::NoExcitation);
    }
    // Powers in units of noise, so that a rotation may lead as well.
    let units = noise
        .diagonal()
        .map(|n| if n > 0.0 { 1.0 / n } else { 0.0 });
    let runs = lines.runs();
    if runs > PAIRS {
        return Err(MasslineError::TooManyPairs {
            limit: PAIRS,
            found: runs,
        });
    }
    let leaders: heapless::Vec<usize, PAIRS> = (0..runs)
        .map(|run| {
            let mut m = Powers::zero();
            for line in band.clone() {
                lines.add_powers(run, line, 1.0, &mut m);
            }
            m.aa.diagonal().component_mul(&units).imax()
        })
        .collect();
    let trend = Trend::Constant;
    set.average(
        lines,
        &band,
        trend,
        equations,
        &excitation,
        runs,
        &mut |line, pairs| {
            for (run, (pair, leader)) in pairs.iter_mut().zip(&leaders).enumerate() {
                let (a, f) = lines.pair(run, line).ok_or(MasslineError::NoReference)?;
                let lead = seen(&a)[*leader];
                let size = libm::sqrt(lead.norm_sqr());
                let turn = if size > 0.0 {
                    lead.conj() / size
                } else {
                    Complex::new(1.0, 0.0)
                };
                *pair = (a.map(|z| (z * turn).re), f.map(|z| (z * turn).re));
            }
            Ok(())
        },
    )?;
    let mut of_lines = Matrix6::zeros();
    for run in 0..runs {
        let noise = lines.noise(run).acceleration;
        for line in band.clone() {
            // The noise is that of the moments, in which the responses have a weight.
            let weight = lines.pair_weight(run, line) * band.len() as f64;
            if weight > 0.0 {
                of_lines += noise / weight;
            }
        }
    }
    set.set_averaged_noise(&of_lines);
    Ok(())
}
