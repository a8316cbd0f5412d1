//! The messages about wrong setups, and the round trip.

use std::path::Path;

use super::keys::unit;
use super::*;
use crate::limits;

const GOOD: &str = r#"
title = "Tuning fork on the shaker"
reference_point = [0.0, 0.0, 0.0]
known_mass = 0.63076

[processing]
sample_rate = 512.0
block_length = 1024
overlap = 0.5
averaging_band = [0.5, 14.5]
mode_band = [28.0, 50.0]

[[accelerometer]]
channel = "a1"
position = [0.0, 0.0, 0.0]
direction = [2, 0, 0]
mount = "interface"

[[accelerometer]]
channel = "a4"
position = [0.1, 0.2, 0.3]
direction = [1, 2, 2]
scale = -9.81

[[load_cell]]
channel = "fx"
position = [0, 0, 0]
direction = [1, 0, 0]

[[load_cell]]
channel = "ty"
direction = [0, 1, 0]
quantity = "moment"

[[run]]
name = "lateral X"
recording = "lateral-x.csv"
excitation = "random"
reference = "drive"
weights = { a4 = 0.5 }
rotation = [0.0, 0.0, 90.0]

[[run]]
name = "poses"
recording = "poses.csv"
excitation = "static"
"#;

fn read(text: &str) -> Result<Setup, SetupError> {
    Setup::from_str(text, Path::new("bench/setup.toml"))
}

/// The text after one replacement, which must apply.
fn with(from: &str, to: &str) -> String {
    assert!(GOOD.contains(from), "{from}");
    GOOD.replacen(from, to, 1)
}

/// The message of a setup that must be refused.
fn refused(text: &str) -> String {
    read(text).expect_err("must be refused").to_string()
}

#[test]
fn reads_what_is_written() {
    let setup = read(GOOD).unwrap();
    assert_eq!(setup.known_mass, Some(0.63076));
    assert_eq!(setup.accelerometers[0].direction, [1.0, 0.0, 0.0]);
    assert_eq!(setup.accelerometers[0].mount, Mount::Interface);
    assert_eq!(setup.accelerometers[1].mount, Mount::Structure);
    assert_eq!(setup.accelerometers[1].scale, -9.81);
    let direction = setup.accelerometers[1].direction;
    for (found, expected) in direction.iter().zip([1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0]) {
        // One division and one square root: two roundings.
        assert!((found - expected).abs() <= 2.0 * f64::EPSILON);
    }
    assert_eq!(setup.load_cells[1].quantity, Quantity::Moment);
    assert_eq!(setup.runs[0].weights["a4"], 0.5);
    assert_eq!(setup.runs[0].rotation, [0.0, 0.0, 90.0]);
    assert!(setup.runs[0].is_remounted() && !setup.runs[1].is_remounted());
    assert_eq!(
        setup.recording_path(&setup.runs[0]),
        Path::new("bench").join("lateral-x.csv")
    );
}

#[test]
fn writes_what_reads_back() {
    let mut setup = read(GOOD).unwrap();
    setup.title = "quotes \" and \\ and Θ".to_owned();
    setup.runs[0].translation = [1e-9, -1.0 / 3.0, 1e12];
    let again = read(&setup.to_toml()).unwrap();
    assert_eq!(again, setup);

    setup.known_mass = None;
    setup.processing = None;
    setup.runs.remove(0);
    assert_eq!(read(&setup.to_toml()).unwrap(), setup);
}

/// Titles and names come out on terminals, where they could pass for this program's own words.
#[test]
fn a_text_that_steers_a_terminal_is_refused_and_shown_as_it_is() {
    for (escaped, shown) in [
        ("\\u001b[2J", "\\u{1b}[2J"),
        ("\\u009b1m", "\\u{9b}1m"),
        ("a\\nerror: b", "a\\nerror: b"),
        ("\\u202e", "\\u{202e}"),
    ] {
        for (from, key) in [
            ("\"Tuning fork on the shaker\"", "`title`"),
            ("\"lateral-x.csv\"", "`recording`"),
            ("\"a4\"", "`channel`"),
        ] {
            let message = refused(&with(from, &format!("\"{escaped}\"")));
            assert!(
                message.contains(key) && message.contains(shown),
                "{message}"
            );
            assert!(message.contains("text of one line"), "{message}");
            assert!(!message.contains(crate::printable::steers), "{message:?}");
        }
    }
    let key = refused(&with("title =", "\"ti\\u001btle\" ="));
    assert!(key.contains("`ti\\u{1b}tle`"), "{key}");
    let long = refused(&with(
        "title = \"",
        &format!("title = {} # \"", "9".repeat(1000)),
    ));
    assert!(long.len() < 300, "{long}");
}

#[test]
fn too_many_sensors_or_runs_are_named_before_anything_else_of_them() {
    // What is wrong with each of them is not looked at.
    let sensors = GOOD.to_owned() + &"[[accelerometer]]\n".repeat(limits::SENSORS);
    let message = refused(&sensors);
    assert!(message.contains("sensors, at most 64"), "{message}");
    let runs = GOOD.to_owned() + &"[[run]]\n".repeat(limits::RUNS);
    let message = refused(&runs);
    assert!(message.contains("runs, at most 1000"), "{message}");
}

#[test]
fn open_choices_have_defaults() {
    let text = with("block_length = 1024\noverlap = 0.5\n", "")
        .replacen("title = \"Tuning fork on the shaker\"\n", "", 1)
        .replacen("reference_point = [0.0, 0.0, 0.0]\n", "", 1);
    let setup = read(&text).unwrap();
    let processing = setup.processing.unwrap();
    assert_eq!(processing.block_length, DEFAULT_BLOCK_LENGTH);
    assert_eq!(processing.overlap, DEFAULT_OVERLAP);
    assert_eq!(setup.title, "setup");
    assert_eq!(setup.reference_point, [0.0; 3]);
}

#[test]
fn lines_of_a_band() {
    let processing = read(GOOD).unwrap().processing.unwrap();
    let lines = |band, rate| {
        let spectrum = processing.spectrum(rate);
        let band = spectrum.within(band).unwrap();
        spectrum.first + band.indices().start..spectrum.first + band.indices().end
    };
    assert_eq!(lines([0.5, 14.5], 512.0), 1..30);
    assert_eq!(lines([0.0, 14.4], 512.0), 1..29);
    // 0.1 + 0.2 Hz at lines of 0.1 Hz: meant is line 3, although the sum is above 0.3.
    assert_eq!(lines([0.1 + 0.2, 1.0], 102.4), 3..11);
    assert!(lines([0.6, 0.9], 512.0).is_empty());
    assert!(processing.check_bands(512.0).is_ok());
    assert!(matches!(
        processing.check_bands(80.0),
        Err(BandError::AboveSpectrum {
            key: "mode_band",
            ..
        })
    ));
}

/// Wrong changes of the good setup, each with words of its message; `\n` ends a line.
const MISTAKES: &str = r#"
title = "Tuning fork on the shaker" => title = => bench/setup.toml, line 2 | not TOML
direction = [1, 2, 2] => direction = [0, 0, 0] => line 22 | [[accelerometer]] 2 (channel "a4") | zero vector
channel = "a4" => channel = "a1" => line 20 | [[accelerometer]] 2 | [[accelerometer]] 1 (channel "a1")
channel = "fx" => channel = "a4" => [[load_cell]] 1 | [[accelerometer]] 2
position = [0.1, 0.2, 0.3]\n => => line 19 | `position` is missing | in m
position = [0, 0, 0]\n => => [[load_cell]] 1 | `position` is missing
position = [0.1, 0.2, 0.3] => position = [0.1, nan, 0.3] => line 21 | `position` is NaN | finite
position = [0.1, 0.2, 0.3] => position = [0.1, 1e300, 0.3] => of a size that exists
position = [0.1, 0.2, 0.3] => position = [0.1, 0.2] => a list of 2 values | a list of 3 numbers
position = [0.1, 0.2, 0.3] => position = "top" => the text "top" | a list of 3 numbers
known_mass = 0.63076 => known_mass = 0 => line 4 | `known_mass` is 0 | more than 0
known_mass = 0.63076 => known_mass = -1.5 => `known_mass` is -1.5
known_mass = 0.63076 => known_mass = 1e400 => line 4 | `known_mass` is the number 1e400
overlap = 0.5 => overlap = 0.96 => [processing] | `overlap` is 0.96 | 0.95
block_length = 1024 => block_length = 1000 => `block_length` is 1000 | power of two from 16 to 32768
block_length = 1024 => block_length = 65536 => power of two
block_length = 1024 => block_length = 1024.5 => power of two
[0.5, 14.5] => [14.5, 0.5] => line 10 | `averaging_band` is [14.5, 0.5] | lower first
[0.5, 14.5] => [-0.5, 14.5] => not negative
[28.0, 50.0] => [28.0, 28.0] => `mode_band`
[0.5, 14.5] => [30.0, 40.0] => line 10 | begins above the first 28 Hz of `mode_band` | lower it
title = "Tuning fork on the shaker" => estimation = { rigid_up_to = 14.5 } # => [estimation] | `rigid_up_to` is 14.5 | above the end of `averaging_band`
[0.5, 14.5] => [0.5, 300.0] => ends at 300 Hz | 255 Hz
[0.5, 14.5] => [0.5, 1.0] => holds 2 line(s) | 0.5 Hz | block_length
averaging_band = [0.5, 14.5]\n => => line 6 | [processing] | `averaging_band` is missing | in Hz
sample_rate = 512.0 => sample_rate = 0 => `sample_rate` is 0
{ a4 = 0.5 } => { a5 = 0.5 } => [[run]] 1 (name "lateral X") | "a5" | known are `a1`, `a4`
{ a4 = 0.5 } => { fx = 0.5 } => load cell "fx"
{ a4 = 0.5 } => { a4 = 0 } => weight of "a4" is 0
{ a4 = 0.5 } => { a4 = 1.1 } => at most 1
{ a4 = 0.5 } => [0.5] => line 40 | `weights` is a list | a table
"random" => "noise" => "noise" | "random" or "sine" or "static"
name = "poses" => name = "lateral X" => [[run]] 2 | [[run]] 1 | own name
rotation = [0.0, 0.0, 90.0] => rotation = [90.0] => `rotation` is a list of 1 values | 3 numbers
recording = "poses.csv" => recording = " " => `recording` is empty
excitation = "static" => excitation = "static"\nreference = "drive" => `reference` | static run
scale = -9.81 => scale = 0 => `scale` is 0
mount = "interface" => monut = "interface" => line 17 | `monut` | did you mean `mount`?
mount = "interface" => xyz = 1 => known are `channel`, `position`
[processing] => [procesing] => did you mean `processing`?
[processing] => processing = 1\n[x] => line 6 | `processing` is the integer 1 | a table
title = "Tuning fork on the shaker" => estimation = { modes = 9 } # => [estimation] | `modes` is 9 | from 1 to 4
[[run]]\nname = "poses" => [[run]]\nchecksum = { bytes = 1 }\nname = "poses" => `checksum` | `crc32` is missing | hexadecimal
[[run]]\nname = "poses" => [[run]]\nchecksum = { crc32 = "x", bytes = 1 }\nname = "poses" => `crc32` is "x" | hexadecimal
"#;

#[test]
fn every_mistake_is_located_and_explained() {
    for case in MISTAKES.trim().lines() {
        let case = case.replace("\\n", "\n");
        let [from, to, parts] = case.split("=>").collect::<Vec<_>>()[..] else {
            panic!("{case}");
        };
        let trimmed = |text: &str| text.trim_matches(' ').to_owned();
        let message = refused(&with(&trimmed(from), &trimmed(to)));
        for part in parts.split('|').map(str::trim) {
            assert!(message.contains(part), "«{part}» is not in: {message}");
        }
        assert!(message.starts_with("bench/setup.toml"), "{message}");
    }
}

#[test]
fn uncertainty_is_that_of_the_sensor_its_kind_or_all() {
    let text = GOOD.replacen(
        "[processing]",
        "known_mass_uncertainty = 0.001\n[defaults]\nposition_uncertainty = 0.002\ncalibration_uncertainty = 0.01\n\
         [defaults.accelerometer]\nnoise = 0.003\ncalibration_uncertainty = 0.02\n\
         [defaults.moment]\nnoise = 0.5\ndirection_uncertainty = 1\n[processing]",
        1,
    );
    let text = text.replacen(
        "scale = -9.81",
        "scale = -9.81\nnoise = 4e-3\nposition_uncertainty = 0",
        1,
    );
    let setup = read(&text).unwrap();
    assert_eq!(read(&setup.to_toml()).unwrap(), setup);
    let all = |u: Uncertainty| [u.noise, u.calibration, u.position, u.direction];
    let (a, f) = (
        |k| all(setup.accelerometer_uncertainty(k)),
        |k| all(setup.load_cell_uncertainty(k)),
    );
    assert_eq!(a(0), [Some(0.003), Some(0.02), Some(0.002), None]);
    assert_eq!(a(1), [Some(0.004), Some(0.02), Some(0.0), None]);
    assert_eq!(f(0), [None, Some(0.01), Some(0.002), None]);
    assert_eq!(f(1), [Some(0.5), Some(0.01), Some(0.002), Some(1.0)]);
    for case in WRONG_UNCERTAINTIES.trim().lines() {
        let (keys, parts) = case.split_once("=>").unwrap();
        let (at, keys) = match keys.split_once("scale:") {
            Some((_, keys)) => ("scale = -9.81", keys.to_owned()),
            None => ("[processing]", keys.replace(';', "\n") + "\n[processing]"),
        };
        let message = refused(&GOOD.replacen(at, &keys, 1));
        for part in parts.split('|').map(str::trim) {
            assert!(message.contains(part), "«{part}» is not in: {message}");
        }
    }
    let alone = with("known_mass = 0.63076", "known_mass_uncertainty = 0.1");
    let message = refused(&alone);
    assert!(message.contains("`known_mass_uncertainty`"), "{message}");
    assert!(message.contains("beside a `known_mass`"), "{message}");
}

/// Keys before `[processing]`, or in place of the scale of a4, and words of the message.
const WRONG_UNCERTAINTIES: &str = r#"
[defaults];noise = 1 => `noise` | [defaults.accelerometer]
[defaults];positon_uncertainty = 1 => `positon_uncertainty` | did you mean
[defaults.load_cell];noise = 1 => `load_cell` | `force`
[defaults.force];noise = 0 => [defaults], `force` | more than 0
scale: noise = -1 => (channel "a4") | more than 0
scale: calibration_uncertainty = 1 => `calibration_uncertainty` is 1 | 0.01 for one per cent
scale: position_uncertainty = 2 => `position_uncertainty` is 2 | in m
scale: direction_uncertainty = 90 => `direction_uncertainty` is 90 | in degrees
scale: noise = "low" => the text "low" | a number
"#;

#[test]
fn lists_must_not_be_empty() {
    let head = &GOOD[..GOOD.find("[[accelerometer]]").unwrap()];
    assert!(refused(head).contains("no [[accelerometer]]"));
    let cells = &GOOD[..GOOD.find("[[load_cell]]").unwrap()];
    assert!(refused(cells).contains("no [[load_cell]]"));
    let runs = &GOOD[..GOOD.find("[[run]]").unwrap()];
    assert!(refused(runs).contains("no [[run]]"));
    assert!(refused("").contains("no [[accelerometer]]"));
}

#[test]
fn random_runs_need_processing() {
    let start = GOOD.find("[processing]").unwrap();
    let end = GOOD.find("[[accelerometer]]").unwrap();
    let text = format!("{}{}", &GOOD[..start], &GOOD[end..]);
    assert!(refused(&text).contains("averaging_band"));
}

#[test]
fn unreadable_files_are_named() {
    let missing = Setup::read(Path::new("no/such/setup.toml")).unwrap_err();
    assert!(missing.to_string().contains("no/such/setup.toml"));

    let folder = std::env::temp_dir().join(format!("massline-setup-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("binary.toml");
    std::fs::write(&file, b"title = \"\xff\"").unwrap();
    let binary = Setup::read(&file).unwrap_err().to_string();
    assert!(binary.contains("byte 9"), "{binary}");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn unit_vectors_stay_untouched() {
    let mut state = 1_u64;
    for _ in 0..10_000 {
        let mut component = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let once = unit([component(), component(), component()]).unwrap();
        assert_eq!(unit(once), Some(once));
    }
    assert_eq!(unit([0.0, -0.0, 0.0]), None);
    assert_eq!(unit([0.0, 1e-200, 0.0]), Some([0.0, 1.0, 0.0]));
}

/// Two axes make a frame, and any two the same one; what is written and read again is the same to the
/// last bit.
#[test]
fn frames_are_right_handed_and_survive_printing() {
    let with = |keys: &str| {
        let text = format!("{GOOD}\n[frame]\n{keys}\n");
        Setup::from_str(&text, Path::new("setup.toml"))
    };
    let frame = |keys: &str| with(keys).unwrap().frame.unwrap();
    assert_eq!(frame(""), crate::frame::Frame::default());
    assert_eq!(frame("origin = [1, 2, 3]").origin, [1.0, 2.0, 3.0]);
    let quarter = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    for keys in [
        "x = \"+y\"\ny = \"-x\"",
        "x = \"y\"\nz = \"z\"",
        "y = [-2, 0, 0]\nz = \"+z\"",
    ] {
        assert_eq!(frame(keys).axes, quarter, "{keys}");
        let signed = frame(keys)
            .axes
            .as_flattened()
            .iter()
            .any(|x| *x == 0.0 && x.is_sign_negative());
        assert!(!signed, "a zero has no sign: {keys}");
    }
    let near = frame("x = [1.001, 0.3, -0.7]\ny = [0.3, -1.0, 0.0]");
    for (i, a) in near.axes.iter().enumerate() {
        for (j, b) in near.axes.iter().enumerate() {
            let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
            // Products of unit vectors after a dozen roundings.
            assert!(
                (dot - f64::from(u8::from(i == j))).abs() < 2e-15,
                "{near:?}"
            );
        }
    }
    let mut state = 7_u64;
    for _ in 0..1000 {
        let mut number = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let (a, b) = (
            [number(), number(), number()],
            [number(), number(), number()],
        );
        let dot: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
        let square: f64 = a.iter().map(|a| a * a).sum();
        let across: Vec<f64> = a
            .iter()
            .zip(&b)
            .map(|(a, b)| b - a * dot / square)
            .collect();
        let names = [["x", "y"], ["x", "z"], ["y", "z"]][(number().abs() * 2.99) as usize];
        let setup = with(&format!("{} = {a:?}\n{} = {across:?}", names[0], names[1])).unwrap();
        let again = Setup::from_str(&setup.to_toml(), Path::new("setup.toml")).unwrap();
        assert_eq!(again.frame, setup.frame);
    }
    for (keys, words) in [
        ("x = \"+x\"", "given by `x` alone"),
        ("x = \"+x\"\ny = \"+y\"\nz = \"+z\"", "given by three axes"),
        (
            "x = \"+x\"\nz = [0.1, 0, 1]",
            "`x` and `z`, which are 84.3 degrees apart",
        ),
        ("x = \"+x\"\nz = \"-x\"", "180.0 degrees apart"),
        ("x = [0, 0, 0]\nz = \"-x\"", "the zero vector"),
        ("orgin = [0, 0, 0]", "orgin"),
    ] {
        let error = with(keys).unwrap_err().to_string();
        assert!(error.contains(words), "{keys}: {error}");
    }
    let millimetres = format!("length_unit = \"mm\"\n{GOOD}\n[frame]\norigin = [100, 0, 0]\n");
    let setup = Setup::from_str(&millimetres, Path::new("setup.toml")).unwrap();
    assert_eq!(setup.frame.unwrap().origin, [0.1, 0.0, 0.0]);
}
