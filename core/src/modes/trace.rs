//! One scalar function of frequency with a weight for each line.

use nalgebra::Complex;

/// A scalar function in which the poles are looked for, and how far each line is to be
/// trusted.
///
/// It is kept in single precision, which is far finer than the spectra that it is computed from
/// scatter, and which the chip has in hardware.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trace<'w> {
    lines: &'w [Complex<f64>],
}

/// A line of a trace.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TraceLine {
    /// The value.
    pub value: Complex<f32>,
    /// Inverse of the squared error that the value may have.
    pub weight: f32,
    /// Frequency, Hz.
    pub frequency: f32,
}

/// Lines on either side over which scatter is judged.
const NEIGHBOURS: usize = 3;

impl<'w> Trace<'w> {
    /// Takes the values from the first half of `work`, at the frequencies (Hz) that are given, and
    /// leaves the trace in the second.
    ///
    /// A line counts by the inverse square of what it may be wrong by: the scatter of
    /// its neighbourhood (second differences, which a smooth curve hardly has, but noise
    /// and the leakage of a sharp resonance do), and a share of its own size, so that the
    /// lines below a resonance count as much as the resonance itself.
    #[must_use]
    pub fn new(work: &'w mut [Complex<f64>], frequency: &dyn Fn(usize) -> f64) -> Self {
        let (values, lines) = work.split_at_mut(work.len() / 2);
        let lines = lines.get_mut(..values.len()).unwrap_or_default();
        for (line, (kept, value)) in lines.iter_mut().zip(values.iter()).enumerate() {
            *kept = packed(&TraceLine {
                value: Complex::new(value.re as f32, value.im as f32),
                weight: 0.0,
                frequency: frequency(line) as f32,
            });
        }
        let count = values.len();
        let floor = 0.02 * mean_size(&Trace { lines });
        for line in 0..count {
            let trace = Trace { lines };
            let second = |line: usize| {
                let at = |k: usize| trace.at(k).value;
                let d = at(line + 1) - at(line) * 2.0 + at(line - 1);
                // The variance of 1, -2, 1 is six.
                d.norm_sqr() / 6.0
            };
            let from = line.saturating_sub(NEIGHBOURS).max(1);
            let to = (line + NEIGHBOURS + 1).min(count.saturating_sub(1));
            let inside = to.saturating_sub(from).max(1) as f32;
            let scatter = (from..to).map(second).sum::<f32>() / inside;
            let mut own = trace.at(line);
            let size = 0.02 * modulus(&own.value) + floor;
            own.weight = 1.0 / (scatter + size * size);
            if let Some(kept) = lines.get_mut(line) {
                *kept = packed(&own);
            }
        }
        Self { lines }
    }

    /// Number of lines.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// All lines, in ascending order.
    #[inline]
    pub fn lines(&self) -> impl Iterator<Item = TraceLine> + '_ {
        self.lines.iter().map(unpacked)
    }

    /// A line, all zero beyond the last.
    #[must_use]
    pub fn at(&self, line: usize) -> TraceLine {
        self.lines.get(line).map(unpacked).unwrap_or_default()
    }

    /// Inverse of the squared error that a line may have, zero beyond the last.
    #[must_use]
    pub fn weight(&self, line: usize) -> f64 {
        self.at(line).weight.into()
    }
}

/// Two numbers in the place of one of twice their size.
#[inline]
fn pair(first: f32, second: f32) -> f64 {
    f64::from_bits(u64::from(second.to_bits()) << 32 | u64::from(first.to_bits()))
}

/// The numbers of a [`pair`].
#[inline]
fn halves(both: f64) -> [f32; 2] {
    let bits = both.to_bits();
    [bits as u32, (bits >> 32) as u32].map(f32::from_bits)
}

#[inline]
fn packed(line: &TraceLine) -> Complex<f64> {
    Complex::new(
        pair(line.value.re, line.value.im),
        pair(line.weight, line.frequency),
    )
}

#[inline]
fn unpacked(kept: &Complex<f64>) -> TraceLine {
    let ([re, im], [weight, frequency]) = (halves(kept.re), halves(kept.im));
    TraceLine {
        value: Complex::new(re, im),
        weight,
        frequency,
    }
}

fn modulus(z: &Complex<f32>) -> f32 {
    libm::sqrtf(z.norm_sqr())
}

/// Mean size of the lines, with a resonance counting no more than its share of them.
fn mean_size(trace: &Trace<'_>) -> f32 {
    let n = trace.len().max(1) as f32;
    let roots: f32 = trace.lines().map(|t| libm::sqrtf(modulus(&t.value))).sum();
    (roots / n) * (roots / n)
}
