//! Stepped sine runs: frequency responses, one frequency a row.

use super::MeasureError;
use super::geometry::{RunGeometry, channel_names};
use super::noise::RESOLUTION;
use super::units::Noticed;
use crate::recording::Preamble;
use crate::setup::{Run, Setup};
use massline_core::geometry::{RESULTANTS, ResultantNoise};
use massline_core::masslines::SineRun;
use massline_core::spectra::LineRange;
use nalgebra::Complex;
use std::hash::{DefaultHasher, Hasher};

/// One stepped sine run.
#[derive(Clone)]
pub struct MeasuredSine {
    /// Name of the run.
    pub name: String,
    /// Its sensors.
    pub geometry: RunGeometry,
    /// Hz, ascending.
    pub frequencies: Vec<f64>,
    /// Responses of the twelve resultants, frequency by frequency.
    pub responses: Vec<[Complex<f64>; RESULTANTS]>,
    /// Responses of all channels in recorded units, frequency by frequency.
    pub(crate) readings: Vec<Vec<Complex<f64>>>,
    /// Responses of the accelerometers, m/s², frequency by frequency.
    pub sensors: Vec<Vec<Complex<f64>>>,
    /// Lines of the averaging band.
    pub band: LineRange,
    /// Covariance of the noise of the resultants per line, and at least the resolution of the
    /// recorded numbers.
    pub noise: ResultantNoise,
    /// The same from the misfit of neighbouring lines of the averaging band, where there are
    /// enough.
    pub(super) neighbours: Option<ResultantNoise>,
    /// The resolution of the recorded numbers alone.
    pub(super) resolution: ResultantNoise,
    /// The run that this one repeats.
    pub(super) repeats: Option<String>,
    /// True sample rate and calibrations that the recording states.
    pub preamble: Preamble,
    pub(super) fingerprint: u64,
}

impl MeasuredSine {
    /// As the core's estimators read it.
    #[must_use]
    pub fn run(&self) -> SineRun<'_> {
        SineRun {
            responses: &self.responses,
            noise: self.noise,
        }
    }
}

/// Reads one run; `before` are the frequencies of the sine runs before it. Its noise comes when
/// all runs are there: some may repeat it.
pub(super) fn read(
    setup: &Setup,
    run: &Run,
    geometry: RunGeometry,
    before: Option<&[f64]>,
    noticed: &mut Noticed,
) -> Result<MeasuredSine, MeasureError> {
    let Some(processing) = &setup.processing else {
        return Err(MeasureError::NoProcessing {
            run: run.name.clone(),
        });
    };
    let file = setup.recording_path(run);
    let names = channel_names(setup, run);
    let mut columns = vec!["frequency".to_owned()];
    for name in &names {
        columns.push(format!("{name}.re"));
        columns.push(format!("{name}.im"));
    }
    let wanted: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut recording = setup.open_recording(run, &wanted)?;
    noticed.notice(setup, run, &recording)?;
    let warnings = &mut noticed.warnings;
    recording.notice_columns(warnings);
    let sensors_of = setup.accelerometers.len();
    let mut measured = MeasuredSine {
        name: run.name.clone(),
        geometry,
        frequencies: Vec::new(),
        responses: Vec::new(),
        readings: Vec::new(),
        sensors: Vec::new(),
        band: LineRange::all(0),
        noise: ResultantNoise::default(),
        neighbours: None,
        resolution: ResultantNoise::default(),
        repeats: run.repeats.clone(),
        preamble: recording.preamble().clone(),
        fingerprint: 0,
    };
    let mut hash = DefaultHasher::new();
    let mut resolution = ResultantNoise::default();
    // 1 / (s / (s + 2π c)) at s = 2π i f.
    let uncoupled = |channel, frequency| Complex::new(1.0, -setup.ac_corner(channel) / frequency);
    let mut row = vec![0.0; columns.len()];
    while recording.next_row_f64(|i, x| row[i] = x)? {
        let frequency = row[0];
        // At 0 Hz nothing moves: analysers write a line there all the same.
        if frequency == 0.0 && recording.rows() == 1 {
            continue;
        }
        let last = measured.frequencies.last().copied().unwrap_or(0.0);
        if frequency <= last {
            return Err(MeasureError::FrequencyOrder {
                file,
                place: recording.place(),
                found: frequency,
                before: last,
            });
        }
        measured.frequencies.push(frequency);
        let mut response = [Complex::new(0.0, 0.0); RESULTANTS];
        let mut sensors = Vec::with_capacity(sensors_of);
        let mut readings = Vec::with_capacity(names.len());
        for (c, pair) in row[1..].chunks_exact(2).enumerate() {
            let x = Complex::new(pair[0], pair[1]) * uncoupled(names[c], frequency);
            hash.write_u64(pair[0].to_bits());
            hash.write_u64(pair[1].to_bits());
            let column = &measured.geometry.columns[c];
            for (j, r) in response.iter_mut().enumerate() {
                *r += x * column[j];
            }
            resolution.add_sensor(column, x.norm_sqr());
            readings.push(x);
            if c < sensors_of {
                sensors.push(x * setup.accelerometers[c].scale);
            }
        }
        measured.responses.push(response);
        measured.sensors.push(sensors);
        measured.readings.push(readings);
    }
    recording.notice_end(warnings);
    let lines = measured.frequencies.len().max(1) as f64;
    let band = LineRange::among(&measured.frequencies, processing.averaging_band);
    measured.band = band.map_err(|why| MeasureError::band(&file, "averaging_band", why))?;
    let band = measured.band.indices();
    measured.neighbours = SineRun::noise_of_neighbours(
        &measured.frequencies[band.clone()],
        &measured.responses[band],
    );
    measured
        .resolution
        .add(&resolution, RESOLUTION * RESOLUTION / lines);
    measured.fingerprint = hash.finish();
    if let Some(before) = before
        && let Some(frequency) = first_difference(before, &measured.frequencies)
    {
        return Err(MeasureError::OtherFrequencies { file, frequency });
    }
    Ok(measured)
}

fn first_difference(a: &[f64], b: &[f64]) -> Option<f64> {
    let differ = |x: &f64, y: &f64| (x - y).abs() > 1e-9 * x.abs();
    if let Some((x, y)) = a.iter().zip(b).find(|(x, y)| differ(x, y)) {
        return Some(x.min(*y));
    }
    let longer = if a.len() > b.len() { a } else { b };
    longer.get(a.len().min(b.len())).copied()
}
