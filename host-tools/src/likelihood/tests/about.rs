//! Models and records about another point.

use super::*;
use massline_core::rigid_body::{Inertia, RigidBody};
use nalgebra::Vector3;

const SHIFT: Vector3<f64> = Vector3::new(0.7, -2.0, 3.0);

/// Two modes, and others beyond the lines.
fn model() -> Model {
    let mut model = two_modes(1);
    model.set_upper_matrix(&Matrix6::from_fn(|i, j| {
        0.1 + ((i + 1) * (j + 1)) as f64 * 0.01
    }));
    model
}

/// The rigid body of a moved model is that of equation (1) about the other point, and back it is what it was.
#[test]
fn a_moved_model_is_of_the_same_body() {
    let ([mass, x, y, z, inertia @ ..], _) = numbers(&body(), &Vector3::zeros(), None);
    let expected = RigidBody {
        mass,
        centre_of_gravity: Vector3::new(x, y, z),
        inertia: Inertia::from_terms(inertia),
    };
    let moved = model().about(&SHIFT);
    let off = moved.rigid_matrix() - expected.mass_matrix(&SHIFT);
    // A few roundings of numbers up to two hundred.
    assert!(off.norm() < 1e-12, "{off}");
    let back = moved.about(&-SHIFT);
    for (a, b) in back.rigid.iter().zip(body()) {
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }
}

/// Moved forces follow from moved accelerations by the moved model, at a frequency where modes count; the
/// noise of a residual is that of the moved residual.
#[test]
fn moved_records_follow_the_moved_model() {
    let model = model();
    let mut here = record(&model, 0, 1, false);
    let frequency = here.frequencies[0];
    let spread = |record: &Record, model: &Model| {
        let m = model.at(0, frequency);
        let complex = |m: Matrix6<f64>| m.map(Complex::from);
        complex(record.noise.force) + m * complex(record.noise.base) * m.adjoint()
    };
    let before = spread(&here, &model);
    // Without leakage.
    here.force[0] = model.at(0, frequency) * here.base[0];
    let (there, model) = (here.about(&SHIFT), model.about(&SHIFT));
    let expected = model.at(0, frequency) * there.base[0];
    let off = (there.force[0] - expected).norm() / expected.norm();
    assert!(off < 1e-13, "{off}");
    // Tᵀ N_B T = N_A.
    let carry = crate::frame::shift(&SHIFT).map(Complex::from);
    let back = carry.adjoint() * spread(&there, &model) * carry;
    let off = (back - before).norm() / before.norm();
    assert!(off < 1e-12, "{off}");
}
