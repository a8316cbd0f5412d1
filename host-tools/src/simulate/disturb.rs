//! Errors of the instruments: white noise and constant offsets.

use std::collections::BTreeSet;

use super::Recording;
use super::model::{Measurement, Model};
use super::random::Stream;

/// Adds noise and offsets.
///
/// Both are properties of a sensor and its amplifier, not of a run: their level follows
/// the channel's RMS over all runs of one kind, so that a channel which rests in one run
/// has the noise there that it has in the others.
pub(super) fn disturb(
    model: &Model,
    measurement: &Measurement,
    seed: u64,
    recordings: &mut [Recording],
) {
    for shaken in [true, false] {
        let mut names: BTreeSet<String> = BTreeSet::new();
        for recording in recordings
            .iter()
            .filter(|r| r.sample_rate.is_some() == shaken)
        {
            names.extend(recording.channels.iter().cloned());
        }
        for name in names {
            let level = rms_over_runs(&name, shaken, recordings);
            // In static poses the offsets of accelerometers would be a wrong gravity,
            // which nothing can tell from a right one.
            let drifts = shaken || model.load_cells.iter().any(|cell| cell.channel == name);
            let offset = match drifts && measurement.dc_offset > 0.0 {
                true => Stream::new(seed, &["offset", &name]).signed() * measurement.dc_offset,
                false => 0.0,
            };
            for (plan, recording) in model.runs.iter().zip(&mut *recordings) {
                let column = recording
                    .channels
                    .iter()
                    .position(|channel| *channel == name);
                let Some(column) = column else { continue };
                if recording.sample_rate.is_some() != shaken {
                    continue;
                }
                let mut stream = Stream::new(seed, &["noise", &plan.name, &name]);
                let scale = level * measurement.noise;
                if scale == 0.0 && offset == 0.0 {
                    continue;
                }
                for pair in recording.samples[column].chunks_mut(2) {
                    let noise = stream.normal() * scale;
                    for (sample, noise) in pair.iter_mut().zip([noise.re, noise.im]) {
                        *sample = (f64::from(*sample) + noise + offset * level) as f32;
                    }
                }
            }
        }
    }
}

/// RMS of a channel over all runs of one kind.
pub(super) fn rms_over_runs(name: &str, shaken: bool, recordings: &[Recording]) -> f64 {
    let (mut power, mut count) = (0.0, 0_usize);
    for recording in recordings {
        if recording.sample_rate.is_some() != shaken {
            continue;
        }
        for (channel, samples) in recording.channels.iter().zip(&recording.samples) {
            if channel == name {
                power += samples.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
                count += samples.len();
            }
        }
    }
    libm::sqrt(power / count.max(1) as f64)
}
