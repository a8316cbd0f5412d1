//! Whatever comes over the link: no panic, no desync, and an answer where one is due.

use crate::reference::{frame, header, stuffed};
use massline_firmware::wire::*;
use proptest::prelude::*;

/// A frame that has nothing to do with what came before it: another session, so that it
/// is new whatever was understood until then.
fn sound() -> Vec<u8> {
    let mut out = [0; FRAME_MAX];
    let ping = Request::Ping(Ping { stamp: 42 });
    Sender::new(999)
        .request(3, &ping, &mut out)
        .expect("it fits")
        .to_vec()
}

/// Feeds `noise` to both kinds of receivers and asks whether a sound frame that follows
/// is understood.
fn survives(noise: &[u8]) -> bool {
    let mut buffer = [0; BODY_MAX];
    let mut host = Receiver::<ToHost>::new(&mut buffer);
    let mut rest = noise;
    while host.next(&mut rest).is_some() {}

    let mut buffer = [0; BODY_MAX];
    let mut on_box = Receiver::<ToBox>::new(&mut buffer);
    let mut rest = noise;
    while on_box.next(&mut rest).is_some() {}
    let sound = sound();
    let mut rest = &sound[..];
    matches!(
        on_box.next(&mut rest),
        Some(Received::Message(_, Request::Ping(Ping { stamp: 42 })))
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn any_bytes(noise in proptest::collection::vec(any::<u8>(), 0..3000)) {
        prop_assert!(survives(&noise));
    }

    #[test]
    fn any_bytes_that_are_mostly_codes(
        noise in proptest::collection::vec(prop_oneof![Just(0_u8), Just(1), Just(2), Just(255), any::<u8>()], 0..3000)
    ) {
        prop_assert!(survives(&noise));
    }

    /// Sound frames of any number and any content: a message, or a refusal that names
    /// what is wrong with it. What was understood is written as it was read.
    #[test]
    fn any_payload(
        number: u8,
        id: u16,
        payload in proptest::collection::vec(prop_oneof![0_u8..4, any::<u8>()], 0..PAYLOAD_MAX)
    ) {
        let wire = frame(&header(number, 0, id), &payload);
        let mut buffer = [0; BODY_MAX];
        let mut on_box = Receiver::<ToBox>::new(&mut buffer);
        let mut rest = &wire[..];
        let message = match on_box.next(&mut rest) {
            Some(Received::Message(_, message)) => Some(format!("{message:?}")),
            Some(Received::Refused(_, refusal)) => {
                let known = Request::name(number).is_some();
                prop_assert_eq!(known, refusal != Refusal::UnknownNumber { found: number });
                None
            }
            None => return Err(TestCaseError::fail("the frame was not taken")),
        };
        let counters = *on_box.counters();
        prop_assert_eq!(counters.frames, 1);
        prop_assert_eq!(counters.unknown_number + counters.malformed, u32::from(message.is_none()));

        let mut buffer = [0; BODY_MAX];
        let mut host = Receiver::<ToHost>::new(&mut buffer);
        let mut rest = &wire[..];
        let known = Reply::name(number).or(Event::name(number)).is_some();
        if let Some(Received::Refused(_, refusal)) = host.next(&mut rest) {
            prop_assert_eq!(known, refusal != Refusal::UnknownNumber { found: number });
        }
    }
}

#[test]
fn all_short_streams() {
    let mut streams = 1_u32;
    assert!(survives(&[]));
    for a in 0..=255 {
        assert!(survives(&[a]));
        streams += 1;
        for b in 0..=255 {
            assert!(survives(&[a, b]));
            streams += 1;
        }
    }
    // Longer ones of the bytes that steer the decoder.
    let alphabet = [0, 1, 2, 3, 15, 0xFF];
    for mut n in 0..6_usize.pow(6) {
        let noise = [(); 6].map(|()| {
            let byte = alphabet[n % 6];
            n /= 6;
            byte
        });
        assert!(survives(&noise));
        streams += 1;
    }
    println!("{streams} streams");
}

/// Feeds two frames, of which the first was tampered with, and returns what came.
fn after(tampered: &[u8], intact: &[u8]) -> Vec<(u32, u64)> {
    let mut buffer = [0; BODY_MAX];
    let mut receiver = Receiver::<ToBox>::new(&mut buffer);
    let mut seen = Vec::new();
    for wire in [tampered, intact] {
        let mut rest = wire;
        while let Some(received) = receiver.next(&mut rest) {
            match received {
                Received::Message(header, Request::Ping(Ping { stamp })) => {
                    seen.push((header.sequence, stamp));
                }
                other => panic!("{other:?} was never sent"),
            }
        }
    }
    seen
}

/// All damage that one byte can take, anywhere in a frame: it costs that frame and never
/// the next one, and no frame is ever taken for another.
#[test]
fn one_damaged_byte_costs_one_frame() {
    let mut sender = Sender::new(5);
    let mut out = [0; FRAME_MAX];
    // Zeros, and bytes that are large codes, so that damage has something to hit.
    let (first, second) = (0x00FF_0100_0002_FE00, 0x1122_3344_5566_7788);
    let ping = |stamp| Request::Ping(Ping { stamp });
    let a = sender
        .request(0x0100, &ping(first), &mut out)
        .expect("fits")
        .to_vec();
    let b = sender
        .request(0x0101, &ping(second), &mut out)
        .expect("fits")
        .to_vec();
    let both = [(0, first), (1, second)];
    let mut cases = 0;
    let mut check = |damaged: &[u8]| {
        let seen = after(damaged, &b);
        // A delimiter may go without harm, as there are two.
        assert!(
            seen == both || seen == both[1..],
            "{damaged:02x?}: {seen:?}"
        );
        cases += 1;
    };
    for i in 0..a.len() {
        for value in 0..=255 {
            let mut damaged = a.clone();
            damaged[i] = value;
            check(&damaged);
            damaged.insert(i, a[i]);
            check(&damaged);
        }
        let mut damaged = a.clone();
        damaged.remove(i);
        check(&damaged);
        check(&a[..i]);
        check(&a[i..]);
        for j in i..a.len() {
            let mut damaged = a.clone();
            damaged.drain(i..j);
            check(&damaged);
        }
    }
    println!("{cases} kinds of damage");
}

#[test]
fn the_box_can_say_what_is_wrong_with_a_sound_frame() {
    let refusal = |wire: &[u8]| {
        let mut buffer = [0; BODY_MAX];
        let mut receiver = Receiver::<ToBox>::new(&mut buffer);
        let mut rest = wire;
        match receiver.next(&mut rest) {
            Some(Received::Refused(header, refusal)) => (
                header.request,
                Refused::because(&header, refusal),
                *receiver.counters(),
            ),
            other => panic!("{other:?}"),
        }
    };
    // Another version, even with a payload nobody can read, is told apart first.
    let mut future = header(0x7F, 0, 9);
    future[0] = PROTOCOL_VERSION + 1;
    let (id, refused, counters) = refusal(&frame(&future, &[1, 2, 3]));
    let expected = Problem::Version {
        found: PROTOCOL_VERSION + 1,
        expected: PROTOCOL_VERSION,
    };
    assert_eq!((id, refused.request, refused.problem), (9, 0x7F, expected));
    assert_eq!((counters.unknown_version, counters.frames), (1, 1));
    let (newer, ours) = (PROTOCOL_VERSION + 1, PROTOCOL_VERSION);
    assert_eq!(
        refused.to_string(),
        format!(
            "request 0x7f was refused: it is of version {newer} of the link, the box speaks version {ours}"
        )
    );

    let (_, refused, counters) = refusal(&frame(&header(0x7F, 0, 9), &[]));
    assert_eq!(refused.problem, Problem::UnknownNumber);
    assert_eq!(counters.unknown_number, 1);

    // A reply is none of the box's business.
    let (_, refused, _) = refusal(&frame(&header(0x80, 0, 9), &[]));
    assert_eq!(refused.problem, Problem::UnknownNumber);

    // A variant that a later firmware may know; a byte too few; one too many.
    for (number, payload) in [(0x07, &[99][..]), (0x30, &[]), (0x22, &[0])] {
        let (_, refused, counters) = refusal(&frame(&header(number, 0, 9), payload));
        assert_eq!(refused.problem, Problem::Malformed, "{number:#04x}");
        assert_eq!(counters.malformed, 1);
    }

    let (id, refused, _) = refusal(&frame(&header(0x22, 0, 0), &[]));
    assert_eq!((id, refused.problem), (0, Problem::NoRequestId));
    assert_eq!(refused.to_string(), "Stop was refused: it has no id");
}

#[test]
fn the_host_refuses_what_is_no_answer_and_no_event() {
    let refusal = |number, id, payload: &[u8]| {
        let wire = frame(&header(number, 0, id), payload);
        let mut buffer = [0; BODY_MAX];
        let mut receiver = Receiver::<ToHost>::new(&mut buffer);
        let mut rest = &wire[..];
        match receiver.next(&mut rest) {
            Some(Received::Refused(_, refusal)) => Some(refusal),
            Some(Received::Message(..)) => None,
            None => panic!("{number:#04x} was not taken"),
        }
    };
    // An event answers nothing, and an error may answer a request that had no id.
    let started = [0, 0];
    assert_eq!(refusal(0xC0, 0, &started), None);
    let with_id = Refusal::RequestId { number: 0xC0 };
    assert_eq!(refusal(0xC0, 5, &started), Some(with_id));
    assert_eq!(refusal(0x81, 0, &[0x22, 3]), None);
    assert_eq!(refusal(0x80, 5, &[]), None);
    let unknown = |found| Some(Refusal::UnknownNumber { found });
    for number in [0x00, 0x01, 0x7F, 0xBF, 0xFF] {
        assert_eq!(refusal(number, 5, &[]), unknown(number));
    }
}

#[test]
fn frames_that_are_too_long_or_too_short_are_counted_as_such() {
    let mut buffer = [0; BODY_MAX];
    let mut receiver = Receiver::<ToBox>::new(&mut buffer);
    let mut feed = |wire: &[u8]| {
        let mut rest = wire;
        assert_eq!(receiver.next(&mut rest), None);
        *receiver.counters()
    };
    let long = frame(&header(1, 0, 1), &[7; PAYLOAD_MAX + 1]);
    assert_eq!(feed(&long).oversize, 1);
    let mut short = vec![0];
    short.extend(stuffed(&[1; 13]));
    short.push(0);
    assert_eq!(feed(&short).truncated, 1);
    let mut whole = frame(&header(1, 0, 1), &[]);
    let last = whole.len() - 2;
    whole[last] ^= 0x10;
    assert_eq!(feed(&whole).bad_crc, 1);
    whole.remove(last);
    let counters = feed(&whole);
    assert_eq!(counters.bad_cobs, 1);
    // Nobody sent a frame that could have been lost.
    assert_eq!((counters.frames, counters.lost), (0, 0));
    // The longest frame there is.
    let longest = frame(&header(0x7F, 0, 1), &[0; PAYLOAD_MAX]);
    assert!(longest.len() <= FRAME_MAX);
    let mut rest = &longest[..];
    assert!(matches!(
        receiver.next(&mut rest),
        Some(Received::Refused(_, Refusal::UnknownNumber { found: 0x7F }))
    ));
}
