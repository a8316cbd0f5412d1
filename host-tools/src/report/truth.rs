//! True properties, where they are known.

use crate::frame::Frame;

/// The true body of a simulated or otherwise known specimen. SI units, in the frame of
/// the sensors; `None` where unknown, as out of the plane of a plane model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrueBody {
    /// Overall mass, kg.
    pub mass: Option<f64>,
    /// Centre of gravity S, m.
    pub centre_of_gravity: [Option<f64>; 3],
    /// xx, yy, zz, xy, xz, yz about the setup's reference point, kg m²; products are
    /// ∫ x y dm with a plus sign.
    pub inertia_reference: [Option<f64>; 6],
    /// The same about S.
    pub inertia_cg: [Option<f64>; 6],
}

impl TrueBody {
    /// The body in a frame.
    #[must_use]
    pub(super) fn in_frame(&self, frame: &Frame) -> Self {
        Self {
            mass: self.mass,
            centre_of_gravity: frame.known_point(self.centre_of_gravity),
            inertia_reference: frame.known_inertia(self.inertia_reference),
            inertia_cg: frame.known_inertia(self.inertia_cg),
        }
    }
}
