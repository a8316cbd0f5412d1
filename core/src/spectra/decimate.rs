//! Decimation by two, stage by stage, before the transform.
//!
//! The lines of interest lie far below half the sample rate. A quarter of the samples, and
//! of the memory, carries them as well as all of them do, if what would fold onto them is
//! filtered out first. All channels, the drive among them, pass the same linear-phase
//! filters, so responses and coherences do not notice, and the pass band is flat to 5e-6.
//!
//! The filters are half-band ones: every other coefficient is zero, the middle one is a
//! half. They are equiripple (Parks and McClellan), designed for a pass band up to
//! 25/64 of the output rate in the last stage and up to 25/128 in those before it: of 1024
//! samples a hundred lines.
//!
//! | stage | taps | pass band, of its input rate | stop band |
//! | --- | --- | --- | --- |
//! | last | 59 | 0.1953125, ripple 5e-6 | 0.3046875 and up, -107 dB |
//! | before | 19 | 0.09765625, ripple 3e-6 | 0.40234375 and up, -111 dB |
//!
//! A frequency that folds onto a line is uncorrelated with it, so it biases averaged spectra by its
//! power, 1e-10, and makes them scatter by its amplitude, 5e-6.

/// Share of the decimated block up to which lines may be kept: the pass band's edge.
pub(super) const USABLE: f64 = 25.0 / 64.0;
/// Most stages: a factor of sixteen.
pub(super) const MAX_STAGES: usize = 4;

const LAST_TAPS: usize = 59;
const EARLY_TAPS: usize = 19;

/// Coefficients at the distances 1, 3, 5, … from the middle, on either side.
const LAST: [f32; 15] = [
    3.166_449_4e-1,
    -1.012_022e-1,
    5.579_532_3e-2,
    -3.505_815_6e-2,
    2.292_485_5e-2,
    -1.503_574_8e-2,
    9.692_057e-3,
    -6.053_719e-3,
    3.619_395e-3,
    -2.045_211_4e-3,
    1.075_515_9e-3,
    -5.151_528e-4,
    2.171_971e-4,
    -7.557_232e-5,
    1.868_490_1e-5,
];
const EARLY: [f32; 5] = [
    3.058_903e-1,
    -7.373_881e-2,
    2.236_649_4e-2,
    -5.150_574_3e-3,
    6.338_563e-4,
];

/// Samples that a sum sees of those that came an even number of samples before: two a
/// coefficient. Of the odd ones it sees the middle one.
const LAST_EVENS: usize = 2 * LAST.len();
const EARLY_EVENS: usize = 2 * EARLY.len();
/// Even samples that a delay line has room for beyond these: the newest always lie in one
/// piece, and are moved only when it is full.
const SLACK: usize = 5;
/// Elements of a delay line: odd samples, as many as there are coefficients, then even ones.
const LAST_LINE: usize = LAST.len() + LAST_EVENS + SLACK;
const EARLY_LINE: usize = EARLY.len() + EARLY_EVENS + SLACK;

const _: () = assert!(2 * LAST_EVENS == LAST_TAPS + 1 && 2 * EARLY_EVENS == EARLY_TAPS + 1);
const _: () = assert!(LAST.len().is_multiple_of(5) && EARLY.len().is_multiple_of(5));

/// Elements of state that one channel needs.
pub(super) const fn state_len(stages: usize) -> usize {
    if stages == 0 {
        0
    } else {
        LAST_LINE + (stages - 1) * EARLY_LINE
    }
}

/// Input samples until the first output that does not see the start from rest.
pub(super) const fn settling(stages: usize) -> usize {
    if stages == 0 {
        return 0;
    }
    let mut inputs = (LAST_TAPS - 1) << (stages - 1);
    let mut stage = 0;
    while stage + 1 < stages {
        inputs += (EARLY_TAPS - 1) << stage;
        stage += 1;
    }
    inputs
}

/// Coefficients of the last stage's filter, or of one before it.
const fn half(is_last: bool) -> usize {
    if is_last { LAST.len() } else { EARLY.len() }
}

/// State that all channels of a decimator have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Phase {
    stages: usize,
    lines: [LinePhase; MAX_STAGES],
}

/// State of the delay line of a stage.
#[derive(Clone, Copy, Debug)]
struct LinePhase {
    /// `true` if the next sample completes a pair.
    second: bool,
    /// Elements of the slack that even samples have taken.
    even: usize,
    /// Index of the oldest odd sample, which the next one replaces.
    odd: usize,
}

impl Phase {
    pub(super) const fn new(stages: usize) -> Self {
        let begin = LinePhase {
            second: false,
            even: 0,
            odd: 0,
        };
        Self {
            stages,
            lines: [begin; MAX_STAGES],
        }
    }

    /// `true` if the sample that is being pushed yields an output.
    pub(super) fn yields(&self) -> bool {
        self.lines.iter().take(self.stages).all(|line| line.second)
    }

    /// Pushes one sample of every channel through their `states` of [`state_len`] each; a
    /// channel that `sample` lacks reads zero. The result goes to `outputs` where
    /// [`Self::yields`], else nothing does.
    #[inline]
    pub(super) fn push<'o>(
        &self,
        states: &mut [f32],
        sample: &[f32],
        outputs: impl Iterator<Item = &'o mut f32>,
    ) {
        // Stage by stage for all channels: what all of them have in common is found once, and
        // a filter's coefficients stay in registers.
        let length = state_len(self.stages).max(1);
        let lines = self.lines.get(..self.stages).unwrap_or(&self.lines);
        let mut before: Option<Taps> = None;
        for (stage, line) in lines.iter().enumerate() {
            let begin = stage * EARLY_LINE;
            let half = self.half(stage);
            if line.second && line.even == 0 {
                let evens = begin + half..begin + 3 * half + SLACK;
                for state in states.chunks_exact_mut(length) {
                    if let Some(evens) = state.get_mut(evens.clone()) {
                        evens.copy_within(SLACK + 1.., 0);
                    }
                }
            }
            let place = begin + line.place(half);
            if let Some(taps) = before {
                for state in states.chunks_exact_mut(length) {
                    let y = taps.sum(state, &EARLY);
                    if let Some(slot) = state.get_mut(place) {
                        *slot = y;
                    }
                }
            } else {
                let mut states = states.chunks_exact_mut(length);
                for (x, state) in sample.iter().zip(states.by_ref()) {
                    if let Some(slot) = state.get_mut(place) {
                        *slot = *x;
                    }
                }
                for slot in states.filter_map(|state| state.get_mut(place)) {
                    *slot = 0.0;
                }
            }
            if !line.second {
                return;
            }
            before = Some(Taps {
                evens: begin + half + line.even,
                middle: begin + line.odd,
            });
        }
        match before {
            Some(taps) => {
                for (output, state) in outputs.zip(states.chunks_exact(length)) {
                    *output = taps.sum(state, &LAST);
                }
            }
            None => {
                let sample = sample.iter().copied().chain(core::iter::repeat(0.0));
                outputs.zip(sample).for_each(|(output, x)| *output = x);
            }
        }
    }

    /// Coefficients of a stage's filter.
    const fn half(&self, stage: usize) -> usize {
        half(stage + 1 == self.stages)
    }

    /// Goes on to the next sample, after all channels were pushed.
    pub(super) fn advance(&mut self) {
        let next = |at: usize, last: usize| if at == last { 0 } else { at + 1 };
        let last = self.stages.wrapping_sub(1);
        for (stage, line) in self.lines.iter_mut().enumerate().take(self.stages) {
            let odds = half(stage == last);
            line.second = !line.second;
            if line.second {
                line.odd = next(line.odd, odds - 1);
                break;
            }
            line.even = next(line.even, SLACK);
        }
    }
}

impl LinePhase {
    /// Index of the next sample in a delay line of a filter with so many coefficients.
    const fn place(&self, half: usize) -> usize {
        if self.second {
            3 * half + self.even - 1
        } else {
            // The oldest odd one's, which no sum will see again.
            self.odd
        }
    }
}

/// The part of a channel's state that a filter reads once the second sample of a pair is there.
#[derive(Clone, Copy)]
struct Taps {
    /// Index of the first even sample.
    evens: usize,
    /// Of as many odd samples as there are coefficients, the oldest is the middle one.
    middle: usize,
}

impl Taps {
    /// The filter's output.
    #[inline]
    fn sum<const HALF: usize>(self, state: &[f32], h: &[f32; HALF]) -> f32 {
        let evens = state.get(self.evens..self.evens + 2 * HALF);
        match (evens, state.get(self.middle)) {
            (Some(evens), Some(middle)) => filter(evens, *middle, h),
            _ => 0.0,
        }
    }
}

/// The half-band sum over the even samples, oldest first, and the middle one.
#[inline]
fn filter<const HALF: usize>(evens: &[f32], middle: f32, h: &[f32; HALF]) -> f32 {
    let Some((old, new)) = evens.split_first_chunk::<HALF>() else {
        return 0.0;
    };
    // Written out by fives, since the chip's code is made small rather than fast, and this
    // runs for every reading.
    let (h, old, new) = (
        h.as_chunks::<5>().0,
        old.as_chunks::<5>().0,
        new.as_chunks::<5>().0,
    );
    let mut sum = 0.5 * middle;
    for ((h, old), new) in h.iter().zip(old.iter().rev()).zip(new) {
        sum += h[0] * (old[4] + new[0]);
        sum += h[1] * (old[3] + new[1]);
        sum += h[2] * (old[2] + new[2]);
        sum += h[3] * (old[1] + new[3]);
        sum += h[4] * (old[0] + new[4]);
    }
    sum
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec;
    use std::vec::Vec;

    /// Magnitude of a half-band filter at `f` in units of its input rate.
    fn magnitude(h: &[f32], f: f64) -> f64 {
        let cosines = h.iter().enumerate().map(|(i, &h)| {
            let distance = (2 * i + 1) as f64;
            2.0 * f64::from(h) * libm::cos(2.0 * core::f64::consts::PI * f * distance)
        });
        0.5 + cosines.sum::<f64>()
    }

    #[test]
    fn the_filters_are_what_the_table_says() {
        for (h, edge, ripple, stop) in [
            (&LAST[..], 0.195_312_5, 5e-6, -107.0),
            (&EARLY[..], 0.097_656_25, 3e-6, -111.0),
        ] {
            for k in 0..=1000 {
                let pass = edge * f64::from(k) / 1000.0;
                assert!((magnitude(h, pass) - 1.0).abs() < ripple, "{pass}");
                let beyond = 0.5 - pass;
                let db = 20.0 * libm::log10(magnitude(h, beyond).abs());
                assert!(db < stop, "{beyond}: {db} dB");
            }
        }
    }

    /// Pushes a sample of a single channel; gives zero where nothing comes out.
    fn push(phase: &mut Phase, state: &mut [f32], x: f32) -> f32 {
        let mut y = 0.0;
        phase.push(state, &[x], core::iter::once(&mut y));
        y
    }

    /// Every second output of a filter as it is written in books: all taps over all samples.
    fn by_the_book(h: &[f32], samples: &[f32]) -> Vec<f32> {
        let taps = 4 * h.len() - 1;
        let middle = taps / 2;
        let mut padded = vec![0.0; taps - 1];
        padded.extend(samples);
        let outputs = padded.windows(taps).skip(1).step_by(2);
        outputs
            .map(|line| {
                let pairs = h.iter().enumerate();
                pairs.fold(0.5 * line[middle], |sum, (i, h)| {
                    sum + h * (line[middle - 1 - 2 * i] + line[middle + 1 + 2 * i])
                })
            })
            .collect()
    }

    #[test]
    fn decimates_as_by_the_book_to_the_last_bit() {
        let samples: Vec<f32> = (0..4000_u32)
            .map(|n| (n.wrapping_mul(0x9E37_79B1) >> 8) as f32 - 8e6)
            .collect();
        for stages in 1..=MAX_STAGES {
            let mut phase = Phase::new(stages);
            let mut state = vec![0.0; state_len(stages)];
            let mut found = Vec::new();
            for x in &samples {
                let y = push(&mut phase, &mut state, *x);
                if phase.yields() {
                    found.push(y);
                }
                phase.advance();
            }
            let early = (1..stages).fold(samples.clone(), |x, _| by_the_book(&EARLY, &x));
            assert_eq!(found, by_the_book(&LAST, &early), "{stages}");
            assert_eq!(found.len(), samples.len() >> stages);
        }
    }

    #[test]
    fn a_constant_comes_out_every_fourth_time() {
        let mut phase = Phase::new(2);
        let mut state = [0.0; state_len(2)];
        let mut outputs = 0;
        for n in 0..400 {
            let yields = phase.yields();
            let y = push(&mut phase, &mut state, 1.0);
            phase.advance();
            if yields {
                assert_eq!(n % 4, 3);
                outputs += 1;
                if n >= settling(2) {
                    // Two ripples of 5e-6 and 3e-6.
                    assert!((y - 1.0).abs() < 8e-6, "{n}: {y}");
                }
            }
        }
        assert_eq!(outputs, 100);
    }

    #[test]
    fn settling_is_when_the_start_is_forgotten() {
        let run = |lead: f32| {
            let mut phase = Phase::new(3);
            let mut state = [0.0; state_len(3)];
            let mut out = [0.0; 400];
            for (n, out) in out.iter_mut().enumerate() {
                let x = if n == 0 { lead } else { libm::sinf(n as f32) };
                *out = push(&mut phase, &mut state, x);
                if !phase.yields() {
                    *out = 0.0;
                }
                phase.advance();
            }
            out
        };
        let (a, b) = (run(0.0), run(1000.0));
        let differ = |n: usize| a[n] != b[n];
        assert!((0..settling(3)).any(differ));
        assert!(!(settling(3) + 1..400).any(differ));
    }
}
