//! Settings of the box, which are independent of the set-up.

use super::{NAME_MAX, Storage};
use serde::{Deserialize, Serialize};

const _: () = assert!(NAME_MAX == 32, "texts of settings are stated as 32 bytes");

/// Name of a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SettingKey {
    /// [`Setting::Name`].
    Name,
    /// [`Setting::LinkBaud`].
    LinkBaud,
    /// [`Setting::SampleRate`].
    SampleRate,
    /// [`Setting::Input`] of this number.
    Input(u8),
}

/// A setting with its value. A message has one setting, so that each fits a frame and an unknown
/// one is refused without harm to the others.
///
/// A new value holds at once, except the bit rate of the link, which holds from the next start. The
/// value is stored once [`super::Request::SaveSettings`] was answered.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Setting<'a> {
    /// Name of the box, at most 32 bytes.
    Name(&'a str),
    /// Bit rate of the link, baud. A box that receives bytes for a minute after a start, but no
    /// valid frame, listens at the factory bit rate, and alternates between both until a valid
    /// frame comes.
    LinkBaud(u32),
    /// Sample rate of the box's converters, Hz.
    SampleRate(f64),
    /// Wiring and calibration of one input of the converters.
    Input(#[serde(borrow)] Input<'a>),
}

/// Wiring and calibration of an input.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Input<'a> {
    /// Number of the input, from zero.
    pub input: u8,
    /// Circuit of the sensor.
    pub circuit: Circuit,
    /// Serial number of the sensor, at most 32 bytes.
    pub serial: &'a str,
    /// Calibration laboratory, or number of the certificate, at most 32 bytes.
    pub certificate: &'a str,
    /// Day of the calibration.
    pub calibrated: Option<Date>,
    /// Sensitivity in m/s², N or N m per count; negative if the sensor is turned round.
    pub per_count: f64,
    /// Count at zero.
    pub offset: f64,
    /// Standard uncertainty of `per_count`, relative.
    pub uncertainty: f64,
    /// Gain of the converter's amplifier.
    pub gain: u8,
    /// Counts from which on, and down to which, a sample is an overload.
    pub limits: [i32; 2],
}

/// Circuit of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Circuit {
    /// Nothing is wired to the input.
    Unused,
    /// The input measures a voltage.
    Voltage,
    /// The sensor is a strain-gauge bridge.
    Bridge,
    /// The sensor has a charge amplifier.
    Charge,
    /// The sensor has its own amplifier, fed by a constant current.
    Iepe,
    /// The sensor is digital.
    Digital,
}

/// A day of the Gregorian calendar.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Date {
    /// Year.
    pub year: u16,
    /// Month, 1 to 12.
    pub month: u8,
    /// Day, 1 to 31.
    pub day: u8,
}

/// Confirmation that the settings are saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Saved {
    /// Memory that holds the settings.
    pub storage: Storage,
}
