//! Method e: averaged frequency responses of the rigid body, synthesised by subtracting
//! the elastic modes of the free system.

use crate::masslines::averaging::Trend;
use crate::masslines::bands::Bands;
use crate::masslines::lines::indices;
use crate::masslines::{Complex6, FreeSystem, Lines, MasslineError, Masslines, Workspace};
use nalgebra::Complex;

/// Adds masslines from the real part over the averaging band of what remains of H when the
/// elastic modes found in the lines [`Bands::fit`] are taken out. Those are left in
/// `space`; `work` holds two elements per line.
///
/// # Errors
/// [`MasslineError`], among them [`MasslineError::TooFewRuns`] and
/// [`MasslineError::NoMode`].
#[inline(never)] // One method's working memory at a time.
pub(super) fn synthesis<L: Lines + ?Sized, const PAIRS: usize>(
    lines: &L,
    bands: &Bands,
    set: &mut Masslines<PAIRS>,
    space: &mut Workspace,
    work: &mut [Complex<f64>],
) -> Result<(), MasslineError> {
    let mut system = FreeSystem::of(lines, &set.equations);
    system.look_at(bands.averaging, bands.equations)?;
    system.modes(bands.fit, bands.modes, space, work)?;
    let modes = &space.free_modes;
    let band = indices(lines, bands.averaging)?;
    set.average(
        lines,
        &band,
        Trend::Constant,
        bands.equations,
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
