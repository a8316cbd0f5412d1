//! Records for the maximum likelihood fit: unwindowed transforms of whole runs and their noise.
//!
//! A run is kept in memory as its twelve resultants and drives in single precision: 52 bytes a
//! sample with one drive. It is cut where samples are faulty, and into blocks of 2²⁰ samples where
//! it is longer.

use super::geometry::{RunGeometry, channel_names, middle_of_interface};
use super::noise::Stated;
use super::opened::drive_columns;
use super::redundancy::Redundancy;
use super::samples::Samples;
use super::{Accelerations, MeasureError, NoiseOrigin, Progress, Work};
use crate::likelihood::noise::{self, Found};
use crate::likelihood::{Complex6, Noise, Record, transform};
use crate::setup::{Excitation, Setup};
use massline_core::geometry::{RESULTANTS, ResultantNoise};
use nalgebra::{Complex, Vector3};

/// Most samples of one transform.
const MOST: usize = 1 << 20;
/// Least lines of a stretch between faulty samples.
const LEAST_LINES: f64 = 200.0;
/// Share of a component that counts as none of it.
const UNSEEN: f64 = 1e-9;
/// Rows between two reports of progress.
const REPORT_ROWS: u64 = 4096;

/// Records of all random runs.
pub struct Records {
    /// One or more a run, about the reference point A.
    pub records: Vec<Record>,
    /// Middle of the accelerometers on the interface seen from A, m, about which their noise was estimated; `None` where
    /// not all resultants are measured, and it was about A.
    pub middle: Option<Vector3<f64>>,
    /// Source of their noise.
    pub origin: NoiseOrigin,
    /// Samples that lie in stretches too short to use, and faulty ones.
    pub left_out: u64,
}

/// Reason why there are no records.
#[derive(Debug, thiserror::Error)]
pub enum NoRecords {
    /// The recordings cannot be read.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// Runs that are not random.
    #[error("run \"{run}\" is not random: this method reads time records only")]
    NotRandom {
        /// Name of the run.
        run: String,
    },
    /// Too short a run.
    #[error(
        "run \"{run}\" has no stretch of good samples with {LEAST_LINES} lines between {low} and {high} Hz; record longer"
    )]
    TooShort {
        /// Name of the run.
        run: String,
        /// Lowest line, Hz.
        low: f64,
        /// Highest line, Hz.
        high: f64,
    },
    /// Nothing tells the noise.
    #[error(
        "nothing tells the noise of run \"{run}\": record the drive and name it by `reference`, state the sensors' `noise`, or use more than six accelerometers on the interface"
    )]
    NoNoise {
        /// Name of the run.
        run: String,
    },
}

/// Signals of good samples in a row.
#[derive(Default)]
struct Stretch {
    /// Twelve resultants, then drives.
    signals: Vec<Vec<f32>>,
}

/// Middle of the accelerometers on the interface, m, where all resultants are measured in all runs.
fn middle(setup: &Setup) -> Result<Option<Vector3<f64>>, MeasureError> {
    for number in 0..setup.runs.len() {
        if !RunGeometry::new(setup, number, &Accelerations::Interface)?.is_complete() {
            return Ok(None);
        }
    }
    middle_of_interface(setup).map(Some)
}

/// Signals of one run.
struct Intake<'a> {
    setup: &'a Setup,
    number: usize,
    geometry: RunGeometry,
    drives: usize,
    stretches: Vec<Stretch>,
    now: Stretch,
    redundancy: Option<Redundancy>,
    /// Faulty samples.
    faulty: u64,
}

impl<'a> Intake<'a> {
    /// With resultants about `middle`, or about A.
    fn new(
        setup: &'a Setup,
        number: usize,
        drives: usize,
        middle: Option<Vector3<f64>>,
    ) -> Result<Self, NoRecords> {
        let run = &setup.runs[number];
        if run.excitation != Excitation::Random {
            return Err(NoRecords::NotRandom {
                run: run.name.clone(),
            });
        }
        let about = middle.unwrap_or(setup.reference_point.into());
        let geometry = RunGeometry::about(setup, number, &Accelerations::Interface, about)?;
        let redundancy = if drives == 0 {
            Redundancy::new(setup, &geometry)
        } else {
            None
        };
        Ok(Self {
            setup,
            number,
            geometry,
            drives,
            stretches: Vec::new(),
            now: Stretch::default(),
            redundancy,
            faulty: 0,
        })
    }

    fn push(&mut self, sample: &[f32], drives: &[f32], good: bool) {
        if !good {
            self.faulty += 1;
            self.close();
            return;
        }
        let twelve = self.geometry.resultants(sample);
        let signals = &mut self.now.signals;
        signals.resize_with(RESULTANTS + self.drives, Vec::new);
        for (signal, x) in signals.iter_mut().zip(twelve.iter().chain(drives)) {
            signal.push(*x);
        }
        if let Some(redundancy) = &mut self.redundancy {
            redundancy.add(sample);
        }
    }

    fn close(&mut self) {
        if !self.now.signals.is_empty() {
            self.stretches.push(std::mem::take(&mut self.now));
        }
    }

    /// Lines of the run and their noise.
    fn finish(
        mut self,
        rate: f64,
        band: [f64; 2],
        warnings: &mut Vec<String>,
    ) -> Result<(Vec<Record>, Found, NoiseOrigin, u64), NoRecords> {
        self.close();
        let run = &self.setup.runs[self.number];
        let least = (LEAST_LINES * rate / (band[1] - band[0]).max(1e-9)) as usize;
        let mut left_out = self.faulty;
        let mut lines = Vec::new();
        for stretch in std::mem::take(&mut self.stretches) {
            let count = stretch.signals.first().map_or(0, Vec::len);
            if count < least {
                left_out += count as u64;
                continue;
            }
            let parts = count.div_ceil(MOST);
            for part in 0..parts {
                let range = part * count / parts..(part + 1) * count / parts;
                let cut: Vec<Vec<f32>> = if parts == 1 {
                    Vec::new()
                } else {
                    let of = |s: &Vec<f32>| s[range.clone()].to_vec();
                    stretch.signals.iter().map(of).collect()
                };
                let signals = if parts == 1 { &stretch.signals } else { &cut };
                lines.push(transform(signals, rate, band));
            }
        }
        let determined = self.geometry.determined();
        let seen = |c: usize| match c {
            0..6 => determined[c] > UNSEEN,
            _ => self.geometry.equations.measured(c - 6) > UNSEEN,
        };
        // Rounding of what no sensor sees is no signal.
        for lines in &mut lines {
            for c in (0..RESULTANTS).filter(|&c| !seen(c)) {
                lines.signals[c].fill(Complex::default());
            }
        }
        let Some(longest) = lines.iter().max_by_key(|l| l.frequencies.len()) else {
            return Err(NoRecords::TooShort {
                run: run.name.clone(),
                low: band[0],
                high: band[1],
            });
        };
        let signals: Vec<&[Complex<f64>]> = longest.signals.iter().map(Vec::as_slice).collect();
        let twelve: [&[Complex<f64>]; RESULTANTS] = core::array::from_fn(|c| signals[c]);
        let stated = Stated::of(self.setup, &self.geometry, warnings);
        let (found, origin) = if self.drives > 0 {
            let found = noise::beside_drives(&signals[RESULTANTS..], &twelve);
            (found, NoiseOrigin::Spectra)
        } else if stated.whole.iter().all(|whole| *whole) {
            (Some(white(&stated.noise)), NoiseOrigin::Stated)
        } else {
            let found = self.redundancy.as_ref().and_then(|redundancy| {
                let alone = redundancy.noise(None)?;
                let beside = noise::beside_strongest(&alone, &twelve);
                let base = redundancy.noise(beside.as_ref()).unwrap_or(alone);
                noise::beside_base(&base, &twelve)
            });
            (found, NoiseOrigin::Residual)
        };
        let found = found.ok_or_else(|| NoRecords::NoNoise {
            run: run.name.clone(),
        })?;
        let longest = longest.frequencies.clone();
        let records = lines.iter().map(|lines| Record {
            run: self.number,
            base: six(&lines.signals, 0),
            force: six(&lines.signals, 6),
            noise: found.noise,
            level: level_at(&found.level, &longest, &lines.frequencies),
            frequencies: lines.frequencies.clone(),
            equations: *self.geometry.equations.rows(),
        });
        Ok((records.collect(), found, origin, left_out))
    }
}

fn six(signals: &[Vec<Complex<f64>>], first: usize) -> Vec<Complex6> {
    let count = signals.first().map_or(0, Vec::len);
    let at = |k: usize| Complex6::from_fn(|i, _| signals[first + i][k]);
    (0..count).map(at).collect()
}

/// Levels that were found at some frequencies, at others.
fn level_at(level: &[f64], found: &[f64], wanted: &[f64]) -> Vec<f64> {
    if level.is_empty() || found == wanted {
        return level.to_vec();
    }
    let of = |f: &f64| level[found.partition_point(|x| x < f).min(level.len() - 1)];
    wanted.iter().map(of).collect()
}

/// White noise of one sample, as the noise of a line.
fn white(noise: &ResultantNoise) -> Found {
    Found {
        noise: Noise {
            base: noise.acceleration,
            force: noise.force,
        },
        level: Vec::new(),
    }
}

/// Joins the runs, which are about a point at `middle` from A: noise by the same sensors is one where they agree.
fn join(
    runs: Vec<(Vec<Record>, Found, NoiseOrigin, u64)>,
    middle: Option<Vector3<f64>>,
    warnings: &mut Vec<String>,
) -> Records {
    let mut found: Vec<Found> = runs.iter().map(|(_, found, ..)| found.clone()).collect();
    noise::pool(&mut found);
    let left_out = runs.iter().map(|r| r.3).sum();
    let origin = runs.first().map_or(NoiseOrigin::Spectra, |r| r.2);
    let mut records = Vec::new();
    for ((of_run, ..), found) in runs.into_iter().zip(found) {
        records.extend(of_run.into_iter().map(|record| Record {
            noise: found.noise,
            ..record
        }));
    }
    if let Some(r) = &middle {
        records = records
            .into_iter()
            .map(|record| record.about(&-r))
            .collect();
    }
    if left_out > 0 {
        warnings.push(format!(
            "method ml: {left_out} samples are faulty or lie in short stretches between faulty ones, and are left out"
        ));
    }
    Records {
        records,
        middle,
        origin,
        left_out,
    }
}

/// A point seen from A.
fn from_a(setup: &Setup, point: Option<Vector3<f64>>) -> Option<Vector3<f64>> {
    point.map(|p| p - Vector3::from(setup.reference_point))
}

/// Reads the random runs of a setup and transforms the lines in `band` (Hz).
///
/// # Errors
/// [`NoRecords`] where recordings cannot be read or do not suit the method.
pub fn read_records(
    setup: &Setup,
    band: [f64; 2],
    limit: Option<u64>,
    warnings: &mut Vec<String>,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Records, NoRecords> {
    let middle = middle(setup)?;
    let mut runs = Vec::new();
    let mut rate = None;
    for (number, run) in setup.runs.iter().enumerate() {
        let mut intake = Intake::new(setup, number, run.references.len(), middle)?;
        let names = channel_names(setup, run);
        let mut recording = setup
            .open_recording(run, &names)
            .map_err(MeasureError::from)?;
        recording.limit(limit);
        let stated = setup.processing.as_ref().and_then(|p| p.sample_rate);
        let settled = recording.settle_rate(stated).map_err(MeasureError::from)?;
        // Those before it have been held against each other by the band's method.
        let rate = *rate.get_or_insert(settled);
        let columns = drive_columns(run, &names);
        let mut sample = vec![0.0_f32; recording.channels()];
        let mut drives = vec![0.0_f32; columns.len()];
        while recording
            .next_row(&mut sample)
            .map_err(MeasureError::from)?
        {
            for (slot, &at) in drives.iter_mut().zip(&columns) {
                *slot = sample.get(at).copied().unwrap_or(0.0);
            }
            intake.push(&sample, &drives, recording.health().is_good());
            if recording.rows().is_multiple_of(REPORT_ROWS) {
                progress(Progress {
                    work: Work::Reading,
                    run: number,
                    runs: setup.runs.len(),
                    name: &run.name,
                    share: recording.progress(),
                });
            }
        }
        runs.push(intake.finish(rate, band, warnings)?);
    }
    Ok(join(runs, from_a(setup, middle), warnings))
}

/// The same from samples in memory.
///
/// # Errors
/// [`NoRecords`] where sensors, bands or lengths do not suit.
pub(crate) fn sampled_records(
    setup: &Setup,
    band: [f64; 2],
    runs: &[Samples<'_>],
    warnings: &mut Vec<String>,
) -> Result<Records, NoRecords> {
    let middle = middle(setup)?;
    let rate = setup.processing.as_ref().and_then(|p| p.sample_rate);
    let mut all = Vec::new();
    for (number, (run, samples)) in setup.runs.iter().zip(runs).enumerate() {
        let rate = rate.ok_or_else(|| MeasureError::NoProcessing {
            run: run.name.clone(),
        })?;
        let drives = run.references.len().min(1);
        let mut intake = Intake::new(setup, number, drives, middle)?;
        let mut sample = vec![0.0_f32; samples.sensors.len()];
        for n in 0..samples.sensors.first().map_or(0, Vec::len) {
            for (slot, channel) in sample.iter_mut().zip(samples.sensors) {
                *slot = channel.get(n).copied().unwrap_or(0.0);
            }
            let drive = [samples.drive.get(n).copied().unwrap_or(0.0)];
            intake.push(&sample, &drive[..drives], true);
        }
        all.push(intake.finish(rate, band, warnings)?);
    }
    Ok(join(all, from_a(setup, middle), warnings))
}
