//! The numbers of one noisy test, to the last bit: answers of every method, and the results of
//! runs and surveys on the way there.
//!
//! The box, the emulator and a workstation find the same bits, so that they can be written down.
//! Other tests hold them against the truth; this one notices that they change.
//! To accept a change, `MASSLINE_ACCEPT=1 cargo test -p massline-firmware --test instrument answers`
//! writes the new ones, and the commit says why.

use crate::bench::{Bench, Heard, Said};
use crate::plan::Pieces;
use crate::shaken::{CHANNELS, samples};
use massline_core::identify;
use massline_firmware::models::setup;
use massline_firmware::wire::*;
use std::fmt::Write as _;

/// Samples of a run: 15 blocks of 256 that overlap by half.
const SAMPLES: usize = 2048;

/// The set-up, with accelerometers on the structure.
fn set_up(bench: &mut Bench, accelerations: Accelerations, weighting: Weighting) -> Said {
    let mut pieces = Pieces::new();
    let unit = ScaleSource::Given {
        per_unit: 1.0,
        offset: 0.0,
    };
    for sensor in &mut pieces.sensors {
        sensor.scale = unit;
    }
    for (sensor, direction) in [(12, [1.0, 0.0, 0.0]), (13, [0.0, 1.0, 0.0])] {
        pieces.sensors.push(Sensor {
            sensor,
            name: "t",
            kind: SensorKind::Accelerometer(Mount::Structure),
            position: [0.0, 0.0, 0.6],
            direction,
            scale: unit,
        });
    }
    pieces.plan.sensors = 14;
    pieces.plan.runs = 6;
    pieces.channels = (0..14).chain([ChannelRole::Drive.code()]).collect();
    pieces.processing = Processing {
        block_length: 256,
        kept_band: [2.0, 80.0],
        averaging_band: [4.0, 20.0],
        mode_band: Some([24.0, 60.0]),
        accelerations,
        weighting,
        ..pieces.processing
    };
    pieces.send(bench);
    bench.ask(&Request::EndSetup)
}

/// Has the box take a run, and notes what it says of it.
fn measure(bench: &mut Bench, run: u8, pass: Pass, notes: &mut String) {
    bench.done(&Request::Start(Start {
        run,
        pass,
        source: Source::Host,
        gaps: Gaps::Refuse,
        limit: None,
    }));
    bench.events();
    let all = samples(run.into(), 512.0, SAMPLES, [1.0; 2]);
    for (first, some) in (0..).step_by(8).zip(all.chunks(8)) {
        let values: Vec<f32> = some.iter().flatten().copied().collect();
        let said = bench.ask(&Request::Samples(Samples {
            first,
            channels: CHANNELS as u8,
            values: Values::Readings(Packed::new(&values)),
        }));
        assert!(matches!(said, Said::Progress(_)), "{said:?}");
    }
    let last = bench
        .events()
        .into_iter()
        .rfind(|e| matches!(e, Heard::Block(_)));
    note(notes, "last block", &last);
    note(notes, "summary", &bench.ask(&Request::Stop));
}

/// Notes a value on lines of a length that can be read, without the names of wrappers.
fn note(notes: &mut String, what: &str, value: &dyn std::fmt::Debug) {
    let text = format!("{value:?}");
    let text = text.replace("Some(", "(");
    let _ = write!(notes, "{what}:");
    let mut width = usize::MAX;
    for word in text.split(' ') {
        if width.saturating_add(word.len()) > 96 {
            notes.push_str("\n   ");
            width = 3;
        }
        let _ = write!(notes, " {word}");
        width += word.len() + 1;
    }
    notes.push('\n');
}

fn question(method: Method, procedure: Procedure) -> Question {
    setup::question(method, procedure, 2)
}

/// Answers of one set-up to all questions.
fn answers(accelerations: Accelerations, weighting: Weighting, questions: &[Question]) -> String {
    let mut bench = Bench::switch_on();
    let mut notes = format!("== {accelerations:?}, {weighting:?}\n");
    note(
        &mut notes,
        "grid",
        &set_up(&mut bench, accelerations, weighting),
    );
    if weighting != Weighting::Given {
        for run in 0..6 {
            measure(&mut bench, run, Pass::Survey, &mut notes);
        }
        for run in [0, 3] {
            note(&mut notes, "peaks", &bench.ask(&Request::ReadPeaks(run)));
            note(
                &mut notes,
                "weights",
                &bench.ask(&Request::ReadWeights(run)),
            );
        }
    }
    for run in 0..6 {
        measure(&mut bench, run, Pass::Measure, &mut notes);
    }
    let read = ReadLines {
        run: 0,
        first: 13,
        count: 2,
    };
    note(&mut notes, "lines", &bench.ask(&Request::ReadLines(read)));
    for question in questions {
        let mut said = bench.await_reply(&Request::Identify(*question));
        if let Said::Identified(found) = &mut said {
            found.ticks = 0;
        }
        note(&mut notes, "answer", &said);
    }
    notes
}

#[test]
fn answers_to_the_last_bit() {
    use Method::*;
    let iterative = Procedure::Iterative {
        tolerance: 1e-7,
        limit: 20,
    };
    let direct = |method| question(method, Procedure::Direct);
    let of_interface = [
        direct(ApparentMass),
        question(ApparentMass, iterative),
        Question {
            identify: identify::Question::new(Some(100.0), Procedure::Direct),
            fit_band: Some([4.0, 70.0]),
            ..direct(ApparentMass)
        },
        Question {
            runs: 0b111,
            modes: 1,
            ..direct(ApparentMass)
        },
    ];
    let unweighted = [
        direct(FrequencyResponses),
        question(PowerSpectra, iterative),
        direct(PowerSpectraCholesky),
    ];
    let weighted = [
        direct(FrequencyResponses),
        direct(PowerSpectra),
        direct(FreeResponses),
        question(FreeResponsesSquared, iterative),
        direct(CurveFit),
        direct(Synthesis),
    ];
    let mut found = answers(Accelerations::Interface, Weighting::Given, &of_interface);
    found += &answers(Accelerations::All, Weighting::Given, &unweighted);
    found += &answers(Accelerations::Weighted, Weighting::EachRun, &weighted[..3]);
    found += &answers(Accelerations::Weighted, Weighting::Joined, &weighted);
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/instrument/answers.txt");
    if std::env::var_os("MASSLINE_ACCEPT").is_some_and(|value| value == "1") {
        std::fs::write(file, &found).unwrap();
    }
    let kept = std::fs::read_to_string(file).unwrap_or_default();
    for (found, kept) in found.lines().zip(kept.lines()) {
        assert_eq!(found, kept);
    }
    assert_eq!(found.len(), kept.len());
}
