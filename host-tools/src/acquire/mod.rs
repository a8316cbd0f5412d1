//! Samples of a box's own converters on this machine: in their order, in SI, with their faults.
//!
//! | file | holds |
//! | --- | --- |
//! | `intake` | messages to rows: gaps filled, counts to SI, what the counts tell of the sensors |
//! | `level` | mean, RMS and peak of each channel |
//! | `follow` | the conversation while samples come |
//! | `pace` | whether they come as fast as the box's rate says |
//! | `record` | rows to a recording that `identify` reads |
//! | `file` | that recording while it grows |
//! | `monitor` | levels some times a second |
//! | `fault` | the box's own faults in words |
//!
//! # Design
//!
//! The box sends counts, each message with the number of its first sample and the faults that
//! the converters' driver has found. A frame that is lost leaves a gap in the numbers, which
//! becomes rows without readings: nothing shifts, and nothing is made up. Overload, an open
//! lead and a reading that stands still are found here, by the watch that the box itself uses
//! in a run ([`massline_firmware::calibration::Channel`]).
//!
//! The rate at which samples really come is measured against this computer's clock and stands
//! in the recording ([`crate::sample_rate::SampleRate`]).

mod error;
mod fault;
mod file;
mod follow;
mod intake;
mod level;
mod monitor;
mod pace;
mod record;
#[cfg(test)]
mod tests;

pub use error::AcquireError;
pub use fault::{count_faults, fault_name, fault_text};
pub(crate) use follow::sample_rate;
pub use intake::{Intake, Row};
pub use level::Level;
pub use monitor::{Snapshot, monitor};
pub(crate) use record::traceability;
pub use record::{Ending, Order, Progress, Recorded, free_name, record};
