//! Measurements of the board's own parts, for whoever puts a board into operation.

use super::ConverterFault;
use crate::drivers::Signal;
use crate::drivers::lanes::BusClock;
use serde::{Deserialize, Serialize};

/// Number of converters with a DRDY line.
pub const DRDY_LINES: usize = 4;

/// A measurement of the board, which takes milliseconds at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Probe {
    /// Returns the frequency of the crystal as it was measured at the start. [`Probed::Crystal`]. Also
    /// while samples are recorded.
    Crystal,
    /// Exchanges bytes over a bus of the converters, by its number, while none of them is selected.
    /// [`Probed::Loop`].
    Loop(u8),
    /// Prepares a converter, by its number, as a start of the inputs does. [`Probed::Converter`].
    Converter(u8),
    /// Returns the times between the DRDY lines at the newest sample. [`Probed::Skew`]. Also while
    /// samples are recorded.
    Skew,
}

/// Result of a [`Probe`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Probed {
    /// Frequency of the crystal in Hz by the internal oscillator, which is good to 1 % at room
    /// temperature; `None` if it does not oscillate.
    Crystal(Option<u32>),
    /// Comparison of the bytes that were sent and received.
    Loop(Looped),
    /// Fault of the converter; `None` if it was prepared.
    Converter(Option<ConverterFault>),
    /// Time from the first DRDY line to each of them, ticks; `None` for a line without an edge.
    Skew([Option<u16>; DRDY_LINES]),
}

/// Comparison of bytes that were sent over a bus with those that were received.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Looped {
    /// Number of bits that were sent.
    pub bits: u16,
    /// Number of bits that were received otherwise than they were sent.
    pub wrong: u16,
    /// Number of ones among the bits that were received.
    pub ones: u16,
}

/// Conditions under which the inputs are sampled. The usual ones are the pins' signals at the usual
/// clock of the buses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Conditions {
    /// Signal that the channels of the ADS131M08 convert.
    pub signal: Signal,
    /// Clock of their buses.
    pub bus: BusClock,
}
