//! A link that garbles, cuts, loses and repeats: 10,000 frames into the box.
//!
//! The arriving frames are known without the code under test: the stream is cut at its zeros, and a
//! piece is a frame if it equals, byte for byte, a sent one. Each of these must be answered once,
//! and no others; the box's counters must agree.

use std::collections::{HashMap, HashSet};

use massline_firmware::models::random::Random;
use massline_firmware::wire::{
    Event, FromBox, LinkCounters, Ping, Reply, Request, ResetReason, Subscription, Telemetry,
};

use crate::talk::Talk;

const FRAMES: usize = 10_000;

/// Damages a frame in one of three cases.
fn damage(mut frame: Vec<u8>, random: &mut Random) -> Vec<u8> {
    let at = random.index(frame.len());
    match random.index(24) {
        0 => frame.clear(),
        1 => frame.truncate(at),
        2 => drop(frame.drain(..at)),
        3 => drop(frame.drain(at..at + random.index(frame.len() - at + 1))),
        4 => {
            for _ in 0..=random.index(4) {
                let bit = random.index(8 * frame.len());
                frame[bit / 8] ^= 1 << (bit % 8);
            }
        }
        5 => frame[at] = 0,
        6 => {
            let once = frame.clone();
            for _ in 0..=random.index(3) {
                frame.extend(&once);
            }
        }
        7 => {
            let noise: Vec<u8> = (0..random.index(40)).map(|_| random.bits() as u8).collect();
            drop(frame.splice(at..at, noise));
        }
        // Longer than the longest frame, in one of a hundred.
        8 if random.index(4) == 0 => frame.extend((0..1500).map(|n| (n % 255) as u8 + 1)),
        _ => {}
    }
    frame
}

/// The box's link counters.
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
    let mut random = Random::new(4);

    let mut stream = Vec::new();
    // The bytes between the delimiters of every frame, with its place and its id.
    let mut sent: HashMap<Vec<u8>, (usize, u16)> = HashMap::new();
    for place in 0..FRAMES {
        let stamp = random.bits();
        let (id, frame) = talk.frame(&Request::Ping(Ping { stamp }));
        sent.insert(frame[1..frame.len() - 1].to_vec(), (place, id));
        stream.extend(damage(frame, &mut random));
    }

    let mut received = Vec::new();
    let mut answered = HashSet::new();
    let (mut duplicates, mut broken) = (0, 0);
    for piece in stream.split(|&byte| byte == 0).filter(|p| !p.is_empty()) {
        match sent.get(piece) {
            None => broken += 1,
            Some(&(_, id)) if !answered.insert(id) => duplicates += 1,
            Some(&frame) => received.push(frame),
        }
    }
    // A garbled piece with a right checksum by chance would give a reply too many; about 1500
    // pieces reach the checksum, so with another seed that has a chance of 1500 / 2^32 = 4e-7.
    talk.send(&stream);
    // A delimiter ends the last frame.
    talk.send(&[0]);
    let (last, frame) = talk.frame(&Request::Ping(Ping { stamp: 0 }));
    talk.send(&frame);
    let mut expected = received.iter().map(|&(_, id)| id).chain([last]);
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
    // The frame that ended the test and the two of each read of the counters; the second read is
    // answered before it is counted as a frame, the first one after.
    let others = 3;
    assert_eq!(
        after.frames - before.frames,
        received.len() as u32 + others,
        "{after:?}"
    );
    assert_eq!(after.lost - before.lost, (FRAMES - received.len()) as u64);
    assert_eq!(after.duplicates, duplicates);
    assert_eq!(
        after.bad_crc + after.bad_cobs + after.oversize + after.truncated,
        broken
    );
    let nothing = [after.out_of_order, after.unknown_version, after.restarts];
    assert_eq!(nothing, [0; 3]);
    assert_eq!([after.unknown_number, after.malformed], [0; 2]);
    // The abuse contains all kinds of damage.
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
