//! Exact pairs of acceleration and force to ten numbers.
//!
//! `cargo run -p massline-core --example exact_pairs`

use massline_core::identify::{Procedure, Question, identify};
use massline_core::masslines::{Massline, Masslines};
use massline_core::nalgebra::{Vector3, Vector6};
use massline_core::rigid_body::{Inertia, RigidBody};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let body = RigidBody {
        mass: 12.0,
        centre_of_gravity: Vector3::new(0.10, -0.02, 0.30),
        inertia: Inertia::from_terms([0.5, 0.6, 0.4, 0.02, -0.03, 0.01]),
    };
    let reference = Vector3::zeros();
    let matrix = body.mass_matrix(&reference);
    let pair = |a: Vector6<f64>| (a, matrix * a);
    // Two accelerations whose rotations are independent leave one inertia term unknown.
    let two = [
        Vector6::new(1.0, 0.0, 0.0, 2.0, 0.0, 0.0),
        Vector6::new(0.0, 1.0, 0.0, 0.0, 2.0, 0.0),
    ];
    let found = identify(
        &[Masslines::exact(reference, two.map(pair))?],
        &Question::default(),
    )?;
    let unknown: Vec<_> = found.unobservable().map(|p| p.name()).collect();
    println!("two runs do not tell: {}", unknown.join(", "));
    assert_eq!(unknown, ["Θzz"]);

    let third = Vector6::new(0.0, 0.0, 1.0, 0.0, 0.0, 2.0);
    let all = Masslines::exact(reference, two.into_iter().chain([third]).map(pair))?;
    let Massline {
        acceleration,
        force,
        ..
    } = all.pairs()[2];
    println!("the third: {acceleration:?} takes {force:?}");
    // The reference point moves to the centre of gravity, and the body is solved for again.
    let found = identify(&[all], &Question::new(None, Procedure::ITERATIVE))?;
    let mass = found.mass.ok_or("the mass is not observable")?.value;
    let [x, y, z] = found
        .centre_of_gravity
        .map(|x| x.map_or(f64::NAN, |x| x.value));
    println!(
        "three runs: {mass:.6} kg at ({x:.6}, {y:.6}, {z:.6}) m after {} steps",
        found.iterations
    );
    for (term, truth) in found.inertia_cg.iter().zip(body.inertia.terms()) {
        let term = term.ok_or("an inertia term is not observable")?;
        assert!((term.value - truth).abs() < 1e-9);
    }
    Ok(())
}

#[test]
fn the_numbers_hold() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
