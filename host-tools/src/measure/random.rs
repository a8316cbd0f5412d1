//! Random runs: Welch averages of the twelve resultants.

use super::drives::{DrivesAverage, Parts};
use super::geometry::{RunGeometry, channel_names};
use super::noise::{NoiseOrigin, RunNoise, Stated};
use super::stream::stream;
use super::unexplained::Unexplained;
use super::units::Noticed;
use super::{MeasureError, Rejected, WINDOW};
use crate::recording::{ChannelHealth, Health, Preamble, Recording};
use crate::setup::{Excitation, Processing, Run, Setup};
use massline_core::geometry::{PackedNoise, RESULTANTS, ResultantNoise};
use massline_core::spectra::{
    Average, BlockSettings, Complex32, CrossAverage, DriveAverage, LineGrid, LineRange,
    RunResponses, SpectraError, Sum,
};
use std::path::Path;

/// Averaged spectra of one run.
#[derive(Clone)]
#[expect(
    clippy::large_enum_variant,
    reason = "one a run, and nearly always the large one"
)]
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
#[derive(Clone)]
pub struct MeasuredRun {
    /// Name of the run, with the drive where it has several.
    pub name: String,
    /// Number of the run in the setup.
    pub number: usize,
    /// Its sensors.
    pub geometry: RunGeometry,
    /// Its spectra.
    pub spectra: Spectra,
    /// Auto spectra of the twelve resultants, units² per Hz, line by line.
    pub density: Vec<[f64; RESULTANTS]>,
    /// Blocks averaged.
    pub blocks: u32,
    /// Blocks less one for each drive beyond the first: one more than the noise has degrees of
    /// freedom.
    pub(super) freedom: u32,
    /// Samples read.
    pub samples: u64,
    /// Lines of the averaging band.
    pub band: LineRange,
    /// Blocks and samples that were left out of the average.
    pub rejected: Rejected,
    /// True sample rate and calibrations that the recording states.
    pub preamble: Preamble,
    /// State of each channel.
    pub health: Vec<ChannelHealth>,
    pub(super) fingerprint: u64,
    /// Covariance of the noise of one sample of the resultants, where the setup states it of
    /// every sensor.
    pub(super) stated: Option<ResultantNoise>,
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
                blocks: self.freedom,
            }),
            Spectra::Cross { .. } => None,
        }
    }

    /// Source of its noise.
    pub(super) fn noise_origin(&self) -> RunNoise {
        let driven = matches!(self.spectra, Spectra::Drive { .. });
        let origin = if !driven && self.stated.is_some() && self.tells_too_little() {
            NoiseOrigin::Stated
        } else {
            NoiseOrigin::Spectra
        };
        RunNoise {
            run: self.name.clone(),
            accelerations: origin,
            forces: origin,
        }
    }

    /// `true` if a run without a drive has too few blocks to tell its noise: six channels explain
    /// six others in as many independent blocks.
    pub(super) fn tells_too_little(&self) -> bool {
        let hop = self.settings.hop() as f64 / self.settings.block_length() as f64;
        let correlation = self.settings.window().block_correlation(hop);
        f64::from(self.blocks) / correlation < 7.0
    }

    /// Stated noise per line of its sums, as [`massline_core::masslines::Lines::noise`] has it:
    /// white between 0 Hz and half the sample rate.
    pub(super) fn stated_noise(&self) -> Option<ResultantNoise> {
        let grid = self.settings.grid();
        let rate = grid.spacing * self.settings.block_length() as f64;
        let of_sums = f64::from(self.blocks) / (self.settings.density() * 0.5 * rate);
        let mut noise = ResultantNoise::default();
        noise.add(self.stated.as_ref()?, of_sums);
        Some(noise)
    }

    /// The settings it was averaged with.
    #[must_use]
    pub fn settings(&self) -> &BlockSettings {
        &self.settings
    }
}

/// Reads and averages one run: one average a drive, or one by itself without any.
pub(super) fn read(
    setup: &Setup,
    number: usize,
    geometry: RunGeometry,
    limit: Option<u64>,
    settings: &mut Option<BlockSettings>,
    noticed: &mut Noticed,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<MeasuredRun>, MeasureError> {
    let run = &setup.runs[number];
    let file = setup.recording_path(run);
    let names = channel_names(setup, run);
    let mut recording = setup.open_recording(run, &names)?;
    recording.limit(limit);
    noticed.notice(setup, run, &recording)?;
    let warnings = &mut noticed.warnings;
    recording.notice_columns(warnings);
    let unused = recording.ignored().join(", ");
    let settings = settle(setup, run, &file, &mut recording, settings)?;
    let grid = settings.grid();
    let band = match &setup.processing {
        Some(p) => grid
            .within(p.averaging_band)
            .map_err(|why| MeasureError::band(&file, "averaging_band", why))?,
        None => LineRange::all(grid.count),
    };
    let spectral = |source| MeasureError::Spectra {
        file: file.clone(),
        source,
    };

    let drives = drive_columns(run, &names);
    let mut health = Health::new(names.len());
    let mut feed = |average: &mut dyn Average| {
        let resultants = |sample: &[f32], into: &mut [f32]| {
            into.copy_from_slice(&geometry.resultants(sample));
        };
        stream(
            &mut recording,
            &settings,
            &drives,
            RESULTANTS,
            &resultants,
            average,
            &mut |sample| health.add(sample),
            progress,
        )
    };

    let mut averaged: Vec<(String, Finished)> = Vec::new();
    let (rejected, count) = match drives.len() {
        0 => {
            let mut sums = vec![Sum::ZERO; CrossAverage::storage_len(&settings)];
            let mut average = CrossAverage::new(&settings, &mut sums).map_err(spectral)?;
            let rejected = feed(&mut average)?;
            let blocks = average.blocks();
            let power = |c: usize, k: usize| average.cross(c, c, k).0;
            let density = densities(&grid, settings.density(), blocks, &power);
            averaged.push((run.name.clone(), (Spectra::Cross { sums }, density, blocks)));
            (rejected, blocks)
        }
        1 => {
            let mut sums = vec![Sum::ZERO; DriveAverage::storage_len(&settings, RESULTANTS)];
            let mut average =
                DriveAverage::new(&settings, RESULTANTS, &mut sums).map_err(spectral)?;
            let rejected = feed(&mut average)?;
            let finished = finish_drive(band, &geometry, &settings, &average).map_err(spectral)?;
            averaged.push((run.name.clone(), finished));
            (rejected, average.blocks())
        }
        several => {
            let mut average = DrivesAverage::new(&settings, several, RESULTANTS);
            let rejected = feed(&mut average)?;
            let blocks = average.blocks();
            if blocks < several as u32 + 2 {
                return Err(MeasureError::TooFewBlocks {
                    file,
                    blocks,
                    drives: several,
                });
            }
            let parts = average.parts(band.indices());
            note_dependent(run, &parts, warnings);
            averaged = parts_of_drives(run, parts, band, &geometry, &settings).map_err(spectral)?;
            (rejected, blocks)
        }
    };
    recording.notice_end(warnings);
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
    let preamble = recording.preamble().clone();
    let first = averaged.first().map(|(_, (spectra, ..))| spectra);
    if let Some(Spectra::Drive { coherence, .. }) = first {
        let unexplained = Unexplained {
            setup,
            run,
            geometry: &geometry,
            settings: &settings,
            band,
            coherence,
            unused: &unused,
        };
        warnings.extend(unexplained.warning(limit)?);
    }
    let stated = Stated::of(setup, &geometry, warnings);
    let stated = stated.whole.iter().all(|w| *w).then_some(stated.noise);
    let (channels, fingerprint) = (health.channels(), health.fingerprint());
    let runs = averaged
        .into_iter()
        .map(|(name, (spectra, density, _))| MeasuredRun {
            name,
            number,
            geometry: geometry.clone(),
            spectra,
            density,
            blocks: count,
            freedom: 1 + count - drives.len().max(1) as u32,
            samples,
            band,
            rejected,
            preamble: preamble.clone(),
            health: channels.clone(),
            fingerprint,
            stated,
            settings,
        });
    Ok(runs.collect())
}

/// Columns of a run's drives among the channels that are read, where they come last.
pub(super) fn drive_columns(run: &Run, names: &[&str]) -> Vec<usize> {
    (names.len() - run.references.len()..names.len()).collect()
}

/// Says which drives of a run are left out.
fn note_dependent(run: &Run, parts: &Parts, warnings: &mut Vec<String>) {
    let names: Vec<&str> = parts
        .dependent
        .iter()
        .map(|&drive| run.references[drive].as_str())
        .collect();
    if !names.is_empty() {
        warnings.push(format!(
            "run \"{}\": the drives named before them explain {} in full, so they tell nothing new and are left out of `reference`",
            run.name,
            names.join(", ")
        ));
    }
}

/// The part of each drive, as a run by itself.
fn parts_of_drives(
    run: &Run,
    mut found: Parts,
    band: LineRange,
    geometry: &RunGeometry,
    settings: &BlockSettings,
) -> Result<Vec<(String, Finished)>, SpectraError> {
    let mut averaged = Vec::new();
    let mut parts = std::mem::take(&mut found.parts);
    for part in &mut parts {
        let name = format!("{} ({})", run.name, run.references[part.drive]);
        let average = found.average(part)?;
        let (mut spectra, mut density, blocks) = finish_drive(band, geometry, settings, &average)?;
        // What counts is what all drives explain together, and what was there in all.
        let scale = settings.density() / f64::from(found.blocks.max(1));
        if let Spectra::Drive { coherence, .. } = &mut spectra {
            for (of_line, all) in coherence.iter_mut().zip(&found.coherence) {
                *of_line = core::array::from_fn(|c| all[c] as f32);
            }
        }
        for (of_line, all) in density.iter_mut().zip(&found.power) {
            *of_line = core::array::from_fn(|c| all[c] * scale);
        }
        averaged.push((name, (spectra, density, blocks)));
    }
    Ok(averaged)
}

pub(super) type Finished = (Spectra, Vec<[f64; RESULTANTS]>, u32);

pub(super) fn finish_drive(
    band: LineRange,
    geometry: &RunGeometry,
    settings: &BlockSettings,
    average: &DriveAverage<'_>,
) -> Result<Finished, SpectraError> {
    let grid = settings.grid();
    let mut responses = vec![[Complex32::new(0.0, 0.0); RESULTANTS]; grid.count];
    let mut drive = vec![0.0; grid.count];
    let hop = settings.hop() as f64 / settings.block_length() as f64;
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
