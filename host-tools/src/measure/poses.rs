//! Static runs: one pose a row.

use super::MeasureError;
use super::geometry::{RunGeometry, channel_names};
use super::noise::{NoiseOrigin, RESOLUTION, RunNoise, Stated, assumed};
use super::units::Noticed;
use crate::recording::{Health, Preamble};
use crate::setup::{Run, Setup};
use massline_core::geometry::ResultantNoise;
use massline_core::masslines::StaticPoses;
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use std::collections::BTreeMap;

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
    /// Source of the noise.
    pub origin: RunNoise,
    /// Every pose: specific force and resultants at A.
    pub rows: Vec<(Vector6<f64>, Vector6<f64>)>,
    /// The channels' readings in recorded units, pose by pose.
    pub(crate) readings: Vec<Vec<f32>>,
    /// Calibrations that the recording states.
    pub preamble: Preamble,
    pub(super) fingerprint: u64,
}

/// Fewest poses: one for the offsets, one to differ from it.
const FEWEST: u64 = 3;

pub(super) fn read(
    setup: &Setup,
    run: &Run,
    geometry: RunGeometry,
    noticed: &mut Noticed,
) -> Result<MeasuredPoses, MeasureError> {
    let file = setup.recording_path(run);
    let mut names = channel_names(setup, run);
    let mut recording = setup.open_recording(run, &names)?;
    let channels = names.len();
    // Which rows are the same pose, where the recording says so.
    let labelled = recording.ignored().iter().any(|column| column == POSE);
    if labelled {
        names.push(POSE);
        recording = setup.open_recording(run, &names)?;
    }
    noticed.notice(setup, run, &recording)?;
    let warnings = &mut noticed.warnings;
    recording.notice_columns(warnings);
    let mut poses = StaticPoses::default();
    let mut rows = Vec::new();
    let mut readings = Vec::new();
    let mut health = Health::new(channels);
    let mut labels = Vec::new();
    let mut sample = vec![0.0_f32; names.len()];
    let mut largest: f64 = 0.0;
    let mut left_out: u64 = 0;
    while recording.next_row(&mut sample)? {
        if !recording.health().is_good() {
            left_out += 1;
            continue;
        }
        if labelled {
            labels.push(sample[channels]);
        }
        let sample = &sample[..channels];
        health.add(sample);
        let r = geometry.resultants(sample);
        let a = Vector6::from_fn(|j, _| f64::from(r[j]));
        let f = Vector6::from_fn(|j, _| f64::from(r[6 + j]));
        largest = largest.max(a.fixed_rows::<3>(0).norm());
        poses.add(&a, &f);
        readings.push(sample.to_vec());
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
    let used = used(setup, &geometry);
    let resolution = (RESOLUTION * largest).powi(2);
    let stated = Stated::of(setup, &geometry, warnings);
    let mut noise = ResultantNoise::default();
    let mut with = |variance: f64| {
        for (k, scale, _) in &used {
            noise.add_sensor(&geometry.columns[*k], variance / (scale * scale));
        }
    };
    let origin = if stated.whole[0] {
        with(resolution);
        noise.add(&stated.noise, 1.0);
        NoiseOrigin::Stated
    } else if let Some(variance) = of_repeats(&used, &readings, &labels) {
        with(resolution + variance);
        NoiseOrigin::Repeats
    } else if let Some(variance) = of_one_vector(&used, &readings) {
        with(resolution + variance);
        NoiseOrigin::Residual
    } else {
        with(resolution);
        warnings.push(assumed(
            &run.name,
            "three or fewer accelerometers do not tell how noisy they are",
            "read poses more than once and number them in a column `pose`",
        ));
        NoiseOrigin::Assumed
    };
    let origin = RunNoise {
        run: run.name.clone(),
        accelerations: origin,
        // What a rigid body leaves of the forces.
        forces: NoiseOrigin::Residual,
    };
    let noise = noise.acceleration;
    Ok(MeasuredPoses {
        name: run.name.clone(),
        geometry,
        poses,
        noise,
        origin,
        rows,
        readings,
        preamble: recording.preamble().clone(),
        fingerprint: health.fingerprint(),
    })
}

/// The column that numbers poses.
const POSE: &str = "pose";

/// An accelerometer that counts: its number, its scale, its direction.
type Used = (usize, f64, Vector3<f64>);

fn used(setup: &Setup, geometry: &RunGeometry) -> Vec<Used> {
    setup
        .accelerometers
        .iter()
        .enumerate()
        .filter(|(k, _)| geometry.columns[*k][..6].iter().any(|c| *c != 0.0))
        .map(|(k, entry)| (k, entry.scale, Vector3::from(entry.direction).normalize()))
        .collect()
}

fn read_by(reading: &[f32], (k, scale, _): &Used) -> f64 {
    reading.get(*k).map_or(0.0, |x| f64::from(*x) * scale)
}

/// Variance of a reading from the scatter of rows of one pose, mean over the accelerometers,
/// (m/s²)²; `None` where no pose was read twice.
fn of_repeats(used: &[Used], readings: &[Vec<f32>], labels: &[f32]) -> Option<f64> {
    let mut poses: BTreeMap<u32, Vec<&[f32]>> = BTreeMap::new();
    for (label, reading) in labels.iter().zip(readings) {
        poses.entry(label.to_bits()).or_default().push(reading);
    }
    let (mut squares, mut freedom) = (0.0, 0);
    for rows in poses.values() {
        freedom += (rows.len() - 1) * used.len();
        for sensor in used {
            let values = || rows.iter().map(|row| read_by(row, sensor));
            let mean = values().sum::<f64>() / rows.len() as f64;
            squares += values().map(|x| (x - mean).powi(2)).sum::<f64>();
        }
    }
    (freedom > 0).then(|| squares / freedom as f64)
}

/// Variance of a reading from the residual of one vector fitted to all accelerometers: at rest
/// they read the same specific force. It holds their noise and their misalignment.
/// `None` for three or fewer, which leave nothing.
fn of_one_vector(used: &[Used], readings: &[Vec<f32>]) -> Option<f64> {
    let mut normal = Matrix3::zeros();
    for (_, _, direction) in used {
        normal += direction * direction.transpose();
    }
    let freedom = readings.len() * used.len().saturating_sub(3);
    let inverse = normal.try_inverse().filter(|_| freedom > 0)?;
    let mut left = 0.0;
    for reading in readings {
        let sum: Vector3<f64> = used.iter().map(|s| s.2 * read_by(reading, s)).sum();
        let force = inverse * sum;
        left += used
            .iter()
            .map(|s| (read_by(reading, s) - s.2.dot(&force)).powi(2))
            .sum::<f64>();
    }
    Some(left / freedom as f64)
}
