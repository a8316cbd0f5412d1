//! A first setup from the channels of recordings, with a table of sensors or with what the user
//! answers.
//!
//! | file | step |
//! | --- | --- |
//! | `names` | the meaning of a channel's name |
//! | `channels` | recordings to sensors and runs |
//! | `table` | positions, directions and units from `sensors.csv` |
//! | `ask` | questions on a terminal |
//! | `draft` | the setup as text; what is not known stands as a comment that says what to fill in |

mod ask;
mod channels;
mod draft;
mod names;
mod table;

pub use ask::ask;
pub use channels::{Found, find};
pub use draft::draft;
pub use table::fill;

use crate::printable::quoted;
use crate::recording::RecordingError;
use std::path::PathBuf;

/// Reason why there is no draft.
#[derive(Debug, thiserror::Error)]
pub enum InitError {
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A recording that stands there twice.
    #[error("{} is given twice; name each recording once, a run each", file.display())]
    Twice {
        /// The recording.
        file: PathBuf,
    },
    /// Text that is no recording.
    #[error("{}: no row of numbers stands below a row of names; is it a recording?", file.display())]
    NoRecording {
        /// The file.
        file: PathBuf,
    },
    /// No channel that could be a sensor.
    #[error("the recordings have no channel in common that could be a sensor; they have {found}")]
    NoSensor {
        /// Channels of the first recording.
        found: String,
    },
    /// More channels than a setup has sensors.
    #[error(
        "{found} channels could be sensors, at most {limit} can be used; name those that count in a table: --sensors FILE"
    )]
    TooMany {
        /// Channels.
        found: usize,
        /// Most that are taken.
        limit: usize,
    },
    /// A name that no setup can hold.
    #[error("{}: the channel \"{}\" has control characters in its name; rename it", file.display(), quoted(channel))]
    Name {
        /// The recording.
        file: PathBuf,
        /// Its channel.
        channel: String,
    },
    /// The table of sensors cannot be read.
    #[error("{}: cannot be read: {reason}", file.display())]
    Unreadable {
        /// The table.
        file: PathBuf,
        /// Reason of the reader.
        reason: String,
    },
    /// The table of sensors does not fit.
    #[error("{}, line {line}: {reason}", file.display())]
    Table {
        /// The table.
        file: PathBuf,
        /// Line, from one.
        line: u64,
        /// Value found and values expected.
        reason: String,
    },
}
