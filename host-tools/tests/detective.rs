//! Mistakes that people make when they write a set-up, one at a time, in the satellite's test: each
//! is named, with the lines that mend it.

mod bench;

use massline::detective::{Fault, Findings, Mistake, WholeFault};
use massline::identification::Session;
use massline::setup::{AccelerometerEntry, Setup};
use massline::simulate::{Model, Options, simulate};
use std::path::Path;
use std::sync::LazyLock;
use tempfile::TempDir;

/// The satellite shaken for 20 seconds with 1 % of noise.
static SATELLITE: LazyLock<TempDir> = LazyLock::new(|| recorded("models/satellite.toml"));

fn recorded(model: &str) -> TempDir {
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join(model);
    let options = Options {
        noise: Some(0.01),
        duration: Some(20.0),
        ..Options::default()
    };
    let simulation = simulate(&Model::read(&model).unwrap(), &options, &mut |_| ()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    simulation.write(folder.path()).unwrap();
    folder
}

fn setup() -> Setup {
    Setup::read(&SATELLITE.path().join("setup.toml")).unwrap()
}

fn examine(setup: &Setup) -> Findings {
    let mut findings = Session::new(setup).examine(&mut |_| ()).unwrap();
    // Simulated set-ups state no unit, which is asked for.
    findings.whole.retain(|w| w.fault != WholeFault::NoUnit);
    findings
}

fn accelerometer<'s>(setup: &'s mut Setup, channel: &str) -> &'s mut AccelerometerEntry {
    let mut all = setup.accelerometers.iter_mut();
    all.find(|a| a.channel == channel).unwrap()
}

/// The single fault that is named, in words, with the lines that mend it.
fn named(setup: &Setup) -> (Fault, String, Vec<String>) {
    let findings = examine(setup);
    let [suspect] = findings.suspects.as_slice() else {
        panic!("{findings:?}");
    };
    let [explanation] = suspect.explanations.as_slice() else {
        panic!("{suspect:?}");
    };
    assert!(
        !findings.more_is_wrong() && findings.whole.is_empty(),
        "{findings:?}"
    );
    let e = explanation.clone();
    (e.fault, e.text, e.repair)
}

#[test]
fn nothing_is_wrong() {
    let findings = examine(&setup());
    assert!(findings.clean(), "{findings:?}");
}

/// A table that moves along one axis is silent across it, and nobody is dead.
#[test]
fn a_motion_that_the_table_does_not_make_is_nobodys_fault() {
    let folder = recorded("models/uniaxial-remounted.toml");
    let findings = examine(&Setup::read(&folder.path().join("setup.toml")).unwrap());
    assert!(findings.clean(), "{findings:?}");
}

#[test]
fn an_inverted_sensor_on_the_structure() {
    let mut setup = setup();
    accelerometer(&mut setup, "antenna.x").scale = -1.0;
    let (_, text, repair) = named(&setup);
    assert_eq!(text, "`antenna.x` has the other sign");
    let expected = ["[[accelerometer]]", "channel = \"antenna.x\"", "scale = 1"];
    assert_eq!(repair, expected);
}

#[test]
fn an_inverted_sensor_on_the_interface() {
    let mut setup = setup();
    accelerometer(&mut setup, "base2.y").scale = -1.0;
    assert_eq!(named(&setup).1, "`base2.y` has the other sign");
}

#[test]
fn an_inverted_load_cell() {
    let mut setup = setup();
    setup.load_cells[2].scale = -1.0;
    assert_eq!(named(&setup).1, "`cell1.z` has the other sign");
}

#[test]
fn two_sensors_exchanged() {
    let mut setup = setup();
    accelerometer(&mut setup, "base1.x").channel = "?".into();
    accelerometer(&mut setup, "base2.y").channel = "base1.x".into();
    accelerometer(&mut setup, "?").channel = "base2.y".into();
    let (fault, _, repair) = named(&setup);
    assert!(matches!(fault, Fault::Swapped { .. }), "{fault:?}");
    assert_eq!(repair.len(), 2, "{repair:?}");
}

#[test]
fn a_sensor_upside_down() {
    let mut setup = setup();
    for channel in ["base1.y", "base1.z"] {
        let entry = accelerometer(&mut setup, channel);
        entry.direction = entry.direction.map(|x| -x);
    }
    let (fault, text, _) = named(&setup);
    assert!(matches!(fault, Fault::Turned { .. }), "{fault:?}");
    assert!(text.ends_with("turned by 180°"), "{text}");
}

#[test]
fn one_position_in_millimetres() {
    let mut setup = setup();
    for axis in ["x", "y", "z"] {
        let entry = accelerometer(&mut setup, &format!("base1.{axis}"));
        entry.position = entry.position.map(|x| 1000.0 * x);
    }
    let (fault, _, repair) = named(&setup);
    let Fault::Position { mistake, .. } = fault else {
        panic!("{fault:?}");
    };
    assert_eq!(mistake, Mistake::Millimetres);
    assert!(
        repair.contains(&"position = [0.6, 0.55, 0]  # m".to_owned()),
        "{repair:?}"
    );
}

/// The position comes back to a millimetre and a half: thirty blocks of 1 % of noise at 2 rad/s².
#[test]
fn a_sensor_25_mm_off() {
    let mut setup = setup();
    for axis in ["x", "y", "z"] {
        accelerometer(&mut setup, &format!("base1.{axis}")).position[0] += 0.025;
    }
    let (fault, ..) = named(&setup);
    let Fault::Position { position, .. } = fault else {
        panic!("{fault:?}");
    };
    let error = (position - nalgebra::Vector3::new(0.6, 0.55, 0.0)).norm();
    assert!(error < 0.0015, "{error}");
}

#[test]
fn a_load_cell_that_reads_five_percent_too_much() {
    let mut setup = setup();
    setup.load_cells[5].scale *= 1.05;
    let (fault, ..) = named(&setup);
    let Fault::Gain { factor, .. } = fault else {
        panic!("{fault:?}");
    };
    assert!((factor - 1.05).abs() < 0.005, "{factor}");
}

/// Writes the readings of one channel in all recordings anew.
fn each_reading(setup: &Setup, channel: &str, mut change: impl FnMut(f64) -> f64) {
    for run in &setup.runs {
        let file = setup.recording_path(run);
        let text = std::fs::read_to_string(&file).unwrap();
        let header = text.lines().find(|line| line.contains(channel)).unwrap();
        let column = header.split(',').position(|name| name == channel).unwrap();
        let mut kept = String::with_capacity(text.len());
        for line in text.lines() {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if let Some(Ok(reading)) = cells.get(column).map(|cell| cell.parse()) {
                cells[column] = format!("{:e}", change(reading));
            }
            kept.push_str(&cells.join(","));
            kept.push('\n');
        }
        std::fs::write(&file, kept).unwrap();
    }
}

/// A channel whose unit is none that the set-up knows of: the lines have the unit, not a number.
#[test]
fn a_channel_in_another_unit() {
    let mut setup = setup();
    setup.load_cells[2].scale = 0.001;
    let (_, text, repair) = named(&setup);
    assert_eq!(text, "`cell1.z` reads 1000 times too little");
    assert_eq!(repair[2..], ["scale = 1"]);
    // As the recording would be if it were in kN, in g and in mm/s².
    for (channel, factor, unit) in [
        ("cell1.z", 0.001, "kN"),
        ("antenna.x", 1.0 / 9.806_65, "g"),
        ("antenna.x", 1000.0, "mm/s²"),
    ] {
        let folder = recorded("models/satellite.toml");
        let path = folder.path().join("setup.toml");
        bench::by_hand(&path);
        let setup = Setup::read(&path).unwrap();
        each_reading(&setup, channel, |x| factor * x);
        let (_, text, repair) = named(&setup);
        assert!(text.ends_with(&format!(": it is in {unit}")), "{text}");
        assert_eq!(repair[1], format!("channel = \"{channel}\""));
        assert!(
            repair[2].starts_with(&format!("unit = \"{unit}\"")),
            "{repair:?}"
        );
        assert_eq!(repair.len(), 3, "{repair:?}");
    }
}

/// A cable that is not plugged in: noise of the order of the sensor's own, and nothing else.
#[test]
fn a_channel_without_a_signal() {
    let folder = recorded("models/satellite.toml");
    let path = folder.path().join("setup.toml");
    bench::by_hand(&path);
    let setup = Setup::read(&path).unwrap();
    let mut seed = 1_u32;
    each_reading(&setup, "base2.y", |_| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (f64::from(seed >> 8) / f64::from(1 << 24) - 0.5) * 0.01
    });
    assert_eq!(named(&setup).1, "`base2.y` has no signal");
}

/// Load cells on one line of action, and sensors that look the same way on a table that only
/// translates, can be exchanged without a trace; the tool says so.
#[test]
fn what_the_runs_do_not_tell_is_said() {
    let lines = [
        "`cell1.x`, `cell2.x`",
        "`cell1.y`, `cell4.y`",
        "`cell2.y`, `cell3.y`",
        "`cell3.x`, `cell4.x`",
    ];
    let expected = lines.map(|pair| format!("which is which of {pair}"));
    assert_eq!(examine(&setup()).untold, expected);
    let folder = recorded("models/uniaxial-remounted.toml");
    let untold = examine(&Setup::read(&folder.path().join("setup.toml")).unwrap()).untold;
    let parallel = "which is which of `base1.z`, `base2.z`, `base3.z`, `base4.z`";
    assert!(untold.iter().any(|line| line == parallel), "{untold:?}");
}

/// The result document and the report of `identify` say what the data contradict.
#[test]
fn findings_stand_in_the_document_and_in_the_report() {
    let folder = recorded("models/satellite.toml");
    let path = folder.path().join("setup.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let wrong = text.replacen(
        "channel = \"base2.y\"\n",
        "channel = \"base2.y\"\nscale = -1.0\n",
        1,
    );
    assert_ne!(text, wrong);
    std::fs::write(&path, wrong).unwrap();
    let run = || {
        bench::massline(
            folder.path(),
            [
                "identify",
                "setup.toml",
                "--json",
                "--report",
                "report.html",
            ],
        )
    };
    let document: serde_json::Value = serde_json::from_str(&run().stdout).unwrap();
    let findings = document["findings"].as_array().unwrap();
    let [finding] = findings.as_slice() else {
        panic!("{findings:?}");
    };
    assert_eq!(finding["fault"], "inverted");
    assert_eq!(finding["sensors"], serde_json::json!(["base2.y"]));
    assert_eq!(finding["text"], "`base2.y` has the other sign");
    assert_eq!(finding["ties"], serde_json::json!([]));
    let lines = ["[[accelerometer]]", "channel = \"base2.y\"", "scale = 1"];
    assert_eq!(finding["repair"], serde_json::json!(lines));
    let evidence = finding["evidence"].as_str().unwrap();
    assert!(evidence.contains("after the repair"), "{evidence}");
    let report = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    let at = |words: &str| report.find(words).unwrap_or_else(|| panic!("{words}"));
    assert!(at("What contradicts the setup") < at("The ten numbers"));
    assert!(
        report.contains("<pre>[[accelerometer]]\nchannel = &quot;base2.y&quot;\nscale = 1</pre>")
    );
    // Read back and written again, nothing of it is lost.
    std::fs::write(folder.path().join("result.json"), document.to_string()).unwrap();
    let export = bench::massline(
        folder.path(),
        ["export", "result.json", "--to", "json", "--anyway"],
    );
    let again: serde_json::Value = serde_json::from_str(&export.stdout).unwrap();
    assert_eq!(again["findings"], document["findings"]);
    // A sound set-up has none.
    std::fs::write(&path, text).unwrap();
    let document: serde_json::Value = serde_json::from_str(&run().stdout).unwrap();
    assert!(document.get("findings").is_none());
}

/// What all sensors share contradicts nothing, and is told by what no body is.
#[test]
fn faults_of_all_sensors() {
    let mut reversed = setup();
    reversed.load_cells.iter_mut().for_each(|c| c.scale = -1.0);
    let mut millimetres = setup();
    let positions = millimetres
        .accelerometers
        .iter_mut()
        .map(|a| &mut a.position);
    let positions = positions.chain(millimetres.load_cells.iter_mut().map(|c| &mut c.position));
    positions.for_each(|p| *p = p.map(|x| 1000.0 * x));
    let mut in_g = setup();
    in_g.accelerometers
        .iter_mut()
        .for_each(|a| a.scale = 1.0 / 9.806_65);
    let mut weighed = in_g.clone();
    weighed.known_mass = Some(800.0);
    let mut reference = setup();
    reference.reference_point = [300.0, 200.0, 100.0];
    let cases = [
        (reversed, "have the other sign"),
        (millimetres, "`length_unit = \"mm\"` at the top"),
        (in_g, "are the accelerometers in g?"),
        (weighed, "the accelerometers are in g: multiply the `scale`"),
        (reference, "`reference_point` is 3"),
    ];
    for (setup, words) in cases {
        let findings = examine(&setup);
        assert!(findings.suspects.is_empty(), "{findings:?}");
        let [one] = findings.whole.as_slice() else {
            panic!("{words}: {findings:?}");
        };
        assert!(one.text.contains(words), "{one:?}");
    }
}
