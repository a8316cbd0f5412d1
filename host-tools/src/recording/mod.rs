//! Recordings: rows of channel readings, streamed, so that memory does not grow with
//! their length.

mod csv_file;
mod error;
mod header;
mod health;

pub use csv_file::Recording;
pub use error::RecordingError;
pub use health::{ChannelHealth, Complaint, Health};
