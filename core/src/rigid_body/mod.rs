//! The ten rigid-body properties, the mass matrix (1), parallel axes, principal axes
//! and physical plausibility.

mod inertia;
mod plausibility;

pub use inertia::{Inertia, PrincipalInertia};
pub(crate) use plausibility::{Bounded, Moments, check};
pub use plausibility::{Margin, Plausibility, Verdict};

use crate::geometry::skew;
use nalgebra::{Matrix6, Vector3};

/// The ten unknowns, in the order of equation (6). In equation (7) the first is the
/// indicator Δ and the next three are the centre of gravity itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Parameter {
    /// Overall mass m, or the indicator Δ when the mass is known.
    Mass,
    /// m x, or x when the mass is known.
    FirstMomentX,
    /// m y, or y.
    FirstMomentY,
    /// m z, or z.
    FirstMomentZ,
    /// Moment of inertia Θxx about A.
    Ixx,
    /// Moment of inertia Θyy about A.
    Iyy,
    /// Moment of inertia Θzz about A.
    Izz,
    /// Product of inertia Θxy = ∫ x y dm about A.
    Ixy,
    /// Product of inertia Θxz = ∫ x z dm about A.
    Ixz,
    /// Product of inertia Θyz = ∫ y z dm about A.
    Iyz,
}

impl Parameter {
    /// All ten in their fixed order.
    pub(crate) const ALL: [Self; 10] = [
        Self::Mass,
        Self::FirstMomentX,
        Self::FirstMomentY,
        Self::FirstMomentZ,
        Self::Ixx,
        Self::Iyy,
        Self::Izz,
        Self::Ixy,
        Self::Ixz,
        Self::Iyz,
    ];

    /// Name in tables and messages.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mass => "mass",
            Self::FirstMomentX => "x of the CG",
            Self::FirstMomentY => "y of the CG",
            Self::FirstMomentZ => "z of the CG",
            Self::Ixx => "Θxx",
            Self::Iyy => "Θyy",
            Self::Izz => "Θzz",
            Self::Ixy => "Θxy",
            Self::Ixz => "Θxz",
            Self::Iyz => "Θyz",
        }
    }
}

/// A rigid body: mass, centre of gravity S and inertia about S.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidBody {
    /// Overall mass m, kg.
    pub mass: f64,
    /// Centre of gravity S, m, in the frame of the sensors.
    pub centre_of_gravity: Vector3<f64>,
    /// Inertia about S, kg m².
    pub inertia: Inertia,
}

impl RigidBody {
    /// Inertia about any point (m), by the parallel-axis rule.
    pub(crate) fn inertia_about(&self, point: &Vector3<f64>) -> Inertia {
        self.inertia
            .about_point_off_cg(self.mass, &(self.centre_of_gravity - point))
    }

    /// The mass matrix of equation (1) about the reference point A (m).
    #[must_use]
    pub fn mass_matrix(&self, reference: &Vector3<f64>) -> Matrix6<f64> {
        let first_moment = skew(&(self.centre_of_gravity - reference)) * self.mass;
        let mut m = Matrix6::identity() * self.mass;
        m.fixed_view_mut::<3, 3>(0, 3).copy_from(&-first_moment);
        m.fixed_view_mut::<3, 3>(3, 0).copy_from(&first_moment);
        m.fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&self.inertia_about(reference).tensor());
        m
    }

    /// The ten parameters of equation (6) about A: m, m r and the inertia about A.
    #[cfg(test)]
    pub(crate) fn sigma(&self, reference: &Vector3<f64>) -> [f64; 10] {
        let r = (self.centre_of_gravity - reference) * self.mass;
        let i = self.inertia_about(reference);
        [self.mass, r.x, r.y, r.z, i.xx, i.yy, i.zz, i.xy, i.xz, i.yz]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{resultants_at, transfer};
    use nalgebra::Vector6;

    fn body() -> RigidBody {
        RigidBody {
            mass: 3.0,
            centre_of_gravity: Vector3::new(0.1, -0.2, 0.3),
            inertia: Inertia {
                xx: 0.5,
                yy: 0.6,
                zz: 0.7,
                xy: 0.05,
                xz: -0.04,
                yz: 0.03,
            },
        }
    }

    #[test]
    fn equation_1_has_the_papers_signs() {
        let m = body().mass_matrix(&Vector3::zeros());
        let (mx, my, mz) = (0.3, -0.6, 0.9);
        assert!((m[(0, 4)] - mz).abs() < 1e-15 && (m[(0, 5)] + my).abs() < 1e-15);
        assert!((m[(1, 3)] + mz).abs() < 1e-15 && (m[(1, 5)] - mx).abs() < 1e-15);
        assert!((m[(2, 3)] - my).abs() < 1e-15 && (m[(2, 4)] + mx).abs() < 1e-15);
        assert_eq!(m, m.transpose());
    }

    #[test]
    fn the_mass_matrix_moves_with_the_reference_point_like_accelerations_and_forces() {
        let (a, b) = (Vector3::new(0.4, 0.5, -0.6), Vector3::new(-1.0, 0.2, 0.9));
        let shift = b - a;
        let acceleration = Vector6::new(0.3, -1.2, 0.7, 0.9, -0.5, 0.1);
        let at_a = body().mass_matrix(&a) * acceleration;
        let at_b = body().mass_matrix(&b) * (transfer(&shift) * acceleration);
        // Numbers of order 10 after a dozen operations.
        assert!((resultants_at(&shift, &at_a) - at_b).norm() < 1e-14);
    }
}
