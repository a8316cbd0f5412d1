//! Method c: averaged frequency responses of the free system.

use crate::masslines::averaging::Trend;
use crate::masslines::bands::Bands;
use crate::masslines::lines::indices;
use crate::masslines::{Complex6, FreeSystem, Lines, MasslineError, Masslines};

/// Adds masslines from the real part of H over the averaging band: unit forces and the
/// accelerations that go with them.
///
/// With `squared` the average is replaced by the value at ω = 0 of `Re H = H₀ + H₂ ω²`,
/// the leading term of all elastic modes: the best that can be done without their poles.
///
/// # Errors
/// [`MasslineError`], among them [`MasslineError::TooFewRuns`].
#[inline(never)] // One method's working memory at a time.
pub(super) fn free_responses<L: Lines + ?Sized, const PAIRS: usize>(
    lines: &L,
    bands: &Bands,
    squared: bool,
    set: &mut Masslines<PAIRS>,
) -> Result<(), MasslineError> {
    let mut system = FreeSystem::of(lines, &set.equations);
    system.look_at(bands.averaging, bands.equations)?;
    let band = indices(lines, bands.averaging)?;
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
        bands.equations,
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
