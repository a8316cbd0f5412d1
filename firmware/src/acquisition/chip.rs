//! State of one converter among several, and the health of its samples.

use super::{ABSENT, BUFFERED, GARBLED, Reads};
use crate::drivers::{Converter, Fault, Reading};
use crate::wire::{FaultCounters, Health};

/// State of a converter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chip {
    pub(super) state: State,
    /// `true` if its buffer may hold more than the newest sample.
    pub(super) full: bool,
    /// Edges in a row without its sample.
    pub(super) absent: u8,
    /// Frames in a row with errors.
    pub(super) garbled: u8,
    /// Fault after which it was lost.
    pub(super) loss: Health,
}

/// The reads of one converter.
pub(super) struct Reader<'a, R> {
    pub(super) reads: &'a mut R,
    /// Its number.
    pub(super) number: usize,
    pub(super) converter: &'a mut dyn Converter,
}

impl<R: Reads> Reader<'_, R> {
    /// Reads its oldest sample, as [`Converter::read`].
    #[inline]
    fn read(&mut self, counts: &mut [i32]) -> Result<Reading, Fault> {
        self.reads.read(self.number, self.converter, counts)
    }

    /// Reads until the buffer is empty, and returns the last sample, and `false` if there was no time for
    /// that.
    fn drain(&mut self, counts: &mut [i32]) -> (Result<Reading, Fault>, bool) {
        let mut newest = Err(Fault::Stale);
        for read in 0..BUFFERED {
            if read > 0 && self.reads.is_late() {
                return (newest, false);
            }
            newest = match self.read(counts) {
                Ok(reading) => Ok(reading),
                Err(Fault::Stale) => break,
                // Reported once after a restart, without a sample.
                Err(Fault::Resynchronised) if newest.is_err() => newest,
                Err(fault) => return (Err(fault), true),
            };
        }
        (newest, true)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// The converter samples with the others.
    InStep,
    /// The converter samples, but not with the others.
    OutOfStep,
    /// The converter must be prepared.
    Lost,
    /// The converter could not be prepared; samples until the next attempt.
    Down(u32),
    /// The converter is not used.
    LeftOut,
}

impl Chip {
    /// A converter that has not been prepared yet.
    pub(super) const NEW: Self = Self {
        state: State::Lost,
        full: true,
        absent: 0,
        garbled: 0,
        loss: Health::GOOD,
    };

    /// `true` if it must be prepared, now or later.
    #[inline]
    pub(super) fn is_to_be_prepared(&self) -> bool {
        matches!(self.state, State::Lost | State::Down(_))
    }

    /// Reads the newest sample and returns its health.
    #[inline]
    pub(super) fn read(
        &mut self,
        reader: &mut Reader<'_, impl Reads>,
        counts: &mut [i32],
        (is_ready, is_settling): (bool, bool),
        faults: &mut FaultCounters,
        restart: &mut Option<Health>,
    ) -> Health {
        // The common case is kept short.
        if self.state == State::InStep && is_ready && !is_settling && !self.full {
            self.absent = 0;
            let newest = reader.read(counts);
            if newest == Ok(Reading { refused: false }) {
                self.garbled = 0;
                return Health::GOOD;
            }
            return self.classify(newest, (false, false), faults, restart);
        }
        self.read_unready(reader, counts, (is_ready, is_settling), faults, restart)
    }

    /// Reads a converter that is not in step, ready and settled with an empty buffer.
    #[cold]
    fn read_unready(
        &mut self,
        reader: &mut Reader<'_, impl Reads>,
        counts: &mut [i32],
        (is_ready, is_settling): (bool, bool),
        faults: &mut FaultCounters,
        restart: &mut Option<Health>,
    ) -> Health {
        match self.state {
            State::InStep if is_ready => {}
            // The sample is flagged with the reason of the restart anyway.
            State::InStep if is_settling => {
                self.full = true;
                return Health::GOOD;
            }
            State::InStep => {
                if self.probe(reader, counts, faults) == Health::CONVERTER_RESET {
                    return Health::CONVERTER_RESET;
                }
                self.absent = self.absent.saturating_add(1);
                count(&mut faults.converter_missed);
                if self.absent >= ABSENT {
                    self.lose_step(faults, restart);
                    return Health::OUT_OF_STEP;
                }
                return Health::MISSING;
            }
            State::OutOfStep => return Health::OUT_OF_STEP,
            State::Lost => return self.loss,
            State::LeftOut => return Health::MISSING,
            State::Down(_) => {
                count(&mut faults.converter_missed);
                return self.loss.union(Health::MISSING);
            }
        }
        self.absent = 0;
        let was_full = core::mem::take(&mut self.full);
        let (newest, is_emptied) = if was_full {
            reader.drain(counts)
        } else {
            (reader.read(counts), true)
        };
        let health = self.classify(newest, (was_full, is_settling), faults, restart);
        if !is_emptied {
            self.full = true;
            count(&mut faults.converter_missed);
        }
        health
    }

    /// Health of the result of a read; counts its fault and begins the recovery.
    #[cold]
    fn classify(
        &mut self,
        newest: Result<Reading, Fault>,
        (was_full, is_settling): (bool, bool),
        faults: &mut FaultCounters,
        restart: &mut Option<Health>,
    ) -> Health {
        match newest {
            // A sample left in the buffer keeps the line low, too: only the next edge shows that
            // the newest sample belongs to its edge.
            Ok(_) if was_full && !is_settling => Health::MISSING,
            Ok(reading) => {
                self.garbled = 0;
                if reading.refused {
                    count(&mut faults.converter_checksum);
                }
                Health::GOOD
            }
            Err(fault @ (Fault::Checksum | Fault::Stuck)) => {
                let health = match fault {
                    Fault::Stuck => Health::STUCK,
                    _ => Health::CHECKSUM,
                };
                count(&mut faults.converter_checksum);
                // Samples may still be left in the buffer.
                self.full = was_full;
                self.garbled = self.garbled.saturating_add(1);
                if self.garbled >= GARBLED {
                    self.lose(health);
                }
                health
            }
            Err(Fault::Reset) => {
                count(&mut faults.converter_reset);
                self.lose(Health::CONVERTER_RESET)
            }
            Err(Fault::Resynchronised | Fault::Stale) if is_settling => {
                self.full = true;
                Health::GOOD
            }
            Err(Fault::Resynchronised) => {
                self.full = true;
                self.lose_step(faults, restart);
                Health::OUT_OF_STEP
            }
            Err(_) => {
                count(&mut faults.converter_missed);
                self.full = true;
                Health::MISSING
            }
        }
    }

    /// Reads a converter that is not on the others' grid, to detect a reset.
    pub(super) fn probe(
        &mut self,
        reader: &mut Reader<'_, impl Reads>,
        counts: &mut [i32],
        faults: &mut FaultCounters,
    ) -> Health {
        self.full = true;
        if reader.read(counts) == Err(Fault::Reset) {
            count(&mut faults.converter_reset);
            return self.lose(Health::CONVERTER_RESET);
        }
        Health::MISSING
    }

    fn lose(&mut self, reason: Health) -> Health {
        self.state = State::Lost;
        self.loss = reason;
        reason
    }

    pub(super) fn lose_step(&mut self, faults: &mut FaultCounters, restart: &mut Option<Health>) {
        count(&mut faults.out_of_step);
        self.state = State::OutOfStep;
        self.absent = 0;
        *restart = restart.or(Some(Health::OUT_OF_STEP));
    }
}

fn count(faults: &mut u32) {
    *faults = faults.saturating_add(1);
}
