//! Unwindowed transforms of whole records.

use nalgebra::Complex;
use rustfft::FftPlanner;

/// Lines of the unwindowed transforms of some signals.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines {
    /// Frequencies, Hz.
    pub frequencies: Vec<f64>,
    /// Amplitudes `Σ x exp(-j 2π k n / N) / √N`, one list a signal. White noise of variance σ² has
    /// `E |x|² = σ²` in each line.
    pub signals: Vec<Vec<Complex<f64>>>,
}

/// Transforms real signals of one length, sampled at `rate` Hz, and keeps the lines in `band` (Hz).
/// The line at 0 Hz and those from half the sample rate on are left out.
#[must_use]
pub fn transform(signals: &[Vec<f32>], rate: f64, band: [f64; 2]) -> Lines {
    let count = signals.iter().map(Vec::len).min().unwrap_or(0);
    let spacing = rate / count.max(1) as f64;
    let first = ((band[0] / spacing).ceil() as usize).max(1);
    let last = ((band[1] / spacing).floor() as usize).min(count.saturating_sub(1) / 2);
    let kept = first..(last + 1).max(first);
    let mut lines = Lines {
        frequencies: kept.clone().map(|k| k as f64 * spacing).collect(),
        signals: Vec::with_capacity(signals.len()),
    };
    if kept.is_empty() {
        lines.signals.resize(signals.len(), Vec::new());
        return lines;
    }
    let plan = FftPlanner::<f64>::new().plan_fft_forward(count);
    let mut work = vec![Complex::default(); plan.get_inplace_scratch_len()];
    let scale = 0.5 / (count as f64).sqrt();
    for pair in signals.chunks(2) {
        // Two real signals share one complex transform.
        let (a, b) = (&pair[0], pair.get(1));
        let value = |n: usize| {
            let other = b.map_or(0.0, |b| f64::from(b[n]));
            Complex::new(f64::from(a[n]), other)
        };
        let mut buffer: Vec<Complex<f64>> = (0..count).map(value).collect();
        plan.process_with_scratch(&mut buffer, &mut work);
        let both = |k: usize| (buffer[k], buffer[count - k].conj());
        let of_first = kept.clone().map(|k| {
            let (x, y) = both(k);
            (x + y) * scale
        });
        lines.signals.push(of_first.collect());
        if b.is_some() {
            let of_second = kept.clone().map(|k| {
                let (x, y) = both(k);
                (x - y) * Complex::new(0.0, -scale)
            });
            lines.signals.push(of_second.collect());
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_the_definition() {
        const N: usize = 31;
        let signals: Vec<Vec<f32>> = (0..3)
            .map(|s| (0..N).map(|n| ((n * n * (s + 2)) % 17) as f32).collect())
            .collect();
        let lines = transform(&signals, 31.0, [2.0, 9.5]);
        assert_eq!(lines.frequencies.len(), 8);
        for (signal, found) in signals.iter().zip(&lines.signals) {
            for (frequency, x) in lines.frequencies.iter().zip(found) {
                let slow: Complex<f64> = (0..N)
                    .map(|n| {
                        let angle = -2.0 * std::f64::consts::PI * frequency * n as f64 / N as f64;
                        Complex::from_polar(f64::from(signal[n]), angle)
                    })
                    .sum();
                // 31 terms up to 17, whose angles carry some 100 roundings of π: 1e-11.
                assert!((x - slow / (N as f64).sqrt()).norm() < 1e-11);
            }
        }
    }

    #[test]
    fn too_short_a_record_has_no_lines() {
        assert!(
            transform(&[Vec::new()], 1.0, [0.1, 1.0])
                .frequencies
                .is_empty()
        );
        assert!(
            transform(&[vec![1.0; 4]], 4.0, [3.0, 9.0])
                .frequencies
                .is_empty()
        );
    }
}
