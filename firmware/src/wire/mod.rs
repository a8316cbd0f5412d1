//! The messages between host and box, and their framing: both sides compile this.
//!
//! # The protocol
//!
//! Four rules, then the tables [`Request`], [`Reply`] and [`Event`].
//!
//! 1. **Requests and replies.** The host sends a request, and the box answers it exactly once,
//!    with the identifier of the request: either with the reply that the table names, or with
//!    [`Reply::Error`], which says what was found and what was expected. A refused request has
//!    changed nothing. Several requests may be on their way. The box answers them in their order,
//!    except that [`Request::Identify`] and [`Request::Selftest`] take seconds, during which it
//!    answers others.
//! 2. **Loss.** A frame is accepted as a whole or not at all. A host that waits in vain for a
//!    reply sends the request again: a request states the wanted state, so that a repetition leads
//!    to the same state. [`Request::Stop`] is answered with the same summary again,
//!    [`Request::Start`] of the run that is going on is answered and ignored, [`Request::Abort`]
//!    without a run is done at once, samples that the box has are skipped. Only
//!    [`Request::Reboot`] and [`Request::Provoke`] act each time: after them, the host waits for
//!    the new session of the box instead.
//! 3. **Events** tell the present state, and all that matters can be read back: nothing depends on
//!    the arrival of an event. A run goes on when the host is unplugged, and [`Request::Status`]
//!    tells a host that reconnects the state of the box. A run ends by one of these and by nothing
//!    else: [`Request::Stop`], [`Request::Abort`], [`Request::Reboot`], [`Request::Provoke`] of a
//!    failure, samples from the host up to the limit of a run that takes them, and without a
//!    request the limit of any run and a converter that fails. No other frame stops a run or
//!    changes its numbers.
//! 4. **Numbers** are SI. Floating-point numbers are sent as their bits. Lists and texts have the
//!    bounds that are stated, and every message at its bounds fits a frame.
//!
//! # A measurement
//!
//! ```text
//! Hello                                              Info
//! BeginSetup, SetProcessing, SetSensor…, SetRun…     Done each
//! EndSetup                                           Grid
//! Start, Samples…, Stop                              Done, Progress…, Summary  for each run
//! ReadLines…                                         Lines…
//! Identify                                           Identified
//! ```
//!
//! The set-up is sent in pieces. [`Request::BeginSetup`] clears the one before it and all stored
//! runs. The pieces then come in any order and may be repeated; the last one counts.
//! [`Request::EndSetup`] makes the box check the whole. If weights come from surveys, every run is
//! started first as [`Pass::Survey`] and then as [`Pass::Measure`].
//!
//! Samples are sent ahead of their replies, but not more requests than [`Capacity::window`]. They
//! are numbered, so that the length of a gap is known; [`Gaps`] decides if the box refuses a gap,
//! so that the host sends the samples again, or measures around it.
//!
//! # Frames
//!
//! ```text
//! 00 | cobs( version number session sequence request | payload | crc ) | 00
//!        u8      u8     u16     u32      u16     postcard  u32
//! ```
//!
//! Integers of the header and the checksum are little-endian, the checksum is [`CRC32`] over
//! header and payload, [`HEADER`] to [`FRAME_MAX`] are the sizes. Consistent overhead byte stuffing
//! (COBS) leaves no zero in the body, so that a zero always ends a frame. A frame is delimited on
//! both sides: a broken byte costs the frame that it lies in and no other. All of this except the
//! payload is the *envelope*.
//!
//! [`Sender`] makes frames, [`Receiver`] finds them. The sequence number counts the frames that
//! their sender *produced*, so that a receiver knows its exact loss; the session number
//! distinguishes a restart of the peer from loss and from old frames ([`Tracker`] has the rules).
//! Corrupt, truncated, oversized, repeated and overtaken frames are counted in [`LinkCounters`] and
//! dropped; the next intact frame is read, whatever came before it.
//!
//! A corrupt frame passes the checksum once in 2³² times, and never if all changes lie within 32
//! bits of the body. At a thousand frames a second, of which one in a thousand is corrupt, that is
//! one in 136 years, and it would also have to be a well-formed message.
//!
//! # Types of the core
//!
//! The set-up, the question and the answer carry the types of [`massline_core`] by its `serde`
//! feature. A change of these types changes the bytes; `tests/wire` compares the bytes of every
//! message with a stored copy.
//!
//! # Versions
//!
//! [`PROTOCOL_VERSION`] is in every frame. It grows whenever existing bytes change their meaning.
//! It stays when a message is added or a variant is appended to an enum: a peer that does not know
//! it refuses that one message with a typed error, and the link goes on. The envelope never
//! changes, so that peers of different versions can still tell each other ([`Refusal::Version`],
//! [`Problem::Version`]).

mod answer;
mod board;
mod frame;
mod health;
mod measure;
mod packed;
mod probe;
mod problem;
mod receiver;
mod sender;
mod sequence;
mod settings;
mod setup;
mod table;

pub use crate::drivers::Signal;
pub use crate::drivers::lanes::BusClock;
pub use answer::{Answer, Findings, Identified, MethodSet, NoAnswer, Quality, Question};
pub use board::{
    Capacity, Check, ClockSource, Fault, FaultCounters, FaultKind, Info, PANIC_MAX, Ping, Pong,
    Provoke, ResetReason, Running, Selftest, Started, State, Status, Storage, Stream, Subscription,
    Telemetry,
};
pub use frame::{BODY_MAX, CHECKSUM, CRC32, EncodeError, FRAME_MAX, HEADER, Header, PAYLOAD_MAX};
pub use health::{ChannelHealth, Health, Levels};
pub use massline_core::geometry::{Mount, Quantity, RESULTANTS};
pub use massline_core::identify::Procedure;
pub use massline_core::masslines::Method;
pub use massline_core::spectra::{LineGrid, Window};
pub use measure::{
    Block, FaultySamples, Gaps, Line, Lines, Outcome, Pass, Peaks, Progress, ReadLines, Samples,
    Source, Start, Summary, Values,
};
pub use packed::{Count24, Packed, Word};
pub use probe::{Conditions, DRDY_LINES, Looped, Probe, Probed};
pub use problem::{ConverterFault, Field, Item, Problem, Refused};
pub use receiver::{LinkCounters, Received, Receiver, Refusal};
pub use sender::{RequestIds, Sender};
pub use sequence::{Arrival, Tracker};
pub use settings::{Circuit, Date, Input, Saved, Setting, SettingKey};
pub use setup::{
    Accelerations, ChannelRole, Excitation, Grid, NAME_MAX, Plan, Processing, Run, ScaleSource,
    Sensor, SensorKind, Weighting, Weights,
};
pub use table::{Direction, Event, FromBox, Reply, Request, ToBox, ToHost};

/// Version of this protocol. See *Versions* above for the rule by which it grows.
pub const PROTOCOL_VERSION: u8 = 3;
