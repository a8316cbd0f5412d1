//! Uncertainty of the directions in which the base moves.
//!
//! Where the base moves along fewer than six directions, accelerations along the others are noise and
//! are taken off. Which directions move is known from the same noisy accelerations: with c the motion
//! along the directions that were found, and n a direction that rests, the base moves by `n t c` more,
//! where t has the variance 1 / (2 Σ|c|²) in units of the noise. These few numbers are the same at all
//! lines, so that they do not average out: with three translations they bend mass and centre of
//! gravity by as much as all other noise together.

use super::descent::{self, Freedom, Problem};
use super::excited::Excited;
use super::model::{Model, RIGID};
use super::normal::Detail;
use super::record::{Complex6, Record};
use massline_core::geometry::accelerometer_places;
use nalgebra::{Complex, DVector, Matrix6, SMatrix, SVector, Vector3, Vector6};

/// Lines of each record that the effect of a tilt is taken from.
const LINES: usize = 450;
/// Mean and standard deviation of the inertia that the test does not tell, from mass, centre of gravity, and
/// the `noise` of base accelerations: that of a body whose radius of gyration about its centre is the distance of
/// the accelerometers on its base from an axis or that of the centre from their middle, whichever is longer, give
/// or take all of it. Left out, it would stand for zero, and the least rotation of the base would bend the centre
/// of gravity by more than its error bars say.
pub(super) fn likely_inertia(
    model: &Model,
    told: [bool; RIGID],
    noise: &Matrix6<f64>,
) -> [Option<[f64; 2]>; RIGID] {
    let mut likely = [None; RIGID];
    let mass = model.rigid[0];
    if mass.is_nan() || mass <= 0.0 {
        return likely;
    }
    let c = Vector3::new(model.rigid[1], model.rigid[2], model.rigid[3]) / mass;
    let (middle, wide) = accelerometer_places(noise);
    let own = wide.max((c - middle).norm_squared());
    let about_a = c.norm_squared();
    let terms = [
        own + about_a - c.x * c.x,
        own + about_a - c.y * c.y,
        own + about_a - c.z * c.z,
        c.x * c.y,
        c.x * c.z,
        c.y * c.z,
    ];
    for (i, term) in terms.into_iter().enumerate() {
        if !told[4 + i] && own > 0.0 {
            // Products of inertia are at most half the difference of two moments.
            let spread = if i < 3 { own } else { 0.5 * own };
            likely[4 + i] = Some([mass * term, mass * spread]);
        }
    }
    likely
}

/// Covariance of σ from the directions' uncertainty at `model`; `None` where numbers are not finite. Of
/// the rigid body, `freedom` has those parameters that the test tells.
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
    if excited.resting.is_empty() {
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
    for rest in excited.resting.column_iter() {
        let rest = Vector6::from_fn(|i, _| Complex::from(rest[i]));
        let forces: Vec<Vec<Complex6>> = (some.iter())
            .map(|r| {
                let lines = r.frequencies.iter();
                lines.map(|&f| model.at(r.run, f) * rest).collect()
            })
            .collect();
        for j in 0..excited.power.len() {
            let tilt = excited.variance(j).sqrt();
            let coordinate = excited.coordinates.row(j);
            let mut tilted = some.clone();
            for (record, forces) in tilted.iter_mut().zip(&forces) {
                let lines = record.base.iter().zip(&mut record.force).zip(forces);
                for ((a, f), force) in lines {
                    let c: Complex<f64> =
                        (coordinate.iter().zip(a.iter())).map(|(x, a)| a * *x).sum();
                    *f += force * (c * tilt);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The inertia about the centre of gravity is the same guess wherever A lies, and never none.
    #[test]
    fn the_guess_does_not_rest_on_the_reference_point() {
        let own = |shift: f64, height: f64| {
            let mut model = Model::rigid([0.0; RIGID], 1.0, 1);
            // The centre lies this high above the sensors, and A where the shift says.
            model.rigid[0] = 5.0;
            model.rigid[3] = 5.0 * (height + shift);
            let mut noise =
                Matrix6::from_diagonal(&nalgebra::Vector6::new(1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3));
            for (i, j, sign) in [(0, 4, -1.0), (1, 3, 1.0)] {
                noise[(i, j)] = sign * shift * 1e-3;
                noise[(j, i)] = noise[(i, j)];
                noise[(i, i)] += shift * shift * 1e-3;
            }
            let likely = likely_inertia(&model, [false; RIGID], &noise);
            likely[6].unwrap()
        };
        // The sensors lie 0.1 m² from an axis.
        for (height, square) in [(0.5, 0.25), (0.2, 0.1)] {
            for shift in [-height, 0.0, 4.0] {
                let known = own(shift, height);
                let off = known.map(|x| (x - 5.0 * square).abs());
                assert!(off.iter().all(|x| *x < 1e-12), "{known:?}");
            }
        }
    }
}
