//! Decimation by two, stage by stage, before the transform.
//!
//! The lines of interest lie far below half the sample rate. A quarter of the samples, and
//! of the memory, carries them as well as all of them do, if the frequencies that would fold onto
//! them are filtered out first. All channels, the drive among them, pass the same filters, so responses
//! and coherences do not notice.
//!
//! The filters are those of `half_band.rs`. Some samples of each channel are collected, then filtered by all
//! stages at once. The channels lie side by side by fours or eights, so that a group of them is stored at once.

use super::half_band::{
    NARROW_EARLY, NARROW_LAST, WIDE_EARLY, WIDE_LAST, narrow_early, narrow_last_two, narrow_only,
    state_len, wide_early, wide_last_two, wide_only,
};
use super::lane::{Lane, Row};

/// Share of the decimated block up to which lines may be kept: the pass band's edge.
pub(super) const USABLE: f64 = 25.0 / 64.0;
/// Share of the decimated block up to which the filters of fewer sections pass.
const NARROW: f64 = 1.0 / 4.0;
/// Most stages: a factor of sixteen.
pub(super) const MAX_STAGES: usize = 4;
/// Samples of a channel that are collected before they are filtered, at most.
const COLLECTED: usize = 64;

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

    /// Numbers that a stage before the last one remembers, and the last one.
    const fn states(&self) -> [usize; 2] {
        if self.wide {
            [state_len(WIDE_EARLY.len()), state_len(WIDE_LAST.len())]
        } else {
            [state_len(NARROW_EARLY.len()), state_len(NARROW_LAST.len())]
        }
    }

    /// Rows of what all stages remember of a group of channels.
    const fn state_rows(&self) -> usize {
        match self.stages {
            0 => 0,
            stages => {
                let [early, last] = self.states();
                (stages - 1) * early + last
            }
        }
    }

    /// Elements of storage that `channels` in groups of `group` need: for samples that wait, for outputs of
    /// the stages before the last two, and for what all stages remember.
    pub(super) const fn storage_len(&self, channels: usize, group: usize) -> usize {
        let groups = channels.div_ceil(group);
        group * (COLLECTED * (groups + 1) + groups * self.state_rows())
    }

    /// Outputs after a start that are part of no block. Later ones see the samples that there were not by a
    /// thousandth or less, which falls by a quarter or an eighth with each output, while a window rises
    /// from zero: less than a hundredth of what noise of a thousandth does to a response. Without a window
    /// they are twice as many, for a millionth.
    pub(super) const fn settling(&self, is_windowed: bool) -> usize {
        let outputs = match (self.stages, self.wide) {
            (0, _) => 0,
            (_, false) => 24,
            (_, true) => 64,
        };
        if is_windowed { outputs } else { 2 * outputs }
    }
}

/// Samples on their way through the filters.
#[derive(Clone, Copy, Debug)]
pub struct Decimator {
    filters: Filters,
    channels: usize,
    /// Groups of channels that lie side by side.
    groups: usize,
    /// Samples that have come since the filters ran.
    collected: usize,
    /// Samples that come before they run.
    wanted: usize,
    /// `true` until they have run.
    is_fresh: bool,
}

impl Decimator {
    /// Filters of so many channels in groups of `group`, to be begun.
    pub(super) fn new(filters: Filters, channels: usize, group: usize) -> Self {
        Self {
            filters,
            channels,
            groups: channels.div_ceil(group),
            collected: 0,
            wanted: 0,
            is_fresh: true,
        }
    }

    /// Forgets all samples: the next one counts as if it had been there for ever.
    pub(super) fn restart(&mut self) {
        self.is_fresh = true;
    }

    /// Begins to collect the samples of at most `outputs` outputs.
    pub(super) fn begin(&mut self, outputs: usize) {
        self.collected = 0;
        self.wanted = (outputs << self.filters.stages).min(COLLECTED);
    }

    /// The samples of each group that wait.
    #[inline(always)]
    fn queues<'s, R: Row>(&self, storage: &'s mut [f32]) -> &'s mut [[R; COLLECTED]] {
        let (queues, _) = R::rows_mut(storage).as_chunks_mut();
        queues.get_mut(..self.groups).unwrap_or_default()
    }

    /// Takes one sample of every channel into its storage of [`Filters::storage_len`]; a channel that
    /// `sample` lacks reads zero. `true` once the filters can run.
    #[inline]
    pub(super) fn push<R: Row>(&mut self, storage: &mut [f32], sample: &[f32]) -> bool {
        let at = self.collected;
        if sample.len() == self.channels {
            R::store(
                R::rows_mut(storage).as_chunks_mut::<COLLECTED>().0,
                at,
                sample,
            );
        } else {
            self.store_other::<R>(storage, sample);
        }
        self.collected = at + 1;
        self.collected == self.wanted
    }

    /// Stores a sample that lacks channels, or has too many.
    #[cold]
    fn store_other<R: Row>(&self, storage: &mut [f32], sample: &[f32]) {
        let queues = self.queues::<R>(storage);
        for row in queues
            .iter_mut()
            .filter_map(|queue| queue.get_mut(self.collected))
        {
            *row = R::ZERO;
        }
        R::store(
            queues,
            self.collected,
            sample.get(..self.channels).unwrap_or(sample),
        );
    }

    /// Filters the samples that were collected, of every channel. The outputs of each, too large by two a
    /// stage, go to its ring of `n` from `head` on; their number.
    #[cfg_attr(target_os = "none", inline(never))] // Storing a sample is to be short.
    #[cfg_attr(not(target_os = "none"), inline(always))] // Its caller says for which processor.
    pub(super) fn filter<L: Lane>(
        &mut self,
        storage: &mut [f32],
        rings: &mut [f32],
        (n, head): (usize, usize),
    ) -> usize {
        let rows = L::Row::rows_mut(storage);
        let (queues, rest) = rows
            .split_at_mut_checked(self.groups * COLLECTED)
            .unwrap_or_default();
        let (room, states) = rest.split_at_mut_checked(COLLECTED).unwrap_or_default();
        let queues = queues.as_chunks::<COLLECTED>().0.iter();
        let mut rest = states;
        let rings = L::samples_mut(rings).chunks_mut((n * (L::Row::CHANNELS / L::WIDTH)).max(1));
        for (queue, rings) in queues.zip(rings) {
            let own = self.filters.state_rows();
            let (states, later) = rest.split_at_mut_checked(own).unwrap_or_default();
            rest = later;
            let samples = queue.get(..self.wanted).unwrap_or_default();
            if self.is_fresh
                && let Some(first) = samples.first()
            {
                self.rest::<L>(first, states);
            }
            self.run::<L>(states, samples, room, rings, (n, head));
        }
        self.is_fresh = false;
        self.wanted >> self.filters.stages
    }

    /// Lets the stages of a group remember a constant.
    fn rest<L: Lane>(&self, constant: &L::Row, states: &mut [L::Row]) {
        let [early, last] = self.filters.states();
        let mut rest = L::samples_mut(L::Row::numbers_mut(states));
        let lanes = L::Row::CHANNELS / L::WIDTH;
        let mut gain = 1.0;
        for stage in 1..=self.filters.stages {
            let len = if stage < self.filters.stages {
                early
            } else {
                last
            };
            let (own, later) = rest.split_at_mut_checked(lanes * len).unwrap_or_default();
            for (lane, states) in own.chunks_exact_mut(len).enumerate() {
                states.fill(L::of_row(constant, lane * L::WIDTH).times(gain));
            }
            rest = later;
            gain *= 2.0;
        }
    }

    /// Filters a group by all stages: as many lanes as there are rings. `room` takes the outputs of the stages
    /// before the last two, one behind the other.
    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn run<L: Lane>(
        &self,
        states: &mut [L::Row],
        samples: &[L::Row],
        room: &mut [L::Row],
        rings: &mut [L],
        (n, head): (usize, usize),
    ) {
        let Filters { stages, wide } = self.filters;
        let [early, _] = self.filters.states();
        let lanes = rings.len() / n.max(1);
        let (mut states, mut inputs, mut room) = (states, samples, room);
        for _ in 2..stages {
            let (own, later) = states.split_at_mut_checked(early).unwrap_or_default();
            let (outputs, rest) = room
                .split_at_mut_checked(inputs.len() / 2)
                .unwrap_or_default();
            if wide {
                wide_early::<L>(lanes, own, inputs, outputs);
            } else {
                narrow_early::<L>(lanes, own, inputs, outputs);
            }
            (states, inputs, room) = (later, outputs, rest);
        }
        // Up to the end of the rings, then from their beginning on.
        let until_end = n.saturating_sub(head) << stages.min(2);
        let (now, then) = inputs.split_at(inputs.len().min(until_end));
        for (inputs, at) in [(now, head), (then, 0)] {
            if inputs.is_empty() {
                break;
            }
            let place = (n, at);
            match (stages, wide) {
                (0, _) => unfiltered(inputs, rings, place),
                (1, false) => narrow_only(states, inputs, rings, place),
                (1, true) => wide_only(states, inputs, rings, place),
                (_, false) => narrow_last_two(states, inputs, rings, place),
                (_, true) => wide_last_two(states, inputs, rings, place),
            }
        }
    }
}

/// Hands on the samples of a group, as many lanes as there are rings of `n`, whose places from `at` on take
/// them.
#[cfg_attr(target_os = "none", inline(never))] // All registers are its own.
#[cfg_attr(not(target_os = "none"), inline(always))]
fn unfiltered<L: Lane>(samples: &[L::Row], rings: &mut [L], (n, at): (usize, usize)) {
    let mut l = 0;
    for ring in rings.chunks_exact_mut(n.max(1)) {
        let slots = ring.get_mut(at..at + samples.len()).unwrap_or_default();
        let (eights, samples) = samples.as_chunks();
        let (slots, rest) = slots.as_chunks_mut();
        for (slots, rows) in slots.iter_mut().zip(eights) {
            *slots = eight_of(rows, l);
        }
        for (y, row) in rest.iter_mut().zip(samples) {
            *y = L::of_row(row, l);
        }
        l += L::WIDTH;
    }
}

/// Eight samples of a lane. All is written out, as the filters are.
#[inline(always)]
fn eight_of<L: Lane>([a, b, c, d, e, f, g, h]: &[L::Row; 8], l: usize) -> [L; 8] {
    [
        L::of_row(a, l),
        L::of_row(b, l),
        L::of_row(c, l),
        L::of_row(d, l),
        L::of_row(e, l),
        L::of_row(f, l),
        L::of_row(g, l),
        L::of_row(h, l),
    ]
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::super::lane::GROUP;
    use super::*;
    use std::vec;
    use std::vec::Vec;

    /// Every second output, doubled, of a filter as it is written in books: each branch is a cascade of
    /// sections, which all rest at `rest` before the first sample.
    fn by_the_book(h: &[f32], rest: f32, samples: &[f32]) -> Vec<f32> {
        let branch = |from: usize| -> Vec<f32> {
            let samples: Vec<f32> = samples.iter().copied().skip(1 - from).step_by(2).collect();
            h.iter().skip(from).step_by(2).fold(samples, |x, &c| {
                let (mut before, mut y) = (rest, rest);
                let section = |&x: &f32| {
                    y = c * (x - y) + before;
                    before = x;
                    y
                };
                x.iter().map(section).collect()
            })
        };
        let [second, first] = [0, 1].map(branch);
        second.iter().zip(first).map(|(a, b)| a + b).collect()
    }

    /// Outputs of `channels` channels, taken in batches.
    fn outputs(filters: Filters, channels: &[Vec<f32>], batch: usize) -> Vec<Vec<f32>> {
        const N: usize = 32;
        let mut decimator = Decimator::new(filters, channels.len(), GROUP);
        let mut states = vec![0.0; filters.storage_len(channels.len(), GROUP)];
        let mut rings = vec![0.0; N * channels.len()];
        let mut found = vec![Vec::new(); channels.len()];
        let mut head = 0;
        decimator.begin(batch);
        for n in 0..channels[0].len() {
            let sample: Vec<f32> = channels.iter().map(|x| x[n]).collect();
            if decimator.push::<[f32; GROUP]>(&mut states, &sample) {
                let count = decimator.filter::<f32>(&mut states, &mut rings, (N, head));
                decimator.begin(batch);
                for (found, ring) in found.iter_mut().zip(rings.chunks(N)) {
                    found.extend((0..count).map(|k| ring[(head + k) % N]));
                }
                head = (head + count) % N;
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
                for batch in (1..=32).rev() {
                    let found = outputs(filters, &channels, batch);
                    for (found, samples) in found.iter().zip(&channels) {
                        let (mut x, mut rest) = (samples.clone(), samples[0]);
                        for _ in 1..stages {
                            (x, rest) = (by_the_book(early, rest, &x), 2.0 * rest);
                        }
                        let expected = by_the_book(last, rest, &x);
                        assert!(*found == expected[..found.len()], "{stages} {batch}");
                        let at_once = batch.min(COLLECTED >> stages);
                        let whole = (samples.len() >> stages) / at_once * at_once;
                        assert_eq!(found.len(), whole);
                    }
                }
            }
        }
    }

    #[test]
    fn a_constant_comes_out_from_the_first_output_on() {
        for share in [0.25, 0.39] {
            for stages in 1..=MAX_STAGES {
                let found = outputs(Filters::new(stages, share), &[vec![0.1; 800]], 4);
                assert!(found[0].len() >= 40);
                let expected = 0.1 * (1 << stages) as f32;
                assert!(found[0].iter().all(|y| *y == expected));
            }
        }
    }

    /// A start where a sample is not what it was before, and one in between.
    #[test]
    fn what_was_before_is_forgotten_as_fast_as_settings_count_on() {
        for share in [0.25, 0.39] {
            for stages in 1..=MAX_STAGES {
                let filters = Filters::new(stages, share);
                let left = |at: usize, is_windowed: bool| {
                    let mut samples: Vec<f32> = vec![0.0; 4096];
                    samples[..=at].fill(1.0);
                    let found = outputs(filters, &[samples], 1).remove(0);
                    // The first output that sees no sample but later ones, other than by what is remembered.
                    let seen = (at >> stages) + 1;
                    let left = found[seen + filters.settling(is_windowed)..].iter();
                    // An output is as much larger than a constant.
                    left.fold(0.0_f32, |m, y| m.max(y.abs())) / (1 << stages) as f32
                };
                for at in [0, 1, (1 << stages) - 1, 1 << stages, 500] {
                    let found = [true, false].map(|is_windowed| left(at, is_windowed));
                    let [windowed, not] = found;
                    assert!(
                        (1e-9..1e-3).contains(&windowed) && not < 1e-6,
                        "{share} {stages} {at}: {found:?}"
                    );
                }
            }
        }
    }
}
