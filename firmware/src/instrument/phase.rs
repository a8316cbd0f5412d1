//! Phases of the instrument: each owns what belongs to it, and the storage that is lent to the
//! instrument for its life passes from one to the next.
//!
//! A request finds what it needs in the phase it needs, or is refused: without a run there are no
//! samples to be taken, and without the storage, which an identification has taken along, no line
//! to be read.

use super::memory::Scratch;
use super::run::{Ended, Prepared, Run};
use super::setup::Lines;
use super::store::Stored;
use crate::wire::{Accelerations, Answer, Health, Problem, Question, Start, State};
use core::mem;
use massline_core::spectra::Complex32;

/// Storage of a run, of an identification, and of what both leave behind.
#[derive(Debug)]
pub(super) struct Storage<'m> {
    pub(super) scratch: &'m mut Scratch,
    /// Work space of the transform.
    pub(super) work: &'m mut [Complex32],
    /// Lines of the drive and of two channels.
    pub(super) lines: &'m mut [Complex32],
    /// Finished runs.
    pub(super) runs: Stored<'m>,
    /// The answer of the last identification.
    pub(super) answer: &'m mut Option<Answer>,
}

/// A request that is answered when its job is done.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pending {
    pub(super) id: u16,
    /// Number of the request in the contract's table.
    pub(super) number: u8,
    /// Ticks when it came.
    pub(super) since: u64,
}

/// A question that has been checked against the stored runs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked {
    pub(super) question: Question,
    pub(super) accelerations: Accelerations,
}

/// Results of a complete set-up, its stored runs aside.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) lines: Lines,
    /// Bit k: run k is stored.
    pub(super) stored: u32,
    /// The run that ended last.
    pub(super) ended: Option<Ended>,
    /// Ticks that the stored answer took, if there is one.
    pub(super) answered: Option<u64>,
}

impl Session {
    /// A session without runs.
    pub(super) const fn new(lines: Lines) -> Self {
        Self {
            lines,
            stored: 0,
            ended: None,
            answered: None,
        }
    }
}

/// An identification that has been asked for.
#[derive(Debug)]
pub(super) enum Work<'m> {
    /// Its job has yet to be taken.
    Asked(Storage<'m>, Asked),
    /// Its job has the storage.
    Taken,
}

/// A self-test that is going on.
#[derive(Debug)]
pub(super) struct SelfTest<'m> {
    pub(super) pending: Pending,
    pub(super) lines: Lines,
    /// The next run to be started.
    pub(super) run: u8,
    /// Faults of channels so far.
    pub(super) health: Health,
    pub(super) stage: Stage<'m>,
}

/// Stages of a self-test.
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one, and no allocator to put a run elsewhere"
)]
pub(super) enum Stage<'m> {
    /// Before a run, or behind the last one.
    Between(Storage<'m>),
    Running(Run<'m>),
    Identifying(Work<'m>),
}

/// Phase of the instrument.
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one, and no allocator to put a run elsewhere"
)]
pub(super) enum Phase<'m> {
    /// There is no set-up.
    Empty(Storage<'m>),
    /// Pieces of a set-up come in.
    SettingUp(Storage<'m>),
    /// The set-up is complete.
    Ready(Session, Storage<'m>),
    /// A run is going on.
    Running(Session, Run<'m>),
    /// An identification is going on.
    Identifying(Session, Pending, Work<'m>),
    /// A self-test is going on.
    SelfTesting(SelfTest<'m>),
    /// One phase is becoming another, within one call.
    Changing,
}

impl<'m> Phase<'m> {
    /// The state as the contract has it.
    pub(super) fn state(&self) -> State {
        match self {
            // The runs of a self-test are its own: from outside the box is empty.
            Self::Empty(_) | Self::SelfTesting(_) | Self::Changing => State::Empty,
            Self::SettingUp(_) => State::SettingUp,
            Self::Ready(..) | Self::Identifying(..) => State::Ready,
            Self::Running(..) => State::Running,
        }
    }

    /// The refusal of a request that needs another state.
    pub(super) fn unless(&self, expected: State) -> Problem {
        Problem::State {
            found: self.state(),
            expected,
        }
    }

    /// The request that is still being worked on.
    pub(super) fn pending(&self) -> Option<&Pending> {
        match self {
            Self::Identifying(_, pending, _) => Some(pending),
            Self::SelfTesting(test) => Some(&test.pending),
            _ => None,
        }
    }

    /// Refuses what a run of the host's must not be disturbed by.
    pub(super) fn not_running(&self) -> Result<(), Problem> {
        match self {
            Self::Running(..) => Err(self.unless(State::Ready)),
            _ => Ok(()),
        }
    }

    /// Refuses what must wait until the pending request is answered.
    pub(super) fn not_busy(&self) -> Result<(), Problem> {
        match self.pending() {
            Some(pending) => Err(Problem::Busy(pending.number)),
            None => Ok(()),
        }
    }

    /// Session and storage where neither a run nor an identification is going on.
    pub(super) fn ready(&mut self) -> Result<(&Session, &mut Storage<'m>), Problem> {
        match self {
            Self::Ready(session, storage) => Ok((session, storage)),
            Self::Identifying(_, pending, _) => Err(Problem::Busy(pending.number)),
            other => Err(other.unless(State::Ready)),
        }
    }

    /// The session of a complete set-up of the host's.
    pub(super) fn session_mut(&mut self) -> Option<&mut Session> {
        match self {
            Self::Ready(session, _) | Self::Running(session, _) => Some(session),
            Self::Identifying(session, ..) => Some(session),
            _ => None,
        }
    }

    /// The session of a complete set-up of the host's.
    pub(super) fn session(&self) -> Option<&Session> {
        match self {
            Self::Ready(session, _) | Self::Running(session, _) => Some(session),
            Self::Identifying(session, ..) => Some(session),
            _ => None,
        }
    }

    /// The run that is going on.
    pub(super) fn run(&self) -> Option<&Run<'m>> {
        match self {
            Self::Running(_, run) => Some(run),
            Self::SelfTesting(test) => match &test.stage {
                Stage::Running(run) => Some(run),
                _ => None,
            },
            _ => None,
        }
    }

    /// The run that is going on.
    pub(super) fn run_mut(&mut self) -> Option<&mut Run<'m>> {
        match self {
            Self::Running(_, run) => Some(run),
            Self::SelfTesting(test) => match &mut test.stage {
                Stage::Running(run) => Some(run),
                _ => None,
            },
            _ => None,
        }
    }

    /// The storage; `None` while a job has it.
    pub(super) fn storage(&self) -> Option<&Storage<'m>> {
        match self {
            Self::Empty(storage) | Self::SettingUp(storage) | Self::Ready(_, storage) => {
                Some(storage)
            }
            Self::Running(_, run) => Some(&run.storage),
            Self::Identifying(_, _, work) => work.storage(),
            Self::SelfTesting(test) => match &test.stage {
                Stage::Between(storage) => Some(storage),
                Stage::Running(run) => Some(&run.storage),
                Stage::Identifying(work) => work.storage(),
            },
            Self::Changing => None,
        }
    }

    /// The phase itself, in whose place another one must be put.
    pub(super) fn take(&mut self) -> Self {
        mem::replace(self, Self::Changing)
    }

    /// Gives up all but the storage, in favour of another phase. While a job has the storage
    /// nothing is changed.
    #[inline(never)] // A phase is moved over the stack.
    pub(super) fn restart(&mut self, to: impl FnOnce(Storage<'m>) -> Self) {
        *self = match self.take() {
            Self::Empty(storage) | Self::SettingUp(storage) | Self::Ready(_, storage) => {
                to(storage)
            }
            Self::Running(_, run) => to(run.storage),
            Self::Identifying(_, _, Work::Asked(storage, _)) => to(storage),
            Self::SelfTesting(SelfTest {
                stage: Stage::Between(storage),
                ..
            }) => to(storage),
            other => other,
        };
    }

    /// Begins a run where none is going on.
    #[inline(never)] // A phase is moved over the stack.
    pub(super) fn enter_run(&mut self, start: Start, prepared: Prepared) {
        *self = match self.take() {
            Self::Ready(session, storage) => {
                Self::Running(session, Run::new(start, prepared, storage))
            }
            Self::SelfTesting(mut test) => {
                test.stage = match test.stage {
                    Stage::Between(storage) => Stage::Running(Run::new(start, prepared, storage)),
                    other => other,
                };
                Self::SelfTesting(test)
            }
            other => other,
        };
    }

    /// Leaves an identification to be done, where neither a run nor another is going on.
    #[inline(never)] // A phase is moved over the stack.
    pub(super) fn enter_identification(&mut self, asked: Asked, pending: Pending) {
        *self = match self.take() {
            Self::Ready(session, storage) => {
                Self::Identifying(session, pending, Work::Asked(storage, asked))
            }
            Self::SelfTesting(mut test) => {
                test.stage = match test.stage {
                    Stage::Between(storage) => Stage::Identifying(Work::Asked(storage, asked)),
                    other => other,
                };
                Self::SelfTesting(test)
            }
            other => other,
        };
    }

    /// Leaves the run that is going on; what it has stored stays.
    #[inline(never)] // A phase is moved over the stack.
    pub(super) fn leave_run(&mut self) {
        *self = match self.take() {
            Self::Running(session, run) => Self::Ready(session, run.storage),
            Self::SelfTesting(mut test) => {
                test.stage = match test.stage {
                    Stage::Running(run) => Stage::Between(run.storage),
                    other => other,
                };
                Self::SelfTesting(test)
            }
            other => other,
        };
    }
}

impl<'m> Work<'m> {
    fn storage(&self) -> Option<&Storage<'m>> {
        match self {
            Self::Asked(storage, _) => Some(storage),
            Self::Taken => None,
        }
    }
}
