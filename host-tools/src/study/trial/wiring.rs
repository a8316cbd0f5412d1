//! Faults of wiring and recording in a trial: the readings differ from those that the set-up expects.

use super::Trial;

impl Trial {
    /// Exchanges the readings of two sensors.
    pub(in crate::study) fn exchange(&mut self, a: usize, b: usize) {
        for run in &mut self.runs {
            run.sensors.swap(a, b);
            run.noise.swap(a, b);
        }
    }

    /// Records the readings of a sensor in another unit.
    pub(in crate::study) fn record_in(&mut self, sensor: usize, unit: f32) {
        for run in &mut self.runs {
            let readings = run.sensors[sensor].iter_mut();
            readings
                .chain(&mut run.noise[sensor])
                .for_each(|x| *x /= unit);
        }
    }

    /// Adds a share of the readings of one sensor to those of another.
    pub(in crate::study) fn leak(&mut self, sensor: usize, from: usize, share: f32) {
        for run in &mut self.runs {
            let other = run.sensors[from].clone();
            let readings = run.sensors[sensor].iter_mut();
            readings.zip(&other).for_each(|(x, y)| *x += share * y);
        }
    }

    /// Takes the signal of a sensor away; its noise stays.
    pub(in crate::study) fn silence(&mut self, sensor: usize) {
        self.runs
            .iter_mut()
            .for_each(|run| run.sensors[sensor].fill(0.0));
    }

    /// Has sensors come late by so many samples: their ends go, and the beginnings of all others.
    pub(in crate::study) fn delay(&mut self, late: &[usize], samples: usize) {
        for run in &mut self.runs {
            let cut = |channel: &mut Vec<f32>, is_late: bool| {
                if is_late {
                    channel.truncate(channel.len().saturating_sub(samples));
                } else {
                    channel.drain(..samples.min(channel.len()));
                }
            };
            for (c, (signal, noise)) in run.sensors.iter_mut().zip(&mut run.noise).enumerate() {
                cut(signal, late.contains(&c));
                cut(noise, late.contains(&c));
            }
            cut(&mut run.drive, false);
        }
    }
}
