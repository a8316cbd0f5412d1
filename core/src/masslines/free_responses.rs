//! Method c: averaged frequency responses of the free system.

use super::averaging::Trend;
use super::lines::indices;
use super::{Complex6, EquationWeights, FreeSystem, Lines, MasslineError, Masslines};
use crate::spectra::LineRange;

/// Adds masslines from the real part of H over the lines `band`: unit forces and the
/// accelerations that go with them.
///
/// With `squared` the average is replaced by the value at ω = 0 of `Re H = H₀ + H₂ ω²`,
/// the leading term of all elastic modes: the best that can be done without their poles.
///
/// # Errors
/// [`MasslineError`], among them [`MasslineError::TooFewRuns`].
#[inline(never)] // One method's working memory at a time.
pub(crate) fn free_responses<L: Lines + ?Sized, const PAIRS: usize>(
    lines: &L,
    band: LineRange,
    squared: bool,
    equations: EquationWeights,
    set: &mut Masslines<PAIRS>,
) -> Result<(), MasslineError> {
    let mut system = FreeSystem::of(lines, &set.equations);
    system.look_at(band, equations)?;
    let band = indices(lines, band)?;
    let trend = if squared {
        Trend::Squared
    } else {
        Trend::Constant
    };
    let (excitation, count) = (system.excitation(), system.forces());
    set.average(
        lines,
        &band,
        trend,
        equations,
        excitation,
        count,
        &mut |line, pairs| {
            let mut h = Complex6::zeros();
            system.response_into(line, &mut h)?;
            system.pairs(&h, pairs);
            Ok(())
        },
    )?;
    system.add_noise(set);
    Ok(())
}
