//! The whole chain: time recordings of every channel, averaged as a measurement would be.

use super::estimate::{Answer, Selection, Task};
use super::rows::Range;
use super::{Options, StudyError, Twin};
use crate::measure::{Accelerations, BlockStorage, RunGeometry, Survey, SurveyedRun, WINDOW};
use crate::simulate::{self, Recording, Simulation, simulate};
use massline_core::geometry::{PackedNoise, RESULTANTS};
use massline_core::masslines::DriveLines;
use massline_core::spectra::{Average, BlockSettings, Complex32, DriveAverage, RunResponses, Sum};
use nalgebra::{Complex, Vector6};

/// Simulated recordings of all runs, and how they are averaged.
pub struct Recordings {
    simulation: Simulation,
    settings: BlockSettings,
}

impl Recordings {
    /// Recordings with white noise of `level` times each channel's RMS over all runs.
    ///
    /// # Errors
    /// [`StudyError`] if they would be too short or the lines do not suit them.
    pub fn simulate(
        twin: &Twin,
        options: &Options,
        level: f64,
        seed: u64,
    ) -> Result<Self, StudyError> {
        let simulated = simulate::Options {
            noise: Some(level),
            seed,
            weighed: true,
            ..simulate::Options::default()
        };
        let measurement = &twin.model.measurement;
        Ok(Self {
            settings: BlockSettings::new(
                measurement.block_length,
                measurement.overlap,
                WINDOW,
                measurement.sample_rate,
                [options.spacing, options.highest],
            )?,
            simulation: simulate(&twin.model, &simulated, &mut |_| ())?,
        })
    }

    /// All rows of the study.
    ///
    /// # Errors
    /// [`StudyError`] if the lines do not suit the recordings.
    pub fn answers(&self, twin: &Twin, options: &Options) -> Result<Vec<Answer>, StudyError> {
        let task = Task::new(twin, options, &self.survey(twin)?)?;
        let mut answers = task.none_yet();
        for selection in Selection::ALL {
            let accelerations = task.accelerations(selection);
            let mut runs = Vec::with_capacity(self.simulation.recordings.len());
            let mut geometries = Vec::with_capacity(runs.capacity());
            for (number, recording) in self.simulation.recordings.iter().enumerate() {
                let geometry = RunGeometry::new(&twin.setup, number, &accelerations)?;
                runs.push(self.averaged(recording, &geometry, &task)?);
                geometries.push(geometry);
            }
            for range in task.ranges() {
                let responses: Vec<RunResponses<'_>> =
                    runs.iter().map(|run| run.responses(self, range)).collect();
                if let (Some(lines), Some(geometry)) =
                    (DriveLines::new(&responses, WINDOW), geometries.first())
                {
                    task.answer(selection, range, &lines, geometry, &mut answers);
                }
            }
        }
        Ok(answers)
    }

    /// The twelve resultants of one run.
    fn averaged(
        &self,
        recording: &Recording,
        geometry: &RunGeometry,
        task: &Task<'_>,
    ) -> Result<Averaged, StudyError> {
        let grid = self.settings.grid();
        let hop = self.settings.hop() as f64 / self.settings.block_length() as f64;
        let resultants = |sample: &[f32], into: &mut [f32]| {
            into.copy_from_slice(&geometry.map.apply(sample));
        };
        self.average(recording, RESULTANTS, resultants, |average| {
            let mut averaged = Averaged {
                responses: vec![[Complex32::new(0.0, 0.0); RESULTANTS]; grid.count],
                drive: vec![0.0; grid.count],
                noise: Vec::new(),
                blocks: average.blocks(),
            };
            for range in task.ranges() {
                let finished = RunResponses::finish(
                    average,
                    grid,
                    grid.within(task.band(range))?,
                    WINDOW.block_correlation(hop),
                    &geometry.map,
                    &mut averaged.responses,
                    &mut averaged.drive,
                )?;
                averaged.noise.push((range, finished.noise));
            }
            Ok(averaged)
        })
    }

    /// Every accelerometer and the resultants, averaged over all blocks.
    fn survey(&self, twin: &Twin) -> Result<Survey, StudyError> {
        let grid = self.settings.grid();
        let sensors = twin.setup.accelerometers.len();
        let mut survey = Survey {
            frequencies: (0..grid.count).map(|k| grid.frequency(k)).collect(),
            runs: Vec::new(),
        };
        for (number, recording) in self.simulation.recordings.iter().enumerate() {
            let geometry = RunGeometry::new(&twin.setup, number, &Accelerations::Interface)?;
            let channels = sensors + RESULTANTS;
            let split = |sample: &[f32], into: &mut [f32]| {
                let (single, twelve) = into.split_at_mut(sensors);
                single.copy_from_slice(&sample[..sensors]);
                twelve.copy_from_slice(&geometry.map.apply(sample));
            };
            let run = self.average(recording, channels, split, |average| {
                let response = |c: usize, k: usize| {
                    let power = average.drive_power(k).max(f64::MIN_POSITIVE);
                    let (re, im) = average.cross(c, k);
                    Complex::new(re / power, im / power)
                };
                let half = |at: usize| -> Vec<Vector6<Complex<f64>>> {
                    let lines = 0..grid.count;
                    lines
                        .map(|k| Vector6::from_fn(|i, _| response(sensors + at + i, k)))
                        .collect()
                };
                let of_line = |k| (0..sensors).map(|c| response(c, k)).collect();
                Ok(SurveyedRun {
                    number,
                    sensors: (0..grid.count).map(of_line).collect(),
                    base: half(0),
                    forces: half(6),
                    power: (0..grid.count).map(|k| average.drive_power(k)).collect(),
                    equations: geometry.equations,
                })
            })?;
            survey.runs.push(run);
        }
        Ok(survey)
    }

    /// Streams a recording through blocks into an average over the drive. `transform`
    /// turns the sensors of a sample into the `channels` numbers that are averaged.
    fn average<T>(
        &self,
        recording: &Recording,
        channels: usize,
        transform: impl Fn(&[f32], &mut [f32]),
        finish: impl FnOnce(&DriveAverage<'_>) -> Result<T, StudyError>,
    ) -> Result<T, StudyError> {
        let settings = &self.settings;
        let mut sums = vec![Sum::ZERO; DriveAverage::storage_len(settings, channels)];
        let mut average = DriveAverage::new(settings, channels, &mut sums)?;
        let mut storage = BlockStorage::new(*settings, 1 + channels);
        let mut blocks = storage.blocks()?;
        let (drive, sensors) = match recording.samples.split_first() {
            Some((drive, sensors)) => (drive.as_slice(), sensors),
            None => (&[][..], &[][..]),
        };
        let mut sample = vec![0.0_f32; sensors.len()];
        let mut input = vec![0.0_f32; 1 + channels];
        for (n, drive) in drive.iter().enumerate() {
            for (slot, sensor) in sample.iter_mut().zip(sensors) {
                *slot = sensor[n];
            }
            let (head, tail) = input.split_at_mut(1);
            head[0] = *drive;
            transform(&sample, tail);
            if let Some(block) = blocks.push(&input) {
                average.add(&block);
            }
        }
        finish(&average)
    }
}

/// The averaged resultants of a run; how noisy they are depends on the range.
struct Averaged {
    responses: Vec<[Complex32; RESULTANTS]>,
    drive: Vec<f32>,
    noise: Vec<(Range, PackedNoise)>,
    blocks: u32,
}

impl Averaged {
    fn responses(&self, recordings: &Recordings, range: Range) -> RunResponses<'_> {
        let noise = self.noise.iter().find(|(r, _)| *r == range);
        RunResponses {
            grid: recordings.settings.grid(),
            responses: &self.responses,
            drive: &self.drive,
            noise: noise.map_or([0.0; 42], |(_, noise)| *noise),
            blocks: self.blocks,
        }
    }
}
