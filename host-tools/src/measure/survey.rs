//! The survey pass: what every single accelerometer does over the kept lines.
//!
//! Weights (chapter 7), mode shapes and plots of single sensors need more than the twelve
//! resultants. The measuring pass does not, and runs alike on the box; so this is a pass
//! of its own over the same recordings.

use super::drives::DrivesAverage;
use super::geometry::{Accelerations, RunGeometry, channel_names};
use super::random::{drive_columns, settle};
use super::stream::stream;
use super::units::Noticed;
use super::{MeasureError, Progress, sine};
use crate::setup::{Excitation, Setup};
use massline_core::geometry::{Equations, MAX_CHANNELS};
use massline_core::spectra::{Average, BandError, BlockSettings, DriveAverage, LineRange, Sum};
use massline_core::weighting::{join_peaks, weights_from_peaks};
use nalgebra::{Complex, DMatrix, Matrix6, Vector6};

/// Responses of all accelerometers and of the resultants, run by run.
pub struct Survey {
    /// Hz, ascending.
    pub frequencies: Vec<f64>,
    /// The runs that carry a drive or are stepped sines.
    pub runs: Vec<SurveyedRun>,
}

/// One surveyed run.
pub struct SurveyedRun {
    /// Its number in the setup.
    pub number: usize,
    /// Accelerations of all accelerometers in the order of the setup, m/s² per unit of
    /// drive, line by line.
    pub sensors: Vec<Vec<Complex<f64>>>,
    /// Interface acceleration at A from the interface accelerometers, line by line, where
    /// there are any.
    pub base: Vec<Vector6<Complex<f64>>>,
    /// Resultants at A, line by line.
    pub forces: Vec<Vector6<Complex<f64>>>,
    /// Weight of each line: the drive's power, 1 for sines.
    pub power: Vec<f64>,
    /// The equations of its load cells.
    pub equations: Equations,
}

/// Surveys all runs that are referred to a drive or are stepped sines; others are left out.
///
/// # Errors
/// [`MeasureError`] that names file, line and channel.
pub fn survey(
    setup: &Setup,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Survey, MeasureError> {
    survey_first(setup, None, progress)
}

/// The same with at most the first `limit` samples of each random run.
///
/// # Errors
/// [`MeasureError`] that names file, line and channel.
pub fn survey_first(
    setup: &Setup,
    limit: Option<u64>,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Survey, MeasureError> {
    let mut survey = Survey {
        frequencies: Vec::new(),
        runs: Vec::new(),
    };
    let mut settings: Option<BlockSettings> = None;
    for (number, run) in setup.runs.iter().enumerate() {
        let mut report = |share| progress(Progress::of(setup, number, share));
        // Without interface accelerometers there is no exact base acceleration, but peaks
        // and shapes do not need it.
        let geometry = RunGeometry::new(setup, number, &Accelerations::Interface)
            .or_else(|_| RunGeometry::new(setup, number, &Accelerations::All(None)))?;
        let surveyed = match run.excitation {
            Excitation::Random if !run.references.is_empty() => {
                let (grid, surveyed) =
                    random(setup, number, &geometry, limit, &mut settings, &mut report)?;
                survey.frequencies = grid;
                survey.runs.extend(surveyed);
                report(1.0);
                continue;
            }
            Excitation::Sine => {
                let measured = sine::read(setup, run, geometry, None, &mut Noticed::default())?;
                survey.frequencies.clone_from(&measured.frequencies);
                from_sine(number, &measured)
            }
            Excitation::Random | Excitation::Static => continue,
        };
        survey.runs.push(surveyed);
        report(1.0);
    }
    let lines = survey.frequencies.len();
    survey.runs.retain(|r| r.power.len() == lines);
    Ok(survey)
}

fn from_sine(number: usize, measured: &super::MeasuredSine) -> SurveyedRun {
    let half = |at: usize| {
        let rows = measured.responses.iter();
        rows.map(move |r| Vector6::from_fn(|i, _| r[at + i]))
            .collect()
    };
    SurveyedRun {
        number,
        sensors: measured.sensors.clone(),
        base: half(0),
        forces: half(6),
        power: vec![1.0; measured.frequencies.len()],
        equations: measured.geometry.equations,
    }
}

fn random(
    setup: &Setup,
    number: usize,
    geometry: &RunGeometry,
    limit: Option<u64>,
    settings: &mut Option<BlockSettings>,
    progress: &mut dyn FnMut(f64),
) -> Result<(Vec<f64>, Vec<SurveyedRun>), MeasureError> {
    let run = &setup.runs[number];
    let file = setup.recording_path(run);
    let names = channel_names(setup, run);
    let mut recording = setup.open_recording(run, &names)?;
    recording.limit(limit);
    let settings = settle(setup, run, &file, &mut recording, settings)?;
    let sensors = setup.accelerometers.len().min(MAX_CHANNELS);
    let channels = sensors + 12;
    let spectral = |source| MeasureError::Spectra {
        file: file.clone(),
        source,
    };
    let transform = |sample: &[f32], into: &mut [f32]| {
        for ((slot, x), entry) in into.iter_mut().zip(sample).zip(&setup.accelerometers) {
            *slot = x * entry.scale as f32;
        }
        into[sensors..].copy_from_slice(&geometry.resultants(sample));
    };
    let drives = drive_columns(run, &names);
    let mut feed = |average: &mut dyn Average| {
        stream(
            &mut recording,
            &settings,
            &drives,
            channels,
            &transform,
            average,
            &mut |_| {},
            progress,
        )
    };
    let grid = settings.grid();
    let surveyed = |average: &DriveAverage<'_>| {
        let response = |c: usize, k: usize| {
            let power = average.drive_power(k);
            let (re, im) = average.cross(c, k);
            if power > 0.0 {
                Complex::new(re / power, im / power)
            } else {
                Complex::new(0.0, 0.0)
            }
        };
        let lines = 0..grid.count;
        let half = |at: usize, k: usize| Vector6::from_fn(|i, _| response(sensors + at + i, k));
        SurveyedRun {
            number,
            sensors: lines
                .clone()
                .map(|k| (0..sensors).map(|c| response(c, k)).collect())
                .collect(),
            base: lines.clone().map(|k| half(0, k)).collect(),
            forces: lines.clone().map(|k| half(6, k)).collect(),
            power: lines.map(|k| average.drive_power(k)).collect(),
            equations: geometry.equations,
        }
    };
    let mut all = Vec::new();
    let (rejected, blocks) = if let [_] = drives.as_slice() {
        let mut sums = vec![Sum::ZERO; DriveAverage::storage_len(&settings, channels)];
        let mut average = DriveAverage::new(&settings, channels, &mut sums).map_err(spectral)?;
        let rejected = feed(&mut average)?;
        all.push(surveyed(&average));
        (rejected, average.blocks())
    } else {
        let mut average = DrivesAverage::new(&settings, drives.len(), channels);
        let rejected = feed(&mut average)?;
        let mut found = average.parts(0..grid.count);
        for mut part in std::mem::take(&mut found.parts) {
            all.push(surveyed(&found.average(&mut part).map_err(spectral)?));
        }
        (rejected, average.blocks())
    };
    if blocks == 0 && rejected.blocks > 0 {
        return Err(MeasureError::TooFaulty {
            file,
            blocks: 0,
            rejected,
        });
    }
    if blocks == 0 {
        return Err(MeasureError::TooShort {
            file,
            samples: recording.rows(),
            blocks: 0,
            block_length: settings.block_length(),
        });
    }
    let frequencies = (0..grid.count).map(|k| grid.frequency(k)).collect();
    Ok((frequencies, all))
}

/// Responses of sensors to `n` independent inputs, line by line: rows are sensors.
pub type SensorResponses = Vec<DMatrix<Complex<f64>>>;

impl Survey {
    /// Responses of all accelerometers to unit interface forces: the free system's
    /// frequency responses. `None` unless every measured resultant was excited
    /// independently, by runs that share their load cells.
    #[must_use]
    pub fn free_responses(&self) -> Option<SensorResponses> {
        let equations = self.runs.first()?.equations;
        self.solve(equations.rows(), equations.count(), |run| &run.forces)
    }

    /// Responses of all accelerometers to unit accelerations of the interface, in the
    /// directions `basis` (first `count` rows).
    #[must_use]
    pub fn transmissibilities(
        &self,
        basis: &Matrix6<f64>,
        count: usize,
    ) -> Option<SensorResponses> {
        self.solve(basis, count, |run| &run.base)
    }

    /// `S X* (X X*)⁻¹` line by line, with the inputs X in the coordinates `rows`.
    fn solve(
        &self,
        rows: &Matrix6<f64>,
        count: usize,
        inputs: impl Fn(&SurveyedRun) -> &Vec<Vector6<Complex<f64>>>,
    ) -> Option<SensorResponses> {
        if self.runs.len() < count || count == 0 {
            return None;
        }
        let rows = rows.map(|x| Complex::new(x, 0.0));
        let sensors = self.runs.first()?.sensors.first()?.len();
        let mut all = Vec::with_capacity(self.frequencies.len());
        for line in 0..self.frequencies.len() {
            let mut sx = DMatrix::<Complex<f64>>::zeros(sensors, count);
            let mut xx = DMatrix::<Complex<f64>>::zeros(count, count);
            for run in &self.runs {
                let x = rows * inputs(run).get(line)?;
                let power = *run.power.get(line)?;
                for j in 0..count {
                    for i in 0..count {
                        xx[(i, j)] += x[i] * x[j].conj() * power;
                    }
                    for (s, y) in run.sensors.get(line)?.iter().enumerate() {
                        sx[(s, j)] += y * x[j].conj() * power;
                    }
                }
            }
            // Newton and metre mix: equilibrate before the inverse.
            let scale: Vec<f64> = (0..count)
                .map(|j| 1.0 / xx[(j, j)].re.max(f64::MIN_POSITIVE).sqrt())
                .collect();
            let scaled = DMatrix::from_fn(count, count, |i, j| xx[(i, j)] * scale[i] * scale[j]);
            let inverse = scaled.try_inverse()?;
            let inverse =
                DMatrix::from_fn(count, count, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
            all.push(sx * inverse);
        }
        Some(all)
    }

    /// The surveyed lines of a band, Hz.
    ///
    /// # Errors
    /// [`BandError`] if it is no band, or reaches beyond the lines.
    pub fn lines(&self, band: [f64; 2]) -> Result<LineRange, BandError> {
        LineRange::among(&self.frequencies, band)
    }

    /// Largest amplitude over the lines of the mode band of each accelerometer, in the order of
    /// the setup, m/s² per unit of drive.
    #[must_use]
    pub fn peaks(&self, run: &SurveyedRun, band: LineRange) -> Vec<f64> {
        let sensors = run.sensors.first().map_or(0, Vec::len);
        let mut peaks = vec![0.0_f64; sensors];
        for line in run.sensors.get(band.indices()).unwrap_or_default() {
            for (peak, x) in peaks.iter_mut().zip(line) {
                *peak = peak.max(x.norm_sqr());
            }
        }
        for peak in &mut peaks {
            *peak = peak.sqrt();
        }
        peaks
    }

    /// Weights of chapter 7 from each run's own responses in the mode band: for method a.
    /// One list a run of the setup; runs that were not surveyed weigh equally.
    #[must_use]
    pub fn weights_per_run(&self, setup: &Setup, band: LineRange, minimum: f64) -> Vec<Vec<f64>> {
        let count = setup.accelerometers.len();
        let mut weights = vec![vec![1.0; count]; setup.runs.len()];
        for (number, weights) in weights.iter_mut().enumerate() {
            // A recording with several drives is several runs here.
            let of_run = self.runs.iter().filter(|r| r.number == number);
            let of_run: Vec<Vec<f64>> = of_run.map(|run| self.peaks(run, band)).collect();
            let mut peaks = match of_run.as_slice() {
                [] => continue,
                [one] => one.clone(),
                several => {
                    let mut joined = vec![0.0; count];
                    several.iter().for_each(|p| join_peaks(&mut joined, p));
                    joined
                }
            };
            weights_from_peaks(&mut peaks, minimum);
            *weights = peaks;
        }
        weights
    }

    /// Weights of chapter 7 from the free system's responses, where they can be had, else
    /// from the runs' own; the same for all runs. Methods b to e combine runs line by line,
    /// and a structure filtered differently in each is not one structure any more.
    #[must_use]
    pub fn weights_joined(&self, setup: &Setup, band: LineRange, minimum: f64) -> Vec<Vec<f64>> {
        let count = setup.accelerometers.len();
        let mut joined = vec![0.0; count];
        if let Some(free) = self.free_responses() {
            let inputs = free.first().map_or(0, DMatrix::ncols);
            for j in 0..inputs {
                let peak = |s: usize| {
                    let lines = free.get(band.indices()).unwrap_or_default();
                    let at = lines.iter().map(|h| h[(s, j)].norm_sqr());
                    at.fold(0.0, f64::max).sqrt()
                };
                join_peaks(&mut joined, &(0..count).map(peak).collect::<Vec<_>>());
            }
        } else {
            for run in &self.runs {
                join_peaks(&mut joined, &self.peaks(run, band));
            }
        }
        weights_from_peaks(&mut joined, minimum);
        vec![joined; setup.runs.len()]
    }
}
