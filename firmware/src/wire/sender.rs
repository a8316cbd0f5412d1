//! The sending end: it makes numbered frames of messages.

use super::frame::{EncodeError, Header};
use super::{Event, PROTOCOL_VERSION, Reply, Request};

/// Makes frames of messages and numbers them.
///
/// There is one for each direction and link. The box calls [`reply`](Self::reply) and
/// [`event`](Self::event), the host calls [`request`](Self::request).
///
/// Every message that was *produced* uses up a number, even if it could not be written or found no
/// room in a queue ([`skip`](Self::skip)): each lost message leaves a gap in the numbers.
#[derive(Clone, Copy, Debug)]
pub struct Sender {
    session: u16,
    next: u32,
}

impl Sender {
    /// Starts a session with frame zero.
    ///
    /// `session` must differ from the two before it on the same side. A box counts its resets in
    /// memory that is retained over a reset; a host takes a new number, such as one from its clock,
    /// each time it opens the link or sends [`Request::Hello`] again.
    #[must_use]
    pub const fn new(session: u16) -> Self {
        Self { session, next: 0 }
    }

    /// Frames produced in this session, modulo 2³².
    #[must_use]
    pub const fn produced(&self) -> u32 {
        self.next
    }

    /// Counts a message that is dropped before it becomes a frame, since the queue to the link is
    /// full.
    pub const fn skip(&mut self) {
        self.next = self.next.wrapping_add(1);
    }

    fn header(&mut self, number: u8, request: u16) -> Header {
        let sequence = self.next;
        self.skip();
        Header {
            version: PROTOCOL_VERSION,
            number,
            session: self.session,
            sequence,
            request,
        }
    }

    /// Writes a request into `out` and returns its frame. The reply has the same `id`, which is not
    /// zero and not that of another unanswered request.
    ///
    /// # Errors
    /// [`EncodeError`]; the frame's number is used up all the same.
    pub fn request<'o>(
        &mut self,
        id: u16,
        message: &Request<'_>,
        out: &'o mut [u8],
    ) -> Result<&'o [u8], EncodeError> {
        let header = self.header(message.number(), id);
        if id == 0 {
            return Err(EncodeError::NoRequestId);
        }
        let length = message.write(header, out)?;
        out.get(..length).ok_or(EncodeError::BufferTooShort)
    }

    /// Writes the reply to request `id` into `out` and returns its frame.
    ///
    /// # Errors
    /// [`EncodeError`]; the frame's number is used up all the same.
    pub fn reply<'o>(
        &mut self,
        id: u16,
        message: &Reply<'_>,
        out: &'o mut [u8],
    ) -> Result<&'o [u8], EncodeError> {
        let header = self.header(message.number(), id);
        let length = message.write(header, out)?;
        out.get(..length).ok_or(EncodeError::BufferTooShort)
    }

    /// Writes an event into `out` and returns its frame.
    ///
    /// # Errors
    /// [`EncodeError`]; the frame's number is used up all the same.
    pub fn event<'o>(
        &mut self,
        message: &Event<'_>,
        out: &'o mut [u8],
    ) -> Result<&'o [u8], EncodeError> {
        let header = self.header(message.number(), 0);
        let length = message.write(header, out)?;
        out.get(..length).ok_or(EncodeError::BufferTooShort)
    }
}

/// Identifiers for requests: 1 to 65535 in turn, never zero.
#[derive(Clone, Copy, Debug, Default)]
pub struct RequestIds(u16);

impl RequestIds {
    /// Starts with identifier one.
    #[must_use]
    pub const fn new() -> Self {
        Self(0)
    }

    /// Returns the next identifier.
    pub const fn fresh(&mut self) -> u16 {
        self.0 = match self.0 {
            u16::MAX => 1,
            id => id.saturating_add(1),
        };
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_go_around_without_zero() {
        let mut ids = RequestIds(u16::MAX - 1);
        assert_eq!([ids.fresh(), ids.fresh(), ids.fresh()], [u16::MAX, 1, 2]);
    }

    #[test]
    fn a_message_that_could_not_be_written_leaves_a_gap() {
        let mut sender = Sender::new(1);
        let mut out = [0; 8];
        let nothing = sender.request(0, &Request::Hello, &mut out);
        assert_eq!(nothing, Err(EncodeError::NoRequestId));
        let nothing = sender.request(1, &Request::Hello, &mut out);
        assert_eq!(nothing, Err(EncodeError::BufferTooShort));
        sender.skip();
        assert_eq!(sender.produced(), 3);
    }
}
