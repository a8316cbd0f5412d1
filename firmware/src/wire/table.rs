//! The table of messages: number, meaning and content of each.

use super::frame::{EncodeError, Header, write};
use super::{
    Block, ChannelHealth, Fault, FaultySamples, Grid, Identified, Info, Levels, Lines, Peaks, Ping,
    Plan, Pong, Probe, Probed, Processing, Progress, Provoke, Question, ReadLines, Refusal,
    Refused, Run, Samples, Saved, Selftest, Sensor, Setting, SettingKey, Start, Started, Status,
    Subscription, Summary, Telemetry, Weights,
};
use serde::Deserialize;

/// The name that a variant's body is bound to, if it has one.
macro_rules! bound {
    ($name:ident $body:ty) => {
        $name
    };
}

/// Makes an enum, its numbers, its encoder and its decoder of one table.
macro_rules! messages {
    (
        $(#[$doc:meta])*
        $name:ident {
            $( $(#[$of:meta])* $number:literal $variant:ident $(($body:ty))?; )*
        }
    ) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[allow(
            clippy::large_enum_variant,
            reason = "there is no heap to put the large ones on, and none is kept"
        )]
        pub enum $name<'a> {
            $( $(#[$of])* $variant $(($body))?, )*
        }

        impl<'a> $name<'a> {
            /// All numbers of the table with their names, ascending.
            pub const TABLE: &'static [(u8, &'static str)] =
                &[$( ($number, stringify!($variant)), )*];

            /// Number of the message.
            #[must_use]
            pub const fn number(&self) -> u8 {
                match self {
                    $( Self::$variant { .. } => $number, )*
                }
            }

            /// Name of a number; `None` for an unknown one.
            #[must_use]
            pub const fn name(number: u8) -> Option<&'static str> {
                match number {
                    $( $number => Some(stringify!($variant)), )*
                    _ => None,
                }
            }

            /// Writes the frame into `out` and returns its length.
            pub(super) fn write(
                &self,
                header: Header,
                out: &mut [u8],
            ) -> Result<usize, EncodeError> {
                match self {
                    $( Self::$variant $((bound!(body $body)))? => {
                        write(header, &($( bound!(body $body) )?), out)
                    } )*
                }
            }

            /// Reads the payload of a number.
            pub(super) fn read(number: u8, payload: &'a [u8]) -> Result<Self, Refusal> {
                let mut rest = payload;
                let message = match number {
                    $( $number => Self::$variant $((take::<$body>(number, &mut rest)?))?, )*
                    found => return Err(Refusal::UnknownNumber { found }),
                };
                if rest.is_empty() {
                    Ok(message)
                } else {
                    Err(Refusal::Malformed { number })
                }
            }
        }
    };
}

fn take<'a, T: Deserialize<'a>>(number: u8, payload: &mut &'a [u8]) -> Result<T, Refusal> {
    let (body, rest) =
        postcard::take_from_bytes(payload).map_err(|_| Refusal::Malformed { number })?;
    *payload = rest;
    Ok(body)
}

messages! {
    /// Requests of the host. Each has exactly one reply: the one that is named here, or
    /// [`Reply::Error`]. If states are named, the request is refused in others with
    /// [`super::Problem::State`].
    Request {
        /// Asks for the identity of the box. [`Reply::Info`]. In any state.
        0x01 Hello;
        /// Asks for a sign of life and the time. [`Reply::Pong`]. In any state.
        0x02 Ping(Ping);
        /// Asks for the state of the box. [`Reply::Status`]. In any state.
        0x03 Status;
        /// Subscribes to events. [`Reply::Done`]. In any state, except for samples of a test; replaces
        /// the subscription before.
        0x04 Subscribe(Subscription);
        /// Sets the fault counters to zero and deletes the panic text. [`Reply::Done`]. In any
        /// state.
        0x05 ForgetFaults;
        /// Restarts the box. [`Reply::Done`] at once, then [`Event::Started`]. In any state; ends a
        /// run and deletes it.
        0x06 Reboot;
        /// Provokes a fault, or starts the test pattern, for tests. [`Reply::Done`] at once, or
        /// unsupported. A fault in any state, which ends a run; the test pattern not while running
        /// or while samples are recorded.
        0x07 Provoke(Provoke);
        /// Measures the synthetic body. [`Reply::Selftest`] when it is done. Not while running;
        /// deletes the set-up and stored runs, and leaves the box empty.
        0x08 Selftest;
        /// Measures a part of the board. [`Reply::Probed`]. Not while running or while samples are
        /// recorded, except for [`Probe::Crystal`] and [`Probe::Skew`].
        0x09 Probe(Probe);

        /// Deletes the set-up and stored runs, and begins a new set-up. [`Reply::Done`]. Not while
        /// running.
        0x10 BeginSetup(Plan);
        /// Sets the processing. [`Reply::Done`]. While setting up.
        0x11 SetProcessing(Processing);
        /// Sets one sensor. [`Reply::Done`]. While setting up.
        0x12 SetSensor(Sensor<'a>);
        /// Sets one run. [`Reply::Done`]. While setting up.
        0x13 SetRun(Run<'a>);
        /// Sets the weights of a run. [`Reply::Done`]. While setting up, and when ready: they
        /// replace those of a survey.
        0x14 SetWeights(Weights<'a>);
        /// Ends the set-up. [`Reply::Grid`], and the box is ready.
        0x15 EndSetup;

        /// Starts a run. [`Reply::Done`]. When ready; while running, the same start again changes
        /// nothing.
        0x20 Start(Start);
        /// Sends samples of the run. [`Reply::Progress`]. While running from the host. At most
        /// [`super::Capacity::window`] of them are unanswered at a time. Samples that reach the
        /// limit of the run end it.
        0x21 Samples(Samples<'a>);
        /// Ends the run. [`Reply::Summary`]. While running; without a run, the reply is the summary
        /// of the run that ended last. The runs of a self-test do not count.
        0x22 Stop;
        /// Ends the run and deletes it. [`Reply::Done`]. In any state; without a run nothing
        /// happens.
        0x23 Abort;

        /// Reads the summary of a finished run. [`Reply::Summary`].
        0x30 ReadSummary(u8);
        /// Reads lines of a stored run. [`Reply::Lines`], as many as fit.
        0x31 ReadLines(ReadLines);
        /// Reads the result of the survey of a run. [`Reply::Peaks`].
        0x32 ReadPeaks(u8);
        /// Reads the present weights of a run. [`Reply::Weights`].
        0x33 ReadWeights(u8);

        /// Identifies the body. [`Reply::Identified`] when it is done; other requests are answered
        /// in the meantime. When ready.
        0x40 Identify(Question);
        /// Reads the last answer. [`Reply::Identified`].
        0x41 ReadAnswer;

        /// Reads one setting. [`Reply::Setting`]. In any state.
        0x50 ReadSetting(SettingKey);
        /// Changes one setting. [`Reply::Done`]. Not while running; an input and the sample rate
        /// not while samples are recorded, either.
        0x51 WriteSetting(Setting<'a>);
        /// Stores the settings. [`Reply::Saved`]. Not while running, identifying or while samples
        /// are recorded: the flash stops the core.
        0x52 SaveSettings;
        /// Restores the factory settings. [`Reply::Done`]. Not while running, nor while samples are
        /// recorded; not stored until saved.
        0x53 ResetSettings;
    }
}

messages! {
    /// Reply of the box to a request, with the identifier of the request.
    Reply {
        /// The request is done.
        0x80 Done;
        /// The request was refused and has changed nothing.
        0x81 Error(Refused);
        /// Identity of the box.
        0x82 Info(Info<'a>);
        /// Sign of life.
        0x83 Pong(Pong);
        /// State of the box.
        0x84 Status(Status);
        /// Result of the self-test.
        0x85 Selftest(Selftest);
        /// Lines of the set-up.
        0x86 Grid(Grid);
        /// Progress of the run.
        0x87 Progress(Progress);
        /// Summary of a finished run.
        0x88 Summary(Summary);
        /// Lines of a stored run.
        0x89 Lines(Lines<'a>);
        /// Result of a survey.
        0x8A Peaks(Peaks<'a>);
        /// Weights of a run.
        0x8B Weights(Weights<'a>);
        /// Answer with the ten numbers.
        0x8C Identified(Identified);
        /// One setting.
        0x8D Setting(Setting<'a>);
        /// Confirmation that the settings are stored.
        0x8E Saved(Saved);
        /// Result of a measurement of the board.
        0x8F Probed(Probed);
    }
}

messages! {
    /// Messages that the box sends without a request. An event that finds no room is dropped, and
    /// its sequence number is missing.
    Event {
        /// The box has started.
        0xC0 Started(Started);
        /// A block is complete.
        0xC1 Block(Block);
        /// The faults of the channels have changed.
        0xC2 Health(ChannelHealth<'a>);
        /// A run has ended by itself. [`Request::ReadSummary`] returns the same.
        0xC3 RunEnded(Summary);
        /// Levels of the channels. By subscription.
        0xC4 Levels(Levels<'a>);
        /// Samples of the box's own converters, without faults found by their driver. They are
        /// numbered from the start of the converters. By subscription.
        0xC5 Recorded(Samples<'a>);
        /// Load, memory and counters of the box. By subscription.
        0xC6 Telemetry(Telemetry);
        /// A fault of the box.
        0xC7 Fault(Fault);
        /// Samples of the box's own converters, some of whose inputs are faulty. By subscription,
        /// with [`Event::Recorded`].
        0xC8 RecordedFaulty(FaultySamples<'a>);
    }
}

/// Message of the box: a reply or an event.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "there is no heap to put the large one on, and none is kept"
)]
pub enum FromBox<'a> {
    /// A reply.
    Reply(Reply<'a>),
    /// An event.
    Event(Event<'a>),
}

/// Lowest number of an event.
const EVENTS: u8 = 0xC0;

/// Direction of messages.
pub trait Direction {
    /// Type of the messages.
    type Message<'a>;

    /// Reads the payload of a frame.
    ///
    /// # Errors
    /// [`Refusal`] if the message has another direction, or does not fit its number.
    fn read<'a>(header: &Header, payload: &'a [u8]) -> Result<Self::Message<'a>, Refusal>;
}

/// Direction of requests, which the box reads.
#[derive(Clone, Copy, Debug)]
pub enum ToBox {}

impl Direction for ToBox {
    type Message<'a> = Request<'a>;

    fn read<'a>(header: &Header, payload: &'a [u8]) -> Result<Request<'a>, Refusal> {
        let message = Request::read(header.number, payload)?;
        if header.request == 0 {
            return Err(Refusal::RequestId {
                number: header.number,
            });
        }
        Ok(message)
    }
}

/// Direction of replies and events, which the host reads.
#[derive(Clone, Copy, Debug)]
pub enum ToHost {}

impl Direction for ToHost {
    type Message<'a> = FromBox<'a>;

    fn read<'a>(header: &Header, payload: &'a [u8]) -> Result<FromBox<'a>, Refusal> {
        let number = header.number;
        if number < EVENTS {
            return Reply::read(number, payload).map(FromBox::Reply);
        }
        let event = Event::read(number, payload)?;
        if header.request != 0 {
            return Err(Refusal::RequestId { number });
        }
        Ok(FromBox::Event(event))
    }
}
