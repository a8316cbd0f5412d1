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

/// Powers of one channel, which are zero until its variance is known.
pub(super) struct Powers {
    /// Number of the channel.
    pub(super) of: usize,
    /// Number of the channel of each power.
    pub(super) to: Vec<(usize, Power)>,
    samples: u64,
    total: f64,
    squares: f64,
    mean: f64,
    /// 1 / m, 1 / √m and 3: all zero of a channel that does not move.
    per_variance: f64,
    per_deviation: f64,
    linear: f64,
}

impl Powers {
    pub(super) fn new(of: usize, to: (usize, Power)) -> Self {
        Self {
            of,
            to: vec![to],
            samples: 0,
            total: 0.0,
            squares: 0.0,
            mean: 0.0,
            per_variance: 0.0,
            per_deviation: 0.0,
            linear: 0.0,
        }
    }

    /// Writes the powers of a sample, beside which it lies.
    #[inline]
    pub(super) fn write(&mut self, sample: &mut [f32]) {
        let own = f64::from(sample.get(self.of).copied().unwrap_or_default());
        let x = own - self.mean;
        let square = x * x;
        for (channel, power) in &self.to {
            let power = match power {
                Power::Square => square * self.per_deviation,
                Power::Cube => x * (square * self.per_variance - self.linear),
            };
            let power = power as f32;
            if let Some(slot) = sample.get_mut(*channel) {
                *slot = if power.is_finite() { power } else { 0.0 };
            }
        }
        self.total += own;
        self.squares += square;
        self.samples += 1;
        if self.samples.is_multiple_of(EVERY) {
            self.settle();
        }
    }

    /// Squares are about the mean that was known at their time.
    #[cold]
    fn settle(&mut self) {
        let samples = self.samples as f64;
        self.mean = self.total / samples;
        if self.samples == EVERY {
            self.squares -= self.total * self.mean;
        }
        let variance = self.squares / samples;
        let moves = variance > 0.0 && variance.is_finite();
        (self.per_variance, self.linear) = if moves {
            (1.0 / variance, 3.0)
        } else {
            (0.0, 0.0)
        };
        self.per_deviation = self.per_variance.sqrt();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::Draws;

    /// Normal samples about an offset: means of the powers, of their squares and of their products with the sample are
    /// those of Hermite's polynomials. The cube's square has a variance of (10170 - 36) / n.
    #[test]
    fn powers_of_normal_samples_are_hermites() {
        let mut rng = Draws::new(5);
        let mut powers = Powers::new(0, (1, Power::Square));
        powers.to.push((2, Power::Cube));
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

    /// A channel that does not move, or moves out of all bounds, has no powers.
    #[test]
    fn powers_are_finite() {
        for channel in [
            &[5.0_f32; 200][..],
            &[f32::MAX, -f32::MAX].repeat(100),
            &[0.0; 200],
        ] {
            let mut powers = Powers::new(0, (1, Power::Cube));
            powers.to.push((2, Power::Square));
            for x in channel {
                let mut sample = [*x, 0.0, 0.0];
                powers.write(&mut sample);
                assert!(sample[1].is_finite() && sample[2].is_finite(), "{sample:?}");
            }
        }
    }
}
