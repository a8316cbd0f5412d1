//! True properties of a simulated specimen.

use nalgebra::{Matrix3, Matrix6, Vector3};
use serde::{Deserialize, Serialize};

use super::model::Model;
use crate::frame::Frame;

/// Exact properties of a simulated specimen, in its own frame; SI units.
///
/// Properties that a plane model does not have are `None`, `null` in JSON.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
pub struct Truth {
    /// Version of this layout, `massline/truth/1`.
    pub schema: String,
    /// The model's heading.
    pub title: String,
    /// Point A that `inertia_reference` and the effective masses are about, m.
    pub reference_point: [f64; 3],
    /// kg.
    pub mass: f64,
    /// m, in the specimen frame (not from the reference point).
    pub centre_of_gravity: [Option<f64>; 3],
    /// About the reference point, kg m².
    pub inertia_reference: InertiaTruth,
    /// About the centre of gravity, kg m².
    pub inertia_cg: InertiaTruth,
    /// Fixed-base modes below the sample rate, ascending.
    pub modes: Vec<ModeTruth>,
    /// Cramér-Rao bounds of the test, of the averaging band first; empty for a test without noise.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bounds: Vec<Bound>,
}

/// Least standard deviations that an unbiased estimate from the lines of a band can have
/// (Cramér-Rao), SI; `None`, `null` in JSON, for a number that the test does not tell.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
pub struct Bound {
    /// Lowest and highest line, Hz.
    pub band: [f64; 2],
    /// kg.
    pub mass: Option<f64>,
    /// m.
    pub centre_of_gravity: [Option<f64>; 3],
    /// About the reference point, kg m².
    pub inertia_reference: InertiaTruth,
    /// About the centre of gravity, kg m².
    pub inertia_cg: InertiaTruth,
}

/// Moments and products of inertia, kg m²; products are ∫xy dm with a plus sign.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
pub struct InertiaTruth {
    /// ∫(y² + z²) dm.
    pub xx: Option<f64>,
    /// ∫(x² + z²) dm.
    pub yy: Option<f64>,
    /// ∫(x² + y²) dm.
    pub zz: Option<f64>,
    /// ∫xy dm.
    pub xy: Option<f64>,
    /// ∫xz dm.
    pub xz: Option<f64>,
    /// ∫yz dm.
    pub yz: Option<f64>,
}

/// A mode of the specimen on a fixed interface.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
pub struct ModeTruth {
    /// Name of the part that moves.
    pub name: String,
    /// Undamped, Hz.
    pub frequency: f64,
    /// Share of critical damping.
    pub damping: f64,
    /// L_rᵀ L_r about the reference point, ordered as eq (1): kg, kg m, kg m².
    pub effective_mass: [[f64; 6]; 6],
}

impl Truth {
    /// Modes at or above `highest` (Hz) are left out.
    pub(super) fn of(model: &Model, highest: f64) -> Self {
        let specimen = &model.specimen;
        let reference = Vector3::from(model.reference_point);
        let moved = specimen.about(&reference);
        let (mass, centre) = mass_and_centre(&specimen.mass_matrix, specimen.plane);
        let modes = moved
            .modes
            .iter()
            .filter(|mode| mode.frequency < highest)
            .map(|mode| {
                let effective = mode.participation * mode.participation.transpose();
                ModeTruth {
                    name: mode.name.clone(),
                    frequency: mode.frequency,
                    damping: mode.damping,
                    effective_mass: std::array::from_fn(|row| {
                        std::array::from_fn(|column| effective[(row, column)])
                    }),
                }
            })
            .collect();
        Self {
            schema: "massline/truth/1".to_owned(),
            title: model.title.clone(),
            reference_point: model.reference_point,
            mass,
            centre_of_gravity: match specimen.plane {
                true => [Some(centre.x), None, Some(centre.z)],
                false => [Some(centre.x), Some(centre.y), Some(centre.z)],
            },
            inertia_reference: InertiaTruth::of(&moved.mass_matrix, specimen.plane),
            inertia_cg: InertiaTruth::of(&specimen.about(&centre).mass_matrix, specimen.plane),
            modes,
            bounds: Vec::new(),
        }
    }
}

impl Truth {
    /// The body with its inertia about another reference point (m), by the parallel axis theorem; effective masses stay
    /// about that of the model, and bounds of the inertia about it are left out.
    #[must_use]
    pub fn about(&self, point: [f64; 3]) -> Self {
        if point == self.reference_point {
            return self.clone();
        }
        let [x, y, z] = [0, 1, 2].map(|i| Some(self.centre_of_gravity[i]? - point[i]));
        let product = |a: Option<f64>, b: Option<f64>| Some(self.mass * a? * b?);
        let sum = |a: Option<f64>, b: Option<f64>| Some(a? + b?);
        let steiner = [
            sum(product(y, y), product(z, z)),
            sum(product(x, x), product(z, z)),
            sum(product(x, x), product(y, y)),
            product(x, y),
            product(x, z),
            product(y, z),
        ];
        let central = self.inertia_cg.terms();
        let terms = core::array::from_fn(|j| sum(central[j], steiner[j]));
        let bounds = self.bounds.iter().map(|bound| Bound {
            inertia_reference: InertiaTruth::from_terms([None; 6]),
            ..bound.clone()
        });
        Self {
            reference_point: point,
            inertia_reference: InertiaTruth::from_terms(terms),
            bounds: bounds.collect(),
            ..self.clone()
        }
    }

    /// The body in a frame; modes stay about the axes of the model, and bounds of single numbers,
    /// which do not tell those of their sums, are left out.
    #[must_use]
    pub fn in_frame(&self, frame: &Frame) -> Self {
        Self {
            reference_point: frame.point(&self.reference_point.into()).into(),
            centre_of_gravity: frame.known_point(self.centre_of_gravity),
            inertia_reference: self.inertia_reference.in_frame(frame),
            inertia_cg: self.inertia_cg.in_frame(frame),
            bounds: Vec::new(),
            ..self.clone()
        }
    }
}

/// Reads eq (1) backwards: kg and m.
fn mass_and_centre(matrix: &Matrix6<f64>, plane: bool) -> (f64, Vector3<f64>) {
    let mass = matrix[(0, 0)];
    let centre = match plane {
        // Rows fx and fz, column β.
        true => Vector3::new(-matrix[(2, 4)], 0.0, matrix[(0, 4)]),
        false => Vector3::new(matrix[(1, 5)], matrix[(2, 3)], matrix[(0, 4)]),
    };
    (mass, centre / mass)
}

impl InertiaTruth {
    /// xx, yy, zz, xy, xz, yz.
    pub(crate) fn terms(&self) -> [Option<f64>; 6] {
        [self.xx, self.yy, self.zz, self.xy, self.xz, self.yz]
    }

    /// Of xx, yy, zz, xy, xz, yz.
    pub(crate) fn from_terms([xx, yy, zz, xy, xz, yz]: [Option<f64>; 6]) -> Self {
        Self {
            xx,
            yy,
            zz,
            xy,
            xz,
            yz,
        }
    }

    fn in_frame(&self, frame: &Frame) -> Self {
        Self::from_terms(frame.known_inertia(self.terms()))
    }

    fn of(matrix: &Matrix6<f64>, plane: bool) -> Self {
        let tensor: Matrix3<f64> = matrix.fixed_view::<3, 3>(3, 3).into_owned();
        let known = |value: f64| (!plane).then_some(value);
        Self {
            xx: known(tensor[(0, 0)]),
            yy: Some(tensor[(1, 1)]),
            zz: known(tensor[(2, 2)]),
            xy: known(-tensor[(0, 1)]),
            xz: known(-tensor[(0, 2)]),
            yz: known(-tensor[(1, 2)]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body of 2 kg with its centre at (1, 2, 3) m, moved: by hand, and there and back.
    #[test]
    fn inertia_moves_by_the_parallel_axis_theorem() {
        let known = |terms: [f64; 6]| InertiaTruth::from_terms(terms.map(Some));
        let bound = Bound {
            band: [1.0, 2.0],
            mass: Some(0.1),
            centre_of_gravity: [Some(0.2); 3],
            inertia_reference: known([0.3; 6]),
            inertia_cg: known([0.4; 6]),
        };
        let truth = Truth {
            schema: String::new(),
            title: String::new(),
            reference_point: [0.0; 3],
            mass: 2.0,
            centre_of_gravity: [Some(1.0), Some(2.0), Some(3.0)],
            inertia_reference: known([126.0, 120.0, 110.0, 4.5, 6.25, 12.125]),
            inertia_cg: known([100.0, 100.0, 100.0, 0.5, 0.25, 0.125]),
            modes: Vec::new(),
            bounds: vec![bound],
        };
        let moved = truth.about([0.0, 0.0, 1.0]);
        let expected = [116.0, 110.0, 110.0, 4.5, 4.25, 8.125];
        assert_eq!(moved.inertia_reference, known(expected));
        assert_eq!(moved.inertia_cg, truth.inertia_cg);
        assert_eq!(
            moved.bounds[0].inertia_reference,
            InertiaTruth::from_terms([None; 6])
        );
        assert_eq!(moved.bounds[0].mass, Some(0.1));
        let back = moved.about([0.0; 3]);
        assert_eq!(back.inertia_reference, truth.inertia_reference);
        assert_eq!(truth.about([0.0; 3]), truth);
        // Of a plane body nothing is known across its plane.
        let plane = Truth {
            centre_of_gravity: [Some(1.0), None, Some(3.0)],
            inertia_cg: InertiaTruth::from_terms([None, Some(100.0), None, None, None, None]),
            ..truth
        };
        let terms = plane.about([0.0, 0.0, 1.0]).inertia_reference.terms();
        assert_eq!(terms, [None, Some(110.0), None, None, None, None]);
    }
}
