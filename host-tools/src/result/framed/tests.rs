use super::*;
use crate::identification::estimates;
use crate::result::ResultDocument;
use crate::result::tests::{FORK, fork_in};
use massline_core::geometry::Placement;
use massline_core::identify::{Procedure, Question, Workspace, identify_in};
use massline_core::masslines::Masslines;
use massline_core::rigid_body::{Inertia, RigidBody};
use nalgebra::{Matrix3, Vector6};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A random number from -1 to 1.
fn uniform(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

fn turned(rotation: [f64; 3], origin: [f64; 3]) -> Frame {
    let placement = Placement::new(rotation.into(), Vector3::zeros()).unwrap();
    // The axes are the columns of the rotation.
    let axes = placement.rotation().into();
    Frame { origin, axes }
}

const REFERENCE: [f64; 3] = [0.3, -0.2, 0.1];

/// A body whose centre of gravity is far from its reference point, with products of either sign.
fn body() -> RigidBody {
    RigidBody {
        mass: 3.0,
        centre_of_gravity: Vector3::new(2.1, -1.2, 4.3),
        inertia: Inertia::from_terms([0.5, 0.6, 0.7, 0.05, -0.14, 0.03]),
    }
}

/// Standard deviation of the noise of each resultant of [`identified`].
const NOISE: f64 = 1e-3;

/// The identification of the body from eight random accelerations, with noise drawn from `seed` or
/// without any; the noise is known either way.
fn identified(known_mass: Option<f64>, seed: Option<u64>) -> (Identification, Covariance) {
    identified_with(NOISE, known_mass, seed)
}

/// The same with noise of this standard deviation.
fn identified_with(
    std: f64,
    known_mass: Option<f64>,
    seed: Option<u64>,
) -> (Identification, Covariance) {
    let reference = Vector3::from(REFERENCE);
    let matrix = body().mass_matrix(&reference);
    let mut motion = ChaCha8Rng::seed_from_u64(4);
    let mut noise = ChaCha8Rng::seed_from_u64(seed.unwrap_or(0));
    let pairs: Vec<_> = (0..8)
        .map(|_| {
            let acceleration = Vector6::from_fn(|_, _| uniform(&mut motion));
            // Uniform from -1 to 1 has the variance of a third.
            let error = Vector6::from_fn(|_, _| std * 3.0_f64.sqrt() * uniform(&mut noise));
            let error = if seed.is_some() {
                error
            } else {
                Vector6::zeros()
            };
            let variance = Vector6::repeat(std * std);
            (acceleration, matrix * acceleration + error, variance)
        })
        .collect();
    let set: Masslines = Masslines::with_variances(reference, pairs).unwrap();
    let mut space = Workspace::EMPTY;
    let question = Question::new(known_mass, Procedure::Direct);
    let found = identify_in(&[set], &question, &mut space).unwrap();
    (found, space.covariance())
}

/// Centre of gravity, inertia about A and about S in a frame, from mass, centre of gravity and inertia
/// about it along the axes of the sensors, by the textbook.
fn in_frame(frame: &Frame, all: &[f64; 10]) -> [f64; 15] {
    let axes = Matrix3::from_fn(|i, j| frame.axes[j][i]);
    let from_origin = Vector3::new(all[1], all[2], all[3]) - Vector3::from(frame.origin);
    let centre = axes.transpose() * from_origin;
    let [xx, yy, zz, xy, xz, yz] = std::array::from_fn(|k| all[4 + k]);
    let tensor = Matrix3::new(xx, -xy, -xz, -xy, yy, -yz, -xz, -yz, zz);
    let r = Vector3::new(all[1], all[2], all[3]) - Vector3::from(REFERENCE);
    let about_a = tensor + all[0] * (Matrix3::identity() * r.dot(&r) - r * r.transpose());
    let mut numbers = [0.0; 15];
    numbers[..3].copy_from_slice(centre.as_slice());
    for (at, tensor) in [(3, about_a), (9, tensor)] {
        let t = axes.transpose() * tensor * axes;
        let products = [t[(0, 1)], t[(0, 2)], t[(1, 2)]].map(|x| -x);
        numbers[at..at + 3].copy_from_slice(t.diagonal().as_slice());
        numbers[at + 3..at + 6].copy_from_slice(&products);
    }
    numbers
}

fn ten() -> [f64; 10] {
    let body = body();
    let mut all = [body.mass; 10];
    all[1..4].copy_from_slice(body.centre_of_gravity.as_slice());
    all[4..].copy_from_slice(&body.inertia.terms());
    all
}

fn numbers(i: &Identification) -> Vec<Estimate> {
    estimates(i)[place::CENTRE..]
        .iter()
        .map(|e| e.unwrap())
        .collect()
}

const FRAMES: [([f64; 3], [f64; 3]); 4] = [
    ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
    ([30.0, -70.0, 110.0], [0.5, -7.0, 2.0]),
    ([0.0, 0.0, 33.0], [0.0, 0.0, 9.0]),
    ([-170.0, 12.0, 1.0], [-3.0, 0.1, 0.2]),
];

/// With a centre of gravity that is hardly told, a thousandth of a degree changes no error bar by more than that
/// rotation has of another: the second order is in those about S of any frame, and of no other point.
#[test]
fn a_frame_turned_by_little_keeps_wide_error_bars() {
    for known_mass in [None, Some(body().mass)] {
        let (found, covariance) = identified_with(2.5, known_mass, None);
        let centre = found.centre_of_gravity[2].unwrap().std;
        assert!(centre > 0.2, "{centre}");
        let frame = turned([1e-3, -1e-3, 1e-3], [0.0; 3]);
        let framed = identification(&frame, &found, Some(&covariance));
        for (k, (a, b)) in numbers(&found).iter().zip(numbers(&framed)).enumerate() {
            let ratio = b.std / a.std;
            assert!((ratio - 1.0).abs() < 1e-3, "{known_mass:?} {k}: {ratio}");
        }
    }
}

/// Values by the textbook, standard deviations by its derivative in finite differences, and by the second order, which is
/// most of some where the centre of gravity is hardly told.
#[test]
fn numbers_and_deviations_are_those_of_the_textbook() {
    let masses = [None, Some(body().mass)];
    for (known_mass, noise) in masses.into_iter().flat_map(|m| [(m, NOISE), (m, 2.5)]) {
        let (found, covariance) = identified_with(noise, known_mass, None);
        for (rotation, origin) in FRAMES {
            let frame = turned(rotation, origin);
            let framed = identification(&frame, &found, Some(&covariance));
            let values = in_frame(&frame, &ten());
            let mut jacobian = SMatrix::<f64, 15, 10>::zeros();
            for column in 0..10 {
                let side = |step: f64| {
                    let mut all = ten();
                    all[column] += step;
                    SVector::<f64, 15>::from(in_frame(&frame, &all))
                };
                // All of it is a polynomial of third degree: the error is 1e-12 of 1e-2 squared,
                // and rounding of numbers of order 100 over 1e-4.
                let h = 1e-4;
                let mut slope = (side(h) - side(-h)) / (2.0 * h);
                if column == 0 && known_mass.is_some() {
                    // What stands there is Δ, and the mass is exact.
                    slope.fill(0.0);
                }
                jacobian.set_column(column, &slope);
            }
            let matrix = Matrix10::from_fn(|i, j| covariance[i][j].unwrap());
            let mut expected = jacobian * matrix * jacobian.transpose();
            // The second order of the inertia about S is in the standard deviations alone.
            let turned = super::covariance(&frame, &covariance);
            let bent = with_second_order(Some(body().mass), &turned);
            for k in 0..6 {
                expected[(9 + k, 9 + k)] +=
                    bent[4 + k][4 + k].unwrap() - turned[4 + k][4 + k].unwrap();
            }
            for (k, number) in numbers(&framed).iter().enumerate() {
                // The solve of a system of condition 1e3 or so with numbers of order 100.
                assert!(
                    (number.value - values[k]).abs() < 1e-10,
                    "{k}: {number:?} {}",
                    values[k]
                );
                let std = expected[(k, k)].sqrt();
                assert!(
                    (number.std / std - 1.0).abs() < 1e-8,
                    "{k}: {number:?} {std}"
                );
            }
            assert_eq!(framed.mass, found.mass);
            assert_eq!(framed.reference, frame.point(&found.reference));
        }
    }
}

/// The scatter of 2000 draws is the standard deviation to within 1/√4000 = 1.6 %; five times that.
#[test]
fn deviations_are_the_scatter_of_noisy_draws() {
    let frame = turned([30.0, -70.0, 110.0], [0.5, -7.0, 2.0]);
    let (found, covariance) = identified(None, None);
    let stated = numbers(&identification(&frame, &found, Some(&covariance)));
    let mut squares = [0.0; 15];
    for seed in 0..2000 {
        let (found, covariance) = identified(None, Some(seed));
        let draw = numbers(&identification(&frame, &found, Some(&covariance)));
        for ((sum, draw), mean) in squares.iter_mut().zip(draw).zip(&stated) {
            *sum += (draw.value - mean.value).powi(2) / 2000.0;
        }
    }
    for (k, (square, stated)) in squares.iter().zip(&stated).enumerate() {
        let ratio = square.sqrt() / stated.std;
        assert!((ratio - 1.0).abs() < 0.08, "{k}: {ratio}");
    }
}

/// The covariance of the framed numbers is that of the document's rows, with the second order about S.
#[test]
fn the_covariance_fits_the_deviations() {
    let frame = turned([30.0, -70.0, 110.0], [0.5, -7.0, 2.0]);
    let (found, matrix) = identified(None, None);
    let framed = numbers(&identification(&frame, &found, Some(&matrix)));
    let matrix = with_second_order(
        Some(found.mass.unwrap().value),
        &covariance(&frame, &matrix),
    );
    for k in 0..3 {
        let ratio = matrix[1 + k][1 + k].unwrap().sqrt() / framed[k].std;
        assert!((ratio - 1.0).abs() < 1e-12, "{ratio}");
    }
    for k in 0..6 {
        let ratio = matrix[4 + k][4 + k].unwrap().sqrt() / framed[9 + k].std;
        // Squares of sums of six terms, some of which cancel.
        assert!((ratio - 1.0).abs() < 1e-9, "{ratio}");
    }
    let (_, own) = identified(None, None);
    assert_eq!(covariance(&Frame::default(), &own), own);
}

/// Axes along those of the sensors give the same bits, in other places and with other signs.
#[test]
fn quarter_turns_are_exact() {
    let (found, matrix) = identified(None, None);
    let same = identification(&Frame::default(), &found, Some(&matrix));
    assert_eq!(same, found);
    // x along y, y along -x.
    let frame = turned([0.0, 0.0, 90.0], [0.0; 3]);
    let turned = numbers(&identification(&frame, &found, None));
    let own = numbers(&found);
    for (k, from, sign) in [
        (0, 1, 1.0),
        (1, 0, -1.0),
        (2, 2, 1.0),
        (9, 10, 1.0),
        (10, 9, 1.0),
        (12, 12, -1.0),
        (13, 14, 1.0),
        (14, 13, -1.0),
    ] {
        let value = sign * own[from].value;
        let std = own[from].std;
        assert_eq!(turned[k], Estimate { value, std }, "{k}");
    }
}

/// Without a covariance no deviation is too small.
#[test]
fn deviations_without_a_covariance_are_bounds() {
    let frame = turned([30.0, -70.0, 110.0], [0.5, -7.0, 2.0]);
    let (found, matrix) = identified(None, None);
    let exact = numbers(&identification(&frame, &found, Some(&matrix)));
    let bounds = numbers(&identification(&frame, &found, None));
    for (exact, bound) in exact.iter().zip(&bounds) {
        assert_eq!(exact.value, bound.value);
        assert!(exact.std <= bound.std, "{exact:?} {bound:?}");
    }
}

/// A plane test does not tell what lies across its plane: a frame that is turned about the normal
/// keeps what it tells, any other loses what would be a mixture.
#[test]
fn a_mixture_with_what_is_not_observable_is_not_observable() {
    let (document, truth) = fork_in("origin = [0.1, 0.2, 0.3]\nx = [0.8, 0, 0.6]\ny = \"+y\"\n");
    let observable = |document: &ResultDocument| -> Vec<&'static str> {
        let all = document.properties().into_iter();
        all.filter(|p| p.number.observable)
            .map(|p| p.name)
            .collect()
    };
    assert_eq!(observable(&document), observable(&FORK));
    assert_eq!(document.inertia_cg.yy, FORK.inertia_cg.yy);
    let frame = document.frame.unwrap();
    assert_eq!(frame.axes[1], [0.0, 1.0, 0.0]);
    let [x, _, z] = FORK
        .centre_of_gravity
        .each_ref()
        .map(|n| n.value.unwrap_or(0.0));
    let along = 0.8 * (x - 0.1) + 0.6 * (z - 0.3);
    let number = &document.centre_of_gravity[0];
    // Two products of numbers of order 0.1.
    assert!((number.value.unwrap() - along).abs() < 1e-16, "{number:?}");
    // Type B goes along: the same sources, in other shares.
    let both = number.combined.as_ref().unwrap();
    assert!(both.std > number.std.unwrap() && number.type_b.as_ref().unwrap().source.is_some());
    let error = number.value.unwrap() - truth.in_frame(&frame).centre_of_gravity[0].unwrap();
    assert!(error.abs() < 4.0 * both.std, "{error} {both:?}");

    let (document, truth) = fork_in("x = \"+x\"\nz = [0, 0.6, 0.8]\n");
    let lost = observable(&document);
    assert!(lost.contains(&"centre_of_gravity.x"), "{lost:?}");
    for name in [
        "centre_of_gravity.z",
        "inertia_cg.yy",
        "inertia_reference.yy",
    ] {
        assert!(!lost.contains(&name), "{lost:?}");
    }
    let frame = document.frame.unwrap();
    assert_eq!(truth.in_frame(&frame).centre_of_gravity[2], None);
    // Effective masses along a mixture are not known, either.
    assert!(document.fixed_modes[0].effective_mass[0].is_some());
    assert_eq!(document.fixed_modes[0].effective_mass[2], None);
}

#[test]
fn resultants_turn_as_vectors() {
    let frame = turned([0.0, 0.0, 90.0], [1.0, 2.0, 3.0]);
    let turned = resultants(&frame, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    assert_eq!(turned, [2.0, -1.0, 3.0, 5.0, -4.0, 6.0]);
}
