//! One converter among several: what is known of it, and what its next sample is worth.

use super::{ABSENT, BUFFERED, GARBLED};
use crate::drivers::{Converter, Fault, Reading};
use crate::wire::{FaultCounters, Health};

/// What is known of a converter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chip {
    pub(super) state: State,
    /// It may hold more than the newest sample.
    pub(super) full: bool,
    pub(super) absent: u8,
    pub(super) garbled: u8,
    /// What it was lost for, if it is.
    pub(super) lost_for: Health,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// It samples with the others.
    InStep,
    /// It samples, but not with the others.
    OutOfStep,
    /// It must be prepared.
    Lost,
    /// It could not be prepared; samples until it is tried again.
    Down(u32),
    /// Nobody needs it, and it does not answer.
    LeftOut,
}

impl Chip {
    /// One that has not been prepared yet.
    pub(super) const NEW: Self = Self {
        state: State::Lost,
        full: true,
        absent: 0,
        garbled: 0,
        lost_for: Health::GOOD,
    };

    /// Reads the newest sample and says what is wrong with it.
    #[inline]
    pub(super) fn read(
        &mut self,
        converter: &mut dyn Converter,
        counts: &mut [i32],
        (is_ready, is_settling): (bool, bool),
        faults: &mut FaultCounters,
        restart: &mut Option<Health>,
    ) -> Health {
        // Nearly always, so all that is seldom is kept away from it.
        if self.state == State::InStep && is_ready && !is_settling && !self.full {
            self.absent = 0;
            let newest = converter.read(counts);
            if newest == Ok(Reading { refused: false }) {
                self.garbled = 0;
                return Health::GOOD;
            }
            return self.judge(newest, (false, false), faults, restart);
        }
        self.read_seldom(converter, counts, (is_ready, is_settling), faults, restart)
    }

    /// Reads where it is not in step with empty buffers, ready and settled.
    #[cold]
    fn read_seldom(
        &mut self,
        converter: &mut dyn Converter,
        counts: &mut [i32],
        (is_ready, is_settling): (bool, bool),
        faults: &mut FaultCounters,
        restart: &mut Option<Health>,
    ) -> Health {
        match self.state {
            State::InStep if is_ready => {}
            // The sample is not believed anyway; its flag is the reason of the restart.
            State::InStep if is_settling => {
                self.full = true;
                return Health::GOOD;
            }
            State::InStep => {
                if self.probe(converter, counts, faults) == Health::CONVERTER_RESET {
                    return Health::CONVERTER_RESET;
                }
                self.absent += 1;
                count(&mut faults.converter_missed);
                if self.absent >= ABSENT {
                    self.lose_step(faults, restart);
                    return Health::OUT_OF_STEP;
                }
                return Health::MISSING;
            }
            State::OutOfStep => return Health::OUT_OF_STEP,
            State::Lost => return self.lost_for,
            State::LeftOut => return Health::MISSING,
            State::Down(_) => {
                count(&mut faults.converter_missed);
                return self.lost_for.union(Health::MISSING);
            }
        }
        self.absent = 0;
        // What settles ends with empty buffers, so that a line that is low then is low for a new
        // sample.
        let was_full = core::mem::take(&mut self.full) || is_settling;
        let newest = if was_full {
            drain(converter, counts)
        } else {
            converter.read(counts)
        };
        self.judge(newest, (was_full, is_settling), faults, restart)
    }

    /// What a sample is worth that was or was not read, and what is to be done about it.
    #[cold]
    fn judge(
        &mut self,
        newest: Result<Reading, Fault>,
        (was_full, is_settling): (bool, bool),
        faults: &mut FaultCounters,
        restart: &mut Option<Health>,
    ) -> Health {
        match newest {
            // Its line was low for what was left over, too: whether its newest sample belongs to
            // this edge will be seen at the next one.
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
                // What was left over may still be.
                self.full = was_full;
                self.garbled += 1;
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

    /// Asks a converter that is not where the others are whether it was reset.
    pub(super) fn probe(
        &mut self,
        converter: &mut dyn Converter,
        counts: &mut [i32],
        faults: &mut FaultCounters,
    ) -> Health {
        self.full = true;
        if converter.read(counts) == Err(Fault::Reset) {
            count(&mut faults.converter_reset);
            return self.lose(Health::CONVERTER_RESET);
        }
        Health::MISSING
    }

    fn lose(&mut self, reason: Health) -> Health {
        self.state = State::Lost;
        self.lost_for = reason;
        reason
    }

    pub(super) fn lose_step(&mut self, faults: &mut FaultCounters, restart: &mut Option<Health>) {
        count(&mut faults.out_of_step);
        self.state = State::OutOfStep;
        self.absent = 0;
        *restart = restart.or(Some(Health::OUT_OF_STEP));
    }
}

/// Reads until there is nothing left, and gives the last sample.
fn drain(converter: &mut dyn Converter, counts: &mut [i32]) -> Result<Reading, Fault> {
    let mut newest = Err(Fault::Stale);
    for _ in 0..BUFFERED {
        newest = match converter.read(counts) {
            Ok(reading) => Ok(reading),
            Err(Fault::Stale) => return newest,
            // Told once after a restart, with a sample that is none.
            Err(Fault::Resynchronised) if newest.is_err() => newest,
            Err(fault) => return Err(fault),
        };
    }
    // It delivers faster than it is read.
    Err(Fault::Stale)
}

fn count(faults: &mut u32) {
    *faults = faults.saturating_add(1);
}
