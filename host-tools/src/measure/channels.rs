//! Spectra of every single channel, and what resultants would be with other columns.
//!
//! The measuring pass keeps the twelve resultants only. What follows from a sensor that sits
//! elsewhere than the setup says needs each channel by itself, so this is one more pass over
//! the random runs, with as many transforms a block as there are channels. Stepped sines and
//! poses are kept as they were read.

use super::drives::DrivesAverage;
use super::geometry::channel_names;
use super::opened::drive_columns;
use super::samples::{Samples, feed};
use super::stream::{Seen, Signal, Sink, stream};
use super::{MeasureError, MeasuredRun, Measurement, Progress, Spectra};
use crate::parallel::Idle;
use crate::setup::{Excitation, Setup};
use massline_core::geometry::RESULTANTS;
use massline_core::masslines::StaticPoses;
use massline_core::spectra::{BlockSettings, Complex32, CrossAverage, CrossSums, SpectraError};
use nalgebra::{Complex, DMatrix, Vector6};

/// Spectra of every channel in all runs of a measurement, in recorded units.
pub(crate) struct Channels {
    /// In the order of [`Measurement::runs`].
    runs: Vec<OfRun>,
    /// Numbers in the setup of the sine runs and of the static ones.
    sines: Vec<usize>,
    poses: Vec<usize>,
}

enum OfRun {
    Drive {
        /// Responses to the drive, line by line, a column each.
        responses: DMatrix<Complex<f64>>,
        /// Power of the drive, line by line.
        power: Vec<f64>,
        /// Coherence of each channel with the drive, line by line, a column each.
        coherence: DMatrix<f64>,
    },
    /// Products of the channels summed over the blocks, a matrix a line.
    Cross(Vec<DMatrix<Complex<f64>>>),
}

/// Reads the random runs of a setup once more, channel by channel. `limit` is that of the
/// measurement.
///
/// # Errors
/// [`MeasureError`] that names file, line and channel.
pub(crate) fn channels(
    setup: &Setup,
    measurement: &Measurement,
    limit: Option<u64>,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Channels, MeasureError> {
    let of = |wanted: Excitation| {
        let runs = setup.runs.iter().enumerate();
        runs.filter(|(_, run)| run.excitation == wanted)
            .map(|(number, _)| number)
            .collect::<Vec<_>>()
    };
    let mut runs = Vec::new();
    for number in of(Excitation::Random) {
        let mut report = |share| progress(Progress::of(setup, number, share));
        let measured = measurement.runs.iter().find(|run| run.number == number);
        let Some(measured) = measured else { continue };
        runs.extend(of_run(setup, number, measured, limit, &mut report)?);
    }
    Ok(Channels {
        runs,
        sines: of(Excitation::Sine),
        poses: of(Excitation::Static),
    })
}

fn of_run(
    setup: &Setup,
    number: usize,
    measured: &MeasuredRun,
    limit: Option<u64>,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<OfRun>, MeasureError> {
    let run = &setup.runs[number];
    let names = channel_names(setup, run);
    let mut recording = setup.open_recording(run, &names)?;
    recording.limit(limit);
    recording.settle_rate(setup.processing.as_ref().and_then(|p| p.sample_rate))?;
    let settings = measured.settings();
    let count = measured.geometry.columns.len();
    let drives = drive_columns(run, &names);
    let mut average = match drives.len() {
        0 => DrivesAverage::new(settings, count, 0),
        drives => DrivesAverage::new(settings, drives, count),
    };
    let mut same = Same(&mut average, count);
    stream(
        &mut recording,
        settings,
        &drives,
        &mut [&mut same],
        &mut |_| {},
        &Idle::none(),
        progress,
    )?;
    finished(
        &average,
        settings,
        measured.band.indices(),
        (drives.len(), count),
    )
    .map_err(|source| MeasureError::Spectra {
        file: setup.recording_path(run),
        source,
    })
}

/// Sums of as many channels, as they were read.
struct Same<'a>(&'a mut DrivesAverage, usize);

impl Sink for Same<'_> {
    fn channels(&self) -> Vec<Signal<'_>> {
        let all = (0..self.1).map(|channel| Signal::Channel(channel, 1.0));
        all.collect()
    }

    fn add(&mut self, block: &Seen<'_>) {
        self.0.add_channels(&|c| block.channel(c));
    }
}

/// The spectra of a run's channels from its average: one a drive, or all of them without any.
fn finished(
    average: &DrivesAverage,
    settings: &BlockSettings,
    band: std::ops::Range<usize>,
    (drives, count): (usize, usize),
) -> Result<Vec<OfRun>, SpectraError> {
    let lines = settings.grid().count;
    if drives == 0 {
        let matrix = |line| DMatrix::from_fn(count, count, |i, j| average.between(line, i, j));
        return Ok(vec![OfRun::Cross((0..lines).map(matrix).collect())]);
    }
    let mut found = average.parts(band);
    let mut all = Vec::new();
    for mut part in std::mem::take(&mut found.parts) {
        let average = found.average(&mut part)?;
        let responses = DMatrix::from_fn(count, lines, |c, line| {
            let power = average.drive_power(line);
            let (re, im) = average.cross(c, line);
            if power > 0.0 {
                Complex::new(re / power, im / power)
            } else {
                Complex::new(0.0, 0.0)
            }
        });
        all.push(OfRun::Drive {
            responses,
            power: (0..lines).map(|line| average.drive_power(line)).collect(),
            coherence: DMatrix::from_fn(count, lines, |c, line| average.coherence(c, line)),
        });
    }
    Ok(all)
}

/// The same from samples in memory, of which `measurement` was made.
///
/// # Errors
/// [`MeasureError::Spectra`] where blocks do not suit.
pub(crate) fn channels_of_samples(
    setup: &Setup,
    measurement: &Measurement,
    samples: &[Samples<'_>],
) -> Result<Channels, MeasureError> {
    let mut runs = Vec::new();
    for (measured, samples) in measurement.runs.iter().zip(samples) {
        let run = &setup.runs[measured.number];
        let settings = measured.settings();
        let count = samples.sensors.len();
        let drives = usize::from(!run.references.is_empty());
        let mut average = match drives {
            0 => DrivesAverage::new(settings, count, 0),
            drives => DrivesAverage::new(settings, drives, count),
        };
        let same = |sample: &[f32], into: &mut [f32]| into.copy_from_slice(sample);
        let done = feed(settings, samples, (drives > 0, count), &same, &mut average);
        let done = done
            .and_then(|()| finished(&average, settings, measured.band.indices(), (drives, count)));
        runs.extend(done.map_err(|source| MeasureError::Spectra {
            file: setup.recording_path(run),
            source,
        })?);
    }
    Ok(Channels {
        runs,
        sines: Vec::new(),
        poses: Vec::new(),
    })
}

/// Columns of a run that are added to those of its geometry.
pub(crate) type Added = Vec<[f64; RESULTANTS]>;

fn add_to(resultants: &mut [Complex<f64>; RESULTANTS], x: Complex<f64>, column: &[f64; 12]) {
    for (r, gain) in resultants.iter_mut().zip(column) {
        *r += x * *gain;
    }
}

impl Channels {
    /// Products of all channels at a line of run `index` of the measurement, in recorded units: the
    /// part that is coherent with the drive, or all of them without one.
    pub(crate) fn products(&self, index: usize, line: usize) -> DMatrix<Complex<f64>> {
        match &self.runs[index] {
            OfRun::Drive {
                responses, power, ..
            } => {
                let x = responses.column(line);
                x * x.adjoint() * Complex::new(power[line], 0.0)
            }
            OfRun::Cross(products) => products[line].clone(),
        }
    }

    /// Complex equations that a line of run `index` holds, of `blocks` blocks.
    pub(crate) fn equations(&self, index: usize, blocks: u32) -> usize {
        match &self.runs[index] {
            OfRun::Drive { .. } => 1,
            OfRun::Cross(_) => blocks as usize,
        }
    }

    /// Mean coherence of each channel with the drive of run `index` over these lines; `None` without
    /// a drive.
    pub(crate) fn coherence(
        &self,
        index: usize,
        lines: std::ops::Range<usize>,
    ) -> Option<Vec<f64>> {
        match &self.runs[index] {
            OfRun::Drive { coherence, .. } => Some(
                coherence
                    .row_iter()
                    .map(|row| row.columns(lines.start, lines.len()).mean())
                    .collect(),
            ),
            OfRun::Cross(_) => None,
        }
    }

    /// The measurement as it would be with `factor` times these columns added to those of each
    /// run of the setup. The noise stays what it is: its change is of second order.
    pub(crate) fn with_columns(
        &self,
        measurement: &Measurement,
        added: &[Added],
        factor: f64,
    ) -> Measurement {
        let mut changed = measurement.clone();
        for (run, channels) in changed.runs.iter_mut().zip(&self.runs) {
            change_run(run, channels, &added[run.number], factor);
        }
        for (run, number) in changed.sines.iter_mut().zip(&self.sines) {
            for (response, readings) in run.responses.iter_mut().zip(&run.readings) {
                for (x, column) in readings.iter().zip(&added[*number]) {
                    add_to(response, x * factor, column);
                }
            }
        }
        for (run, number) in changed.poses.iter_mut().zip(&self.poses) {
            run.poses = StaticPoses::default();
            for ((a, f), readings) in run.rows.iter_mut().zip(&run.readings) {
                for (x, column) in readings.iter().zip(&added[*number]) {
                    let x = f64::from(*x) * factor;
                    *a += Vector6::from_fn(|j, _| column[j] * x);
                    *f += Vector6::from_fn(|j, _| column[6 + j] * x);
                }
                run.poses.add(a, f);
            }
        }
        changed
    }
}

fn change_run(run: &mut MeasuredRun, channels: &OfRun, added: &Added, factor: f64) {
    match (&mut run.spectra, channels) {
        (
            Spectra::Drive { responses, .. },
            OfRun::Drive {
                responses: channels,
                ..
            },
        ) => {
            for (response, readings) in responses.iter_mut().zip(channels.column_iter()) {
                let mut sum = [Complex::default(); RESULTANTS];
                for (x, column) in readings.iter().zip(added) {
                    add_to(&mut sum, x * factor, column);
                }
                for (r, sum) in response.iter_mut().zip(&sum) {
                    let (re, im) = (f64::from(r.re) + sum.re, f64::from(r.im) + sum.im);
                    *r = Complex32::new(re as f32, im as f32);
                }
            }
        }
        (Spectra::Cross { sums }, OfRun::Cross(channels)) => {
            let columns = &run.geometry.columns;
            let wide = |columns: &[[f64; RESULTANTS]], factor: f64| {
                DMatrix::from_fn(RESULTANTS, columns.len(), |j, c| {
                    Complex::new(columns[c][j] * factor, 0.0)
                })
            };
            let (before, added) = (wide(columns, 1.0), wide(added, factor));
            let settings = run.settings;
            let Ok(average) = CrossAverage::resume(&settings, sums, run.blocks) else {
                // Storage that was large enough to be averaged in is large enough.
                return;
            };
            let changed = channels.iter().enumerate().map(|(line, products)| {
                let half = &added * products;
                let mixed = &half * before.transpose();
                let both = half * added.transpose();
                CrossSums::of(|i, j| {
                    let (re, im) = average.cross(i, j, line);
                    let z = Complex::new(re, im) + mixed[(i, j)] + mixed[(j, i)].conj();
                    let z = z + both[(i, j)];
                    (z.re, z.im)
                })
            });
            *sums = changed.collect();
        }
        // Both were made from the same run.
        _ => {}
    }
}
