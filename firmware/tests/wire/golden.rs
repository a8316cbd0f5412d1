//! The contract, frozen.
//!
//! If one of these fails, bytes on the wire have changed, and boxes and hosts in the
//! field would misunderstand each other. If that is what you want:
//!
//! 1. a message was *added*, or a variant *appended* to an enum: add or correct its row
//!    here, nothing else;
//! 2. anything else: raise `PROTOCOL_VERSION`, say so in the changelog, then take over
//!    the new bytes, which the failing test prints.

use crate::draw::Material;
use crate::round_trip::{Sent, all};
use massline_firmware::wire::*;

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

#[test]
fn frames_to_the_byte() {
    let line = [Line {
        drive: 2.0,
        responses: [[1.0, -1.0]; RESULTANTS],
    }];
    let flags = [0, Health::OVERLOAD.0];
    let readings = [1.0_f32, -0.5, f32::NAN];
    let counts = [Count24::MIN, Count24::MAX];
    let sensor = Sensor {
        sensor: 3,
        name: "a4",
        kind: SensorKind::Accelerometer(Mount::Structure),
        position: [0.25, 0.0, -1.0],
        direction: [0.0, 0.0, 1.0],
        scale: Scale::Given {
            per_unit: 1.0,
            offset: 0.0,
        },
    };
    let frames = [
        (Sent::Request(Request::Hello), HELLO),
        (Sent::Request(Request::Ping(Ping { stamp: 300 })), PING),
        (Sent::Request(Request::SetSensor(sensor)), SET_SENSOR),
        (
            Sent::Request(Request::Samples(Samples {
                first: 1024,
                channels: 3,
                values: Values::Readings(Packed::new(&readings)),
            })),
            READINGS,
        ),
        (
            Sent::Request(Request::Samples(Samples {
                first: 0,
                channels: 2,
                values: Values::Counts24(Packed::new(&counts)),
            })),
            COUNTS,
        ),
        (
            Sent::Reply(Reply::Error(Refused {
                request: 0x21,
                problem: Problem::Gap {
                    found: 1024,
                    expected: 1000,
                },
            })),
            GAP,
        ),
        (
            Sent::Reply(Reply::Lines(Lines {
                run: 1,
                first: 9,
                lines: Packed::new(&line),
            })),
            LINES,
        ),
        (
            Sent::Event(Event::Health(ChannelHealth {
                sample: 77,
                channels: Packed::new(&flags),
            })),
            HEALTH,
        ),
    ];
    let mut changed = String::new();
    for (message, expected) in frames {
        let now = hex(&message.frame().expect("it fits"));
        if now != expected {
            changed += &format!("{message:?}\n{now}\n");
        }
    }
    assert!(changed.is_empty(), "{changed}");
}

const HELLO: &str = "000402010101010101020705513aef7300";
const PING: &str = "000402020101010101020707ac027f202b5100";
const SET_SENSOR: &str = "\
    000402120101010101020705030261340201010101010103d03f0101010101010101010101010103\
    f0bf01010101010101010101010101010101010101010103f03f01010101010103f03f0101010101\
    0101058d2d788200";
const READINGS: &str = "000402210101010101020704800803020c0103803f010102bf0107c07f53cc1d8c00";
const COUNTS: &str = "00040221010101010102070104020206010980ffff7feb4deba000";
const GAP: &str = "00040281010101010102070b210c8008e8075c9d24e900";
const LINES: &str = "\
    000402890101010101020704010964010102400103803f010380bf0103803f010380bf0103803f01\
    0380bf0103803f010380bf0103803f010380bf0103803f010380bf0103803f010380bf0103803f01\
    0380bf0103803f010380bf0103803f010380bf0103803f010380bf0103803f010780bf113b5be700";
const HEALTH: &str = "000402c201010101010101034d0401020105243bb38500";

/// Every message many times, by the length of its largest frame and the checksum of all
/// bodies: any field or variant that changes its type or its place shows.
#[test]
fn every_message_keeps_its_layout() {
    let mut materials = vec![Material::largest()];
    for seed in 0..1000_u32 {
        let byte = |i: u32| ((i + 1).wrapping_mul(seed + 1).wrapping_mul(0x9E37_79B1) >> 24) as u8;
        materials.push(Material::new(
            (0..400).map(byte).collect(),
            "specimen".into(),
        ));
    }
    let mut table: Vec<_> = all(&materials[0])
        .map(|message| (message.name(), 0, Crc32::new()))
        .collect();
    for material in &materials {
        for (message, (name, longest, crc)) in all(material).zip(&mut table) {
            let frame = message.frame().expect("it fits");
            let body = crate::reference::unstuffed(&frame[1..frame.len() - 1]).expect("whole");
            assert_eq!(message.name(), *name);
            *longest = frame.len().max(*longest);
            // Without its own checksum: together with that, all bodies have the same one.
            crc.extend(&body[..body.len() - CHECKSUM]);
        }
    }
    let rows: String = table
        .into_iter()
        .map(|((number, name), longest, crc)| {
            format!("{number:02x} {name} {longest} {:08x}\n", crc.value())
        })
        .collect();
    assert!(
        rows == include_str!("layout.txt"),
        "layout.txt is now:\n{rows}"
    );
}
