//! Queues between the sampling task and the others.

use super::{Command, Outcome, RawFrame};
use heapless::spsc::{Consumer, Producer, Queue};

/// Most samples in the queue: while a block is computed, some 10 come at 4096 samples/s
/// (`tests/tests/firmware_budget.rs`).
pub const WAITING: usize = 32;

/// The queues between the sampling task and the others.
pub struct Queues {
    commands: Queue<Command, 3>,
    outcomes: Queue<Outcome, 3>,
    frames: Queue<RawFrame, WAITING>,
}

impl Queues {
    /// Empty queues.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            commands: Queue::new(),
            outcomes: Queue::new(),
            frames: Queue::new(),
        }
    }

    /// The ends of the sampling task, of the sender of commands and of the receiver of samples.
    pub fn split(&mut self) -> (Ends<'_>, Commands<'_>, Consumer<'_, RawFrame>) {
        let (sent, commands) = self.commands.split();
        let (done, outcomes) = self.outcomes.split();
        let (produced, frames) = self.frames.split();
        let ends = Ends {
            commands,
            outcomes: done,
            frames: produced,
        };
        let commands = Commands {
            queue: sent,
            outcomes,
        };
        (ends, commands, frames)
    }
}

impl Default for Queues {
    fn default() -> Self {
        Self::new()
    }
}

/// The sampling task's ends of the queues.
pub struct Ends<'q> {
    pub(super) commands: Consumer<'q, Command>,
    pub(super) outcomes: Producer<'q, Outcome>,
    pub(super) frames: Producer<'q, RawFrame>,
}

/// The sender's ends of the queues of commands and outcomes.
pub struct Commands<'q> {
    queue: Producer<'q, Command>,
    outcomes: Consumer<'q, Outcome>,
}

impl Commands<'_> {
    /// Sends a command; `call` makes the sampling task run at once. `false` if the queue is full.
    pub fn send(&mut self, command: Command, call: impl FnOnce()) -> bool {
        let is_sent = self.queue.enqueue(command).is_ok();
        call();
        is_sent
    }

    /// Sends a command that has an outcome, and returns it; `None` if the sampling task was not called.
    pub fn ask(&mut self, command: Command, call: impl FnOnce()) -> Option<Outcome> {
        while self.outcomes.dequeue().is_some() {}
        self.send(command, call);
        self.outcomes.dequeue()
    }
}
