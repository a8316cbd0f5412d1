//! What can be wrong with a recording.

use super::Checksum;
use crate::format::plain;
use std::path::PathBuf;

/// What can be wrong with a recording: where, what, and what to do about it.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be opened or read.
    #[error("{}: cannot be read: {source}; check the `recording` of this run", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// Damaged in the middle: a broken gzip stream, or no text.
    #[error("{}, line {line}: the file breaks off or is damaged: {reason}; copy or export it again", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// The line before which reading stopped.
        line: u64,
        /// The reader's reason.
        reason: String,
    },
    /// Not a single byte.
    #[error("{}: the file is empty; expected a header with channel names and rows of numbers", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
    /// Nothing below the header.
    #[error("{}: there is a header but not one row of numbers below it; export the recording again", file.display())]
    HeaderOnly {
        /// The file.
        file: PathBuf,
    },
    /// Bytes that are no text.
    #[error("{}, line 1: this is no text; {advice}", file.display())]
    NoText {
        /// The file.
        file: PathBuf,
        /// What it may be, and what to do.
        advice: &'static str,
    },
    /// Columns between something else than commas.
    #[error("{}, line 1: the columns are separated by {found}; separate them with commas and write numbers with decimal points", file.display())]
    OtherSeparator {
        /// The file.
        file: PathBuf,
        /// What separates them.
        found: &'static str,
    },
    /// Numbers from the first line on.
    #[error("{}, line 1: it starts with the number {found}; put a line with the channel names above the numbers", file.display())]
    NoHeader {
        /// The file.
        file: PathBuf,
        /// The first number.
        found: String,
    },
    /// A channel the setup names is not there.
    #[error("{}, line 1: there is no channel `{channel}`; {hint}", file.display())]
    MissingChannel {
        /// The file.
        file: PathBuf,
        /// The channel asked for.
        channel: String,
        /// The nearest name, or all of them.
        hint: String,
    },
    /// Two columns of one name.
    #[error("{}, line 1: channel `{channel}` stands there twice, in columns {first} and {second}; rename one", file.display())]
    DuplicateChannel {
        /// The file.
        file: PathBuf,
        /// The name.
        channel: String,
        /// Columns, counted from one.
        first: usize,
        /// The second of them.
        second: usize,
    },
    /// Text where a number should be.
    #[error("{}, line {line}, channel `{channel}`: `{found}` is not a number; write it with a decimal point, or cut the recording before this line", file.display())]
    NotANumber {
        /// The file.
        file: PathBuf,
        /// Line, counted from one.
        line: u64,
        /// The channel.
        channel: String,
        /// What stands there.
        found: String,
    },
    /// NaN, infinity, or more than single precision holds.
    #[error("{}, line {line}, channel `{channel}`: {found} is not a finite reading; cut the recording before it, or record again", file.display())]
    NotFinite {
        /// The file.
        file: PathBuf,
        /// Line, counted from one.
        line: u64,
        /// The channel.
        channel: String,
        /// What stands there.
        found: String,
    },
    /// A row with too few or too many fields.
    #[error("{}, line {line}: {found} fields where the header has {expected}; the row is cut or a channel is lost: cut the recording before this line, or export it again", file.display())]
    RowLength {
        /// The file.
        file: PathBuf,
        /// Line, counted from one.
        line: u64,
        /// Fields found.
        found: usize,
        /// Fields of the header.
        expected: usize,
    },
    /// What the recording says of its sample rate contradicts the stated one.
    #[error("{}: {place} says {} samples per second, the setup says {}; correct `sample_rate` in [processing], or leave it out", file.display(), plain(*found, 6), plain(*stated, 6))]
    WrongRate {
        /// The file.
        file: PathBuf,
        /// Where the recording says it.
        place: &'static str,
        /// What it says, Hz.
        found: f64,
        /// From the setup, Hz.
        stated: f64,
    },
    /// Neither the recording nor the setup tells the sample rate.
    #[error("{}: it has no `time` column, and the setup no `sample_rate`; write `sample_rate` into [processing]", file.display())]
    NoRate {
        /// The file.
        file: PathBuf,
    },
    /// Time does not go on evenly: samples are missing or doubled.
    #[error("{}, line {line}: time is {found} s where {expected:.6} s was due; samples are missing or doubled before this line: cut the recording there, or record again", file.display())]
    TimeJump {
        /// The file.
        file: PathBuf,
        /// Line, counted from one.
        line: u64,
        /// The time found, s.
        found: f64,
        /// The time expected, s.
        expected: f64,
    },
    /// A word in the column `health` that names no fault.
    #[error("{}, line {line}, column `health`: `{found}` is no fault; it may be {}, several joined by +, or nothing for a good sample", file.display(), crate::recording::fault_words().join(", "))]
    NoFault {
        /// The file.
        file: PathBuf,
        /// Line, counted from one.
        line: u64,
        /// The word.
        found: String,
    },
    /// A preamble that is not what its first line says.
    #[error("{}: the lines that begin with # above its header cannot be read: {reason}; correct them, or delete the first one", file.display())]
    Preamble {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// Another recording than the setup was written with.
    #[error("{}: this is not the recording that the setup was written with: it has {found}, the setup says {expected}. Either `massline simulate` was ended while it replaced a test, and recordings of two tests lie here: simulate again. Or the recording was changed on purpose: then take the key `checksum` out of its [[run]]", file.display())]
    OtherRecording {
        /// The file.
        file: PathBuf,
        /// What the setup says of it.
        expected: Checksum,
        /// What it is.
        found: Checksum,
    },
}
