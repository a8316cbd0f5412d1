//! Forces beside those that the numbers predict from the accelerations, line by line.

use crate::measure::{MeasuredRun, Products};
use massline_core::identify::{Estimate, Identification};
use nalgebra::{Complex, Matrix3, Matrix6, Vector3};

/// Number of forces and moments.
pub(super) const FORCES: usize = 6;

/// Mean distance of `f / p` from one beyond which the numbers do not predict the force.
const UNPREDICTED: f64 = 0.5;

/// M of equation (1) about A, with zero for what is not known.
pub(super) fn matrix(found: &Identification) -> Matrix6<f64> {
    let value = |e: Option<Estimate>| e.map_or(0.0, |e| e.value);
    let weighed = value(found.mass);
    let mass = weighed * found.indicator.map_or(1.0, |delta| delta.value);
    let first = Vector3::from_fn(|i, _| {
        let known = found.centre_of_gravity[i];
        known.map_or(0.0, |s| weighed * (s.value - found.reference[i]))
    });
    let [xx, yy, zz, xy, xz, yz] = found.inertia_reference.map(value);
    let mut m = Matrix6::identity() * mass;
    let cross = first.cross_matrix();
    m.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross);
    m.fixed_view_mut::<3, 3>(3, 0).copy_from(&cross);
    m.fixed_view_mut::<3, 3>(3, 3)
        .copy_from(&Matrix3::new(xx, -xy, -xz, -xy, yy, -yz, -xz, -yz, zz));
    m
}

/// Products of a force with itself, with its prediction, and of the prediction with itself.
#[derive(Clone, Copy)]
pub(super) struct Line {
    pub(super) force: f64,
    pub(super) cross: Complex<f64>,
    pub(super) predicted: f64,
}

impl Line {
    pub(super) fn of(force: usize, products: &Products, matrix: &Matrix6<f64>) -> Self {
        let row = |i: usize| Complex::from(matrix[(force, i)]);
        let f = FORCES + force;
        let mut line = Self {
            force: products[(f, f)].re,
            cross: Complex::default(),
            predicted: 0.0,
        };
        for i in 0..FORCES {
            line.cross += products[(f, i)] * row(i);
            for k in 0..FORCES {
                line.predicted += (row(i) * products[(i, k)] * row(k)).re;
            }
        }
        line
    }
}

/// `true` if the prediction is about what the force is.
pub(super) fn is_predicted(half: &[Line]) -> bool {
    let cross: Complex<f64> = half.iter().map(|line| line.cross).sum();
    let predicted: f64 = half.iter().map(|line| line.predicted).sum();
    (cross / predicted - 1.0).norm() < UNPREDICTED
}

/// Forces and moments that the load cells of a run measure.
pub(super) fn measured(run: &MeasuredRun) -> impl Iterator<Item = usize> {
    (0..FORCES).filter(|j| run.geometry.equations.measured(*j) > 0.5)
}
