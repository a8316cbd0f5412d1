//! Frames written a second time, slowly and from the description alone.

use massline_firmware::wire::PROTOCOL_VERSION;

/// A header of this version and session 1.
pub fn header(number: u8, sequence: u32, request: u16) -> [u8; 10] {
    let mut h = [0; 10];
    h[0] = PROTOCOL_VERSION;
    h[1] = number;
    h[2] = 1;
    h[4..8].copy_from_slice(&sequence.to_le_bytes());
    h[8..10].copy_from_slice(&request.to_le_bytes());
    h
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
pub fn frame(header: &[u8; 10], payload: &[u8]) -> Vec<u8> {
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

/// Takes the stuffing out; `None` if the last group is not whole.
pub fn unstuffed(wire: &[u8]) -> Option<Vec<u8>> {
    let mut body = Vec::new();
    let mut at = 0;
    while at < wire.len() {
        let code = usize::from(wire[at]);
        body.extend(wire.get(at + 1..at + code)?);
        at += code;
        if code < 255 && at < wire.len() {
            body.push(0);
        }
    }
    Some(body)
}

#[test]
fn the_reference_agrees_with_itself() {
    assert_eq!(checksum(b"123456789"), 0xCBF4_3926);
    for n in [0, 1, 2, 253, 254, 255, 507, 508, 509, 1017] {
        for zeros in [1, 3, 254, 255, 5000] {
            let body: Vec<u8> = (0..n)
                .map(|i| if (i + 1) % zeros == 0 { 0 } else { 7 })
                .collect();
            assert_eq!(unstuffed(&stuffed(&body)), Some(body), "{n}, {zeros}");
        }
    }
}
