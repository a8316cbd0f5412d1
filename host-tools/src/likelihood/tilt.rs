//! Uncertainty of the directions in which the base moves.
//!
//! Where the base moves along fewer than six directions, accelerations along the others are noise and
//! are taken off. Which directions move is known from the same noisy accelerations: with c the motion
//! along the directions that were found, and n a direction that rests, the base moves by `n t c` more,
//! where t has the variance 1 / (2 Σ|c|²) in units of the noise, less where it is taken for noise. These few
//! numbers are the same at all lines, so that they do not average out: with three translations they bend mass and
//! centre of gravity by as much as all other noise together.

use super::descent::{self, Freedom, Problem};
use super::excited::Excited;
use super::model::{Model, RIGID};
use super::normal::Detail;
use super::record::{Complex6, Record};
use nalgebra::{Complex, DMatrix, DVector, SMatrix, SVector, Vector6};

/// Lines of each record that the effect of a tilt is taken from.
const LINES: usize = 450;

/// Covariance of σ from the directions' uncertainty at `model`; `None` where numbers are not finite. Of
/// the rigid body, `freedom` has those parameters that may follow it.
///
/// A tilt leaves M n t c more in the residuals, of which M n nᵀ Mᴴ is what noise is taken to leave there anyway:
/// together it moves no parameter by more than its standard deviation, be it told by the lines or by priors.
pub(super) fn spread(
    problem: &Problem<'_>,
    model: &Model,
    freedom: Freedom,
    excited: &Excited,
) -> Option<SMatrix<f64, RIGID, RIGID>> {
    let mut covariance = SMatrix::zeros();
    if excited.tilts.iter().all(DMatrix::is_empty) {
        return Some(covariance);
    }
    let most = problem.records.iter().map(|r| r.frequencies.len()).max();
    let step = (most.unwrap_or(0) / LINES).max(1);
    let some: Vec<Record> = (problem.records.iter().enumerate())
        .map(|(e, r)| r.thinned(e % step, step, f64::INFINITY))
        .collect();
    let of = |records: &[Record]| {
        let tilted = Problem {
            records,
            ..*problem
        };
        tilted.system(model, freedom, Detail::Step)
    };
    let before = of(&some)?;
    let places = freedom.places(model);
    // Of the same lines: next to resonances no others have the same information.
    let inverse = descent::inverse(&before.information, &places)?;
    for (j, tilts) in excited.tilts.iter().enumerate() {
        let coordinate = excited.coordinates.row(j);
        for tilt in tilts.column_iter() {
            let tilt = Vector6::from_fn(|i, _| Complex::from(tilt[i]));
            let forces = some.iter().map(|r| {
                let lines = r.frequencies.iter();
                lines.map(|&f| model.at(r.run, f) * tilt).collect()
            });
            let forces: Vec<Vec<Complex6>> = forces.collect();
            let mut tilted = some.clone();
            for (record, forces) in tilted.iter_mut().zip(&forces) {
                let lines = record.base.iter().zip(&mut record.force).zip(forces);
                for ((a, f), force) in lines {
                    let c: Complex<f64> =
                        (coordinate.iter().zip(a.iter())).map(|(x, a)| a * *x).sum();
                    *f += force * c;
                }
            }
            let change = of(&tilted)?.score - &before.score;
            let change = DVector::from_fn(places.len(), |i, _| change[places[i]]);
            let moved = &inverse * change;
            let mut of = SVector::<f64, RIGID>::zeros();
            for (place, x) in places.iter().zip(moved.iter()) {
                if *place < RIGID {
                    of[*place] = *x;
                }
            }
            covariance += of * of.transpose();
        }
    }
    Some(covariance)
}
