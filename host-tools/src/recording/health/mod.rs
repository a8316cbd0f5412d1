//! The state of the channels, seen from their samples: dead, clipped, held, with a reading that stands alone.

mod statistics;

pub use statistics::Health;

/// Statistics of one channel over one run.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelHealth {
    /// Smallest and largest reading.
    pub range: [f32; 2],
    /// Numbers of the first samples that have these, from zero.
    pub range_at: [u64; 2],
    /// Samples.
    pub samples: u64,
    /// Root mean square about the mean, recorded units.
    pub rms: f64,
    /// Mean, recorded units.
    pub mean: f64,
    /// Most readings in a row that equal the one before, and the number of the sample where these begin, from zero.
    pub longest_held: (u64, u64),
    /// All readings that equal the one before.
    pub held: u64,
    /// Samples that sit exactly on the largest or on the smallest reading, whichever are
    /// more, and how many of them follow each other.
    pub at_limit: [u64; 2],
    /// Samples on the reading next to that limit.
    pub next_to_limit: u64,
}

/// Reading that stands alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlier {
    /// Number of the sample, from zero.
    pub sample: u64,
    /// The reading, recorded units.
    pub reading: f32,
    /// Its distance from the mean over the channel's RMS.
    pub crest: f64,
    /// Its share of the channel's power about the mean.
    pub share: f64,
}

/// Stretch of one reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Held {
    /// Number of its first sample, from zero.
    pub sample: u64,
    /// Its samples.
    pub samples: u64,
}

/// Stretch of one reading over the mean of such stretches from which it is none of a signal: with stretches that end by
/// chance one in 10¹⁷ is as long.
const HELD: u64 = 40;

/// Crest factor from which a reading of a random signal is an outlier. A Gaussian signal exceeds 9 once in 10¹⁸ samples,
/// and one that bursts for a twentieth of the time 20 once in 10⁵.
const CREST: f64 = 20.0;

/// Fault of a channel, seen from its readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Complaint {
    /// Every sample is the same.
    Dead,
    /// Peaks are cut off: the same extreme reading over and over.
    Clipped {
        /// The reading at which it clips.
        limit: f32,
        /// Samples at that limit.
        samples: u64,
    },
}

impl ChannelHealth {
    /// The longest stretch of one reading, if it is far longer than those of the channel's resolution.
    #[must_use]
    pub fn held(&self) -> Option<Held> {
        let (longest, sample) = self.longest_held;
        let stretches = self.samples.saturating_sub(self.held);
        let samples = longest + 1;
        // Of a channel that never moves there is no other stretch.
        let is_long = stretches > 1 && samples.saturating_mul(stretches) >= HELD * self.samples;
        is_long.then_some(Held { sample, samples })
    }

    /// The extreme reading that no random signal has beside the others, if there is one.
    #[must_use]
    pub fn outlier(&self) -> Option<Outlier> {
        let of = |(reading, sample): (f32, u64)| {
            let crest = (f64::from(reading) - self.mean).abs() / self.rms;
            Outlier {
                sample,
                reading,
                crest,
                share: crest * crest / self.samples as f64,
            }
        };
        let extremes = self.range.into_iter().zip(self.range_at).map(of);
        let largest = extremes.max_by(|a, b| a.crest.total_cmp(&b.crest))?;
        (largest.crest > CREST).then_some(largest)
    }

    /// The fault of this channel, if it has one.
    ///
    /// An extreme of a random signal is rare by nature; even a coarse converter hits it
    /// once or twice. Four times, and two of them in a row, is an amplifier at its stop.
    ///
    /// A signal faster than a quarter of the sample rate has no two peaks in a row. But its
    /// readings get rarer towards an extreme, so one that is hit four times as often as its
    /// neighbour is a stop as well. By chance a coarse converter does that eight times or
    /// more in one of 10⁵ channels: with an expected number of three, the likeliest, eight
    /// come in 1.2 %, two or fewer at the neighbour in 42 %, none beyond in 0.25 %.
    #[must_use]
    pub fn complaint(&self) -> Option<Complaint> {
        if self.range[0] == self.range[1] {
            return Some(Complaint::Dead);
        }
        let [samples, in_a_row] = self.at_limit;
        let row = samples >= 4 && in_a_row >= 2;
        let pile = samples >= 8 && samples >= 4 * self.next_to_limit;
        (row || pile).then(|| {
            let limit = if self.range[1].abs() >= self.range[0].abs() {
                self.range[1]
            } else {
                self.range[0]
            };
            Complaint::Clipped { limit, samples }
        })
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

    /// At 0.4 of the sample rate peaks last less than a sample.
    #[test]
    fn a_fast_signal_at_its_stop_is_clipped() {
        let fast = |stop: f64| -> Vec<f32> {
            let phase = |i| f64::from(i) * 0.8 * std::f64::consts::PI + 1e-4 * f64::from(i * i);
            (0..200)
                .map(|i| phase(i).sin().clamp(-stop, stop) as f32)
                .collect()
        };
        assert_eq!(of(&fast(1.0)).complaint(), None);
        assert!(matches!(
            of(&fast(0.9)).complaint(),
            Some(Complaint::Clipped { .. })
        ));
    }

    /// Twelve bits, a tenth of them used: sums of twelve uniform numbers, nearly Gaussian.
    #[test]
    fn a_coarse_converter_is_not_clipped() {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        for sigma in [3.0, 30.0] {
            let coarse: Vec<f32> = (0..30_000)
                .map(|_| ((0..12).map(|_| uniform()).sum::<f64>() - 6.0) * sigma)
                .map(|x| x.round() as f32)
                .collect();
            assert_eq!(of(&coarse).complaint(), None, "{sigma}");
        }
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

    /// A recorder that repeats its last reading for a hundred samples, at its beginning, in the midst and at its end; a slow
    /// signal in coarse steps, whose stretches are long by themselves; and one that never moves.
    #[test]
    fn a_stretch_that_the_recorder_held_is_found() {
        let signal = |n: usize| (n as f32 * n as f32 * 0.37).sin();
        for begin in [0, 777, 900] {
            let samples: Vec<f32> = (0..1000)
                .map(|n| {
                    signal(if (begin..begin + 100).contains(&n) {
                        begin
                    } else {
                        n
                    })
                })
                .collect();
            let held = of(&samples).held().unwrap();
            assert_eq!((held.sample, held.samples), (begin as u64, 100));
        }
        let whole: Vec<f32> = (0..1000).map(signal).collect();
        assert_eq!(of(&whole).held(), None);
        let coarse: Vec<f32> = (0..20_000)
            .map(|n| (6.0 * (n as f32 * 2e-3).sin()).round())
            .collect();
        assert_eq!(of(&coarse).held(), None);
        assert_eq!(of(&[0.5; 100]).held(), None);
    }

    /// Sums of twelve uniform numbers with one reading that is 40 of their deviations, and the same without it; and a
    /// channel that bursts for a twentieth of the time.
    #[test]
    fn a_reading_that_stands_alone_is_found() {
        let mut state = 1_u64;
        let mut noise = || {
            let twelve = (0..12).map(|_| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                (state >> 40) as f64 / f64::from(1 << 24)
            });
            (twelve.sum::<f64>() - 6.0) as f32
        };
        let mut samples: Vec<f32> = (0..10_000).map(|_| noise()).collect();
        assert_eq!(of(&samples).outlier(), None);
        for (reading, crest, share) in [(-40.0, 37.1, 0.138), (1e20, 100.0, 1.0)] {
            samples[4321] = reading;
            let outlier = of(&samples).outlier().unwrap();
            assert_eq!((outlier.sample, outlier.reading), (4321, reading));
            // 40 over the root of 1 + 40²/10⁴, and the square of this over 10⁴, within three deviations of the RMS by
            // itself; √N of one that is all.
            assert!((outlier.crest / crest - 1.0).abs() < 0.025, "{outlier:?}");
            assert!((outlier.share / share - 1.0).abs() < 0.05, "{outlier:?}");
        }
        let burst: Vec<f32> = (0..10_000)
            .map(|n| if n < 500 { noise() } else { 0.0 })
            .collect();
        assert_eq!(of(&burst).outlier(), None);
    }
}
