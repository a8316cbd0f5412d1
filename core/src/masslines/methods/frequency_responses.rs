//! Method a: averaged frequency responses of base acceleration and interface force.

use crate::cells::seen;
use crate::masslines::averaging::{Trend, noise_of_runs};
use crate::masslines::bands::Bands;
use crate::masslines::lines::{add_powers, indices};
use crate::masslines::moments::add_scaled;
use crate::masslines::{Excitation, Lines, MasslineError, Masslines, Powers};
use core::ops::Range;
use nalgebra::{Complex, Matrix6};

/// Adds masslines from the real parts of the measured frequency responses, averaged over the
/// averaging band: one pair per run, which needs a drive or a stepped sine.
///
/// Real parts mean something only where the base moves in phase with what the responses
/// are referred to. A drive signal reaches the table late, so every line is first turned
/// to the phase of the strongest base acceleration.
///
/// # Errors
/// [`MasslineError`] if the band is too short, nothing is excited or measured, or the
/// runs have no common reference.
#[inline(never)] // One method's working memory at a time.
pub(super) fn frequency_responses<L: Lines + ?Sized, const PAIRS: usize>(
    lines: &L,
    bands: &Bands,
    set: &mut Masslines<PAIRS>,
) -> Result<(), MasslineError> {
    let band = indices(lines, bands.averaging)?;
    if set.equations.count() == 0 {
        return Err(MasslineError::NoResultant);
    }
    let mut excitation = Excitation::NONE;
    let mut leaders = heapless::Vec::<usize, PAIRS>::new();
    look_at(lines, &band, &mut excitation, &mut leaders)?;
    let runs = lines.runs();
    let trend = Trend::Constant;
    set.average(
        lines,
        &band,
        trend,
        bands.equations,
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
    set.set_averaged_noise(&noise_of_lines(lines, &band));
    Ok(())
}

/// Leaves the directions that the runs excite in `excitation`, and of each run the strongest of
/// its accelerations in `leaders`.
#[inline(never)] // Its sums are off the stack when lines are averaged.
fn look_at<L: Lines + ?Sized, const PAIRS: usize>(
    lines: &L,
    band: &Range<usize>,
    excitation: &mut Excitation,
    leaders: &mut heapless::Vec<usize, PAIRS>,
) -> Result<(), MasslineError> {
    let noise = noise_of_runs(lines, band.len()).acceleration;
    // Powers in units of noise, so that a rotation may lead as well.
    let units = noise
        .diagonal()
        .map(|n| if n > 0.0 { 1.0 / n } else { 0.0 });
    let mut energy = Powers::zero();
    for run in 0..lines.runs() {
        let mut powers = Powers::zero();
        for line in band.clone() {
            if lines.pair(run, line).is_none() {
                return Err(MasslineError::NoReference);
            }
            add_powers(lines, run, line, 1.0, &mut powers);
        }
        let leader = powers.aa.diagonal().component_mul(&units).imax();
        // More runs than pairs are refused below.
        let _ = leaders.push(leader);
        add_scaled(&mut energy.aa, &powers.aa, 1.0);
    }
    excitation.decide(&energy.aa, &noise);
    if excitation.rank() == 0 {
        return Err(MasslineError::NoExcitation);
    }
    match lines.runs() {
        runs if runs > PAIRS => Err(MasslineError::TooManyPairs {
            limit: PAIRS,
            found: runs,
        }),
        _ => Ok(()),
    }
}

/// Noise of the accelerations, summed over all runs and lines: that of the moments, in which the
/// responses have a weight.
#[inline(never)] // One run's noise on the stack.
fn noise_of_lines<L: Lines + ?Sized>(lines: &L, band: &Range<usize>) -> Matrix6<f64> {
    let mut sum = Matrix6::zeros();
    for run in 0..lines.runs() {
        let mut shares = 0.0;
        for line in band.clone() {
            let weight = lines.pair_weight(run, line) * band.len() as f64;
            if weight > 0.0 {
                shares += 1.0 / weight;
            }
        }
        add_scaled(&mut sum, &lines.noise(run).acceleration, shares);
    }
    sum
}
