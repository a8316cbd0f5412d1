//! Method d: curve fit of the free system's frequency responses.

use crate::algebra::multiply_left;
use crate::masslines::bands::Bands;
use crate::masslines::{
    EquationWeights, FreeModes, FreeSystem, Lines, MasslineError, Masslines, Workspace,
};
use nalgebra::{Complex, Vector6};

/// Adds masslines from the constant of a fit of H over the lines [`Bands::fit`]: rigid body,
/// elastic modes with common poles, and one term for those above. The lines of the averaging
/// band only judge the excitation. The fit is left in `space`; `work` holds two elements
/// per line.
///
/// # Errors
/// [`MasslineError`], among them [`MasslineError::TooFewRuns`] and
/// [`MasslineError::NoMode`].
#[inline(never)] // One method's working memory at a time.
pub(super) fn curve_fit<L: Lines + ?Sized, const PAIRS: usize>(
    lines: &L,
    bands: &Bands,
    set: &mut Masslines<PAIRS>,
    space: &mut Workspace,
    work: &mut [Complex<f64>],
) -> Result<(), MasslineError> {
    let (fit, equations) = (bands.fit, bands.equations);
    let fit_lines = fit.len() as f64;
    let mut system = FreeSystem::of(lines, &set.equations);
    system.look_at(bands.averaging, equations)?;
    system.modes(fit, bands.modes, space, work)?;
    add_pairs(lines, &system, &space.free_modes, equations, set)?;
    set.lines = (fit_lines / lines.correlation()) as f32;
    set.freedom = (2.0 * fit_lines / lines.correlation() - 1.0).max(1.0) as f32;
    system.add_noise(set);
    Ok(())
}

/// Adds the pairs of the fit's constant, with their variances.
#[inline(never)] // Not on the stack while modes are found.
fn add_pairs<L: Lines + ?Sized, const PAIRS: usize>(
    lines: &L,
    system: &FreeSystem<'_, L>,
    modes: &FreeModes,
    equations: EquationWeights,
    set: &mut Masslines<PAIRS>,
) -> Result<(), MasslineError> {
    for j in 0..system.forces() {
        let (a, f) = system.pair(&modes.constant, j);
        set.push(a, f, Vector6::zeros())?;
    }
    let mut gain = set.best_matrix(system.excitation());
    if equations == EquationWeights::Noise {
        set.whiten_by(lines, &gain);
    }
    for (p, pair) in set.pairs.iter_mut().enumerate() {
        let mut shares = system.shares(p);
        shares.component_mul_assign(&shares.clone_owned());
        pair.variance = modes.constant_variance * shares;
    }
    // An error of the acceleration counts as the force that would make it.
    multiply_left(set.equations.rows(), &mut gain);
    gain.apply(|x| *x *= *x);
    for pair in &mut set.pairs {
        pair.variance = gain * pair.variance;
    }
    Ok(())
}
