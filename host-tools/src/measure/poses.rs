//! Static runs: one pose a row.

use super::MeasureError;
use super::geometry::{RunGeometry, channel_names};
use crate::recording::{Health, Preamble};
use crate::setup::{Run, Setup};
use massline_core::geometry::ResultantNoise;
use massline_core::masslines::StaticPoses;
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// One static run.
#[derive(Clone)]
pub struct MeasuredPoses {
    /// Name of the run.
    pub name: String,
    /// Its sensors.
    pub geometry: RunGeometry,
    /// Running sums over the poses.
    pub poses: StaticPoses,
    /// Covariance of the noise of the specific force in one pose, about A.
    pub noise: Matrix6<f64>,
    /// Every pose: specific force and resultants at A.
    pub rows: Vec<(Vector6<f64>, Vector6<f64>)>,
    /// The channels' readings in recorded units, pose by pose.
    pub(crate) readings: Vec<Vec<f32>>,
    /// What the recording says of itself.
    pub preamble: Preamble,
    pub(super) fingerprint: u64,
}

/// Share of the specific force below which a difference between poses is none: static
/// sensors and hands are not better than this.
const RESOLUTION: f64 = 1e-6;

/// Fewest poses: one for the offsets, one to differ from it.
const FEWEST: u64 = 3;

pub(super) fn read(
    setup: &Setup,
    run: &Run,
    geometry: RunGeometry,
    warnings: &mut Vec<String>,
) -> Result<MeasuredPoses, MeasureError> {
    let file = setup.recording_path(run);
    let names = channel_names(setup, run);
    let mut recording = setup.open_recording(run, &names)?;
    recording.notice_columns(warnings);
    let mut poses = StaticPoses::new();
    let mut rows = Vec::new();
    let mut readings = Vec::new();
    let mut health = Health::new(names.len());
    let mut sample = vec![0.0_f32; names.len()];
    let mut largest: f64 = 0.0;
    let mut left_out: u64 = 0;
    while recording.next_row(&mut sample)? {
        if !recording.health().is_good() {
            left_out += 1;
            continue;
        }
        health.add(&sample);
        let r = geometry.resultants(&sample);
        let a = Vector6::from_fn(|j, _| f64::from(r[j]));
        let f = Vector6::from_fn(|j, _| f64::from(r[6 + j]));
        largest = largest.max(a.fixed_rows::<3>(0).norm());
        poses.add(&a, &f);
        readings.push(sample.clone());
        rows.push((a, f));
    }
    recording.notice_end(warnings);
    if left_out > 0 {
        warnings.push(format!(
            "run \"{}\": {left_out} of {} poses were left out for faulty samples",
            run.name,
            recording.rows()
        ));
    }
    let good = recording.rows() - left_out;
    if good < FEWEST {
        return Err(MeasureError::TooFewPoses { file, poses: good });
    }
    let noise = noise(setup, &geometry, &readings, RESOLUTION * largest);
    Ok(MeasuredPoses {
        name: run.name.clone(),
        geometry,
        poses,
        noise,
        rows,
        readings,
        preamble: recording.preamble().clone(),
        fingerprint: health.fingerprint(),
    })
}

/// Covariance of the noise of the specific force in one pose, about A.
///
/// What is at rest does not turn, so that all accelerometers read one and the same vector.
/// What more than three of them leave of it is their noise, and what they are misaligned by.
/// Three or fewer leave nothing: then `resolution`, m/s², is all that is known.
fn noise(
    setup: &Setup,
    geometry: &RunGeometry,
    readings: &[Vec<f32>],
    resolution: f64,
) -> Matrix6<f64> {
    let used: Vec<(usize, f64, Vector3<f64>)> = setup
        .accelerometers
        .iter()
        .enumerate()
        .filter(|(k, _)| geometry.columns[*k][..6].iter().any(|c| *c != 0.0))
        .map(|(k, entry)| (k, entry.scale, Vector3::from(entry.direction).normalize()))
        .collect();
    let mut normal = Matrix3::zeros();
    for (_, _, direction) in &used {
        normal += direction * direction.transpose();
    }
    let mut variance = resolution * resolution;
    let freedom = readings.len() * used.len().saturating_sub(3);
    if let (Some(inverse), true) = (normal.try_inverse(), freedom > 0) {
        let mut left = 0.0;
        for reading in readings {
            let read = |(k, scale, _): &(usize, f64, Vector3<f64>)| {
                reading.get(*k).map_or(0.0, |x| f64::from(*x) * scale)
            };
            let sum: Vector3<f64> = used.iter().map(|s| s.2 * read(s)).sum();
            let force = inverse * sum;
            left += used
                .iter()
                .map(|s| (read(s) - s.2.dot(&force)).powi(2))
                .sum::<f64>();
        }
        variance += left / freedom as f64;
    }
    let mut noise = ResultantNoise::NONE;
    for (k, scale, _) in &used {
        noise.add_sensor(&geometry.columns[*k], variance / (scale * scale));
    }
    noise.acceleration
}
