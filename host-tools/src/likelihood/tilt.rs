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
use super::record::Record;
use massline_core::geometry::accelerometer_places;
use nalgebra::{Complex, DVector, Matrix6, SMatrix, SVector, Vector3};

/// Lines of each record that the effect of a tilt is taken from.
const LINES: usize = 450;
/// Share of a parameter's information that comes or goes with a tilt, from which that is all it has. The base
/// rotates by about as much as the directions are uncertain: information that rests on this doubles or
/// vanishes, and a tilt would move such a parameter without limit. Other information changes by the
/// tilt itself, some 1e-4.
const BY_TILT: f64 = 0.2;

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
pub(super) fn spread(
    problem: &Problem<'_>,
    model: &Model,
    freedom: Freedom,
    excited: &Excited,
) -> Option<SMatrix<f64, RIGID, RIGID>> {
    if excited.resting.is_empty() {
        return Some(SMatrix::zeros());
    }
    let most = problem.records.iter().map(|r| r.frequencies.len()).max();
    let step = (most.unwrap_or(0) / LINES).max(1);
    let some: Vec<Record> = (problem.records.iter().enumerate())
        .map(|(e, r)| r.thinned(e % step, step, f64::INFINITY))
        .collect();
    let places = freedom.places(model);
    let mut seen = vec![true; places.len()];
    let untilted = Problem {
        records: &some,
        ..*problem
    };
    let before = untilted.system(model, freedom, Detail::Step)?;
    // What is known beforehand does not tilt, and would hide that the lines tell nothing.
    let system = |records: &[Record]| {
        let alone = Problem {
            records,
            rest: None,
            body: None,
            ..*problem
        };
        alone.system(model, freedom, Detail::Step)
    };
    let told = system(&some)?;
    let mut changes = Vec::new();
    for j in 0..excited.power.len() {
        let tilt = excited.variance(j).sqrt();
        let coordinate = excited.coordinates.row(j);
        for rest in excited.resting.column_iter() {
            let at = |sign: f64| {
                let mut tilted = some.clone();
                for a in tilted.iter_mut().flat_map(|r| &mut r.base) {
                    let c: Complex<f64> =
                        (coordinate.iter().zip(a.iter())).map(|(x, a)| a * *x).sum();
                    for (a, n) in a.iter_mut().zip(rest.iter()) {
                        *a += c * (sign * tilt * n);
                    }
                }
                system(&tilted)
            };
            let (up, down) = (at(1.0)?, at(-1.0)?);
            for (seen, &i) in seen.iter_mut().zip(&places) {
                let own = told.information[(i, i)];
                for tilted in [&up, &down] {
                    *seen &= (tilted.information[(i, i)] - own).abs() <= BY_TILT * own;
                }
            }
            changes.push((up.score - down.score) * 0.5);
        }
    }
    let places: Vec<usize> = (places.into_iter().zip(seen))
        .filter_map(|(place, seen)| seen.then_some(place))
        .collect();
    // Of the same lines: next to resonances no others have the same information.
    let inverse = descent::inverse(&before.information, &places)?;
    let mut covariance = SMatrix::zeros();
    for change in changes {
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
