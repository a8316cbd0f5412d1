//! Why samples do not come, or do not get into a file.

use crate::device::ClientError;
use crate::output::OutputError;
use std::path::PathBuf;

/// Why samples do not come, or do not get into a file.
#[derive(Debug, thiserror::Error)]
pub enum AcquireError {
    /// The box, or the way to it.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// Numbers that go back.
    #[error(
        "sample {found} came after sample {last}: the box has started its converters anew; start again"
    )]
    Restarted {
        /// The number that came.
        found: u64,
        /// The one before it.
        last: u64,
    },
    /// More missing samples than anybody wants rows for.
    #[error(
        "{missing} samples are missing at once, a minute or more: the link was interrupted; start again"
    )]
    Gap {
        /// How many.
        missing: u64,
    },
    /// Samples without the input.
    #[error(
        "samples of {found} inputs came, input {input} is not among them; `massline board info` says how many there are"
    )]
    Inputs {
        /// Channels of a sample.
        found: usize,
        /// The input, from one.
        input: u32,
    },
    /// Nothing comes.
    #[error(
        "no samples for {seconds:.0} s: `massline board info` says whether the converters answer and frames are lost"
    )]
    Silence {
        /// For how long, s.
        seconds: f64,
    },
    /// It was stopped too early.
    #[error("it was stopped before the first sample came, so there is no recording")]
    Nothing,
    /// The box has started anew.
    #[error("the box has started anew; `massline board info` says why, then start again")]
    Reset,
    /// A file of that name.
    #[error("{} is there already; choose another name, or replace it by --force", .file.display())]
    Present {
        /// The file.
        file: PathBuf,
    },
    /// A file that is not written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// Rows that did not become a recording.
    #[error("{source}\nthe rows that came are kept in {}: once what is wrong is mended, rename it to a name that ends in .csv, and it is a recording for a setup with `sample_rate`", .part.display())]
    Kept {
        /// The rows.
        part: PathBuf,
        /// Why.
        source: OutputError,
    },
}
