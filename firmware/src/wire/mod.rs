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
//! 3. **Events** tell the present state, and all that matters can be read back: nothing
//!    depends on an event's arrival. A run goes on when the host is unplugged, and
//!    [`Request::Status`] says to one that comes back where things are.
//!    What ends a run is on this list and nowhere else: [`Request::Stop`],
//!    [`Request::Abort`], [`Request::Reboot`], [`Request::Provoke`] of a failure, samples up
//!    to the limit of a run whose samples are the host's, and of itself the limit of any run
//!    and a converter that fails. No other frame stops a run or changes its numbers.
//! 4. **Numbers** are SI. Floating-point numbers travel as their bits. Lists and texts
//!    have the bounds that are stated, and every message at its bounds fits a frame.
//!
//! # A measurement
//!
//! ```text
//! Hello                                              Info
//! BeginSetup, SetProcessing, SetSensor…, SetRun…     Done each
//! EndSetup                                           Grid
//! Start, Samples…, Stop                              Done, Progress…, Summary     for each run
//! ReadLines…                                         Lines…
//! Identify                                           Identified
//! ```
//!
//! The set-up comes in pieces. [`Request::BeginSetup`] forgets the one before it and all
//! stored runs; the pieces then come in any order and may be repeated, the last one
//! counts; [`Request::EndSetup`] has the box check the whole. Where weights come from
//! surveys, every run is started first as [`Pass::Survey`] and then as [`Pass::Measure`].
//!
//! Samples are sent ahead of their replies, but not more requests than
//! [`Capacity::window`]. They are numbered, so a gap is as long as it is; [`Gaps`] says
//! whether it is refused, to be sent again, or measured around.
//!
//! # Frames
//!
//! ```text
//! 00 | cobs( version number session sequence request | payload | crc ) | 00
//!        u8      u8     u16     u32      u16     postcard  u32
//! ```
//!
//! Integers of the header and the checksum are little-endian, the checksum is
//! CRC-32/ISO-HDLC over header and payload, [`HEADER`] to [`FRAME_MAX`] are the sizes. A
//! frame is delimited on both sides: a broken byte then costs the frame it lies in and no
//! other. All of this except the payload is the *envelope*.
//!
//! [`Sender`] makes frames, [`Receiver`] finds them. The sequence number counts what its
//! sender *produced*, so a receiver knows its loss to the frame; the session number tells
//! a restart of the peer from both loss and old frames ([`Tracker`] has the rules).
//! Corrupt, truncated, oversized, repeated and overtaken frames are counted in
//! [`LinkCounters`] and go no further; the next sound frame is read, whatever came before.
//!
//! A garbled frame passes the checksum once in 2³² times, and never if all that changed
//! lies within 32 bits of the body. At a thousand frames a second, of which one in a
//! thousand is garbled, that is one in 136 years, and it would still have to be a
//! well-formed message.
//!
//! # Versions
//!
//! [`PROTOCOL_VERSION`] is in every frame. It grows whenever existing bytes change their
//! meaning. It stays when a message is added or a variant is appended to an enum: a peer
//! that does not know it refuses that one message, with a typed error and in step. The
//! envelope never changes, so peers of different versions still tell each other
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
    Answer, Estimate, Identified, Margin, Method, NoAnswer, POLES_MAX, Plausibility, Pole,
    Principal, Procedure, Quality, Question,
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
    Block, FaultySamples, Gaps, Line, Lines, Outcome, Pass, Peaks, Progress, RESULTANTS, ReadLines,
    Samples, Source, Start, Summary, Values,
};
pub use packed::{Count24, Packed, Word};
pub use problem::{ConverterFault, Field, Item, Problem, Refused};
pub use receiver::{LinkCounters, Received, Receiver, Refusal};
pub use sender::{RequestIds, Sender};
pub use sequence::{Arrival, Tracker};
pub use settings::{Circuit, Date, Input, Saved, Setting, SettingKey};
pub use setup::{
    Accelerations, ChannelRole, Excitation, Grid, Mount, NAME_MAX, Plan, Processing, Quantity, Run,
    Scale, Sensor, SensorKind, Weighting, Weights, Window,
};
pub use table::{Direction, Event, FromBox, Reply, Request, ToBox, ToHost};

/// Version of this contract. See *Versions* above for when it grows.
pub const PROTOCOL_VERSION: u8 = 2;
