//! A second encoder and decoder of frames, from the description of the protocol alone.

use massline_firmware::wire::{
    BODY_MAX, CHECKSUM, HEADER, PROTOCOL_VERSION, Received, Receiver, Request, ToBox,
};

/// A header of this version of the protocol.
#[must_use]
pub fn header(number: u8, session: u16, sequence: u32, request: u16) -> [u8; HEADER] {
    let mut header = [0; HEADER];
    header[0] = PROTOCOL_VERSION;
    header[1] = number;
    header[2..4].copy_from_slice(&session.to_le_bytes());
    header[4..8].copy_from_slice(&sequence.to_le_bytes());
    header[8..].copy_from_slice(&request.to_le_bytes());
    header
}

/// The checksum of each byte, from the polynomial.
const OF_BYTE: [u32; 256] = {
    let mut all = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            crc = (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg());
            bit += 1;
        }
        all[byte] = crc;
        byte += 1;
    }
    all
};

/// CRC-32/ISO-HDLC.
#[must_use]
pub fn checksum(bytes: &[u8]) -> u32 {
    let step = |crc: u32, byte: &u8| (crc >> 8) ^ OF_BYTE[usize::from(crc as u8 ^ byte)];
    !bytes.iter().fold(u32::MAX, step)
}

/// The frame of a header and a payload, both delimiters included.
#[must_use]
pub fn frame(header: &[u8; HEADER], payload: &[u8]) -> Vec<u8> {
    let mut body = header.to_vec();
    body.extend(payload);
    body.extend(checksum(&body).to_le_bytes());
    let mut wire = vec![0];
    wire.extend(stuffed(&body));
    wire.push(0);
    wire
}

/// Byte stuffing: groups between zeros, cut after 254 bytes, each behind its code.
#[must_use]
pub fn stuffed(body: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut groups = body.split(|&b| b == 0).peekable();
    while let Some(mut group) = groups.next() {
        while group.len() >= 254 {
            out.push(255);
            out.extend(&group[..254]);
            group = &group[254..];
            if group.is_empty() && groups.peek().is_none() {
                // After a full group an empty one is needed only for a zero.
                return out;
            }
        }
        out.push(group.len() as u8 + 1);
        out.extend(group);
    }
    out
}

/// Decodes the bytes between two zeros; `None` if the last group is incomplete.
#[must_use]
pub fn unstuffed(piece: &[u8]) -> Option<Vec<u8>> {
    let mut body = Vec::new();
    let mut at = 0;
    while at < piece.len() {
        let code = usize::from(piece[at]);
        body.extend(piece.get(at + 1..at + code)?);
        at += code;
        if code < 255 && at < piece.len() {
            body.push(0);
        }
    }
    Some(body)
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
