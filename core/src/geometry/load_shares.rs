use core::borrow::Borrow;

use nalgebra::{Matrix6, Vector3, Vector6};

use super::LoadCell;
use crate::algebra::symmetric_eigen;

/// Share of the largest eigenvalues below which a direction of load counts as not carried.
const RANK: f64 = 1e-10;

/// The loads of least norm that add up to given resultants at A: the inverse of eq (5),
/// `f_M = Xf (Xfᵀ Xf)⁺ f`, for simulating a structure's load cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadShares {
    reference: Vector3<f64>,
    /// (Xfᵀ Xf)⁺.
    inverse: Matrix6<f64>,
}

impl LoadShares {
    /// The shares of `cells` in resultants about the reference point A (m). Resultants that no
    /// load cell carries are left out.
    #[must_use]
    pub fn new(
        cells: impl IntoIterator<Item = impl Borrow<LoadCell>>,
        reference: &Vector3<f64>,
    ) -> Self {
        let mut gram = Matrix6::zeros();
        for cell in cells {
            let row = cell.borrow().rigid_body_row(reference);
            gram += row.transpose() * row;
        }
        let least = RANK * gram.trace();
        let mut vectors = Matrix6::zeros();
        let values = symmetric_eigen(&mut gram, &mut vectors);
        let mut inverse = Matrix6::zeros();
        for (i, &value) in values.iter().enumerate() {
            if value > least {
                let v: Vector6<f64> = vectors.column(i).into();
                inverse += v * v.transpose() / value;
            }
        }
        Self {
            reference: *reference,
            inverse,
        }
    }

    /// The load (N or N m) on one of the cells from resultants at A (N, N m).
    #[must_use]
    pub fn load(&self, cell: &LoadCell, resultants: &Vector6<f64>) -> f64 {
        (cell.rigid_body_row(&self.reference) * self.inverse * resultants)[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{GeometryError, Quantity};

    fn cell(place: [f64; 3], direction: [f64; 3]) -> Result<LoadCell, GeometryError> {
        LoadCell::new(place.into(), direction.into(), Quantity::Force)
    }

    #[test]
    fn the_loads_add_up_to_the_resultants() -> Result<(), GeometryError> {
        // Seven cells, one of them redundant.
        let cells = [
            cell([0.2, 0.0, 0.0], [0.0, 0.0, 1.0])?,
            cell([-0.1, 0.2, 0.0], [0.0, 0.0, 1.0])?,
            cell([-0.1, -0.2, 0.0], [0.0, 0.0, 1.0])?,
            cell([0.2, 0.0, 0.0], [0.0, 1.0, 0.0])?,
            cell([-0.1, 0.2, 0.0], [1.0, 0.0, 0.0])?,
            cell([-0.1, -0.2, 0.0], [0.0, 1.0, 0.0])?,
            cell([0.1, 0.1, 0.05], [1.0, 1.0, 1.0])?,
        ];
        let reference = Vector3::new(0.3, -0.1, 0.2);
        let shares = LoadShares::new(cells, &reference);
        let resultants = Vector6::new(1.0, -2.0, 3.0, 0.4, -0.5, 0.6);
        let mut sum = Vector6::zeros();
        for cell in &cells {
            sum += cell.rigid_body_row(&reference).transpose() * shares.load(cell, &resultants);
        }
        // Rounding, times the condition of the Gram matrix, some 1e3.
        assert!((sum - resultants).norm() < 1e-11, "{}", sum - resultants);
        Ok(())
    }

    #[test]
    fn what_no_cell_carries_is_left_out() -> Result<(), GeometryError> {
        let upright = [cell([0.0, 0.0, 0.0], [0.0, 0.0, 1.0])?];
        let shares = LoadShares::new(upright, &Vector3::zeros());
        let load = shares.load(&upright[0], &Vector6::new(7.0, 8.0, 9.0, 1.0, 2.0, 3.0));
        assert!((load - 9.0).abs() < 1e-12, "{load}");
        Ok(())
    }
}
