//! Decimation by two, stage by stage, before the transform.
//!
//! The lines of interest lie far below half the sample rate. A quarter of the samples, and
//! of the memory, carries them as well as all of them do, if the frequencies that would fold onto
//! them are filtered out first. All channels, the drive among them, pass the same linear-phase
//! filters, so responses and coherences do not notice.
//!
//! The filters are half-band ones: every other coefficient is zero, the middle one is a
//! half. They are equiripple (Parks and McClellan). There are two sets, by the share of the
//! decimated block that the last line reaches:
//!
//! | lines up to, of the block | stage | taps | pass band, of its input rate | stop band |
//! | --- | --- | --- | --- | --- |
//! | 1/4 | last | 23 | 0.125, ripple 6e-6 | 0.375 and up, -104 dB |
//! | | before | 11 | 0.0625, ripple 2e-5 | 0.4375 and up, -94 dB |
//! | 25/64 | last | 59 | 0.1953125, ripple 5e-6 | 0.3046875 and up, -107 dB |
//! | | before | 19 | 0.09765625, ripple 3e-6 | 0.40234375 and up, -111 dB |
//!
//! A frequency that folds onto a line is uncorrelated with it, so it biases averaged spectra by its
//! power, 4e-10 at most, and makes them scatter by its amplitude, 2e-5.
//!
//! Samples are kept until eight outputs of all channels can be computed together: a sample is then
//! loaded once for eight sums. The channels lie side by side by fours, so that a group of them is
//! stored at once.

/// Share of the decimated block up to which lines may be kept: the pass band's edge.
pub(super) const USABLE: f64 = 25.0 / 64.0;
/// Share of the decimated block up to which the shorter filters pass.
const NARROW: f64 = 1.0 / 4.0;
/// Most stages: a factor of sixteen.
pub(super) const MAX_STAGES: usize = 4;
/// Channels that lie side by side.
const LANES: usize = 4;
/// Outputs that are computed together.
pub(super) const TOGETHER: usize = 8;

/// One sample of the channels of a group.
type Row = [f32; LANES];

/// Twice the coefficients at the distances 1, 3, 5, … from the middle, on either side: the middle
/// one is then one, and an output is too large by a factor of two a stage.
const WIDE_LAST: [f32; 15] = [
    0.633_289_9,
    -0.202_404_4,
    0.111_590_646,
    -0.070_116_31,
    0.045_849_71,
    -0.030_071_497,
    0.019_384_114,
    -0.012_107_438,
    0.007_238_79,
    -0.004_090_422_8,
    0.002_151_031_8,
    -0.001_030_305_6,
    0.000_434_394_2,
    -0.000_151_144_64,
    3.736_980_2e-5,
];
const WIDE_EARLY: [f32; 5] = [
    0.611_780_6,
    -0.147_477_62,
    0.044_732_998,
    -0.010_301_148_6,
    0.001_267_712_6,
];
const NARROW_LAST: [f32; 6] = [
    0.618_837_54,
    -0.163_962_47,
    0.061_104_182,
    -0.020_317_484,
    0.005_026_328_4,
    -0.000_693_899_2,
];
const NARROW_EARLY: [f32; 3] = [0.590_407_9, -0.104_623_47, 0.014_234_926];

/// Adds the part of one coefficient to eight outputs, each of which sees it one row later.
macro_rules! add_tap {
    ($y:ident, $rows:ident, $lane:ident, $h:expr, $j:literal) => {
        $y[0] += $h * $rows[$j][$lane];
        $y[1] += $h * $rows[$j + 1][$lane];
        $y[2] += $h * $rows[$j + 2][$lane];
        $y[3] += $h * $rows[$j + 3][$lane];
        $y[4] += $h * $rows[$j + 4][$lane];
        $y[5] += $h * $rows[$j + 5][$lane];
        $y[6] += $h * $rows[$j + 6][$lane];
        $y[7] += $h * $rows[$j + 7][$lane];
    };
}

/// A filter over rows of second samples and of first ones. The sums are written out, since the
/// chip's code is made small rather than fast. The coefficients of each filter stand in the order
/// of the samples, oldest first.
macro_rules! filter {
    ($name:ident, $h:ident, $rows:literal, $($j:literal $i:literal),*) => {
        #[inline(always)]
        fn $name(seconds: &[Row], firsts: &[Row], lane: usize) -> [f32; TOGETHER] {
            let (Some(e), Some(f)) = (
                seconds.first_chunk::<$rows>(),
                firsts.first_chunk::<TOGETHER>(),
            ) else {
                return [0.0; TOGETHER];
            };
            let l = lane % LANES;
            let mut y = [
                f[0][l], f[1][l], f[2][l], f[3][l], f[4][l], f[5][l], f[6][l], f[7][l],
            ];
            $(add_tap!(y, e, l, $h[$i], $j);)*
            y
        }
    };
}

filter!(narrow_early, NARROW_EARLY, 13, 0 2, 1 1, 2 0, 3 0, 4 1, 5 2);
filter!(wide_early, WIDE_EARLY, 17, 0 4, 1 3, 2 2, 3 1, 4 0, 5 0, 6 1, 7 2, 8 3, 9 4);
filter!(narrow_last, NARROW_LAST, 19,
    0 5, 1 4, 2 3, 3 2, 4 1, 5 0, 6 0, 7 1, 8 2, 9 3, 10 4, 11 5);
filter!(wide_last, WIDE_LAST, 37,
    0 14, 1 13, 2 12, 3 11, 4 10, 5 9, 6 8, 7 7, 8 6, 9 5, 10 4, 11 3, 12 2, 13 1, 14 0,
    15 0, 16 1, 17 2, 18 3, 19 4, 20 5, 21 6, 22 7, 23 8, 24 9, 25 10, 26 11, 27 12, 28 13,
    29 14);

/// The filters of some number of stages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Filters {
    stages: usize,
    wide: bool,
}

impl Filters {
    /// Filters of `stages` stages that let pass the lines up to `share` of the decimated block.
    pub(super) fn new(stages: usize, share: f64) -> Self {
        Self {
            stages,
            wide: share > NARROW,
        }
    }

    /// Number of stages.
    pub(super) const fn stages(&self) -> usize {
        self.stages
    }

    /// Coefficients on either side of the middle one, of the last stage's filter or an earlier one's.
    const fn half(&self, stage: usize) -> usize {
        match (stage + 1 == self.stages, self.wide) {
            (true, true) => WIDE_LAST.len(),
            (true, false) => NARROW_LAST.len(),
            (false, true) => WIDE_EARLY.len(),
            (false, false) => NARROW_EARLY.len(),
        }
    }

    /// Outputs of a stage that are computed together.
    const fn outputs(&self, stage: usize) -> usize {
        TOGETHER << (self.stages - 1 - stage)
    }

    /// Rows of a stage: of second samples, then of first ones.
    const fn rows_of(&self, stage: usize) -> [usize; 2] {
        let (half, outputs) = (self.half(stage), self.outputs(stage));
        [2 * half - 1 + outputs, half - 1 + outputs]
    }

    /// Rows of all stages.
    const fn rows(&self) -> usize {
        let (mut rows, mut stage) = (0, 0);
        while stage < self.stages {
            let [seconds, firsts] = self.rows_of(stage);
            rows += seconds + firsts;
            stage += 1;
        }
        rows
    }

    /// Elements of state that `channels` need.
    pub(super) const fn state_len(&self, channels: usize) -> usize {
        channels.div_ceil(LANES) * LANES * self.rows()
    }

    /// Input samples until the first output that does not see the start from rest.
    pub(super) const fn settling(&self) -> usize {
        let (mut inputs, mut stage) = (0, 0);
        while stage < self.stages {
            inputs += (4 * self.half(stage) - 2) << stage;
            stage += 1;
        }
        inputs
    }
}

/// Samples on their way through the filters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Decimator {
    filters: Filters,
    /// Samples that wait to be filtered.
    waiting: usize,
    /// Elements of the states of all channels.
    length: usize,
    /// Elements of a group's state, and the offsets of the rows in it that take the next two
    /// samples.
    group: usize,
    places: [usize; 2],
}

impl Decimator {
    pub(super) const fn new(filters: Filters, channels: usize) -> Self {
        Self {
            filters,
            waiting: 0,
            length: filters.state_len(channels),
            group: filters.rows() * LANES,
            places: places(&filters),
        }
    }

    /// Takes one sample of every channel into their `states`, of [`Filters::state_len`]; a channel
    /// that `sample` lacks reads zero. `true` once there are inputs for `outputs` outputs, 8 at
    /// most.
    #[inline]
    pub(super) fn push(&mut self, states: &mut [f32], sample: &[f32], outputs: usize) -> bool {
        let [place, next] = self.places;
        let (groups, rest) = sample.as_chunks::<LANES>();
        let states = states.get_mut(..self.length).unwrap_or_default();
        let mut states = states.chunks_exact_mut(self.group.max(LANES));
        for (x, state) in groups.iter().zip(states.by_ref()) {
            if let Some(row) = row_mut(state, place) {
                *row = *x;
            }
        }
        if let Some(row) = states.next().and_then(|state| row_mut(state, place)) {
            *row = [0.0; LANES];
            row.iter_mut().zip(rest).for_each(|(slot, x)| *slot = *x);
        }
        for state in states {
            if let Some(row) = row_mut(state, place) {
                *row = [0.0; LANES];
            }
        }
        self.places = [next, place + LANES];
        self.waiting += 1;
        self.waiting >= outputs << self.filters.stages
    }

    /// Filters the samples that wait, of every channel: the outputs of each, `outputs` of them and
    /// too large by two a stage, go to its ring of `n` from `head` on.
    pub(super) fn filter(
        &mut self,
        states: &mut [f32],
        rings: &mut [f32],
        (n, head): (usize, usize),
        outputs: usize,
    ) {
        let states = states.chunks_exact_mut(self.group.max(LANES));
        for (state, rings) in states.zip(rings.chunks_mut(LANES * n.max(1))) {
            let (rows, _) = state.as_chunks_mut();
            for (lane, ring) in rings.chunks_exact_mut(n.max(1)).enumerate() {
                let y = self.filters.run(rows, lane, outputs);
                if outputs == TOGETHER
                    && let Some(slots) = ring.get_mut(head..).and_then(|r| r.first_chunk_mut())
                {
                    *slots = y;
                    continue;
                }
                let (start, end) = ring.split_at_mut(head.min(n));
                let slots = end.iter_mut().chain(start).zip(y);
                slots.take(outputs).for_each(|(slot, y)| *slot = y);
            }
            self.filters.forget(rows, outputs);
        }
        (self.waiting, self.places) = (0, places(&self.filters));
    }
}

impl Filters {
    /// The outputs of a lane: those that its rows have inputs for, others mean nothing.
    #[inline]
    fn run(&self, mut rows: &mut [Row], lane: usize, outputs: usize) -> [f32; TOGETHER] {
        let mut half = self.half(0);
        for stage in 1..self.stages {
            let count = outputs << (self.stages - stage);
            let [seconds, firsts] = self.rows_of(stage - 1);
            let (seconds, rest) = rows.split_at_mut(seconds.min(rows.len()));
            let (firsts, rest) = rest.split_at_mut(firsts.min(rest.len()));
            rows = rest;
            half = self.half(stage);
            let (into_seconds, into_firsts) =
                rows.split_at_mut(self.rows_of(stage)[0].min(rows.len()));
            let into_seconds = into_seconds.get_mut(2 * half - 1..).unwrap_or_default();
            let into_firsts = into_firsts.get_mut(half - 1..).unwrap_or_default();
            for at in (0..count).step_by(TOGETHER) {
                let (seconds, firsts) = (from(seconds, at), from(firsts, at));
                let y = if self.wide {
                    wide_early(seconds, firsts, lane)
                } else {
                    narrow_early(seconds, firsts, lane)
                };
                let [a, b, c, d, e, f, g, h] = y;
                put(into_firsts, at / 2, lane, [a, c, e, g]);
                put(into_seconds, at / 2, lane, [b, d, f, h]);
            }
        }
        let (seconds, firsts) = rows.split_at((2 * half - 1 + TOGETHER).min(rows.len()));
        if self.wide {
            wide_last(seconds, firsts, lane)
        } else {
            narrow_last(seconds, firsts, lane)
        }
    }

    /// Moves the rows that later outputs see to the beginning, after `outputs` outputs.
    fn forget(&self, mut rows: &mut [Row], outputs: usize) {
        for stage in 0..self.stages {
            let count = outputs << (self.stages - 1 - stage);
            let half = self.half(stage);
            for (length, kept) in self
                .rows_of(stage)
                .into_iter()
                .zip([2 * half - 1, half - 1])
            {
                let (line, rest) = rows.split_at_mut(length.min(rows.len()));
                rows = rest;
                if let Some(last) = line.len().checked_sub(kept)
                    && count <= last
                {
                    line.copy_within(count..count + kept, 0);
                }
            }
        }
    }
}

/// Offsets of the rows that take the first sample of a pair and the second one.
const fn places(filters: &Filters) -> [usize; 2] {
    if filters.stages == 0 {
        return [0; 2];
    }
    let half = filters.half(0);
    let [seconds, _] = filters.rows_of(0);
    [(seconds + half - 1) * LANES, (2 * half - 1) * LANES]
}

/// The rows from one on.
#[inline]
fn from(rows: &[Row], at: usize) -> &[Row] {
    rows.get(at..).unwrap_or_default()
}

/// The row of a group's state at an offset.
#[inline]
fn row_mut(state: &mut [f32], place: usize) -> Option<&mut Row> {
    state.get_mut(place..)?.first_chunk_mut()
}

/// Puts inputs of a lane into four rows.
#[inline(always)]
fn put(rows: &mut [Row], at: usize, lane: usize, x: [f32; 4]) {
    if let Some(rows) = rows
        .get_mut(at..)
        .and_then(|rows| rows.first_chunk_mut::<4>())
    {
        let l = lane % LANES;
        rows[0][l] = x[0];
        rows[1][l] = x[1];
        rows[2][l] = x[2];
        rows[3][l] = x[3];
    }
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
            f64::from(h) * libm::cos(2.0 * core::f64::consts::PI * f * distance)
        });
        0.5 + cosines.sum::<f64>()
    }

    #[test]
    fn the_filters_are_what_the_table_says() {
        for (h, edge, ripple, stop) in [
            (&WIDE_LAST[..], 0.195_312_5, 5e-6, -106.9),
            (&WIDE_EARLY[..], 0.097_656_25, 3e-6, -111.0),
            (&NARROW_LAST[..], 0.125, 6e-6, -104.0),
            (&NARROW_EARLY[..], 0.0625, 2e-5, -94.0),
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

    /// Every second output of a filter as it is written in books: all taps over all samples, oldest
    /// first, of which the middle one is taken first.
    fn by_the_book(h: &[f32], samples: &[f32]) -> Vec<f32> {
        let taps = 4 * h.len() - 1;
        let middle = taps / 2;
        let mut padded = vec![0.0; taps - 1];
        padded.extend(samples);
        let outputs = padded.windows(taps).skip(1).step_by(2);
        outputs
            .map(|line| {
                let odd = line.iter().enumerate().step_by(2);
                odd.fold(line[middle], |sum, (i, x)| {
                    sum + h[middle.abs_diff(i) / 2] * x
                })
            })
            .collect()
    }

    /// What comes out of `channels` channels, taken in batches as their rings of `n` ask for.
    fn outputs(filters: Filters, channels: &[Vec<f32>], batch: usize) -> Vec<Vec<f32>> {
        const N: usize = 16;
        let mut decimator = Decimator::new(filters, channels.len());
        let mut states = vec![0.0; filters.state_len(channels.len())];
        let mut rings = vec![0.0; N * channels.len()];
        let mut found = vec![Vec::new(); channels.len()];
        let mut head = 0;
        for n in 0..channels[0].len() {
            let sample: Vec<f32> = channels.iter().map(|x| x[n]).collect();
            if decimator.push(&mut states, &sample, batch) {
                decimator.filter(&mut states, &mut rings, (N, head), batch);
                for (found, ring) in found.iter_mut().zip(rings.chunks(N)) {
                    found.extend((0..batch).map(|k| ring[(head + k) % N]));
                }
                head = (head + batch) % N;
            }
        }
        found
    }

    #[test]
    fn decimates_as_by_the_book_to_the_last_bit() {
        let samples = |c: u32| -> Vec<f32> {
            (0..4096_u32)
                .map(|n| ((n ^ c << 20).wrapping_mul(0x9E37_79B1) >> 8) as f32 - 8e6)
                .collect()
        };
        let channels: Vec<Vec<f32>> = (0..6).map(samples).collect();
        for (share, early, last) in [
            (0.25, &NARROW_EARLY[..], &NARROW_LAST[..]),
            (0.39, &WIDE_EARLY, &WIDE_LAST),
        ] {
            for stages in 1..=MAX_STAGES {
                let filters = Filters::new(stages, share);
                for batch in [TOGETHER, 4, 1] {
                    let found = outputs(filters, &channels, batch);
                    for (found, samples) in found.iter().zip(&channels) {
                        let early =
                            (1..stages).fold(samples.clone(), |x, _| by_the_book(early, &x));
                        assert_eq!(*found, by_the_book(last, &early), "{stages} {batch}");
                        assert_eq!(found.len(), samples.len() >> stages);
                    }
                }
            }
        }
    }

    #[test]
    fn a_constant_comes_out_every_fourth_time() {
        let filters = Filters::new(2, 0.25);
        let found = outputs(filters, &[vec![1.0; 800]], TOGETHER);
        assert_eq!(found[0].len(), 200);
        for y in &found[0][filters.settling() >> 2..] {
            // Four times as large, with two ripples of 6e-6 and 2e-5.
            assert!((y / 4.0 - 1.0).abs() < 2.6e-5, "{y}");
        }
    }

    #[test]
    fn settling_is_when_the_start_is_forgotten() {
        let filters = Filters::new(3, 0.39);
        let run = |lead: f32| {
            let mut samples: Vec<f32> = (0..1600).map(|n| libm::sinf(n as f32)).collect();
            samples[0] = lead;
            outputs(filters, &[samples], TOGETHER).remove(0)
        };
        let (a, b) = (run(0.0), run(1000.0));
        let differ = |n: usize| a[n] != b[n];
        let first = filters.settling() >> 3;
        assert!((0..first).any(differ));
        assert!(!(first..a.len()).any(differ));
    }
}
