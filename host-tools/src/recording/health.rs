//! The state of the channels, seen from their samples: dead, clipped, copied.

use std::hash::{DefaultHasher, Hasher};

/// Statistics of one channel over one run.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelHealth {
    /// Smallest and largest reading.
    pub range: [f32; 2],
    /// Root mean square about the mean, recorded units.
    pub rms: f64,
    /// Mean, recorded units.
    pub mean: f64,
    /// Samples that sit exactly on the largest or on the smallest reading, whichever are
    /// more, and how many of them follow each other.
    pub at_limit: [u64; 2],
}

/// What is wrong with a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Complaint {
    /// Every sample is the same.
    Dead,
    /// Peaks are cut off: the same extreme reading over and over, also in a row.
    Clipped {
        /// The reading at which it clips.
        limit: f32,
        /// Samples at that limit.
        samples: u64,
    },
}

impl ChannelHealth {
    /// What is wrong with this channel, if anything.
    ///
    /// An extreme of a random signal is rare by nature; even a coarse converter hits it
    /// once or twice. Four times, and two of them in a row, is an amplifier at its stop.
    #[must_use]
    pub fn complaint(&self) -> Option<Complaint> {
        if self.range[0] == self.range[1] {
            return Some(Complaint::Dead);
        }
        let [samples, in_a_row] = self.at_limit;
        (samples >= 4 && in_a_row >= 2).then(|| {
            let limit = if self.range[1].abs() >= self.range[0].abs() {
                self.range[1]
            } else {
                self.range[0]
            };
            Complaint::Clipped { limit, samples }
        })
    }
}

/// Collects [`ChannelHealth`] sample by sample, and a fingerprint of the whole run.
#[derive(Clone, Debug)]
pub struct Health {
    channels: Vec<Running>,
    fingerprint: DefaultHasher,
}

#[derive(Clone, Debug, Default)]
struct Running {
    count: f64,
    mean: f64,
    squares: f64,
    last: f32,
    low: Extreme,
    high: Extreme,
}

#[derive(Clone, Copy, Debug, Default)]
struct Extreme {
    value: f32,
    samples: u64,
    in_a_row: u64,
}

impl Extreme {
    fn see(&mut self, value: f32, beyond: bool, previous: Option<f32>) {
        if beyond || previous.is_none() {
            *self = Self {
                value,
                samples: 1,
                in_a_row: 0,
            };
        } else if value == self.value {
            self.samples += 1;
            if previous == Some(value) {
                self.in_a_row += 1;
            }
        }
    }
}

impl Health {
    /// Of `channels` channels.
    #[must_use]
    pub fn new(channels: usize) -> Self {
        Self {
            channels: vec![Running::default(); channels],
            fingerprint: DefaultHasher::new(),
        }
    }

    /// Takes one sample of all channels.
    pub fn add(&mut self, sample: &[f32]) {
        for (c, &x) in self.channels.iter_mut().zip(sample) {
            let previous = (c.count > 0.0).then_some(c.last);
            c.count += 1.0;
            let before = f64::from(x) - c.mean;
            c.mean += before / c.count;
            c.squares += before * (f64::from(x) - c.mean);
            c.low.see(x, x < c.low.value, previous);
            c.high.see(x, x > c.high.value, previous);
            c.last = x;
            self.fingerprint.write_u32(x.to_bits());
        }
    }

    /// A number that two runs share only if all their samples agree.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint.finish()
    }

    /// The statistics, channel by channel.
    #[must_use]
    pub fn channels(&self) -> Vec<ChannelHealth> {
        self.channels
            .iter()
            .map(|c| {
                let worst = if c.low.samples > c.high.samples {
                    c.low
                } else {
                    c.high
                };
                ChannelHealth {
                    range: [c.low.value, c.high.value],
                    rms: (c.squares / c.count.max(1.0)).sqrt(),
                    mean: c.mean,
                    at_limit: [worst.samples, worst.in_a_row],
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(samples: &[f32]) -> ChannelHealth {
        let mut h = Health::new(1);
        for &s in samples {
            h.add(&[s]);
        }
        h.channels().remove(0)
    }

    #[test]
    fn a_flat_line_is_dead_and_a_flat_top_is_clipped() {
        assert_eq!(of(&[0.5; 100]).complaint(), Some(Complaint::Dead));
        let clipped: Vec<f32> = (0..200)
            .map(|i| (f64::from(i) * 0.1).sin().clamp(-0.9, 0.9) as f32)
            .collect();
        let complaint = of(&clipped).complaint();
        assert!(matches!(complaint, Some(Complaint::Clipped { samples, .. }) if samples > 10));
    }

    #[test]
    fn a_whole_signal_is_neither() {
        let whole: Vec<f32> = (0..2000)
            .map(|i| (f64::from(i) * 0.1).sin() as f32)
            .collect();
        let health = of(&whole);
        assert_eq!(health.complaint(), None);
        // Hundred periods of a sine: 1/√2 to the share of a cut period.
        assert!((health.rms - 0.5_f64.sqrt()).abs() < 5e-3);
    }

    #[test]
    fn one_different_bit_is_another_run() {
        let fingerprint = |x: f32| {
            let mut h = Health::new(1);
            h.add(&[1.0]);
            h.add(&[x]);
            h.fingerprint()
        };
        assert_eq!(fingerprint(2.0), fingerprint(2.0));
        assert_ne!(
            fingerprint(2.0),
            fingerprint(f32::from_bits(2.0_f32.to_bits() + 1))
        );
    }
}
