//! Why a replay cannot be done.

use crate::device::{ClientError, StreamError};
use crate::identification::AnswerError;
use crate::measure::MeasureError;
use crate::on_box::PlanError;
use crate::recording::RecordingError;

/// Why a replay cannot be done. A difference is none: it is what a replay looks for.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The box, or the way to it.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// The set-up does not fit the box.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The recordings.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// A recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The host has no answer for another reason than the data.
    #[error(transparent)]
    Answer(#[from] AnswerError),
    /// A flip that hits nothing.
    #[error(
        "--flip {found}: {reason}; write RUN:SAMPLE:CHANNEL:BIT, for example 1:300:{channel}:20"
    )]
    Flip {
        /// As it was written.
        found: String,
        /// Reason.
        reason: String,
        /// A channel there is.
        channel: String,
    },
    /// A survey that saw too few good blocks.
    #[error(
        "run \"{run}\" is too short, or has too many faults, for the box's survey, which looks at twelve accelerometers at a time and needs two good blocks of each; send more blocks (--blocks), or compare without weights (--no-weights)"
    )]
    Survey {
        /// Its name.
        run: String,
    },
    /// A box that has more samples than there are.
    #[error(
        "the box has taken {found} samples of run \"{run}\", whose recording has {samples}: it was sent another one; leave out --resume"
    )]
    Beyond {
        /// Its name.
        run: String,
        /// Samples that the box has.
        found: u64,
        /// Samples of the recording.
        samples: u64,
    },
    /// The box holds no replay that could go on.
    #[error(
        "the box does not hold this replay's set-up, so there is nothing to go on with; leave out --resume"
    )]
    NothingToResume,
}

impl ReplayError {
    /// 1 where the data do not allow it, 2 where the input or the box is unusable.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Measure(error) if error.is_data() => 1,
            Self::Answer(error) => error.exit_code(),
            Self::Survey { .. } => 1,
            _ => 2,
        }
    }
}

impl From<StreamError<RecordingError>> for ReplayError {
    fn from(error: StreamError<RecordingError>) -> Self {
        match error {
            StreamError::Client(e) => Self::Client(e),
            StreamError::Source(e) => Self::Recording(e),
        }
    }
}
