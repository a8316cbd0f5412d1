//! Any plausible body, any layout of full rank, any reference point: without noise the
//! identification returns the body.

use massline_core::geometry::{
    Accelerometer, LoadCell, Mount, Placement, Quantity, RunGeometry, RunSensor,
};
use massline_core::identify::{Identification, Procedure, Question, identify};
use massline_core::masslines::Masslines;
use massline_core::rigid_body::{Inertia, Parameter, RigidBody, Verdict};
use nalgebra::{Matrix3, Rotation3, Vector3, Vector6};
use proptest::prelude::*;

fn vector(range: f64) -> impl Strategy<Value = Vector3<f64>> + Clone {
    let r = -range..range;
    (r.clone(), r.clone(), r).prop_map(|(x, y, z)| Vector3::new(x, y, z))
}

/// A body of a gram to ten tonnes: its principal second moments of mass are positive,
/// so its inertia obeys the triangle inequality whatever they are.
fn body() -> impl Strategy<Value = RigidBody> {
    (
        -3.0..4.0_f64,
        vector(1.0),
        [0.05..1.0_f64, 0.05..1.0, 0.05..1.0],
        vector(3.0),
    )
        .prop_map(|(log_mass, centre_of_gravity, spread, turn)| {
            let mass = 10_f64.powf(log_mass);
            let r = Rotation3::from_scaled_axis(turn);
            let second = Matrix3::from_diagonal(&Vector3::from(spread.map(|s| mass * s * s)));
            let second = r.matrix() * second * r.matrix().transpose();
            let trace = second.trace();
            RigidBody {
                mass,
                centre_of_gravity,
                inertia: Inertia {
                    xx: trace - second[(0, 0)],
                    yy: trace - second[(1, 1)],
                    zz: trace - second[(2, 2)],
                    xy: second[(0, 1)],
                    xz: second[(0, 2)],
                    yz: second[(1, 2)],
                },
            }
        })
}

/// Three accelerations with independent rotations: the least that tells all ten.
fn accelerations() -> impl Strategy<Value = [Vector6<f64>; 3]> {
    let one =
        (vector(3.0), vector(3.0)).prop_map(|(u, w)| Vector6::new(u.x, u.y, u.z, w.x, w.y, w.z));
    [one.clone(), one.clone(), one].prop_filter("independent rotations", |a| {
        let w = Matrix3::from_columns(&[0, 1, 2].map(|i| a[i].fixed_rows::<3>(3).into_owned()));
        w.determinant().abs() > 1.0
    })
}

fn exact(body: &RigidBody, reference: &Vector3<f64>, a: &[Vector6<f64>]) -> Masslines {
    let m = body.mass_matrix(reference);
    Masslines::exact(*reference, a.iter().map(|a| (*a, m * a))).unwrap()
}

/// Largest error of the ten, relative to mass, to a metre, and to the size of the inertia
/// terms about A, which includes what the distance of A from the body adds.
fn worst_error(found: &Identification, body: &RigidBody) -> f64 {
    let mut worst = (found.mass.unwrap().value / body.mass - 1.0).abs();
    for (cg, truth) in found.centre_of_gravity.iter().zip(&body.centre_of_gravity) {
        worst = worst.max((cg.unwrap().value - truth).abs());
    }
    let m = body.mass_matrix(&found.reference);
    let about_a = [
        m[(3, 3)],
        m[(4, 4)],
        m[(5, 5)],
        -m[(3, 4)],
        -m[(3, 5)],
        -m[(4, 5)],
    ];
    let size = about_a.iter().fold(0.0_f64, |s, t| s.max(t.abs()));
    for (term, truth) in found.inertia_reference.iter().zip(about_a) {
        worst = worst.max((term.unwrap().value - truth).abs() / size);
    }
    for (term, truth) in found.inertia_cg.iter().zip(body.inertia.terms()) {
        worst = worst.max((term.unwrap().value - truth).abs() / size);
    }
    worst
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1024))]

    // The equilibrated normal equations have eigenvalues down to about 1e-6 here (bodies
    // of 5 cm about points 2 m away, rotations nearly dependent), and rounding of 1e-16
    // relative to one: 1e-10, and a factor ten for the forces. The issue asks for 1e-9.
    #[test]
    fn exact_pairs_return_the_body(
        body in body(),
        reference in vector(1.0),
        a in accelerations(),
    ) {
        let set = exact(&body, &reference, &a);
        let found = identify(&[set], &Question::default()).unwrap();
        prop_assert!(worst_error(&found, &body) < 1e-9, "{}", worst_error(&found, &body));
        // Plates and rods are among them, which no error bar tells from impossible bodies.
        prop_assert_ne!(found.plausibility.verdict(), Verdict::Violated, "{:?}", found.plausibility);
        prop_assert_eq!(found.observable, [true; 10]);
    }

    #[test]
    fn a_known_mass_gives_an_indicator_of_one(
        body in body(),
        reference in vector(1.0),
        a in accelerations(),
    ) {
        let set = exact(&body, &reference, &a);
        let question = Question::new(Some(body.mass), Procedure::Direct);
        let found = identify(&[set], &question).unwrap();
        prop_assert!((found.indicator.unwrap().value - 1.0).abs() < 1e-9);
        prop_assert!(worst_error(&found, &body) < 1e-9);
    }

    #[test]
    fn the_iteration_ends_at_the_centre_of_gravity(
        body in body(),
        reference in vector(1.0),
        a in accelerations(),
    ) {
        let set = exact(&body, &reference, &a);
        let question = Question::new(None, Procedure::ITERATIVE);
        let found = identify(&[set], &question).unwrap();
        prop_assert!(worst_error(&found, &body) < 1e-9);
        prop_assert!(found.iterations <= 3);
    }

    #[test]
    fn two_runs_leave_the_inertia_about_their_common_normal_unknown(
        body in body(),
        reference in vector(1.0),
        a in accelerations(),
    ) {
        // Rotations about x and y only: Θzz is not excited, and neither is anything else lost.
        let mut two = [a[0], a[1]];
        two[0][4] = 0.0;
        two[0][5] = 0.0;
        two[0][3] += 4.0_f64.copysign(two[0][3]);
        two[1][3] = 0.0;
        two[1][5] = 0.0;
        two[1][4] += 4.0_f64.copysign(two[1][4]);
        let found = identify(&[exact(&body, &reference, &two)], &Question::default()).unwrap();
        let missing: Vec<_> = found.unobservable().collect();
        prop_assert_eq!(missing, vec![Parameter::Izz]);
        prop_assert!(found.inertia_cg[2].is_none());
        prop_assert!((found.mass.unwrap().value / body.mass - 1.0).abs() < 1e-9);
    }

    #[test]
    fn translations_tell_mass_and_centre_of_gravity_only(
        body in body(),
        reference in vector(1.0),
        u in vector(2.0),
        v in vector(2.0),
    ) {
        prop_assume!(u.cross(&v).norm() > 0.5);
        let a = [u, v].map(|u| Vector6::new(u.x, u.y, u.z, 0.0, 0.0, 0.0));
        let found = identify(&[exact(&body, &reference, &a)], &Question::default()).unwrap();
        prop_assert!((found.mass.unwrap().value / body.mass - 1.0).abs() < 1e-9);
        for (cg, truth) in found.centre_of_gravity.iter().zip(&body.centre_of_gravity) {
            prop_assert!((cg.unwrap().value - truth).abs() < 1e-9);
        }
        prop_assert!(found.inertia_reference.iter().chain(&found.inertia_cg).all(Option::is_none));
    }

    // The whole of equations (3) to (5): sensors read the body's motion and the loads that
    // hold it, and the maps give accelerations and resultants back.
    #[test]
    fn any_layout_of_full_rank_sees_the_body(
        body in body(),
        reference in vector(1.0),
        a in accelerations(),
        places in prop::collection::vec((vector(1.0), vector(1.0), 0.1..1.0_f64), 9..20),
        corners in [vector(1.0), vector(1.0), vector(1.0), vector(1.0)],
    ) {
        let sensors: Vec<_> = places.iter().filter_map(|(p, d, w)| {
            Some((Accelerometer::new(*p, *d, Mount::Interface).ok()?, *w))
        }).collect();
        let cells: Vec<_> = corners.iter().flat_map(|p| {
            Matrix3::<f64>::identity().column_iter().map(|d| {
                LoadCell::new(*p, d.into_owned(), Quantity::Force).unwrap()
            }).collect::<Vec<_>>()
        }).collect();
        // Layouts within a thousandth of a degenerate one are a matter of luck, not of rank.
        let rows: Vec<_> = sensors.iter().map(|(s, w)| s.rigid_body_row(&reference) * w.sqrt()).collect();
        let normal = rows.iter().map(|r| r.transpose() * r).sum::<nalgebra::Matrix6<f64>>();
        prop_assume!(normal.symmetric_eigenvalues().min() > 1e-2);
        let gram = cells.iter().map(|c| c.rigid_body_row(&reference))
            .map(|r| r.transpose() * r).sum::<nalgebra::Matrix6<f64>>();
        prop_assume!(gram.symmetric_eigenvalues().min() > 1e-2);
        let all = sensors.iter().map(|(s, w)| RunSensor::Accelerometer(*s, *w))
            .chain(cells.iter().map(|c| RunSensor::LoadCell(*c)));
        let mut columns = Vec::new();
        let placement = Placement::default();
        let mut geometry = RunGeometry::empty();
        geometry.describe(all, &placement, &reference, |c| columns.push(c)).unwrap();
        prop_assert_eq!(geometry.equations.count(), 6);
        let (of_sensors, of_cells) = columns.split_at(sensors.len());
        let half = |column: &[f64; 12], at: usize| Vector6::from_fn(|j, _| column[at + j]);

        let m = body.mass_matrix(&reference);
        let back: Vec<_> = a.iter().map(|a| {
            let seen: Vector6<f64> = sensors.iter().zip(of_sensors)
                .map(|((s, _), column)| half(column, 0) * (s.rigid_body_row(&reference) * a)[0])
                .sum();
            // Loads in equilibrium with the motion: the least-norm ones.
            let loads = gram.try_inverse().unwrap() * (m * a);
            let held: Vector6<f64> = cells.iter().zip(of_cells)
                .map(|(c, column)| half(column, 6) * (c.rigid_body_row(&reference) * loads)[0])
                .sum();
            (seen, held)
        }).collect();
        let set = Masslines::exact(reference, back).unwrap();
        let found = identify(&[set], &Question::default()).unwrap();
        // Conditions of 1e3 in both maps on top of the identification's own bound.
        prop_assert!(worst_error(&found, &body) < 1e-8, "{}", worst_error(&found, &body));
    }

    #[test]
    fn runs_about_different_points_speak_of_one_body(
        body in body(),
        points in [vector(1.0), vector(1.0), vector(1.0)],
        a in accelerations(),
    ) {
        let sets: Vec<_> = points.iter().zip(&a)
            .map(|(p, a)| exact(&body, p, std::slice::from_ref(a)))
            .collect();
        // Moved to one point the rotations stay independent.
        let found = identify(&sets, &Question::default()).unwrap();
        prop_assert!(worst_error(&found, &body) < 1e-9);
    }

    #[test]
    fn garbage_is_refused_and_never_panics(
        numbers in prop::collection::vec(any::<f64>(), 36),
        mass in any::<f64>(),
    ) {
        let v = |i: usize| Vector6::from_column_slice(&numbers[6 * i..6 * i + 6]);
        let pairs = [(v(0), v(1)), (v(2), v(3)), (v(4), v(5))];
        if let Ok(set) = Masslines::exact(Vector3::zeros(), pairs) {
            let question = Question::new(Some(mass), Procedure::ITERATIVE);
            let _ = identify(&[set], &question);
        }
    }
}
