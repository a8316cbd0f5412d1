//! Samples without faults, many at a time, in single precision.

use super::Recording;

impl Recording {
    /// The next samples one after the other, in the order of the channels asked for, as far as they have been read,
    /// have no faults and are in step; none where [`Recording::next_row`] has to look at the next one.
    pub(crate) fn good_rows(&mut self) -> &[f32] {
        let ends = self.limit.is_some_and(|limit| self.rows >= limit);
        let changed = self.alignment.is_some() || self.coupling.is_some();
        if changed || self.channels == 0 || ends {
            return &[];
        }
        if self.taken == self.block.len() {
            if self.pending.is_some() {
                return &[];
            }
            match self.refill() {
                Ok(true) => {}
                Ok(false) => return &[],
                Err(error) => {
                    self.pending = Some(error);
                    return &[];
                }
            }
        }
        if self.block.is_faulty() {
            return &[];
        }
        self.factors.resize(self.channels, 1.0);
        let width = self.selected.len().max(1);
        let readings = self.block.readings(self.taken);
        if !singles(readings, width, &self.factors, &mut self.singles) {
            return &[];
        }
        let before = self.rows;
        for row in readings.chunks_exact(width) {
            let time = row.get(self.channels);
            if time.is_some_and(|time| !self.is_due(*time)) {
                break;
            }
            self.rows += 1;
        }
        let count = (self.rows - before) as usize;
        self.taken += count;
        self.singles.truncate(count * self.channels);
        if let Some(last) = self.taken.checked_sub(1)
            && let Some((_, place, health)) = self.block.sample(last)
        {
            (self.place, self.health) = (place, health);
        }
        &self.singles
    }
}

/// Writes the readings of the first `factors.len()` channels of samples of `width` readings, times these factors, in
/// single precision, sample by sample. `false` if one of the readings is not finite there.
fn singles(readings: &[f64], width: usize, factors: &[f64], into: &mut Vec<f32>) -> bool {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return simd.vectorize(Singles(readings, width, factors, into));
    }
    each(readings, width, factors, into)
}

#[inline(always)]
fn each(readings: &[f64], width: usize, factors: &[f64], into: &mut Vec<f32>) -> bool {
    let count = readings.len() / width.max(1);
    // What is left of earlier samples is written over.
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

/// [`singles`] with these instructions.
#[cfg(target_arch = "x86_64")]
struct Singles<'a>(&'a [f64], usize, &'a [f64], &'a mut Vec<f32>);

#[cfg(target_arch = "x86_64")]
impl pulp::NullaryFnOnce for Singles<'_> {
    type Output = bool;

    #[inline(always)]
    fn call(self) -> bool {
        let Self(readings, width, factors, into) = self;
        each(readings, width, factors, into)
    }
}
