//! The box as a state machine, without hardware: requests and samples in, replies and
//! events out.
//!
//! The firmware runs this very type, and so does the host where it stands in for a box:
//! what they compute is the same to the last bit. The contract is [`crate::wire`].
//!
//! Nothing here waits or takes long: [`Instrument::request`], [`Instrument::sample`] and
//! [`Instrument::poll`] return after one block at the most. What takes seconds leaves as a
//! [`Job`], which a task of low priority runs while requests are still answered.

mod board;
mod job;
pub mod memory;

pub use board::{Board, Identity, Outbox, RawSample, Vitals};
pub use job::Job;
pub use memory::{Memory, RunStorage, WorkingStorage};

use crate::wire::{
    Capacity, Event, Info, Item, NAME_MAX, PANIC_MAX, Pong, Problem, Refused, Reply, Request,
    Saved, Started, State, Status, Subscription,
};

/// The box.
#[derive(Debug)]
pub struct Instrument<'m> {
    identity: Identity<'m>,
    #[expect(dead_code, reason = "runs come with the next commit")]
    memory: Memory<'m>,
    state: State,
    subscription: Subscription,
    told: bool,
}

impl<'m> Instrument<'m> {
    /// A box that has just started, and says so with its first event
    /// ([`crate::wire::Event::Started`], from the first [`Self::poll`]).
    #[must_use]
    pub fn new(memory: Memory<'m>, identity: Identity<'m>) -> Self {
        Self {
            identity,
            memory,
            state: State::Empty,
            subscription: Subscription::default(),
            told: false,
        }
    }

    /// Deals with one request, and answers it exactly once: here, or by [`Self::finish`]
    /// where it takes a [`Job`].
    pub fn request(
        &mut self,
        id: u16,
        request: &Request<'_>,
        board: &mut impl Board,
        out: &mut impl Outbox,
    ) {
        let done = |r: Result<(), Problem>| r.map(|()| Reply::Done);
        let reply = match request {
            Request::Hello => Ok(Reply::Info(self.info(board))),
            Request::Ping(ping) => Ok(Reply::Pong(Pong {
                stamp: ping.stamp,
                ticks: board.ticks(),
                samples: board.input_samples(),
            })),
            Request::Status => Ok(Reply::Status(self.status(board))),
            Request::Subscribe(subscription) => {
                self.subscription = *subscription;
                Ok(Reply::Done)
            }
            Request::ForgetFaults => {
                self.identity.panic = None;
                board.forget_faults();
                Ok(Reply::Done)
            }
            Request::ReadSetting(key) => match board.setting(*key) {
                Ok(setting) => {
                    out.reply(id, &Reply::Setting(setting));
                    return;
                }
                Err(problem) => Err(problem),
            },
            Request::WriteSetting(setting) => done(board.write_setting(setting)),
            Request::SaveSettings => board
                .save_settings()
                .map(|storage| Reply::Saved(Saved { storage })),
            Request::ResetSettings => {
                board.reset_settings();
                Ok(Reply::Done)
            }
            Request::Reboot => {
                out.reply(id, &Reply::Done);
                board.reboot();
                return;
            }
            Request::Provoke(fault) => {
                if board.provoke(*fault) {
                    Ok(Reply::Done)
                } else {
                    Err(Problem::Unsupported(Item::Provoke))
                }
            }
            _ => Err(Problem::Unsupported(Item::Method)),
        };
        let refused = |problem| {
            Reply::Error(Refused {
                request: request.number(),
                problem,
            })
        };
        out.reply(id, &reply.unwrap_or_else(refused));
    }

    /// Takes one sample of the box's own converters.
    pub fn sample(
        &mut self,
        _sample: &RawSample<'_>,
        _board: &mut impl Board,
        _out: &mut impl Outbox,
    ) {
    }

    /// Does what is due without a request. Call it whenever there is time, a hundred times
    /// a second or more; `true` if there is more to do at once.
    pub fn poll(&mut self, _board: &mut impl Board, out: &mut impl Outbox) -> bool {
        if !self.told {
            self.told = true;
            out.event(&Event::Started(Started {
                reset: self.identity.reset,
                resets: self.identity.resets,
            }));
        }
        false
    }

    /// The job that a request has left to be done, once. It comes back by
    /// [`Self::finish`].
    pub fn take_job(&mut self) -> Option<Job<'m>> {
        None
    }

    /// Takes a job back and answers the request behind it. One that has not been run says
    /// that it was given up.
    pub fn finish(&mut self, _job: Job<'m>, _board: &mut impl Board, _out: &mut impl Outbox) {}

    fn info(&self, board: &impl Board) -> Info<'_> {
        let i = &self.identity;
        Info {
            firmware: cut(i.firmware, NAME_MAX),
            version: cut(i.version, NAME_MAX),
            build: cut(i.build, NAME_MAX),
            chip: cut(i.chip, NAME_MAX),
            serial: i.serial,
            clock: i.clock,
            clock_hz: i.clock_hz,
            tick_hz: i.tick_hz,
            storage: i.storage,
            reset: i.reset,
            resets: i.resets,
            panic: i.panic.map(|text| cut(text, PANIC_MAX)),
            faults: board.faults(),
            capacity: Capacity {
                channels: memory::CHANNELS as u8,
                inputs: i.inputs,
                sensors: memory::SENSORS as u8,
                runs: memory::RUNS as u8,
                lines: memory::LINES as u16,
                block_length: memory::BLOCK_LENGTH as u32,
                window: i.window,
                methods: 0,
            },
        }
    }

    fn status(&self, board: &impl Board) -> Status {
        Status {
            state: self.state,
            busy: None,
            fingerprint: None,
            running: None,
            stored: 0,
            surveyed: 0,
            answer: false,
            unsaved: board.unsaved(),
        }
    }
}

/// The beginning of a text, at most `most` bytes of it.
fn cut(text: &str, most: usize) -> &str {
    let mut end = text.len().min(most);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    text.get(..end).unwrap_or("")
}
