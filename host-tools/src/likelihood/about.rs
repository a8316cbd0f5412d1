//! Records, models and fits about another point.
//!
//! The same motion is `a_B = T a_A`, the same forces are `f_A = Tᵀ f_B`, and a mass matrix `M_A = Tᵀ M_B T`, with
//! `T = [I, -skew(r); 0, I]` for `r` from A to B. A fit about any point would be the same in exact numbers, were
//! noise known exactly: what is estimated of it, and the larger of two error bars term by term, depend on the point.

use super::fit::{Covariance10, Fit};
use super::model::{Model, RIGID};
use super::record::Record;
use super::rigid::sigma_of;
use nalgebra::{Complex, Matrix6, SMatrix, Vector3};

/// T for a point at `r` (m).
fn carry(r: &Vector3<f64>) -> Matrix6<f64> {
    let mut matrix = Matrix6::identity();
    let turned = -r.cross_matrix();
    matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&turned);
    matrix
}

impl Record {
    /// The same about a point at `r` (m) from the one that it is about; all six resultants have to be measured.
    #[must_use]
    pub fn about(mut self, r: &Vector3<f64>) -> Self {
        let (base, force) = (carry(r), carry(&-r).transpose());
        self.noise.base = base * self.noise.base * base.transpose();
        self.noise.force = force * self.noise.force * force.transpose();
        let (base, force) = (base.map(Complex::from), force.map(Complex::from));
        self.base.iter_mut().for_each(|a| *a = base * *a);
        self.force.iter_mut().for_each(|f| *f = force * *f);
        self
    }
}

impl Model {
    /// The same about a point at `r` (m) from the one that it is about.
    #[must_use]
    pub fn about(mut self, r: &Vector3<f64>) -> Self {
        let back = carry(&-r);
        let matrix = |m: Matrix6<f64>| back.transpose() * m * back;
        self.rigid = sigma_of(&matrix(self.rigid_matrix()));
        for mode in &mut self.modes {
            mode.participation = back.transpose() * mode.participation;
        }
        if self.upper.is_some() {
            self.set_upper_matrix(&matrix(self.upper_matrix()));
        }
        self
    }
}

impl Fit {
    /// The same about a point at `r` (m) from the one that it is about.
    #[must_use]
    pub fn about(self, r: &Vector3<f64>) -> Self {
        let mut map = SMatrix::<f64, RIGID, RIGID>::zeros();
        for (j, mut column) in map.column_iter_mut().enumerate() {
            let unit = core::array::from_fn(|i| f64::from(u8::from(i == j)));
            let moved = Model::rigid(unit, 1.0, 0).about(r).rigid;
            column.copy_from_slice(&moved);
        }
        let moved = |covariance: Covariance10| map * covariance * map.transpose();
        Self {
            model: self.model.about(r),
            by_information: moved(self.by_information),
            by_score: moved(self.by_score),
            covariance: moved(self.covariance),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::{FittedMode, Noise};
    use massline_core::rigid_body::{Inertia, RigidBody};
    use nalgebra::Vector6;

    fn body() -> RigidBody {
        RigidBody {
            mass: 3.0,
            centre_of_gravity: Vector3::new(0.1, -0.2, 0.3),
            inertia: Inertia::from_terms([0.5, 0.6, 0.7, 0.05, -0.04, 0.03]),
        }
    }

    fn model() -> Model {
        let mut model = Model::rigid(sigma_of(&body().mass_matrix(&Vector3::zeros())), 60.0, 1);
        let participation = Vector6::new(0.5, -0.3, 0.2, 0.1, 0.4, -0.6);
        model.push(FittedMode::new(40.0, 0.01, participation));
        model.set_upper_matrix(&Matrix6::from_fn(|i, j| {
            0.1 + ((i + 1) * (j + 1)) as f64 * 0.01
        }));
        model
    }

    const SHIFT: Vector3<f64> = Vector3::new(0.7, -2.0, 3.0);

    /// The rigid body of a moved model is that of equation (1) about the other point, and back it is what it was.
    #[test]
    fn a_moved_model_is_of_the_same_body() {
        let moved = model().about(&SHIFT);
        let expected = body().mass_matrix(&SHIFT);
        // A few roundings of numbers up to forty.
        assert!((moved.rigid_matrix() - expected).norm() < 1e-13);
        let back = moved.about(&-SHIFT);
        for (a, b) in back.rigid.iter().zip(model().rigid) {
            assert!((a - b).abs() < 1e-13, "{a} {b}");
        }
    }

    /// Moved forces follow from moved accelerations by the moved model, at a frequency where the mode counts; the
    /// noise of a residual is that of the moved residual.
    #[test]
    fn moved_records_follow_the_moved_model() {
        let model = model();
        let base = Vector6::from_fn(|i, _| Complex::new(i as f64 - 2.0, 0.5 * i as f64));
        let noise = Noise {
            base: Matrix6::from_diagonal(&Vector6::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)),
            force: Matrix6::from_diagonal(&Vector6::new(6.0, 5.0, 4.0, 3.0, 2.0, 1.0)),
        };
        let record = Record {
            run: 0,
            frequencies: vec![39.0],
            base: vec![base],
            force: vec![model.at(0, 39.0) * base],
            noise,
            level: Vec::new(),
            equations: Matrix6::identity(),
        };
        let spread = |record: &Record, model: &Model| {
            let m = model.at(0, 39.0);
            let complex = |m: Matrix6<f64>| m.map(Complex::from);
            complex(record.noise.force) + m * complex(record.noise.base) * m.adjoint()
        };
        let before = spread(&record, &model);
        let (record, model) = (record.about(&SHIFT), model.about(&SHIFT));
        let expected = model.at(0, 39.0) * record.base[0];
        let off = (record.force[0] - expected).norm() / expected.norm();
        assert!(off < 1e-14, "{off}");
        // Tᵀ N_B T = N_A.
        let carry = carry(&SHIFT).map(Complex::from);
        let back = carry.adjoint() * spread(&record, &model) * carry;
        let off = (back - before).norm() / before.norm();
        assert!(off < 1e-12, "{off}");
    }
}
