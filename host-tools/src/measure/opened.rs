//! Random runs whose recordings are read: sample rate and blocks before the first sample, and all but the averages
//! behind the last one.

use super::geometry::channel_names;
use super::rejected::Rejected;
use super::stream::{Sink, stream};
use super::{MeasureError, WINDOW};
use crate::parallel::Idle;
use crate::recording::{ChannelHealth, Health, Preamble, Recording};
use crate::setup::{Excitation, Processing, Run, Setup};
use massline_core::spectra::{BlockSettings, LineRange, SpectraError};
use std::path::{Path, PathBuf};

/// A run whose recording was opened.
pub(super) struct Opened<'a> {
    pub(super) number: usize,
    pub(super) run: &'a Run,
    pub(super) setup: &'a Setup,
    pub(super) file: PathBuf,
    recording: Recording,
    pub(super) settings: BlockSettings,
    /// Number of channels that are read, and the columns of the drives among them.
    channels: usize,
    pub(super) drives: Vec<usize>,
    /// Columns of the recording that nothing reads.
    pub(super) unused: String,
}

/// The samples of a run, seen while they were read.
pub(super) struct Read {
    pub(super) rejected: Rejected,
    health: Health,
}

/// The rest of what is known of a run once it has been read.
pub(super) struct Ended {
    pub(super) number: usize,
    pub(super) file: PathBuf,
    pub(super) settings: BlockSettings,
    pub(super) drives: usize,
    pub(super) rejected: Rejected,
    pub(super) samples: u64,
    pub(super) notes: Vec<String>,
    pub(super) preamble: Preamble,
    pub(super) health: Vec<ChannelHealth>,
    pub(super) fingerprint: u64,
}

impl<'a> Opened<'a> {
    /// Opens the recording of a random run; `notice` sees it before its sample rate is settled.
    pub(super) fn new(
        setup: &'a Setup,
        number: usize,
        limit: Option<u64>,
        settings: &mut Option<BlockSettings>,
        notice: &mut dyn FnMut(&Recording) -> Result<(), MeasureError>,
    ) -> Result<Self, MeasureError> {
        let run = &setup.runs[number];
        let file = setup.recording_path(run);
        let names = channel_names(setup, run);
        let mut recording = setup.open_recording(run, &names)?;
        recording.limit(limit);
        notice(&recording)?;
        let unused = recording.ignored().join(", ");
        let settings = settle(setup, run, &file, &mut recording, settings)?;
        let drives = drive_columns(run, &names);
        Ok(Self {
            number,
            run,
            setup,
            file,
            recording,
            settings,
            channels: names.len(),
            drives,
            unused,
        })
    }

    /// The lines of the averaging band.
    pub(super) fn band(&self) -> Result<LineRange, MeasureError> {
        let grid = self.settings.grid();
        match &self.setup.processing {
            Some(p) => grid
                .within(p.averaging_band)
                .map_err(|why| MeasureError::band(&self.file, "averaging_band", why)),
            None => Ok(LineRange::all(grid.count)),
        }
    }

    /// Reads all samples, into all of their consumers; on two threads as soon as one is `idle`.
    pub(super) fn read(
        &mut self,
        sinks: &mut [&mut dyn Sink],
        idle: &Idle,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Read, MeasureError> {
        let mut health = Health::new(self.channels);
        let rejected = stream(
            &mut self.recording,
            &self.settings,
            &self.drives,
            sinks,
            &mut |samples| health.add_all(samples),
            idle,
            progress,
        )?;
        Ok(Read { rejected, health })
    }

    /// Samples that were read.
    pub(super) fn samples(&self) -> u64 {
        self.recording.rows()
    }

    pub(super) fn spectral(&self, source: SpectraError) -> MeasureError {
        MeasureError::Spectra {
            file: self.file.clone(),
            source,
        }
    }

    /// Closes the recording.
    pub(super) fn ended(self, read: Read) -> Ended {
        let mut notes = Vec::new();
        self.recording.notice_end(&mut notes);
        Ended {
            number: self.number,
            file: self.file,
            settings: self.settings,
            drives: self.drives.len(),
            rejected: read.rejected,
            samples: self.recording.rows(),
            notes,
            preamble: self.recording.preamble().clone(),
            health: read.health.channels(),
            fingerprint: read.health.fingerprint(),
        }
    }
}

/// Columns of a run's drives among the channels that are read, where they come last.
pub(super) fn drive_columns(run: &Run, names: &[&str]) -> Vec<usize> {
    (names.len() - run.references.len()..names.len()).collect()
}

/// Blocks and kept lines of a setup's random runs, as its first one has them; `None`
/// without any.
///
/// # Errors
/// [`MeasureError`] that names the recording.
pub fn block_settings(setup: &Setup) -> Result<Option<BlockSettings>, MeasureError> {
    let random = |run: &&Run| run.excitation == Excitation::Random;
    let Some(run) = setup.runs.iter().find(random) else {
        return Ok(None);
    };
    let file = setup.recording_path(run);
    let mut recording = setup.open_recording(run, &channel_names(setup, run))?;
    settle(setup, run, &file, &mut recording, &mut None).map(Some)
}

/// Sample rate and kept lines; the first run decides, the others must agree.
pub(super) fn settle(
    setup: &Setup,
    run: &Run,
    file: &Path,
    recording: &mut Recording,
    settled: &mut Option<BlockSettings>,
) -> Result<BlockSettings, MeasureError> {
    let Some(p) = &setup.processing else {
        return Err(MeasureError::NoProcessing {
            run: run.name.clone(),
        });
    };
    let rate = recording.settle_rate(p.sample_rate)?;
    if let Some(settings) = settled {
        let expected = settings.grid().spacing * settings.block_length() as f64;
        // Rates read off time columns agree to the columns' rounding.
        if (rate / expected - 1.0).abs() > 1e-3 {
            return Err(MeasureError::OtherRate {
                file: file.to_owned(),
                found: rate,
                expected,
            });
        }
        return Ok(*settings);
    }
    p.check_bands(rate).map_err(|e| MeasureError::Band {
        file: file.to_owned(),
        reason: e.to_string(),
    })?;
    let settings = settings_at(p, rate).map_err(|source| MeasureError::Spectra {
        file: file.to_owned(),
        source,
    })?;
    *settled = Some(settings);
    Ok(settings)
}

/// Blocks and lines of a setup at a sample rate, Hz.
pub(crate) fn settings_at(p: &Processing, rate: f64) -> Result<BlockSettings, SpectraError> {
    let band = [p.averaging_band[0], p.kept_up_to(Some(rate))];
    BlockSettings::new(p.block_length, p.overlap, WINDOW, rate, band)
}
