//! Readings of samples in single precision, many at a time.

/// Writes the readings of the first `factors.len()` channels of samples of `width` readings, times these factors, in
/// single precision, sample by sample. `false` if one of the readings is not finite there.
pub(super) fn of(readings: &[f64], width: usize, factors: &[f64], into: &mut Vec<f32>) -> bool {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return simd.vectorize(Of(readings, width, factors, into));
    }
    each(readings, width, factors, into)
}

#[inline(always)]
fn each(readings: &[f64], width: usize, factors: &[f64], into: &mut Vec<f32>) -> bool {
    let count = readings.len() / width.max(1);
    into.resize(count * factors.len(), 0.0);
    let samples = readings.chunks_exact(width.max(1));
    let mut finite = true;
    for (sample, slots) in samples.zip(into.chunks_exact_mut(factors.len().max(1))) {
        for ((reading, factor), slot) in sample.iter().zip(factors).zip(slots) {
            finite &= (*reading as f32).is_finite();
            *slot = (reading * factor) as f32;
        }
    }
    finite
}

/// [`of`] with these instructions.
#[cfg(target_arch = "x86_64")]
struct Of<'a>(&'a [f64], usize, &'a [f64], &'a mut Vec<f32>);

#[cfg(target_arch = "x86_64")]
impl pulp::NullaryFnOnce for Of<'_> {
    type Output = bool;

    #[inline(always)]
    fn call(self) -> bool {
        let Self(readings, width, factors, into) = self;
        each(readings, width, factors, into)
    }
}
