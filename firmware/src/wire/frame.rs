//! One frame: header, payload, checksum, and how they lie on the wire. The layout is
//! drawn in the description of [`super`].
//!
//! With a delimiter on one side only, a broken delimiter would join two frames and cost
//! both, and so would the noise of a port that opens. The second one costs a byte.
//! Receivers skip the empty frame between two of them.

use super::cobs::{Encoder, Full};
use super::crc::Crc32;
use postcard::ser_flavors::Flavor;
use serde::Serialize;

/// Bytes of the header.
pub const HEADER: usize = 10;

/// Bytes of the checksum.
pub const CHECKSUM: usize = 4;

/// Most bytes of header, payload and checksum: what a receiver must hold.
pub const BODY_MAX: usize = 1017;

/// Most bytes of a payload.
pub const PAYLOAD_MAX: usize = BODY_MAX - HEADER - CHECKSUM;

/// Most bytes of a frame on the wire, both delimiters included: what a sender must hold.
pub const FRAME_MAX: usize = 1024;

// Two delimiters, the first code, and one more for each full group.
const _: () = assert!(2 + 1 + BODY_MAX / 254 + BODY_MAX == FRAME_MAX);

/// What every frame says before its payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Version of the contract that the sender was built with.
    pub version: u8,
    /// Number of the message, see [`super::Request`], [`super::Reply`], [`super::Event`].
    pub number: u8,
    /// One run of the sender's program. See [`super::Sender::new`].
    pub session: u16,
    /// Counts every frame that the sender produced in this session, from zero.
    pub sequence: u32,
    /// Pairs a reply with its request; zero for events.
    pub request: u16,
}

impl Header {
    const fn to_bytes(self) -> [u8; HEADER] {
        let [s0, s1] = self.session.to_le_bytes();
        let [n0, n1, n2, n3] = self.sequence.to_le_bytes();
        let [r0, r1] = self.request.to_le_bytes();
        [self.version, self.number, s0, s1, n0, n1, n2, n3, r0, r1]
    }

    const fn from_bytes(bytes: [u8; HEADER]) -> Self {
        let [version, number, s0, s1, n0, n1, n2, n3, r0, r1] = bytes;
        Self {
            version,
            number,
            session: u16::from_le_bytes([s0, s1]),
            sequence: u32::from_le_bytes([n0, n1, n2, n3]),
            request: u16::from_le_bytes([r0, r1]),
        }
    }
}

/// Why a body is no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BodyError {
    /// Shorter than a header and a checksum.
    Short,
    /// The checksum is that of other bytes.
    Checksum,
}

/// Checks a body and takes it apart into header and payload.
pub(super) fn open(body: &[u8]) -> Result<(Header, &[u8]), BodyError> {
    let (covered, checksum) = body
        .split_last_chunk::<CHECKSUM>()
        .ok_or(BodyError::Short)?;
    let (header, payload) = covered
        .split_first_chunk::<HEADER>()
        .ok_or(BodyError::Short)?;
    if super::crc::crc32(covered) != u32::from_le_bytes(*checksum) {
        return Err(BodyError::Checksum);
    }
    Ok((Header::from_bytes(*header), payload))
}

/// Why a frame cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncodeError {
    /// The message is longer than [`PAYLOAD_MAX`]: too many samples or lines, or a text
    /// beyond its stated length.
    MessageTooLong,
    /// The lent buffer is shorter than this frame; [`FRAME_MAX`] is always enough.
    BufferTooShort,
    /// A request with the id zero, which means no request.
    NoRequestId,
}

impl core::fmt::Display for EncodeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::MessageTooLong => {
                write!(f, "the message is longer than {PAYLOAD_MAX} bytes")
            }
            Self::BufferTooShort => write!(
                f,
                "the buffer is too short for the frame; {FRAME_MAX} bytes are always enough"
            ),
            Self::NoRequestId => f.write_str("a request needs an id other than zero"),
        }
    }
}

impl core::error::Error for EncodeError {}

/// Writes a frame into `out`; its length.
pub(super) fn write<T: Serialize + ?Sized>(
    header: Header,
    payload: &T,
    out: &mut [u8],
) -> Result<usize, EncodeError> {
    let mut error = None;
    let first = out.first_mut().ok_or(EncodeError::BufferTooShort)?;
    *first = 0;
    let mut writer = Writer {
        cobs: Encoder::new(out, 1),
        crc: Crc32::new(),
        length: 0,
        error: &mut error,
    };
    let written = writer
        .try_extend(&header.to_bytes())
        .and_then(|()| postcard::serialize_with_flavor(payload, writer));
    // The serialiser knows one error for all that can go wrong; the writer knows which.
    // It cannot fail otherwise: all sequences in the contract know their length.
    written.map_err(|_| error.unwrap_or(EncodeError::MessageTooLong))
}

/// What the serialiser writes to: checksum and stuffing in one pass.
struct Writer<'o, 'e> {
    cobs: Encoder<'o>,
    crc: Crc32,
    /// Bytes of the body so far, without the checksum.
    length: usize,
    error: &'e mut Option<EncodeError>,
}

impl Writer<'_, '_> {
    fn fail(&mut self, error: EncodeError) -> postcard::Error {
        *self.error = Some(error);
        postcard::Error::SerializeBufferFull
    }
}

impl Flavor for Writer<'_, '_> {
    type Output = usize;

    // Every field of every message ends here: a copy inlined at each of them would take
    // 16 KiB of flash.
    #[inline(never)]
    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        if self.length >= BODY_MAX - CHECKSUM {
            return Err(self.fail(EncodeError::MessageTooLong));
        }
        self.length += 1;
        self.crc.push(byte);
        self.cobs
            .push(byte)
            .map_err(|Full| self.fail(EncodeError::BufferTooShort))
    }

    fn finalize(mut self) -> postcard::Result<usize> {
        let checksum = self.crc.value().to_le_bytes();
        for byte in checksum {
            if self.cobs.push(byte).is_err() {
                return Err(self.fail(EncodeError::BufferTooShort));
            }
        }
        let Self { cobs, error, .. } = self;
        cobs.finish().map_err(|Full| {
            *error = Some(EncodeError::BufferTooShort);
            postcard::Error::SerializeBufferFull
        })
    }
}
