//! Statistics of the channels, sample by sample, and a fingerprint of the whole run, which tells copies.

use super::ChannelHealth;

/// Collects [`ChannelHealth`] sample by sample, and a fingerprint of the whole run.
#[derive(Clone, Debug)]
pub struct Health {
    count: f64,
    /// Mean, and sum of squares about it, of each channel.
    means: Vec<f64>,
    squares: Vec<f64>,
    last: Vec<f32>,
    held: Vec<Stretches>,
    extremes: Vec<[Extreme; 2]>,
    /// Readings strictly between these change no extreme of their channel.
    inner: [Vec<f32>; 2],
    fingerprint: [u64; LANES],
}

/// Parts of a sample whose fingerprints are taken at a time.
const LANES: usize = 4;
/// Samples that are looked at together: most of their like change no extreme.
const TOGETHER: usize = 32;
/// Channels whose sums do not wait for each other.
const SIDE: usize = 8;

/// Adds a reading to a mean, and to the sum of squares about it; `count` is that of the readings with this one.
#[inline(always)]
fn add_moment(mean: &mut f64, squares: &mut f64, x: f64, count: f64) {
    let before = x - *mean;
    *mean += before / count;
    *squares += before * (x - *mean);
}

/// Adds a word to a fingerprint: odd factors lose no bit, and the turn brings high bits back to where they count.
#[inline(always)]
fn add_word(sum: &mut u64, word: u64) {
    *sum = (*sum ^ word)
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .rotate_left(29);
}

/// Readings of a channel that equal the one before.
#[derive(Clone, Copy, Debug, Default)]
struct Stretches {
    all: u64,
    /// Of them, those in a row up to now.
    now: u32,
    longest: u32,
    /// Number of the sample where the longest row of them begins.
    from: u64,
}

impl Stretches {
    /// Number of the reading, of some that come after this state and the reading `before`, that ends a row of `longest`.
    fn end(&self, longest: u32, mut before: f32, readings: impl Iterator<Item = f32>) -> u64 {
        let mut row = self.now;
        let mut rows = readings.map(|x| {
            row = if x == before { row + 1 } else { 0 };
            before = x;
            row
        });
        rows.position(|row| row == longest).unwrap_or(0) as u64
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Extreme {
    value: f32,
    /// Number of the first sample that has it.
    at: u64,
    samples: u64,
    in_a_row: u64,
    /// The next reading inwards and its samples; none of them while there is no other.
    next: f32,
    next_samples: u64,
}

impl Extreme {
    /// Takes the reading of sample `at`; `beyond(a, b)` is `true` if `a` lies further out than `b`.
    fn see(&mut self, value: f32, at: u64, beyond: fn(&f32, &f32) -> bool, previous: Option<f32>) {
        if previous.is_none() || beyond(&value, &self.value) {
            *self = Self {
                value,
                at,
                samples: 1,
                in_a_row: 0,
                next: self.value,
                next_samples: self.samples,
            };
        } else if value == self.value {
            self.samples += 1;
            if previous == Some(value) {
                self.in_a_row += 1;
            }
        } else if self.next_samples == 0 || beyond(&value, &self.next) {
            self.next = value;
            self.next_samples = 1;
        } else if value == self.next {
            self.next_samples += 1;
        }
    }
}

/// [`Health::add_all`] with these instructions.
#[cfg(target_arch = "x86_64")]
struct AddAll<'a>(&'a mut Health, &'a [f32]);

#[cfg(target_arch = "x86_64")]
impl pulp::NullaryFnOnce for AddAll<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self(health, samples) = self;
        health.add_each(samples);
    }
}

impl Health {
    /// Statistics of `channels` channels without samples.
    #[must_use]
    pub fn new(channels: usize) -> Self {
        Self {
            count: 0.0,
            means: vec![0.0; channels],
            squares: vec![0.0; channels],
            last: vec![0.0; channels],
            held: vec![Stretches::default(); channels],
            extremes: vec![Default::default(); channels],
            inner: [
                vec![f32::INFINITY; channels],
                vec![f32::NEG_INFINITY; channels],
            ],
            fingerprint: [0; LANES],
        }
    }

    /// Takes samples of all channels, one after the other.
    pub fn add_all(&mut self, samples: &[f32]) {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            return simd.vectorize(AddAll(self, samples));
        }
        self.add_each(samples);
    }

    /// Takes one sample of all channels.
    pub fn add(&mut self, sample: &[f32]) {
        self.add_each(sample);
    }

    #[inline(always)]
    fn add_each(&mut self, samples: &[f32]) {
        let channels = self.means.len().max(1);
        for samples in samples.chunks(TOGETHER * channels) {
            self.add_moments(samples, channels);
            if !self.are_inside(samples, channels) {
                self.add_outside(samples, channels);
            }
            for sample in samples.chunks_exact(channels) {
                self.count += 1.0;
                self.add_bits(sample);
            }
            if let Some(last) = samples.rchunks_exact(channels).next() {
                for (slot, x) in self.last.iter_mut().zip(last) {
                    *slot = *x;
                }
            }
        }
    }

    /// Sums up means and squares of samples, of many channels at a time: each sum waits for the one before it.
    #[inline(always)]
    fn add_moments(&mut self, samples: &[f32], channels: usize) {
        let mut at = 0;
        while at < channels {
            at = if channels - at > SIDE && channels >= 2 * SIDE {
                self.add_moments_from::<{ 2 * SIDE }>(samples, channels, at)
            } else if channels >= SIDE {
                self.add_moments_from::<SIDE>(samples, channels, at)
            } else {
                self.add_moments_from::<1>(samples, channels, at)
            };
        }
    }

    /// The same of `N` channels from `at` on, which moves back where fewer are left: those before `at` keep what they
    /// have. The number of the next channel.
    #[inline(always)]
    fn add_moments_from<const N: usize>(
        &mut self,
        samples: &[f32],
        channels: usize,
        at: usize,
    ) -> usize {
        let first = at.min(channels - N);
        let own = first..first + N;
        let means = self.means.get_mut(own.clone());
        let squares = self.squares.get_mut(own.clone());
        let held = self.held.get_mut(own.clone());
        let last = self.last.get(own.clone());
        if let Some(means) = means.and_then(|means| means.first_chunk_mut::<N>())
            && let Some(squares) = squares.and_then(|squares| squares.first_chunk_mut::<N>())
            && let Some(held) = held.and_then(|held| held.first_chunk_mut::<N>())
            && let Some(last) = last.and_then(|last| last.first_chunk::<N>())
        {
            let (mut mean, mut square, mut count) = (*means, *squares, self.count);
            // Nothing equals the first reading before it.
            let mut before = if count > 0.0 { *last } else { [f32::NAN; N] };
            let (mut same, mut now) = ([0_u32; N], held.map(|held| held.now));
            let mut longest = held.map(|held| held.longest);
            for sample in samples.chunks_exact(channels) {
                count += 1.0;
                let readings = sample.get(first..).and_then(|x| x.first_chunk::<N>());
                let Some(readings) = readings else {
                    break;
                };
                for ((mean, square), x) in mean.iter_mut().zip(&mut square).zip(readings) {
                    add_moment(mean, square, f64::from(*x), count);
                }
                let stretches = same.iter_mut().zip(&mut now).zip(&mut longest);
                for (((same, now), longest), (before, x)) in
                    stretches.zip(before.iter().zip(readings))
                {
                    let equal = u32::from(before == x);
                    *same += equal;
                    *now = now.wrapping_add(equal) * equal;
                    *longest = (*longest).max(*now);
                }
                before = *readings;
            }
            for (lane, held) in held.iter_mut().enumerate().skip(at - first) {
                let longest = longest.get(lane).copied().unwrap_or(0);
                if longest > held.longest {
                    let own = samples.iter().skip(first + lane).step_by(channels);
                    let before = match last.get(lane) {
                        Some(before) if self.count > 0.0 => *before,
                        _ => f32::NAN,
                    };
                    let end = self.count as u64 + held.end(longest, before, own.copied());
                    (held.longest, held.from) = (longest, end.saturating_sub(longest.into()));
                }
                held.all += u64::from(same.get(lane).copied().unwrap_or(0));
                held.now = now.get(lane).copied().unwrap_or(0);
            }
            let moments = mean.iter().zip(&square).skip(at - first);
            let slots = means.iter_mut().zip(squares).skip(at - first);
            for ((mean_slot, square_slot), (mean, square)) in slots.zip(moments) {
                (*mean_slot, *square_slot) = (*mean, *square);
            }
        }
        first + N
    }

    /// `true` if these samples change no extreme.
    #[inline(always)]
    fn are_inside(&self, samples: &[f32], channels: usize) -> bool {
        let samples = samples.chunks_exact(channels);
        let [(low, other_low), (high, other_high)] =
            [&self.inner[0], &self.inner[1]].map(|inner| inner.as_chunks::<SIDE>());
        let first_other = low.len() * SIDE;
        for (group, (low, high)) in low.iter().zip(high).enumerate() {
            let mut inside = [true; SIDE];
            for sample in samples.clone() {
                let Some(readings) = sample.as_chunks::<SIDE>().0.get(group) else {
                    break;
                };
                let bounds = inside.iter_mut().zip(low).zip(high).zip(readings);
                for (((inside, low), high), x) in bounds {
                    *inside &= (x > low) & (x < high);
                }
            }
            if inside.contains(&false) {
                return false;
            }
        }
        samples.into_iter().all(|sample| {
            let others = sample.get(first_other..).unwrap_or_default();
            let bounds = other_low.iter().zip(other_high).zip(others);
            bounds.fold(true, |all, ((low, high), x)| all & (x > low) & (x < high))
        })
    }

    /// Takes samples of which some may change an extreme.
    #[inline(never)] // Rare, once the extremes are known.
    fn add_outside(&mut self, samples: &[f32], channels: usize) {
        let last = std::mem::take(&mut self.last);
        let mut previous = (self.count > 0.0).then_some(last.as_slice());
        for (at, sample) in (self.count as u64..).zip(samples.chunks_exact(channels)) {
            if !self.are_inside(sample, channels) {
                self.add_extremes(sample, at, previous);
            }
            previous = Some(sample);
        }
        self.last = last;
    }

    fn add_extremes(&mut self, sample: &[f32], at: u64, previous: Option<&[f32]>) {
        let [low, high] = &mut self.inner;
        let inner = low.iter_mut().zip(high);
        let channels = self.extremes.iter_mut().zip(inner).zip(sample);
        for (channel, (([lowest, highest], (low, high)), &x)) in channels.enumerate() {
            let previous = previous.and_then(|p| p.get(channel)).copied();
            lowest.see(x, at, f32::lt, previous);
            highest.see(x, at, f32::gt, previous);
            if lowest.next_samples > 0 && highest.next_samples > 0 {
                (*low, *high) = (lowest.next, highest.next);
            }
        }
    }

    /// Adds a sample to the fingerprint.
    #[inline(always)]
    fn add_bits(&mut self, sample: &[f32]) {
        let (pairs, single) = sample.as_chunks::<2>();
        let (parts, rest) = pairs.as_chunks::<LANES>();
        let word = |[a, b]: &[f32; 2]| u64::from(a.to_bits()) << 32 | u64::from(b.to_bits());
        for part in parts {
            for (sum, pair) in self.fingerprint.iter_mut().zip(part) {
                add_word(sum, word(pair));
            }
        }
        let single = single.iter().map(|x| u64::from(x.to_bits()));
        let words = rest.iter().map(word).chain(single);
        for (sum, word) in self.fingerprint.iter_mut().zip(words) {
            add_word(sum, word);
        }
    }

    /// A number that two runs share only if all their samples agree, but for a chance of some 2⁻⁶⁴.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let turned = self.fingerprint.iter().zip([0, 17, 31, 47]);
        turned.fold(self.count.to_bits(), |all, (sum, turn)| {
            (all ^ sum.rotate_left(turn)).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        })
    }

    /// The statistics, channel by channel.
    #[must_use]
    pub fn channels(&self) -> Vec<ChannelHealth> {
        let moments = self.means.iter().zip(&self.squares);
        moments
            .zip(&self.extremes)
            .zip(&self.held)
            .map(|(((mean, squares), [low, high]), held)| {
                let worst = if low.samples > high.samples {
                    low
                } else {
                    high
                };
                ChannelHealth {
                    range: [low.value, high.value],
                    range_at: [low.at, high.at],
                    samples: self.count as u64,
                    rms: (squares / self.count.max(1.0)).sqrt(),
                    mean: *mean,
                    longest_held: (held.longest.into(), held.from),
                    held: held.all,
                    at_limit: [worst.samples, worst.in_a_row],
                    next_to_limit: worst.next_samples,
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_taken_together_are_those_taken_one_by_one() {
        for channels in [1, 7, 8, 30] {
            let samples: Vec<f32> = (0..channels * 500)
                .map(|i| ((i * i) as f32 * 0.1).sin().clamp(-0.9, 0.9))
                .collect();
            let (mut one, mut all) = (Health::new(channels), Health::new(channels));
            samples.chunks_exact(channels).for_each(|s| one.add(s));
            let (begin, end) = samples.split_at(channels * 77);
            all.add_all(begin);
            all.add_all(end);
            assert_eq!(all.channels(), one.channels());
            assert_eq!(all.fingerprint(), one.fingerprint());
            assert_eq!(all.channels().len(), channels);
        }
    }

    /// Beside the definitions, over all samples at once.
    #[test]
    fn statistics_are_those_of_their_definitions() {
        // Fewer than are summed up together, as many, and some more of each.
        for channels in [3, 8, 11, 16, 21, 27] {
            let samples: Vec<f32> = (0..channels * 500)
                .map(|i| ((i * i) as f32 * 0.1).sin().clamp(-0.9, 0.8))
                .collect();
            let mut health = Health::new(channels);
            health.add_all(&samples);
            for (channel, found) in health.channels().iter().enumerate() {
                let own: Vec<f32> = samples
                    .iter()
                    .skip(channel)
                    .step_by(channels)
                    .copied()
                    .collect();
                let (low, high) = own.iter().fold((f32::MAX, f32::MIN), |(low, high), x| {
                    (low.min(*x), high.max(*x))
                });
                assert_eq!(found.range, [low, high]);
                let rows = own.windows(2).map(|x| x[0] == x[1]);
                assert_eq!(found.held, rows.clone().filter(|same| *same).count() as u64);
                let (mut row, mut longest) = (0, (0, 0));
                for (at, same) in rows.enumerate() {
                    row = if same { row + 1 } else { 0 };
                    if row > longest.0 {
                        longest = (row, at as u64 + 1 - row);
                    }
                }
                assert_eq!(found.longest_held, longest);
                let first = |limit: f32| own.iter().position(|x| *x == limit).unwrap() as u64;
                assert_eq!(found.range_at, [first(low), first(high)]);
                let at = |limit: f32| own.iter().filter(|x| **x == limit).count() as u64;
                let in_a_row =
                    |limit: f32| own.windows(2).filter(|x| **x == [limit; 2]).count() as u64;
                let limit = if at(low) > at(high) { low } else { high };
                assert_eq!(found.at_limit, [at(limit), in_a_row(limit)]);
                let wide = own.iter().map(|x| f64::from(*x));
                let mean = wide.clone().sum::<f64>() / 500.0;
                let square = wide.map(|x| (x - mean).powi(2)).sum::<f64>() / 500.0;
                // 500 roundings of numbers up to one.
                assert!(
                    (found.mean - mean).abs() < 1e-13 && (found.rms - square.sqrt()).abs() < 1e-13
                );
            }
        }
    }

    #[test]
    fn one_different_bit_is_another_run() {
        let fingerprint = |x: f32| {
            let mut h = Health::new(1);
            h.add(&[1.0]);
            h.add(&[x]);
            h.fingerprint()
        };
        assert_eq!(fingerprint(2.0), fingerprint(2.0));
        assert_ne!(
            fingerprint(2.0),
            fingerprint(f32::from_bits(2.0_f32.to_bits() + 1))
        );
    }
}
