//! Noise and type B uncertainty of sensors, as an engineer states them.

use std::fmt::Write as _;

use super::document::Section;
use super::error::DocumentError;
use super::{Quantity, Setup};

/// The keys that sensors and defaults share.
pub(super) const KEYS: [&str; 4] = [
    "noise",
    "calibration_uncertainty",
    "position_uncertainty",
    "direction_uncertainty",
];

/// Noise and uncertainty that are stated of one sensor, or of all that state none themselves.
/// Uncertainties are standard uncertainties (k = 1) in the sense of the GUM.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Uncertainty {
    /// Standard deviation of the noise in SI, after `scale`: of the samples of a random run
    /// between 0 Hz and half the sample rate, of a complex amplitude (root of the sum of the
    /// variances of both parts) of a stepped sine, of the averaged reading of a pose.
    pub noise: Option<f64>,
    /// Uncertainty of the sensitivity, relative.
    pub calibration: Option<f64>,
    /// Uncertainty of each coordinate of the position, m.
    pub position: Option<f64>,
    /// Uncertainty of the tilt about each axis, degrees.
    pub direction: Option<f64>,
}

/// Noise and uncertainty of sensors that do not state their own.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
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

/// Reads the keys of one sensor, or of the defaults of one kind of sensor.
pub(super) fn read(section: &Section<'_>) -> Result<Uncertainty, DocumentError> {
    let [noise, calibration, position, direction] = KEYS;
    Ok(Uncertainty {
        noise: section.number_where(
            noise,
            "the standard deviation of the noise in m/s², N or N m, more than 0",
            |x| x > 0.0,
        )?,
        calibration: section.number_where(
            calibration,
            "a relative standard uncertainty from 0 to 0.5, such as 0.01 for one per cent",
            |x| (0.0..=0.5).contains(&x),
        )?,
        position: section.number_where(
            position,
            "a standard uncertainty in m from 0 to 1, such as 0.001 for one millimetre",
            |x| (0.0..=1.0).contains(&x),
        )?,
        direction: section.number_where(
            direction,
            "a standard uncertainty in degrees from 0 to 30",
            |x| (0.0..=30.0).contains(&x),
        )?,
    })
}

/// Reads `[defaults]`.
pub(super) fn defaults(section: &Section<'_>) -> Result<Defaults, DocumentError> {
    let kinds = ["accelerometer", "force", "moment"];
    // Noise of sensors of several units would be a number without one.
    if section.has("noise") {
        return Err(section.unexpected(
            "noise",
            "given for all sensors",
            "it in [defaults.accelerometer] (m/s²), [defaults.force] (N) or [defaults.moment] (N m)",
        ));
    }
    let known: Vec<&str> = KEYS[1..].iter().copied().chain(kinds).collect();
    section.only(&known)?;
    let kind = |key: &str| -> Result<Uncertainty, DocumentError> {
        let Some(section) = section.section(key)? else {
            return Ok(Uncertainty::default());
        };
        section.only(&KEYS)?;
        read(&section)
    };
    Ok(Defaults {
        all: read(section)?,
        accelerometer: kind("accelerometer")?,
        force: kind("force")?,
        moment: kind("moment")?,
    })
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
