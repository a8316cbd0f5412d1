//! A link that garbles, cuts, loses and repeats: 10,000 frames into the box.
//!
//! What arrives is known without the code under test: the stream is cut at its zeros, and a
//! piece is a frame if it is, byte for byte, one that was sent. Every one of these must be
//! answered once, nothing else may be, and the box's counters must be what follows.

use std::collections::{HashMap, HashSet};

use massline_firmware::wire::{
    Event, FromBox, LinkCounters, Ping, Reply, Request, ResetReason, Subscription, Telemetry,
};

use crate::talk::Talk;

const FRAMES: usize = 10_000;

/// Sebastiano Vigna's SplitMix64: short, and the same everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// Does something to a frame, or nothing in two of three cases.
fn damage(mut frame: Vec<u8>, random: &mut Random) -> Vec<u8> {
    let at = random.below(frame.len());
    match random.below(24) {
        0 => frame.clear(),
        1 => frame.truncate(at),
        2 => drop(frame.drain(..at)),
        3 => drop(frame.drain(at..at + random.below(frame.len() - at + 1))),
        4 => {
            for _ in 0..=random.below(4) {
                let bit = random.below(8 * frame.len());
                frame[bit / 8] ^= 1 << (bit % 8);
            }
        }
        5 => frame[at] = 0,
        6 => {
            let once = frame.clone();
            for _ in 0..=random.below(3) {
                frame.extend(&once);
            }
        }
        7 => {
            let noise: Vec<u8> = (0..random.below(40)).map(|_| random.next() as u8).collect();
            drop(frame.splice(at..at, noise));
        }
        // Longer than any frame may be, in one in a hundred.
        8 if random.below(4) == 0 => frame.extend((0..1500).map(|n| (n % 255) as u8 + 1)),
        _ => {}
    }
    frame
}

/// What the box has counted up to now.
fn counters(talk: &mut Talk) -> LinkCounters {
    talk.done(&Request::Subscribe(Subscription {
        telemetry: 10,
        ..Subscription::default()
    }));
    let Telemetry { overrun, link, .. } = talk.event(|event| match event {
        Event::Telemetry(telemetry) => Some(*telemetry),
        _ => None,
    });
    talk.done(&Request::Subscribe(Subscription::default()));
    assert_eq!(overrun, 0, "the emulated port loses no byte");
    link
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn ten_thousand_frames_under_abuse() {
    let mut talk = Talk::boot();
    let before = counters(&mut talk);
    let mut random = Random(4);

    let mut stream = Vec::new();
    // What lies between the delimiters of every frame, its place and its id.
    let mut sent: HashMap<Vec<u8>, (usize, u16)> = HashMap::new();
    for place in 0..FRAMES {
        let stamp = random.next();
        let (id, frame) = talk.frame(&Request::Ping(Ping { stamp }));
        sent.insert(frame[1..frame.len() - 1].to_vec(), (place, id));
        stream.extend(damage(frame, &mut random));
    }

    let mut taken = Vec::new();
    let mut answered = HashSet::new();
    let (mut duplicates, mut broken) = (0, 0);
    for piece in stream.split(|&byte| byte == 0).filter(|p| !p.is_empty()) {
        match sent.get(piece) {
            None => broken += 1,
            Some(&(_, id)) if !answered.insert(id) => duplicates += 1,
            Some(&frame) => taken.push(frame),
        }
    }
    // A garbled piece that happens to pass its checksum would be seen here as a reply too many;
    // some 1500 pieces reach it, so with another seed that has a chance of 1500 / 2^32 = 4e-7.
    talk.send(&stream);
    // A delimiter ends whatever the last frame was made of.
    talk.send(&[0]);
    let (last, frame) = talk.frame(&Request::Ping(Ping { stamp: 0 }));
    talk.send(&frame);
    let mut expected = taken.iter().map(|&(_, id)| id).chain([last]);
    talk.wait(|id, message| {
        let FromBox::Reply(Reply::Pong(_)) = message else {
            panic!("{message:?}");
        };
        assert_eq!(expected.next(), Some(id));
        (id == last).then_some(())
    });
    assert_eq!(
        expected.next(),
        None,
        "every frame that arrived was answered"
    );

    let after = counters(&mut talk);
    // The frame that ended the test and the two of each look at the counters; the second look
    // is answered before it is counted as frame, the first one after.
    let others = 3;
    assert_eq!(
        after.frames - before.frames,
        taken.len() as u32 + others,
        "{after:?}"
    );
    assert_eq!(after.lost - before.lost, (FRAMES - taken.len()) as u64);
    assert_eq!(after.duplicates, duplicates);
    assert_eq!(
        after.bad_crc + after.bad_cobs + after.oversize + after.truncated,
        broken
    );
    let nothing = [after.out_of_order, after.unknown_version, after.restarts];
    assert_eq!(nothing, [0; 3]);
    assert_eq!([after.unknown_number, after.malformed], [0; 2]);
    // The abuse is what it claims to be.
    for count in [
        after.bad_crc,
        after.bad_cobs,
        after.oversize,
        after.duplicates,
    ] {
        assert!(count > 50, "{after:?}");
    }
    talk.hello(|info| {
        assert_eq!((info.reset, info.resets), (ResetReason::PowerOn, 0));
        assert_eq!(info.panic, None);
    });
}
