//! Method e: averaged frequency responses of the rigid body, synthesised by subtracting
//! the elastic modes of the free system.

use super::averaging::Trend;
use super::{FreeModes, FreeSystem, Lines, MasslineError, Masslines};
use crate::geometry::Equations;
use core::ops::Range;
use nalgebra::{Complex, Vector3};

/// Masslines from the real part over the lines `band` of what remains of H when the
/// elastic modes found in the lines `fit` are taken out.
///
/// # Errors
/// [`MasslineError`], among them [`MasslineError::TooFewRuns`] and
/// [`MasslineError::NoMode`].
#[inline(never)] // One method's working memory at a time.
pub fn synthesis<L: Lines + ?Sized>(
    lines: &L,
    band: Range<usize>,
    fit: Range<usize>,
    modes: usize,
    reference: Vector3<f64>,
    equations: &Equations,
    work: &mut [Complex<f64>],
) -> Result<(Masslines, FreeModes), MasslineError> {
    let system = FreeSystem::new(lines, &band, equations)?;
    let modes = system.modes(fit, modes, work)?;
    let mut set = system.empty(reference);
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
    )?;
    Ok((set, modes))
}
