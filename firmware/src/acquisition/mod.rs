//! From edges of DRDY lines to samples whose faults are named.
//!
//! # Design
//!
//! All converters run on one clock and one SYNC line, so that their samples are ready at the same
//! instant. The first DRDY line that falls raises the interrupt; shortly afterwards (1 µs) all
//! lines are looked at, and [`Acquisition::edge`] is called with what was seen. It reads every
//! converter once, and gives one sample of all inputs under one number.
//!
//! | what happens | what the sample says | what is done |
//! | --- | --- | --- |
//! | a frame with a wrong checksum, or of one level throughout | `CHECKSUM` or `STUCK` on that converter's inputs | nothing; after [`GARBLED`] in a row the converter is prepared anew |
//! | an edge was lost, or came while the box was busy | numbers jump, and `MISSING` on all inputs | buffers are emptied: what they held has no sure number |
//! | an edge beside the grid of samples | `MISSING` on all inputs | after [`BESIDE`] in a row the grid is taken to be there |
//! | one line is not low when the others are | `MISSING` on its inputs; after [`ABSENT`] in a row `OUT_OF_STEP` | all are restarted together |
//! | a line falls when the others do not | `OUT_OF_STEP` on its inputs from the next sample on | all are restarted together |
//! | a converter says it was restarted | `OUT_OF_STEP` | all are restarted together |
//! | a converter says it was reset, or is not configured as it was | `CONVERTER_RESET` | it is prepared anew, all are restarted together |
//! | a converter cannot be prepared | `MISSING`, and what it was lost for | again after [`RETRY`] samples; the others go on without |
//! | a converter is not there, and nobody needs it | `MISSING` on its inputs | [`Acquisition::leave_out`] |
//! | no edge at all | numbers jump | [`Acquisition::watch`] prepares all and restarts them |
//!
//! A converter that is not where the others are is asked at once whether it was reset: then that
//! is the fault's name, and not what follows from it.
//!
//! A restart moves the grid of samples and unsettles the filters, so that all inputs carry its
//! reason from the restart on until [`SETTLING`] samples have gone by. It is made at the moment
//! of an edge, so that the grid moves little.
//!
//! What is not seen: a converter that falls behind by less than a quarter of a period in the very
//! sample whose edges are lost on all other lines. Its own edge then stands for theirs, and its
//! counts are believed for one sample, until the next edge shows who is late.
//!
//! Counts of a converter always go to its own inputs: nothing that is missing shifts what is not.

mod chip;
mod grid;

use self::chip::{Chip, State};
use self::grid::{Grid, Place};
use crate::drivers::{Converter, Fault};
use crate::wire::{self, FaultCounters, FaultKind, Health};

/// Samples after a restart that are not believed: the response of a third-order filter.
pub const SETTLING: u8 = 3;
/// Samples in a row that a converter may be absent from before it counts as out of step.
pub const ABSENT: u8 = 3;
/// Frames in a row with wrong checksums after which a converter is prepared anew.
pub const GARBLED: u8 = 8;
/// Edges in a row beside the grid after which the grid is moved there.
pub const BESIDE: u8 = 3;
/// Samples until a converter that could not be prepared is tried again.
pub const RETRY: u32 = 512;
/// Samples that a converter can hold, and one more.
const BUFFERED: u8 = 3;
/// Periods without an edge after which nobody answers any more.
const SILENT: u64 = 8;

/// One sample of all inputs, taken at the same instant.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Its number since the start. Neighbours that differ by more than one have lost samples
    /// between them.
    pub number: u64,
    /// Counts of all inputs. That of a faulty input is what came last, or zero.
    pub counts: &'a [i32],
    /// Faults of all inputs.
    pub health: &'a [Health],
}

/// Reads up to `CHIPS` converters with up to `INPUTS` inputs together.
#[derive(Clone, Debug)]
pub struct Acquisition<const CHIPS: usize, const INPUTS: usize> {
    grid: Grid,
    number: u64,
    chips: [Chip; CHIPS],
    counts: [i32; INPUTS],
    health: [Health; INPUTS],
    /// Why all converters are to be restarted at the next edge, if they are.
    restart: Option<Health>,
    /// Samples that are not believed yet, and why.
    settling: u8,
    reason: Health,
    beside: u8,
    faults: FaultCounters,
    told: Option<wire::Fault>,
}

impl<const CHIPS: usize, const INPUTS: usize> Acquisition<CHIPS, INPUTS> {
    const TOGETHER: () = assert!(CHIPS <= 32, "converters are bits of a word");
    /// The bits of all converters.
    const ALL: u32 = ((1_u64 << CHIPS) - 1) as u32;

    /// For converters whose samples are `period` ticks apart, nominally.
    #[must_use]
    pub fn new(period: f32) -> Self {
        let () = Self::TOGETHER;
        Self {
            grid: Grid::new(period),
            number: 0,
            chips: [Chip::NEW; CHIPS],
            counts: [0; INPUTS],
            health: [Health::MISSING; INPUTS],
            restart: None,
            settling: 0,
            reason: Health::GOOD,
            beside: 0,
            faults: FaultCounters::default(),
            told: None,
        }
    }

    /// Goes on counting faults from there.
    #[must_use]
    pub const fn counting_from(mut self, faults: FaultCounters) -> Self {
        self.faults = faults;
        self
    }

    /// Prepares all converters and starts them together by `synchronise`, which pulses the SYNC
    /// line. Samples come with the next edges.
    ///
    /// # Errors
    ///
    /// The fault of the first converter that cannot be prepared, with its number. The others
    /// are started all the same, and this one is tried again later.
    pub fn start(
        &mut self,
        converters: &mut [&mut dyn Converter],
        synchronise: &mut dyn FnMut(),
    ) -> Result<(), (u8, Fault)> {
        let mut result = Ok(());
        for (k, (chip, converter)) in (0..).zip(self.chips.iter_mut().zip(converters)) {
            chip.full = true;
            if chip.state == State::LeftOut {
                continue;
            }
            chip.state = match converter.prepare() {
                Ok(()) => State::InStep,
                Err(fault) => {
                    result = result.and(Err((k, fault)));
                    State::Down(RETRY)
                }
            };
        }
        self.synchronise(synchronise, Health::MISSING);
        result
    }

    /// Does without the converter of this number, which is not soldered, or not needed: its
    /// inputs are `MISSING` from now on, which is no fault.
    pub fn leave_out(&mut self, converter: usize) {
        if let Some(chip) = self.chips.get_mut(converter) {
            chip.state = State::LeftOut;
        }
    }

    /// Takes an edge of the DRDY lines.
    ///
    /// `ready` has a bit for each converter whose line was low shortly after the edge. `ticks`
    /// is when the edge came. Gives a sample unless the edge belongs to none.
    pub fn edge(
        &mut self,
        converters: &mut [&mut dyn Converter],
        synchronise: &mut dyn FnMut(),
        ready: u32,
        ticks: u64,
    ) -> Option<Sample<'_>> {
        if !self.is_majority(ready) {
            self.probe_early(converters, ready);
            // Where a line fell and no line is low, somebody may have a sample all the same.
            self.leave_unread(if ready == 0 { u32::MAX } else { ready });
            return None;
        }
        let (samples, on_grid) = match self.grid.edge(ticks) {
            Place::On(samples) => (samples, true),
            Place::Beside(samples) => (samples, false),
            Place::Same => {
                // Samples again, much too soon: who has none is the one that came early.
                self.lose_others(ready);
                self.leave_unread(ready);
                return None;
            }
        };
        self.number += samples;
        if samples > 1 || !on_grid {
            let missed = u32::try_from(samples.saturating_sub(1)).unwrap_or(u32::MAX);
            let missed_by_all = &mut self.faults.converter_missed;
            *missed_by_all = missed_by_all.saturating_add(missed);
            self.leave_unread(u32::MAX);
        }

        if on_grid {
            self.beside = 0;
        } else {
            self.faults.overrun = self.faults.overrun.saturating_add(1);
            self.beside += 1;
            if self.beside >= BESIDE {
                self.beside = 0;
                self.grid.moved();
            }
        }
        if let Some(reason) = self.restart
            && self.chips.iter().all(|c| c.state != State::Lost)
        {
            // What the converters hold is from before; they are read at the next edge.
            self.synchronise(synchronise, reason);
            self.health = [reason; INPUTS];
        } else {
            self.read_all(converters, ready, on_grid);
            if !on_grid {
                // Which samples were read is not known, nor what is left.
                self.leave_unread(u32::MAX);
            }
            self.settling = self.settling.saturating_sub(1);
        }
        self.prepare_one(converters);
        Some(Sample {
            number: self.number,
            counts: &self.counts,
            health: &self.health,
        })
    }

    /// To be called some ten times a second: when no edge has come for some periods, prepares
    /// all converters and restarts them. Says whether that was so.
    pub fn watch(
        &mut self,
        converters: &mut [&mut dyn Converter],
        synchronise: &mut dyn FnMut(),
        ticks: u64,
    ) -> bool {
        if !self.grid.is_silent(ticks, SILENT) {
            return false;
        }
        if let Err((part, _)) = self.start(converters, synchronise) {
            self.tell(FaultKind::Converter, Some(part));
        }
        true
    }

    /// What went wrong so far: the counters of converters, and overruns.
    pub const fn faults(&self) -> &FaultCounters {
        &self.faults
    }

    /// Counts faults anew.
    pub fn forget_faults(&mut self) {
        self.faults = FaultCounters::default();
    }

    /// A fault that the host should be told of, once.
    pub const fn take_fault(&mut self) -> Option<wire::Fault> {
        self.told.take()
    }

    /// Number of the last sample.
    pub const fn number(&self) -> u64 {
        self.number
    }

    /// Whether all converters sample together and have settled.
    pub fn is_steady(&self, converters: usize) -> bool {
        let chips = self.chips.iter().take(converters);
        let mut chips = chips.filter(|c| c.state != State::LeftOut);
        self.settling == 0
            && self.restart.is_none()
            && chips.all(|c| c.state == State::InStep && c.absent == 0)
    }

    /// Ticks from sample to sample, as measured.
    pub fn period(&self) -> f32 {
        self.grid.period()
    }

    /// Whether these are most of the converters that sample in step. A tie goes to the side of
    /// the first one.
    fn is_majority(&self, ready: u32) -> bool {
        // Nearly always; who is in step need not be known then.
        if ready & Self::ALL == Self::ALL {
            return true;
        }
        let mut in_step = 0_u32;
        for (k, chip) in self.chips.iter().enumerate() {
            in_step |= u32::from(chip.state == State::InStep) << k;
        }
        let both = ready & in_step;
        let first = in_step & in_step.wrapping_neg();
        match (2 * both.count_ones()).cmp(&in_step.count_ones()) {
            core::cmp::Ordering::Greater => true,
            // Where none is in step, any edge drives the recovery.
            core::cmp::Ordering::Equal => in_step == 0 || both & first != 0,
            core::cmp::Ordering::Less => false,
        }
    }

    fn synchronise(&mut self, synchronise: &mut dyn FnMut(), reason: Health) {
        synchronise();
        self.grid.moved();
        self.restart = None;
        self.reason = reason;
        self.settling = SETTLING;
        for chip in &mut self.chips {
            chip.full = true;
            chip.absent = 0;
            if chip.state == State::OutOfStep {
                chip.state = State::InStep;
            }
        }
    }

    /// Those whose lines fall before the others' are out of step, or worse.
    fn probe_early(&mut self, converters: &mut [&mut dyn Converter], ready: u32) {
        let mut counts = [0; INPUTS];
        for (k, (chip, converter)) in self.chips.iter_mut().zip(converters).enumerate() {
            // An edge from before a restart may still be pending after it.
            let is_early = ready >> k & 1 != 0 && self.settling < SETTLING;
            if is_early && chip.state == State::InStep {
                let found = chip.probe(&mut **converter, &mut counts, &mut self.faults);
                if found != Health::CONVERTER_RESET {
                    chip.lose_step(&mut self.faults, &mut self.restart);
                }
            }
        }
    }

    /// Converters that are in step, but not among these, are not.
    fn lose_others(&mut self, ready: u32) {
        for (k, chip) in self.chips.iter_mut().enumerate() {
            let is_other = ready >> k & 1 == 0 && self.settling < SETTLING;
            if is_other && chip.state == State::InStep {
                chip.lose_step(&mut self.faults, &mut self.restart);
            }
        }
    }

    /// These converters keep a sample that the next edge must not take for its own.
    fn leave_unread(&mut self, ready: u32) {
        for (k, chip) in self.chips.iter_mut().enumerate() {
            chip.full |= ready >> k & 1 != 0;
        }
    }

    fn read_all(&mut self, converters: &mut [&mut dyn Converter], ready: u32, on_grid: bool) {
        let mut first = 0;
        for (k, (chip, converter)) in self.chips.iter_mut().zip(converters).enumerate() {
            let inputs = first..first + converter.channels();
            first = inputs.end;
            let (Some(counts), Some(health)) = (
                self.counts.get_mut(inputs.clone()),
                self.health.get_mut(inputs),
            ) else {
                break;
            };
            let is_ready = ready >> k & 1 != 0;
            let settling = self.settling > 0;
            let mut found = chip.read(
                &mut **converter,
                counts,
                (is_ready, settling),
                &mut self.faults,
                &mut self.restart,
            );
            if settling {
                found = found.union(self.reason);
            }
            if !on_grid {
                found = found.union(Health::MISSING);
            }
            // All inputs of a converter always say the same.
            if health.first() != Some(&found) {
                health.fill(found);
            }
        }
    }

    /// Prepares the first converter that needs it: one at a time, since it takes long.
    fn prepare_one(&mut self, converters: &mut [&mut dyn Converter]) {
        let mut failed = None;
        for (k, (chip, converter)) in (0..).zip(self.chips.iter_mut().zip(converters)) {
            match &mut chip.state {
                State::Down(samples) if *samples > 0 => {
                    *samples -= 1;
                    continue;
                }
                State::Down(_) | State::Lost => {}
                _ => continue,
            }
            let was_lost = chip.state == State::Lost;
            chip.full = true;
            chip.garbled = 0;
            if converter.prepare().is_ok() {
                chip.state = State::OutOfStep;
                self.restart = Some(Health::CONVERTER_RESET);
            } else {
                chip.state = State::Down(RETRY);
                failed = was_lost.then_some(k);
            }
            break;
        }
        if let Some(part) = failed {
            self.tell(FaultKind::Converter, Some(part));
        }
    }

    fn tell(&mut self, kind: FaultKind, part: Option<u8>) {
        self.told = Some(wire::Fault {
            kind,
            sample: self.number,
            part,
        });
    }
}
