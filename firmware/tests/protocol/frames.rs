//! Malformed frames: out of random bytes, and out of requests whose bytes were
//! changed.

use crate::draw::Material;
use crate::random::Random;
use crate::{messages, reference};
use massline_firmware::wire::{CHECKSUM, FRAME_MAX, HEADER, PAYLOAD_MAX, Request, Sender};

/// Content of a frame behind its envelope.
#[derive(Clone, Debug)]
pub struct Piece {
    pub number: u8,
    pub payload: Vec<u8>,
}

/// Pieces of sound requests of every kind, drawn at random, and of those that `fitting` gives.
pub fn corpus(
    random: &mut Random,
    fitting: impl Fn(&mut Random, &mut dyn FnMut(&Request<'_>)),
) -> Vec<Piece> {
    let mut corpus = Vec::new();
    let mut frame = [0; FRAME_MAX];
    let mut keep = |request: &Request<'_>| {
        // A text or a list may be drawn that is longer than a frame.
        if let Ok(written) = Sender::new(1).request(1, request, &mut frame) {
            let body = reference::unstuffed(&written[1..written.len() - 1]).expect("whole groups");
            corpus.push(Piece {
                number: request.number(),
                payload: body[HEADER..body.len() - CHECKSUM].to_vec(),
            });
        }
    };
    for _ in 0..200 {
        let entropy = (0..200).map(|_| random.bits() as u8).collect();
        let material = Material::new(entropy, "table".to_owned());
        for (number, _) in Request::TABLE {
            keep(&messages::request(*number, &mut material.draw()));
        }
        fitting(random, &mut keep);
    }
    corpus
}

/// The next piece: one of the corpus as it is, one whose bytes were changed, or random bytes.
pub fn piece(corpus: &[Piece], random: &mut Random) -> Piece {
    let mut piece = corpus[random.index(corpus.len())].clone();
    match random.index(8) {
        0 => {
            piece.payload = (0..random.index(60)).map(|_| random.bits() as u8).collect();
            piece.number = random.bits() as u8;
        }
        1..6 => {
            let other = &corpus[random.index(corpus.len())].payload;
            mutate(&mut piece.payload, other, random);
        }
        _ => {}
    }
    piece
}

/// Turns a bit of one frame in sixteen, which its checksum does not know of.
pub fn damage(frame: &mut [u8], random: &mut Random) {
    if random.once_in(16) {
        let bit = random.index(8 * frame.len());
        frame[bit / 8] ^= 1 << (bit % 8);
    }
}

/// Changes some bytes, or cuts, or joins with another payload.
fn mutate(payload: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    const ENDS: [u8; 7] = [0, 1, 0x7F, 0x80, 0xFE, 0xFF, 0x3F];
    for _ in 0..random.index(4) {
        let at = random.index(payload.len() + 1);
        match random.index(8) {
            0..3 => {
                if let Some(byte) = payload.get_mut(at) {
                    *byte ^= 1 << random.index(8);
                }
            }
            3 => {
                if let Some(byte) = payload.get_mut(at) {
                    *byte = random.pick(&ENDS);
                }
            }
            4 => payload.truncate(at),
            5 => payload.insert(at, random.bits() as u8),
            6 => {
                // A number of ten bytes in place of whatever was there.
                let far = [0xFF; 9].into_iter().chain([1]);
                payload.splice(at..payload.len().min(at + 2), far);
            }
            _ => {
                payload.truncate(at);
                payload.extend(&other[random.index(other.len() + 1)..]);
            }
        }
    }
    payload.truncate(PAYLOAD_MAX);
}
