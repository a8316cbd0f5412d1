//! Recordings: rows of channel readings, streamed, so that memory does not grow with
//! their length.

mod checksum;
mod csv_file;
mod error;
mod faults;
mod header;
mod health;
mod preamble;

pub use checksum::Checksum;
pub(crate) use checksum::Summed;
pub use csv_file::Recording;
pub use error::RecordingError;
pub use faults::{HEALTH_COLUMN, fault_words, spell};
pub(crate) use header::field;
pub use health::{ChannelHealth, Complaint, Health};
pub use preamble::{Preamble, Traceability, TrueRate};
