//! Low-pass filters of converters, as far as they tell inputs of different converters apart.

use core::f64::consts::TAU;

/// Low-pass filters behind an input: averages over a time each, a pole, and whatever delays beside them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lowpass {
    /// Delay of all of them together at low frequencies, s: a sample is of so much time ago.
    pub delay: f64,
    /// Averages: the time over which each is taken, s, and how often one follows the other.
    pub averages: [(f64, u8); 2],
    /// Time constant of the pole, s; zero without one.
    pub pole: f64,
}

impl Lowpass {
    /// Amplitude at a frequency, Hz, of a signal of amplitude one.
    #[must_use]
    pub fn magnitude(&self, frequency: f64) -> f64 {
        let mut magnitude = 1.0 / libm::hypot(1.0, TAU * frequency * self.pole);
        for (time, often) in self.averages {
            let x = 0.5 * TAU * frequency * time;
            let once = if x == 0.0 { 1.0 } else { libm::sin(x) / x };
            for _ in 0..often {
                magnitude *= once;
            }
        }
        magnitude
    }

    /// Phase lag at a frequency, Hz, in radians: averages delay all frequencies alike, a pole low ones
    /// longest.
    #[must_use]
    pub fn lag(&self, frequency: f64) -> f64 {
        let omega = TAU * frequency;
        omega * (self.delay - self.pole) + libm::atan(omega * self.pole)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drivers::{ads131m08, adxl355};
    use std::vec;
    use std::vec::Vec;

    /// The convolution of weights with an average of so many of them, a step apart.
    fn averaged(weights: &[f64], count: usize, step: usize) -> Vec<f64> {
        let mut result = vec![0.0; weights.len() + (count - 1) * step];
        for (k, weight) in weights.iter().enumerate() {
            for n in 0..count {
                result[k + n * step] += weight / count as f64;
            }
        }
        result
    }

    #[test]
    fn the_filters_of_the_ads131m08_are_averages_of_its_modulator() {
        let modulator = f64::from(ads131m08::CLOCK_HZ) / 2.0;
        for ratio in [128_usize, 512, 1024, 2048, 8192, 16384] {
            let rate = modulator / ratio as f64;
            let lowpass = ads131m08::lowpass(rate);
            let sinc3 = ratio.min(1024);
            let mut weights = vec![1.0];
            for _ in 0..3 {
                weights = averaged(&weights, sinc3, 1);
            }
            weights = averaged(&weights, ratio / sinc3, sinc3);
            for share in [0.01, 0.1, 0.25, 0.4] {
                let omega = TAU * share * rate / modulator;
                // The newest weight belongs to the time of the sample.
                let part = |trigonometric: fn(f64) -> f64| -> f64 {
                    let turned = (0..).map(|age| trigonometric(omega * f64::from(age)));
                    weights.iter().zip(turned).map(|(w, x)| w * x).sum()
                };
                let (re, im) = (part(f64::cos), part(f64::sin));
                let frequency = share * rate;
                // A sum of a hundred terms or more for an integral: its square, for three averages.
                let magnitude = lowpass.magnitude(frequency) / re.hypot(im);
                assert!(
                    (magnitude - 1.0).abs() < 1e-4,
                    "{ratio} {share}: {magnitude}"
                );
                // The middle of n weights is half a cycle before that of n cycles, for each of the averages.
                let late = (lowpass.lag(frequency) - im.atan2(re)).rem_euclid(TAU) / omega;
                assert!((late - 1.5).abs() < 1e-3, "{ratio} {share}: {late} cycles");
            }
        }
    }

    #[test]
    fn the_filters_of_the_adxl355_have_the_attenuation_of_its_data_sheet() {
        // At a quarter of their sample rate, dB.
        let table = [3.44, 2.21, 1.92, 1.83, 1.83, 1.83];
        for (halvings, attenuation) in (0..).zip(table) {
            let configuration = adxl355::Configuration {
                halvings,
                ..adxl355::Configuration::following(0.0)
            };
            let rate = 4000.0 / f64::from(1_u16 << halvings);
            let lowpass = configuration.lowpass();
            let found = -20.0 * lowpass.magnitude(rate / 4.0).log10();
            assert!((found - attenuation).abs() < 0.1, "{rate}: {found} dB");
            // Two averages and half a period until the sample is there, behind a quarter of a millisecond.
            let periods = (lowpass.delay - 0.25e-3) * rate;
            assert!((periods - 1.5).abs() < 0.04, "{rate}: {periods} periods");
        }
    }
}
