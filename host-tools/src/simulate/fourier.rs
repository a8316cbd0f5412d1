//! An inverse Fourier transform with the same bits on every machine.
//!
//! FFT libraries choose their kernels by the processor and take sine and cosine from the
//! system; both move the last bit of a sample. This one is the plain radix-2 algorithm with
//! twiddle factors from the `libm` crate, quick enough for recordings of minutes.

use nalgebra::Complex;

/// Plan for one length.
pub(super) struct Fourier {
    /// exp(j 2π k / N) for k below N/2.
    twiddles: Vec<Complex<f64>>,
}

impl Fourier {
    /// For transforms of `length` points, a power of two and at least 2.
    pub(super) fn new(length: usize) -> Self {
        debug_assert!(length.is_power_of_two() && length >= 2);
        let step = 2.0 * std::f64::consts::PI / length as f64;
        let twiddles = (0..length / 2)
            .map(|k| {
                let (sin, cos) = libm::sincos(step * k as f64);
                Complex::new(cos, sin)
            })
            .collect();
        Self { twiddles }
    }

    /// x_n = Σ_k X_k exp(j 2π k n / N), in place and without a factor 1/N.
    pub(super) fn inverse(&self, data: &mut [Complex<f64>]) {
        let length = 2 * self.twiddles.len();
        debug_assert_eq!(data.len(), length);
        let shift = usize::BITS - length.trailing_zeros();
        for index in 0..length {
            let mirrored = index.reverse_bits() >> shift;
            if index < mirrored {
                data.swap(index, mirrored);
            }
        }
        let mut half = 1;
        while half < length {
            let stride = self.twiddles.len() / half;
            for block in data.chunks_exact_mut(2 * half) {
                let (lower, upper) = block.split_at_mut(half);
                let twiddles = self.twiddles.iter().step_by(stride);
                for ((a, b), twiddle) in lower.iter_mut().zip(upper).zip(twiddles) {
                    let turned = *b * twiddle;
                    (*a, *b) = (*a + turned, *a - turned);
                }
            }
            half *= 2;
        }
    }

    /// Two real signals from the lines 0 to N/2 of their spectra, Nyquist and DC real.
    /// One complex transform serves both: the second rides along as the imaginary part.
    pub(super) fn real_pair(
        &self,
        first: &[Complex<f64>],
        second: &[Complex<f64>],
        buffer: &mut Vec<Complex<f64>>,
    ) {
        let length = 2 * self.twiddles.len();
        buffer.clear();
        buffer.resize(length, Complex::default());
        for (line, (a, b)) in first.iter().zip(second).enumerate() {
            buffer[line] = Complex::new(a.re - b.im, a.im + b.re);
            if line != 0 && 2 * line != length {
                buffer[length - line] = Complex::new(a.re + b.im, b.re - a.im);
            }
        }
        self.inverse(buffer);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_the_definition() {
        const N: usize = 16;
        let spectrum: Vec<_> = (0..N)
            .map(|k| Complex::new(1.0 / (1 + k) as f64, (k * k % 7) as f64 - 3.0))
            .collect();
        let mut fast = spectrum.clone();
        Fourier::new(N).inverse(&mut fast);
        for (n, found) in fast.iter().enumerate() {
            let slow: Complex<f64> = (0..N)
                .map(|k| {
                    let angle = 2.0 * std::f64::consts::PI * (k * n % N) as f64 / N as f64;
                    spectrum[k] * Complex::new(angle.cos(), angle.sin())
                })
                .sum();
            // Sixteen terms up to 3: 16 · 3 · ε each way.
            assert!((found - slow).l1_norm() < 1e-13);
        }
    }

    #[test]
    fn two_cosines_come_back_apart() {
        const N: usize = 32;
        let mut first = vec![Complex::default(); N / 2 + 1];
        let mut second = first.clone();
        first[3] = Complex::new(0.5, 0.0);
        second[5] = Complex::new(0.0, -0.5);
        let mut buffer = Vec::new();
        Fourier::new(N).real_pair(&first, &second, &mut buffer);
        for (n, sample) in buffer.iter().enumerate() {
            let phase = 2.0 * std::f64::consts::PI * n as f64 / N as f64;
            assert!((sample.re - (3.0 * phase).cos()).abs() < 1e-14);
            assert!((sample.im - (5.0 * phase).sin()).abs() < 1e-14);
        }
    }
}
