//! Decimation by two, stage by stage, before the transform.
//!
//! The lines of interest lie far below half the sample rate. A quarter of the samples, and
//! of the memory, carries them as well as all of them do, if the frequencies that would fold onto
//! them are filtered out first. All channels, the drive among them, pass the same linear-phase
//! filters, so responses and coherences do not notice.
//!
//! The filters are those of `half_band.rs`. Samples are kept until eight sums of a channel can be
//! computed together, for which a sample is loaded once. The channels lie side by side by fours, so
//! that a group of them is stored at once.

use super::gains::Gains;
use super::half_band::{
    MAX_STAGES, NARROW_EARLY_SEES, NARROW_LAST_SEES, Sees, TOGETHER, WIDE_EARLY_SEES,
    WIDE_LAST_SEES, narrow_early, narrow_last, wide_early, wide_last,
};
use super::lane::{GROUP, Lane, Row};

/// Share of the decimated block up to which lines may be kept: the pass band's edge.
pub(super) const USABLE: f64 = 25.0 / 64.0;
/// Share of the decimated block up to which the shorter filters keep out what folds.
const NARROW: f64 = 1.0 / 4.0;

/// The filters of some number of stages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Filters {
    stages: usize,
    wide: bool,
}

/// Gains of lines.
pub(super) enum Gain {
    /// All have the same.
    Uniform(f32),
    /// Each has its own.
    OfLines(Gains),
}

impl Filters {
    /// Filters of `stages` stages that let pass the lines up to `share` of the decimated block.
    pub(super) fn new(stages: usize, share: f64) -> Self {
        Self {
            stages,
            wide: share > NARROW,
        }
    }

    /// What gives back to lines what the filters take from them, and halves them.
    pub(super) fn gain(&self) -> Gain {
        match self.stages {
            stages if self.wide || stages == 0 => Gain::Uniform(1.0 / (2_u32 << stages) as f32),
            stages => Gain::OfLines(Gains::of(stages)),
        }
    }

    /// Number of stages.
    pub(super) const fn stages(&self) -> usize {
        self.stages
    }

    /// What the last stage's filter or an earlier one's sees.
    const fn sees(&self, stage: usize) -> Sees {
        match (stage + 1 == self.stages, self.wide) {
            (true, true) => WIDE_LAST_SEES,
            (true, false) => NARROW_LAST_SEES,
            (false, true) => WIDE_EARLY_SEES,
            (false, false) => NARROW_EARLY_SEES,
        }
    }

    /// Outputs that are computed together: of many stages fewer, since each takes its inputs.
    pub(super) const fn batch(&self) -> usize {
        // The shorter filters leave room for twice as many.
        let outputs = if self.wide { TOGETHER } else { 2 * TOGETHER };
        outputs >> self.stages.saturating_sub(2)
    }

    /// Outputs of a stage for which there is room.
    const fn outputs(&self, stage: usize) -> usize {
        let outputs = self.batch() << (self.stages - 1 - stage);
        if outputs < TOGETHER {
            TOGETHER
        } else {
            outputs
        }
    }

    /// Rows of a stage that later outputs see, a multiple of four: of second samples, then of first
    /// ones.
    const fn kept(&self, stage: usize) -> [usize; 2] {
        let [seconds, firsts] = self.sees(stage).before;
        [seconds.next_multiple_of(4), firsts.next_multiple_of(4)]
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

    /// Elements of state that `channels` need.
    pub(super) const fn state_len(&self, channels: usize) -> usize {
        channels.div_ceil(GROUP) * GROUP * self.rows()
    }

    /// Input samples until the first output that does not see the start from rest.
    pub(super) const fn settling(&self) -> usize {
        let (mut inputs, mut stage) = (0, 0);
        while stage < self.stages {
            inputs += (self.sees(stage).taps - 1) << stage;
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
    /// Logarithm to base two of its outputs for one of the last stage.
    shift: usize,
}

impl Line {
    /// What the filter sees: second samples of pairs, and first ones.
    #[inline(always)]
    fn inputs<'r>(&self, rows: &'r [Row]) -> [&'r [Row]; 2] {
        let ([second, first], [later, last]) = (self.begin, self.slack);
        [
            rows.get(second + later..).unwrap_or_default(),
            rows.get(first + last..).unwrap_or_default(),
        ]
    }
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
}

impl Decimator {
    /// Filters of so many channels, to be begun.
    pub(super) fn new(filters: Filters, channels: usize) -> Self {
        let mut lines = [Line::default(); MAX_STAGES];
        let mut begin = 0;
        for (stage, line) in lines.iter_mut().enumerate().take(filters.stages) {
            let (before, kept) = (filters.sees(stage).before, filters.kept(stage));
            let [seconds, firsts] = filters.rows_of(stage);
            *line = Line {
                begin: [begin, begin + seconds],
                kept,
                slack: [kept[0] - before[0], kept[1] - before[1]],
                shift: filters.stages - 1 - stage,
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
        }
    }

    /// Begins to collect the samples of `outputs` outputs, [`Filters::batch`] at most. The states begin
    /// at `base` in their storage, a multiple of four.
    pub(super) fn begin(&mut self, base: usize, outputs: usize) {
        let [Line { begin, kept, .. }, ..] = &self.lines;
        // The first one of a pair, and the second one.
        self.places = [1, 0].map(|i: usize| match (begin.get(i), kept.get(i)) {
            (Some(begin), Some(kept)) => base / GROUP + begin + kept,
            _ => base / GROUP,
        });
        self.wanted = outputs << self.filters.stages;
    }

    /// Takes one sample of every channel into their states in `storage`; a channel that `sample` lacks
    /// reads zero. `true` once the filters can run.
    #[inline(never)] // All registers are its own.
    pub(super) fn push(&mut self, storage: &mut [f32], sample: &[f32]) -> bool {
        if sample.len() < self.channels {
            self.clear(storage);
        }
        let [at, next] = self.places;
        self.places = [next, at + 1];
        self.wanted -= 1;
        store(storage.as_chunks_mut().0, (at, self.group), sample);
        self.wanted == 0
    }

    /// Lets the sample that comes next read zero in all channels.
    #[cold]
    fn clear(&self, storage: &mut [f32]) {
        let [place, _] = self.places;
        let (rows, _) = storage.as_chunks_mut::<GROUP>();
        let rows = rows.iter_mut().skip(place).step_by(self.group.max(1));
        rows.take(self.channels.div_ceil(GROUP))
            .for_each(|row| *row = [0.0; GROUP]);
    }

    /// Filters the samples that wait, of every channel: the outputs of each, `outputs` of them and
    /// too large by two a stage, go to its ring of `n` from `head` on.
    #[inline(never)] // Storing a sample is to be short.
    pub(super) fn filter<L: Lane>(
        &self,
        states: &mut [f32],
        rings: &mut [f32],
        (n, head): (usize, usize),
        outputs: usize,
    ) {
        let n = n.max(1);
        let mut channels = self.channels;
        let states = states.as_chunks_mut().0.chunks_exact_mut(self.group.max(1));
        let rings = rings.chunks_mut((GROUP * n).max(1));
        for (rows, rings) in states.zip(rings) {
            self.run::<L>(rows, channels, outputs);
            self.finish::<L>(rows, rings, (n, head), outputs);
            self.forget(rows, outputs);
            channels = channels.saturating_sub(GROUP);
        }
    }

    /// Filters a group by all stages before the last one.
    #[inline(always)]
    fn run<L: Lane>(&self, rows: &mut [Row], channels: usize, outputs: usize) {
        for pair in self.lines.windows(2).take(self.filters.stages - 1) {
            let [line, next] = pair else {
                return;
            };
            let (own, later) = rows.split_at_mut(next.begin[0].min(rows.len()));
            let [e, f] = line.inputs(own);
            let (seconds, firsts) =
                later.split_at_mut((next.begin[1] - next.begin[0]).min(later.len()));
            // Whole eights of outputs: the last ones of them are overwritten by those of the next batch.
            let count = (outputs << line.shift).next_multiple_of(TOGETHER) / 2;
            let [second, first] = next.kept;
            let seconds = seconds.get_mut(second..second + count).unwrap_or_default();
            let firsts = firsts.get_mut(first..first + count).unwrap_or_default();
            if self.filters.wide {
                wide_early::<L>(channels, e, f, seconds, firsts);
            } else {
                narrow_early::<L>(channels, e, f, seconds, firsts);
            }
        }
    }

    /// Filters a group by the last stage, into its rings.
    #[inline(always)]
    fn finish<L: Lane>(
        &self,
        rows: &[Row],
        rings: &mut [f32],
        (n, mut at): (usize, usize),
        outputs: usize,
    ) {
        let Some(line) = self.lines.get(self.filters.stages - 1) else {
            return;
        };
        let filter = |e: &[Row], f: &[Row], rings: &mut [f32], place| {
            if self.filters.wide {
                wide_last::<L>(e, f, rings, place);
            } else {
                narrow_last::<L>(e, f, rings, place);
            }
        };
        let [mut e, mut f] = line.inputs(rows);
        let mut left = outputs;
        while left > 0 {
            let count = left.min(TOGETHER);
            if count == TOGETHER && at + TOGETHER <= n {
                filter(e, f, rings, (n, at));
            } else {
                let mut y = [0.0; GROUP * TOGETHER];
                filter(e, f, &mut y, (TOGETHER, 0));
                let rings = rings.chunks_mut(n * L::WIDTH);
                for (ring, y) in rings.zip(y.chunks(TOGETHER * L::WIDTH)) {
                    let Some((start, end)) = L::samples_mut(ring).split_at_mut_checked(at) else {
                        break;
                    };
                    let slots = end.iter_mut().chain(start).zip(L::samples(y));
                    slots.take(count).for_each(|(slot, y)| *slot = *y);
                }
            }
            at = (at + count) % n;
            left -= count;
            e = e.get(TOGETHER..).unwrap_or_default();
            f = f.get(TOGETHER..).unwrap_or_default();
        }
    }

    /// Moves the rows that later outputs see to the beginning, after `outputs` outputs.
    #[inline(always)]
    fn forget(&self, rows: &mut [Row], outputs: usize) {
        for line in self.lines.iter().take(self.filters.stages) {
            let count = outputs << line.shift;
            let ([second, first], [seconds, firsts]) = (line.begin, line.kept);
            shift(rows, second, seconds, count);
            shift(rows, first, firsts, count);
        }
    }
}

/// Stores a sample of channels side by side in every `stride`-th of the rows from `at` on.
#[inline(always)]
fn store(rows: &mut [Row], (mut at, stride): (usize, usize), sample: &[f32]) {
    let (groups, rest) = sample.as_chunks::<GROUP>();
    // One by one, since a loop would become a call.
    if let ([a, rest @ ..], Some([x, y, z, _])) = (rest, rows.get_mut(at + groups.len() * stride)) {
        *x = *a;
        if let [b, rest @ ..] = rest {
            *y = *b;
            if let [c, ..] = rest {
                *z = *c;
            }
        }
    }
    for x in groups {
        let Some(row) = rows.get_mut(at) else {
            break;
        };
        *row = *x;
        at += stride;
    }
}

/// Moves `kept` rows, a multiple of four, that begin `by` rows behind `begin` to there.
fn shift(rows: &mut [Row], begin: usize, kept: usize, by: usize) {
    let rows = rows.get_mut(begin..).unwrap_or_default();
    let mut rest = rows.get_mut(..by + kept).unwrap_or_default();
    if by < 4 {
        for to in 0..kept {
            if let Some(from) = rest.get(to + by).copied()
                && let Some(to) = rest.get_mut(to)
            {
                *to = from;
            }
        }
        return;
    }
    // By fours, since a loop over single ones would become a call that moves word by word.
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

    use super::super::half_band::{NARROW_EARLY, NARROW_LAST, WIDE_EARLY, WIDE_LAST};
    use super::*;
    use std::vec;
    use std::vec::Vec;

    /// Every second output of a filter as it is written in books: all taps over all samples, those
    /// beside the middle one first.
    fn by_the_book(h: &[f32], taps: usize, samples: &[f32]) -> Vec<f32> {
        let mut padded = vec![0.0; taps - 1];
        padded.extend(samples);
        let outputs = padded.windows(taps).skip(1).step_by(2);
        let (half, odd) = (taps / 2, taps % 2);
        // Samples that far from the middle, on either side.
        let beside = |line: &[f32], i: usize| line[half - 1 - i] + line[half + odd + i];
        outputs
            .map(|line| {
                let pairs = h.iter().enumerate();
                if taps == 4 * h.len() - 1 {
                    pairs.fold(line[half], |sum, (i, h)| sum + h * beside(line, 2 * i))
                } else if odd == 1 {
                    pairs.fold(line[half], |sum, (i, h)| sum + h * beside(line, i))
                } else {
                    pairs.fold(beside(line, 0), |sum, (i, h)| sum + h * beside(line, i + 1))
                }
            })
            .collect()
    }

    /// Outputs of `channels` channels, taken in batches.
    fn outputs(filters: Filters, channels: &[Vec<f32>], batch: usize) -> Vec<Vec<f32>> {
        const N: usize = 16;
        let mut decimator = Decimator::new(filters, channels.len());
        let mut states = vec![0.0; filters.state_len(channels.len())];
        let mut rings = vec![0.0; N * channels.len()];
        let mut found = vec![Vec::new(); channels.len()];
        let mut head = 0;
        decimator.begin(0, batch);
        for n in 0..channels[0].len() {
            let sample: Vec<f32> = channels.iter().map(|x| x[n]).collect();
            if decimator.push(&mut states, &sample) {
                decimator.filter::<f32>(&mut states, &mut rings, (N, head), batch);
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
            (0.25, (&NARROW_EARLY[..], 6), (&NARROW_LAST[..], 9)),
            (0.39, (&WIDE_EARLY, 19), (&WIDE_LAST, 59)),
        ] {
            for stages in 1..=MAX_STAGES {
                let filters = Filters::new(stages, share);
                for batch in [filters.batch(), 2, 1] {
                    let found = outputs(filters, &channels, batch);
                    for (found, samples) in found.iter().zip(&channels) {
                        let early = (1..stages)
                            .fold(samples.clone(), |x, _| by_the_book(early.0, early.1, &x));
                        let expected = by_the_book(last.0, last.1, &early);
                        assert_eq!(*found, expected, "{stages} {batch}");
                        assert_eq!(found.len(), samples.len() >> stages);
                    }
                }
            }
        }
    }

    #[test]
    fn a_constant_comes_out_every_fourth_time() {
        let filters = Filters::new(2, 0.25);
        let found = outputs(filters, &[vec![1.0; 832]], filters.batch());
        assert_eq!(found[0].len(), 208);
        let Gain::OfLines(gains) = filters.gain() else {
            panic!("all lines pass alike");
        };
        let gain = 2.0 * gains.of_block(64)[0];
        for y in &found[0][filters.settling() >> 2..] {
            // Rounded by the two filters and the gain.
            assert!((y * gain - 1.0).abs() < 3e-7, "{y}");
        }
    }

    #[test]
    fn settling_is_when_the_start_is_forgotten() {
        let filters = Filters::new(3, 0.39);
        let run = |lead: f32| {
            let mut samples: Vec<f32> = (0..1600).map(|n| libm::sinf(n as f32)).collect();
            samples[0] = lead;
            outputs(filters, &[samples], filters.batch()).remove(0)
        };
        let (a, b) = (run(0.0), run(1000.0));
        let differ = |n: usize| a[n] != b[n];
        let first = filters.settling() >> 3;
        assert!((0..first).any(differ));
        assert!(!(first..a.len()).any(differ));
    }
}
