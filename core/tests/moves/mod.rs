//! Equation (2): accelerations and resultants about another reference point, as the paper writes
//! it.

use nalgebra::{Matrix6, Vector3};

/// T of `a_B = T a_A` for `shift = r_B - r_A`, m. Resultants move by its inverse, transposed.
pub fn of_accelerations(shift: &Vector3<f64>) -> Matrix6<f64> {
    let mut t = Matrix6::identity();
    t.fixed_view_mut::<3, 3>(0, 3)
        .copy_from(&-shift.cross_matrix());
    t
}

/// T⁻ᵀ of `f_B = T⁻ᵀ f_A`.
pub fn of_resultants(shift: &Vector3<f64>) -> Matrix6<f64> {
    of_accelerations(&-shift).transpose()
}
