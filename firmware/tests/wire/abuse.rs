//! A link that garbles, cuts, loses, repeats, delays and invents: 100,000 frames.
//!
//! The frames that arrived are decided without the code under test: the stream is cut at its zeros,
//! and a piece is a frame if it is, byte for byte, one that was sent. Everything that the
//! receiver says must follow from that list: messages, losses, repetitions, restarts, and
//! the number of broken pieces.
//!
//! The one thing that may differ is a garbled frame whose checksum happens to fit. About
//! 36,000 broken pieces come by here, 3,400 of which are whole enough for the checksum to
//! be the judge, so with another seed that has a chance of 3,400 / 2³² = 8e-7, and such a
//! piece would still have to be a well-formed message.

use massline_firmware::models::random::{Random, mix};
use massline_firmware::wire::*;
use std::collections::{HashMap, HashSet};

/// At most so many random bytes.
fn noise(random: &mut Random, most: usize) -> Vec<u8> {
    let count = random.index(most + 1);
    (0..count).map(|_| random.bits() as u8).collect()
}

/// A frame: the ordinal of its session, and its number in it.
type Id = (u32, u32);

/// Frames of the sender, and the stream that the link made of them.
#[derive(Default)]
struct Link {
    stream: Vec<u8>,
    /// Bytes between the delimiters of every frame that was sent.
    sent: HashMap<Vec<u8>, Id>,
    /// Copies that are late: after how many more frames they come, and their bytes.
    late: Vec<(usize, Vec<u8>)>,
    /// Frames that never reached the wire.
    removed: u32,
}

impl Link {
    /// Takes a frame from the sender and does something to it.
    fn carry(&mut self, id: Id, frame: &[u8], random: &mut Random) {
        let inner = &frame[1..frame.len() - 1];
        assert!(self.sent.insert(inner.to_vec(), id).is_none());
        let mut frame = frame.to_vec();
        let at = random.index(frame.len());
        match random.index(40) {
            0 => {
                // Never sent at all.
                self.removed += 1;
                frame.clear();
            }
            1 => frame.truncate(at),
            2 => drop(frame.drain(..at)),
            3 => {
                let end = at + random.index(frame.len() - at + 1);
                drop(frame.drain(at..end));
            }
            4 => {
                for _ in 0..=random.index(4) {
                    let bit = random.index(8 * frame.len());
                    frame[bit / 8] ^= 1 << (bit % 8);
                }
            }
            5 => {
                let burst = noise(random, 40);
                for (byte, noise) in frame[at..].iter_mut().zip(burst) {
                    *byte = noise;
                }
            }
            6 => drop(frame.splice(at..at, noise(random, 20))),
            7 => frame[at] = 0,
            8 => {
                // A repetition at once, up to three times.
                let once = frame.clone();
                for _ in 0..=random.index(3) {
                    frame.extend(&once);
                }
            }
            9 => self.late.push((1 + random.index(50), frame.clone())),
            10 => {
                // Overtaken: it comes later, and only then.
                self.late.push((1 + random.index(50), frame.clone()));
                frame.clear();
            }
            11 => self.stream.extend(noise(random, 3000)),
            12 => {
                frame.pop();
            }
            13 => {
                frame.remove(0);
            }
            _ => {}
        }
        self.stream.extend(frame);
        for (left, _) in &mut self.late {
            *left -= 1;
        }
        let due: Vec<_> = self.late.extract_if(.., |(left, _)| *left == 0).collect();
        self.stream
            .extend(due.into_iter().flat_map(|(_, copy)| copy));
    }
}

/// Messages and counters that a receiver must find in a stream.
#[derive(Default)]
struct Expected {
    taken: Vec<Id>,
    broken: u32,
    duplicates: u32,
    out_of_order: u32,
    restarts: u32,
}

impl Expected {
    fn new(link: &Link) -> Self {
        let mut expected = Self::default();
        let mut seen = HashSet::new();
        for piece in link.stream.split(|&b| b == 0).filter(|p| !p.is_empty()) {
            let Some(&id) = link.sent.get(piece) else {
                expected.broken += 1;
                continue;
            };
            let newest = expected.taken.last();
            if newest.is_none_or(|&newest| id > newest) {
                let restart = newest.is_some_and(|newest| newest.0 != id.0);
                expected.restarts += u32::from(restart);
                expected.taken.push(id);
                seen.insert(id);
            } else if newest.is_some_and(|n| n.0 == id.0) && seen.contains(&id) {
                expected.duplicates += 1;
            } else {
                expected.out_of_order += 1;
            }
        }
        expected
    }

    /// Frames before the last one taken of each session that were not taken. Of the
    /// first session only those behind the first one taken: nobody listened before.
    fn lost(&self) -> u64 {
        let taken: HashSet<Id> = self.taken.iter().copied().collect();
        let mut last: HashMap<u32, u32> = HashMap::new();
        for &(session, number) in &self.taken {
            last.insert(session, number);
        }
        let first = self.taken[0];
        let missing = |(&session, &last): (&u32, &u32)| {
            let from = if session == first.0 { first.1 } else { 0 };
            (from..=last)
                .filter(|&n| !taken.contains(&(session, n)))
                .count() as u64
        };
        last.iter().map(missing).sum()
    }
}

/// A message whose content is decided by who it is.
fn with_content<T>(id: Id, send: impl FnOnce(&Request<'_>) -> T) -> T {
    let stamp = mix(u64::from(id.0) << 32 | u64::from(id.1));
    let values: Vec<f32> = (0..stamp % 150)
        .map(|i| (stamp >> (i % 40)) as f32)
        .collect();
    let message = match stamp % 4 {
        0 => Request::Ping(Ping { stamp }),
        1 => Request::ReadLines(ReadLines {
            run: stamp as u8,
            first: id.1 as u16,
            count: (id.1 >> 16) as u16,
        }),
        _ => Request::Samples(Samples {
            first: stamp,
            channels: 1,
            values: Values::Readings(Packed::new(&values)),
        }),
    };
    send(&message)
}

fn abuse(seed: u64, frames: u32) {
    let mut random = Random::new(seed);
    let mut link = Link::default();
    let mut sender = Sender::new(0);
    let mut sent_in_session = 0;
    let mut session = 0;
    let mut out = [0; FRAME_MAX];
    for _ in 0..frames {
        // Sessions outlast the delays, so that only the last one's frames come late.
        if sent_in_session > 200 && random.index(2000) == 0 {
            session += 1;
            sender = Sender::new(session as u16);
            sent_in_session = 0;
        }
        let id = (session, sender.produced());
        sent_in_session += 1;
        if random.index(100) == 0 {
            // The queue was full.
            sender.skip();
            link.removed += 1;
            continue;
        }
        let frame = with_content(id, |m| {
            sender
                .request(1 + id.1 as u16 % 60_000, m, &mut out)
                .map(<[u8]>::to_vec)
        });
        link.carry(id, &frame.expect("it fits"), &mut random);
    }

    // A delimiter ends the last frame.
    link.stream.push(0);

    let expected = Expected::new(&link);
    let mut buffer = [0; BODY_MAX];
    let mut receiver = Receiver::<ToBox>::new(&mut buffer);
    let mut taken = expected.taken.iter();
    let mut bytes = &link.stream[..];
    while !bytes.is_empty() {
        let (mut chunk, rest) = bytes.split_at(1 + random.index(bytes.len().min(700)));
        bytes = rest;
        while let Some(received) = receiver.next(&mut chunk) {
            let Received::Message(header, message) = received else {
                panic!("{received:?} was never sent");
            };
            let id = *taken.next().expect("no more frames than arrived");
            assert_eq!((header.session, header.sequence), (id.0 as u16, id.1));
            assert_eq!(header.request, 1 + id.1 as u16 % 60_000);
            with_content(id, |m| assert_eq!(message, *m));
        }
    }
    assert_eq!(taken.next(), None, "a frame that arrived was not taken");

    let c = receiver.counters();
    assert_eq!(c.frames as usize, expected.taken.len());
    assert_eq!(c.lost, expected.lost());
    assert_eq!(c.duplicates, expected.duplicates);
    assert_eq!(c.out_of_order, expected.out_of_order);
    assert_eq!(c.restarts, expected.restarts);
    assert_eq!(
        c.bad_crc + c.bad_cobs + c.oversize + c.truncated,
        expected.broken
    );
    println!(
        "seed {seed}: {frames} frames, {} never sent: {c:?}",
        link.removed
    );
    // The abuse is what it claims to be.
    for count in [
        c.bad_crc,
        c.bad_cobs,
        c.oversize,
        c.truncated,
        c.duplicates,
        c.out_of_order,
    ] {
        assert!(count > frames / 4000, "{c:?}");
    }
    assert!(c.lost > u64::from(frames / 10) && c.restarts > 0);
}

#[test]
fn a_hundred_thousand_frames_under_abuse() {
    abuse(1, 100_000);
}

#[test]
fn other_abuse() {
    for seed in 2..12 {
        abuse(seed, 4000);
    }
}

#[test]
fn loss_is_what_was_removed_where_nothing_else_happens() {
    // Without damage the list of arrivals is not needed: what the test takes out is lost.
    let mut random = Random::new(77);
    let mut sender = Sender::new(3);
    let mut out = [0; FRAME_MAX];
    let mut buffer = [0; BODY_MAX];
    let mut receiver = Receiver::<ToBox>::new(&mut buffer);
    let mut removed = 0;
    for i in 0..50_000 {
        let frame = sender
            .request(1, &Request::Status, &mut out)
            .expect("it fits");
        // The ends stay, as loss shows only between frames that arrive.
        if i > 0 && i < 49_999 && random.index(3) == 0 {
            removed += 1;
            continue;
        }
        let mut rest = frame;
        assert!(receiver.next(&mut rest).is_some());
    }
    assert_eq!(receiver.counters().lost, removed);
    assert_eq!(u64::from(receiver.counters().frames) + removed, 50_000);
}
