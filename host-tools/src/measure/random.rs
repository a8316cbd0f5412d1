//! Random runs: Welch averages of the twelve resultants.

use super::distortion::{Distortion, Distortions};
use super::drives::Parts;
use super::early_late::{EarlyLate, Moments};
use super::geometry::RunGeometry;
use super::noise::{NoiseOrigin, RunNoise, Stated};
use super::opened::{Ended, Opened};
use super::stream::{Seen, Signal, Sink};
use super::sums::{SumStorage, Sums};
use super::survey;
use super::unexplained::Unexplained;
use super::units::Noticed;
use super::{MeasureError, Rejected};
use crate::parallel::Idle;
use crate::recording::{ChannelHealth, Preamble, Recording};
use crate::setup::{Run, Setup};
use massline_core::geometry::{PackedNoise, RESULTANTS, ResultantNoise};
use massline_core::spectra::{
    Average, BlockSettings, Complex32, CrossSums, DriveAverage, LineGrid, LineRange, RunResponses,
    SpectraError,
};
use std::sync::Arc;

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
        sums: Vec<CrossSums>,
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
    /// Both halves of the run, of its first drive; `None` where it is too short for them.
    pub(crate) early_late: Option<Arc<EarlyLate>>,
    /// Shares of powers of the forces in them, of its first drive.
    pub(crate) distortions: Vec<Distortion>,
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
        let of_sums = f64::from(self.blocks) / (self.settings.density() * 0.5 * self.rate());
        let mut noise = ResultantNoise::default();
        noise.add(self.stated.as_ref()?, of_sums);
        Some(noise)
    }

    /// Sample rate, Hz.
    fn rate(&self) -> f64 {
        self.settings.grid().spacing * self.settings.block_length() as f64
    }

    /// Length of the samples read, s.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.samples as f64 / self.rate()
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
    let mut notice = |recording: &Recording| {
        noticed.notice(setup, &setup.runs[number], recording)?;
        recording.notice_columns(&mut noticed.warnings);
        Ok(())
    };
    let mut opened = Opened::new(setup, number, limit, settings, &mut notice)?;
    let band = opened.band()?;
    let mut storage = SumStorage::default();
    let mut resultants = Resultants::new(&opened, band, &geometry, &mut storage)?;
    let of_interface = survey::geometry(setup, number);
    let of_interface = of_interface.unwrap_or_else(|_| geometry.clone());
    let mut distortions = Distortions::new(&of_interface, band.indices(), opened.drives.len());
    let read = opened.read(
        &mut [&mut resultants, &mut distortions],
        &Idle::none(),
        progress,
    )?;
    let averaged = resultants.finish(&opened, &distortions)?.with(storage);
    let distortions = distortions.finish(&opened.settings);
    let ended = opened.ended(read);
    let warnings = &mut noticed.warnings;
    conclude(setup, geometry, averaged, &distortions, &ended, warnings)
}

/// The consumer of a run that averages its twelve resultants.
pub(super) struct Resultants<'s> {
    geometry: &'s RunGeometry,
    band: LineRange,
    sums: Sums<'s>,
    moments: Moments,
}

/// Averages of one run.
pub(super) struct Averaged {
    spectra: Vec<(String, Finished)>,
    band: LineRange,
    blocks: u32,
    notes: Vec<String>,
    unexplained: Option<String>,
    early_late: Option<EarlyLate>,
}

impl<'s> Resultants<'s> {
    pub(super) fn new(
        opened: &Opened<'_>,
        band: LineRange,
        geometry: &'s RunGeometry,
        storage: &'s mut SumStorage,
    ) -> Result<Self, MeasureError> {
        let drives = opened.drives.len();
        let sums = Sums::new(&opened.settings, drives, RESULTANTS, storage);
        Ok(Self {
            geometry,
            band,
            sums: sums.map_err(|source| opened.spectral(source))?,
            moments: Moments::new(band.indices()),
        })
    }

    /// The averages, without the sums of a run that has no drive.
    pub(super) fn finish(
        self,
        opened: &Opened<'_>,
        distortions: &Distortions<'_>,
    ) -> Result<Averaged, MeasureError> {
        let (run, band, settings) = (opened.run, self.band, &opened.settings);
        let spectral = |source| opened.spectral(source);
        let blocks = self.sums.blocks();
        let early_late = self.moments.halves(&self.sums);
        let mut notes = Vec::new();
        let spectra = match self.sums {
            Sums::Cross(average) => {
                let power = |c: usize, k: usize| average.cross(c, c, k).0;
                let density = densities(&settings.grid(), settings.density(), blocks, &power);
                let spectra = Spectra::Cross { sums: Vec::new() };
                vec![(run.name.clone(), (spectra, density, blocks))]
            }
            Sums::One(average) => {
                let finished = finish_drive(band, self.geometry, settings, &average);
                vec![(run.name.clone(), finished.map_err(spectral)?)]
            }
            Sums::Several(average) => {
                let drives = opened.drives.len();
                if blocks < drives as u32 + 2 {
                    return Err(MeasureError::TooFewBlocks {
                        file: opened.file.clone(),
                        blocks,
                        drives,
                    });
                }
                let parts = average.parts(band.indices());
                note_dependent(run, &parts, &mut notes);
                parts_of_drives(run, parts, band, self.geometry, settings).map_err(spectral)?
            }
        };
        let first = spectra.first().map(|(_, (spectra, ..))| spectra);
        let unexplained = match first {
            Some(Spectra::Drive { coherence, .. }) => Unexplained {
                run,
                geometry: self.geometry,
                band,
                coherence,
                unused: &opened.unused,
            }
            .warning(distortions.sums()),
            _ => None,
        };
        Ok(Averaged {
            spectra,
            band,
            blocks,
            notes,
            unexplained,
            early_late,
        })
    }
}

impl Sink for Resultants<'_> {
    fn channels(&self) -> Vec<Signal<'_>> {
        let resultants = (0..RESULTANTS).map(|r| Signal::Resultant(self.geometry, r));
        resultants.collect()
    }

    fn is_alone(&self) -> bool {
        self.sums.are_of_whole_blocks()
    }

    fn add(&mut self, block: &Seen<'_>) {
        self.sums.add(block);
        self.moments.look(&self.sums);
    }
}

impl Averaged {
    /// The same with the sums of a run that has no drive.
    pub(super) fn with(mut self, storage: SumStorage) -> Self {
        if let [(_, (Spectra::Cross { sums }, ..))] = self.spectra.as_mut_slice() {
            *sums = storage.cross;
        }
        self
    }
}

/// The measured runs of averages that suffice.
pub(super) fn conclude(
    setup: &Setup,
    geometry: RunGeometry,
    averaged: Averaged,
    distortions: &[Distortion],
    ended: &Ended,
    warnings: &mut Vec<String>,
) -> Result<Vec<MeasuredRun>, MeasureError> {
    let Ended {
        number,
        file,
        settings,
        rejected,
        samples,
        ..
    } = ended;
    let run = &setup.runs[*number];
    let count = averaged.blocks;
    warnings.extend(averaged.notes);
    for note in &ended.notes {
        // One that is of all recordings is given once.
        if !warnings.contains(note) {
            warnings.push(note.clone());
        }
    }
    if count < 2 && rejected.blocks > 0 {
        return Err(MeasureError::TooFaulty {
            file: file.clone(),
            blocks: count,
            rejected: *rejected,
        });
    }
    if count < 2 {
        return Err(MeasureError::TooShort {
            file: file.clone(),
            samples: *samples,
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
    warnings.extend(averaged.unexplained);
    let stated = Stated::of(setup, &geometry, warnings);
    let stated = stated.whole.iter().all(|w| *w).then_some(stated.noise);
    let mut early_late = averaged.early_late.map(Arc::new);
    let mut distortions = distortions.to_vec();
    let runs = averaged.spectra.into_iter();
    let runs = runs.map(|(name, (spectra, density, _))| MeasuredRun {
        name,
        number: *number,
        geometry: geometry.clone(),
        spectra,
        density,
        blocks: count,
        freedom: 1 + count - ended.drives.max(1) as u32,
        samples: *samples,
        band: averaged.band,
        rejected: *rejected,
        preamble: ended.preamble.clone(),
        health: ended.health.clone(),
        early_late: early_late.take(),
        distortions: std::mem::take(&mut distortions),
        fingerprint: ended.fingerprint,
        stated,
        settings: *settings,
    });
    Ok(runs.collect())
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
