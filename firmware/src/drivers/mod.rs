//! Converters: what turns a sensor's signal into counts.
//!
//! | folder | chip | bus |
//! | --- | --- | --- |
//! | [`ads131m08`] | eight simultaneous channels of 24 bits | SPI mode 1, checksum both ways |
//! | [`adxl355`] | accelerometer, three axes of 20 bits | SPI mode 0, no checksum |
//!
//! A third kind is one more folder: a type that implements [`Converter`], and a model of it in
//! [`crate::models`]. A box with it has it in its list, `sampling/bank.rs`. Drivers know
//! embedded-hal's traits, no microcontroller and no board.

pub mod ads131m08;
pub mod adxl355;

/// A device that samples some channels at once and keeps them until they are read.
pub trait Converter {
    /// Channels of a sample.
    fn channels(&self) -> usize;

    /// Chooses the sample rate, Hz, and the gain of each channel, which hold from the next
    /// [`Self::prepare`] on. A device without gains ignores them; a gain that is missing is one.
    ///
    /// # Errors
    ///
    /// [`Fault::Unsupported`] if the device does not have this rate; nothing is changed then.
    fn choose(&mut self, rate: f64, gains: &[u8]) -> Result<(), Fault>;

    /// Brings the device from any state to the one it samples in: reset, every register
    /// written and read back. It may take as long as some hundred bytes take on the bus.
    ///
    /// # Errors
    ///
    /// What the device did instead.
    fn prepare(&mut self) -> Result<(), Fault>;

    /// Reads the oldest sample that the device holds, one count for each channel.
    ///
    /// # Errors
    ///
    /// Why there is none. What `counts` holds then is no sample.
    fn read(&mut self, counts: &mut [i32]) -> Result<Reading, Fault>;
}

/// What came with a good sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// The device has refused what it was sent before, for its checksum: it did nothing, and
    /// the sample is good.
    pub refused: bool,
}

/// Why a device gave no sample, or could not be prepared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The bus failed.
    Bus,
    /// What came is not what was sent: checksum, padding or a word that cannot be.
    Checksum,
    /// Nothing but zeros or nothing but ones came: the line does not move.
    Stuck,
    /// There is no new sample.
    Stale,
    /// The device has lost its settings: it has reset itself, or they were changed.
    Reset,
    /// The device has restarted its conversions.
    Resynchronised,
    /// Another device, or none.
    Identity {
        /// What it says it is.
        found: u16,
        /// What it should say.
        expected: u16,
    },
    /// A register does not keep what is written.
    Register {
        /// Its address.
        address: u8,
        /// What was read.
        found: u16,
        /// What was written.
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
                "the device says {found:#06x} where {expected:#06x} is expected: see the wiring"
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
                "a command was answered by {found:#06x} where {expected:#06x} is expected"
            ),
        }
    }
}

impl core::error::Error for Fault {}
