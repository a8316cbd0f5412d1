//! One door to all methods: averaged lines in, masslines out.

use super::averaging::noise_of_runs;
use super::bands::{Bands, EquationWeights};
use super::methods::{self, Method, Task};
use super::moved::Moved;
use super::workspace::Found;
use super::{ApparentMass, FreeModes, Lines, MasslineError, Masslines, Workspace};
use crate::geometry::{Equations, least_translation};
use nalgebra::{Complex, Vector3};

/// Result of a method.
#[derive(Clone, Debug, PartialEq)]
pub struct Condensed {
    /// The pairs.
    pub masslines: Masslines,
    /// The fit behind them, for [`Method::ApparentMass`].
    pub apparent_mass: Option<ApparentMass>,
    /// The modes behind them, for [`Method::CurveFit`] and [`Method::Synthesis`].
    pub free_modes: Option<FreeModes>,
}

/// Condenses `lines` to masslines about `reference` by `method`. `work` holds two elements
/// per line. For stacks of some 64 KiB or more; see [`condense_into`].
///
/// # Errors
/// [`MasslineError`], what the method lacks.
pub fn condense<L: Lines + ?Sized>(
    method: Method,
    lines: &L,
    bands: &Bands,
    reference: Vector3<f64>,
    equations: &Equations,
    work: &mut [Complex<f64>],
) -> Result<Condensed, MasslineError> {
    let mut masslines = Masslines::new(reference, *equations);
    let mut space = Workspace::EMPTY;
    condense_into(method, lines, bands, &mut masslines, &mut space, work)?;
    Ok(Condensed {
        masslines,
        apparent_mass: space.apparent_mass().cloned(),
        free_modes: space.free_modes().cloned(),
    })
}

/// Condenses `lines` by `method` to masslines, which are added to the empty `set` about the
/// reference point and in the equations that it has. `work` holds two elements per line.
///
/// # Errors
/// [`MasslineError`], what the method lacks.
#[inline(never)] // Not on the stack of what else its caller does.
pub fn condense_into<L: Lines + ?Sized, const PAIRS: usize>(
    method: Method,
    lines: &L,
    bands: &Bands,
    set: &mut Masslines<PAIRS>,
    space: &mut Workspace,
    work: &mut [Complex<f64>],
) -> Result<(), MasslineError> {
    lines.check()?;
    // Read only where the method has succeeded.
    space.found = methods::leaves(method);
    // Estimators work at a point of the body, whichever reference point was given: their
    // choices and their rounding then do not depend on it.
    let shift = match bands.equations {
        EquationWeights::Noise => centre_of_noise(lines),
        EquationWeights::Unit => Vector3::zeros(),
    };
    let given = set.equations;
    set.reference += shift;
    set.equations = given.at(&shift);
    let task = Task {
        lines: &Moved::new(lines, &shift),
        given: lines,
        shift: &shift,
        bands,
        set: &mut *set,
        space: &mut *space,
        work,
    };
    methods::run(method, task)?;
    match space.found {
        Found::ApparentMass => space.apparent_mass.move_by(&shift),
        Found::FreeModes => space.free_modes.move_by(&shift, &given, &given.at(&shift)),
        Found::Nothing => {}
    }
    set.move_by(&-shift);
    Ok(())
}

/// From A to the point at which the noise of the translations is least, m.
#[inline(never)] // The noise is off the stack when a method works.
fn centre_of_noise<L: Lines + ?Sized>(lines: &L) -> Vector3<f64> {
    least_translation(&noise_of_runs(lines, 1).acceleration)
}
