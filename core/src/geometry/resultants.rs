//! Shares of each channel in one acceleration and one set of resultants: equations (4) and (5).

use super::{Accelerometer, Equations, GeometryError, LoadCell};
use crate::algebra::symmetric_eigen;
use core::borrow::Borrow;
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// A direction counts as seen by the sensors when its share of the normal matrix
/// exceeds this. It is a squared sine: 1e-10 is sensors 10 m from A and 0.1 mm apart.
const RANK: f64 = 1e-10;

/// Equation (4): the weighted least-squares acceleration of A from any number of
/// accelerometers, `a = (Xaᵀ W Xa)⁻¹ Xaᵀ W a_M`.
///
/// If the accelerometers do not determine the motion, the smallest one is taken that explains
/// their readings: first the least rotation, then the least translation. So a single
/// accelerometer on a uniaxial table means translation along its axis, and what a
/// plane set-up does not see is taken as zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AccelerationFit {
    reference: Vector3<f64>,
    /// (Xaᵀ W Xa)⁺ in the sense above.
    inverse: Matrix6<f64>,
    seen_translation: Matrix3<f64>,
    seen_rotation: Matrix3<f64>,
}

impl AccelerationFit {
    /// The fit for pairs of an accelerometer and its weight (1 where none is wanted),
    /// about the reference point A (m).
    ///
    /// # Errors
    /// [`GeometryError::Weight`] for a negative or non-finite weight,
    /// [`GeometryError::NoAccelerometer`] if nothing carries weight,
    /// [`GeometryError::NotFinite`] if positions or weights are too large to compute with.
    #[inline(never)] // One step's matrices at a time.
    pub fn new(
        sensors: impl IntoIterator<Item = (impl Borrow<Accelerometer>, f64)>,
        reference: &Vector3<f64>,
    ) -> Result<Self, GeometryError> {
        let mut normal = Matrix6::zeros();
        let mut total = 0.0;
        for (sensor, weight) in sensors {
            if !(weight.is_finite() && weight >= 0.0) {
                return Err(GeometryError::Weight);
            }
            let row = sensor.borrow().rigid_body_row(reference);
            for j in 0..6 {
                for i in 0..6 {
                    normal[(i, j)] += row[i] * row[j] * weight;
                }
            }
            total += weight;
        }
        if total <= 0.0 {
            return Err(GeometryError::NoAccelerometer);
        }
        let fit = Self::solved(&normal, reference);
        let seen = fit.seen_translation.iter().chain(&fit.seen_rotation);
        if !seen.chain(&fit.inverse).all(|x| x.is_finite()) {
            return Err(GeometryError::NotFinite);
        }
        Ok(fit)
    }

    /// The fit with these normal equations.
    #[inline(never)] // One step's matrices at a time.
    fn solved(normal: &Matrix6<f64>, reference: &Vector3<f64>) -> Self {
        let tt: Matrix3<f64> = normal.fixed_view::<3, 3>(0, 0).into();
        let tr: Matrix3<f64> = normal.fixed_view::<3, 3>(0, 3).into();
        let rr: Matrix3<f64> = normal.fixed_view::<3, 3>(3, 3).into();
        let (tt_inverse, seen_translation) = pseudo_inverse(&tt, tt.trace());
        // What rotation does to the readings beyond what translation could do.
        let schur = rr - tr.transpose() * tt_inverse * tr;
        let schur = (schur + schur.transpose()) * 0.5;
        let (rr_inverse, seen_rotation) = pseudo_inverse(&schur, rr.trace());
        let coupling = tt_inverse * tr * rr_inverse;
        let mut inverse = Matrix6::zeros();
        inverse
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(tt_inverse + coupling * tr.transpose() * tt_inverse));
        inverse.fixed_view_mut::<3, 3>(0, 3).copy_from(&-coupling);
        inverse
            .fixed_view_mut::<3, 3>(3, 0)
            .copy_from(&-coupling.transpose());
        inverse.fixed_view_mut::<3, 3>(3, 3).copy_from(&rr_inverse);
        Self {
            reference: *reference,
            inverse,
            seen_translation,
            seen_rotation,
        }
    }

    /// Acceleration of A per unit reading of this sensor: its
    /// column of `(Xaᵀ W Xa)⁻¹ Xaᵀ W`.
    #[must_use]
    pub fn column(&self, sensor: &Accelerometer, weight: f64) -> Vector6<f64> {
        self.inverse * sensor.rigid_body_row(&self.reference).transpose() * weight
    }

    /// Share of component `j` of the acceleration that the sensors determine: 1 all
    /// of it, 0 none, it is then taken as zero.
    #[must_use]
    pub fn determined(&self, j: usize) -> f64 {
        let (seen, k) = match j.checked_sub(3) {
            None => (&self.seen_translation, j),
            Some(k) => (&self.seen_rotation, k),
        };
        seen.get((k, k)).copied().unwrap_or(0.0)
    }
}

/// Least-norm inverse of a symmetric 3 x 3 matrix and the projector on what it sees.
fn pseudo_inverse(matrix: &Matrix3<f64>, scale: f64) -> (Matrix3<f64>, Matrix3<f64>) {
    let (mut rest, mut vectors) = (*matrix, Matrix3::zeros());
    let values = symmetric_eigen(&mut rest, &mut vectors);
    let mut inverse = Matrix3::zeros();
    let mut projector = Matrix3::zeros();
    for (i, &value) in values.iter().enumerate() {
        if value > RANK * scale {
            let v: Vector3<f64> = vectors.column(i).into();
            inverse += v * v.transpose() / value;
            projector += v * v.transpose();
        }
    }
    (inverse, projector)
}

/// Equation (5): the resultants at A of all load cells, `f = Xfᵀ f_M`, and which of
/// the equations of motion they complete.
///
/// No weights here: every load path must be measured. What lies outside the row space
/// of Xf, taken about the centre of the load cells, is a path without a load cell, and
/// its equations are left out of (8).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ForceResultants {
    reference: Vector3<f64>,
    equations: Equations,
}

impl ForceResultants {
    /// The resultants of `cells` about the reference point A (m).
    ///
    /// # Errors
    /// [`GeometryError::NoLoadCell`] if there is none, [`GeometryError::NotFinite`] if positions
    /// are too large to compute with.
    #[inline(never)] // One step's matrices at a time.
    pub fn new(
        cells: impl IntoIterator<Item = impl Borrow<LoadCell>, IntoIter: Clone>,
        reference: &Vector3<f64>,
    ) -> Result<Self, GeometryError> {
        let cells = cells.into_iter();
        let (mut sum, mut count) = (Vector3::zeros(), 0.0);
        for cell in cells.clone() {
            sum += cell.borrow().position();
            count += 1.0;
        }
        if count == 0.0 {
            return Err(GeometryError::NoLoadCell);
        }
        let centre = sum / count;
        let spread = cells
            .clone()
            .map(|c| (c.borrow().position() - centre).norm())
            .fold(0.0, f64::max);
        let length = if spread > 0.0 { spread } else { 1.0 };
        let mut gram = Matrix6::zeros();
        for cell in cells {
            let mut row = cell.borrow().rigid_body_row(&centre);
            for j in 3..6 {
                row[j] /= length;
            }
            row /= row.norm();
            gram += row.transpose() * row;
        }
        let mut vectors = Matrix6::zeros();
        let values = symmetric_eigen(&mut gram, &mut vectors);
        let mut rows = Matrix6::zeros();
        let mut rank = 0;
        for (i, &value) in values.iter().enumerate() {
            if value > RANK * count {
                let mut row = vectors.column(i).transpose();
                for j in 3..6 {
                    row[j] *= length;
                }
                rows.set_row(rank, &row);
                rank += 1;
            }
        }
        let equations = Equations::spanned(&rows, rank).at(&(reference - centre));
        if !(spread.is_finite() && equations.rows().iter().all(|x| x.is_finite())) {
            return Err(GeometryError::NotFinite);
        }
        Ok(Self {
            reference: *reference,
            equations,
        })
    }

    /// Resultants at A per unit reading of this cell.
    #[must_use]
    pub fn column(&self, cell: &LoadCell) -> Vector6<f64> {
        cell.rigid_body_row(&self.reference).transpose()
    }

    /// The equations of motion these load cells complete, about A.
    #[must_use]
    pub fn equations(&self) -> &Equations {
        &self.equations
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Mount, Quantity};

    fn sensor(position: [f64; 3], direction: [f64; 3]) -> Accelerometer {
        Accelerometer::new(position.into(), direction.into(), Mount::Interface).unwrap()
    }

    fn cell(position: [f64; 3], direction: [f64; 3]) -> LoadCell {
        LoadCell::new(position.into(), direction.into(), Quantity::Force).unwrap()
    }

    #[test]
    fn a_single_oblique_accelerometer_means_translation_along_its_axis() {
        let s = sensor([0.3, 0.2, 0.1], [1.0, 0.0, 1.0]);
        let fit = AccelerationFit::new([(&s, 1.0)], &Vector3::zeros()).unwrap();
        let a = fit.column(&s, 1.0);
        let h = core::f64::consts::FRAC_1_SQRT_2;
        let expected = Vector6::new(h, 0.0, h, 0.0, 0.0, 0.0);
        assert!((a - expected).norm() < 1e-15, "{a}");
        assert!((fit.determined(0) - 0.5).abs() < 1e-15);
        assert_eq!(fit.determined(4), 0.0);
    }

    #[test]
    fn a_plane_set_up_takes_the_rest_as_zero() {
        let s = [
            sensor([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
            sensor([-0.04, 0.0, 0.0], [0.0, 0.0, 1.0]),
            sensor([0.04, 0.0, 0.0], [0.0, 0.0, 1.0]),
        ];
        let all = s.iter().map(|s| (s, 1.0));
        let fit = AccelerationFit::new(all, &Vector3::zeros()).unwrap();
        let seen: [f64; 6] = core::array::from_fn(|j| fit.determined(j));
        for (j, expected) in [1.0, 0.0, 1.0, 0.0, 1.0, 0.0].into_iter().enumerate() {
            assert!((seen[j] - expected).abs() < 1e-15, "{j}: {seen:?}");
        }
        let beta = fit.column(&s[1], 1.0)[4] * 0.04 + fit.column(&s[2], 1.0)[4] * -0.04;
        assert!((beta - 1.0).abs() < 1e-14);
    }

    #[test]
    fn four_vertical_cells_measure_three_resultants() {
        let cells = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]]
            .map(|[x, y]| cell([x, y, 0.2], [0.0, 0.0, 1.0]));
        let f = ForceResultants::new(cells, &Vector3::zeros()).unwrap();
        assert_eq!(f.equations().count(), 3);
        // About the centre of the cells they are fz, tx, ty; 0.2 m lower tx and ty
        // would need the lateral forces, which nobody measures.
        let centre = f.equations().at(&Vector3::new(0.0, 0.0, 0.2));
        for (j, share) in [0.0, 0.0, 1.0, 1.0, 1.0, 0.0].into_iter().enumerate() {
            assert!((centre.measured(j) - share).abs() < 1e-14, "{j}");
        }
        assert!(f.equations().measured(3) < 1.0 - 1e-3);
    }

    #[test]
    fn two_triaxial_cells_miss_the_moment_about_their_line() {
        let mut cells = heapless::Vec::<_, 6>::new();
        for x in [-0.5, 0.5] {
            for d in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
                cells.push(cell([x, x, 0.0], d)).unwrap();
            }
        }
        let f = ForceResultants::new(&cells, &Vector3::zeros()).unwrap();
        assert_eq!(f.equations().count(), 5);
        assert!((f.equations().measured(3) - 0.5).abs() < 1e-14);
    }

    #[test]
    fn one_triaxial_cell_measures_no_moment_wherever_a_is() {
        let cells =
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|d| cell([0.0, 0.0, 0.0], d));
        let f = ForceResultants::new(cells, &Vector3::new(1.0, 2.0, 3.0)).unwrap();
        assert_eq!(f.equations().count(), 3);
    }

    #[test]
    fn weighted_least_squares_of_a_rigid_motion_returns_it() {
        let sensors = [
            sensor([0.5, 0.1, 0.0], [1.0, 0.2, 0.0]),
            sensor([-0.5, 0.3, 0.2], [0.0, 1.0, 0.0]),
            sensor([0.1, -0.5, 0.4], [0.0, 0.0, 1.0]),
            sensor([0.4, 0.5, -0.3], [0.3, 0.0, 1.0]),
            sensor([-0.2, -0.4, 0.6], [1.0, 1.0, 0.0]),
            sensor([0.3, 0.2, 0.7], [0.0, 1.0, 1.0]),
            sensor([-0.3, 0.6, -0.4], [1.0, 0.0, 1.0]),
        ];
        let weights = [1.0, 0.25, 0.5, 1.0, 0.7, 0.3, 0.9];
        let reference = Vector3::new(0.2, -0.1, 0.3);
        let a = Vector6::new(1.0, -2.0, 0.5, 3.0, -1.0, 2.0);
        let fit = AccelerationFit::new(sensors.iter().zip(weights), &reference).unwrap();
        let back: Vector6<f64> = sensors
            .iter()
            .zip(weights)
            .map(|(s, w)| fit.column(s, w) * (s.rigid_body_row(&reference) * a)[0])
            .sum();
        // A condition number of about 1e2 on sums of ten roundings.
        assert!((back - a).norm() < 1e-13, "{back}");
    }
}
