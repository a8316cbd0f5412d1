//! Samples with the health of each input, from edges of the DRDY lines.
//!
//! # Design
//!
//! All converters run on one clock and one SYNC line, so that their samples are ready at the same
//! instant. The first DRDY line that falls raises the interrupt; 1 µs later all lines are read, and
//! [`Acquisition::edge`] is called with their levels. It reads every converter once, and returns
//! one sample of all inputs under one number.
//!
//! | fault | health of the sample | recovery |
//! | --- | --- | --- |
//! | a frame with a wrong checksum, or of one level throughout | `CHECKSUM` or `STUCK` on that converter's inputs | nothing; after [`GARBLED`] in a row the converter is prepared anew |
//! | an edge was lost, or came while the box was busy | numbers jump, and `MISSING` on all inputs | buffers are emptied, since the numbers of their samples are uncertain |
//! | an edge beside the grid of samples | `MISSING` on all inputs | after [`BESIDE`] in a row the grid is moved there |
//! | one line is not low when the others are | `MISSING` on its inputs; after [`ABSENT`] in a row `OUT_OF_STEP` | all are restarted together |
//! | a line falls when the others do not | `OUT_OF_STEP` on its inputs from the next sample on | all are restarted together |
//! | a converter reports a restart | `OUT_OF_STEP` | all are restarted together |
//! | a converter reports a reset, or another configuration | `CONVERTER_RESET` | it is prepared anew, all are restarted together |
//! | a converter cannot be prepared | `MISSING`, and the fault before | again after [`RETRY`] samples; the others go on without it |
//! | a converter that is not in use does not answer | `MISSING` on its inputs | [`Acquisition::leave_out`] |
//! | no edge at all | numbers jump | [`Acquisition::watch`] prepares all and restarts them |
//!
//! The status of a converter that leaves the others' grid is read at once, so that a reset is
//! reported as such, and not as its consequences.
//!
//! A restart moves the grid of samples and unsettles the filters, so that the health of all inputs
//! holds its reason until [`SETTLING`] samples have gone by. Buffers are emptied meanwhile, each at an edge
//! after which there is time for it; up to [`SETTLING`] more samples go by until all are empty. The restart is made right
//! after an edge, so that the grid moves little; edges that were noted before it have to be forgotten.
//!
//! One fault is not detected: a converter that falls behind by less than a quarter of a period in
//! the same sample whose edges are lost on all other lines. Its own edge then stands for theirs,
//! and its counts are valid for one sample, until the next edge shows which converter is late.
//!
//! Counts of a converter always go to its own inputs, whichever others are missing.

mod chip;
mod frame;
mod grid;

use self::chip::{Chip, Reader, State};
pub use self::frame::Frame;
use self::grid::{Grid, Place};
use crate::drivers::{Converter, Fault, Reading};
use crate::wire::{self, FaultCounters, FaultKind, Health};

/// Invalid samples after a restart: the response of a third-order filter.
pub const SETTLING: u8 = 3;
/// Samples in a row that a converter may be absent from before it counts as out of step.
pub const ABSENT: u8 = 3;
/// Frames in a row with wrong checksums after which a converter is prepared anew.
pub const GARBLED: u8 = 8;
/// Edges in a row beside the grid after which the grid is moved there.
pub const BESIDE: u8 = 3;
/// Samples until a converter that could not be prepared is tried again.
pub const RETRY: u32 = 512;
/// Reads that empty a converter's buffer of two samples.
const BUFFERED: u8 = 2;
/// Periods without an edge after which all converters are restarted.
const SILENT: u64 = 8;

/// One sample of all inputs, taken at the same instant.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Number of the sample since the start. A step of more than one means lost samples.
    pub number: u64,
    /// Counts of all inputs. The count of a faulty input is the last one read, or zero.
    pub counts: &'a [i32],
    /// Faults of all inputs.
    pub health: &'a [Health],
    /// `true` if the filters settle after a restart: the sample of no input is valid.
    pub is_settling: bool,
}

/// Reads of the converters at an edge.
pub trait Reads {
    /// Reads the oldest sample of a converter, given its number, as [`Converter::read`].
    ///
    /// # Errors
    ///
    /// Those of [`Converter::read`].
    fn read(
        &mut self,
        number: usize,
        converter: &mut dyn Converter,
        counts: &mut [i32],
    ) -> Result<Reading, Fault>;

    /// `true` if the next samples have come already, so that there is no time to empty buffers.
    fn is_late(&self) -> bool;
}

/// Reads by the converters' drivers.
struct ByDrivers;

impl Reads for ByDrivers {
    fn read(
        &mut self,
        _: usize,
        converter: &mut dyn Converter,
        counts: &mut [i32],
    ) -> Result<Reading, Fault> {
        converter.read(counts)
    }

    fn is_late(&self) -> bool {
        false
    }
}

/// Reads up to `CHIPS` converters with up to `INPUTS` inputs together.
#[derive(Clone, Debug)]
pub struct Acquisition<const CHIPS: usize, const INPUTS: usize> {
    grid: Grid,
    chips: [Chip; CHIPS],
    /// The last sample.
    frame: Frame<CHIPS, INPUTS>,
    /// Its faults by inputs.
    health: [Health; INPUTS],
    /// Bit k: converter k was left out.
    left_out: u32,
    /// Reason to restart all converters at the next edge, if any.
    restart: Option<Health>,
    /// Invalid samples to come after a restart, and its reason.
    settling: u8,
    reason: Health,
    /// Samples by which that may still be put off until the buffers of all converters are empty.
    put_off: u8,
    /// Edges in a row beside the grid.
    beside: u8,
    faults: FaultCounters,
    /// Fault to report to the host.
    fault: Option<wire::Fault>,
}

impl<const CHIPS: usize, const INPUTS: usize> Acquisition<CHIPS, INPUTS> {
    const TOGETHER: () = assert!(CHIPS <= 32, "converters are bits of a word");
    /// The bits of all converters.
    const ALL: u32 = ((1_u64 << CHIPS) - 1) as u32;

    /// An acquisition from converters with a nominal sample period in ticks.
    #[must_use]
    pub fn new(period: f32) -> Self {
        let () = Self::TOGETHER;
        Self {
            grid: Grid::new(period),
            chips: [Chip::NEW; CHIPS],
            frame: Frame::NONE,
            health: [Health::MISSING; INPUTS],
            left_out: 0,
            restart: None,
            settling: 0,
            reason: Health::GOOD,
            put_off: 0,
            beside: 0,
            faults: FaultCounters::default(),
            fault: None,
        }
    }

    /// Continues the fault counters from `faults`.
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
    /// The number and the fault of the first converter that cannot be prepared. The others are
    /// started nevertheless, and this one is tried again later.
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

    /// Excludes the converter of this number, which is not fitted or not in use: its inputs are
    /// `MISSING` from now on, and that is not counted as a fault.
    pub fn leave_out(&mut self, converter: usize) {
        if let Some(chip) = self.chips.get_mut(converter) {
            chip.state = State::LeftOut;
            self.left_out |= 1_u32.wrapping_shl(converter as u32);
        }
    }

    /// Handles an edge of the DRDY lines at a time in ticks, and returns its sample, if any.
    ///
    /// Bit k of `ready` is set if the line of converter k was low shortly after the edge.
    pub fn edge(
        &mut self,
        converters: &mut [&mut dyn Converter],
        synchronise: &mut dyn FnMut(),
        ready: u32,
        ticks: u64,
    ) -> Option<Sample<'_>> {
        self.edge_read_by(&mut ByDrivers, converters, synchronise, ready, ticks)
    }

    /// The same where `reads` reads the converters.
    #[inline]
    pub fn edge_read_by(
        &mut self,
        reads: &mut impl Reads,
        converters: &mut [&mut dyn Converter],
        synchronise: &mut dyn FnMut(),
        ready: u32,
        ticks: u64,
    ) -> Option<Sample<'_>> {
        if !self.is_majority(ready) {
            self.probe_early(reads, converters, ready);
            // If no line is low, any converter may have a sample nevertheless.
            self.leave_unread(if ready == 0 { u32::MAX } else { ready });
            return None;
        }
        let (samples, on_grid) = match self.grid.edge(ticks) {
            Place::On(samples) => (samples, true),
            Place::Beside(samples) => (samples, false),
            Place::Same => {
                // A second sample too soon: the converters without one came early before.
                self.lose_others(ready);
                self.leave_unread(ready);
                return None;
            }
        };
        // 2^64 samples are never reached.
        self.frame.number = self.frame.number.wrapping_add(samples);
        self.frame.ticks = ticks;
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
            // Cleared at `BESIDE`.
            self.beside = self.beside.wrapping_add(1);
            if self.beside >= BESIDE {
                self.beside = 0;
                self.grid.moved();
            }
        }
        if self.settling == 0 && self.put_off > 0 {
            self.put_settling_off();
        }
        let mut is_settling = self.settling > 0;
        if let Some(reason) = self.restart
            && self.chips.iter().all(|c| c.state != State::Lost)
        {
            // The converters hold samples from before the restart; they are read at the next edge.
            self.synchronise(synchronise, reason);
            self.health = [reason; INPUTS];
            self.frame.faults = [reason; CHIPS];
            is_settling = true;
        } else {
            self.read_all(reads, converters, ready, on_grid);
            if !on_grid {
                // Neither the samples that were read nor those that are left are known.
                self.leave_unread(u32::MAX);
            }
            self.settling = self.settling.saturating_sub(1);
        }
        if self.chips.iter().any(Chip::is_to_be_prepared) {
            self.prepare_one(converters);
        }
        Some(Sample {
            number: self.frame.number,
            counts: &self.frame.counts,
            health: &self.health,
            is_settling,
        })
    }

    /// Has a converter settle for one more sample whose buffer could not be emptied, because samples came
    /// meanwhile: its next sample would be `MISSING`.
    #[cold]
    fn put_settling_off(&mut self) {
        let mut in_step = self.chips.iter().filter(|c| c.state == State::InStep);
        if in_step.any(|chip| chip.full) {
            self.settling = 1;
            self.put_off = self.put_off.saturating_sub(1);
        } else {
            self.put_off = 0;
        }
    }

    /// Prepares and restarts all converters if no edge has come for some periods, and returns
    /// `true` then. To be called about ten times a second.
    pub fn watch(
        &mut self,
        converters: &mut [&mut dyn Converter],
        synchronise: &mut dyn FnMut(),
        ticks: u64,
    ) -> bool {
        if !self.is_silent(ticks) {
            return false;
        }
        if let Err((part, _)) = self.start(converters, synchronise) {
            self.report(part);
        }
        true
    }

    /// `true` if no edge has come for some periods: [`Self::watch`] would prepare all converters.
    pub fn is_silent(&self, ticks: u64) -> bool {
        self.grid.is_silent(ticks, SILENT)
    }

    /// Fault counters; those of converters and overruns are counted here.
    pub const fn faults(&self) -> &FaultCounters {
        &self.faults
    }

    /// Sets the fault counters to zero.
    pub fn clear_faults(&mut self) {
        self.faults = FaultCounters::default();
    }

    /// The fault to report to the host, once.
    pub const fn take_fault(&mut self) -> Option<wire::Fault> {
        self.fault.take()
    }

    /// Number of the last sample.
    pub const fn number(&self) -> u64 {
        self.frame.number
    }

    /// The last sample.
    #[inline]
    pub const fn frame(&self) -> &Frame<CHIPS, INPUTS> {
        &self.frame
    }

    /// `true` if all converters sample together and have settled.
    pub fn is_steady(&self, converters: usize) -> bool {
        let chips = self.chips.iter().take(converters);
        let mut chips = chips.filter(|c| c.state != State::LeftOut);
        self.settling == 0
            && self.restart.is_none()
            && chips.all(|c| c.state == State::InStep && c.absent == 0)
    }

    /// Measured sample period, ticks.
    pub fn period(&self) -> f32 {
        self.grid.period()
    }

    /// `true` if these are most of the converters in step. In a tie the side with the first
    /// converter is the majority.
    fn is_majority(&self, ready: u32) -> bool {
        // In the common case all are ready that were not left out.
        if (ready | self.left_out) & Self::ALL == Self::ALL {
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
        self.put_off = SETTLING;
        for chip in &mut self.chips {
            chip.full = true;
            chip.absent = 0;
            if chip.state == State::OutOfStep {
                chip.state = State::InStep;
            }
        }
    }

    /// Marks converters whose lines fall before the others' as out of step, or as reset.
    fn probe_early(
        &mut self,
        reads: &mut impl Reads,
        converters: &mut [&mut dyn Converter],
        ready: u32,
    ) {
        let mut counts = [0; INPUTS];
        for (k, (chip, converter)) in self.chips.iter_mut().zip(converters).enumerate() {
            // An edge from before a restart may still be pending after it.
            let is_early = has(ready, k) && self.settling < SETTLING;
            if is_early && chip.state == State::InStep {
                let mut reader = Reader {
                    reads: &mut *reads,
                    number: k,
                    converter: &mut **converter,
                };
                let found = chip.probe(&mut reader, &mut counts, &mut self.faults);
                if found != Health::CONVERTER_RESET {
                    chip.lose_step(&mut self.faults, &mut self.restart);
                }
            }
        }
    }

    /// Marks converters in step that are not ready as out of step.
    fn lose_others(&mut self, ready: u32) {
        for (k, chip) in self.chips.iter_mut().enumerate() {
            let is_other = !has(ready, k) && self.settling < SETTLING;
            if is_other && chip.state == State::InStep {
                chip.lose_step(&mut self.faults, &mut self.restart);
            }
        }
    }

    /// Marks these converters as holding a sample from before the next edge.
    fn leave_unread(&mut self, ready: u32) {
        for (k, chip) in self.chips.iter_mut().enumerate() {
            chip.full |= has(ready, k);
        }
    }

    fn read_all(
        &mut self,
        reads: &mut impl Reads,
        converters: &mut [&mut dyn Converter],
        ready: u32,
        on_grid: bool,
    ) {
        let mut first = 0;
        let chips = self.chips.iter_mut().zip(&mut self.frame.faults);
        for (k, ((chip, faults), converter)) in chips.zip(converters).enumerate() {
            let inputs = first..usize::saturating_add(first, converter.channels());
            first = inputs.end;
            let (Some(counts), Some(health)) = (
                self.frame.counts.get_mut(inputs.clone()),
                self.health.get_mut(inputs),
            ) else {
                break;
            };
            if chip.state == State::LeftOut {
                if *faults != Health::MISSING {
                    *faults = Health::MISSING;
                    health.fill(Health::MISSING);
                }
                continue;
            }
            let is_ready = has(ready, k);
            let settling = self.settling > 0;
            let mut reader = Reader {
                reads: &mut *reads,
                number: k,
                converter: &mut **converter,
            };
            let mut found = chip.read(
                &mut reader,
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
            // All inputs of a converter have the same health.
            if *faults != found {
                *faults = found;
                health.fill(found);
            }
        }
    }

    /// Prepares the first converter that needs it; one at a time, since a preparation takes long.
    #[cold]
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
            self.report(part);
        }
    }

    /// Notes that a converter cannot be prepared.
    fn report(&mut self, converter: u8) {
        self.fault = Some(wire::Fault {
            kind: FaultKind::Converter,
            sample: self.frame.number,
            part: Some(converter),
        });
    }
}

/// `true` if bit `k`, below 32, is set.
#[inline]
const fn has(bits: u32, k: usize) -> bool {
    bits.wrapping_shr(k as u32) & 1 != 0
}
