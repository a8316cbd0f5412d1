//! The survey pass: what every single accelerometer does over the kept lines.
//!
//! Weights (chapter 7), mode shapes and plots of single sensors need more than the twelve
//! resultants. Measuring does not, and runs alike on the box; so this has blocks and sums of its
//! own, over the same recordings.

use super::geometry::{Accelerations, RunGeometry};
use super::opened::{Opened, Read};
use super::stream::{Seen, Signal, Sink};
use super::sums::{SumStorage, Sums};
use super::units::Noticed;
use super::{MeasureError, Progress, sine};
use crate::parallel::Idle;
use crate::setup::{Excitation, Run, Setup};
use massline_core::geometry::{Equations, MAX_CHANNELS, RESULTANTS};
use massline_core::spectra::{BandError, BlockSettings, DriveAverage, LineRange};
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
    let mut settings: Option<BlockSettings> = None;
    let mut random = |number: usize| {
        let mut report = |share| progress(Progress::of(setup, number, share));
        let geometry = geometry(setup, number)?;
        let mut opened = Opened::new(setup, number, limit, &mut settings, &mut |_| Ok(()))?;
        let mut storage = SumStorage::default();
        let mut sensors = Sensors::new(&opened, &geometry, &mut storage)?;
        let read = opened.read(&mut [&mut sensors], &Idle::none(), &mut report)?;
        let found = sensors.finish(&opened, &read)?;
        report(1.0);
        Ok(found)
    };
    gather(setup, &mut random)
}

/// Geometry of a run's survey. Without interface accelerometers there is no exact base acceleration, but
/// peaks and shapes do not need it.
pub(super) fn geometry(setup: &Setup, number: usize) -> Result<RunGeometry, MeasureError> {
    RunGeometry::new(setup, number, &Accelerations::Interface)
        .or_else(|_| RunGeometry::new(setup, number, &Accelerations::All(None)))
}

/// Frequencies of the lines, Hz, and the surveyed runs of one recording, one a drive.
pub(super) type Found = (Vec<f64>, Vec<SurveyedRun>);

/// `true` for a random run that is surveyed.
pub(super) fn is_driven(run: &Run) -> bool {
    run.excitation == Excitation::Random && !run.references.is_empty()
}

/// The survey of all runs, whose random ones with a drive `random` gives.
pub(super) fn gather(
    setup: &Setup,
    random: &mut dyn FnMut(usize) -> Result<Found, MeasureError>,
) -> Result<Survey, MeasureError> {
    let mut survey = Survey {
        frequencies: Vec::new(),
        runs: Vec::new(),
    };
    for (number, run) in setup.runs.iter().enumerate() {
        if is_driven(run) {
            let (grid, surveyed) = random(number)?;
            survey.frequencies = grid;
            survey.runs.extend(surveyed);
        } else if run.excitation == Excitation::Sine {
            let geometry = geometry(setup, number)?;
            let measured = sine::read(setup, run, geometry, None, &mut Noticed::default())?;
            survey.frequencies.clone_from(&measured.frequencies);
            survey.runs.push(from_sine(number, &measured));
        } else {
            geometry(setup, number)?;
        }
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

/// The consumer of a run that averages its single accelerometers, and the twelve resultants behind them.
pub(super) struct Sensors<'s> {
    number: usize,
    geometry: &'s RunGeometry,
    /// Factors of the accelerometers to m/s².
    scales: Vec<f32>,
    sums: Sums<'s>,
}

impl<'s> Sensors<'s> {
    pub(super) fn new(
        opened: &Opened<'_>,
        geometry: &'s RunGeometry,
        storage: &'s mut SumStorage,
    ) -> Result<Self, MeasureError> {
        let sensors = opened.setup.accelerometers.iter().take(MAX_CHANNELS);
        let scales: Vec<f32> = sensors.map(|entry| entry.scale as f32).collect();
        let channels = scales.len() + RESULTANTS;
        let sums = Sums::new(&opened.settings, opened.drives.len(), channels, storage);
        Ok(Self {
            number: opened.number,
            geometry,
            scales,
            sums: sums.map_err(|source| opened.spectral(source))?,
        })
    }

    /// The surveyed runs, one a drive.
    pub(super) fn finish(self, opened: &Opened<'_>, read: &Read) -> Result<Found, MeasureError> {
        let grid = opened.settings.grid();
        let blocks = self.sums.blocks();
        let mut all = Vec::new();
        match &self.sums {
            Sums::One(average) => all.push(self.surveyed(average, grid.count)),
            Sums::Several(average) => {
                let mut found = average.parts(0..grid.count);
                for mut part in std::mem::take(&mut found.parts) {
                    let average = found.average(&mut part);
                    let average = average.map_err(|source| opened.spectral(source))?;
                    all.push(self.surveyed(&average, grid.count));
                }
            }
            // Runs without a drive are not surveyed.
            Sums::Cross(_) => {}
        }
        if blocks == 0 && read.rejected.blocks > 0 {
            return Err(MeasureError::TooFaulty {
                file: opened.file.clone(),
                blocks: 0,
                rejected: read.rejected,
            });
        }
        if blocks == 0 {
            return Err(MeasureError::TooShort {
                file: opened.file.clone(),
                samples: opened.samples(),
                blocks: 0,
                block_length: opened.settings.block_length(),
            });
        }
        let frequencies = (0..grid.count).map(|k| grid.frequency(k)).collect();
        Ok((frequencies, all))
    }

    fn surveyed(&self, average: &DriveAverage<'_>, count: usize) -> SurveyedRun {
        let sensors = self.scales.len();
        let response = |c: usize, k: usize| {
            let power = average.drive_power(k);
            let (re, im) = average.cross(c, k);
            if power > 0.0 {
                Complex::new(re / power, im / power)
            } else {
                Complex::new(0.0, 0.0)
            }
        };
        let half = |at: usize, k: usize| Vector6::from_fn(|i, _| response(sensors + at + i, k));
        SurveyedRun {
            number: self.number,
            sensors: (0..count)
                .map(|k| (0..sensors).map(|c| response(c, k)).collect())
                .collect(),
            base: (0..count).map(|k| half(0, k)).collect(),
            forces: (0..count).map(|k| half(6, k)).collect(),
            power: (0..count).map(|k| average.drive_power(k)).collect(),
            equations: self.geometry.equations,
        }
    }
}

impl Sink for Sensors<'_> {
    fn channels(&self) -> Vec<Signal<'_>> {
        let sensors = self.scales.iter().enumerate();
        let sensors = sensors.map(|(channel, scale)| Signal::Channel(channel, *scale));
        let resultants = (0..RESULTANTS).map(|r| Signal::Resultant(self.geometry, r));
        sensors.chain(resultants).collect()
    }

    fn add(&mut self, block: &Seen<'_>) {
        self.sums.add(block);
    }
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
