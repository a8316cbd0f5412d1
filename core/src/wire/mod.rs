//! The messages between host and box, and their framing: both sides compile this.
//!
//! # The contract
//!
//! Four rules, then the tables [`Request`], [`Reply`] and [`Event`].
//!
//! 1. **Requests and replies.** The host asks, the box answers each request exactly once,
//!    with the request's id: either with the reply that the table names or with
//!    [`Reply::Error`], which says what was found and what was expected. A refused
//!    request has changed nothing. Several requests may be on their way; they are dealt
//!    with in their order, except that [`Request::Identify`] and [`Request::Selftest`]
//!    take seconds, during which others are answered.
//! 2. **Loss.** A frame is either taken whole or not at all. A host that waits in vain for
//!    a reply sends the request again: requests say what shall be, so a repetition leads
//!    to the same state. [`Request::Stop`] answers with the summary again,
//!    [`Request::Start`] of the very run that is going on is answered and ignored,
//!    [`Request::Abort`] without a run is done at once, samples that the box has are
//!    skipped. Only [`Request::Reboot`] and [`Request::Provoke`] act each time: after
//!    them, wait for the box's new session instead.
//! 3. **Events** carry state, not changes of it, and all that matters can be read back:
//!    nothing depends on an event's arrival. A run goes on when the host is unplugged.
//! 4. **Numbers** are SI. Floating-point numbers travel as their bits. Lists and texts
//!    have the bounds that are stated; a set-up is uploaded in pieces that fit.
//!
//! A typical measurement:
//!
//! ```text
//! Hello                                            -> Info
//! BeginSetup, SetProcessing, SetSensor…, SetRun…   -> Done each
//! EndSetup                                         -> Grid
//! Start, Samples…, Stop                            -> Done, Taken…, Summary    for each run
//! ReadLines…                                       -> Lines…
//! Identify                                         -> Identified
//! ```
//!
//! With weighting by survey, each run is started twice: as [`Pass::Survey`], which sets its
//! weights, and as [`Pass::Measure`].
//!
//! # Frames
//!
//! [`Sender`] makes them, [`Receiver`] finds them; the module `frame` holds the layout. Each has
//! a sequence number that counts what its sender *produced*, so a receiver knows its loss
//! to the frame, and a session number, so that a restart of the peer is neither loss nor
//! a flood of old numbers. [`Tracker`] has the rules. Corrupt, truncated, oversized,
//! repeated and overtaken frames are counted in [`LinkCounters`] and go no further; the
//! next sound frame is read, whatever came before it.
//!
//! A corrupted frame passes the checksum once in 2³² times, and never if the change lies
//! within 32 bits of the body. Of a stream in which one frame in a thousand is garbled, at
//! a thousand frames a second, that is one wrong frame in 136 years, and its payload would
//! still have to be well-formed.
//!
//! # Versions
//!
//! [`PROTOCOL_VERSION`] is in every frame. It grows whenever existing bytes change their
//! meaning. It stays when a message is added or a variant is appended to an enum: a peer
//! that does not know it refuses that one message, with a typed error and in step. The
//! frame's envelope never changes, so peers of different versions still tell each other
//! ([`Refusal::Version`], [`Problem::Version`]).

mod answer;
mod board;
mod cobs;
mod crc;
mod exact;
mod frame;
mod health;
mod measure;
mod packed;
mod problem;
mod receiver;
mod sender;
mod sequence;
mod settings;
mod setup;
mod table;

pub use answer::{
    Answer, Estimate, Identified, Method, NoAnswer, POLES_MAX, Plausibility, Pole, Principal,
    Procedure, Quality, Question, Solution,
};
pub use board::{
    Capacity, Check, ClockSource, Fault, FaultCounters, FaultKind, Info, PANIC_MAX, Ping, Pong,
    Provoke, ResetReason, Running, Selftest, Started, State, Status, Storage, Stream, Subscription,
    Telemetry,
};
pub use crc::{Crc32, crc32};
pub use exact::Exact;
pub use frame::{BODY_MAX, CHECKSUM, EncodeError, FRAME_MAX, HEADER, Header, PAYLOAD_MAX};
pub use health::{ChannelHealth, Health, Levels};
pub use measure::{
    Block, Gaps, Line, Lines, Outcome, Pass, RESULTANTS, ReadLines, Samples, Source, Start,
    Summary, Survey, Taken, Values,
};
pub use packed::{Count24, Packed, Word};
pub use problem::{Field, Item, Problem, Refused};
pub use receiver::{LinkCounters, Received, Receiver, Refusal};
pub use sender::{RequestIds, Sender};
pub use sequence::{Arrival, Tracker};
pub use settings::{Circuit, Date, Input, Saved, Setting, SettingKey};
pub use setup::{
    Accelerations, Carries, Excitation, Grid, Mount, NAME_MAX, Plan, Processing, Quantity, Run,
    Scale, Sensor, SensorKind, Weights, Window,
};
pub use table::{Direction, Event, FromBox, Reply, Request, ToBox, ToHost};

/// Version of this contract. See *Versions* above for when it grows.
pub const PROTOCOL_VERSION: u8 = 1;
