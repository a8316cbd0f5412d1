//! Noise and type B uncertainty of sensors, as an engineer states them.

use std::fmt::Write as _;

use serde::{Deserialize, Deserializer};

use super::document::{Document, Section};
use super::error::DocumentError;
use super::keys::outside;
use super::units::Length;
use super::{Quantity, Setup};

/// The keys that sensors and defaults share.
const KEYS: [&str; 4] = [
    "noise",
    "calibration_uncertainty",
    "position_uncertainty",
    "direction_uncertainty",
];

/// Noise and uncertainty that are stated of one sensor, or of all that state none themselves.
/// Uncertainties are standard uncertainties (k = 1) in the sense of the GUM.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Uncertainty {
    /// Standard deviation of the noise in SI, after `scale`: of the samples of a random run
    /// between 0 Hz and half the sample rate, of a complex amplitude (root of the sum of the
    /// variances of both parts) of a stepped sine, of the averaged reading of a pose.
    #[serde(deserialize_with = "noise")]
    pub noise: Option<f64>,
    /// Uncertainty of the sensitivity, relative.
    #[serde(rename = "calibration_uncertainty", deserialize_with = "calibration")]
    pub calibration: Option<f64>,
    /// Uncertainty of each coordinate of the position, m.
    #[serde(rename = "position_uncertainty", deserialize_with = "position")]
    pub position: Option<f64>,
    /// Uncertainty of the tilt about each axis, degrees.
    #[serde(rename = "direction_uncertainty", deserialize_with = "direction")]
    pub direction: Option<f64>,
}

/// Noise and uncertainty of sensors that do not state their own.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(from = "DefaultsKeys")]
pub struct Defaults {
    /// Uncertainty of every sensor; noise, whose unit differs, is not among it.
    pub all: Uncertainty,
    /// Noise and uncertainty of accelerometers.
    pub accelerometer: Uncertainty,
    /// Noise and uncertainty of load cells that measure a force.
    pub force: Uncertainty,
    /// Noise and uncertainty of load cells that measure a moment.
    pub moment: Uncertainty,
}

impl Uncertainty {
    /// The values of `self`, and those of `other` where `self` has none.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            noise: self.noise.or(other.noise),
            calibration: self.calibration.or(other.calibration),
            position: self.position.or(other.position),
            direction: self.direction.or(other.direction),
        }
    }
}

impl Uncertainty {
    /// The same with its length in m, which is stated in a section by this key, or in its table.
    pub(super) fn in_metres(
        mut self,
        length: Length,
        key: &str,
        section: &Section<'_>,
    ) -> Result<Self, DocumentError> {
        let found = self.position;
        self.position = found.map(|x| length.metres(x));
        match found.filter(|x| length.metres(*x) > 1.0) {
            None => Ok(self),
            Some(found) => Err(DocumentError::Unexpected {
                place: section.place_of(key),
                key: "position_uncertainty".to_owned(),
                found: found.to_string(),
                expected: "a standard uncertainty in m from 0 to 1, such as 0.001 for one millimetre, or the like in the unit that `length_unit` names".to_owned(),
            }),
        }
    }
}

impl Defaults {
    /// The same with its lengths in m.
    pub(super) fn in_metres(
        self,
        length: Length,
        document: &Document<'_>,
    ) -> Result<Self, DocumentError> {
        let section = document.section("defaults", 0);
        let of = |u: Uncertainty, key| u.in_metres(length, key, &section);
        Ok(Self {
            all: of(self.all, "position_uncertainty")?,
            accelerometer: of(self.accelerometer, "accelerometer")?,
            force: of(self.force, "force")?,
            moment: of(self.moment, "moment")?,
        })
    }
}

impl Setup {
    /// Noise and uncertainty of accelerometer `number`, its own or the default.
    #[must_use]
    pub fn accelerometer_uncertainty(&self, number: usize) -> Uncertainty {
        let own = self.accelerometers.get(number).map(|a| a.uncertainty);
        self.or_default(own.unwrap_or_default(), self.defaults.accelerometer)
    }

    /// Noise and uncertainty of load cell `number`, its own or the default.
    #[must_use]
    pub fn load_cell_uncertainty(&self, number: usize) -> Uncertainty {
        let Some(cell) = self.load_cells.get(number) else {
            return Uncertainty::default();
        };
        let kind = match cell.quantity {
            Quantity::Force => self.defaults.force,
            Quantity::Moment => self.defaults.moment,
        };
        self.or_default(cell.uncertainty, kind)
    }

    fn or_default(&self, own: Uncertainty, kind: Uncertainty) -> Uncertainty {
        own.or(kind).or(self.defaults.all)
    }
}

super::keys::numbers! {
    noise: "the standard deviation of the noise in m/s², N or N m, more than 0", |x| x > 0.0;
    calibration:
        "a relative standard uncertainty from 0 to 0.5, such as 0.01 for one per cent",
        |x| (0.0..=0.5).contains(&x);
    position:
        "a standard uncertainty, not negative", |x| x >= 0.0;
    direction:
        "a standard uncertainty in degrees from 0 to 30",
        |x| (0.0..=30.0).contains(&x);
}

/// `[defaults]` as it is written.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub(super) struct DefaultsKeys {
    #[serde(deserialize_with = "noise_of_all")]
    noise: Option<f64>,
    #[serde(deserialize_with = "calibration")]
    calibration_uncertainty: Option<f64>,
    #[serde(deserialize_with = "position")]
    position_uncertainty: Option<f64>,
    #[serde(deserialize_with = "direction")]
    direction_uncertainty: Option<f64>,
    accelerometer: Uncertainty,
    force: Uncertainty,
    moment: Uncertainty,
}

/// Noise of sensors of several units would be a number without one.
fn noise_of_all<'de, D: Deserializer<'de>>(_: D) -> Result<Option<f64>, D::Error> {
    Err(outside(
        "given for all sensors",
        "it in [defaults.accelerometer] (m/s²), [defaults.force] (N) or [defaults.moment] (N m)",
    ))
}

impl From<DefaultsKeys> for Defaults {
    fn from(keys: DefaultsKeys) -> Self {
        Self {
            all: Uncertainty {
                noise: keys.noise,
                calibration: keys.calibration_uncertainty,
                position: keys.position_uncertainty,
                direction: keys.direction_uncertainty,
            },
            accelerometer: keys.accelerometer,
            force: keys.force,
            moment: keys.moment,
        }
    }
}

/// Writes the keys of one sensor. `unit` is that of the noise.
pub(super) fn print(out: &mut String, uncertainty: &Uncertainty, unit: &str) {
    let Uncertainty {
        noise,
        calibration,
        position,
        direction,
    } = *uncertainty;
    let values = [noise, calibration, position, direction];
    let comments = [
        format!("{unit}, standard deviation"),
        "relative, k = 1".to_owned(),
        "m, k = 1".to_owned(),
        "degrees, k = 1".to_owned(),
    ];
    for ((key, value), comment) in KEYS.into_iter().zip(values).zip(comments) {
        if let Some(value) = value {
            let _ = writeln!(out, "{key} = {value:?}  # {comment}");
        }
    }
}

/// Writes `[defaults]` and its tables.
pub(super) fn print_defaults(out: &mut String, defaults: &Defaults) {
    let nothing = Uncertainty::default();
    let sections = [
        ("defaults", defaults.all, ""),
        ("defaults.accelerometer", defaults.accelerometer, "m/s²"),
        ("defaults.force", defaults.force, "N"),
        ("defaults.moment", defaults.moment, "N m"),
    ];
    for (name, uncertainty, unit) in sections {
        if uncertainty != nothing {
            let _ = writeln!(out, "\n[{name}]");
            print(out, &uncertainty, unit);
        }
    }
}
