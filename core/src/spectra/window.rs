//! Windows as cosine sums, applied in the frequency domain.
//!
//! `w(n) = c₀ - c₁ cos(2πn/N) + c₂ cos(4πn/N) - …` needs no table and no pass over the
//! samples: a cosine is two lines of the spectrum, so windowing is a short convolution
//! over the lines that are kept, and only those.

use crate::cells::cells;

/// A window, periodic in the block length N.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Window {
    /// None: for signals periodic in the block.
    Rectangular,
    /// Hann's: the one for random excitation.
    #[default]
    Hann,
    /// Hamming's.
    Hamming,
    /// Blackman's, three terms.
    Blackman,
    /// Blackman and Harris's of four terms: side lobes below -92 dB.
    BlackmanHarris,
    /// The flat top of ISO 18431-2, for amplitudes of single tones.
    FlatTop,
}

/// Most cosine terms of a window.
const TERMS: usize = 5;

impl Window {
    /// Magnitudes c₀, c₁, … of the cosine terms.
    #[must_use]
    pub(crate) const fn coefficients(self) -> &'static [f32] {
        match self {
            Self::Rectangular => &[1.0],
            Self::Hann => &[0.5, 0.5],
            Self::Hamming => &[0.54, 0.46],
            Self::Blackman => &[0.42, 0.5, 0.08],
            Self::BlackmanHarris => &[0.358_75, 0.488_29, 0.141_28, 0.011_68],
            Self::FlatTop => &[
                0.215_578_95,
                0.416_631_58,
                0.277_263_16,
                0.083_578_947,
                0.006_947_368,
            ],
        }
    }

    /// Lines on either side that a windowed line is made of.
    #[must_use]
    pub const fn reach(self) -> usize {
        self.coefficients().len() - 1
    }

    /// Value at phase `t`, 0 to 1 over the block.
    #[must_use]
    pub(crate) fn value(self, t: f64) -> f64 {
        let mut sign = 1.0;
        let mut w = 0.0;
        for (i, &c) in self.coefficients().iter().enumerate() {
            w += sign * f64::from(c) * libm::cos(2.0 * core::f64::consts::PI * i as f64 * t);
            sign = -sign;
        }
        w
    }

    /// Mean of w², the factor of a windowed auto power.
    #[must_use]
    pub(crate) fn power(self) -> f64 {
        let [mean, others @ ..] = self.terms();
        mean * mean + others.iter().map(|c| c * c).sum::<f64>() / 2.0
    }

    /// Magnitudes of the cosine terms, those that it has not zero.
    fn terms(self) -> [f64; TERMS] {
        let mut terms = [0.0; TERMS];
        for (term, c) in terms.iter_mut().zip(self.coefficients()) {
            *term = f64::from(*c);
        }
        terms
    }

    /// Variance of a mean over neighbouring lines relative to that over
    /// independent lines: `N Σw⁴ / (Σw²)²`.
    ///
    /// The window makes neighbouring lines resemble each other. A frequency response's
    /// error is noise times conjugate drive, so its correlation between lines is the
    /// square of that of white noise under w², and the squares sum to this ratio
    /// (Parseval). 35/18 = 1.94 for Hann, whatever the overlap.
    #[must_use]
    pub(crate) fn line_correlation(self) -> f64 {
        let power = self.power();
        // The signs of the terms alternate, which is a shift by half a block: without them the
        // square has the same power. Its terms are sums over pairs that add up or differ.
        let terms = self.terms();
        let mut square = [0.0; 2 * TERMS - 1];
        for (i, a) in terms.iter().enumerate() {
            for (j, b) in terms.iter().enumerate() {
                if *a != 0.0 && *b != 0.0 {
                    for at in [i + j, i.abs_diff(j)] {
                        cells(&mut square[..])[at] += a * b / 2.0;
                    }
                }
            }
        }
        let [mean, others @ ..] = square;
        let squares = others.iter().map(|c| c * c).sum::<f64>();
        (mean * mean + squares / 2.0) / (power * power)
    }

    /// Variance of a mean over blocks `hop / N` apart relative to that over
    /// independent blocks: `1 + 2 Σ ρ²`, with ρ the correlation of the overlapping
    /// windows (Welch 1967). 1.06 for Hann at half overlap.
    #[must_use]
    pub fn block_correlation(self, hop: f64) -> f64 {
        let power = self.power();
        let mut factor = 1.0;
        let mut lag = hop;
        while hop > 0.0 && lag < 1.0 {
            let overlap = self.mean(
                |w, shifted| {
                    if let Some(s) = shifted { w * s } else { 0.0 }
                },
                lag,
            );
            factor += 2.0 * (overlap / power) * (overlap / power);
            lag += hop;
        }
        factor
    }

    /// Mean over the block of `f(w(t), w(t + lag))`, the second `None` past the end.
    /// 256 points are exact for the fourth power of the longest of these cosine sums.
    fn mean(self, f: impl Fn(f64, Option<f64>) -> f64, lag: f64) -> f64 {
        const POINTS: usize = 256;
        let mut sum = 0.0;
        for i in 0..POINTS {
            let t = i as f64 / POINTS as f64;
            let shifted = (t + lag < 1.0).then(|| self.value(t + lag));
            sum += f(self.value(t), shifted);
        }
        sum / POINTS as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hann_has_its_closed_forms() {
        let w = Window::Hann;
        // Averages of cos⁰ to cos⁸: 3/8, 35/128, and at half overlap a correlation of 1/6.
        assert!((w.power() - 0.375).abs() < 1e-14);
        assert!((w.line_correlation() - 35.0 / 18.0).abs() < 1e-13);
        assert!((w.block_correlation(0.5) - (1.0 + 2.0 / 36.0)).abs() < 1e-13);
    }

    #[test]
    fn a_rectangle_correlates_nothing() {
        assert_eq!(Window::Rectangular.line_correlation(), 1.0);
        assert_eq!(Window::Rectangular.block_correlation(1.0), 1.0);
        // Half the samples shared: ρ = 1/2.
        assert!((Window::Rectangular.block_correlation(0.5) - 1.5).abs() < 1e-14);
    }
}
