//! SETUP.toml: which sensors sit where, how to average, and which runs were recorded.
//!
//! All quantities are SI, whatever units the file states: they are converted when it is read.
//! Positions and directions are in the global frame, which is the frame of the table; for a specimen that is re-mounted between runs, structure
//! accelerometers are given in the specimen's own frame, load cells and interface
//! accelerometers in the table's (see [`Run::rotation`]).
//!
//! The types are plain data without knowledge of the identification: they say what the
//! user wrote, checked for what can be checked without a recording.

mod document;
mod error;
mod file;
mod form;
mod frame;
pub(crate) mod keys;
mod parse;
mod print;
mod sensors;
#[cfg(test)]
mod tests;
mod uncertainty;
mod units;

use crate::frame::Frame;
use crate::recording::{Checksum, Corners, Form, Recording, RecordingError};
use massline_core::spectra::{LineGrid, Window};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use crate::printable::quoted;
pub(crate) use document::{Document, Keys, Section, Source, nearest};
pub use error::{BandError, DocumentError, Place, SetupError};
pub(crate) use file::{read as read_document, read_of as read_document_of};
pub(crate) use keys::along;
pub use massline_core::geometry::{Mount, Quantity};
pub(crate) use parse::{block_length, overlap};
pub(crate) use print::quoted as toml_text;
pub(crate) use sensors::quantity;
pub use uncertainty::{Defaults, Uncertainty};
pub(crate) use units::{Measured, UnitsOfTwo, is_electric, is_other, measured_in};
pub use units::{STANDARD_GRAVITY, Units};

/// The window of all random runs.
pub const WINDOW: Window = Window::Hann;

/// A measurement: sensors, processing and runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// Heading of reports.
    pub title: String,
    /// Starting point A of the identification, m, in the coordinates of the sensors.
    pub reference_point: [f64; 3],
    /// Mass found on a balance, kg; then the indicator Δ of eq (7) is estimated in its place.
    pub known_mass: Option<f64>,
    /// Standard uncertainty of that mass, kg.
    pub known_mass_uncertainty: Option<f64>,
    /// Averaging of time recordings; `None` only where every run is static.
    pub processing: Option<Processing>,
    /// Settings of the estimation, where the defaults do not fit.
    pub estimation: Estimation,
    /// Noise and uncertainty of sensors that do not state their own.
    pub defaults: Defaults,
    /// Form of the recordings, where it is stated.
    pub form: Form,
    /// Frame that results are given in, where it is not that of the sensors.
    pub frame: Option<Frame>,
    /// At least one, channels unique among all sensors.
    pub accelerometers: Vec<AccelerometerEntry>,
    /// At least one, channels unique among all sensors.
    pub load_cells: Vec<LoadCellEntry>,
    /// At least one, names unique.
    pub runs: Vec<Run>,
    /// The folder that relative recordings are looked for in: the setup file's.
    pub folder: PathBuf,
}

/// Settings of the averaging of time recordings, and the bands of lines that count.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Processing {
    /// Samples per second, Hz; `None`: the recording carries it.
    #[serde(default, deserialize_with = "parse::sample_rate")]
    pub sample_rate: Option<f64>,
    /// Samples of one transform, a power of two.
    #[serde(default = "default_block_length", deserialize_with = "block_length")]
    pub block_length: usize,
    /// Share of a block that the next one uses again, 0 to 0.95.
    #[serde(default = "default_overlap", deserialize_with = "overlap")]
    pub overlap: f64,
    /// Lower and upper frequency of the lines that the rigid body is read from, Hz.
    #[serde(deserialize_with = "keys::band")]
    pub averaging_band: [f64; 2],
    /// Band in which the weighting strategy looks for the first elastic modes, Hz (chapter 7).
    #[serde(default, deserialize_with = "keys::band")]
    pub mode_band: Option<[f64; 2]>,
}

/// Choices of the estimators, chapters 5 to 7.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
pub struct Estimation {
    /// W_min: the weight of the accelerometer that sees the first modes most.
    #[serde(deserialize_with = "parse::minimum_weight")]
    pub minimum_weight: f64,
    /// Most elastic modes that methods d and e fit.
    #[serde(deserialize_with = "parse::modes")]
    pub modes: usize,
    /// Band in which methods d and e fit, Hz; `None`: all lines that are kept.
    #[serde(deserialize_with = "keys::band")]
    pub fit_band: Option<[f64; 2]>,
    /// Highest frequency at which the interface is rigid, Hz, up to which method ml fits; `None`: as
    /// far as lines are kept.
    #[serde(deserialize_with = "parse::rigid_up_to")]
    pub rigid_up_to: Option<f64>,
    /// Distance of CG and reference point at which the iteration ends, m.
    #[serde(deserialize_with = "parse::tolerance")]
    pub tolerance: f64,
    /// Most iterations.
    #[serde(deserialize_with = "parse::iterations")]
    pub iterations: u32,
}

impl Default for Estimation {
    fn default() -> Self {
        Self {
            minimum_weight: massline_core::weighting::MINIMUM_WEIGHT,
            modes: massline_core::modes::MAX_MODES,
            fit_band: None,
            rigid_up_to: None,
            tolerance: 1e-7,
            iterations: 50,
        }
    }
}

/// One channel of an accelerometer: a point and a direction (a row of X_a, eq 4).
#[derive(Debug, Clone, PartialEq)]
pub struct AccelerometerEntry {
    /// Column of the recordings.
    pub channel: String,
    /// m.
    pub position: [f64; 3],
    /// Sensitive axis, unit length; positive acceleration along it reads positive.
    pub direction: [f64; 3],
    /// Place of the sensor: on the interface or on the structure.
    pub mount: Mount,
    /// m/s² per recorded unit: the key `scale` times the size of the stated unit; negative for a
    /// sensor that is mounted the wrong way round.
    pub scale: f64,
    /// Unit and sensitivity that the setup states.
    pub units: Units,
    /// Samples that the channel comes late.
    pub delay: f64,
    /// Corner frequency of its coupling to alternating current, Hz; zero where it is coupled to direct current.
    pub ac_corner: f64,
    /// Noise and uncertainty of this sensor, where it states them.
    pub uncertainty: Uncertainty,
}

/// One channel of a load cell (a row of X_f, eq 5).
#[derive(Debug, Clone, PartialEq)]
pub struct LoadCellEntry {
    /// Column of the recordings.
    pub channel: String,
    /// m; a pure moment does not depend on it.
    pub position: [f64; 3],
    /// Unit vector; positive: the load acts ON the structure along or about it.
    pub direction: [f64; 3],
    /// Force or moment.
    pub quantity: Quantity,
    /// N or N m per recorded unit: the key `scale` times the size of the stated unit; negative
    /// turns the sign convention.
    pub scale: f64,
    /// Unit and sensitivity that the setup states.
    pub units: Units,
    /// Samples that the channel comes late.
    pub delay: f64,
    /// Corner frequency of its coupling to alternating current, Hz; zero where it is coupled to direct current.
    pub ac_corner: f64,
    /// Noise and uncertainty of this load cell, where it states them.
    pub uncertainty: Uncertainty,
}

/// One excitation configuration.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct Run {
    /// Unique among the runs.
    #[serde(deserialize_with = "keys::text")]
    pub name: String,
    /// As written: absolute, or relative to the setup file. See [`Setup::recording_path`].
    #[serde(deserialize_with = "keys::text")]
    pub recording: PathBuf,
    /// Length and checksum of the recording, where the program that wrote the setup wrote it, too.
    #[serde(default, deserialize_with = "parse::checksum")]
    pub checksum: Option<Checksum>,
    /// Kind of the recording.
    #[serde(default, deserialize_with = "parse::excitation")]
    pub excitation: Excitation,
    /// Channels of the generator's drive signals, random runs only: one a shaker that is driven
    /// by itself. None: spectra are referred to nothing.
    #[serde(default, rename = "reference", deserialize_with = "keys::texts")]
    pub references: Vec<String>,
    /// Unit of their readings, as a recording may state it; no result depends on it.
    #[serde(default, deserialize_with = "keys::text")]
    pub reference_unit: Option<String>,
    /// The run before it that this one repeats: sine runs only.
    #[serde(default, deserialize_with = "keys::text")]
    pub repeats: Option<String>,
    /// Weights given by hand, by accelerometer channel, each in (0, 1]; this run only.
    #[serde(default, deserialize_with = "keys::numbered")]
    pub weights: BTreeMap<String, f64>,
    /// Rotation vector in degrees: x_interface = R x_specimen + translation.
    #[serde(default, deserialize_with = "keys::vector")]
    pub rotation: [f64; 3],
    /// Shift in m: where the specimen frame's origin lies in interface coordinates.
    #[serde(default, deserialize_with = "keys::vector")]
    pub translation: [f64; 3],
}

/// Kind of a recording.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Excitation {
    /// Time samples under random excitation.
    #[default]
    Random,
    /// Frequency responses of a stepped sine test.
    Sine,
    /// One pose a row, DC-coupled.
    Static,
}

/// Block length where the file names none: lines 0.5 Hz apart at 512 Hz.
pub const DEFAULT_BLOCK_LENGTH: usize = 1024;
/// Overlap where the file names none: what suits the Hann window.
pub const DEFAULT_OVERLAP: f64 = 0.5;

pub(crate) fn default_block_length() -> usize {
    DEFAULT_BLOCK_LENGTH
}

pub(crate) fn default_overlap() -> f64 {
    DEFAULT_OVERLAP
}

/// Allowed block lengths are the powers of two in this range.
pub const BLOCK_LENGTHS: RangeInclusive<usize> = 16..=32768;
/// A block that shares more than this with the next costs time and says nothing new.
pub const OVERLAPS: RangeInclusive<f64> = 0.0..=0.95;
/// Fewer lines than this in a band say nothing about a trend over frequency.
pub const FEWEST_LINES: usize = 3;

/// Delay in samples and corner of the coupling to alternating current in Hz of a channel.
struct Timing<'s> {
    channel: &'s str,
    delay: f64,
    ac_corner: f64,
}

impl AccelerometerEntry {
    /// A sensor that records m/s² and states no uncertainty.
    pub(crate) fn new(
        channel: String,
        position: impl Into<[f64; 3]>,
        direction: impl Into<[f64; 3]>,
        mount: Mount,
    ) -> Self {
        Self {
            channel,
            position: position.into(),
            direction: direction.into(),
            mount,
            scale: 1.0,
            units: Units::default(),
            delay: 0.0,
            ac_corner: 0.0,
            uncertainty: Uncertainty::default(),
        }
    }
}

impl LoadCellEntry {
    /// A load cell that records N or N m and states no uncertainty.
    pub(crate) fn new(
        channel: String,
        position: impl Into<[f64; 3]>,
        direction: impl Into<[f64; 3]>,
        quantity: Quantity,
    ) -> Self {
        Self {
            channel,
            position: position.into(),
            direction: direction.into(),
            quantity,
            scale: 1.0,
            units: Units::default(),
            delay: 0.0,
            ac_corner: 0.0,
            uncertainty: Uncertainty::default(),
        }
    }
}

impl AccelerometerEntry {
    /// The key `scale`: factor of the readings beside the unit that the setup states.
    #[must_use]
    pub fn key_scale(&self) -> f64 {
        self.units.key_scale(Measured::Acceleration, self.scale)
    }
}

impl LoadCellEntry {
    /// The key `scale`: factor of the readings beside the unit that the setup states.
    #[must_use]
    pub fn key_scale(&self) -> f64 {
        self.units.key_scale(self.quantity.into(), self.scale)
    }
}

impl Setup {
    /// Reads and checks a setup file.
    ///
    /// # Errors
    /// Whatever is wrong with the file, with line and section, and what to write instead.
    pub fn read(path: &Path) -> Result<Self, SetupError> {
        parse::setup(&Source::read(path)?)
    }

    /// The same from text; `path` names the file in messages and is not opened.
    ///
    /// # Errors
    /// As [`Setup::read`].
    pub fn from_str(text: &str, path: &Path) -> Result<Self, SetupError> {
        parse::setup(&Source::new(text, path))
    }

    /// The setup as a commented file that reads back to an equal setup.
    #[must_use]
    pub fn to_toml(&self) -> String {
        print::setup(self)
    }

    /// Opens the recording of a run and looks for `channels` in its header.
    ///
    /// # Errors
    /// As [`Recording::open_as`].
    pub fn open_recording(
        &self,
        run: &Run,
        channels: &[&str],
    ) -> Result<Recording, RecordingError> {
        let path = self.recording_path(run);
        let mut recording = Recording::open_as(&path, channels, run.checksum, &self.form)?;
        let (mut factors, mut delays) = (Vec::new(), Vec::new());
        for name in channels {
            // A complex amplitude has two columns.
            let parts = [".re", ".im"].map(|part| name.strip_suffix(part));
            let channel = match run.excitation {
                Excitation::Sine => parts.into_iter().flatten().next().unwrap_or(name),
                _ => name,
            };
            let unit = recording.unit(name);
            let factor = match self.sensor(channel) {
                Some((list, measured, _, scale))
                    if recording.is_share_of_full_scale() && scale.abs() == 1.0 =>
                {
                    Err(format!(
                        "whole numbers of a WAV file are shares of full scale, and nothing says how much that is; give `scale`, {} at full scale ([[{list}]] of the setup)",
                        measured.si()
                    ))
                }
                Some((list, measured, units, scale)) => units
                    .of_recording(measured, scale, unit)
                    .map_err(|reason| format!("{reason} ([[{list}]] of the setup)")),
                None => run.check_reference_unit(channel, unit).map(|()| 1.0),
            };
            let factor = factor.map_err(|reason| recording.unit_error(name, reason))?;
            factors.push(factor);
            delays.push(self.of_sensor(channel, |s| s.delay).unwrap_or(0.0));
        }
        let is_random = run.excitation == Excitation::Random;
        if !is_random {
            delays.fill(0.0);
        }
        let corners = self.corners(channels).filter(|_| is_random);
        recording.correct(factors, &delays, corners);
        Ok(recording)
    }

    /// Couplings to alternating current of these channels, where those of the sensors differ. Spectra are referred to
    /// drives, so that these stay as they are.
    fn corners(&self, channels: &[&str]) -> Option<Corners> {
        let highest = self.timings().map(|s| s.ac_corner).fold(0.0, f64::max);
        let taken = |channel: &&str| {
            let own = self.of_sensor(channel, |s| s.ac_corner);
            1.0 - own.unwrap_or(highest) / highest
        };
        self.are_coupled_alike().is_err().then(|| Corners {
            highest,
            taken: channels.iter().map(taken).collect(),
        })
    }

    /// Checks that all sensors are coupled alike; the error names the channels of two that are not.
    pub(crate) fn are_coupled_alike(&self) -> Result<(), [&str; 2]> {
        let mut all = self.timings();
        let Some(first) = all.next() else {
            return Ok(());
        };
        match all.find(|other| other.ac_corner != first.ac_corner) {
            None => Ok(()),
            Some(other) => Err([first.channel, other.channel]),
        }
    }

    /// Channels of all sensors: accelerometers, then load cells.
    pub(crate) fn sensor_channels(&self) -> impl Iterator<Item = &str> {
        let motion = self.accelerometers.iter().map(|a| a.channel.as_str());
        motion.chain(self.load_cells.iter().map(|c| c.channel.as_str()))
    }

    /// SI unit and positive direction of the channel of a sensor.
    pub(crate) fn described(&self, channel: &str) -> Option<(&'static str, [f64; 3])> {
        let motion = self
            .accelerometers
            .iter()
            .map(|a| (&a.channel, a.direction));
        let load = self.load_cells.iter().map(|c| (&c.channel, c.direction));
        let mut all = motion.chain(load);
        let (_, direction) = all.find(|(name, _)| *name == channel)?;
        let (_, measured, ..) = self.sensor(channel)?;
        Some((measured.si(), direction))
    }

    /// The units that the recordings of two runs state for the channel of a sensor, held against
    /// each other.
    pub(crate) fn units_of_two(&self, channel: &str, found: [Option<&str>; 2]) -> UnitsOfTwo {
        match self.sensor(channel) {
            Some((list, measured, units, scale)) => units.of_two(list, measured, scale, found),
            None => UnitsOfTwo::Alike,
        }
    }

    /// List, quantity, units and scale of the sensor that has a channel.
    fn sensor(&self, channel: &str) -> Option<(&'static str, Measured, &Units, f64)> {
        let motion = self.accelerometers.iter().find(|a| a.channel == channel);
        let force = || self.load_cells.iter().find(|c| c.channel == channel);
        motion
            .map(|a| ("accelerometer", Measured::Acceleration, &a.units, a.scale))
            .or_else(|| force().map(|c| ("load_cell", c.quantity.into(), &c.units, c.scale)))
    }

    /// Delays and couplings of all sensors: accelerometers, then load cells.
    fn timings(&self) -> impl Iterator<Item = Timing<'_>> {
        let motion = self.accelerometers.iter().map(|a| Timing {
            channel: &a.channel,
            delay: a.delay,
            ac_corner: a.ac_corner,
        });
        let force = self.load_cells.iter().map(|c| Timing {
            channel: &c.channel,
            delay: c.delay,
            ac_corner: c.ac_corner,
        });
        motion.chain(force)
    }

    /// Corner of the coupling to alternating current of a channel, Hz.
    pub(crate) fn ac_corner(&self, channel: &str) -> f64 {
        self.of_sensor(channel, |s| s.ac_corner).unwrap_or(0.0)
    }

    fn of_sensor(&self, channel: &str, of: impl Fn(Timing<'_>) -> f64) -> Option<f64> {
        self.timings().find(|s| s.channel == channel).map(of)
    }

    /// The same for readings that are in SI and in step, as the inputs of a box are: without units
    /// and delays of the recording system. The keys `scale` stay.
    #[must_use]
    pub fn with_readings_in_si(mut self) -> Self {
        for a in &mut self.accelerometers {
            a.scale = a.key_scale();
            (a.units, a.delay) = (Units::default(), 0.0);
        }
        for c in &mut self.load_cells {
            c.scale = c.key_scale();
            (c.units, c.delay) = (Units::default(), 0.0);
        }
        self
    }

    /// Path of the recording of a run.
    #[must_use]
    pub fn recording_path(&self, run: &Run) -> PathBuf {
        self.folder.join(&run.recording)
    }
}

impl Processing {
    /// The lines of the spectrum at a sample rate, Hz.
    ///
    /// Line 0 is not among them: offsets of DC-coupled and drift of AC-coupled sensors live
    /// there. Nor are those next to half the sample rate, which belong to the window's foot.
    #[must_use]
    pub fn spectrum(&self, sample_rate: f64) -> LineGrid {
        LineGrid {
            first: 1,
            count: (self.block_length / 2).saturating_sub(1 + WINDOW.reach()),
            spacing: sample_rate / self.block_length as f64,
        }
    }

    /// Highest frequency of the lines that are kept, Hz: where the mode band ends, or,
    /// without one, some way above the averaging band, for the first modes lie there. At a
    /// known sample rate (Hz) it stays clear of the anti-aliasing filter.
    #[must_use]
    pub fn kept_up_to(&self, sample_rate: Option<f64>) -> f64 {
        const REACH: f64 = 4.0;
        const CLEAR: f64 = 0.45;
        let high = self.averaging_band[1];
        match self.mode_band {
            Some([_, top]) => top.max(high),
            None => sample_rate
                .map_or(REACH * high, |rate| (REACH * high).min(CLEAR * rate))
                .max(high),
        }
    }

    /// Checks that both bands lie in the spectrum and hold enough lines at this rate (Hz).
    ///
    /// # Errors
    /// Names the band, and what would make it fit.
    pub fn check_bands(&self, sample_rate: f64) -> Result<(), BandError> {
        let bands = [
            ("averaging_band", Some(self.averaging_band)),
            ("mode_band", self.mode_band),
        ];
        let band = self.averaging_band;
        if let Some([modes, _]) = self.mode_band.filter(|modes| band[0] >= modes[0]) {
            return Err(BandError::AmongModes { band, modes });
        }
        for (key, band) in bands {
            let Some(band) = band else { continue };
            let spectrum = self.spectrum(sample_rate);
            let spacing = spectrum.spacing;
            let lines = spectrum
                .within(band)
                .map_err(|_| BandError::AboveSpectrum {
                    key,
                    band,
                    sample_rate,
                    limit: spectrum.count as f64 * spacing,
                })?
                .indices()
                .len();
            if lines < FEWEST_LINES {
                return Err(BandError::TooFewLines {
                    key,
                    band,
                    lines,
                    spacing,
                });
            }
        }
        Ok(())
    }
}

impl Run {
    fn check_reference_unit(&self, channel: &str, found: Option<&str>) -> Result<(), String> {
        match (found, &self.reference_unit) {
            (Some(found), Some(stated))
                if self.references.iter().any(|r| r == channel) && found != stated =>
            {
                Err(format!(
                    "the recording says [{}], and `reference_unit` of its [[run]] says \"{}\"; correct the one that is wrong",
                    quoted(found),
                    quoted(stated)
                ))
            }
            _ => Ok(()),
        }
    }

    /// `true` if the specimen stands otherwise in this run than its coordinates say.
    #[must_use]
    pub fn is_remounted(&self) -> bool {
        self.rotation != [0.0; 3] || self.translation != [0.0; 3]
    }
}
