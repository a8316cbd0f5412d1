//! The inertia tensor, its parallel axes and its principal axes.

use crate::algebra::symmetric_eigen;
use core::ops::Add;
use nalgebra::{Matrix3, Vector3};

/// Six inertia terms in kg m². Products carry a plus sign, `xy = ∫ x y dm`, and enter
/// the tensor with a minus sign.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Inertia {
    /// ∫ (y² + z²) dm
    pub xx: f64,
    /// ∫ (x² + z²) dm
    pub yy: f64,
    /// ∫ (x² + y²) dm
    pub zz: f64,
    /// ∫ x y dm
    pub xy: f64,
    /// ∫ x z dm
    pub xz: f64,
    /// ∫ y z dm
    pub yz: f64,
}

impl Add for Inertia {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self {
            xx: self.xx + o.xx,
            yy: self.yy + o.yy,
            zz: self.zz + o.zz,
            xy: self.xy + o.xy,
            xz: self.xz + o.xz,
            yz: self.yz + o.yz,
        }
    }
}

/// Principal moments (ascending, kg m²) and their axes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PrincipalInertia {
    /// Principal moments, smallest first.
    pub moments: Vector3<f64>,
    /// Unit axes as columns, a right-handed set in the order of the moments.
    pub axes: Matrix3<f64>,
}

impl Inertia {
    /// Terms in the fixed order xx, yy, zz, xy, xz, yz.
    #[must_use]
    pub fn terms(&self) -> [f64; 6] {
        [self.xx, self.yy, self.zz, self.xy, self.xz, self.yz]
    }

    /// From terms in the fixed order.
    #[must_use]
    pub fn from_terms([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> Self {
        Self {
            xx,
            yy,
            zz,
            xy,
            xz,
            yz,
        }
    }

    /// The inertia of a point mass (kg) at `r` (m) about the origin of `r`.
    #[must_use]
    pub(crate) fn of_point(mass: f64, r: &Vector3<f64>) -> Self {
        let (x, y, z) = (r.x, r.y, r.z);
        Self {
            xx: mass * (y * y + z * z),
            yy: mass * (x * x + z * z),
            zz: mass * (x * x + y * y),
            xy: mass * x * y,
            xz: mass * x * z,
            yz: mass * y * z,
        }
    }

    /// Parallel axes: from the CG to a point from which the CG lies at `r` (m).
    #[must_use]
    pub(crate) fn about_point_off_cg(&self, mass: f64, r: &Vector3<f64>) -> Self {
        *self + Self::of_point(mass, r)
    }

    /// The symmetric tensor as it stands in equation (1): products with a minus sign.
    #[must_use]
    pub(crate) fn tensor(&self) -> Matrix3<f64> {
        Matrix3::new(
            self.xx, -self.xy, -self.xz, //
            -self.xy, self.yy, -self.yz, //
            -self.xz, -self.yz, self.zz,
        )
    }

    /// Principal moments and axes.
    #[must_use]
    pub(crate) fn principal(&self) -> PrincipalInertia {
        let mut vectors = Matrix3::zeros();
        let values = symmetric_eigen(&mut self.tensor(), &mut vectors);
        let moments = Vector3::new(values[2], values[1], values[0]);
        let mut axes = Matrix3::zeros();
        for column in 0..3 {
            let mut axis: Vector3<f64> = vectors.column(2 - column).into();
            // An axis has no sense; the largest component positive makes it unique.
            if axis.get(axis.iamax()).is_some_and(|largest| *largest < 0.0) {
                axis = -axis;
            }
            axes.set_column(column, &axis);
        }
        if axes.determinant() < 0.0 {
            let flipped = -axes.column(2);
            axes.set_column(2, &flipped);
        }
        PrincipalInertia { moments, axes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_axes_rebuild_the_tensor() {
        let i = Inertia {
            xx: 2.0,
            yy: 3.0,
            zz: 2.5,
            xy: 0.3,
            xz: -0.2,
            yz: 0.4,
        };
        let p = i.principal();
        let back = p.axes * Matrix3::from_diagonal(&p.moments) * p.axes.transpose();
        // Numbers of order 3, a few dozen roundings.
        assert!((back - i.tensor()).norm() < 1e-14);
        assert!(p.moments[0] <= p.moments[1] && p.moments[1] <= p.moments[2]);
        assert!((p.axes.determinant() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn a_brick_has_its_closed_form() {
        // 1 x 2 x 3 m, 12 kg: m/12 (b² + c²) and so on.
        let brick = Inertia::from_terms([13.0, 10.0, 5.0, 0.0, 0.0, 0.0]);
        assert_eq!(brick.principal().moments, Vector3::new(5.0, 10.0, 13.0));
        let off = brick.about_point_off_cg(12.0, &Vector3::new(1.0, 1.0, 0.0));
        assert_eq!(off.terms(), [25.0, 22.0, 29.0, 12.0, 0.0, 0.0]);
    }
}
