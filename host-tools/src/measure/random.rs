//! Random runs: Welch averages of the twelve resultants.

use super::geometry::{RunGeometry, channel_names};
use super::rejected::{Gate, Rejected};
use super::{MeasureError, WINDOW};
use crate::recording::{ChannelHealth, Health, Preamble, Recording};
use crate::setup::{Excitation, Processing, Run, Setup};
use massline_core::geometry::{PackedNoise, RESULTANTS};
use massline_core::spectra::{
    Average, BlockSettings, Blocks, Complex32, CrossAverage, DriveAverage, LineGrid, RunResponses,
    SpectraError, Sum,
};
use std::path::Path;

/// Rows between two reports of progress.
const REPORT_ROWS: u64 = 4096;

/// Averaged spectra of one run.
pub enum Spectra {
    /// Referred to the drive.
    Drive {
        /// Responses of the twelve resultants, line by line.
        responses: Vec<[Complex32; RESULTANTS]>,
        /// G_rr of each line, summed over the blocks.
        drive: Vec<f32>,
        /// Covariance of the noise per line, mean over the averaging band.
        noise: PackedNoise,
        /// Coherence of each resultant with the drive, line by line.
        coherence: Vec<[f32; RESULTANTS]>,
    },
    /// Cross-spectral matrix.
    Cross {
        /// The running sums.
        sums: Vec<Sum>,
    },
}

/// One random run, averaged.
pub struct MeasuredRun {
    /// Name of the run.
    pub name: String,
    /// Its sensors.
    pub geometry: RunGeometry,
    /// Its spectra.
    pub spectra: Spectra,
    /// Auto spectra of the twelve resultants, units² per Hz, line by line.
    pub density: Vec<[f64; RESULTANTS]>,
    /// Blocks averaged.
    pub blocks: u32,
    /// Samples read.
    pub samples: u64,
    /// What was left out of the average.
    pub rejected: Rejected,
    /// What the recording says of itself.
    pub preamble: Preamble,
    /// State of each channel.
    pub health: Vec<ChannelHealth>,
    pub(super) fingerprint: u64,
    pub(super) settings: BlockSettings,
}

impl MeasuredRun {
    /// The responses as the core's estimators read them, if referred to a drive.
    #[must_use]
    pub fn responses(&self) -> Option<RunResponses<'_>> {
        match &self.spectra {
            Spectra::Drive {
                responses,
                drive,
                noise,
                ..
            } => Some(RunResponses {
                grid: self.settings.grid(),
                responses,
                drive,
                noise: *noise,
                blocks: self.blocks,
            }),
            Spectra::Cross { .. } => None,
        }
    }

    /// The settings it was averaged with.
    #[must_use]
    pub fn settings(&self) -> &BlockSettings {
        &self.settings
    }
}

/// Reads and averages one run.
pub(super) fn read(
    setup: &Setup,
    run: &Run,
    geometry: RunGeometry,
    limit: Option<u64>,
    settings: &mut Option<BlockSettings>,
    warnings: &mut Vec<String>,
    progress: &mut dyn FnMut(f64),
) -> Result<MeasuredRun, MeasureError> {
    let file = setup.recording_path(run);
    let names = channel_names(setup, run);
    let mut recording = Recording::open(&file, &names)?;
    recording.limit(limit);
    if !recording.ignored().is_empty() {
        warnings.push(format!(
            "{}: columns not used: {}",
            file.display(),
            recording.ignored().join(", ")
        ));
    }
    let settings = settle(setup, run, &file, &mut recording, settings)?;
    let grid = settings.grid();
    let spectral = |source| MeasureError::Spectra {
        file: file.clone(),
        source,
    };

    let drive_at = run.reference.is_some().then_some(names.len() - 1);
    let mut sums = vec![
        Sum::ZERO;
        match drive_at {
            Some(_) => DriveAverage::storage_len(&settings, RESULTANTS),
            None => CrossAverage::storage_len(&settings),
        }
    ];
    let mut health = Health::new(names.len());
    let mut feed = |average: &mut dyn Average| {
        let resultants = |sample: &[f32], into: &mut [f32]| {
            into.copy_from_slice(&geometry.resultants(sample));
        };
        stream(
            &mut recording,
            &settings,
            drive_at,
            RESULTANTS,
            &resultants,
            average,
            &mut |sample| health.add(sample),
            progress,
        )
    };

    let (averaged, rejected) = if drive_at.is_some() {
        let mut average = DriveAverage::new(&settings, RESULTANTS, &mut sums).map_err(spectral)?;
        let rejected = feed(&mut average)?;
        let averaged = finish_drive(setup, &geometry, &settings, &average).map_err(spectral)?;
        (averaged, rejected)
    } else {
        let mut average = CrossAverage::new(&settings, &mut sums).map_err(spectral)?;
        let rejected = feed(&mut average)?;
        let blocks = average.blocks();
        let power = |c: usize, k: usize| average.cross(c, c, k).0;
        let density = densities(&grid, settings.density(), blocks, &power);
        let averaged = (Spectra::Cross { sums: Vec::new() }, density, blocks);
        (averaged, rejected)
    };
    let (mut spectra, density, count) = averaged;
    if let Spectra::Cross { sums: kept } = &mut spectra {
        *kept = sums;
    }
    let samples = recording.rows();
    if count < 2 && rejected.blocks > 0 {
        return Err(MeasureError::TooFaulty {
            file,
            blocks: count,
            rejected,
        });
    }
    if count < 2 {
        return Err(MeasureError::TooShort {
            file,
            samples,
            blocks: count,
            block_length: settings.block_length(),
        });
    }
    if rejected.blocks > 0 {
        warnings.push(format!(
            "run \"{}\": {} of {} blocks were left out for faulty samples: {}",
            run.name,
            rejected.blocks,
            rejected.blocks + count,
            rejected.reasons()
        ));
    }
    if count < 10 {
        warnings.push(format!(
            "run \"{}\": only {count} blocks were averaged; error bars are rough below ten",
            run.name
        ));
    }
    Ok(MeasuredRun {
        name: run.name.clone(),
        geometry,
        spectra,
        density,
        blocks: count,
        samples,
        rejected,
        preamble: recording.preamble().clone(),
        health: health.channels(),
        fingerprint: health.fingerprint(),
        settings,
    })
}

/// Streams a recording through blocks into an average. `transform` turns a sample of all
/// channels into the `channels` numbers that are averaged; the drive, where there is one,
/// comes before them as channel 0. A block with a faulty sample goes nowhere, and `watch` sees
/// good samples only.
#[allow(clippy::too_many_arguments)]
pub(super) fn stream(
    recording: &mut Recording,
    settings: &BlockSettings,
    drive_at: Option<usize>,
    channels: usize,
    transform: &dyn Fn(&[f32], &mut [f32]),
    average: &mut dyn Average,
    watch: &mut dyn FnMut(&[f32]),
    progress: &mut dyn FnMut(f64),
) -> Result<Rejected, MeasureError> {
    let lead = usize::from(drive_at.is_some());
    let zero = Complex32::new(0.0, 0.0);
    let mut history = vec![0.0; settings.history_len(lead + channels)];
    let mut work = vec![zero; settings.block_length()];
    let mut lines = vec![zero; settings.lines_len(lead + channels)];
    let blocks = Blocks::new(
        *settings,
        lead + channels,
        &mut history,
        &mut work,
        &mut lines,
    );
    let mut blocks = blocks.map_err(|source| MeasureError::Spectra {
        file: recording.file().to_owned(),
        source,
    })?;
    let mut sample = vec![0.0_f32; recording.channels()];
    let mut input = vec![0.0_f32; lead + channels];
    let mut gate = Gate::new(settings);
    while recording.next_row(&mut sample)? {
        gate.sample(recording.health());
        if recording.health().is_good() {
            watch(&sample);
        }
        let (head, tail) = input.split_at_mut(lead);
        if let (Some(slot), Some(at)) = (head.first_mut(), drive_at) {
            *slot = sample.get(at).copied().unwrap_or(0.0);
        }
        transform(&sample, tail);
        if let Some(block) = blocks.push(&input)
            && gate.admits()
        {
            average.add(&block);
        }
        if recording.rows().is_multiple_of(REPORT_ROWS) {
            progress(recording.progress());
        }
    }
    Ok(gate.rejected)
}

pub(super) type Finished = (Spectra, Vec<[f64; RESULTANTS]>, u32);

pub(super) fn finish_drive(
    setup: &Setup,
    geometry: &RunGeometry,
    settings: &BlockSettings,
    average: &DriveAverage<'_>,
) -> Result<Finished, SpectraError> {
    let grid = settings.grid();
    let mut responses = vec![[Complex32::new(0.0, 0.0); RESULTANTS]; grid.count];
    let mut drive = vec![0.0; grid.count];
    let hop = settings.hop() as f64 / settings.block_length() as f64;
    let band = setup.processing.as_ref().map_or(0..0, |p| {
        grid.within(p.averaging_band[0], p.averaging_band[1])
    });
    let noise = RunResponses::finish(
        average,
        grid,
        band,
        settings.window().block_correlation(hop),
        &geometry.map,
        &mut responses,
        &mut drive,
    )?
    .noise;
    let coherence = (0..grid.count)
        .map(|k| core::array::from_fn(|c| average.coherence(c, k) as f32))
        .collect();
    let power = |c: usize, k: usize| average.power(c, k);
    let density = densities(&grid, settings.density(), average.blocks(), &power);
    let spectra = Spectra::Drive {
        responses,
        drive,
        noise,
        coherence,
    };
    Ok((spectra, density, average.blocks()))
}

pub(super) fn densities(
    grid: &LineGrid,
    density: f64,
    blocks: u32,
    power: &dyn Fn(usize, usize) -> f64,
) -> Vec<[f64; RESULTANTS]> {
    let scale = density / f64::from(blocks.max(1));
    (0..grid.count)
        .map(|k| core::array::from_fn(|c| power(c, k) * scale))
        .collect()
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
    let mut recording = Recording::open(&file, &channel_names(setup, run))?;
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
