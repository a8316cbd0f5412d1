//! The bytes of every message of this version of the protocol, those of the core's types included.
//!
//! If one of these tests fails, bytes on the wire have changed, and boxes and hosts of the two
//! builds would misunderstand each other. If the change is intended:
//!
//! 1. a message was *added*, or a variant *appended* to an enum: add or correct its row here,
//!    nothing else;
//! 2. anything else: raise `PROTOCOL_VERSION`, say so in the changelog, then take over the new
//!    bytes, which the failing test prints.

use crate::draw::Material;
use crate::round_trip::{Sent, all};
use massline_core::identify::{self, Estimate, Identification, IdentifyError};
use massline_core::masslines::MasslineError;
use massline_core::modes::Pole;
use massline_core::rigid_body::{Margin, Plausibility, PrincipalInertia};
use massline_firmware::wire::*;
use nalgebra::{Matrix3, Vector3};

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// An answer with a different number in each field.
fn answer(question: Question) -> Answer {
    let estimate = |value: f64| {
        Some(Estimate {
            value,
            std: value / 64.0,
        })
    };
    let margin = |relative: f64| {
        Some(Margin {
            relative,
            uncertainty: -relative,
        })
    };
    let inertia = |first: f64| [0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|k| estimate(first + k));
    let axes = Matrix3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0);
    Answer {
        question,
        accelerations: Accelerations::All,
        quality: Quality {
            blocks: 7,
            rejected: 6,
            rejected_by: [0, 1, 2, 3, 4, 5, 6, 7],
            missing: 5,
            health: Health::STUCK,
        },
        identification: Identification {
            reference: Vector3::new(11.0, 12.0, 13.0),
            mass: estimate(14.0),
            indicator: estimate(15.0),
            centre_of_gravity: [estimate(16.0), None, estimate(18.0)],
            inertia_reference: inertia(20.0),
            inertia_cg: inertia(30.0),
            principal: Some(PrincipalInertia {
                moments: Vector3::new(41.0, 42.0, 43.0),
                axes,
            }),
            observable: core::array::from_fn(|k| k % 3 == 0),
            condition_number: 44.0,
            iterations: 45,
            consistency: Some(46.0),
            misfit: 47.0,
            attenuation: 48.0,
            freedom: f64::INFINITY,
            plausibility: Plausibility {
                mass: margin(49.0),
                positive_definite: margin(50.0),
                triangle: margin(51.0),
            },
        },
        findings: Findings {
            excited: Some(6),
            weakest_excitation: Some(52.0),
            poles: [53.0, 54.0, 55.0, 56.0].map(|frequency| {
                Some(Pole {
                    frequency,
                    damping: frequency / 1024.0,
                })
            }),
        },
    }
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
        scale: ScaleSource::Given {
            per_unit: 1.0,
            offset: 0.0,
        },
    };
    let processing = Processing {
        sample_rate: 512.0,
        block_length: 1024,
        overlap: 0.5,
        window: Window::BlackmanHarris,
        kept_band: [2.0, 50.0],
        averaging_band: [2.0, 20.0],
        mode_band: Some([30.0, 40.0]),
        accelerations: Accelerations::Weighted,
        weighting: Weighting::Joined,
        minimum_weight: 0.25,
    };
    let question = Question {
        method: Method::CurveFit,
        identify: identify::Question::new(
            Some(2.0),
            Procedure::Iterative {
                tolerance: 0.5,
                limit: 300,
            },
        ),
        modes: 3,
        fit_band: Some([4.0, 8.0]),
        runs: 0b101,
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
            Sent::Request(Request::SetProcessing(processing)),
            PROCESSING,
        ),
        (Sent::Request(Request::Identify(question)), QUESTION),
        (
            Sent::Reply(Reply::Grid(Grid {
                lines: LineGrid {
                    first: 4,
                    count: 96,
                    spacing: 0.5,
                },
                hop: 512,
                band: [0, 37],
            })),
            GRID,
        ),
        (
            Sent::Reply(Reply::Error(Refused {
                request: 0x40,
                problem: Problem::NoAnswer(MasslineError::NoMode.into()),
            })),
            NO_MODE,
        ),
        (
            Sent::Reply(Reply::Error(Refused {
                request: 0x40,
                problem: Problem::NoAnswer(IdentifyError::Diverged(-1.0).into()),
            })),
            DIVERGED,
        ),
        (
            Sent::Reply(Reply::Identified(Identified {
                ticks: 1000,
                answer: answer(question),
            })),
            IDENTIFIED,
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

const HELLO: &str = "0004030101010101010207056f512d9c00";
const PING: &str = "000403020101010101020707ac02106c8eca00";
const SET_SENSOR: &str = "\
    000403120101010101020705030261340201010101010103d03f0101010101010101010101010103\
    f0bf01010101010101010101010101010101010101010103f03f01010101010103f03f0101010101\
    010105feeeb9ef00";
const READINGS: &str = "000403210101010101020704800803020c0103803f010102bf0107c07f12d791e200";
const COUNTS: &str = "00040321010101010102070104020206010980ffff7fad768cc500";
const GAP: &str = "00040381010101010102070b210c8008e807cd0c4c4700";
const LINES: &str = "\
    000403890101010101020704010964010102400103803f010380bf0103803f010380bf0103803f01\
    0380bf0103803f010380bf0103803f010380bf0103803f010380bf0103803f010380bf0103803f01\
    0380bf0103803f010380bf0103803f010380bf0103803f010380bf0103803f010780bf1cee0c5100";
const PROCESSING: &str = "\
    00040311010101010102070101010101010580408008010101010104e03f04010101010101024001\
    0101010103494001010101010102400101010101043440010101010101033e400101010101054440\
    0202010101010107d03f1f119eae00";
const QUESTION: &str = "\
    0004034001010101010207030601010101010101034001010101010107e03fac0203010101010101\
    031040010101010108204005a5ce5fee00";
const GRID: &str = "0004038601010101010207030460010101010105e03f8004062597146e7400";
const NO_MODE: &str = "000403810101010101020703400e0607cd3c685900";
const DIVERGED: &str = "000403810101010101020705400e0103010101010107f0bfb617aac700";
const IDENTIFIED: &str = "\
    0004038c0101010101020705e8070601010101010101034001010101010107e03fac020301010101\
    01010310400101010101072040050107060a01020304050607051001010101010326400101010101\
    0328400101010101042a40010101010101032c40010101010104cc3f010101010101032e40010101\
    010104ce3f010101010101033040010101010103d03f02010101010101033240010101010104d23f\
    010101010101033440010101010104d43f010101010101033540010101010104d53f010101010101\
    033640010101010104d63f010101010101033740010101010104d73f010101010101033840010101\
    010104d83f010101010101033940010101010104d93f010101010101033e40010101010104de3f01\
    0101010101033f40010101010104df3f010101010101034040010101010104e03f01010101010480\
    4040010101010580e03f010101010101034140010101010104e13f01010101010480414001010101\
    0580e13f01010101010480444001010101010345400101010104804540010101010103f03f010101\
    01010310400101010101031c40010101010101024001010101010314400101010101032040010101\
    0101030840010101010103184001010101010422400101020101020101020101010101010546402d\
    01010101010103474001010101048047400101010101034840010101010104f07f01010101010480\
    484001010101058048c001010101010103494001010101010449c001010101010480494001010101\
    078049c00106010101010101044a40010101010104804a40010101010580aa3f010101010101034b\
    40010101010104ab3f010101010104804b40010101010580ab3f010101010101034c400101010101\
    07ac3f24629e8800";
const HEALTH: &str = "000403c201010101010101034d0401020105b5aadb2b00";

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
        .map(|message| (message.name(), 0, CRC32.digest()))
        .collect();
    for material in &materials {
        for (message, (name, longest, crc)) in all(material).zip(&mut table) {
            let frame = message.frame().expect("it fits");
            let body = crate::reference::unstuffed(&frame[1..frame.len() - 1]).expect("whole");
            assert_eq!(message.name(), *name);
            *longest = frame.len().max(*longest);
            // Without its own checksum: together with that, all bodies have the same one.
            crc.update(&body[..body.len() - CHECKSUM]);
        }
    }
    let rows: String = table
        .into_iter()
        .map(|((number, name), longest, crc)| {
            format!("{number:02x} {name} {longest} {:08x}\n", crc.finalize())
        })
        .collect();
    assert!(
        rows == include_str!("layout.txt"),
        "layout.txt is now:\n{rows}"
    );
}

#[test]
fn a_set_of_methods_has_a_bit_for_each_by_its_number_on_the_wire() {
    for (k, method) in Method::ALL.into_iter().enumerate() {
        let mut number = [0; 1];
        postcard::to_slice(&method, &mut number).unwrap();
        assert_eq!(usize::from(number[0]), k);
        let one = MethodSet::of(&[method]);
        assert_eq!(one, MethodSet(1 << k));
        assert!(
            Method::ALL
                .iter()
                .all(|m| one.contains(*m) == (*m == method))
        );
    }
    assert_eq!(MethodSet::of(&Method::ALL), MethodSet(0xff));
}
