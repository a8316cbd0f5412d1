//! Records, models and fits about another point.
//!
//! The same motion is `a_B = T a_A`, the same forces are `f_A = Tᵀ f_B`, and a mass matrix `M_A = Tᵀ M_B T`, with
//! `T = [I, -skew(r); 0, I]` for `r` from A to B. A fit about any point would be the same in exact numbers, were
//! noise known exactly: what is estimated of it, and the larger of two error bars term by term, depend on the point.

use super::fit::{Covariance10, Fit};
use super::model::{Model, RIGID};
use super::record::Record;
use super::rigid::sigma_of;
use crate::frame::shift;
use nalgebra::{Complex, Matrix6, SMatrix, Vector3};

impl Record {
    /// The same about a point at `r` (m) from the one that it is about; all six resultants have to be measured.
    #[must_use]
    pub fn about(mut self, r: &Vector3<f64>) -> Self {
        let (base, force) = (shift(r), shift(&-r).transpose());
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
        let back = shift(&-r);
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
