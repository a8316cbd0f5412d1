//! Method e: averaged frequency responses of the rigid body, synthesised by subtracting
//! the elastic modes of the free system.

use super::averaging::Trend;
use super::{FreeModes, FreeSystem, Lines, MasslineError, Masslines};
use core::ops::Range;
use nalgebra::Complex;

/// Adds masslines from the real part over the lines `band` of what remains of H when the
/// elastic modes found in the lines `fit`, at most `limit`, are taken out. Those are left in
/// `modes`; `work` holds two elements per line.
///
/// # Errors
/// [`MasslineError`], among them [`MasslineError::TooFewRuns`] and
/// [`MasslineError::NoMode`].
#[inline(never)] // One method's working memory at a time.
pub fn synthesis<L: Lines + ?Sized, const PAIRS: usize>(
    lines: &L,
    band: Range<usize>,
    fit: Range<usize>,
    limit: usize,
    set: &mut Masslines<PAIRS>,
    modes: &mut FreeModes,
    work: &mut [Complex<f64>],
) -> Result<(), MasslineError> {
    let system = FreeSystem::new(lines, &band, &set.equations)?;
    system.modes(fit, limit, modes, work)?;
    set.average(
        lines,
        &band,
        Trend::Constant,
        system.forces(),
        |line, pairs| {
            let left = system.response(line)? - modes.elastic(lines.frequency(line));
            let rigid = left.map(|z| z.re);
            for (j, pair) in pairs.iter_mut().enumerate() {
                *pair = (
                    system.noise_filter() * rigid.column(j),
                    system.unit_force(j),
                );
            }
            Ok(())
        },
    )
}
