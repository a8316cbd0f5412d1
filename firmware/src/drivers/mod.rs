//! Drivers of converters, which turn sensors' signals into counts.
//!
//! | folder | chip | bus |
//! | --- | --- | --- |
//! | [`ads131m08`] | eight simultaneous channels of 24 bits | SPI mode 1, checksum both ways |
//! | [`adxl355`] | accelerometer, three axes of 20 bits | SPI mode 0, no checksum |
//!
//! [`lanes`] is the trait of buses that exchange frames by themselves, [`Lowpass`] how a converter delays and damps.
//!
//! A third kind is one more folder with a type that implements [`Converter`], a model of it in
//! [`crate::models`], and a place in the list of the box's converters, `sampling/bank.rs`. Each has a
//! function `lowpass`, by which its inputs are brought into step with those of others. Drivers depend on embedded-hal's traits, on no microcontroller and no board.

pub mod ads131m08;
pub mod adxl355;
pub mod lanes;
mod lowpass;

pub use lowpass::Lowpass;

use serde::{Deserialize, Serialize};

/// Signal that a channel converts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum Signal {
    /// The channel's pins.
    #[default]
    Pins = 0,
    /// A short circuit within the device, to measure its noise.
    Shorted = 1,
    /// A positive voltage of the device's own.
    TestPositive = 2,
    /// The same voltage with the opposite sign.
    TestNegative = 3,
}

/// A device that samples some channels at once and keeps them until they are read.
pub trait Converter {
    /// Channels of a sample.
    fn channels(&self) -> usize;

    /// Chooses the sample rate, Hz, the gain of each channel and the signal of all of them, which hold
    /// from the next [`Self::prepare`] on. A device without gains, or without signals of its own,
    /// ignores them; a gain that is missing is one.
    ///
    /// # Errors
    ///
    /// [`Fault::Unsupported`] if the device does not have this rate; nothing is changed then.
    fn choose(&mut self, rate: f64, gains: &[u8], signal: Signal) -> Result<(), Fault>;

    /// Resets the device from any state, and writes and reads back every register, after which it
    /// samples. It takes as long as some hundred bytes on the bus.
    ///
    /// # Errors
    ///
    /// The first [`Fault`].
    fn prepare(&mut self) -> Result<(), Fault>;

    /// Reads the oldest sample that the device holds, one count for each channel.
    ///
    /// # Errors
    ///
    /// The [`Fault`] because of which there is none; `counts` is not valid then.
    fn read(&mut self, counts: &mut [i32]) -> Result<Reading, Fault>;

    /// The same from bytes that a lane has received for the device's request, see [`lanes`].
    ///
    /// # Errors
    ///
    /// As [`Self::read`]; [`Fault::Bus`] if there are too few bytes, or the device has no request.
    fn decode(&mut self, _received: &[u8], _counts: &mut [i32]) -> Result<Reading, Fault> {
        Err(Fault::Bus)
    }
}

/// Status of a good sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// `true` if the device has refused the frame sent before because of its checksum.
    pub refused: bool,
}

/// A fault because of which a device has no sample, or cannot be prepared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The bus failed.
    Bus,
    /// Received data are garbled: wrong checksum or padding.
    Checksum,
    /// All received bits are zeros, or all are ones: the line is stuck.
    Stuck,
    /// There is no new sample.
    Stale,
    /// The device has lost its settings: it has reset itself, or they were changed.
    Reset,
    /// The device has restarted its conversions.
    Resynchronised,
    /// Another device, or none, answers.
    Identity {
        /// Identity that was read.
        found: u16,
        /// Identity of the device that belongs there.
        expected: u16,
    },
    /// A register does not hold the value that was written.
    Register {
        /// Address of the register.
        address: u8,
        /// Value that was read.
        found: u16,
        /// Value that was written.
        expected: u16,
    },
    /// The device does not have the sample rate that was chosen.
    Unsupported,
    /// A command was not acknowledged.
    Command {
        /// The answer.
        found: u16,
        /// The answer that belongs to the command.
        expected: u16,
    },
}

impl core::fmt::Display for Fault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::Bus => f.write_str("the SPI bus failed: see its configuration"),
            Self::Checksum => {
                f.write_str("a frame came with a wrong checksum: shorten or shield the wires")
            }
            Self::Stuck => f.write_str(
                "the data line is stuck at one level: see its wire and the converter's supply",
            ),
            Self::Stale => f.write_str("there is no new sample: see the converter's clock"),
            Self::Reset => f.write_str("the converter has reset itself: see its supply"),
            Self::Resynchronised => {
                f.write_str("the converter has restarted on its own: see the SYNC line")
            }
            Self::Unsupported => {
                f.write_str("the converter does not have this sample rate: choose another one")
            }
            Self::Identity { found, expected } => write!(
                f,
                "the device's identity is {found:#06x}, expected {expected:#06x}: see the wiring"
            ),
            Self::Register {
                address,
                found,
                expected,
            } => write!(
                f,
                "register {address:#04x} reads {found:#06x} after {expected:#06x} was written"
            ),
            Self::Command { found, expected } => write!(
                f,
                "a command was answered by {found:#06x}, expected {expected:#06x}"
            ),
        }
    }
}

impl core::error::Error for Fault {}
