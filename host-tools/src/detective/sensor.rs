//! One channel as the set-up describes it.

use massline_core::geometry::Quantity;
use nalgebra::{Vector3, Vector6};

/// Kind of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// An accelerometer on the interface.
    Interface,
    /// An accelerometer on the structure.
    Structure,
    /// A load cell.
    Cell(Quantity),
}

impl Kind {
    pub(super) fn is_cell(self) -> bool {
        matches!(self, Self::Cell(_))
    }
}

/// One channel as the set-up describes it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sensor {
    pub(super) channel: String,
    pub(super) kind: Kind,
    /// m.
    pub(super) position: Vector3<f64>,
    /// Unit vector.
    pub(super) direction: Vector3<f64>,
}

impl Sensor {
    /// Reading for a unit motion about the origin of an accelerometer; resultants of a unit reading
    /// of a load cell.
    pub(super) fn rigid(&self) -> Vector6<f64> {
        let moment = match self.kind {
            Kind::Cell(Quantity::Moment) => {
                return Vector6::from_fn(|i, _| if i < 3 { 0.0 } else { self.direction[i - 3] });
            }
            _ => self.position.cross(&self.direction),
        };
        let d = &self.direction;
        Vector6::new(d.x, d.y, d.z, moment.x, moment.y, moment.z)
    }
}
