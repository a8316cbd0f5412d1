//! Recordings: samples of channels, streamed, so that memory does not grow with their length.
//!
//! | file | holds |
//! | --- | --- |
//! | `reader` | a recording as the rest of the program reads it, whatever its format |
//! | `source` | the trait behind which every format lies |
//! | `csv` | CSV |
//! | `uff` | universal files with time histories of dataset 58 |
//! | `mat` | MAT files of version 5 |
//! | `hdf5` | HDF5, with MAT files of version 7.3 and netCDF-4 |
//! | `tdms` | TDMS without scaling by DAQmx |
//! | `wav` | WAV |
//! | `parquet` | Parquet |
//! | `about` | facts about a recording that Parquet files and journals carry |
//! | `columns` | files that have each channel as a series of its own |
//! | `bytes` | any part of a file, in shared pages |
//! | `testlab` | structs of MAT files as Simcenter Testlab exports them |
//! | `rate` | names under which files state the sample rate |
//! | `number` | numbers of fixed size as files hold them |
//! | `form` | the form of text recordings, where the setup states it |
//! | `foreign` | files of kinds that are not read, by name and with the way out |
//! | `input` | the bytes of a file, unpacked where it is compressed by gzip |
//! | `names` | the search for channels by name |
//! | `delay` | channels that come late, brought into step |
//! | `coupling` | channels that are coupled to alternating current, brought to one lower limit |
//! | `around` | samples on both sides of one, for these two |
//! | `time` | the channel of time: its name, its unit, and how far it is rounded |
//! | `preamble` | true sample rate and calibrations that a recording states |
//! | `faults`, `health` | faults of samples; the state of channels, seen from their samples |
//! | `rows` | recordings that are written |
//! | `checksum` | the identity of a file |
//!
//! A new format is a file in this folder with a type that implements [`Source`] and a
//! `Format`, and its two lines in this one (`mod` and `FORMATS`).

mod about;
mod around;
mod bytes;
mod checksum;
mod columns;
mod coupling;
mod csv;
mod delay;
mod error;
mod faults;
mod foreign;
mod form;
mod hdf5;
mod health;
mod input;
mod mat;
mod names;
mod number;
mod parquet;
mod preamble;
mod rate;
mod reader;
mod rows;
mod source;
mod tdms;
mod testlab;
#[cfg(test)]
mod tests;
mod time;
mod uff;
mod wav;

pub(crate) use about::About;
pub use about::Firmware;
pub use checksum::Checksum;
pub(crate) use checksum::Summed;
pub(crate) use coupling::{Corners, MOST_CORNER};
pub(crate) use delay::MOST_DELAY;
pub use error::{Mismatch, RecordingError};
pub(crate) use faults::read as spelt;
pub use faults::{HEALTH_COLUMN, fault_words, spell};
pub use form::Form;
pub use health::{ChannelHealth, Complaint, Health, Held, Outlier};
pub(crate) use names::{some_of, split as split_label};
pub use preamble::{Preamble, Traceability, TrueRate};
pub use reader::Recording;
pub use rows::Written;
pub(crate) use rows::{Line, Rows};
pub use source::{Block, Channel, Place, Source, StatedRate};

use input::Input;

/// A file that was opened in its format.
type Opened = Result<Box<dyn Source>, RecordingError>;

/// A format of recordings.
struct Format {
    /// `true` if the first bytes of a file, unpacked, are those of this format.
    recognises: fn(&[u8]) -> bool,
    /// Opens a file of this format.
    open: fn(Input, &Form) -> Opened,
}

/// All formats, in the order in which they are tried. CSV is the last: it takes every file, and
/// its errors say what one may be that is no text.
const FORMATS: [Format; 8] = [
    foreign::FORMAT,
    uff::FORMAT,
    mat::FORMAT,
    hdf5::FORMAT,
    tdms::FORMAT,
    wav::FORMAT,
    parquet::FORMAT,
    csv::FORMAT,
];
