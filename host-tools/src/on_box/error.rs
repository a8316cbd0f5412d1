//! Reasons why a set-up does not fit a box.

use crate::device::ClientError;
use massline_core::masslines::Method;

/// Reason why a set-up does not fit a box.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// The box, or the way to it.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// More than the box holds.
    #[error("the box holds {limit} {what}, this setup has {found}; {advice}")]
    Capacity {
        /// Kind of the items that are too many.
        what: &'static str,
        /// Number of them.
        found: usize,
        /// Highest number that fits.
        limit: usize,
        /// Advice to the user.
        advice: String,
    },
    /// A run that the box does not measure.
    #[error("run \"{run}\" {what}; {advice}")]
    Run {
        /// Its name.
        run: String,
        /// Its kind.
        what: &'static str,
        /// Advice to the user.
        advice: &'static str,
    },
    /// A setup without time recordings.
    #[error(
        "the setup has no [processing], so there are no time recordings to replay; `massline identify` does without a box"
    )]
    NoProcessing,
    /// A method that this firmware lacks.
    #[error("this firmware lacks the method {}; it has {}", .method.name(), .has.join(", "))]
    Method {
        /// The method.
        method: Method,
        /// Names of the methods that it has.
        has: Vec<&'static str>,
    },
}
