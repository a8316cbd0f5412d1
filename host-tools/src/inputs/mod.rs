//! Sensors that are wired to a box's inputs, as a file: with their calibrations, written once
//! and kept with the certificates.
//!
//! ```toml
//! [[input]]
//! input = 1                    # as printed on the box, from one
//! channel = "fx"               # name of the column in recordings
//! circuit = "bridge"
//! serial = "LC-0815"
//! certificate = "K 2026-17"
//! calibrated = "2026-03-02"
//! uncertainty = 0.002          # of the sensitivity, relative
//! rated_load = 500.0           # N or N m
//! rated_output = 2e-3          # V per V of supply; negative where the cell is turned round
//! ```
//!
//! The same holds for the other circuits with what their data sheets say. Whoever has
//! calibrated sensor, cable and input together gives `per_count` in its place.

mod parse;
mod print;

use crate::setup::{DocumentError, Source};
use massline_firmware::calibration::Certificate;
use massline_firmware::wire::{Circuit, Date, Input};
use std::path::Path;

/// One input of a box.
#[derive(Clone, Debug, PartialEq)]
pub struct InputEntry {
    /// Its number, from zero.
    pub input: u8,
    /// Name of the column in recordings.
    pub channel: Option<String>,
    /// Certificate of the sensor that is wired to it.
    pub certificate: Certificate,
}

impl InputEntry {
    /// Its number as people read it, from one.
    #[must_use]
    pub fn number(&self) -> u32 {
        u32::from(self.input) + 1
    }

    /// Name of its column: the one given, or `input 3`.
    #[must_use]
    pub fn column(&self) -> String {
        let own = self.channel.clone();
        own.unwrap_or_else(|| format!("input {}", self.number()))
    }

    /// As it goes over the link.
    #[must_use]
    pub fn setting(&self) -> Input<'_> {
        self.certificate.input(self.input)
    }

    /// `true` if a sensor is wired to it.
    #[must_use]
    pub fn is_used(&self) -> bool {
        self.certificate.circuit() != Circuit::Unused
    }
}

/// Reads a file of inputs.
///
/// # Errors
/// [`DocumentError`] that names file, line and key: also for what the box would refuse.
pub fn read(file: &Path) -> Result<Vec<InputEntry>, DocumentError> {
    parse::document(&Source::read(file)?)
}

/// The file that says so.
#[must_use]
pub fn to_toml(entries: &[InputEntry]) -> String {
    print::document(entries)
}

/// Name of a circuit.
#[must_use]
pub const fn circuit(circuit: Circuit) -> &'static str {
    match circuit {
        Circuit::Unused => "unused",
        Circuit::Voltage => "voltage",
        Circuit::Bridge => "bridge",
        Circuit::Charge => "charge",
        Circuit::Iepe => "iepe",
        Circuit::Digital => "digital",
    }
}

/// A day as year-month-day.
#[must_use]
pub fn day(date: Date) -> String {
    format!("{:04}-{:02}-{:02}", date.year, date.month, date.day)
}
