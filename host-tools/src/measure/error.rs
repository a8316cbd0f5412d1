//! Errors on the way from recordings to spectra.

use super::Rejected;
use crate::recording::{Outlier, Place, RecordingError};
use massline_core::geometry::GeometryError;
use massline_core::spectra::{BandError, SpectraError};
use std::path::{Path, PathBuf};

/// Error on the way from recordings to spectra, with its place and what to do.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// A recording that cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Sensors that make no sense together.
    #[error("run \"{run}\": {source}")]
    Geometry {
        /// Name of the run.
        run: String,
        /// Reason.
        source: GeometryError,
    },
    /// The apparent mass needs accelerometers on the interface.
    #[error(
        "run \"{run}\": no accelerometer has `mount = \"interface\"`, but this method takes the base acceleration from those; mark the ones on the table or adapter, or use `--method b-cholesky`"
    )]
    NoInterface {
        /// Name of the run.
        run: String,
    },
    /// Spectral settings that do not fit the recording.
    #[error("{}: {source}; check `block_length`, `overlap` and the bands in [processing]", file.display())]
    Spectra {
        /// The recording.
        file: PathBuf,
        /// Reason.
        source: SpectraError,
    },
    /// A band that the spectrum does not hold.
    #[error("{}: {reason}", file.display())]
    Band {
        /// The recording.
        file: PathBuf,
        /// Reason, and the bands that would fit.
        reason: String,
    },
    /// A random run without `[processing]`.
    #[error(
        "run \"{run}\": a random recording needs the section [processing] with an `averaging_band`"
    )]
    NoProcessing {
        /// Name of the run.
        run: String,
    },
    /// Runs with different sample rates.
    #[error("{}: {found} samples per second, the runs before it have {expected}; record all runs at one rate", file.display())]
    OtherRate {
        /// The recording.
        file: PathBuf,
        /// Its rate, Hz.
        found: f64,
        /// The rate so far, Hz.
        expected: f64,
    },
    /// Not even two blocks.
    #[error("{}: {samples} samples give {blocks} block(s) of {block_length}; at least 2 are needed, and some 50 for small error bars; record longer or shorten `block_length`", file.display())]
    TooShort {
        /// The recording.
        file: PathBuf,
        /// Samples read.
        samples: u64,
        /// Blocks they gave.
        blocks: u32,
        /// Samples of a block.
        block_length: usize,
    },
    /// Not even two blocks more than drives.
    #[error("{}: {blocks} block(s) without a faulty sample for {drives} drives; at least two more than drives are needed, and some 50 for small error bars; record longer, shorten `block_length`, or shake with fewer drives at a time", file.display())]
    TooFewBlocks {
        /// The recording.
        file: PathBuf,
        /// Blocks averaged.
        blocks: u32,
        /// Drives named.
        drives: usize,
    },
    /// Hardly a block without a faulty sample.
    #[error("{}: {blocks} block(s) without a faulty sample; at least 2 are needed, and some 50 for small error bars. {} were left out: {}; mend what is at fault and record again", file.display(), rejected.blocks, rejected.reasons())]
    TooFaulty {
        /// The recording.
        file: PathBuf,
        /// Blocks without one.
        blocks: u32,
        /// Blocks with a faulty sample, by fault.
        rejected: Rejected,
    },
    /// Too few poses.
    #[error("{}: {poses} pose(s); at least 3 are needed, six that turn every axis up and down are good", file.display())]
    TooFewPoses {
        /// The recording.
        file: PathBuf,
        /// Poses read.
        poses: u64,
    },
    /// A channel that never moves.
    #[error("{}, channel `{channel}`: it reads {reading} throughout; the sensor is dead or unplugged: repair it and record again, or take it out of the setup", file.display())]
    Dead {
        /// The recording.
        file: PathBuf,
        /// The channel.
        channel: String,
        /// Its reading.
        reading: f32,
    },
    /// A drive that never moves.
    #[error("{}, channel `{channel}`: it reads {reading} throughout, so nothing can be referred to it; check the generator's cable and record again, or take `reference` out of this run", file.display())]
    SilentDrive {
        /// The recording.
        file: PathBuf,
        /// The channel.
        channel: String,
        /// Its reading.
        reading: f32,
    },
    /// A channel at its stop.
    #[error("{}, channel `{channel}`: {samples} samples sit at {limit}, the signal is clipped; lower the gain or the level and record again", file.display())]
    Clipped {
        /// The recording.
        file: PathBuf,
        /// The channel.
        channel: String,
        /// The reading at which it clips.
        limit: f32,
        /// Samples there.
        samples: u64,
    },
    /// A channel of a random run whose power is that of one reading.
    #[error(
        "{}, channel `{channel}`: sample {}, counted from one, reads {:e}, and all others together have less power; cut the recording there or record the run again",
        file.display(), outlier.sample + 1, outlier.reading
    )]
    Outlier {
        /// The recording.
        file: PathBuf,
        /// The channel.
        channel: String,
        /// The reading.
        outlier: Outlier,
    },
    /// Two runs with the same data.
    #[error(
        "runs \"{first}\" and \"{second}\" hold the very same samples; one recording was copied or named twice: give each run its own"
    )]
    Copies {
        /// A run.
        first: String,
        /// Its copy.
        second: String,
    },
    /// Frequencies that do not ascend.
    #[error("{}, {place}: {found} Hz after {before} Hz; frequencies must ascend, each once: sort the rows and take out repeated ones", file.display())]
    FrequencyOrder {
        /// The recording.
        file: PathBuf,
        /// Place of the row.
        place: Place,
        /// The frequency found, Hz.
        found: f64,
        /// The one before it, Hz.
        before: f64,
    },
    /// Sine runs at different frequencies.
    #[error("{}: its frequencies differ from those of the sine runs before it, first at {frequency} Hz; step all runs through the same frequencies", file.display())]
    OtherFrequencies {
        /// The recording.
        file: PathBuf,
        /// The first frequency that is missing or additional, Hz.
        frequency: f64,
    },
}

impl MeasureError {
    /// A band, by its key in the setup, that a recording's lines do not hold.
    pub(crate) fn band(file: &Path, key: &str, why: BandError) -> Self {
        Self::Band {
            file: file.to_owned(),
            reason: format!("`{key}`: {why}; move the band's ends to where there are lines"),
        }
    }

    /// `true` if the input could be read but does not allow an answer (exit code 1), `false` if it
    /// is unusable (exit code 2).
    #[must_use]
    pub fn is_data(&self) -> bool {
        matches!(
            self,
            Self::TooShort { .. }
                | Self::TooFewBlocks { .. }
                | Self::TooFaulty { .. }
                | Self::TooFewPoses { .. }
                | Self::Dead { .. }
                | Self::SilentDrive { .. }
                | Self::Clipped { .. }
                | Self::Outlier { .. }
                | Self::Copies { .. }
        )
    }
}
