//! Settings of the box, which outlive a set-up.

use super::{NAME_MAX, Storage};
use serde::{Deserialize, Serialize};

const _: () = assert!(NAME_MAX == 32, "texts of settings are stated as 32 bytes");

/// Which setting.
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

/// A setting with its value: one item at a time, so that each fits a frame and one that
/// the box does not know is refused without harm to the others.
///
/// What is written holds at once, except the link's rate, which holds from the next
/// start. It outlives the power switch once [`super::Request::SaveSettings`] was answered.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Setting<'a> {
    /// What this box is called, at most 32 bytes.
    Name(&'a str),
    /// Rate of the link, baud. A box that hears bytes for a minute after a start, but no valid
    /// frame, listens at the rate that it was delivered with, and so to and fro until it does.
    LinkBaud(u32),
    /// Samples per second of the box's converters.
    SampleRate(f64),
    /// One input of the converters.
    Input(#[serde(borrow)] Input<'a>),
}

/// What is wired to an input, and how its counts become SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Input<'a> {
    /// Its number, from zero.
    pub input: u8,
    /// How the sensor is wired.
    pub circuit: Circuit,
    /// Serial number of the sensor, at most 32 bytes.
    pub serial: &'a str,
    /// Who calibrated it, or the certificate's number, at most 32 bytes.
    pub certificate: &'a str,
    /// Day of the calibration.
    pub calibrated: Option<Date>,
    /// m/s², N or N m per count; negative where the sensor is turned round.
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

/// How a sensor is wired.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Circuit {
    /// Nothing is wired to the input.
    Unused,
    /// A voltage.
    Voltage,
    /// A strain-gauge bridge.
    Bridge,
    /// A charge amplifier.
    Charge,
    /// A sensor with its own amplifier, fed by a constant current.
    Iepe,
    /// A digital sensor.
    Digital,
}

/// A day.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Date {
    /// Of the Gregorian calendar.
    pub year: u16,
    /// 1 to 12.
    pub month: u8,
    /// 1 to 31.
    pub day: u8,
}

/// Settings are saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Saved {
    /// Where. In memory they hold until the box is switched off.
    pub storage: Storage,
}
