//! Guess of the inertia that the test does not tell.

use super::descent::Problem;
use super::model::{Model, RIGID};
use super::record::Record;
use massline_core::geometry::accelerometer_places;
use nalgebra::{DMatrix, DVector, Matrix6, SMatrix, Vector3};

/// Most steps towards the scale of the guess's deviations, and change at which they end.
const STEPS: usize = 1000;
const SETTLED: f64 = 1e-4;
/// Distance of a centre of gravity that the test does not tell from the middle of the accelerometers, over theirs from an
/// axis: a standard deviation.
const HIGH: f64 = 2.0;
/// Scale from which the guess is widened.
const WIDER: f64 = 1.1;

/// Parameters of the rigid body that are sought.
#[derive(Clone, Debug)]
pub(super) struct Body {
    /// Those that are free.
    pub(super) free: [bool; RIGID],
    /// Means and standard deviations of those that the test does not tell.
    pub(super) likely: [Option<[f64; 2]>; RIGID],
}

impl Body {
    /// Those that the test tells.
    pub(super) fn told(free: [bool; RIGID]) -> Self {
        Self {
            free,
            likely: [None; RIGID],
        }
    }

    /// The same with a guess of the others among first moments and inertia, from what a model tells of mass and centre of
    /// gravity and the `noise` of base accelerations.
    pub(super) fn guessed(told: [bool; RIGID], model: &Model, noise: &Matrix6<f64>) -> Self {
        let likely = likely_body(model, told, noise);
        let free = core::array::from_fn(|i| told[i] || likely[i].is_some());
        Self { free, likely }
    }

    /// Records with leakage, beside these guesses.
    pub(super) fn problem<'a>(&'a self, records: &'a [Record], threads: usize) -> Problem<'a> {
        Problem {
            body: Some(&self.likely),
            ..Problem::new(records, true, threads)
        }
    }

    /// The same with deviations from the guess as large as the data say (the scale of most marginal likelihood, by the
    /// steps of Dempster, Laird and Rubin 1977), from the fitted model and its `covariance` beside this guess; `None`
    /// where they are no larger. A body may be far larger than its sensors tell.
    pub(super) fn widened(
        &self,
        model: &Model,
        covariance: &SMatrix<f64, RIGID, RIGID>,
    ) -> Option<Self> {
        let guessed: Vec<(usize, [f64; 2])> = (self.likely.iter().enumerate())
            .filter_map(|(i, known)| Some((i, (*known)?)))
            .collect();
        let n = guessed.len();
        // In units of the guess's deviations.
        let own = DMatrix::from_fn(n, n, |i, j| {
            let ((a, [_, of_a]), (b, [_, of_b])) = (guessed[i], guessed[j]);
            covariance[(a, b)] / (of_a * of_b)
        });
        let away = DVector::from_fn(n, |i, _| {
            let (a, [mean, deviation]) = guessed[i];
            (model.rigid[a] - mean) / deviation
        });
        let weights = own.cholesky()?.inverse();
        let told = &weights * away;
        let mut scale = 1.0_f64;
        for _ in 0..STEPS {
            let mut weights = weights.clone();
            for i in 0..n {
                weights[(i, i)] += 1.0 / (scale * scale) - 1.0;
            }
            let own = weights.cholesky()?.inverse();
            let square = ((&own * &told).norm_squared() + own.trace()) / n as f64;
            let before = scale;
            scale = square.sqrt().max(1.0);
            if (scale - before).abs() < SETTLED * scale {
                break;
            }
        }
        let mut wider = self.clone();
        for [_, deviation] in wider.likely.iter_mut().flatten() {
            *deviation *= scale;
        }
        (scale > WIDER).then_some(wider)
    }

    /// Least share of its deviation beforehand that a guessed parameter has left in the fitted `covariance`; `None` without
    /// a guess.
    pub(super) fn left(&self, covariance: &SMatrix<f64, RIGID, RIGID>) -> Option<f64> {
        let shares = self.likely.iter().enumerate().filter_map(|(i, known)| {
            let [_, deviation] = (*known)?;
            Some(covariance[(i, i)].sqrt() / deviation)
        });
        shares.reduce(f64::min)
    }

    /// Puts the guesses into a model.
    pub(super) fn put(&self, model: &mut Model) {
        for (x, known) in model.rigid.iter_mut().zip(&self.likely) {
            if let Some([mean, _]) = known {
                *x = *mean;
            }
        }
    }
}

/// Mean and standard deviation of first moments and inertia that the test does not tell, from mass, centre of gravity, and
/// the `noise` of base accelerations: those of a body above the middle of the accelerometers on its base, give or take
/// [`HIGH`] times their distance from an axis, whose radius of gyration about its centre is that distance or that of the
/// centre from their middle, whichever is longer, give or take all of it. Left out, they would stand for zero, and the
/// least rotation of the base would bend mass and centre of gravity by more than their error bars say.
fn likely_body(
    model: &Model,
    told: [bool; RIGID],
    noise: &Matrix6<f64>,
) -> [Option<[f64; 2]>; RIGID] {
    let mut likely = [None; RIGID];
    let mass = model.rigid[0];
    if mass.is_nan() || mass <= 0.0 {
        return likely;
    }
    let (middle, wide) = accelerometer_places(noise);
    let c = Vector3::from_fn(|i, _| match told[1 + i] {
        true => model.rigid[1 + i] / mass,
        false => middle[i],
    });
    for i in 0..3 {
        if !told[1 + i] && wide > 0.0 {
            likely[1 + i] = Some([mass * middle[i], mass * HIGH * wide.sqrt()]);
        }
    }
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
            let told = core::array::from_fn(|i| i < 4);
            let likely = likely_body(&model, told, &noise);
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
