//! The Cramér-Rao bound: the least covariance that any unbiased estimate can have.
//!
//! Unknown are the ten numbers, frequency, damping and participation of each mode, and the base
//! acceleration at every line, along directions that are known as well as the accelerometers tell
//! them. Leakage is not: a bound knows how each record begins and ends.

use super::descent::{self, Freedom, Problem};
use super::excited::Excited;
use super::fit::{Covariance10, FitError, corner};
use super::model::{Model, RIGID};
use super::normal::Detail;
use super::record::Record;
use super::{start, tilt};

/// Bound of the covariance of those of σ that the test tells, `rigid`, for records without noise of
/// their own, whose `noise` is that of the test, and the true model.
///
/// # Errors
/// [`FitError`] where nothing moves, or numbers are not finite.
pub fn bound(
    records: &[Record],
    model: &Model,
    rigid: [bool; RIGID],
) -> Result<Covariance10, FitError> {
    let freedom = Freedom::least(rigid);
    let excited = Excited::of(records).ok_or(FitError::NoExcitation)?;
    let mut records = records.to_vec();
    excited.project(&mut records);
    let possible = model.upper.map(|_| start::possible_rest(model));
    let problem = Problem {
        rest: possible.as_ref(),
        ..Problem::new(&records, false, 1)
    };
    let system = problem
        .system(model, freedom, Detail::Step)
        .ok_or(FitError::Singular)?;
    let places = freedom.places(model);
    let inverse = descent::inverse(&system.information, &places).ok_or(FitError::Singular)?;
    let tilt = tilt::spread(&problem, model, freedom, &excited).ok_or(FitError::Singular)?;
    Ok(corner(&inverse, &places) * 0.5 + tilt)
}
