//! Re-mounted specimens: a uniaxial table's way to three directions.

use super::{Accelerometer, GeometryError, LoadCell, Mount};
use nalgebra::{Matrix3, Vector3};

/// Placement of the specimen on the table in one run: specimen coordinates `s` become
/// interface coordinates `R s + t`.
///
/// There is one rule, applied here and nowhere else: what stays with the table (load
/// cells and interface accelerometers) is carried into the specimen's frame, so that
/// all runs speak of the same body in the same axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

impl Default for Placement {
    fn default() -> Self {
        Self {
            rotation: Matrix3::identity(),
            translation: Vector3::zeros(),
        }
    }
}

impl Placement {
    /// A placement from a rotation vector (axis times angle, degrees) and a shift (m).
    ///
    /// # Errors
    /// [`GeometryError::NotFinite`] if a component is not finite, or so large that the rotation
    /// is not.
    pub fn new(
        rotation_degrees: Vector3<f64>,
        translation: Vector3<f64>,
    ) -> Result<Self, GeometryError> {
        let rotation = rotation_matrix(&rotation_degrees);
        // An angle that is no number would be a rotation of no numbers, and one whose square
        // overflows would be, too.
        let all = [rotation_degrees, translation];
        let given = all.iter().flatten().all(|x| x.is_finite());
        if !(given && rotation.iter().all(|x| x.is_finite())) {
            return Err(GeometryError::NotFinite);
        }
        Ok(Self {
            rotation,
            translation,
        })
    }

    /// R, which turns specimen axes into interface axes.
    #[must_use]
    pub fn rotation(&self) -> Matrix3<f64> {
        self.rotation
    }

    /// An interface point in specimen coordinates.
    #[must_use]
    pub(crate) fn point_in_specimen(&self, interface: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.tr_mul(&(interface - self.translation))
    }

    /// The accelerometer as the specimen sees it. One that is glued to the structure
    /// was described in the specimen's frame and stays as it is.
    #[must_use]
    pub fn accelerometer(&self, sensor: &Accelerometer) -> Accelerometer {
        match sensor.mount {
            Mount::Structure => *sensor,
            Mount::Interface => Accelerometer {
                position: self.point_in_specimen(&sensor.position),
                direction: self.rotation.tr_mul(&sensor.direction),
                mount: Mount::Interface,
            },
        }
    }

    /// The load cell, which stays with the table, as the specimen sees it.
    #[must_use]
    pub fn load_cell(&self, cell: &LoadCell) -> LoadCell {
        LoadCell {
            position: self.point_in_specimen(&cell.position),
            direction: self.rotation.tr_mul(&cell.direction),
            quantity: cell.quantity,
        }
    }
}

/// Rodrigues' formula with the `libm` sine, the same bits on every machine. A quarter
/// turn must give exact zeros: a re-mounted cube is turned by 90 degrees, and a
/// cosine of 6e-17 would leak one direction into another.
fn rotation_matrix(vector_degrees: &Vector3<f64>) -> Matrix3<f64> {
    let degrees = vector_degrees.norm();
    if degrees == 0.0 {
        return Matrix3::identity();
    }
    let axis = vector_degrees / degrees;
    let (sine, cosine) = sine_cosine(degrees);
    Matrix3::identity() * cosine
        + axis * axis.transpose() * (1.0 - cosine)
        + axis.cross_matrix() * sine
}

fn sine_cosine(degrees: f64) -> (f64, f64) {
    let turned = libm::fmod(degrees, 360.0);
    if turned == 90.0 {
        (1.0, 0.0)
    } else if turned == 180.0 {
        (0.0, -1.0)
    } else if turned == 270.0 {
        (-1.0, 0.0)
    } else {
        let radians = turned.to_radians();
        (libm::sin(radians), libm::cos(radians))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Quantity;

    #[test]
    fn a_quarter_turn_is_exact() {
        let p = Placement::new(Vector3::new(0.0, 0.0, 90.0), Vector3::new(1.0, 2.0, 3.0)).unwrap();
        assert_eq!(p.rotation() * Vector3::x(), Vector3::y());
        let cell =
            LoadCell::new(Vector3::new(1.0, 3.0, 3.0), Vector3::y(), Quantity::Force).unwrap();
        let seen = p.load_cell(&cell);
        assert_eq!(seen.position(), Vector3::x());
        assert_eq!(seen.direction(), Vector3::x());
    }

    #[test]
    fn what_is_glued_to_the_structure_stays() {
        let p =
            Placement::new(Vector3::new(30.0, 40.0, 50.0), Vector3::new(1.0, 2.0, 3.0)).unwrap();
        let s = Accelerometer::new(Vector3::x(), Vector3::z(), Mount::Structure).unwrap();
        assert_eq!(p.accelerometer(&s), s);
    }

    #[test]
    fn the_rotation_is_a_rotation() {
        let r = Placement::new(Vector3::new(30.0, -70.0, 110.0), Vector3::zeros())
            .unwrap()
            .rotation();
        // Products of unit vectors: a few roundings of 1.1e-16.
        assert!((r.transpose() * r - Matrix3::identity()).norm() < 1e-15);
        assert!((r.determinant() - 1.0).abs() < 1e-15);
    }
}
