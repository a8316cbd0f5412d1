//! Mean, RMS and peak of a channel.

use super::Row;
use crate::inputs::InputEntry;
use massline_firmware::wire::Health;

/// Level of a channel over some samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Name of the channel.
    pub channel: String,
    /// Mean, SI.
    pub mean: f64,
    /// Largest distance from zero, SI.
    pub peak: f64,
    /// Reading at which the channel is overloaded, SI.
    pub range: f64,
    /// All faults that were seen.
    pub health: Health,
    /// Samples that went in.
    pub samples: u64,
    squares: f64,
}

impl Level {
    /// One for each input.
    #[must_use]
    pub fn of(inputs: &[InputEntry]) -> Vec<Self> {
        let level = |entry: &InputEntry| {
            let (scale, limits) = (entry.certificate.scale(), entry.certificate.limits());
            let end = |count| f64::from(scale.count(count)).abs();
            Self {
                channel: entry.column(),
                range: end(limits.low).min(end(limits.high)),
                mean: 0.0,
                peak: 0.0,
                health: Health::GOOD,
                samples: 0,
                squares: 0.0,
            }
        };
        inputs.iter().map(level).collect()
    }

    /// Takes a row.
    pub fn add(levels: &mut [Self], row: &Row<'_>) {
        let channels = row.si.iter().zip(row.health);
        for (level, (si, health)) in levels.iter_mut().zip(channels) {
            level.take(*si, *health);
        }
    }

    fn take(&mut self, si: f32, health: Health) {
        self.health = self.health.union(health);
        // An overload is too large a reading, but it is one; the others are none.
        if !Health::OVERLOAD.union(Health::OPEN).contains(health) {
            return;
        }
        let x = f64::from(si);
        self.samples += 1;
        let before = x - self.mean;
        self.mean += before / self.samples as f64;
        self.squares += before * (x - self.mean);
        self.peak = self.peak.max(x.abs());
    }

    /// Root mean square about the mean, SI.
    #[must_use]
    pub fn rms(&self) -> f64 {
        (self.squares / self.samples.max(1) as f64).sqrt()
    }

    /// Peak over range, 0 to 1 and beyond.
    #[must_use]
    pub fn used(&self) -> f64 {
        if self.range > 0.0 {
            self.peak / self.range
        } else {
            0.0
        }
    }

    /// Begins anew.
    pub fn restart(&mut self) {
        (self.mean, self.peak, self.squares) = (0.0, 0.0, 0.0);
        (self.samples, self.health) = (0, Health::GOOD);
    }
}
