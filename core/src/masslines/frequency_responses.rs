//! Method a: averaged frequency responses of base acceleration and interface force.

use super::averaging::Trend;
use super::lines::indices;
use super::{Excitation, Lines, MasslineError, Masslines, Powers};
use crate::cells::seen;
use crate::spectra::LineRange;
use nalgebra::{Complex, Vector6};

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
    set: &mut Masslines<PAIRS>,
) -> Result<(), MasslineError> {
    let band = indices(lines, band)?;
    if set.equations.count() == 0 {
        return Err(MasslineError::NoResultant);
    }
    let mut energy = Powers::zero();
    let mut noise = Vector6::zeros();
    for run in 0..lines.runs() {
        let per_line = lines.noise(run);
        for j in 0..6 {
            noise[j] += per_line[j] * band.len() as f64;
        }
        for line in band.clone() {
            if lines.pair(run, line).is_none() {
                return Err(MasslineError::NoReference);
            }
            lines.add_powers(run, line, 1.0, &mut energy);
        }
    }
    let excited = Excitation::rank_and_cleaner(&energy.aa, &noise);
    let (rank, noise_filter) = &excited;
    if *rank == 0 {
        return Err(MasslineError::NoExcitation);
    }
    // Powers in units of noise, so that a rotation may lead as well.
    let units = noise.map(|n| if n > 0.0 { 1.0 / n } else { 0.0 });
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
    set.average(lines, &band, Trend::Constant, runs, &mut |line, pairs| {
        for (run, (pair, leader)) in pairs.iter_mut().zip(&leaders).enumerate() {
            let (a, f) = lines.pair(run, line).ok_or(MasslineError::NoReference)?;
            let lead = seen(&a)[*leader];
            let size = libm::sqrt(lead.norm_sqr());
            let turn = if size > 0.0 {
                lead.conj() / size
            } else {
                Complex::new(1.0, 0.0)
            };
            *pair = (
                noise_filter * a.map(|z| (z * turn).re),
                f.map(|z| (z * turn).re),
            );
        }
        Ok(())
    })?;
    set.share_noise(&energy.aa.diagonal(), &noise);
    Ok(())
}
