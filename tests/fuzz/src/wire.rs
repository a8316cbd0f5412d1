//! Frames and noise on the link, read by both ends.
//!
//! A script's steps append to a stream: noise, frames with right checksums and any payload, and
//! damage to the bytes before.

use crate::link::{self, Piece};
use crate::script::{Bytes, steps};
use massline_firmware::wire::{
    BODY_MAX, Direction, FRAME_MAX, FromBox, HEADER, Header, LinkCounters, Received, Receiver,
    Refusal, Request, Sender, ToBox, ToHost,
};
use std::fmt::Debug;

/// Longest stream, bytes: more only takes longer.
const LONGEST: usize = 16 << 10;

/// Runs the target; see the module.
pub fn run(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    let chunks = bytes.array::<4>();
    let stream = stream(bytes.0);
    read::<ToBox>(&stream, &chunks, &|header, request| {
        again(header, request);
    });
    read::<ToHost>(&stream, &chunks, &|header, message| {
        back(header, message);
    });
}

/// The stream of a script.
fn stream(script: &[u8]) -> Vec<u8> {
    let mut stream = Vec::new();
    let mut sequence = 0_u32;
    let mut last = Vec::new();
    for (step, mut bytes) in steps(script) {
        if stream.len() > LONGEST {
            break;
        }
        match step % 8 {
            // Noise.
            0 => stream.extend(bytes.0),
            // A frame, the next in order.
            1..=3 => {
                let header = link::header(bytes.u8(), 1, sequence, bytes.u16());
                sequence = sequence.wrapping_add(1);
                last = link::frame(&header, bytes.0);
                stream.extend(&last);
            }
            // A frame with any header.
            4 => {
                let header = bytes.array::<HEADER>();
                last = link::frame(&header, bytes.0);
                stream.extend(&last);
            }
            // The last frame again.
            5 => stream.extend(&last),
            // Numbers are skipped, or a new session begins.
            6 => sequence = sequence.wrapping_add(bytes.u32()),
            // Damage.
            _ => {
                let at = usize::from(bytes.u16());
                let at = stream.len().saturating_sub(at + 1);
                match bytes.u8() {
                    0 => stream.truncate(at),
                    flip => stream.iter_mut().skip(at).take(1).for_each(|b| *b ^= flip),
                }
            }
        }
    }
    stream
}

/// Reads a stream as one side does, in chunks and as a whole, and compares the result with the
/// pieces between zeros.
fn read<D>(stream: &[u8], chunks: &[u8], see: &dyn Fn(&Header, &D::Message<'_>))
where
    D: Direction + 'static,
    for<'m> D::Message<'m>: Debug,
{
    let mut heard = Vec::new();
    let counters = listen::<D>([stream].into_iter(), &mut |received| {
        if let Received::Message(header, message) = received {
            see(header, message);
        }
        heard.push(format!("{received:?}"));
    });

    // The result does not depend on the chunks.
    let mut lengths = chunks.iter().cycle().map(|&n| usize::from(n) + 1);
    let mut rest = stream;
    let cut = std::iter::from_fn(|| {
        let at = lengths.next()?.min(rest.len());
        let (chunk, behind) = rest.split_at(at);
        rest = behind;
        (at > 0).then_some(chunk)
    });
    let mut number = 0;
    let in_chunks = listen::<D>(cut, &mut |received| {
        assert_eq!(heard.get(number), Some(&format!("{received:?}")));
        number += 1;
    });
    assert_eq!((number, in_chunks), (heard.len(), counters));

    // The last piece has no end yet.
    let mut pieces: Vec<_> = stream.split(|&b| b == 0).collect();
    pieces.pop();
    let pieces = pieces.into_iter().filter(|piece| !piece.is_empty());
    let (mut sound, mut broken) = (0, 0);
    for piece in pieces.map(link::classify) {
        match piece {
            Piece::Sound(..) => sound += 1,
            _ => broken += 1,
        }
    }
    let c = counters;
    let damaged = c.bad_cobs + c.bad_crc + c.truncated + c.oversize;
    assert_eq!(
        (c.frames + c.duplicates + c.out_of_order, damaged),
        (sound, broken),
        "{c:?}"
    );
    assert_eq!(c.frames as usize, heard.len());
}

/// Decodes chunks with a receiver, and passes its results on.
fn listen<'s, D: Direction + 'static>(
    chunks: impl Iterator<Item = &'s [u8]>,
    receive: &mut dyn FnMut(&Received<D::Message<'_>>),
) -> LinkCounters {
    let mut buffer = [0; BODY_MAX];
    let mut receiver = Receiver::<D>::new(&mut buffer);
    for mut chunk in chunks {
        while let Some(received) = receiver.next(&mut chunk) {
            if let Received::Refused(header, refusal) = &received {
                // The refusal is sent to the host with its message.
                assert!(!refusal.to_string().is_empty());
                if let Refusal::UnknownNumber { found } = refusal {
                    assert_eq!(*found, header.number);
                }
            }
            receive(&received);
        }
    }
    *receiver.counters()
}

/// Writes a request again, and reads it.
fn again(header: &Header, request: &Request<'_>) {
    let mut out = [0; FRAME_MAX];
    let mut sender = Sender::new(header.session);
    let frame = sender.request(header.request, request, &mut out);
    let frame = frame.expect("what came in a frame goes into one");
    let mut buffer = [0; BODY_MAX];
    let mut receiver = Receiver::<ToBox>::new(&mut buffer);
    let mut rest = frame;
    let Some(Received::Message(_, found)) = receiver.next(&mut rest) else {
        panic!("{request:?} cannot be read again");
    };
    assert_eq!(format!("{found:?}"), format!("{request:?}"));
}

/// Writes a message of a box again, and reads it.
fn back(header: &Header, message: &FromBox<'_>) {
    let mut out = [0; FRAME_MAX];
    let mut sender = Sender::new(header.session);
    let frame = match message {
        FromBox::Reply(reply) => sender.reply(header.request, reply, &mut out),
        FromBox::Event(event) => sender.event(event, &mut out),
    };
    let frame = frame.expect("what came in a frame goes into one");
    let mut buffer = [0; BODY_MAX];
    let mut receiver = Receiver::<ToHost>::new(&mut buffer);
    let mut rest = frame;
    let Some(Received::Message(_, found)) = receiver.next(&mut rest) else {
        panic!("{message:?} cannot be read again");
    };
    assert_eq!(format!("{found:?}"), format!("{message:?}"));
}
