//! Method e: averaged frequency responses of the rigid body, synthesised by subtracting
//! the elastic modes of the free system.

use super::averaging::Trend;
use super::lines::indices;
use super::{Complex6, EquationWeights, FreeSystem, Lines, MasslineError, Masslines, Workspace};
use crate::spectra::LineRange;
use nalgebra::Complex;

/// Adds masslines from the real part over the lines `band` of what remains of H when the
/// elastic modes found in the lines `fit`, at most `limit`, are taken out. Those are left in
/// `space`; `work` holds two elements per line.
///
/// # Errors
/// [`MasslineError`], among them [`MasslineError::TooFewRuns`] and
/// [`MasslineError::NoMode`].
#[inline(never)] // One method's working memory at a time.
#[expect(
    clippy::too_many_arguments,
    reason = "all that a method works on, and in"
)]
pub(crate) fn synthesis<L: Lines + ?Sized, const PAIRS: usize>(
    lines: &L,
    band: LineRange,
    fit: LineRange,
    limit: usize,
    equations: EquationWeights,
    set: &mut Masslines<PAIRS>,
    space: &mut Workspace,
    work: &mut [Complex<f64>],
) -> Result<(), MasslineError> {
    let mut system = FreeSystem::of(lines, &set.equations);
    system.look_at(band, equations)?;
    system.modes(fit, limit, space, work)?;
    let modes = &space.free_modes;
    let band = indices(lines, band)?;
    set.average(
        lines,
        &band,
        Trend::Constant,
        equations,
        system.excitation(),
        system.forces(),
        &mut |line, pairs| {
            let mut rigid = Complex6::zeros();
            system.response_into(line, &mut rigid)?;
            modes.take_elastic(lines.frequency(line), &mut rigid);
            system.pairs(&rigid, pairs);
            Ok(())
        },
    )?;
    system.add_noise(set);
    Ok(())
}
