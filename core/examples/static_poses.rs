//! Static poses: the mass and the centre of gravity of what is only put down and tilted.
//!
//! `cargo run -p massline-core --example static_poses`

use massline_core::geometry::Equations;
use massline_core::identify::{Question, identify};
use massline_core::masslines::StaticPoses;
use massline_core::nalgebra::{Matrix6, Vector3, Vector6};
use massline_core::rigid_body::{Inertia, RigidBody};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let body = RigidBody {
        mass: 12.0,
        centre_of_gravity: Vector3::new(0.10, -0.02, 0.30),
        inertia: Inertia::from_terms([0.5, 0.6, 0.4, 0.02, -0.03, 0.01]),
    };
    let reference = Vector3::zeros();
    let matrix = body.mass_matrix(&reference);
    // Load cells at rest do not read zero; the offsets are estimated with the body.
    let offset = Vector6::new(3.0, -2.0, 120.0, 0.5, -0.4, 0.1);
    let tilts: [[f64; 3]; 8] = [
        [0.0, 0.0, 1.0],
        [0.5, 0.0, 0.87],
        [-0.5, 0.0, 0.87],
        [0.0, 0.5, 0.87],
        [0.0, -0.5, 0.87],
        [0.4, 0.4, 0.82],
        [-0.4, 0.4, 0.82],
        [0.0, 0.0, -1.0],
    ];
    let mut poses = StaticPoses::default();
    for (number, [x, y, z]) in tilts.into_iter().enumerate() {
        let specific_force = Vector6::new(x, y, z, 0.0, 0.0, 0.0) * 9.81;
        // A reading is good to some 10 mN and 1 mN m.
        let error = |j: usize| ((number * 7 + j * 3) % 5) as f64 - 2.0;
        let error = Vector6::from_fn(|j, _| error(j) * if j < 3 { 1e-2 } else { 1e-3 });
        poses.add(&specific_force, &(matrix * specific_force + offset + error));
    }
    // The accelerometers resolve a tenth of a milligravity.
    let noise = Matrix6::identity() * (1e-3 * 1e-3);
    let fit = poses.masslines(reference, &Equations::all(), &noise, None)?;
    let found = identify(&[fit.masslines], &Question::default())?;
    let mass = found.mass.ok_or("the mass is not observable")?;
    println!(
        "mass {:.4} ± {:.4} kg",
        mass.value,
        mass.interval(found.freedom)
    );
    assert!((mass.value - body.mass).abs() < 5.0 * mass.interval(found.freedom));
    for (cg, truth) in found.centre_of_gravity.iter().zip(&body.centre_of_gravity) {
        let cg = cg.ok_or("the centre of gravity is not observable")?;
        println!("cg   {:.5} ± {:.5} m", cg.value, cg.interval(found.freedom));
        assert!((cg.value - truth).abs() < 5.0 * cg.interval(found.freedom));
    }
    // At rest nothing turns, so that no inertia shows.
    assert!(found.inertia_reference.iter().all(Option::is_none));
    Ok(())
}

#[test]
fn the_numbers_hold() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
