//! Moving the reference point: the exact 6 x 6 transform of equation (2).

use super::skew;
use nalgebra::{Matrix6, Vector3, Vector6};

/// T with `a_B = T a_A`, where B lies at `shift = r_B - r_A` (m).
///
/// The translational part is equation (2), `u_B = [ I | -skew(shift) ] u_A`; a rigid
/// body turns the same way everywhere, so the rotational part is the identity.
#[must_use]
pub(crate) fn transfer(shift: &Vector3<f64>) -> Matrix6<f64> {
    let mut t = Matrix6::identity();
    t.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(shift));
    t
}

/// The resultants at B of the resultants `f` at A, with `shift = r_B - r_A` (m).
///
/// Virtual work fixes it: `a_B · f_B = a_A · f_A`, so `f_A = Tᵀ f_B`. The force stays,
/// the moment loses `shift × force`.
#[must_use]
pub(crate) fn resultants_at(shift: &Vector3<f64>, f: &Vector6<f64>) -> Vector6<f64> {
    let force = Vector3::new(f[0], f[1], f[2]);
    let lost = shift.cross(&force);
    let mut moved = *f;
    moved[3] -= lost.x;
    moved[4] -= lost.y;
    moved[5] -= lost.z;
    moved
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_does_not_depend_on_the_reference_point() {
        let shift = Vector3::new(0.3, -0.7, 1.1);
        let a = Vector6::new(1.0, -2.0, 0.5, 0.2, 0.7, -0.4);
        let f = Vector6::new(-3.0, 1.0, 2.0, 0.9, -0.1, 0.6);
        let there = (transfer(&shift) * a).dot(&resultants_at(&shift, &f));
        // Some thirty products and sums of numbers below 10: 1e-14 is ten roundings.
        assert!((there - a.dot(&f)).abs() < 1e-14);
    }

    #[test]
    fn a_rotation_moves_a_distant_point_as_eq_2_says() {
        let t = transfer(&Vector3::new(0.0, 0.0, 2.0));
        let about_y = Vector6::new(0.0, 0.0, 0.0, 0.0, 1.0, 0.0);
        assert_eq!(t * about_y, Vector6::new(2.0, 0.0, 0.0, 0.0, 1.0, 0.0));
    }
}
