//! Powers of signals about their mean, sample by sample.

/// A power of a signal x about its mean, in the unit of x, where m is its variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Power {
    /// `x² / √m`, such as a stiffness that differs between push and pull adds it.
    Square,
    /// `(x³ - 3 m x) / m`, such as a stiffness that changes with the force adds it, without its part that is linear in
    /// normal samples and in noise.
    Cube,
}

impl Power {
    /// Both of them.
    pub(crate) const ALL: [Self; 2] = [Self::Square, Self::Cube];

    /// Root mean square of the power of normal samples, as a share of theirs.
    pub(super) fn of_normal(self) -> f64 {
        match self {
            Self::Square => 2.0_f64.sqrt(),
            Self::Cube => 6.0_f64.sqrt(),
        }
    }
}

/// Samples after which mean and variance are settled anew, from all samples so far.
const EVERY: u64 = 64;

/// Channels that are calculated together.
const LANES: usize = 8;

/// A number of each of these channels.
type Lanes = [f32; LANES];

/// Powers of a few channels, which are zero until their variances are known.
pub(super) struct Powers {
    /// Numbers of the channels.
    of: Vec<usize>,
    /// Place of a channel among these, power and number of the channel that it becomes.
    to: Vec<(usize, Power, usize)>,
    mean: Lanes,
    /// 1 / m, 1 / √m and 3: all zero of a channel that does not move.
    per_variance: Lanes,
    per_deviation: Lanes,
    linear: Lanes,
    /// Sums of deviations from the mean and of their squares, since it was settled.
    latest: u64,
    deviations: Lanes,
    squares: Lanes,
    /// Sums of samples and of squares up to then.
    samples: u64,
    totals: [[f64; 2]; LANES],
}

impl Powers {
    /// None yet.
    fn new() -> Self {
        Self {
            of: Vec::new(),
            to: Vec::new(),
            mean: [0.0; LANES],
            per_variance: [0.0; LANES],
            per_deviation: [0.0; LANES],
            linear: [0.0; LANES],
            latest: 0,
            deviations: [0.0; LANES],
            squares: [0.0; LANES],
            samples: 0,
            totals: [[0.0; 2]; LANES],
        }
    }

    /// Has the power of one channel written to another, by these or by others behind them.
    pub(super) fn add(all: &mut Vec<Self>, of: usize, power: Power, to: usize) {
        let known = all.iter().position(|own| own.of.contains(&of));
        let at = known.or_else(|| all.iter().position(|own| own.of.len() < LANES));
        let at = at.unwrap_or_else(|| {
            all.push(Self::new());
            all.len() - 1
        });
        let own = &mut all[at];
        let lane = own.of.iter().position(|other| *other == of);
        let lane = lane.unwrap_or_else(|| {
            own.of.push(of);
            own.of.len() - 1
        });
        own.to.push((lane, power, to));
    }

    /// Writes the powers of a sample, beside which it lies.
    #[inline]
    pub(super) fn write(&mut self, sample: &mut [f32]) {
        let mut own = self.mean;
        for (slot, of) in own.iter_mut().zip(&self.of) {
            *slot = sample.get(*of).copied().unwrap_or_default();
        }
        if self.samples + self.latest == 0 {
            // Squares of an offset would hide those of the motion in single precision.
            self.mean = own;
        }
        let (mut square, mut cube) = ([0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let x = own[i] - self.mean[i];
            let squared = x * x;
            square[i] = finite(squared * self.per_deviation[i]);
            cube[i] = finite(x * (squared * self.per_variance[i] - self.linear[i]));
            self.deviations[i] += x;
            self.squares[i] += squared;
        }
        for (lane, power, channel) in &self.to {
            let of = match power {
                Power::Square => &square,
                Power::Cube => &cube,
            };
            if let Some(slot) = sample.get_mut(*channel) {
                *slot = of[lane % LANES];
            }
        }
        self.latest += 1;
        if self.latest == EVERY {
            self.settle();
        }
    }

    /// Squares are about the mean that was known at their time.
    #[cold]
    fn settle(&mut self) {
        let latest = self.latest as f64;
        let is_first = self.samples == 0;
        self.samples += self.latest;
        self.latest = 0;
        let samples = self.samples as f64;
        for (i, [total, squares]) in self.totals.iter_mut().enumerate() {
            let deviations = f64::from(self.deviations[i]);
            *total += deviations + latest * f64::from(self.mean[i]);
            *squares += f64::from(self.squares[i]);
            if is_first {
                *squares -= deviations * deviations / latest;
            }
            let mean = *total / samples;
            let variance = *squares / samples;
            let per_variance = (1.0 / variance) as f32;
            let moves = variance > 0.0 && per_variance > 0.0 && per_variance.is_finite();
            let factors = match moves {
                true => (per_variance, (1.0 / variance.sqrt()) as f32, 3.0),
                false => (0.0, 0.0, 0.0),
            };
            self.mean[i] = mean as f32;
            (self.per_variance[i], self.per_deviation[i], self.linear[i]) = factors;
        }
        (self.deviations, self.squares) = ([0.0; LANES], [0.0; LANES]);
    }
}

/// Zero in place of what is no number.
#[inline(always)]
fn finite(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::Draws;

    /// Square and cube of channel 0 in channels 1 and 2.
    fn both() -> Powers {
        let mut all = Vec::new();
        Powers::add(&mut all, 0, Power::Square, 1);
        Powers::add(&mut all, 0, Power::Cube, 2);
        all.remove(0)
    }

    /// Normal samples about an offset: means of the powers, of their squares and of their products with the sample are
    /// those of Hermite's polynomials. The cube's square has a variance of (10170 - 36) / n.
    #[test]
    fn powers_of_normal_samples_are_hermites() {
        let mut rng = Draws::new(5);
        let mut powers = both();
        let (offset, deviation, count) = (900.0, 7.0, 400_000);
        let mut sums = [[0.0; 2]; 3];
        for n in 0..count {
            let x = deviation * rng.normal();
            let mut sample = [(offset + x) as f32, 0.0, 0.0];
            powers.write(&mut sample);
            if n < 1000 {
                continue;
            }
            for (power, sum) in [1, 2].into_iter().zip(0..) {
                let y = f64::from(sample[power]) / deviation;
                sums[0][sum] += y;
                sums[1][sum] += y * y;
                sums[2][sum] += y * x / deviation;
            }
        }
        let count = f64::from(count - 1000);
        let [means, squares, products] = sums.map(|of| of.map(|sum: f64| sum / count));
        // Four standard deviations each; the first 64 samples of the mean and the variance matter a tenth of that.
        let limit = |variance: f64| 4.0 * (variance / count).sqrt() + 1e-3;
        assert!((means[0] - 1.0).abs() < limit(2.0), "{means:?}");
        assert!(means[1].abs() < limit(6.0), "{means:?}");
        assert!((squares[0] - 3.0).abs() < limit(96.0), "{squares:?}");
        assert!((squares[1] - 6.0).abs() < limit(10134.0), "{squares:?}");
        assert!(products[0].abs() < limit(15.0), "{products:?}");
        assert!(products[1].abs() < limit(42.0), "{products:?}");
    }

    /// The variance of the first samples is theirs, whatever the offset: in single precision squares of the offset
    /// would be off by more than all of it.
    #[test]
    fn an_offset_does_not_hide_the_variance() {
        let mut rng = Draws::new(7);
        let mut powers = both();
        let samples: Vec<f32> = (0..EVERY)
            .map(|_| (1e5 + 7.0 * rng.normal()) as f32)
            .collect();
        for x in &samples {
            powers.write(&mut [*x, 0.0, 0.0]);
        }
        let count = EVERY as f64;
        let mean = samples.iter().map(|x| f64::from(*x)).sum::<f64>() / count;
        let squares = samples.iter().map(|x| (f64::from(*x) - mean).powi(2));
        let deviation = (squares.sum::<f64>() / count).sqrt();
        let mut sample = [(mean + 20.0) as f32, 0.0, 0.0];
        powers.write(&mut sample);
        let x = f64::from(sample[0]) - mean;
        // The mean is rounded to 4e-3 of 20, twice in the square.
        let ratio = f64::from(sample[1]) * deviation / (x * x);
        assert!((ratio - 1.0).abs() < 4e-4, "{ratio}");
    }

    /// A channel that does not move, or moves out of all bounds, has no powers.
    #[test]
    fn powers_are_finite() {
        for channel in [
            &[5.0_f32; 200][..],
            &[f32::MAX, -f32::MAX].repeat(100),
            &[0.0; 200],
        ] {
            let mut powers = both();
            for x in channel {
                let mut sample = [*x, 0.0, 0.0];
                powers.write(&mut sample);
                assert!(sample[1].is_finite() && sample[2].is_finite(), "{sample:?}");
            }
        }
    }

    /// Each channel has its own powers, however many there are.
    #[test]
    fn channels_beside_others_have_the_powers_of_one() {
        const CHANNELS: usize = 19;
        let mut all = Vec::new();
        for c in (0..CHANNELS).rev() {
            Powers::add(&mut all, c, Power::Cube, CHANNELS + c);
        }
        for c in 0..CHANNELS {
            Powers::add(&mut all, c, Power::Square, 2 * CHANNELS + c);
        }
        assert_eq!(all.len(), CHANNELS.div_ceil(LANES));
        let mut alone: Vec<Powers> = (0..CHANNELS).map(|_| both()).collect();
        let mut rng = Draws::new(6);
        for _ in 0..300 {
            let mut sample = [0.0; 3 * CHANNELS];
            for (c, slot) in sample.iter_mut().take(CHANNELS).enumerate() {
                *slot = (c as f64 * (3.0 + rng.normal())) as f32;
            }
            all.iter_mut().for_each(|own| own.write(&mut sample));
            for (c, own) in alone.iter_mut().enumerate() {
                let mut of_one = [sample[c], 0.0, 0.0];
                own.write(&mut of_one);
                let [_, square, cube] = of_one;
                assert_eq!(
                    (sample[2 * CHANNELS + c], sample[CHANNELS + c]),
                    (square, cube)
                );
            }
        }
    }
}
