//! The frame that results are given in: an origin and three axes.
//!
//! A frame changes coordinates, not points: A and S stay where they are, and the numbers about
//! them are those along other axes. All of it is linear but the shift of the origin, so that
//! covariances are carried by the exact Jacobian.

use crate::format::plain;
use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector3};
use serde::{Deserialize, Serialize};

/// Origin and axes of a frame, in the coordinates that it is stated in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// The origin, m.
    pub origin: [f64; 3],
    /// Unit vectors along its x, y and z axis.
    pub axes: [[f64; 3]; 3],
}

/// Tensor of six terms xx, yy, zz, xy, xz, yz; products `∫ x y dm` enter it with a minus sign.
pub(crate) fn tensor([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, -xy, -xz, -xy, yy, -yz, -xz, -yz, zz)
}

/// Six terms of a tensor, products with a plus sign.
fn terms(t: &Matrix3<f64>) -> [f64; 6] {
    // No negative zero where there is no product.
    let product = |entry: f64| 0.0 - entry;
    let products = [t[(0, 1)], t[(0, 2)], t[(1, 2)]].map(product);
    [
        t[(0, 0)],
        t[(1, 1)],
        t[(2, 2)],
        products[0],
        products[1],
        products[2],
    ]
}

/// The transform [I | -skew(r); 0 | I] that carries the motion of a frame's origin to
/// the point r (m) of the same rigid body; its transpose carries resultants back.
pub(crate) fn shift(r: &Vector3<f64>) -> Matrix6<f64> {
    let mut transform = Matrix6::identity();
    let turned = -r.cross_matrix();
    transform.fixed_view_mut::<3, 3>(0, 3).copy_from(&turned);
    transform
}

impl Default for Frame {
    fn default() -> Self {
        Self {
            origin: [0.0; 3],
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        }
    }
}

/// Sums of numbers by the rows of a matrix; `None` where a number of the sum is not known.
fn sums<const N: usize>(
    matrix: &SMatrix<f64, N, N>,
    numbers: [Option<f64>; N],
) -> [Option<f64>; N] {
    std::array::from_fn(|i| {
        let parts = (0..N).filter(|j| matrix[(i, *j)] != 0.0);
        parts.map(|j| Some(matrix[(i, j)] * numbers[j]?)).sum()
    })
}

impl Frame {
    /// Origin and axes in words.
    pub(crate) fn words(&self) -> String {
        let words = |v: &[f64; 3]| v.map(|x| plain(x + 0.0, 4)).join(", ");
        let [x, y, z] = &self.axes;
        format!(
            "the origin ({}) m, x along ({}), y along ({}), z along ({}) of the sensors' coordinates",
            words(&self.origin),
            words(x),
            words(y),
            words(z)
        )
    }

    /// Coordinates of a point, m, of which some are not known.
    pub(crate) fn known_point(&self, point: [Option<f64>; 3]) -> [Option<f64>; 3] {
        let from_origin = std::array::from_fn(|k| point[k].map(|x| x - self.origin[k]));
        sums(&self.turn(), from_origin)
    }

    /// Six terms of inertia, kg m², of which some are not known.
    pub(crate) fn known_inertia(&self, terms: [Option<f64>; 6]) -> [Option<f64>; 6] {
        sums(&self.turn_of_inertia(), terms)
    }

    /// Matrix whose product with a vector gives its components along the axes.
    pub(crate) fn turn(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| self.axes[i][j])
    }

    /// Coordinates of a point, m.
    pub(crate) fn point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.turn() * (point - Vector3::from(self.origin))
    }

    /// Matrix whose product with six terms of inertia about any point gives those along the axes
    /// about the same point.
    pub(crate) fn turn_of_inertia(&self) -> SMatrix<f64, 6, 6> {
        let turn = self.turn();
        let mut matrix = SMatrix::<f64, 6, 6>::zeros();
        for term in 0..6 {
            let unit = std::array::from_fn(|k| f64::from(u8::from(k == term)));
            let turned = terms(&(turn * tensor(unit) * turn.transpose()));
            matrix.set_column(term, &SVector::from(turned));
        }
        matrix
    }
}
