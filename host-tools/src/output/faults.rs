//! A disk that fails, fills up, or loses its program at the n-th operation, for tests.
//!
//! A plan holds for the thread that made it, and for all that this program writes meanwhile.

use super::operation::Operation;
use std::cell::RefCell;
use std::io;
use std::path::{Path, PathBuf};

/// Fault at the n-th operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// The disk is full and stays so: nothing is made or written any more, but renamed and
    /// removed. A write takes half of its bytes before.
    Full,
    /// This operation fails, the next ones do not.
    Error,
    /// The program is killed: nothing that it would have done after this happens. A write takes
    /// half of its bytes before.
    Killed,
}

struct Plan {
    /// Number of the operation, from zero.
    at: usize,
    fault: Fault,
    /// Operations so far.
    seen: Vec<(Operation, PathBuf)>,
}

thread_local! {
    static PLAN: RefCell<Option<Plan>> = const { RefCell::new(None) };
}

/// Operations under a plan in turn, and the result.
pub(crate) struct Done<T> {
    pub(crate) value: T,
    pub(crate) seen: Vec<(Operation, PathBuf)>,
}

/// Does something while the `at`-th operation, from zero, meets a fault.
pub(crate) fn with<T>(at: usize, fault: Fault, work: impl FnOnce() -> T) -> Done<T> {
    let plan = Plan {
        at,
        fault,
        seen: Vec::new(),
    };
    PLAN.with_borrow_mut(|own| *own = Some(plan));
    let value = work();
    let seen = PLAN.take().map_or_else(Vec::new, |plan| plan.seen);
    Done { value, seen }
}

/// Lets an operation pass, with so many bytes of a write, or has it fail.
pub(super) fn step(operation: Operation, path: &Path, bytes: usize) -> io::Result<usize> {
    PLAN.with_borrow_mut(|plan| match plan {
        None => Ok(bytes),
        Some(plan) => plan.step(operation, path, bytes),
    })
}

impl Plan {
    fn step(&mut self, operation: Operation, path: &Path, bytes: usize) -> io::Result<usize> {
        let number = self.seen.len();
        self.seen.push((operation, path.to_owned()));
        let full = || Err(io::ErrorKind::StorageFull.into());
        let half = bytes / 2;
        match self.fault {
            _ if number < self.at => Ok(bytes),
            Fault::Error if number > self.at => Ok(bytes),
            // EIO has no kind of its own.
            Fault::Error => Err(io::Error::from_raw_os_error(5)),
            Fault::Full | Fault::Killed if number == self.at && half > 0 => Ok(half),
            Fault::Full if number == self.at => full(),
            Fault::Full => match operation {
                Operation::Create | Operation::Write | Operation::Sync => full(),
                Operation::Permit | Operation::Rename | Operation::Remove => Ok(bytes),
            },
            Fault::Killed => Err(io::Error::other("killed")),
        }
    }
}
