//! White noise of the sensors of a trial, whose shape serves every level.

use super::{Trial, TrialError};
use crate::likelihood::Noise;
use crate::measure::{Accelerations, RunGeometry};
use crate::setup::Quantity;
use crate::simulate::Stream;
use crate::study::chance::Chance;
use massline_core::geometry::ResultantNoise;

impl Trial {
    /// White noise of each sensor: the RMS of its readings over all runs, times a factor of its
    /// own between 1/√`unlike` and √`unlike`. The RMS of a stepped sine is taken over the lines
    /// of the averaging band.
    pub(super) fn draw_noise(&mut self, unlike: f64) {
        let root = libm::sqrt(unlike);
        let mut levels = self.strengths();
        for (c, level) in levels.iter_mut().enumerate() {
            let number = c.to_string();
            *level *= Chance::new(self.seed, &["level", &number]).by_ratio(1.0 / root, root);
        }
        for (r, run) in self.runs.iter_mut().enumerate() {
            let number = r.to_string();
            run.noise = (run.sensors.iter().zip(&levels).enumerate())
                .map(|(c, (samples, level))| {
                    let names = ["noise", &number, &c.to_string()];
                    let mut stream = Stream::new(self.seed, &names);
                    // Two parts share the power of an amplitude, as they share its RMS.
                    let scale = *level;
                    let mut noise = Vec::with_capacity(samples.len() + 1);
                    while noise.len() < samples.len() {
                        let pair = stream.normal() * scale;
                        noise.extend([pair.re as f32, pair.im as f32]);
                    }
                    noise.truncate(samples.len());
                    noise
                })
                .collect();
        }
        self.levels = levels;
    }

    /// RMS of each sensor's readings over all runs. A sensor that rests has the mean of its
    /// kind: nothing is without noise because nothing moves it.
    pub(super) fn strengths(&self) -> Vec<f64> {
        let channels = self.runs.first().map_or(0, |r| r.sensors.len());
        let band = self.setup.processing.as_ref().map(|p| p.averaging_band);
        let counts = |n: usize| match (self.frequencies.get(n / 2), band) {
            (Some(f), Some([low, high])) => (low..=high).contains(f),
            _ => true,
        };
        let own = |c: usize| {
            let (mut power, mut count) = (0.0, 0_usize);
            for run in &self.runs {
                for (_, x) in run.sensors[c]
                    .iter()
                    .enumerate()
                    .filter(|(n, _)| counts(*n))
                {
                    power += f64::from(*x).powi(2);
                    count += 1;
                }
            }
            libm::sqrt(power / count.max(1) as f64)
        };
        let mut strengths: Vec<f64> = (0..channels).map(own).collect();
        let sensors = self.setup.accelerometers.len();
        let moment = |c: usize| {
            let cell = self.setup.load_cells.get(c.wrapping_sub(sensors));
            cell.is_some_and(|cell| cell.quantity == Quantity::Moment)
        };
        let kinds: [&dyn Fn(usize) -> bool; 3] =
            [&|c| c < sensors, &|c| c >= sensors && !moment(c), &moment];
        let mut before = 0.0;
        for kind in kinds {
            let members: Vec<usize> = (0..channels).filter(|&c| kind(c)).collect();
            let sum: f64 = members.iter().map(|&c| strengths[c]).sum();
            let mut mean = sum / members.len().max(1) as f64;
            if mean == 0.0 {
                // Moments where none acts: forces at a lever of a tenth of a metre.
                mean = 0.1 * before;
            }
            before = mean;
            for &c in &members {
                if strengths[c] < 1e-3 * mean {
                    strengths[c] = mean;
                }
            }
        }
        strengths
    }

    /// Standard deviation of each sensor's noise at a level, in its unit.
    pub(in crate::study) fn noise(&self, level: f64) -> Vec<f64> {
        self.levels.iter().map(|l| l * level).collect()
    }

    /// Noise of a line of each resultant at a level, if white: that of all sensors.
    pub(in crate::study) fn resultant_noise(&self, level: f64) -> Result<Noise, TrialError> {
        let geometry = RunGeometry::new(&self.setup, 0, &Accelerations::Interface)?;
        let mut noise = ResultantNoise::default();
        for (column, std) in geometry.columns.iter().zip(self.noise(level)) {
            noise.add_sensor(column, std * std);
        }
        Ok(Noise {
            base: noise.acceleration,
            force: noise.force,
        })
    }

    /// Samples of all runs and sensors with noise at a level.
    pub(super) fn noisy(&self, level: f64) -> Vec<Vec<Vec<f32>>> {
        let add = |(x, n): (&f32, &f32)| x + level as f32 * n;
        let channel = |(x, n): (&Vec<f32>, &Vec<f32>)| x.iter().zip(n).map(add).collect();
        self.runs
            .iter()
            .map(|run| run.sensors.iter().zip(&run.noise).map(channel).collect())
            .collect()
    }
}
