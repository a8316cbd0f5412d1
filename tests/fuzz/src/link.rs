//! A second decoder of frames, from the description of the protocol alone.

use massline_firmware::wire::{BODY_MAX, CHECKSUM, HEADER, Received, Receiver, Request, ToBox};

#[path = "../../../firmware/tests/wire/reference.rs"]
mod reference;
pub use reference::frame;
use reference::{checksum, unstuffed};

/// A header of this version of the protocol.
#[must_use]
pub fn header(number: u8, session: u16, sequence: u32, request: u16) -> [u8; HEADER] {
    let mut header = reference::header(number, sequence, request);
    header[2..4].copy_from_slice(&session.to_le_bytes());
    header
}

/// Kind of a piece between two zeros.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Piece {
    /// A valid frame: its header and its payload.
    Sound([u8; HEADER], Vec<u8>),
    /// The last group is incomplete.
    Cut,
    /// The piece is longer than the longest frame.
    Long,
    /// The piece is shorter than a header and a checksum.
    Short,
    /// The checksum is wrong.
    Garbled,
}

/// Classifies a piece between two zeros.
#[must_use]
pub fn classify(piece: &[u8]) -> Piece {
    let Some(body) = unstuffed(piece) else {
        // A cut piece may already have been too long.
        let whole = piece.len() <= BODY_MAX;
        return if whole { Piece::Cut } else { Piece::Long };
    };
    if body.len() > BODY_MAX {
        return Piece::Long;
    }
    if body.len() < HEADER + CHECKSUM {
        return Piece::Short;
    }
    let (covered, sum) = body.split_at(body.len() - CHECKSUM);
    if checksum(covered).to_le_bytes() != sum {
        return Piece::Garbled;
    }
    let (head, payload) = covered.split_at(HEADER);
    let mut header = [0; HEADER];
    header.copy_from_slice(head);
    Piece::Sound(header, payload.to_vec())
}

/// Passes the request of a number and a payload to `take`, if there is one.
pub fn request(number: u8, payload: &[u8], take: impl FnOnce(&Request<'_>)) {
    let wire = frame(&header(number, 1, 0, 1), payload);
    let mut buffer = [0; BODY_MAX];
    let mut receiver = Receiver::<ToBox>::new(&mut buffer);
    let mut rest = &wire[..];
    if let Some(Received::Message(_, request)) = receiver.next(&mut rest) {
        take(&request);
    }
}

/// Payload of a frame.
#[must_use]
pub fn payload(frame: &[u8]) -> Vec<u8> {
    let piece = frame.split(|&b| b == 0).find(|piece| !piece.is_empty());
    match piece.map(classify) {
        Some(Piece::Sound(_, payload)) => payload,
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_what_was_put_into_them() {
        assert_eq!(checksum(b"123456789"), 0xCBF4_3926);
        for n in [0, 1, 2, 243, 244, 245, 253, 254, 255, 507, 508, 509, 1003] {
            for zeros in [1, 3, 254, 255, 5000] {
                let payload: Vec<u8> = (1..=n).map(|i| u8::from(i % zeros != 0) * 7).collect();
                let head = header(3, 1, 2, 3);
                let wire = frame(&head, &payload);
                let piece = &wire[1..wire.len() - 1];
                assert!(!piece.contains(&0));
                assert_eq!(classify(piece), Piece::Sound(head, payload));
            }
        }
    }
}
