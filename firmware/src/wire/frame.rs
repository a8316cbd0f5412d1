//! One frame: header, payload and checksum, and their encoding on the wire. The module
//! [`super`] shows the layout.
//!
//! A frame has a delimiter on both sides. With one delimiter only, a broken delimiter would join
//! two frames and lose both, and so would the noise of a port that opens. Receivers skip the
//! empty frame between two delimiters.

use cobs::CobsEncoder;
use crc::{CRC_32_ISO_HDLC, Crc, Digest};
use postcard::ser_flavors::Flavor;
use serde::Serialize;

/// Length of the header in bytes.
pub const HEADER: usize = 10;

/// Length of the checksum in bytes.
pub const CHECKSUM: usize = 4;

/// Largest number of bytes of header, payload and checksum together: the size of a receive buffer.
pub const BODY_MAX: usize = 1017;

/// Largest number of bytes of a payload.
pub const PAYLOAD_MAX: usize = BODY_MAX - HEADER - CHECKSUM;

/// Largest number of bytes of a frame on the wire, with both delimiters: the size of a send
/// buffer.
pub const FRAME_MAX: usize = 1024;

const _: () = assert!(2 + cobs::max_encoding_length(BODY_MAX) == FRAME_MAX);

/// CRC-32/ISO-HDLC, the checksum of frames, settings and retained memory.
///
/// The chip's CRC unit computes the unreflected form of 32-bit words only, so that this one is
/// computed by a table of 1 KiB.
pub static CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Header of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Protocol version of the sender.
    pub version: u8,
    /// Number of the message, see [`super::Request`], [`super::Reply`], [`super::Event`].
    pub number: u8,
    /// Session of the sender, one for each run of its program; see [`super::Sender::new`].
    pub session: u16,
    /// Number of frames that the sender produced before this one in the session.
    pub sequence: u32,
    /// Identifier that a reply shares with its request; zero for events.
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

/// Reason why a body is not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BodyError {
    /// The body is shorter than a header and a checksum.
    Short,
    /// The checksum does not match.
    Checksum,
}

/// Checks a body and splits it into header and payload.
pub(super) fn open(body: &[u8]) -> Result<(Header, &[u8]), BodyError> {
    let (covered, checksum) = body
        .split_last_chunk::<CHECKSUM>()
        .ok_or(BodyError::Short)?;
    let (header, payload) = covered
        .split_first_chunk::<HEADER>()
        .ok_or(BodyError::Short)?;
    if CRC32.checksum(covered) != u32::from_le_bytes(*checksum) {
        return Err(BodyError::Checksum);
    }
    Ok((Header::from_bytes(*header), payload))
}

/// Reason why a frame cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncodeError {
    /// The message is longer than [`PAYLOAD_MAX`]: too many samples or lines, or a text
    /// beyond its stated length.
    MessageTooLong,
    /// The lent buffer is shorter than this frame; [`FRAME_MAX`] bytes are always enough.
    BufferTooShort,
    /// A request has the identifier zero, which stands for no request.
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

/// Writes a frame into `out` and returns its length.
pub(super) fn write<T: Serialize + ?Sized>(
    header: Header,
    payload: &T,
    out: &mut [u8],
) -> Result<usize, EncodeError> {
    let (before, rest) = out.split_first_mut().ok_or(EncodeError::BufferTooShort)?;
    let mut error = None;
    let mut writer = Writer {
        cobs: CobsEncoder::new(&mut *rest),
        crc: CRC32.digest(),
        room: BODY_MAX - CHECKSUM,
        error: &mut error,
    };
    let written = writer
        .try_extend(&header.to_bytes())
        .and_then(|()| postcard::serialize_with_flavor(payload, writer));
    // The serialiser has one error for all failures; the writer distinguishes them. Nothing else
    // can fail: all sequences in the protocol know their length.
    let stuffed = written.map_err(|_| error.unwrap_or(EncodeError::MessageTooLong))?;
    *before = 0;
    *rest.get_mut(stuffed).ok_or(EncodeError::BufferTooShort)? = 0;
    Ok(stuffed.saturating_add(2))
}

/// Output of the serialiser: it computes the checksum and stuffs the bytes in one pass.
struct Writer<'o, 'e> {
    cobs: CobsEncoder<'o>,
    crc: Digest<'static, u32>,
    /// Number of bytes that still fit in front of the checksum.
    room: usize,
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

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.try_extend(&[byte])
    }

    // Every field of every message ends here: a copy inlined at each of them would take
    // 16 KiB of flash.
    #[inline(never)]
    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        match self.room.checked_sub(bytes.len()) {
            Some(room) => self.room = room,
            None => return Err(self.fail(EncodeError::MessageTooLong)),
        }
        self.crc.update(bytes);
        self.cobs
            .push(bytes)
            .map_err(|_| self.fail(EncodeError::BufferTooShort))
    }

    /// Ends the body with its checksum and returns the number of stuffed bytes.
    fn finalize(self) -> postcard::Result<usize> {
        let Self {
            mut cobs,
            crc,
            error,
            ..
        } = self;
        if cobs.push(&crc.finalize().to_le_bytes()).is_err() {
            *error = Some(EncodeError::BufferTooShort);
            return Err(postcard::Error::SerializeBufferFull);
        }
        Ok(cobs.finalize())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_the_catalogue() {
        assert_eq!(CRC32.checksum(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn a_small_buffer_is_an_error_at_every_length() {
        let header = Header {
            version: 0,
            number: 1,
            session: 2,
            sequence: 3,
            request: 4,
        };
        // With zeros, without one, and with a full group of 254 bytes.
        for payload in [&[3, 0, 4, 0, 0, 5][..], &[7; 20], &[7; 300]] {
            let mut out = [0xAA; FRAME_MAX];
            let needed = write(header, payload, &mut out).unwrap();
            assert_eq!(
                (out[0], out[needed - 1], out[needed]),
                (0, 0, 0xAA),
                "the frame ends at {needed}"
            );
            for length in 0..needed {
                let short = write(header, payload, &mut out[..length]);
                assert_eq!(short, Err(EncodeError::BufferTooShort), "{length} bytes");
            }
        }
    }
}
