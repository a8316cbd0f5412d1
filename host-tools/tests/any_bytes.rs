//! No bytes make the host tool panic: setups and recordings, plain and compressed, random
//! ones and good ones with damage.

use flate2::Compression;
use flate2::write::GzEncoder;
use massline::identification::{Choice, answer};
use massline::report::render;
use massline::result::ResultDocument;
use massline::setup::Setup;
use proptest::collection::vec;
use proptest::prelude::*;
use std::io::Write;
use std::path::Path;

/// A small setup that uses every section.
const SETUP: &str = include_str!("../../tests/fuzz/seeds/setup.toml");

/// A recording of a body of 2 kg whose readings are some pseudo-random numbers.
fn recording(rows: usize, seed: u32) -> String {
    let mut state = seed;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24) - 0.5
    };
    let mut text = "time,drive,ax,az,fx,ty\n".to_owned();
    for row in 0..rows {
        let (a, b) = (noise(), noise());
        text += &format!(
            "{},{a},{},{b},{},{}\n",
            row as f64 / 128.0,
            a + 0.01 * noise(),
            2.0 * a + 0.01 * noise(),
            0.4 * a + 0.01 * noise()
        );
    }
    text
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// Damage to bytes on their way.
#[derive(Clone, Debug)]
enum Damage {
    Replace(Vec<u8>),
    Insert(Vec<u8>),
    Remove(usize),
    Repeat(usize),
    CutOff,
}

fn damage() -> impl Strategy<Value = (prop::sample::Index, Damage)> {
    // Single bytes that formats care about, words that numbers do, and anything.
    let piece = prop_oneof![
        prop::sample::select(b"\"'[]{}=,.#-+eE0 9\n\r\t;\\\x00\xff".to_vec()).prop_map(|b| vec![b]),
        prop::sample::select(vec![
            "nan",
            "inf",
            "-1e308",
            "1e-320",
            "99999999999999999999",
            "\"\"",
            "[[run]]",
            "\u{feff}",
            "é",
        ])
        .prop_map(|word| word.as_bytes().to_vec()),
        vec(any::<u8>(), 1..8),
    ];
    let kind = prop_oneof![
        3 => piece.clone().prop_map(Damage::Replace),
        3 => piece.prop_map(Damage::Insert),
        2 => (1..60_usize).prop_map(Damage::Remove),
        1 => (1..60_usize).prop_map(Damage::Repeat),
        1 => Just(Damage::CutOff),
    ];
    (any::<prop::sample::Index>(), kind)
}

fn apply(good: &[u8], damages: &[(prop::sample::Index, Damage)]) -> Vec<u8> {
    let mut bytes = good.to_vec();
    for (at, damage) in damages {
        let at = at.index(bytes.len() + 1);
        let up_to = |n: usize| (at + n).min(bytes.len());
        match damage {
            Damage::Replace(piece) => drop(bytes.splice(at..up_to(piece.len()), piece.clone())),
            Damage::Insert(piece) => drop(bytes.splice(at..at, piece.clone())),
            Damage::Remove(n) => drop(bytes.drain(at..up_to(*n))),
            Damage::Repeat(n) => {
                let piece = bytes[at..up_to(*n)].to_vec();
                drop(bytes.splice(at..at, piece));
            }
            Damage::CutOff => bytes.truncate(at),
        }
    }
    bytes
}

/// Identifies from files, and looks at what an error or an answer says of itself.
fn identify(setup: &[u8], one: &[u8], two: &[u8]) -> Result<(), String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("setup.toml");
    std::fs::write(&file, setup).unwrap();
    std::fs::write(folder.path().join("one.csv"), one).unwrap();
    std::fs::write(folder.path().join("two.csv.gz"), two).unwrap();
    let setup = Setup::read(&file).map_err(|e| e.to_string())?;
    // A damaged name may point anywhere, even at a device that never ends.
    if setup
        .runs
        .iter()
        .any(|run| run.recording.components().count() != 1)
    {
        return Err("outside the folder".to_owned());
    }
    for method in massline_core::masslines::Method::ALL {
        let choice = Choice {
            method: Some(method),
            ..Choice::default()
        };
        match answer(&setup, &choice, &mut |_| ()) {
            Ok(answer) => {
                let result = ResultDocument::new(&setup, &answer);
                drop(render(&setup, &answer, &result, None));
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    answer(&setup, &Choice::default(), &mut |_| ())
        .map(drop)
        .map_err(|e| e.to_string())
}

#[test]
fn what_is_damaged_below_was_good() {
    let one = recording(200, 1);
    let two = gzip(recording(200, 2).as_bytes());
    assert_eq!(identify(SETUP.as_bytes(), one.as_bytes(), &two), Ok(()));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn any_bytes_as_a_setup(bytes in vec(any::<u8>(), 0..400)) {
        let text = String::from_utf8_lossy(&bytes);
        let _ = Setup::from_str(&text, Path::new("setup.toml"));
    }

    #[test]
    fn a_damaged_setup(damages in vec(damage(), 1..6)) {
        let one = recording(60, 1);
        let two = gzip(recording(60, 2).as_bytes());
        let _ = identify(&apply(SETUP.as_bytes(), &damages), one.as_bytes(), &two);
    }

    #[test]
    fn any_bytes_as_recordings(one in vec(any::<u8>(), 0..400), two in vec(any::<u8>(), 0..400)) {
        prop_assert!(identify(SETUP.as_bytes(), &one, &two).is_err());
    }

    #[test]
    fn a_damaged_recording(damages in vec(damage(), 1..6), rows in 0..80_usize) {
        let one = apply(recording(rows, 1).as_bytes(), &damages);
        let two = gzip(recording(60, 2).as_bytes());
        let _ = identify(SETUP.as_bytes(), &one, &two);
    }

    #[test]
    fn a_damaged_text_inside_gzip(damages in vec(damage(), 1..6), rows in 0..80_usize) {
        let one = recording(60, 1);
        let two = gzip(&apply(recording(rows, 2).as_bytes(), &damages));
        let _ = identify(SETUP.as_bytes(), one.as_bytes(), &two);
    }

    #[test]
    fn a_damaged_gzip(damages in vec(damage(), 1..6)) {
        let one = recording(60, 1);
        let two = apply(&gzip(recording(60, 2).as_bytes()), &damages);
        let _ = identify(SETUP.as_bytes(), one.as_bytes(), &two);
    }

    /// Readings that are numbers, but of sizes that no test has.
    #[test]
    fn any_numbers(
        rows in vec((any::<f32>(), any::<f32>(), any::<f32>(), any::<f32>(), any::<f32>()), 40..60)
    ) {
        let text = |order: [usize; 5]| {
            let mut text = "drive,ax,az,fx,ty\n".to_owned();
            for r in &rows {
                let row = [r.0, r.1, r.2, r.3, r.4];
                let fields: Vec<String> = order.iter().map(|&i| format!("{:e}", row[i])).collect();
                text += &fields.join(",");
                text.push('\n');
            }
            text
        };
        let one = text([0, 1, 2, 3, 4]);
        let two = gzip(text([4, 3, 2, 1, 0]).as_bytes());
        let _ = identify(SETUP.as_bytes(), one.as_bytes(), &two);
    }
}
