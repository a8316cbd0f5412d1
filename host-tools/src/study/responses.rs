//! Frequency responses of all channels, exact or with noise on every line.

use super::estimate::{Answer, Selection, Task};
use super::{Options, StudyError, Twin};
use crate::measure::{Accelerations, RunGeometry, Survey, SurveyedRun};
use crate::simulate::Stream;
use massline_core::geometry::{RESULTANTS, ResultantNoise};
use massline_core::masslines::{SineLines, SineRun};
use nalgebra::{Complex, Vector6};

/// Responses of all channels in all runs.
#[derive(Clone, Debug)]
pub struct Responses {
    /// Hz, ascending.
    pub frequencies: Vec<f64>,
    /// By run, line and channel; accelerometers first, then load cells.
    pub runs: Vec<Vec<Vec<Complex<f64>>>>,
    /// Variance of the noise in each channel.
    pub variance: Vec<f64>,
}

/// Uncertainty that exact responses are taken to have, relative to their size: an estimator
/// must be told some noise to tell an excited direction from rounding.
const RESOLUTION: f64 = 1e-12;

impl Responses {
    /// The exact ones at the study's lines.
    #[must_use]
    pub fn exact(twin: &Twin, options: &Options) -> Self {
        let count = (options.highest / options.spacing + 1e-9) as usize;
        let frequencies: Vec<f64> = (1..=count).map(|k| k as f64 * options.spacing).collect();
        let runs: Vec<Vec<Vec<Complex<f64>>>> = (0..twin.setup.runs.len())
            .map(|run| frequencies.iter().map(|&f| twin.channels(run, f)).collect())
            .collect();
        let variance = mean_squares(&runs)
            .into_iter()
            .map(|square| square * RESOLUTION * RESOLUTION)
            .collect();
        Self {
            frequencies,
            runs,
            variance,
        }
    }

    /// The same with complex Gaussian noise, `level` times each channel's RMS over all
    /// lines and runs. A sensor's noise is its own, so that it is the same in all runs.
    #[must_use]
    pub fn with_noise(&self, level: f64, seed: u64) -> Self {
        let mut noisy = self.clone();
        noisy.variance = mean_squares(&self.runs)
            .into_iter()
            .map(|square| square * (level * level))
            .collect();
        for (r, run) in noisy.runs.iter_mut().enumerate() {
            for (c, variance) in noisy.variance.iter().enumerate() {
                let name = [r.to_string(), c.to_string()];
                let mut stream = Stream::new(seed, &["responses", &name[0], &name[1]]);
                // `normal` has a variance of two, one in each part.
                let scale = (0.5 * variance).sqrt();
                for line in run.iter_mut() {
                    line[c] += stream.normal() * scale;
                }
            }
        }
        noisy
    }

    /// Every accelerometer and the resultants, as the weighting strategy looks at them.
    ///
    /// # Errors
    /// [`StudyError::Measure`].
    pub fn survey(&self, twin: &Twin) -> Result<Survey, StudyError> {
        let sensors = twin.setup.accelerometers.len();
        let mut survey = Survey {
            frequencies: self.frequencies.clone(),
            runs: Vec::with_capacity(self.runs.len()),
        };
        for (number, run) in self.runs.iter().enumerate() {
            let geometry = RunGeometry::new(&twin.setup, number, &Accelerations::Interface)?;
            survey.runs.push(surveyed(number, geometry, run, sensors));
        }
        Ok(survey)
    }

    /// All rows of the study.
    ///
    /// # Errors
    /// [`StudyError::Measure`].
    pub fn answers(&self, twin: &Twin, options: &Options) -> Result<Vec<Answer>, StudyError> {
        let task = Task::new(twin, options, &self.survey(twin)?)?;
        let mut answers = task.none_yet();
        for selection in Selection::ALL {
            let accelerations = task.accelerations(selection);
            let mut reduced = Vec::with_capacity(self.runs.len());
            let mut geometries = Vec::with_capacity(self.runs.len());
            for (number, run) in self.runs.iter().enumerate() {
                let geometry = RunGeometry::new(&twin.setup, number, &accelerations)?;
                let lines: Vec<[Complex<f64>; RESULTANTS]> =
                    run.iter().map(|line| resultants(&geometry, line)).collect();
                let mut noise = ResultantNoise::default();
                for (column, variance) in geometry.columns.iter().zip(&self.variance) {
                    noise.add_sensor(column, *variance);
                }
                reduced.push((lines, noise));
                geometries.push(geometry);
            }
            let runs: Vec<SineRun<'_>> = reduced
                .iter()
                .map(|(responses, noise)| SineRun {
                    responses,
                    noise: *noise,
                })
                .collect();
            if let (Some(lines), Some(geometry)) =
                (SineLines::new(&self.frequencies, &runs), geometries.first())
            {
                for range in task.ranges() {
                    task.answer(selection, range, &lines, geometry, &mut answers);
                }
            }
        }
        Ok(answers)
    }
}

/// A run as a survey sees it, from the responses of all its channels line by line,
/// accelerometers first.
pub(super) fn surveyed(
    number: usize,
    geometry: RunGeometry,
    lines: &[Vec<Complex<f64>>],
    accelerometers: usize,
) -> SurveyedRun {
    let twelve: Vec<_> = lines
        .iter()
        .map(|line| resultants(&geometry, line))
        .collect();
    let half = |at: usize| -> Vec<Vector6<Complex<f64>>> {
        let lines = twelve.iter();
        lines.map(|r| Vector6::from_fn(|i, _| r[at + i])).collect()
    };
    let sensors = lines.iter().map(|line| line[..accelerometers].to_vec());
    SurveyedRun {
        number,
        sensors: sensors.collect(),
        base: half(0),
        forces: half(6),
        power: vec![1.0; lines.len()],
        equations: geometry.equations,
    }
}

/// The twelve numbers that the channels of one line become.
fn resultants(geometry: &RunGeometry, channels: &[Complex<f64>]) -> [Complex<f64>; RESULTANTS] {
    let mut sum = [Complex::new(0.0, 0.0); RESULTANTS];
    for (x, column) in channels.iter().zip(&geometry.columns) {
        for (slot, gain) in sum.iter_mut().zip(column) {
            *slot += x * *gain;
        }
    }
    sum
}

/// Mean square of each channel over lines and runs.
fn mean_squares(runs: &[Vec<Vec<Complex<f64>>>]) -> Vec<f64> {
    let channels = runs
        .first()
        .and_then(|r| r.first())
        .map_or(0, |line| line.len());
    let mut sums = vec![0.0; channels];
    let mut lines = 0_usize;
    for line in runs.iter().flatten() {
        lines += 1;
        for (sum, x) in sums.iter_mut().zip(line) {
            *sum += x.norm_sqr();
        }
    }
    sums.iter().map(|s| s / lines.max(1) as f64).collect()
}
