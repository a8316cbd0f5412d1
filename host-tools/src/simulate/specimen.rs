//! The specimen: a rigid-body mass matrix and fixed-base modes.
//!
//! Both kinds of model end here. With a = (ax, ay, az, α, β, γ) the acceleration of the
//! specimen frame's origin, every force and every acceleration of the specimen is
//!
//! ```text
//! f(ω) = M_0 a + Σ_r L_rᵀ D_r (L_r a)             resultants at the origin, ON the structure
//! s(ω) = X a   + Σ_r φ_r  D_r (L_r a)             one accelerometer
//! D_r  = ω² / (ω_r² - ω² + 2 j ζ_r ω_r ω)
//! ```
//!
//! which is the apparent mass M(ω) of a base-excited structure, its modes scaled to unit
//! modal mass. L_rᵀ L_r is the effective mass matrix of mode r.

use crate::frame::shift;
use nalgebra::{Matrix6, Vector3, Vector6};

/// An elastic structure as its interface sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct Specimen {
    /// Rigid-body mass matrix of eq (1) about the origin of the specimen frame: kg,
    /// kg m, kg m². Rows and columns that the model says nothing about are zero.
    pub mass_matrix: Matrix6<f64>,
    /// Fixed-base modes, ascending in frequency.
    pub modes: Vec<Mode>,
    /// `true` if the model moves in the plane y = 0 only: along x, z and about y.
    pub plane: bool,
}

/// One natural mode of the structure with its interface held fixed.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// Name of the part that moves.
    pub name: String,
    /// Undamped natural frequency, Hz.
    pub frequency: f64,
    /// Damping ratio, a share of critical damping.
    pub damping: f64,
    /// Power of ω/ω_r that the damping term rises with: 1 viscous, 0 structural.
    pub exponent: f64,
    /// L_r for unit modal mass, √kg and √kg m.
    pub participation: Vector6<f64>,
}

/// Coefficients of one channel: the row X and the modal gains of the page's equations.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Gains {
    /// Applied to the rigid-body acceleration.
    pub(super) rigid: Vector6<f64>,
    /// Applied to D_r (L_r a), in the order of the modes.
    pub(super) modal: Vec<f64>,
}

impl Specimen {
    /// The same body about the point `reference` (m, specimen frame) in place of the origin.
    pub(crate) fn about(&self, reference: &Vector3<f64>) -> Self {
        // The origin moves as seen from the point.
        let to_origin = shift(&-reference);
        let mut moved = self.clone();
        moved.mass_matrix = to_origin.tr_mul(&(self.mass_matrix * to_origin));
        for mode in &mut moved.modes {
            mode.participation = to_origin.tr_mul(&mode.participation);
        }
        moved
    }

    /// The channel that reads p·f, a combination of the six resultants at the origin.
    pub(super) fn force_gains(&self, combination: &Vector6<f64>) -> Gains {
        Gains {
            rigid: self.mass_matrix.tr_mul(combination),
            modal: self
                .modes
                .iter()
                .map(|mode| mode.participation.dot(combination))
                .collect(),
        }
    }
}

/// The row dᵀ [I | -skew(r)] of eq (2): how a point at `position` (m) moves along the
/// unit vector `direction` when the frame's origin moves.
pub(crate) fn motion_row(position: &Vector3<f64>, direction: &Vector3<f64>) -> Vector6<f64> {
    // dᵀ (-skew(r)) ω = d·(ω × r) = ω·(r × d)
    stack(direction, &position.cross(direction))
}

/// A translation and a rotation, or a force and a moment, as one vector of six.
pub(super) fn stack(upper: &Vector3<f64>, lower: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(upper.x, upper.y, upper.z, lower.x, lower.y, lower.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_moves_as_its_rows_say() {
        let r = Vector3::new(0.3, -0.2, 0.7);
        let a = Vector3::new(1.0, 2.0, 3.0);
        let omega = Vector3::new(-0.4, 0.5, 0.6);
        let moved = a + omega.cross(&r);
        let carried = shift(&r) * stack(&a, &omega);
        for (axis, direction) in [Vector3::x(), Vector3::y(), Vector3::z()]
            .iter()
            .enumerate()
        {
            let row = motion_row(&r, direction).dot(&stack(&a, &omega));
            // Six products of numbers near one: a few ε.
            assert!((row - moved[axis]).abs() < 1e-15);
            assert!((carried[axis] - moved[axis]).abs() < 1e-15);
        }
    }

    #[test]
    fn resultants_do_the_same_work_at_both_points() {
        let r = Vector3::new(0.3, -0.2, 0.7);
        let force = Vector3::new(5.0, -7.0, 2.0);
        let carried = shift(&r).tr_mul(&stack(&force, &Vector3::zeros()));
        let moment = r.cross(&force);
        for axis in 0..3 {
            assert!((carried[axis + 3] - moment[axis]).abs() < 1e-14);
        }
    }
}
