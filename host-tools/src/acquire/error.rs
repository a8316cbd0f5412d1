//! Why samples do not come, or do not get into a file.

use crate::device::ClientError;
use crate::limits;
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
    /// More missing samples than a recording bridges.
    #[error(
        "{missing} samples are missing at once, {seconds:.3e} s of them, where a recording bridges at most {} s: the link was interrupted, or the box is faulty; start again",
        limits::LONGEST_GAP
    )]
    Gap {
        /// Number of missing samples.
        missing: u64,
        /// By the rate that the converters are set to, s.
        seconds: f64,
    },
    /// A number beyond all that can be counted.
    #[error(
        "the box numbers a sample {found}, beyond the last number there is ({}): it is faulty; start it again by `massline board restart`",
        limits::LAST_SAMPLE
    )]
    Number {
        /// The number.
        found: u64,
    },
    /// Samples that cannot have been taken yet.
    #[error(
        "the box says to have taken {samples} samples, {nominal:.3e} s at its rate of {rate} Hz, in {seconds:.1} s: its rate is another one than its settings say, or it is faulty; look at `massline board settings`, and start it again"
    )]
    Lead {
        /// Samples since the first one that came.
        samples: u64,
        /// Duration of the samples at their nominal rate, s.
        nominal: f64,
        /// Rate of the settings, Hz.
        rate: f64,
        /// Time since the first one came, s.
        seconds: f64,
    },
    /// Samples that come too slowly.
    #[error(
        "{wanted} s were asked for, and after {seconds:.0} s they have not come: the converters sample more slowly than their settings say, or the link loses most of it; look at `massline board settings` and `massline board info`"
    )]
    Overtime {
        /// Length that was asked for, s of samples.
        wanted: f64,
        /// Time since the first samples came, s.
        seconds: f64,
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
    /// No samples come.
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
    #[error("{source}; the rows that came are kept in {}: once what is wrong is mended, `massline recover {}` makes a recording of them", .part.display(), .part.display())]
    Kept {
        /// The rows.
        part: PathBuf,
        /// Why.
        source: OutputError,
    },
}
