//! Decimation by two, stage by stage, before the transform.
//!
//! The lines of interest lie far below half the sample rate. A quarter of the samples, and
//! of the memory, carries them as well as all of them do, if the frequencies that would fold onto
//! them are filtered out first. All channels, the drive among them, pass the same linear-phase
//! filters, so responses and coherences do not notice.
//!
//! The filters are those of `half_band.rs`. Samples are kept at each stage until eight of its sums of a
//! channel can be computed together, for which a sample is loaded once; only the last ones of a block are
//! fewer. The channels lie side by side by fours or eights, so that a group of them is stored at once.

use super::half_band::{
    NARROW_EARLY, NARROW_LAST, TOGETHER, WIDE_EARLY, WIDE_LAST, narrow_early, narrow_last,
    wide_early, wide_last,
};
use super::lane::{Lane, Row};

/// Share of the decimated block up to which lines may be kept: the pass band's edge.
pub(super) const USABLE: f64 = 25.0 / 64.0;
/// Share of the decimated block up to which the shorter filters pass.
const NARROW: f64 = 1.0 / 4.0;
/// Most stages: a factor of sixteen.
pub(super) const MAX_STAGES: usize = 4;

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

    /// Outputs of a stage that are computed together, for which there is room: twice as many of the first
    /// one, since the next takes them in pairs.
    const fn outputs(&self, stage: usize) -> usize {
        if stage == 0 && self.stages > 1 {
            2 * TOGETHER
        } else {
            TOGETHER
        }
    }

    /// Rows of a stage that later outputs see, a multiple of four: of second samples, then of first
    /// ones.
    const fn kept(&self, stage: usize) -> [usize; 2] {
        let half = self.half(stage);
        [
            (2 * half - 1).next_multiple_of(4),
            (half - 1).next_multiple_of(4),
        ]
    }

    /// Rows of a stage: of second samples, then of first ones.
    const fn rows_of(&self, stage: usize) -> [usize; 2] {
        let ([seconds, firsts], outputs) = (self.kept(stage), self.outputs(stage));
        [seconds + outputs, firsts + outputs]
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

    /// Elements of state that `channels` in groups of `group` need.
    pub(super) const fn state_len(&self, channels: usize, group: usize) -> usize {
        channels.div_ceil(group) * group * self.rows()
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

/// Delay line of a stage, as rows of a group's state.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    /// First row of the second samples of pairs, and of the first ones.
    begin: [usize; 2],
    /// Rows of each that later outputs see, after which new ones lie.
    kept: [usize; 2],
    /// Rows that the filter does not see, of those.
    slack: [usize; 2],
    /// Outputs whose samples wait there.
    waiting: usize,
}

/// Outputs that a stage computes at once, and its delay line as it was before the samples that came for them.
#[derive(Clone, Copy, Debug, Default)]
struct Work {
    line: Line,
    outputs: usize,
}

/// Samples on their way through the filters.
#[derive(Clone, Copy, Debug)]
pub struct Decimator {
    filters: Filters,
    lines: [Line; MAX_STAGES],
    channels: usize,
    /// Rows of a group's state.
    group: usize,
    /// The rows of the storage that take the next two samples, for the first group.
    places: [usize; 2],
    /// Samples until the filters run.
    wanted: usize,
    /// Samples until all outputs are there, those that have come since the filters ran last among them.
    left: usize,
}

impl Decimator {
    /// Filters of so many channels, to be begun.
    pub(super) fn new(filters: Filters, channels: usize) -> Self {
        let mut lines = [Line::default(); MAX_STAGES];
        let mut begin = 0;
        for (stage, line) in lines.iter_mut().enumerate().take(filters.stages) {
            let (half, kept) = (filters.half(stage), filters.kept(stage));
            let [seconds, firsts] = filters.rows_of(stage);
            *line = Line {
                begin: [begin, begin + seconds],
                kept,
                slack: [kept[0] + 1 - 2 * half, kept[1] + 1 - half],
                waiting: 0,
            };
            begin += seconds + firsts;
        }
        Self {
            filters,
            lines,
            channels,
            group: filters.rows(),
            places: [0; 2],
            wanted: 0,
            left: 0,
        }
    }

    /// Begins to collect the samples of `outputs` outputs, [`TOGETHER`] at most. The states begin at `base`
    /// in their storage, counted in rows.
    pub(super) fn begin(&mut self, base: usize, outputs: usize) {
        self.left = outputs << self.filters.stages;
        self.lines.iter_mut().for_each(|line| line.waiting = 0);
        self.go_on(base);
    }

    /// Samples that the first filter takes together, or all that are left.
    fn together(&self) -> usize {
        self.left.min(2 * self.filters.outputs(0))
    }

    /// Collects the next samples after the filters ran, those of no output yet among them.
    pub(super) fn go_on(&mut self, base: usize) {
        let [Line { begin, kept, .. }, ..] = &self.lines;
        // The first one of a pair, and the second one.
        self.places = [1, 0].map(|i: usize| match (begin.get(i), kept.get(i)) {
            (Some(begin), Some(kept)) => base + begin + kept,
            _ => base,
        });
        self.wanted = self.together();
    }

    /// Takes one sample of every channel into their states in `storage`; a channel that `sample` lacks
    /// reads zero. `true` once the filters can run.
    #[inline]
    pub(super) fn push<R: Row>(&mut self, storage: &mut [f32], sample: &[f32]) -> bool {
        if sample.len() < self.channels {
            self.clear::<R>(storage);
        }
        let [at, next] = self.places;
        self.places = [next, at + 1];
        self.wanted -= 1;
        R::store(R::rows_mut(storage), (at, self.group), sample);
        self.wanted == 0
    }

    /// Lets the sample that comes next read zero in all channels.
    #[cold]
    fn clear<R: Row>(&self, storage: &mut [f32]) {
        let [place, _] = self.places;
        let rows = R::rows_mut(storage).iter_mut().skip(place);
        rows.step_by(self.group.max(1))
            .take(self.channels.div_ceil(R::CHANNELS))
            .for_each(|row| *row = R::ZERO);
    }

    /// Filters the samples that wait, of every channel. Once those of all outputs have come, the outputs of
    /// each channel, too large by two a stage, go to its ring of `n` from `head` on; their number, zero before.
    #[cfg_attr(target_os = "none", inline(never))] // Storing a sample is to be short.
    #[cfg_attr(not(target_os = "none"), inline(always))] // Its caller says for which processor.
    pub(super) fn filter<L: Lane>(
        &mut self,
        states: &mut [f32],
        rings: &mut [f32],
        (n, head): (usize, usize),
    ) -> usize {
        let n = n.max(1);
        let works = self.due();
        let (works, outputs) = match works.get(..self.filters.stages) {
            Some(works @ [.., last]) => (works, last.outputs),
            _ => return 0,
        };
        let mut channels = self.channels;
        let states = L::Row::rows_mut(states).chunks_exact_mut(self.group.max(1));
        for (rows, rings) in states.zip(rings.chunks_mut((L::Row::CHANNELS * n).max(1))) {
            self.run::<L>(rows, channels, works);
            if outputs == TOGETHER && head + TOGETHER <= n {
                self.finish::<L>(rows, rings, (n, head));
            } else if outputs > 0 {
                let mut y = [L::Row::ZERO; TOGETHER];
                let y = L::Row::numbers_mut(&mut y);
                self.finish::<L>(rows, y, (TOGETHER, 0));
                let rings = rings.chunks_mut(n * L::WIDTH);
                for (ring, y) in rings.zip(y.chunks(TOGETHER * L::WIDTH)) {
                    let Some((start, end)) = L::samples_mut(ring).split_at_mut_checked(head) else {
                        break;
                    };
                    let slots = end.iter_mut().chain(start).zip(L::samples(y));
                    slots.take(outputs).for_each(|(slot, y)| *slot = *y);
                }
            }
            forget(rows, works);
            channels = channels.saturating_sub(L::Row::CHANNELS);
        }
        outputs
    }

    /// The work of each stage now: all outputs whose samples have come, once there are as many as are computed
    /// together, or no more to come.
    fn due(&mut self) -> [Work; MAX_STAGES] {
        let mut works = [Work::default(); MAX_STAGES];
        let collected = self.together();
        self.left -= collected;
        let mut pairs = collected / 2;
        let lines = self.lines.iter_mut().take(self.filters.stages);
        for (line, work) in lines.zip(&mut works) {
            work.line = *line;
            line.waiting += pairs;
            if line.waiting < TOGETHER && self.left > 0 {
                break;
            }
            work.outputs = line.waiting;
            pairs = line.waiting / 2;
            line.waiting = 0;
        }
        works
    }

    /// Filters a group by all stages before the last one.
    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn run<L: Lane>(&self, rows: &mut [L::Row], channels: usize, works: &[Work]) {
        for pair in works.windows(2) {
            let [Work { line, outputs }, Work { line: next, .. }] = pair else {
                return;
            };
            let (own, later) = rows.split_at_mut(next.begin[0].min(rows.len()));
            let (mut seconds, mut firsts) =
                (line.begin[0] + line.slack[0], line.begin[1] + line.slack[1]);
            let between = next.begin[1] - next.begin[0];
            let mut into = [next.kept[0], between + next.kept[1]].map(|row| row + next.waiting);
            let last = seconds + outputs;
            while seconds < last {
                let (Some(e), Some(f)) = (own.get(seconds..), own.get(firsts..)) else {
                    return;
                };
                if self.filters.wide {
                    wide_early::<L>(channels, e, f, later, into);
                } else {
                    narrow_early::<L>(channels, e, f, later, into);
                }
                seconds += TOGETHER;
                firsts += TOGETHER;
                into = into.map(|row| row + TOGETHER / 2);
            }
        }
    }

    /// Filters a group by the last stage.
    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn finish<L: Lane>(&self, rows: &[L::Row], rings: &mut [f32], place: (usize, usize)) {
        let line = self.lines.get(self.filters.stages - 1);
        let Some(Line { begin, slack, .. }) = line else {
            return;
        };
        let inputs = [begin[0] + slack[0], begin[1] + slack[1]]
            .map(|row| rows.get(row..).unwrap_or_default());
        if self.filters.wide {
            wide_last::<L>(inputs, rings, place);
        } else {
            narrow_last::<L>(inputs, rings, place);
        }
    }
}

/// Moves the rows of a group that later outputs see to the beginning, after these outputs of each stage.
#[cfg_attr(not(target_os = "none"), inline(always))]
fn forget<R: Row>(rows: &mut [R], works: &[Work]) {
    for Work { line, outputs } in works {
        if *outputs == 0 {
            break;
        }
        for (begin, kept) in line.begin.into_iter().zip(line.kept) {
            if let Some(rows) = rows.get_mut(begin..begin + kept + outputs) {
                shift(rows, *outputs);
            }
        }
    }
}

/// Moves the rows from `by` on, a multiple of four of them, to the beginning.
#[cfg_attr(not(target_os = "none"), inline(always))]
fn shift<R: Row>(rows: &mut [R], by: usize) {
    if by < 4 {
        for to in 0..rows.len().saturating_sub(by) {
            if let Some(from) = rows.get(to + by).copied()
                && let Some(to) = rows.get_mut(to)
            {
                *to = from;
            }
        }
        return;
    }
    // By fours, since a loop over single ones would become a call that moves word by word.
    let mut rest = rows;
    while let Some((to, from)) = rest.split_at_mut_checked(by) {
        let (Some(to), Some(from)) = (to.first_chunk_mut::<4>(), from.first_chunk::<4>()) else {
            return;
        };
        to[0] = from[0];
        to[1] = from[1];
        to[2] = from[2];
        to[3] = from[3];
        rest = rest.get_mut(4..).unwrap_or_default();
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::super::lane::GROUP;
    use super::*;
    use std::vec;
    use std::vec::Vec;

    /// Every second output of a filter as it is written in books: all taps over all samples, those
    /// beside the middle one first.
    fn by_the_book(h: &[f32], samples: &[f32]) -> Vec<f32> {
        let taps = 4 * h.len() - 1;
        let middle = taps / 2;
        let mut padded = vec![0.0; taps - 1];
        padded.extend(samples);
        let outputs = padded.windows(taps).skip(1).step_by(2);
        outputs
            .map(|line| {
                let pairs = h.iter().enumerate();
                pairs.fold(line[middle], |sum, (i, h)| {
                    sum + h * (line[middle - 1 - 2 * i] + line[middle + 1 + 2 * i])
                })
            })
            .collect()
    }

    /// Outputs of `channels` channels, taken in batches.
    fn outputs(filters: Filters, channels: &[Vec<f32>], batch: usize) -> Vec<Vec<f32>> {
        const N: usize = 16;
        let mut decimator = Decimator::new(filters, channels.len());
        let mut states = vec![0.0; filters.state_len(channels.len(), GROUP)];
        let mut rings = vec![0.0; N * channels.len()];
        let mut found = vec![Vec::new(); channels.len()];
        let mut head = 0;
        decimator.begin(0, batch);
        for n in 0..channels[0].len() {
            let sample: Vec<f32> = channels.iter().map(|x| x[n]).collect();
            if decimator.push::<[f32; GROUP]>(&mut states, &sample) {
                if decimator.filter::<f32>(&mut states, &mut rings, (N, head)) == 0 {
                    decimator.go_on(0);
                    continue;
                }
                decimator.begin(0, batch);
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
                for batch in (1..=TOGETHER).rev() {
                    let found = outputs(filters, &channels, batch);
                    for (found, samples) in found.iter().zip(&channels) {
                        let early =
                            (1..stages).fold(samples.clone(), |x, _| by_the_book(early, &x));
                        let expected = by_the_book(last, &early);
                        assert_eq!(*found, expected[..found.len()], "{stages} {batch}");
                        let whole = (samples.len() >> stages) / batch * batch;
                        assert_eq!(found.len(), whole);
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
