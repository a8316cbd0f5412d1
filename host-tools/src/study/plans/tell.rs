//! Numbers that a test determines: by exact kinematics, without samples and without the core.
//!
//! The ten unknowns σ = (m, mx, my, mz, Θxx, Θyy, Θzz, Θxy, Θxz, Θyz) about A enter linearly:
//! each direction of acceleration that a run excites and each resultant that the load cells
//! measure is one row of B σ = f, equation (8). A parameter is told by the test if its unit
//! vector lies in the space of these rows, found by singular values.

use nalgebra::{DMatrix, DVector, Matrix6, SMatrix, SVector, Vector6};

/// Equations of one run: directions of acceleration of A, the resultants that are
/// measured, and the noise of both, as the averaging leaves it.
pub(super) struct Excited {
    /// m/s² and rad/s².
    pub(super) accelerations: Vec<Vector6<f64>>,
    /// Measured combinations of the six resultants at A.
    pub(super) equations: Vec<Vector6<f64>>,
    /// Covariance of the acceleration's noise at A.
    pub(super) acceleration_noise: Matrix6<f64>,
    /// Covariance of the resultants' noise at A.
    pub(super) force_noise: Matrix6<f64>,
    /// Independent readings that are averaged.
    pub(super) readings: f64,
    /// Gain of signal over noise by averaging, in power.
    pub(super) gain: f64,
}

/// Rows of (8) for one acceleration.
pub(in crate::study) fn rows(a: &Vector6<f64>) -> SMatrix<f64, 6, 10> {
    let [x, y, z, p, q, r] = [a[0], a[1], a[2], a[3], a[4], a[5]];
    #[rustfmt::skip]
    let rows = SMatrix::<f64, 6, 10>::from_row_slice(&[
        x,   0.0, -r,  q,   0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        y,   r,   0.0, -p,  0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        z,   -q,  p,   0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, z,   -y,  p,   0.0, 0.0, -q,  -r,  0.0,
        0.0, -z,  0.0, x,   0.0, q,   0.0, -p,  0.0, -r,
        0.0, y,   -x,  0.0, 0.0, 0.0, r,   0.0, -p,  -q,
    ]);
    rows
}

/// `true` for each of the sixteen numbers that a test determines: mass, centre of gravity,
/// inertia about S, about A.
pub(super) type Told = [bool; 16];

/// Numbers that a test determines, if that is beyond doubt.
pub(super) enum Verdict {
    /// Told or not, number by number.
    Clear(Told),
    /// Near the border; in words where.
    Doubtful(&'static str),
}

/// Unit vectors this far out of the row space are not told; rounding is some 1e-13.
const OUT: f64 = 1e-6;
/// Unit vectors that are out of the row space by less than this square are on the border: where
/// an excitation is only as clear as [`CLEAR`] asks for, noise turns it by a tenth of that.
const NEARLY: f64 = 10.0 / CLEAR;
/// Ratio of excitation to noise in power from which an excited direction is beyond doubt: ten
/// times what the core asks for.
const CLEAR: f64 = 1000.0;
/// The error bar that an ideal estimator would have, as a share of the body's own scale, up to
/// which a parameter counts as told.
const SHARP: f64 = 0.01;

/// Judges a test of a body with this mass matrix about A and this size (m). With `weighed` the
/// mass is known.
pub(super) fn tell(runs: &[Excited], body: &Matrix6<f64>, size: f64, weighed: bool) -> Verdict {
    let mass = body[(0, 0)];
    // Metres in units of the size, so that singular values compare.
    let scales = SVector::<f64, 10>::from_fn(|i, _| match i {
        0 => mass,
        1..4 => mass * size,
        _ => mass * size * size * 0.1,
    });
    let mut count = 0;
    let mut information = SMatrix::<f64, 10, 10>::zeros();
    let mut stacked: Vec<SVector<f64, 10>> = Vec::new();
    for run in runs {
        let equations = DMatrix::from_fn(run.equations.len(), 6, |i, j| run.equations[i][j]);
        let noise = run.force_noise + body * run.acceleration_noise * body.transpose();
        let noise = &equations * noise * equations.transpose();
        let Some(root) = noise.cholesky() else {
            return Verdict::Doubtful("a resultant without noise");
        };
        for a in &run.accelerations {
            let rows = &equations
                * rows(a)
                * DMatrix::from_diagonal(&DVector::from_column_slice(scales.as_slice()));
            let Some(white) = root.l().solve_lower_triangular(&rows) else {
                return Verdict::Doubtful("a resultant without noise");
            };
            for row in white.row_iter() {
                let row = SVector::<f64, 10>::from_fn(|i, _| row[i]);
                information += row * row.transpose() * run.readings;
                stacked.push(row);
                count += 1;
            }
        }
    }
    if !excited_clearly(runs) {
        return Verdict::Doubtful("an acceleration near its noise");
    }
    if weighed {
        let mut row = SVector::<f64, 10>::zeros();
        row[0] = stacked.iter().map(|row| row.norm()).fold(0.0, f64::max);
        // Exact: a thousand times what all the rest says.
        information[(0, 0)] += 1e6 * information.diagonal().max();
        stacked.push(row);
        count += 1;
    }
    if count == 0 {
        return Verdict::Clear(follow([false; 10], weighed));
    }
    let matrix = DMatrix::from_fn(count, 10, |i, j| stacked[i][j]);
    let svd = matrix.svd(false, true);
    let Some(right) = svd.v_t else {
        return Verdict::Doubtful("no singular values");
    };
    let largest = svd.singular_values.max();
    let mut space = SMatrix::<f64, 10, 10>::zeros();
    let mut inverse = SMatrix::<f64, 10, 10>::zeros();
    for (k, &value) in svd.singular_values.iter().enumerate() {
        let v = SVector::<f64, 10>::from_fn(|i, _| right[(k, i)]);
        if value > 1e-4 * largest {
            space += v * v.transpose();
            let weight = (v.transpose() * information * v)[0];
            inverse += v * v.transpose() / weight;
        } else if value > 1e-9 * largest {
            return Verdict::Doubtful("a weak combination");
        }
    }
    let mut linear = [false; 10];
    for (i, told) in linear.iter_mut().enumerate() {
        let out = 1.0 - space[(i, i)];
        if out < OUT * OUT {
            *told = true;
            if i > 0 || !weighed {
                let std = inverse[(i, i)].max(0.0).sqrt();
                if std > SHARP {
                    return Verdict::Doubtful("a wide error bar");
                }
            }
        } else if out < NEARLY {
            return Verdict::Doubtful("a parameter nearly told");
        }
    }
    Verdict::Clear(follow(linear, weighed))
}

/// From σ to the sixteen numbers.
fn follow(linear: [bool; 10], weighed: bool) -> Told {
    let mass = linear[0] || weighed;
    let centre = [1, 2, 3].map(|i| linear[i] && mass);
    let mut told = [false; 16];
    told[0] = mass;
    told[1..4].copy_from_slice(&centre);
    // Each term of inertia moves with the coordinates along these two axes.
    let axes = [[1, 2], [0, 2], [0, 1], [0, 1], [0, 2], [1, 2]];
    for (term, [i, j]) in axes.into_iter().enumerate() {
        let about_a = linear[4 + term];
        told[10 + term] = about_a;
        told[4 + term] = about_a && centre[i] && centre[j] && mass;
    }
    told
}

/// `true` if every excited direction stands well above the accelerometers' noise, all runs
/// together.
fn excited_clearly(runs: &[Excited]) -> bool {
    let mut power = Matrix6::zeros();
    let mut noise = Matrix6::zeros();
    let mut gain = f64::INFINITY;
    for run in runs {
        for a in &run.accelerations {
            power += a * a.transpose();
        }
        noise += run.acceleration_noise;
        gain = gain.min(run.gain);
    }
    // In units of the noise, component by component at first: metres and radians mix.
    let Some(root) =
        (noise + Matrix6::from_diagonal(&noise.diagonal()) * 1e-9 + Matrix6::identity() * 1e-30)
            .cholesky()
    else {
        return false;
    };
    let Some(half) = root.l().solve_lower_triangular(&power) else {
        return false;
    };
    let Some(white) = root.l().solve_lower_triangular(&half.transpose()) else {
        return false;
    };
    let values = ((white + white.transpose()) * 0.5).symmetric_eigenvalues();
    let largest = values.max();
    // Unexcited directions are zero but for rounding.
    values
        .iter()
        .all(|&v| v <= 1e-9 * largest || v * gain > CLEAR)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(accelerations: &[[f64; 6]]) -> Excited {
        let unit = |i: usize| Vector6::from_fn(|j, _| f64::from(u8::from(i == j)));
        Excited {
            accelerations: accelerations.iter().map(|a| Vector6::from(*a)).collect(),
            equations: (0..6).map(unit).collect(),
            acceleration_noise: Matrix6::identity() * 1e-8,
            force_noise: Matrix6::identity() * 1e-8,
            readings: 100.0,
            gain: 10.0,
        }
    }

    fn told(runs: &[Excited], weighed: bool) -> Told {
        match tell(runs, &(Matrix6::identity() * 2.0), 1.0, weighed) {
            Verdict::Clear(told) => told,
            Verdict::Doubtful(why) => panic!("{why}"),
        }
    }

    /// Equation (11): translations tell mass and centre of gravity, no inertia.
    #[test]
    fn translations_tell_four() {
        let runs = [
            run(&[[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]]),
            run(&[[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]]),
        ];
        let all = told(&runs, false);
        assert_eq!(&all[..4], &[true; 4]);
        assert_eq!(&all[4..], &[false; 12]);
    }

    /// A vertical shaker does not tell how high the centre of gravity lies.
    #[test]
    fn one_axis_tells_three() {
        let all = told(&[run(&[[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]])], false);
        assert_eq!(&all[..4], &[true, true, true, false]);
    }

    /// Two rotations leave the inertia about the axis normal to both: rank nine.
    #[test]
    fn two_runs_leave_one_and_three_leave_none() {
        let mut runs = vec![
            run(&[[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]]),
            run(&[[0.0, 1.0, 0.0, 0.0, 1.0, 0.0]]),
        ];
        let all = told(&runs, false);
        assert_eq!(all.iter().filter(|t| !**t).count(), 2);
        assert!(!all[6] && !all[12]);
        runs.push(run(&[[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]]));
        assert_eq!(told(&runs, false), [true; 16]);
    }

    /// Rotation about A alone: forces give m r, moments the inertia, nothing gives m; with the
    /// mass weighed the centre of gravity follows.
    #[test]
    fn rotations_alone_do_not_tell_the_mass() {
        let about = |i: usize| {
            let mut a = [0.0; 6];
            a[3 + i] = 1.0;
            run(&[a])
        };
        let runs = [about(0), about(1), about(2)];
        let all = told(&runs, false);
        assert_eq!(&all[..10], &[false; 10]);
        assert_eq!(&all[10..], &[true; 6]);
        assert_eq!(told(&runs, true), [true; 16]);
    }

    /// The row of a weighed mass is as long as the longest of the others: shorter by 1e4 it would
    /// count as no row, longer by that the others would.
    #[test]
    fn a_weighed_mass_counts_however_strongly_the_test_shakes() {
        for strength in [1.0, 1e3, 1e6] {
            let about = |i: usize| {
                let mut a = [0.0; 6];
                a[3 + i] = strength;
                run(&[a])
            };
            let runs = [about(0), about(1), about(2)];
            assert_eq!(told(&runs, true), [true; 16], "{strength}");
            assert!(!told(&runs, false)[0], "{strength}");
        }
        // The mass alone, where nothing else is measured.
        let mut mass = [false; 16];
        mass[0] = true;
        assert_eq!(told(&[], true), mass);
    }

    /// One force along x under x and rotation q about y measures m x + m z q alone, so that the
    /// mass is out of the row space by q² / (1 + q²): a hundredth for q = 0.1005.
    #[test]
    fn a_mass_that_is_nearly_told_is_on_the_border() {
        let of = |q: f64| {
            let runs = [Excited {
                equations: vec![Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)],
                ..run(&[[1.0, 0.0, 0.0, 0.0, q, 0.0]])
            }];
            match tell(&runs, &(Matrix6::identity() * 2.0), 1.0, false) {
                Verdict::Clear(told) => Ok(told[0]),
                Verdict::Doubtful(why) => Err(why),
            }
        };
        assert_eq!(of(0.0), Ok(true));
        assert_eq!(of(1e-7), Ok(true));
        for q in [1e-5, 0.05, 0.1000] {
            assert_eq!(of(q), Err("a parameter nearly told"), "{q}");
        }
        for q in [0.1010, 0.5, 1.0] {
            assert_eq!(of(q), Ok(false), "{q}");
        }
    }
}
