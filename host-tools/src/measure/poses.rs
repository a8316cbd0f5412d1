//! Static runs: one pose a row.

use super::MeasureError;
use super::geometry::{RunGeometry, channel_names};
use crate::recording::Health;
use crate::setup::{Run, Setup};
use massline_core::masslines::StaticPoses;
use nalgebra::Vector6;

/// One static run.
pub struct MeasuredPoses {
    /// Name of the run.
    pub name: String,
    /// Its sensors.
    pub geometry: RunGeometry,
    /// Running sums over the poses.
    pub poses: StaticPoses,
    /// Resolution of each component of the specific force, m/s² or rad/s².
    pub noise: Vector6<f64>,
    /// Every pose: specific force and resultants at A.
    pub rows: Vec<(Vector6<f64>, Vector6<f64>)>,
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
    if !recording.ignored().is_empty() {
        warnings.push(format!(
            "{}: columns not used: {}",
            file.display(),
            recording.ignored().join(", ")
        ));
    }
    let mut poses = StaticPoses::new();
    let mut rows = Vec::new();
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
        rows.push((a, f));
    }
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
    let determined = geometry.determined();
    let noise = Vector6::from_fn(|j, _| {
        if determined[j] > 0.0 {
            RESOLUTION * largest
        } else {
            0.0
        }
    });
    Ok(MeasuredPoses {
        name: run.name.clone(),
        geometry,
        poses,
        noise,
        rows,
        fingerprint: health.fingerprint(),
    })
}
