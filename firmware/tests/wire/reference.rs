//! Frames written a second time, slowly and from the description alone.

use massline_firmware::wire::{CRC32, PROTOCOL_VERSION};

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

/// The frame of a header and a payload, both delimiters included.
pub fn frame(header: &[u8; 10], payload: &[u8]) -> Vec<u8> {
    let mut body = header.to_vec();
    body.extend(payload);
    let checksum = CRC32.checksum(&body);
    body.extend(checksum.to_le_bytes());
    let mut wire = vec![0];
    wire.extend(stuffed(&body));
    wire.push(0);
    wire
}

/// Byte stuffing: groups between zeros, cut after 254 bytes, each behind its code.
pub fn stuffed(body: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let groups: Vec<&[u8]> = body.split(|&b| b == 0).collect();
    for group in groups {
        let mut rest = group;
        while rest.len() >= 254 {
            out.push(255);
            out.extend(&rest[..254]);
            rest = &rest[254..];
        }
        // Behind a full cut an empty group is needed only to carry a zero.
        out.push(rest.len() as u8 + 1);
        out.extend(rest);
    }
    if body
        .rsplit(|&b| b == 0)
        .next()
        .is_some_and(|g| !g.is_empty() && g.len() % 254 == 0)
    {
        out.pop();
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
    for n in [0, 1, 2, 253, 254, 255, 507, 508, 509, 1017] {
        for zeros in [1, 3, 254, 255, 5000] {
            let body: Vec<u8> = (0..n)
                .map(|i| if (i + 1) % zeros == 0 { 0 } else { 7 })
                .collect();
            assert_eq!(unstuffed(&stuffed(&body)), Some(body), "{n}, {zeros}");
        }
    }
}
