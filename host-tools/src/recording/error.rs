//! Errors of recordings.

use super::{Checksum, Place};
use crate::format::plain;
use crate::limits;
use std::fmt;
use std::path::{Path, PathBuf};

/// A file with a place in it, where there is one.
fn at(file: &Path, place: Option<Place>) -> String {
    match place {
        Some(place) => format!("{}, {place}", file.display()),
        None => file.display().to_string(),
    }
}

/// The part of a file that is not as its format has it.
#[derive(Debug)]
pub struct Mismatch {
    /// The channel; empty where it is none's.
    pub channel: String,
    /// The part that was found.
    pub found: String,
    /// The part that was expected.
    pub expected: String,
    /// The remedy.
    pub advice: &'static str,
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.channel.is_empty() {
            write!(f, ", channel `{}`", self.channel)?;
        }
        let Self {
            found,
            expected,
            advice,
            ..
        } = self;
        write!(f, ": {found}, expected {expected}; {advice}")
    }
}

/// Error of a recording, with its place and what to do.
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
    /// A pipe or a device.
    #[error("{}: it is no file but a pipe or a device, and a recording is read several times; save it to a file first", file.display())]
    NoFile {
        /// As it was named.
        file: PathBuf,
    },
    /// A row that no recording has.
    #[error("{}, {place}: a row of more than {} MiB; this is no recording, or its line ends are lost: export it again", file.display(), limits::ROW >> 20)]
    RowTooLong {
        /// The file.
        file: PathBuf,
        /// The line at which it begins, or the line within it that was reached.
        place: Place,
    },
    /// A header that no recording has.
    #[error("{}, line 1: {found} columns, at most {} can be read; export fewer channels, or the file in parts", file.display(), limits::COLUMNS)]
    TooManyColumns {
        /// The file.
        file: PathBuf,
        /// Columns of the header.
        found: usize,
    },
    /// Damaged in the middle: a broken gzip stream, or no text.
    #[error("{}, {place}: the file breaks off or is damaged: {reason}; copy or export it again", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// The place before which reading stopped.
        place: Place,
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
    /// Shorter than it takes until couplings to alternating current are alike.
    #[error("{}: it has {samples} samples, and sensors whose `ac_corner` differ are brought behind the same coupling by the first {needed}; record longer, or leave `ac_corner` out where it lies below a hundredth of the averaging band's begin", file.display())]
    NotSettled {
        /// The file.
        file: PathBuf,
        /// Samples that were read.
        samples: u64,
        /// Samples that it takes.
        needed: usize,
    },
    /// Bytes that are no text.
    #[error("{}, line 1: this is no text; {advice}", file.display())]
    NoText {
        /// The file.
        file: PathBuf,
        /// Probable kind of the file, and what to do.
        advice: &'static str,
    },
    /// A file of a kind that is not read.
    #[error("{}: this is {kind}; {advice}", file.display())]
    OtherKind {
        /// The file.
        file: PathBuf,
        /// Kind of the file.
        kind: String,
        /// The remedy.
        advice: &'static str,
    },
    /// Numbers with commas that could be decimal signs or stand between thousands.
    #[error("{}, {place}: `{found}` and all numbers like it could have a decimal comma or thousands; write `decimal = \",\"` into [recording] if it is a decimal comma, else export the recording without a sign between thousands", file.display())]
    Ambiguous {
        /// The file.
        file: PathBuf,
        /// Place of the first such number.
        place: Place,
        /// That number.
        found: String,
    },
    /// A file that is not as its format has it.
    #[error("{}{mismatch}", at(file, *place))]
    Malformed {
        /// The file.
        file: PathBuf,
        /// Place at fault, where there is one.
        place: Option<Place>,
        /// The parts that do not agree.
        mismatch: Box<Mismatch>,
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
    #[error("{}: there is no channel `{channel}`; {hint}", at(file, *place))]
    MissingChannel {
        /// The file.
        file: PathBuf,
        /// Place of the names, where they have one.
        place: Option<Place>,
        /// The channel asked for.
        channel: String,
        /// The nearest name, or all of them.
        hint: String,
    },
    /// A unit that does not fit, or not the setup's.
    #[error("{}, channel `{channel}`: {reason}", at(file, *place))]
    Unit {
        /// The file.
        file: PathBuf,
        /// Place of the names, where they have one.
        place: Option<Place>,
        /// The channel.
        channel: String,
        /// Both units with their places, and what to do.
        reason: String,
    },
    /// Two columns of one name.
    #[error("{}: channel `{channel}` stands there twice, in columns {first} and {second}; rename one", at(file, *place))]
    DuplicateChannel {
        /// The file.
        file: PathBuf,
        /// Place of the names, where they have one.
        place: Option<Place>,
        /// The name.
        channel: String,
        /// Columns, counted from one.
        first: usize,
        /// The second of them.
        second: usize,
    },
    /// Text where a number should be.
    #[error("{}, {place}, channel `{channel}`: `{found}` is not a number; write it with a decimal {sign}, or cut the recording before this line", file.display())]
    NotANumber {
        /// The file.
        file: PathBuf,
        /// Place of the sample.
        place: Place,
        /// The channel.
        channel: String,
        /// The text that was found.
        found: String,
        /// Name of the file's decimal sign.
        sign: &'static str,
    },
    /// NaN, infinity, or more than single precision holds.
    #[error("{}, {place}, channel `{channel}`: {found} is not a finite reading; cut the recording before it, or record again", file.display())]
    NotFinite {
        /// The file.
        file: PathBuf,
        /// Place of the sample.
        place: Place,
        /// The channel.
        channel: String,
        /// The text that was found.
        found: String,
    },
    /// A row with too few or too many fields.
    #[error("{}, {place}: {found} fields where the header has {expected}; the row is cut or a channel is lost: cut the recording before this line, or export it again", file.display())]
    RowLength {
        /// The file.
        file: PathBuf,
        /// Place of the sample.
        place: Place,
        /// Fields found.
        found: usize,
        /// Fields of the header.
        expected: usize,
    },
    /// The recording's own sample rate contradicts the stated one.
    #[error("{}: {place} says {} samples per second, the setup says {}; correct `sample_rate` in [processing], or leave it out", file.display(), plain(*found, 6), plain(*stated, 6))]
    WrongRate {
        /// The file.
        file: PathBuf,
        /// Part of the recording that states it.
        place: &'static str,
        /// The recording's own rate, Hz.
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
    /// Time stands still or goes back in the first samples.
    #[error("{}, {place}: time is {found} s after {before} s in the sample before; export it with times that ascend, or without the column of time and with `sample_rate` in [processing]", file.display())]
    TimeDescends {
        /// The file.
        file: PathBuf,
        /// Place of the sample.
        place: Place,
        /// The time of the sample before, s.
        before: f64,
        /// The time found, s.
        found: f64,
    },
    /// Time does not go on evenly: samples are missing or doubled.
    #[error("{}, {place}: time is {found} s where {expected:.6} s was due; samples are missing or doubled before this line: cut the recording there, or record again", file.display())]
    TimeJump {
        /// The file.
        file: PathBuf,
        /// Place of the sample.
        place: Place,
        /// The time found, s.
        found: f64,
        /// The time expected, s.
        expected: f64,
    },
    /// A word in the column `health` that names no fault.
    #[error("{}, {place}, column `health`: `{found}` is no fault; it may be {}, several joined by +, or nothing for a good sample", file.display(), crate::recording::fault_words().join(", "))]
    NoFault {
        /// The file.
        file: PathBuf,
        /// Place of the sample.
        place: Place,
        /// The word.
        found: String,
    },
    /// A preamble that is not what its first line says.
    #[error("{}: the lines that begin with # above its header cannot be read: {reason}; correct them, or delete the first one", file.display())]
    Preamble {
        /// The file.
        file: PathBuf,
        /// Reason of the reader.
        reason: String,
    },
    /// Another recording than the setup was written with.
    #[error("{}: this is not the recording that the setup was written with: it has {found}, the setup says {expected}. Either `massline simulate` was ended while it replaced a test, and recordings of two tests lie here: simulate again. Or the recording was changed on purpose: then take the key `checksum` out of its [[run]]", file.display())]
    OtherRecording {
        /// The file.
        file: PathBuf,
        /// Checksum that the setup states.
        expected: Checksum,
        /// Checksum of the file.
        found: Checksum,
    },
}
