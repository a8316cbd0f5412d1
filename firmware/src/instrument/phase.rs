//! Phases of the instrument: each owns its data, and the storage that is lent to the instrument
//! for its life passes from one to the next.
//!
//! A request finds its data in the phase that has them, or is refused: without a run there are no
//! samples to be taken, and without the storage, which an identification has taken along, no line
//! to be read.

use super::run::{Ended, Prepared, Run};
use super::setup::Lines;
use super::storage::Storage;
use crate::wire::{Accelerations, Health, Problem, Question, Start, State};
use core::mem;

/// A request that is answered when its job is done.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pending {
    pub(super) id: u16,
    /// Number of the request in the protocol's table.
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

/// Activity behind a complete set-up.
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one, and no allocator to put a run elsewhere"
)]
pub(super) enum Activity<'m> {
    /// Nothing is going on.
    Idle(Storage<'m>),
    /// A run is going on.
    Running(Run<'m>),
    /// A question has been asked, and its job has yet to be taken.
    Asked(Pending, Asked, Storage<'m>),
    /// An identification is going on; its job has the storage.
    Identifying(Pending),
    /// One activity is becoming another, within one call.
    Changing,
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
    pub(super) activity: Activity<'m>,
}

/// Phase of the instrument.
#[derive(Debug)]
pub(super) enum Phase<'m> {
    /// There is no set-up.
    Empty(Storage<'m>),
    /// Pieces of a set-up come in.
    SettingUp(Storage<'m>),
    /// The set-up is complete.
    SetUp(Session, Activity<'m>),
    /// A self-test is going on.
    SelfTesting(SelfTest<'m>),
    /// One phase is becoming another, within one call.
    Changing,
}

impl<'m> Phase<'m> {
    /// The state of the protocol.
    pub(super) fn state(&self) -> State {
        match self {
            // The runs of a self-test are its own: from outside the box is empty.
            Self::Empty(_) | Self::SelfTesting(_) | Self::Changing => State::Empty,
            Self::SettingUp(_) => State::SettingUp,
            Self::SetUp(_, Activity::Running(_)) => State::Running,
            Self::SetUp(..) => State::Ready,
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
            Self::SetUp(_, activity) => activity.pending(),
            Self::SelfTesting(test) => Some(&test.pending),
            _ => None,
        }
    }

    /// Refuses a request that would disturb a run of the host's.
    pub(super) fn not_running(&self) -> Result<(), Problem> {
        match self {
            Self::SetUp(_, Activity::Running(_)) => Err(self.unless(State::Ready)),
            _ => Ok(()),
        }
    }

    /// Refuses a request that must wait until the pending one is answered.
    pub(super) fn not_busy(&self) -> Result<(), Problem> {
        match self.pending() {
            Some(pending) => Err(Problem::Busy(pending.number)),
            None => Ok(()),
        }
    }

    /// Session and storage where neither a run nor an identification is going on.
    pub(super) fn ready(&mut self) -> Result<(&Session, &mut Storage<'m>), Problem> {
        match self {
            Self::SetUp(session, Activity::Idle(storage)) => Ok((session, storage)),
            Self::SetUp(_, Activity::Asked(pending, ..) | Activity::Identifying(pending)) => {
                Err(Problem::Busy(pending.number))
            }
            other => Err(other.unless(State::Ready)),
        }
    }

    /// The session of a complete set-up of the host's.
    pub(super) fn session(&self) -> Option<&Session> {
        match self {
            Self::SetUp(session, _) => Some(session),
            _ => None,
        }
    }

    /// The session of a complete set-up of the host's.
    pub(super) fn session_mut(&mut self) -> Option<&mut Session> {
        match self {
            Self::SetUp(session, _) => Some(session),
            _ => None,
        }
    }

    /// The activity behind a complete set-up, be it the host's or that of a self-test.
    fn activity(&self) -> Option<&Activity<'m>> {
        match self {
            Self::SetUp(_, activity) => Some(activity),
            Self::SelfTesting(test) => Some(&test.activity),
            _ => None,
        }
    }

    /// The activity behind a complete set-up, be it the host's or that of a self-test.
    pub(super) fn activity_mut(&mut self) -> Option<&mut Activity<'m>> {
        match self {
            Self::SetUp(_, activity) => Some(activity),
            Self::SelfTesting(test) => Some(&mut test.activity),
            _ => None,
        }
    }

    /// The run that is going on.
    pub(super) fn run(&self) -> Option<&Run<'m>> {
        match self.activity()? {
            Activity::Running(run) => Some(run),
            _ => None,
        }
    }

    /// The run that is going on.
    pub(super) fn run_mut(&mut self) -> Option<&mut Run<'m>> {
        match self.activity_mut()? {
            Activity::Running(run) => Some(run),
            _ => None,
        }
    }

    /// The storage; `None` while a job has it.
    pub(super) fn storage(&self) -> Option<&Storage<'m>> {
        match self {
            Self::Empty(storage) | Self::SettingUp(storage) => Some(storage),
            _ => match self.activity()? {
                Activity::Idle(storage) | Activity::Asked(_, _, storage) => Some(storage),
                Activity::Running(run) => Some(&run.storage),
                Activity::Identifying(_) | Activity::Changing => None,
            },
        }
    }

    /// Gives up the phase for its storage, and another one must be put in its place; `None`, and
    /// nothing is changed, while a run or an identification is going on.
    #[inline(never)]
    pub(super) fn take_storage(&mut self) -> Option<Storage<'m>> {
        match self {
            Self::Empty(_) | Self::SettingUp(_) => match mem::replace(self, Self::Changing) {
                Self::Empty(storage) | Self::SettingUp(storage) => Some(storage),
                _ => None,
            },
            _ => self.activity_mut()?.take_storage(),
        }
    }
}

impl<'m> Activity<'m> {
    fn pending(&self) -> Option<&Pending> {
        match self {
            Self::Asked(pending, ..) | Self::Identifying(pending) => Some(pending),
            _ => None,
        }
    }

    /// The storage where nothing is going on; another activity must be put in its place.
    #[inline(never)]
    fn take_storage(&mut self) -> Option<Storage<'m>> {
        if !matches!(self, Self::Idle(_)) {
            return None;
        }
        match mem::replace(self, Self::Changing) {
            Self::Idle(storage) => Some(storage),
            _ => None,
        }
    }

    /// Begins a run where nothing is going on.
    #[inline(never)] // A run is moved over the stack.
    pub(super) fn begin_run(&mut self, start: Start, prepared: Prepared) {
        if let Some(storage) = self.take_storage() {
            *self = Self::Running(Run::new(start, prepared, storage));
        }
    }

    /// Leaves the run that is going on; what it has stored stays.
    #[inline(never)]
    pub(super) fn leave_run(&mut self) {
        if matches!(self, Self::Running(_))
            && let Self::Running(run) = mem::replace(self, Self::Changing)
        {
            *self = Self::Idle(run.storage);
        }
    }

    /// Asks a question where nothing is going on.
    pub(super) fn ask(&mut self, pending: Pending, asked: Asked) {
        if let Some(storage) = self.take_storage() {
            *self = Self::Asked(pending, asked, storage);
        }
    }

    /// Question and storage for a job, once; they come back by [`Self::finish`].
    pub(super) fn take_question(&mut self) -> Option<(Asked, Storage<'m>)> {
        let Self::Asked(pending, ..) = self else {
            return None;
        };
        let taken = Self::Identifying(*pending);
        match mem::replace(self, taken) {
            Self::Asked(_, asked, storage) => Some((asked, storage)),
            _ => None,
        }
    }

    /// Takes the storage back from a job; the request behind it, or `None` for a job of another
    /// instrument.
    pub(super) fn finish(&mut self, storage: Storage<'m>) -> Option<Pending> {
        let Self::Identifying(pending) = self else {
            return None;
        };
        let pending = *pending;
        *self = Self::Idle(storage);
        Some(pending)
    }
}
