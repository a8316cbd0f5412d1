//! The table of messages: every number, what it means, what it carries.

use super::frame::{EncodeError, Header, write};
use super::{
    Block, ChannelHealth, Fault, FaultySamples, Grid, Identified, Info, Levels, Lines, Peaks, Ping,
    Plan, Pong, Processing, Progress, Provoke, Question, ReadLines, Refusal, Refused, Run, Samples,
    Saved, Selftest, Sensor, Setting, SettingKey, Start, Started, Status, Subscription, Summary,
    Telemetry, Weights,
};
use serde::Deserialize;

/// The name that a variant's body is bound to, if it has one.
macro_rules! bound {
    ($name:ident $body:ty) => {
        $name
    };
}

/// Turns one table into an enum, its numbers, and both ways between it and payloads.
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

            /// Its number.
            #[must_use]
            pub const fn number(&self) -> u8 {
                match self {
                    $( Self::$variant { .. } => $number, )*
                }
            }

            /// The name of a number.
            #[must_use]
            pub const fn name(number: u8) -> Option<&'static str> {
                match number {
                    $( $number => Some(stringify!($variant)), )*
                    _ => None,
                }
            }

            /// Writes its frame into `out`.
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
    /// What a host asks of the box. Each has exactly one reply: the one that is named here,
    /// or [`Reply::Error`]. Where a state is named, others are refused with
    /// [`super::Problem::State`].
    Request {
        /// Who is there? [`Reply::Info`]. In any state.
        0x01 Hello;
        /// Are you there, and what is the time? [`Reply::Pong`]. In any state.
        0x02 Ping(Ping);
        /// What are you doing? [`Reply::Status`]. In any state.
        0x03 Status;
        /// What to send unasked. [`Reply::Done`]. In any state; replaces what held before.
        0x04 Subscribe(Subscription);
        /// Fault counters to zero, panic text away. [`Reply::Done`]. In any state.
        0x05 ForgetFaults;
        /// Start afresh. [`Reply::Done`] at once, then [`Event::Started`]. In any state; ends a
        /// run, of which nothing is left.
        0x06 Reboot;
        /// For tests: fail or feign. [`Reply::Done`] at once, or unsupported. To fail, in any
        /// state, which ends a run; to feign, not while running or while samples are recorded.
        0x07 Provoke(Provoke);
        /// Run the synthetic body through the box. [`Reply::Selftest`] when it is done. Not
        /// while running; forgets set-up and stored runs, and leaves the box empty.
        0x08 Selftest;

        /// Forget set-up and stored runs; a new one comes. [`Reply::Done`]. Not while running.
        0x10 BeginSetup(Plan);
        /// Its processing. [`Reply::Done`]. While setting up.
        0x11 SetProcessing(Processing);
        /// One of its sensors. [`Reply::Done`]. While setting up.
        0x12 SetSensor(Sensor<'a>);
        /// One of its runs. [`Reply::Done`]. While setting up.
        0x13 SetRun(Run<'a>);
        /// Weights of a run. [`Reply::Done`]. While setting up, and when ready: they replace
        /// those of a survey.
        0x14 SetWeights(Weights<'a>);
        /// That is all of it. [`Reply::Grid`], and the box is ready.
        0x15 EndSetup;

        /// Start a run. [`Reply::Done`]. When ready; while running, the same start again
        /// changes nothing.
        0x20 Start(Start);
        /// Samples of the run. [`Reply::Progress`]. While running from the host. At most
        /// [`super::Capacity::window`] of them are unanswered at a time. Those that reach the
        /// run's limit end it.
        0x21 Samples(Samples<'a>);
        /// End the run. [`Reply::Summary`]. While running; without one, the summary of the
        /// run that ended last. The runs of a self-test are not the host's.
        0x22 Stop;
        /// Throw the run that is going on away. [`Reply::Done`]. In any state; without a run
        /// nothing happens.
        0x23 Abort;

        /// Summary of a finished run. [`Reply::Summary`].
        0x30 ReadSummary(u8);
        /// Lines of a stored run. [`Reply::Lines`], as many as fit.
        0x31 ReadLines(ReadLines);
        /// What the survey of a run found. [`Reply::Peaks`].
        0x32 ReadPeaks(u8);
        /// The weights of a run as they are now. [`Reply::Weights`].
        0x33 ReadWeights(u8);

        /// Identify. [`Reply::Identified`] when it is done; other requests are answered in
        /// the meantime. When ready.
        0x40 Identify(Question);
        /// The last answer. [`Reply::Identified`].
        0x41 ReadAnswer;

        /// One setting. [`Reply::Setting`]. In any state.
        0x50 ReadSetting(SettingKey);
        /// Change one setting. [`Reply::Done`]. Not while running; an input and the sample
        /// rate not while samples are recorded, either.
        0x51 WriteSetting(Setting<'a>);
        /// Keep the settings. [`Reply::Saved`]. Not while running, identifying or while samples
        /// are recorded: the flash stops the core.
        0x52 SaveSettings;
        /// Go back to the settings the box was delivered with. [`Reply::Done`]. Not while
        /// running, nor while samples are recorded; not kept until saved.
        0x53 ResetSettings;
    }
}

messages! {
    /// The box's answer to a request, with the request's id.
    Reply {
        /// It is done.
        0x80 Done;
        /// It was refused and has changed nothing.
        0x81 Error(Refused);
        /// Who is here.
        0x82 Info(Info<'a>);
        /// A sign of life.
        0x83 Pong(Pong);
        /// What the box is doing.
        0x84 Status(Status);
        /// How the self-test went.
        0x85 Selftest(Selftest);
        /// The lines of the set-up.
        0x86 Grid(Grid);
        /// How far the samples have come.
        0x87 Progress(Progress);
        /// A finished run.
        0x88 Summary(Summary);
        /// Lines of a stored run.
        0x89 Lines(Lines<'a>);
        /// What a survey found.
        0x8A Peaks(Peaks<'a>);
        /// The weights of a run.
        0x8B Weights(Weights<'a>);
        /// The ten numbers.
        0x8C Identified(Identified);
        /// One setting.
        0x8D Setting(Setting<'a>);
        /// The settings are kept.
        0x8E Saved(Saved);
    }
}

messages! {
    /// What the box says without being asked. Nothing waits for it: an event that finds no
    /// room on its way is given up, and its number is missing.
    Event {
        /// The box has started.
        0xC0 Started(Started);
        /// A block is complete.
        0xC1 Block(Block);
        /// The faults of the channels have changed.
        0xC2 Health(ChannelHealth<'a>);
        /// A run has ended by itself. Also to be had by [`Request::ReadSummary`].
        0xC3 RunEnded(Summary);
        /// Live levels. Subscribed to.
        0xC4 Levels(Levels<'a>);
        /// Samples of the box's own converters, in which their driver has found no fault.
        /// They are numbered since the converters' start. Subscribed to.
        0xC5 Recorded(Samples<'a>);
        /// How the box fares. Subscribed to.
        0xC6 Telemetry(Telemetry);
        /// A fault of the box.
        0xC7 Fault(Fault);
        /// Samples of the box's own converters, some of whose inputs are faulty. Subscribed
        /// to, with [`Event::Recorded`].
        0xC8 RecordedFaulty(FaultySamples<'a>);
    }
}

/// What a box says: an answer or an event.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "there is no heap to put the large one on, and none is kept"
)]
pub enum FromBox<'a> {
    /// An answer.
    Reply(Reply<'a>),
    /// An event.
    Event(Event<'a>),
}

/// Numbers from this on are events'.
const EVENTS: u8 = 0xC0;

/// Which way messages go.
pub trait Direction {
    /// What is read.
    type Message<'a>;

    /// Reads the payload of a frame.
    ///
    /// # Errors
    /// [`Refusal`] if it is not of this direction, or not what its number says.
    fn read<'a>(header: &Header, payload: &'a [u8]) -> Result<Self::Message<'a>, Refusal>;
}

/// Requests, as the box reads them.
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

/// Replies and events, as the host reads them.
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
