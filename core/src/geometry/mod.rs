//! Sensors, rigid-body modes and reference points: equations (2) to (5).
//!
//! Everything here is exact geometry. Positions are in metres in one Cartesian
//! frame, directions are unit vectors, rotations follow the right-hand rule.
//!
//! A vector of six always has the order *x, y, z, about x, about y, about z*:
//! `a = (ax, ay, az, α, β, γ)` for accelerations of a reference point and
//! `f = (fx, fy, fz, tx, ty, tz)` for the resultants exerted **on** the structure.

mod equations;
mod load_shares;
mod noise;
mod placement;
mod reference;
mod resultant_map;
mod resultants;
mod run;

pub use equations::Equations;
pub use load_shares::LoadShares;
pub use noise::{PackedNoise, ResultantNoise, accelerometer_places};
pub(crate) use noise::{least_translation, move_accelerations, move_forces};
pub use placement::Placement;
pub(crate) use reference::{resultants_at, transfer};
pub use resultant_map::{RESULTANTS, ResultantMap};
use resultants::{AccelerationFit, ForceResultants};
pub use run::{RunGeometry, RunSensor};

use nalgebra::{Matrix3, RowVector6, Vector3};

/// Most channels one run may record: accelerometers, load cells and the drive.
pub const MAX_CHANNELS: usize = 64;

/// Names of the six components of an acceleration, in their fixed order.
pub const ACCELERATION_NAMES: [&str; 6] = ["ax", "ay", "az", "α", "β", "γ"];

/// Names of the six force and moment resultants, in their fixed order.
pub const RESULTANT_NAMES: [&str; 6] = ["fx", "fy", "fz", "tx", "ty", "tz"];

/// Reason why a set of sensors is unusable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum GeometryError {
    /// A direction of length zero, or a position or direction that is not finite.
    Direction,
    /// More channels than [`MAX_CHANNELS`].
    TooManyChannels,
    /// No accelerometer with a weight above zero.
    NoAccelerometer,
    /// No load cell.
    NoLoadCell,
    /// A weight that is negative or not finite.
    Weight,
    /// A rotation, shift, position or weight with which coordinates, or what sensors add to
    /// the resultants, are not finite.
    NotFinite,
}

impl core::fmt::Display for GeometryError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Direction => f.write_str(
                "a sensor's position or direction is not finite, or its direction is zero",
            ),
            Self::TooManyChannels => write!(f, "more than {MAX_CHANNELS} channels in a run"),
            Self::NoAccelerometer => f.write_str("no accelerometer with a weight above zero"),
            Self::NoLoadCell => f.write_str("no load cell"),
            Self::Weight => f.write_str("a weight is negative or not finite"),
            Self::NotFinite => f.write_str(
                "a rotation, shift, position or weight is not finite, or too large to compute with",
            ),
        }
    }
}

impl core::error::Error for GeometryError {}

/// Mounting place of an accelerometer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mount {
    /// On the table or its adapter, which are rigid: it sees the base acceleration
    /// exactly, however elastic the structure is.
    Interface,
    /// On the structure: it sees the base acceleration plus elastic motion.
    #[default]
    Structure,
}

/// A single-axis accelerometer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accelerometer {
    position: Vector3<f64>,
    direction: Vector3<f64>,
    /// Mounting place.
    pub mount: Mount,
}

/// Measured quantity of a load cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Quantity {
    /// A force along the direction, N.
    #[default]
    Force,
    /// A moment about the direction, N m.
    Moment,
}

/// A single-axis load cell, or one axis of a multi-axis one. Positive is what acts
/// on the structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadCell {
    position: Vector3<f64>,
    direction: Vector3<f64>,
    /// Force or moment.
    pub quantity: Quantity,
}

fn checked(
    position: Vector3<f64>,
    direction: Vector3<f64>,
) -> Result<(Vector3<f64>, Vector3<f64>), GeometryError> {
    // Squares of numbers far from one overflow, or are zero.
    let largest = direction.amax();
    let finite = position.iter().chain(&direction).all(|x| x.is_finite());
    if finite && largest > 0.0 {
        let safe = (1e-140..1e140).contains(&largest);
        let direction = if safe { direction } else { direction / largest };
        Ok((position, direction / direction.norm()))
    } else {
        Err(GeometryError::Direction)
    }
}

impl Accelerometer {
    /// An accelerometer at `position` (m) that looks along `direction` (any length
    /// but zero).
    ///
    /// # Errors
    /// [`GeometryError::Direction`] if the direction is zero or anything is not finite.
    pub fn new(
        position: Vector3<f64>,
        direction: Vector3<f64>,
        mount: Mount,
    ) -> Result<Self, GeometryError> {
        let (position, direction) = checked(position, direction)?;
        Ok(Self {
            position,
            direction,
            mount,
        })
    }

    /// Position, m.
    #[must_use]
    pub fn position(&self) -> Vector3<f64> {
        self.position
    }

    /// Unit vector of the positive axis.
    #[must_use]
    pub fn direction(&self) -> Vector3<f64> {
        self.direction
    }

    /// One row of X_R, equation (3): what this sensor reads per unit acceleration of
    /// the reference point A, `dᵀ [ I | -skew(r) ]`.
    #[must_use]
    pub fn rigid_body_row(&self, reference: &Vector3<f64>) -> RowVector6<f64> {
        force_row(&(self.position - reference), &self.direction)
    }
}

impl LoadCell {
    /// A load cell at `position` (m) along or about `direction` (any length but zero).
    ///
    /// # Errors
    /// [`GeometryError::Direction`] if the direction is zero or anything is not finite.
    pub fn new(
        position: Vector3<f64>,
        direction: Vector3<f64>,
        quantity: Quantity,
    ) -> Result<Self, GeometryError> {
        let (position, direction) = checked(position, direction)?;
        Ok(Self {
            position,
            direction,
            quantity,
        })
    }

    /// Position, m.
    #[must_use]
    pub fn position(&self) -> Vector3<f64> {
        self.position
    }

    /// Unit vector of the positive axis.
    #[must_use]
    pub fn direction(&self) -> Vector3<f64> {
        self.direction
    }

    /// One row of X_R for equation (5): the resultants at A per unit reading. A force
    /// gives `[ d | r × d ]`, a directly measured moment `[ 0 | d ]`.
    #[must_use]
    pub fn rigid_body_row(&self, reference: &Vector3<f64>) -> RowVector6<f64> {
        match self.quantity {
            Quantity::Force => force_row(&(self.position - reference), &self.direction),
            Quantity::Moment => {
                let d = self.direction;
                RowVector6::new(0.0, 0.0, 0.0, d.x, d.y, d.z)
            }
        }
    }
}

/// `dᵀ [ I | -skew(r) ]`, which is `[ d | r × d ]`: the same six numbers turn a
/// rigid-body motion into a reading along `d` and a force along `d` into resultants.
fn force_row(r: &Vector3<f64>, d: &Vector3<f64>) -> RowVector6<f64> {
    let moment = r.cross(d);
    RowVector6::new(d.x, d.y, d.z, moment.x, moment.y, moment.z)
}

/// The matrix with `skew(r) v = r × v`.
#[must_use]
pub(crate) fn skew(r: &Vector3<f64>) -> Matrix3<f64> {
    r.cross_matrix()
}
