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
/// The rows that eight outputs of a stage go to, each of both kinds.
type Four = [Row; TOGETHER / 2];

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

/// Eight outputs of a filter over a lane of rows of second samples and of first ones. The sums are
/// written out, since the chip's code is made small rather than fast. The coefficients of each filter
/// stand in the order of the samples, oldest first.
macro_rules! sums {
    ($h:ident, $e:ident, $f:ident, $l:ident, $($j:literal $i:literal),*) => {{
        let mut y = [
            $f[0][$l], $f[1][$l], $f[2][$l], $f[3][$l], $f[4][$l], $f[5][$l], $f[6][$l], $f[7][$l],
        ];
        $(add_tap!(y, $e, $l, $h[$i], $j);)*
        y
    }};
}

/// A filter before the last one, for `lanes` lanes: its outputs are first and second samples of the
/// next.
macro_rules! early {
    ($name:ident, $h:ident, $rows:literal, $($taps:tt)*) => {
        #[inline(never)] // All registers are its own.
        fn $name(lanes: usize, [e, f]: [&[Row]; 2], [firsts, seconds]: [&mut Four; 2]) {
            let (Some(e), Some(f)) = (e.first_chunk::<$rows>(), f.first_chunk::<TOGETHER>()) else {
                return;
            };
            for l in 0..lanes.min(LANES) {
                let y = sums!($h, e, f, l, $($taps)*);
                firsts[0][l] = y[0];
                seconds[0][l] = y[1];
                firsts[1][l] = y[2];
                seconds[1][l] = y[3];
                firsts[2][l] = y[4];
                seconds[2][l] = y[5];
                firsts[3][l] = y[6];
                seconds[3][l] = y[7];
            }
        }
    };
}

/// The last filter, for as many lanes as there are rings, whose places `at` take the outputs.
macro_rules! last {
    ($name:ident, $h:ident, $rows:literal, $($taps:tt)*) => {
        #[inline(never)] // All registers are its own.
        fn $name([e, f]: [&[Row]; 2], rings: &mut [f32], (n, at): (usize, usize)) {
            let (Some(e), Some(f)) = (e.first_chunk::<$rows>(), f.first_chunk::<TOGETHER>()) else {
                return;
            };
            for (l, ring) in rings.chunks_exact_mut(n.max(1)).enumerate().take(LANES) {
                if let Some(into) = ring.get_mut(at..).and_then(|r| r.first_chunk_mut()) {
                    *into = sums!($h, e, f, l, $($taps)*);
                }
            }
        }
    };
}

early!(narrow_early, NARROW_EARLY, 13, 0 2, 1 1, 2 0, 3 0, 4 1, 5 2);
early!(wide_early, WIDE_EARLY, 17, 0 4, 1 3, 2 2, 3 1, 4 0, 5 0, 6 1, 7 2, 8 3, 9 4);
last!(narrow_last, NARROW_LAST, 19,
    0 5, 1 4, 2 3, 3 2, 4 1, 5 0, 6 0, 7 1, 8 2, 9 3, 10 4, 11 5);
last!(wide_last, WIDE_LAST, 37,
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

/// Rows of the delay line of a stage.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    /// Second samples of pairs, then first ones.
    rows: [usize; 2],
    /// Those of them that the next output sees, too.
    kept: [usize; 2],
    /// Outputs that are computed together.
    outputs: usize,
}

/// Samples on their way through the filters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Decimator {
    filters: Filters,
    lines: [Line; MAX_STAGES],
    /// Samples that wait to be filtered.
    waiting: usize,
    /// Elements of a group's state.
    group: usize,
    channels: usize,
    /// Rows of a group before the last stage's, and of its second samples.
    last: usize,
    seconds_of_last: usize,
    /// Offsets in a group's state of the rows that take the next two samples.
    places: [usize; 2],
}

impl Decimator {
    pub(super) fn new(filters: Filters, channels: usize) -> Self {
        let mut lines = [Line::default(); MAX_STAGES];
        for (stage, line) in lines.iter_mut().enumerate().take(filters.stages) {
            let half = filters.half(stage);
            *line = Line {
                rows: filters.rows_of(stage),
                kept: [2 * half - 1, half - 1],
                outputs: filters.outputs(stage),
            };
        }
        let used = lines.get(..filters.stages).unwrap_or(&lines);
        let (last, before) = used.split_last().unzip();
        let before: &[Line] = before.unwrap_or_default();
        let mut new = Self {
            filters,
            lines,
            waiting: 0,
            group: filters.rows() * LANES,
            channels,
            last: before.iter().flat_map(|line| line.rows).sum(),
            seconds_of_last: last.map_or(0, |line| line.rows[0]),
            places: [0; 2],
        };
        new.begin();
        new
    }

    /// Begins to collect samples.
    fn begin(&mut self) {
        let [Line { rows, kept, .. }, ..] = &self.lines;
        self.waiting = 0;
        // The first one of a pair, and the second one.
        self.places = [(rows[0] + kept[1]) * LANES, kept[0] * LANES];
    }

    /// Takes one sample of every channel into their `states`, of [`Filters::state_len`]; a channel
    /// that `sample` lacks reads zero. `true` once there are inputs for `outputs` outputs, 8 at
    /// most.
    #[inline]
    pub(super) fn push(&mut self, states: &mut [f32], sample: &[f32], outputs: usize) -> bool {
        let [place, next] = self.places;
        if sample.len() < self.channels {
            self.clear(states);
        }
        let (groups, rest) = sample.as_chunks();
        let mut at = place;
        for x in groups {
            let Some(row) = states
                .get_mut(at..)
                .and_then(|s| s.first_chunk_mut::<LANES>())
            else {
                break;
            };
            *row = *x;
            at += self.group;
        }
        let row = states.get_mut(at..).unwrap_or_default();
        row.iter_mut().zip(rest).for_each(|(slot, x)| *slot = *x);
        self.places = [next, place + LANES];
        self.waiting += 1;
        self.waiting >= outputs << self.filters.stages
    }

    /// Lets the sample that comes next read zero in all channels.
    #[cold]
    fn clear(&self, states: &mut [f32]) {
        let [place, _] = self.places;
        let states = states.chunks_exact_mut(self.group.max(LANES));
        states
            .filter_map(|state| state.get_mut(place..place + LANES))
            .for_each(|row| row.fill(0.0));
    }

    /// Filters the samples that wait, of every channel: the outputs of each, `outputs` of them and
    /// too large by two a stage, go to its ring of `n` from `head` on.
    #[inline(never)] // Storing a sample is to be short.
    pub(super) fn filter(
        &mut self,
        states: &mut [f32],
        rings: &mut [f32],
        (n, head): (usize, usize),
        outputs: usize,
    ) {
        let n = n.max(1);
        let lanes = rings.len() / n;
        let states = states.chunks_exact_mut(self.group.max(LANES));
        for (group, (state, rings)) in states.zip(rings.chunks_mut(LANES * n)).enumerate() {
            let (rows, _) = state.as_chunks_mut();
            let lanes = (lanes - LANES * group).min(LANES);
            self.run(rows, lanes, outputs);
            if outputs == TOGETHER && head + TOGETHER <= n {
                self.finish(rows, rings, (n, head));
            } else {
                let mut y = [0.0; LANES * TOGETHER];
                self.finish(rows, &mut y, (TOGETHER, 0));
                for (ring, y) in rings.chunks_exact_mut(n).zip(y.chunks_exact(TOGETHER)) {
                    let (start, end) = ring.split_at_mut(head.min(n));
                    let slots = end.iter_mut().chain(start).zip(y);
                    slots.take(outputs).for_each(|(slot, y)| *slot = *y);
                }
            }
            self.forget(rows, outputs);
        }
        self.begin();
    }

    /// Filters a group by all stages before the last one.
    fn run(&self, mut rows: &mut [Row], lanes: usize, outputs: usize) {
        let filter = if self.filters.wide {
            wide_early
        } else {
            narrow_early
        };
        let stages = self.filters.stages;
        for (stage, pair) in self.lines.windows(2).enumerate().take(stages - 1) {
            let [line, next] = pair else {
                return;
            };
            let (seconds, rest) = rows.split_at_mut(line.rows[0].min(rows.len()));
            let (firsts, rest) = rest.split_at_mut(line.rows[1].min(rest.len()));
            rows = rest;
            let (into_seconds, into_firsts) = rows.split_at_mut(next.rows[0].min(rows.len()));
            let into_seconds = into_seconds.get_mut(next.kept[0]..).unwrap_or_default();
            let into_firsts = into_firsts.get_mut(next.kept[1]..).unwrap_or_default();
            let (into_seconds, _) = into_seconds.as_chunks_mut();
            let (into_firsts, _) = into_firsts.as_chunks_mut();
            let count = outputs << (stages - 1 - stage);
            let blocks = into_firsts.iter_mut().zip(into_seconds);
            for (block, (first, second)) in blocks.enumerate().take(count.div_ceil(TOGETHER)) {
                let from = [&*seconds, firsts].map(|rows| rows.get(TOGETHER * block..));
                filter(lanes, from.map(Option::unwrap_or_default), [first, second]);
            }
        }
    }

    /// Filters a group by the last stage.
    fn finish(&self, rows: &[Row], rings: &mut [f32], place: (usize, usize)) {
        let rows = rows.get(self.last..).unwrap_or_default();
        let (seconds, firsts) = rows.split_at(self.seconds_of_last.min(rows.len()));
        if self.filters.wide {
            wide_last([seconds, firsts], rings, place);
        } else {
            narrow_last([seconds, firsts], rings, place);
        }
    }

    /// Moves the rows that later outputs see to the beginning, after `outputs` outputs.
    fn forget(&self, mut rows: &mut [Row], outputs: usize) {
        for line in self.lines.iter().take(self.filters.stages) {
            let count = outputs * line.outputs / TOGETHER;
            for (length, kept) in line.rows.into_iter().zip(line.kept) {
                let (part, rest) = rows.split_at_mut(length.min(rows.len()));
                rows = rest;
                shift(part, count, kept);
            }
        }
    }
}

/// Moves `kept` rows from `by` on to the beginning.
fn shift(rows: &mut [Row], by: usize, kept: usize) {
    // By fours, since a loop over single ones would become a call that moves word by word.
    let mut at = 0;
    while by >= 4 && at + 4 <= kept {
        let Some((to, from)) = rows.split_at_mut_checked(at + by) else {
            return;
        };
        let to = to
            .get_mut(at..)
            .and_then(|rows| rows.first_chunk_mut::<4>());
        if let (Some(to), Some(from)) = (to, from.first_chunk::<4>()) {
            to[0] = from[0];
            to[1] = from[1];
            to[2] = from[2];
            to[3] = from[3];
        }
        at += 4;
    }
    if by + kept <= rows.len() {
        rows.copy_within(by + at..by + kept, at);
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
