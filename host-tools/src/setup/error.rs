//! Errors of files, and setups that make no measurement.

use std::fmt;
use std::path::PathBuf;

/// Place in a file: `setup.toml, line 12, [[run]] 2 ("lateral Z")`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file as the user named it.
    pub file: PathBuf,
    /// Line, counted from one; `None` where the whole file is meant.
    pub line: Option<usize>,
    /// The section with its number and name; empty for the top of the file.
    pub section: String,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ", line {line}")?;
        }
        if !self.section.is_empty() {
            write!(f, ", {}", self.section)?;
        }
        Ok(())
    }
}

/// Errors of a file's form.
#[derive(Debug, thiserror::Error)]
pub enum DocumentError {
    /// The file system refused.
    #[error("{}: cannot be read: {source}; check the path", file.display())]
    Unreadable {
        /// The file asked for.
        file: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file that no test is described by.
    #[error(
        "{}: it is longer than {} MiB, so it is no file of this kind; check the path",
        file.display(), .limit >> 20
    )]
    TooLong {
        /// The file.
        file: PathBuf,
        /// Most bytes that are read.
        limit: u64,
    },
    /// A pipe that nothing comes through.
    #[error(
        "{}: it is no file but a pipe, and has not come to its end for {seconds} s; check the \
         program that writes to it, or save the text to a file", file.display()
    )]
    Late {
        /// The pipe.
        file: PathBuf,
        /// Time that was waited, s.
        seconds: f64,
    },
    /// Bytes that are no text.
    #[error("{}: byte {offset} is not UTF-8 text; save the file as UTF-8", file.display())]
    NotText {
        /// The file.
        file: PathBuf,
        /// First offending byte, counted from zero.
        offset: usize,
    },
    /// The text breaks the rules of TOML.
    #[error("{place}: this is not TOML: {message}")]
    Syntax {
        /// File and line.
        place: Box<Place>,
        /// The parser's words.
        message: String,
    },
    /// A key that nothing reads, most often a typing error.
    #[error("{place}: there is no key `{key}` here; {hint}")]
    UnknownKey {
        /// File, line and section.
        place: Box<Place>,
        /// The key as written.
        key: String,
        /// The nearest known key, or all of them.
        hint: String,
    },
    /// A key that has no default.
    #[error("{place}: `{key}` is missing; give {expected}")]
    Missing {
        /// File, line and section.
        place: Box<Place>,
        /// The missing key.
        key: String,
        /// The keys or values that would be right.
        expected: String,
    },
    /// A value of the wrong kind, or outside what can be meant.
    #[error("{place}: `{key}` is {found}; expected {expected}")]
    Unexpected {
        /// File, line and section.
        place: Box<Place>,
        /// The key.
        key: String,
        /// The value found.
        found: String,
        /// The kind of value that would be right.
        expected: String,
    },
}

/// A setup that cannot be used; every text says where, what, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The file cannot be read, is not TOML, or a key is unknown, missing or of the wrong kind.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A list that a measurement cannot do without.
    #[error("{}: there is no [[{list}]]; add at least one, without it {reason}", file.display())]
    NoEntries {
        /// The file.
        file: PathBuf,
        /// `accelerometer`, `load_cell` or `run`.
        list: &'static str,
        /// Property that is not known then.
        reason: &'static str,
    },
    /// More entries than a measurement has.
    #[error(
        "{}: {found} {what}, at most {limit} can be used; {advice}", file.display()
    )]
    TooMany {
        /// The file.
        file: PathBuf,
        /// `sensors` or `runs`.
        what: &'static str,
        /// Number that was found.
        found: usize,
        /// Highest number that is taken.
        limit: usize,
        /// Advice to the user.
        advice: &'static str,
    },
    /// Two sensors that claim the same column.
    #[error(
        "{place}: channel \"{channel}\" belongs to {first} already; every channel of the \
         recordings has one sensor, so correct the name or remove one entry"
    )]
    DuplicateChannel {
        /// The second of the two.
        place: Box<Place>,
        /// The name they share.
        channel: String,
        /// The section that had it first.
        first: String,
    },
    /// Two runs of the same name.
    #[error(
        "{place}: a run named \"{name}\" exists already as {first}; give each run its own name, \
         results refer to it"
    )]
    DuplicateRun {
        /// The second of the two.
        place: Box<Place>,
        /// The name they share.
        name: String,
        /// The section that had it first.
        first: String,
    },
    /// Time recordings without a band to average over.
    #[error(
        "{place}: a random or sine run needs to know its lines; add [processing] with \
         `averaging_band = [low, high]` in Hz, well below the first elastic natural frequency"
    )]
    NoProcessing {
        /// The run that asks for it.
        place: Box<Place>,
    },
    /// A band that the spectrum cannot serve at the stated sample rate.
    #[error("{place}: {source}")]
    BandLines {
        /// File, line and section.
        place: Box<Place>,
        /// The band and the lines that there are.
        source: BandError,
    },
    /// A weight for a column that no sensor has.
    #[error(
        "{place}: `weights` names the channel \"{channel}\", which no accelerometer has; {hint}"
    )]
    WeightUnknown {
        /// File, line and section.
        place: Box<Place>,
        /// The channel as written.
        channel: String,
        /// The nearest channel, or all.
        hint: String,
    },
    /// A weight for a load cell.
    #[error(
        "{place}: `weights` names the load cell \"{channel}\"; forces carry no weights \
         because every load path counts in full (eq 5), so remove it"
    )]
    WeightOnLoadCell {
        /// File, line and section.
        place: Box<Place>,
        /// The channel.
        channel: String,
    },
    /// A weight outside its range.
    #[error(
        "{place}: the weight of \"{channel}\" is {found}; expected more than 0 and at most 1 \
         (remove a bad channel's [[accelerometer]] instead of weighing it with 0)"
    )]
    WeightRange {
        /// File, line and section.
        place: Box<Place>,
        /// The channel.
        channel: String,
        /// As written.
        found: f64,
    },
    /// A drive signal where nothing is referred to it.
    #[error(
        "{place}: `reference` names a drive signal, but a {excitation} run is not averaged over \
         one; remove `reference` or set excitation = \"random\""
    )]
    ReferenceUnused {
        /// File, line and section.
        place: Box<Place>,
        /// The run's excitation.
        excitation: &'static str,
    },
    /// A drive that is named twice.
    #[error("{place}: `reference` names \"{channel}\" twice; name each drive once")]
    ReferenceTwice {
        /// File, line and section.
        place: Box<Place>,
        /// The channel.
        channel: String,
    },
    /// A sensor in the place of the drive.
    #[error(
        "{place}: `reference` names \"{channel}\", which is a sensor; its noise would bias the \
         result, so name the generator's signal, or leave `reference` out"
    )]
    ReferenceIsSensor {
        /// File, line and section.
        place: Box<Place>,
        /// The channel.
        channel: String,
    },
}

/// A band that does not fit the spectrum of a recording.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BandError {
    /// It ends above the last line.
    #[error(
        "`{key}` ends at {} Hz, but at {sample_rate} samples per second the spectrum ends at \
         {limit} Hz; lower the band or record faster", band[1]
    )]
    AboveSpectrum {
        /// `averaging_band` or `mode_band`.
        key: &'static str,
        /// Hz.
        band: [f64; 2],
        /// Hz.
        sample_rate: f64,
        /// Highest line that the window keeps clear of half the sample rate, Hz.
        limit: f64,
    },
    /// The averaging band begins where elastic modes are expected.
    #[error(
        "`averaging_band` from {} to {} Hz begins above the first {modes} Hz of `mode_band`: rigid-body properties come \
         from lines below the first elastic natural frequency, so lower it", band[0], band[1]
    )]
    AmongModes {
        /// Hz.
        band: [f64; 2],
        /// Beginning of the mode band, Hz.
        modes: f64,
    },
    /// It holds too few lines to average or to fit over.
    #[error(
        "`{key}` from {} to {} Hz holds {lines} line(s) at a spacing of {spacing} Hz; at least \
         three are needed, so widen the band or raise `block_length`", band[0], band[1]
    )]
    TooFewLines {
        /// `averaging_band` or `mode_band`.
        key: &'static str,
        /// Hz.
        band: [f64; 2],
        /// Lines inside.
        lines: usize,
        /// Hz.
        spacing: f64,
    },
}
