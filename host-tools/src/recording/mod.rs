//! Recordings: samples of channels, streamed, so that memory does not grow with their length.
//!
//! | file | holds |
//! | --- | --- |
//! | `reader` | a recording as the rest of the program reads it, whatever its format |
//! | `source` | the trait behind which every format lies |
//! | `csv` | CSV |
//! | `input` | the bytes of a file, unpacked where it is compressed by gzip |
//! | `names` | the search for channels by name |
//! | `delay` | channels that come late, brought into step |
//! | `preamble` | true sample rate and calibrations that a recording states |
//! | `faults`, `health` | faults of samples; the state of channels, seen from their samples |
//! | `checksum` | the identity of a file |
//!
//! A new format is a file in this folder with a type that implements [`Source`] and a
//! `Format`, and its two lines in this one (`mod` and `FORMATS`).

mod checksum;
mod csv;
mod delay;
mod error;
mod faults;
mod health;
mod input;
mod names;
mod preamble;
mod reader;
mod source;
#[cfg(test)]
mod tests;

pub use checksum::Checksum;
pub(crate) use checksum::Summed;
pub(crate) use csv::field;
pub(crate) use delay::MOST_DELAY;
pub use error::RecordingError;
pub use faults::{HEALTH_COLUMN, fault_words, spell};
pub use health::{ChannelHealth, Complaint, Health};
pub(crate) use names::{some_of, split as split_label};
pub use preamble::{Preamble, Traceability, TrueRate};
pub use reader::Recording;
pub use source::{Block, Channel, Place, Source, StatedRate};

use input::Input;

/// A format of recordings.
struct Format {
    /// `true` if the first bytes of a file, unpacked, are those of this format.
    recognises: fn(&[u8]) -> bool,
    /// Opens a file of this format.
    open: fn(Input) -> Result<Box<dyn Source>, RecordingError>,
}

/// All formats, in the order in which they are tried. CSV is the last: it takes every file, and
/// its errors say what one may be that is no text.
const FORMATS: [Format; 1] = [csv::FORMAT];
