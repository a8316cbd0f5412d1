//! Why a box did not do what was asked.

use crate::device::PortError;
use massline_firmware::wire::{
    EncodeError, PROTOCOL_VERSION, Refused, Reply, Request, ResetReason,
};
use std::time::Duration;

/// Why a box did not do what was asked.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The connection.
    #[error(transparent)]
    Port(#[from] PortError),
    /// No answer, however often it was asked.
    #[error(
        "{port}: no answer to {}, asked {attempts} times in {:.1} s; {}",
        name(*.request), .waited.as_secs_f64(),
        if *.heard {
            "the link loses frames: look at the cable and the bit rate, or start the box again"
        } else {
            "nothing that a massline box says came: is it the right port, is the bit rate the box's (--baud), is the firmware on it (`massline flash`)?"
        }
    )]
    Silent {
        /// Name of the port.
        port: String,
        /// Number of the request.
        request: u8,
        /// Times that it was sent.
        attempts: u32,
        /// For how long altogether.
        waited: Duration,
        /// `true` if the box was ever heard on this link.
        heard: bool,
    },
    /// The box has refused, and says why.
    #[error("the box: {0}")]
    Refused(Refused),
    /// The box has another version of the protocol.
    #[error(
        "the box speaks version {found} of the link and this program version {PROTOCOL_VERSION}: put this program's firmware on it by `massline flash`"
    )]
    Version {
        /// The box's.
        found: u8,
    },
    /// An answer of the wrong kind.
    #[error(
        "the box answered {} with {}; its firmware and this program are of different builds, flash this one by `massline flash`",
        name(*.request), Reply::name(*.reply).unwrap_or("something that this program cannot read")
    )]
    Unexpected {
        /// Number of the request.
        request: u8,
        /// Number of the reply.
        reply: u8,
    },
    /// An answer that no box can mean.
    #[error(
        "the box answered {} with {what} of {found}, expected {expected}; it is faulty, or no massline box: start it again, and if that does not help put the firmware on it anew by `massline flash`",
        name(*.request)
    )]
    Limit {
        /// Number of the request.
        request: u8,
        /// The quantity.
        what: &'static str,
        /// Its value.
        found: String,
        /// The values that are taken.
        expected: String,
    },
    /// It works at a request without end.
    #[error(
        "the box is still at work on {} after {seconds:.0} s; start it again by `massline board restart` or switch it off and on, and if that does not help put the firmware on it anew by `massline flash`",
        name(*.request)
    )]
    Busy {
        /// Number of the request.
        request: u8,
        /// For how long, s.
        seconds: f64,
    },
    /// It answers, but so late that nothing can be done with it.
    #[error(
        "{port}: only {read} of {inputs} inputs were read within {seconds:.0} s, the link is too slow or loses too much; look at the cable and the bit rate (--baud)"
    )]
    Slow {
        /// Name of the port.
        port: String,
        /// Inputs that were read.
        read: u8,
        /// Inputs of the box.
        inputs: u8,
        /// The time, s.
        seconds: f64,
    },
    /// The box says to have samples that it was never sent.
    #[error(
        "the box expects sample {next}, but was only sent those before {end}: somebody else sends to it; let only one program talk to it and replay again"
    )]
    Ahead {
        /// Number of the sample that it expects.
        next: u64,
        /// The first one that was not sent.
        end: u64,
    },
    /// The box started anew while it was asked something.
    #[error(
        "the box has started anew in the middle of {}, its set-up and runs are gone; {}",
        name(*.request), reason(*.reset, .panic.as_deref())
    )]
    Restarted {
        /// Number of the request.
        request: u8,
        /// Why, if the box has said so since.
        reset: Option<ResetReason>,
        /// Text of its panic.
        panic: Option<String>,
    },
    /// The box wants samples again that it had said to have.
    #[error(
        "the box expects sample {next}, but had said to have all before {first}: somebody else has started a run on it; let only one program talk to it and replay again"
    )]
    Behind {
        /// Number of the sample that it expects.
        next: u64,
        /// The first one that it has not confirmed.
        first: u64,
    },
    /// A message that does not fit a frame.
    #[error("{} does not fit the link: {source}", name(*.request))]
    Encode {
        /// Number of the request.
        request: u8,
        /// Why.
        source: EncodeError,
    },
}

fn reason(reset: Option<ResetReason>, panic: Option<&str>) -> String {
    match (reset, panic) {
        (_, Some(panic)) => format!("its firmware has failed: {panic}; report this text"),
        (Some(ResetReason::PowerOn | ResetReason::BrownOut), None) => {
            "it was without power for a moment: look at its supply".to_owned()
        }
        (Some(reset), None) => format!(
            "its reason: {reset:?}; if it happens again, report it with what `massline board info` says"
        ),
        (None, None) => "`massline board info` says why".to_owned(),
    }
}

fn name(request: u8) -> &'static str {
    Request::name(request).unwrap_or("a request")
}
