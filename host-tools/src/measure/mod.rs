//! From recordings to averaged spectra of the twelve resultants: the core's own blocks
//! and averages, fed from files.

mod blocks;
mod change;
mod channels;
mod distortion;
mod drives;
mod early_late;
mod error;
mod geometry;
mod group;
mod halves;
mod lines;
mod noise;
mod opened;
mod poses;
mod powers;
mod random;
mod redundancy;
mod rejected;
mod rows;
mod samples;
mod silent;
mod sine;
mod stream;
mod sums;
mod survey;
mod together;
mod unexplained;
mod units;
mod unlisted;

pub use crate::setup::WINDOW;
pub use blocks::BlockStorage;
pub(crate) use change::Change;
pub(crate) use channels::{Added, Channels, channels, channels_of_samples};
pub(crate) use distortion::{Distortion, SensorDistortions, sensor_distortions};
pub(crate) use early_late::{EarlyLate, ForceGain, Products};
pub use error::MeasureError;
pub(crate) use geometry::channel_names;
pub use geometry::{Accelerations, RunGeometry};
pub use group::Group;
pub(crate) use lines::sampled_records;
pub use lines::{NoRecords, Records, read_records};
pub use noise::{NoiseOrigin, RunNoise};
pub use opened::block_settings;
pub(crate) use opened::settings_at;
pub use poses::MeasuredPoses;
pub(crate) use powers::Power;
pub use random::{MeasuredRun, Spectra};
pub use rejected::{Rejected, blocks_by_word};
pub(crate) use samples::{Samples, measure_samples};
pub use sine::MeasuredSine;
pub use survey::{Survey, SurveyedRun, survey, survey_first};
pub(crate) use together::together;

use crate::recording::some_of;
use crate::setup::{Excitation, Setup};
use massline_core::spectra::{BlockSettings, LineGrid, LineRange};
use std::collections::HashMap;
use units::Noticed;

/// Kind of work that takes its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Recordings are read.
    Reading,
    /// Lines are fitted.
    Fitting,
}

/// Told now and then how far the reading of recordings is, or what follows it.
pub struct Progress<'a> {
    /// Kind of work.
    pub work: Work,
    /// Number of the run, from zero.
    pub run: usize,
    /// Number of runs.
    pub runs: usize,
    /// Name of the run, or the step of the fit.
    pub name: &'a str,
    /// Share of this run's recording that was read, or of the fit that is done, 0 to 1.
    pub share: f64,
}

impl<'a> Progress<'a> {
    fn of(setup: &'a Setup, run: usize, share: f64) -> Self {
        Self {
            work: Work::Reading,
            run,
            runs: setup.runs.len(),
            name: &setup.runs[run].name,
            share,
        }
    }
}

/// Everything the estimators need, and what was noticed on the way.
#[derive(Clone)]
pub struct Measurement {
    /// Random runs, in the order of the setup: one a drive where there are several.
    pub runs: Vec<MeasuredRun>,
    /// Stepped sine runs, in the order of the setup.
    pub sines: Vec<MeasuredSine>,
    /// Static runs, in the order of the setup.
    pub poses: Vec<MeasuredPoses>,
    /// Frequencies of the lines; `None` if all runs are static.
    pub grid: Option<LineGrid>,
    /// The averaging band, as indices into the kept lines.
    pub band: LineRange,
    /// Blocks' hop over their length.
    pub hop: f64,
    /// Source of the noise of each run: random ones, stepped sines, static ones.
    pub noise: Vec<RunNoise>,
    /// `true` if a recording states the unit of an accelerometer or load cell.
    pub units_in_recordings: bool,
    /// Channels of the recordings that look like load cells and have no entry in the setup.
    pub unlisted: Vec<String>,
    /// Warnings to the user.
    pub warnings: Vec<String>,
}

impl Measurement {
    /// Load cells that the setup may have forgotten, in words; `None` where there are none.
    #[must_use]
    pub fn unlisted_cells(&self) -> Option<String> {
        (!self.unlisted.is_empty()).then(|| {
            let names: Vec<String> = self.unlisted.iter().map(|n| format!("`{n}`")).collect();
            let (names, one) = (some_of(names.iter()), names.len() == 1);
            format!(
                "{names} {} called like the load cells and {} no [[load_cell]]: the force {} is missing, if the structure stands on {}",
                if one { "is" } else { "are" },
                if one { "has" } else { "have" },
                if one { "that it carries" } else { "that they carry" },
                if one { "it" } else { "them" },
            )
        })
    }
}

impl Default for Measurement {
    /// A measurement without any run.
    fn default() -> Self {
        Self {
            runs: Vec::new(),
            sines: Vec::new(),
            poses: Vec::new(),
            grid: None,
            band: LineRange::all(0),
            hop: 0.5,
            noise: Vec::new(),
            units_in_recordings: false,
            unlisted: Vec::new(),
            warnings: Vec::new(),
        }
    }
}

/// Reads all runs of a setup and averages them, with the base acceleration from the
/// given accelerometers.
///
/// # Errors
/// [`MeasureError`] that names file, line and channel.
pub fn measure(
    setup: &Setup,
    accelerations: &Accelerations,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Measurement, MeasureError> {
    measure_first(setup, accelerations, None, progress)
}

/// The same with at most the first `limit` samples of each random run.
///
/// # Errors
/// [`MeasureError`] that names file, line and channel.
pub fn measure_first(
    setup: &Setup,
    accelerations: &Accelerations,
    limit: Option<u64>,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Measurement, MeasureError> {
    let mut random = |run: Wanted<'_>| {
        random::read(
            setup,
            run.number,
            run.geometry,
            limit,
            run.settings,
            run.noticed,
            run.progress,
        )
    };
    assemble(setup, accelerations, &mut random, progress)
}

/// A random run that a measurement wants averaged.
struct Wanted<'a> {
    number: usize,
    geometry: RunGeometry,
    /// Blocks and lines, once the first run has settled them.
    settings: &'a mut Option<BlockSettings>,
    noticed: &'a mut Noticed,
    progress: &'a mut dyn FnMut(f64),
}

/// The averages of a random run, one a drive.
type Averages<'a> = &'a mut dyn FnMut(Wanted<'_>) -> Result<Vec<MeasuredRun>, MeasureError>;

/// The measurement of all runs, whose random ones `random` averages.
fn assemble(
    setup: &Setup,
    accelerations: &Accelerations,
    random: Averages<'_>,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Measurement, MeasureError> {
    let mut measurement = Measurement::default();
    let mut settings: Option<BlockSettings> = None;
    let mut health = Vec::new();
    let mut noticed = Noticed::default();
    let mut fingerprints: HashMap<u64, String> = HashMap::new();
    for (number, run) in setup.runs.iter().enumerate() {
        let mut report = |share| progress(Progress::of(setup, number, share));
        let geometry = RunGeometry::new(setup, number, accelerations)?;
        geometry.warn(&mut noticed.warnings);
        let fingerprint = match run.excitation {
            Excitation::Static => {
                let poses = poses::read(setup, run, geometry, &mut noticed)?;
                let fingerprint = poses.fingerprint;
                measurement.poses.push(poses);
                fingerprint
            }
            Excitation::Random => {
                let measured = random(Wanted {
                    number,
                    geometry,
                    settings: &mut settings,
                    noticed: &mut noticed,
                    progress: &mut report,
                })?;
                let mut fingerprint = 0;
                // One a drive.
                if let Some(first) = measured.first() {
                    health.push((run, first.health.clone()));
                    fingerprint = first.fingerprint;
                }
                measurement.runs.extend(measured);
                fingerprint
            }
            Excitation::Sine => {
                let before = measurement.sines.first().map(|s| s.frequencies.as_slice());
                let measured = sine::read(setup, run, geometry, before, &mut noticed)?;
                let fingerprint = measured.fingerprint;
                measurement.sines.push(measured);
                fingerprint
            }
        };
        if let Some(other) = fingerprints.insert(fingerprint, run.name.clone()) {
            return Err(MeasureError::Copies {
                first: other,
                second: run.name.clone(),
            });
        }
        report(1.0);
    }
    measurement.units_in_recordings = noticed.states_units();
    measurement.warnings = noticed.warnings;
    measurement.unlisted = noticed.unlisted;
    if let Some(fact) = measurement.unlisted_cells() {
        measurement.warnings.insert(0, fact);
    }
    if let Some(settings) = settings {
        measurement.grid = Some(settings.grid());
        measurement.hop = settings.hop() as f64 / settings.block_length() as f64;
        // All random runs have one band, which the first of them was asked for.
        measurement.band = measurement
            .runs
            .first()
            .map_or(LineRange::all(0), |r| r.band);
    }
    let random = measurement.runs.iter().map(MeasuredRun::noise_origin);
    measurement.noise = random.collect();
    let sines = noise::settle(setup, &mut measurement.sines, &mut measurement.warnings);
    measurement.noise.extend(sines);
    let poses = measurement.poses.iter().map(|poses| poses.origin.clone());
    measurement.noise.extend(poses);
    silent::check(setup, &health, &mut measurement.warnings)?;
    dedup(&mut measurement.warnings);
    Ok(measurement)
}

fn dedup(warnings: &mut Vec<String>) {
    let mut seen = std::collections::HashSet::new();
    warnings.retain(|w| seen.insert(w.clone()));
}
