//! The run that is going on: samples become blocks, blocks become an average.

use super::memory::{AVERAGED, Averaging};
use super::readings::Sample;
use super::setup::Lines;
use super::storage::Storage;
use super::survey::Survey;
use super::synthetic::Synthetic;
use super::{Board, Transmit};
use crate::capacity::SENSORS;
use crate::wire::{
    Accelerations, Block, Event, Health, Outcome, Progress, Quality, Running, Source, Start,
    Summary,
};
use massline_core::geometry::RESULTANTS;
use massline_core::spectra::{Complex32, DriveAverage, Rings};

/// Largest reading that is taken as such, of any sensor in any unit. Up to it, a line of 1024
/// samples squared and summed over 10⁷ blocks stays below 1e37, within `f32`.
const BOUND: f32 = 1e12;

/// Source of a run's samples.
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one, and no allocator to put a body elsewhere"
)]
pub(super) enum Feed {
    /// The host sends them.
    Host,
    /// The box's own converters.
    Inputs {
        /// Number of the converters' sample that is the run's first.
        origin: Option<u64>,
    },
    /// The body that the box computes.
    Synthetic(Synthetic),
}

/// Purpose of a run.
#[derive(Debug)]
pub(super) enum Task {
    /// Twelve resultants, to be stored.
    Measure(Accelerations),
    /// Peaks of single accelerometers.
    Survey(Survey),
}

/// Everything of a run that depends on its set-up, ready before it starts.
#[derive(Debug)]
pub(super) struct Prepared {
    pub(super) lines: Lines,
    pub(super) rings: Rings,
    pub(super) task: Task,
    pub(super) feed: Feed,
}

/// The end of a run that is over.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ended {
    pub(super) start: Start,
    pub(super) taken: Progress,
}

/// Counts of a run so far.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    /// Index of the sample that is expected next.
    next: u64,
    missing: u64,
    overloads: u64,
    /// Blocks complete, averaged or not.
    blocks: u32,
    averaged: u32,
    rejected: u32,
    rejected_by: [u32; Health::KINDS],
    health: Health,
}

/// The run that is going on.
#[derive(Debug)]
pub(super) struct Run<'m> {
    pub(super) start: Start,
    pub(super) feed: Feed,
    pub(super) storage: Storage<'m>,
    lines: Lines,
    rings: Rings,
    task: Task,
    counts: Counts,
    /// Index after the last sample that rests on a faulty one.
    spoilt: u64,
    /// The last one that rests on none.
    good: [f32; AVERAGED],
    /// Index of the first sample of the block that is under way.
    block_first: u64,
    /// Index after the last sample with each fault.
    faulty: [u64; Health::KINDS],
    /// Ticks at the first and the last sample.
    ticks: [u64; 2],
    /// Longest that a block took, ticks.
    pub(super) longest: u32,
}

impl<'m> Run<'m> {
    /// Starts a run in storage whose scratch memory was cleared for it and has its channels and
    /// its geometry.
    pub(super) fn new(start: Start, prepared: Prepared, storage: Storage<'m>) -> Self {
        let Prepared {
            lines,
            rings,
            task,
            feed,
        } = prepared;
        Self {
            start,
            feed,
            storage,
            lines,
            rings,
            task,
            counts: Counts::default(),
            spoilt: 0,
            good: [0.0; AVERAGED],
            block_first: 0,
            faulty: [0; Health::KINDS],
            ticks: [0; 2],
            longest: 0,
        }
    }

    /// `true` if its samples are those of the box's own converters.
    pub(super) fn is_of_inputs(&self) -> bool {
        matches!(self.feed, Feed::Inputs { .. })
    }

    /// The run as the host is told of it.
    pub(super) fn running(&self) -> Running {
        Running {
            run: self.start.run,
            pass: self.start.pass,
            source: self.start.source,
            next: self.counts.next,
            blocks: self.counts.averaged,
        }
    }

    /// Index of the sample that is expected next.
    pub(super) fn next(&self) -> u64 {
        self.counts.next
    }

    /// Samples so far, in the words of a reply.
    pub(super) fn taken(&self) -> Progress {
        Progress {
            next: self.counts.next,
            missing: self.counts.missing,
        }
    }

    /// Channels of a sample.
    pub(super) fn channels(&self) -> usize {
        self.storage.scratch.run().map_or(0, |r| r.channels.count())
    }

    /// `true` once the run has all the samples it was started for.
    pub(super) fn is_complete(&self) -> bool {
        self.start.limit.is_some_and(|l| self.counts.next >= l)
    }

    /// Notes that all samples before number `first` are missing. The block they are
    /// missing from is rejected, the next one begins with that sample.
    #[inline]
    pub(super) fn skip_to(&mut self, first: u64, out: &mut impl Transmit) {
        if first > self.counts.next {
            self.skip(first, out);
        }
    }

    #[cold]
    fn skip(&mut self, first: u64, out: &mut impl Transmit) {
        let first = self.start.limit.map_or(first, |limit| first.min(limit));
        if first <= self.counts.next {
            return;
        }
        let missing = first.saturating_sub(self.counts.next);
        // All samples are counted in 64 bits, so those that are missing are, too.
        self.counts.missing = self.counts.missing.saturating_add(missing);
        self.counts.next = first;
        self.reject(Health::MISSING, 0, out);
        if let Some(room) = self.storage.scratch.run_mut() {
            self.rings.restart();
            room.channels.skip(missing);
            room.alignment.restart();
        }
        self.faulty = [0; Health::KINDS];
        self.spoilt = 0;
        self.block_first = first;
    }

    /// Takes the next sample.
    pub(super) fn push(
        &mut self,
        sample: &Sample<'_>,
        board: &impl Board,
        out: &mut impl Transmit,
    ) {
        let taken = match sample {
            Sample::Counts { ticks, .. } => *ticks,
            _ => board.ticks(),
        };
        if self.counts.next == self.counts.missing {
            self.ticks[0] = taken;
        }
        self.ticks[1] = taken;
        let index = self.counts.next;
        self.counts.next = index.saturating_add(1);
        let Some(room) = self.storage.scratch.run_mut() else {
            return;
        };
        let mut health = room.channels.take(sample, index, out);
        let is_aligned = room.channels.align(&mut room.alignment);
        let sensors = room.channels.sensors();
        let [a, b, c, d, e, f, g, h, i, j, k, l] = match &self.task {
            Task::Measure(_) => room.geometry.map.apply(sensors),
            Task::Survey(survey) => survey.select(sensors),
        };
        let drive = room.channels.drive();
        // No smaller than any of them, and written out: a loop over them takes three times as long.
        let accelerations = a.abs() + b.abs() + c.abs() + d.abs() + e.abs() + f.abs();
        let forces = g.abs() + h.abs() + i.abs() + j.abs() + k.abs() + l.abs();
        let largest = drive.abs() + accelerations + forces;
        let mut input = [drive, a, b, c, d, e, f, g, h, i, j, k, l];
        // Not a number is not below it, either.
        let is_usable = |x: f32| x < BOUND;
        if !is_usable(largest) {
            for x in input.iter_mut().filter(|x| !is_usable(x.abs())) {
                health = health.union(Health::NOT_FINITE);
                *x = 0.0;
            }
        }
        if health.contains(Health::OVERLOAD) {
            self.counts.overloads = self.counts.overloads.saturating_add(1);
        }
        if !health.is_good() {
            // And of all samples that rest on it.
            let [reach, _] = room.alignment.reach();
            self.spoilt = index.saturating_add(1).saturating_add(reach as u64);
            for (kind, last) in self.faulty.iter_mut().enumerate() {
                if health.contains(Health(1 << kind)) {
                    *last = self.spoilt;
                }
            }
        }
        // In place of a sample that rests on a faulty one stays the last good one: filters remember it longer
        // than its blocks are left out.
        if index >= self.spoilt {
            self.good = input;
        }
        if !is_aligned || !self.rings.push(&mut room.history, &self.good) {
            return;
        }
        let begun = board.ticks();
        let [_, delay] = room.alignment.reach();
        let support = self.lines.settings.support() as u64;
        let first = self.counts.next.saturating_sub(support);
        let mut faults = 0;
        for (kind, last) in self.faulty.iter().enumerate() {
            if *last > first {
                faults |= 1 << kind;
            }
        }
        let health = Health(faults);
        let first = first.saturating_sub(delay as u64);
        self.block_first = first;
        if health.is_good() {
            self.average();
            self.counts.averaged = self.counts.averaged.saturating_add(1);
            let coherence = self.coherence();
            let ticks = self.since(begun, board);
            self.report(Health::GOOD, coherence, ticks, out);
        } else {
            let ticks = self.since(begun, board);
            self.reject(health, ticks, out);
        }
        self.block_first = first.saturating_add(self.lines.settings.hop() as u64);
        if let Task::Survey(survey) = &mut self.task
            && survey.turn()
        {
            self.rings.restart();
            self.block_first = self.counts.next;
        }
    }

    /// Transforms the block that is complete, two channels at a time, and adds it to the
    /// average.
    fn average(&mut self) {
        let count = self.lines.settings.grid().count;
        let Storage {
            scratch,
            work,
            lines,
            ..
        } = &mut self.storage;
        let Some(Averaging { history, sums, .. }) = scratch.run_mut() else {
            return;
        };
        let (average, wanted) = match &mut self.task {
            Task::Measure(..) => {
                let blocks = self.counts.averaged;
                let average = DriveAverage::resume(count, RESULTANTS, sums, blocks);
                (average.ok(), 0..count)
            }
            Task::Survey(survey) => {
                let wanted = survey.lines();
                (survey.average(sums), wanted)
            }
        };
        let Some(mut average) = average else {
            return;
        };
        let (drive, rest) = lines.split_at_mut(count.min(lines.len()));
        let response = rest.get_mut(..count).unwrap_or_default();
        fn part<'l>(lines: &'l [Complex32], wanted: &core::ops::Range<usize>) -> &'l [Complex32] {
            let end = wanted.end.min(lines.len());
            lines.get(wanted.start..end).unwrap_or(&[])
        }
        // The drive is the first channel, responses follow.
        self.rings.transform(0, history, work, drive);
        let drive = part(drive, &wanted);
        average.add_drive(drive);
        for c in 0..RESULTANTS {
            self.rings.transform(1 + c, history, work, response);
            average.add_response(c, drive, part(response, &wanted));
        }
    }

    fn since(&mut self, begun: u64, board: &impl Board) -> u32 {
        let ticks = u32::try_from(board.ticks().saturating_sub(begun)).unwrap_or(u32::MAX);
        self.longest = self.longest.max(ticks);
        ticks
    }

    fn reject(&mut self, health: Health, ticks: u32, out: &mut impl Transmit) {
        self.counts.rejected = self.counts.rejected.saturating_add(1);
        self.counts.health = self.counts.health.union(health);
        for (kind, count) in self.counts.rejected_by.iter_mut().enumerate() {
            if health.contains(Health(1 << kind)) {
                *count = count.saturating_add(1);
            }
        }
        self.report(health, None, ticks, out);
    }

    /// Coherences so far, where there are any.
    fn coherence(&mut self) -> Option<[f32; RESULTANTS]> {
        let Task::Measure(..) = self.task else {
            return None;
        };
        if self.counts.averaged < 2 {
            return None;
        }
        let count = self.lines.settings.grid().count;
        let sums = &mut self.storage.scratch.run_mut()?.sums;
        let average = DriveAverage::resume(count, RESULTANTS, sums, self.counts.averaged);
        let average = average.ok()?;
        let band = self.lines.band;
        Some(core::array::from_fn(|c| average.mean_coherence(c, band)))
    }

    /// Reports the block that is complete to the host.
    fn report(
        &mut self,
        health: Health,
        coherence: Option<[f32; RESULTANTS]>,
        ticks: u32,
        out: &mut impl Transmit,
    ) {
        out.event(&Event::Block(Block {
            run: self.start.run,
            pass: self.start.pass,
            block: self.counts.blocks,
            first: self.block_first,
            health,
            averaged: self.counts.averaged,
            coherence,
            ticks,
        }));
        self.counts.blocks = self.counts.blocks.saturating_add(1);
    }

    /// SI samples of the channels, as the last sample left them.
    pub(super) fn readings(&self) -> &[f32] {
        let room = self.storage.scratch.run();
        room.map_or(&[], |room| room.channels.readings())
    }

    /// Ends the run: the average of a measuring pass is stored, the peaks of a survey returned.
    pub(super) fn finish(
        &mut self,
        outcome: Outcome,
        tick_hz: u32,
    ) -> (Summary, Option<[f64; SENSORS]>) {
        let mut noise = None;
        let mut peaks = None;
        let grid = self.lines.settings.grid();
        let blocks = self.counts.averaged;
        let run = usize::from(self.start.run);
        let Storage { scratch, runs, .. } = &mut self.storage;
        if let Some(room) = scratch.run_mut() {
            match &self.task {
                Task::Survey(survey) => peaks = survey.peaks(&mut room.sums),
                Task::Measure(accelerations) => {
                    runs.forget(run);
                    let quality = Quality {
                        blocks,
                        rejected: self.counts.rejected,
                        rejected_by: self.counts.rejected_by,
                        missing: self.counts.missing,
                        health: self.counts.health,
                    };
                    let average =
                        DriveAverage::resume(grid.count, RESULTANTS, &mut room.sums, blocks);
                    let settings = &self.lines.settings;
                    let hop = settings.hop() as f64 / settings.block_length() as f64;
                    let correlation = settings.window().block_correlation(hop);
                    // Scatter, and with it noise, shows from two blocks on.
                    if let Ok(average) = average
                        && blocks >= 2
                    {
                        noise = runs.keep(
                            run,
                            &average,
                            grid,
                            self.lines.band,
                            correlation,
                            &room.geometry.map,
                            *accelerations,
                            quality,
                        );
                    }
                }
            }
        }
        let received = self.counts.next.saturating_sub(self.counts.missing);
        let elapsed = self.ticks[1].saturating_sub(self.ticks[0]);
        let sample_rate = (self.start.source == Source::Inputs && elapsed > 0).then(|| {
            // From the first sample to the last, missing ones among them.
            let steps = self.counts.next.saturating_sub(1) as f64;
            steps * f64::from(tick_hz) / elapsed as f64
        });
        let summary = Summary {
            run: self.start.run,
            pass: self.start.pass,
            source: self.start.source,
            outcome,
            samples: received,
            missing: self.counts.missing,
            blocks,
            rejected: self.counts.rejected,
            rejected_by: self.counts.rejected_by,
            health: self.counts.health,
            overloads: self.counts.overloads,
            sample_rate,
            noise,
        };
        (summary, peaks)
    }
}
