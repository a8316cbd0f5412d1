//! The receiving end: it takes bytes, gives messages, and counts everything else.

use super::frame::{BODY_MAX, BodyError, CHECKSUM, HEADER, Header, open};
use super::sequence::{Arrival, Tracker};
use super::{Direction, PROTOCOL_VERSION};
use cobs::{DecodeResult, DecoderState};
use serde::{Deserialize, Serialize};

/// Counters of a receiver. They stop at their maximum instead of wrapping.
///
/// `lost` counts frames exactly. `bad_crc` to `truncated` count the pieces that arrived in the
/// place of lost frames; one lost frame may leave two broken pieces behind, or none. A loss is
/// noticed when a later frame arrives: [`super::Request::Ping`] asks for one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LinkCounters {
    /// Frames that were accepted: intact, new and in order. They include those of an unknown
    /// version or number and the malformed ones, each of which is refused by a reply.
    pub frames: u32,
    /// Frames that the peer produced and that were not accepted, by its sequence numbers.
    pub lost: u64,
    /// Frames with a wrong checksum.
    pub bad_crc: u32,
    /// Frames that end in the middle of a group, since bytes are missing or a zero was added.
    pub bad_cobs: u32,
    /// Frames longer than [`BODY_MAX`].
    pub oversize: u32,
    /// Well-formed frames shorter than a header and a checksum.
    pub truncated: u32,
    /// Frames that were accepted before.
    pub duplicates: u32,
    /// Frames that a later frame overtook; they are among the lost ones.
    pub out_of_order: u32,
    /// Intact frames of another protocol version.
    pub unknown_version: u32,
    /// Intact frames with a message number that this direction does not have.
    pub unknown_number: u32,
    /// Intact frames whose payload does not fit their message number.
    pub malformed: u32,
    /// Restarts of the peer.
    pub restarts: u32,
}

/// Reason why an intact frame is not a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The peer uses another protocol version.
    Version {
        /// The peer's version; this side has [`PROTOCOL_VERSION`].
        found: u8,
    },
    /// This direction has no such message: the peer is an older or newer one of the same version.
    UnknownNumber {
        /// The number.
        found: u8,
    },
    /// The payload does not fit its number, or has bytes left over.
    Malformed {
        /// The number.
        number: u8,
    },
    /// A request without an id, or an event with one.
    RequestId {
        /// The number.
        number: u8,
    },
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Version { found } => write!(
                f,
                "the other side speaks version {found} of the link, this side {PROTOCOL_VERSION}"
            ),
            Self::UnknownNumber { found } => write!(f, "there is no message {found:#04x}"),
            Self::Malformed { number } => {
                write!(f, "the content of message {number:#04x} cannot be read")
            }
            Self::RequestId { number } => write!(
                f,
                "message {number:#04x} is a request without an id or an event with one"
            ),
        }
    }
}

impl core::error::Error for Refusal {}

/// An intact frame, new and in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Received<M> {
    /// A message.
    Message(Header, M),
    /// A frame that this side cannot read as a message. A box answers it with
    /// [`super::Reply::Error`], to the request identifier of the header.
    Refused(Header, Refusal),
}

/// Finds messages in a stream of bytes, whatever else the stream holds and however it is cut.
///
/// It never fails and never stops: bytes that are not a frame are counted and dropped at the next
/// delimiter. `D` is the direction of the messages, [`super::ToBox`] or [`super::ToHost`].
///
/// ```
/// use massline_firmware::wire::{BODY_MAX, Received, Receiver, ToBox};
///
/// # fn handle(_: &Received<massline_firmware::wire::Request<'_>>) {}
/// # let chunk = [0; 3];
/// let mut buffer = [0; BODY_MAX];
/// let mut receiver = Receiver::<ToBox>::new(&mut buffer);
/// // For every chunk from the link:
/// let mut rest = &chunk[..];
/// while let Some(received) = receiver.next(&mut rest) {
///     handle(&received);
/// }
/// ```
#[derive(Debug)]
pub struct Receiver<'b, D> {
    buffer: &'b mut [u8; BODY_MAX],
    length: usize,
    overflow: bool,
    cobs: DecoderState,
    tracker: Tracker,
    counters: LinkCounters,
    direction: core::marker::PhantomData<fn() -> D>,
}

impl<'b, D: Direction> Receiver<'b, D> {
    /// Creates a receiver over lent storage.
    #[must_use]
    pub const fn new(buffer: &'b mut [u8; BODY_MAX]) -> Self {
        Self {
            buffer,
            length: 0,
            overflow: false,
            cobs: DecoderState::Idle,
            tracker: Tracker::new(),
            counters: LinkCounters {
                frames: 0,
                lost: 0,
                bad_crc: 0,
                bad_cobs: 0,
                oversize: 0,
                truncated: 0,
                duplicates: 0,
                out_of_order: 0,
                unknown_version: 0,
                unknown_number: 0,
                malformed: 0,
                restarts: 0,
            },
            direction: core::marker::PhantomData,
        }
    }

    /// The counters so far.
    #[must_use]
    pub const fn counters(&self) -> &LinkCounters {
        &self.counters
    }

    /// The tracker of the peer's frames.
    #[must_use]
    pub const fn tracker(&self) -> &Tracker {
        &self.tracker
    }

    /// Takes bytes off the front of `input` until a frame is complete. The caller calls again with
    /// the rest until `None` says that all of `input` is taken.
    pub fn next<'s>(&'s mut self, input: &mut &[u8]) -> Option<Received<D::Message<'s>>> {
        loop {
            let (&byte, rest) = input.split_first()?;
            *input = rest;
            if let Some((header, length)) = self.take(byte) {
                return Some(self.deliver(header, length));
            }
        }
    }

    /// Takes one byte. If the byte ends an intact frame that is new and in order, returns the
    /// header and the length of the body in the buffer.
    fn take(&mut self, byte: u8) -> Option<(Header, usize)> {
        let broken = match self.cobs.feed(byte) {
            Ok(DecodeResult::NoData | DecodeResult::DataStart) => return None,
            Ok(DecodeResult::DataContinue(byte)) => {
                match self.buffer.get_mut(self.length) {
                    Some(slot) => {
                        *slot = byte;
                        self.length = self.length.saturating_add(1);
                    }
                    None => self.overflow = true,
                }
                return None;
            }
            Ok(DecodeResult::DataComplete) => false,
            Err(_) => true,
        };
        let length = core::mem::take(&mut self.length);
        let overflow = core::mem::take(&mut self.overflow);
        let header = self.judge(length, overflow, broken)?;
        Some((header, length))
    }

    /// Checks a complete body and counts it; returns the header of an acceptable one.
    fn judge(&mut self, length: usize, overflow: bool, broken: bool) -> Option<Header> {
        let counters = &mut self.counters;
        if overflow {
            count(&mut counters.oversize);
            return None;
        }
        if broken {
            count(&mut counters.bad_cobs);
            return None;
        }
        let header = match open(self.buffer.get(..length)?) {
            Ok((header, _)) => header,
            Err(BodyError::Short) => {
                count(&mut counters.truncated);
                return None;
            }
            Err(BodyError::Checksum) => {
                count(&mut counters.bad_crc);
                return None;
            }
        };
        match self.tracker.arrive(header.session, header.sequence) {
            Arrival::New { lost, restarted } => {
                count(&mut counters.frames);
                counters.lost = counters.lost.saturating_add(u64::from(lost));
                if restarted {
                    count(&mut counters.restarts);
                }
                Some(header)
            }
            Arrival::Duplicate => {
                count(&mut counters.duplicates);
                None
            }
            Arrival::OutOfOrder => {
                count(&mut counters.out_of_order);
                None
            }
        }
    }

    /// Reads the message in the buffer, which the next byte will overwrite.
    fn deliver(&mut self, header: Header, length: usize) -> Received<D::Message<'_>> {
        let payload = self
            .buffer
            .get(HEADER..length.saturating_sub(CHECKSUM))
            .unwrap_or(&[]);
        let message = if header.version == PROTOCOL_VERSION {
            D::read(&header, payload)
        } else {
            Err(Refusal::Version {
                found: header.version,
            })
        };
        match message {
            Ok(message) => Received::Message(header, message),
            Err(refusal) => {
                count(match refusal {
                    Refusal::Version { .. } => &mut self.counters.unknown_version,
                    Refusal::UnknownNumber { .. } => &mut self.counters.unknown_number,
                    Refusal::Malformed { .. } | Refusal::RequestId { .. } => {
                        &mut self.counters.malformed
                    }
                });
                Received::Refused(header, refusal)
            }
        }
    }
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
