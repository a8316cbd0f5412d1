//! Which of the six equations of motion the load cells let us write.

use nalgebra::{ArrayStorage, Matrix6, Vector3, Vector6};

/// Up to six combinations of the rows of `M a = f` that hold with what was measured:
/// `rows · (M a - f) = 0`.
///
/// With six measured resultants this is the identity. A plane set-up or three vertical
/// load cells measure fewer; then only some combinations remain. A weighted estimator
/// multiplies them with the inverse square root of the noise covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equations {
    rows: Matrix6<f64>,
    count: u8,
    whitened: bool,
}

impl Default for Equations {
    fn default() -> Self {
        Self::all()
    }
}

impl Equations {
    /// None.
    pub(crate) const NONE: Self = Self {
        rows: Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6])),
        count: 0,
        whitened: false,
    };

    /// All six equations, as equation (8) has them.
    #[must_use]
    pub fn all() -> Self {
        Self {
            rows: Matrix6::identity(),
            count: 6,
            whitened: false,
        }
    }

    /// None of them.
    #[must_use]
    pub const fn none() -> Self {
        Self {
            rows: Matrix6::from_array_storage(ArrayStorage([[0.0; 6]; 6])),
            count: 0,
            whitened: false,
        }
    }

    /// The equations spanned by the first `count` rows of `rows` (the others are
    /// ignored), without weights.
    pub(crate) fn spanned(rows: &Matrix6<f64>, count: usize) -> Self {
        if count >= 6 {
            return Self::all();
        }
        // Of a row of length one, that is the rounding of a rotation matrix. It would make an
        // equation for what was not measured.
        const ROUNDING: f64 = 1e-13;
        let (mut rows, count) = orthonormal_rows(rows, count);
        rows.apply(|x| {
            if x.abs() < ROUNDING {
                *x = 0.0;
            }
        });
        Self {
            rows,
            count: count as u8,
            whitened: false,
        }
    }

    /// The same equations after multiplication from the left with `weights`
    /// (upper left `count` x `count` part).
    pub(crate) fn whitened(&self, weights: &Matrix6<f64>) -> Self {
        Self {
            rows: weights * self.rows,
            count: self.count,
            whitened: true,
        }
    }

    /// The matrix in front of `M a - f`; rows past [`Self::count`] are zero.
    #[must_use]
    pub fn rows(&self) -> &Matrix6<f64> {
        &self.rows
    }

    /// Number of equations per acceleration vector, 0 to 6.
    #[must_use]
    pub fn count(&self) -> usize {
        usize::from(self.count)
    }

    /// `true` if the rows carry the weights of the noise. Then the least-squares answer
    /// does not depend on the reference point.
    #[must_use]
    pub fn is_whitened(&self) -> bool {
        self.whitened
    }

    /// `true` if two runs that were measured with these can be condensed together: the rows
    /// are the same, up to the rounding of a rotation matrix.
    #[must_use]
    pub fn alike(&self, other: &Self) -> bool {
        (self.rows - other.rows).norm() < 1e-9
    }

    /// Share of resultant `j` that is measured, 1 all of it, 0 none. Not for whitened
    /// equations.
    #[must_use]
    pub fn measured(&self, j: usize) -> f64 {
        self.rows.column(j).norm_squared()
    }

    /// The same equations about a point `shift = r_B - r_A` (m) away: with
    /// `f_A = Tᵀ f_B` the rows become `rows · Tᵀ`. Unweighted equations are made
    /// orthonormal again, so that six measured resultants stay the six rows of
    /// equation (8) at every reference point, as the paper has it.
    #[must_use]
    pub(crate) fn at(&self, shift: &Vector3<f64>) -> Self {
        // r·f_A is r·f_B and the moment r_m·(s x force), which is force·(r_m x s).
        let mut rows = self.rows;
        for mut row in rows.row_iter_mut() {
            let gained = Vector3::new(row[3], row[4], row[5]).cross(shift);
            row[0] += gained.x;
            row[1] += gained.y;
            row[2] += gained.z;
        }
        if self.whitened {
            Self { rows, ..*self }
        } else {
            Self::spanned(&rows, self.count())
        }
    }
}

/// Gram-Schmidt, twice for good measure. A row that depends on those before it is dropped.
fn orthonormal_rows(rows: &Matrix6<f64>, count: usize) -> (Matrix6<f64>, usize) {
    const DEPENDENT: f64 = 1e-9;
    let mut basis = Matrix6::zeros();
    let mut kept = 0;
    for i in 0..count.min(6) {
        let mut row: Vector6<f64> = rows.row(i).transpose();
        let before = row.norm();
        for _ in 0..2 {
            for k in 0..kept {
                let b: Vector6<f64> = basis.row(k).transpose();
                row -= b * b.dot(&row);
            }
        }
        let norm = row.norm();
        if norm > DEPENDENT * before {
            basis.set_row(kept, &(row / norm).transpose());
            kept += 1;
        }
    }
    (basis, kept)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_equations_stay_six_plain_equations() {
        let e = Equations::all().at(&Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(e, Equations::all());
    }

    #[test]
    fn plane_equations_stay_plane_within_the_plane() {
        let mut rows = Matrix6::zeros();
        rows[(0, 0)] = 1.0;
        rows[(1, 2)] = 1.0;
        rows[(2, 4)] = 1.0;
        let e = Equations::spanned(&rows, 3).at(&Vector3::new(0.4, 0.0, -0.2));
        assert_eq!(e.count(), 3);
        for (j, share) in [1.0, 0.0, 1.0, 0.0, 1.0, 0.0].into_iter().enumerate() {
            assert!((e.measured(j) - share).abs() < 1e-15, "{j}");
        }
    }

    #[test]
    fn rounding_of_a_rotation_makes_no_equation() {
        let row = |beside: f64| {
            let mut rows = Matrix6::zeros();
            rows[(0, 2)] = -2.0;
            rows[(0, 4)] = beside;
            Equations::spanned(&rows, 1)
        };
        // Rows are of length one, so the entries are halved.
        assert_eq!(row(1.9e-13).measured(4), 0.0);
        assert_eq!(row(-1.9e-13).measured(4), 0.0);
        assert_eq!(row(2.1e-13).rows()[(0, 4)], 1.05e-13);
        assert_eq!(row(1.9e-13).measured(2), 1.0);
    }

    #[test]
    fn equations_are_alike_up_to_rounding() {
        let vertical = |beside: f64| {
            let mut rows = Matrix6::zeros();
            rows[(0, 2)] = 1.0;
            rows[(0, 4)] = beside;
            Equations::spanned(&rows, 1)
        };
        assert!(vertical(0.0).alike(&vertical(0.0)));
        assert!(vertical(0.0).alike(&vertical(0.9e-9)));
        assert!(!vertical(0.0).alike(&vertical(1.1e-9)));
    }
}
