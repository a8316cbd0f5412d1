//! Mistakes that people make when they write a set-up, one at a time, in the satellite's test: each
//! is named, with the lines that mend it.

mod bench;

use massline::detective::{Fault, Findings, Mistake, Whole, WholeFault};
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
    // A weighed mass may be wrong itself.
    let others = |w: &Whole| w.fault != WholeFault::Weighed;
    assert!(
        !findings.more_is_wrong() && !findings.whole.iter().any(others),
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
    assert!(text.ends_with("turned by 180° about x"), "{text}");
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

/// A fault that all sensors share contradicts nothing but the body that would follow.
#[test]
fn faults_of_all_sensors() {
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
    let mut reference = setup();
    reference.reference_point = [300.0, 200.0, 100.0];
    let mut small = setup();
    let positions = small.accelerometers.iter_mut().map(|a| &mut a.position);
    let positions = positions.chain(small.load_cells.iter_mut().map(|c| &mut c.position));
    positions.for_each(|p| *p = p.map(|x| 0.001 * x));
    let findings = examine(&small);
    let [one] = findings.whole.as_slice() else {
        panic!("{findings:?}");
    };
    assert_eq!(one.fault, WholeFault::TooSmall);
    assert!(
        one.text.contains("`length_unit` says another unit"),
        "{one:?}"
    );
    let cases = [
        (
            millimetres,
            "positions are in millimetres",
            "length_unit = \"mm\"",
        ),
        (in_g, "are the accelerometers in g?", "scale = 1"),
        (
            reference,
            "`reference_point` is 3",
            "reference_point = [0.3, 0.2, 0.1]  # m",
        ),
    ];
    for (setup, words, line) in cases {
        let findings = examine(&setup);
        assert!(findings.suspects.is_empty(), "{findings:?}");
        let [one] = findings.whole.as_slice() else {
            panic!("{words}: {findings:?}");
        };
        assert!(one.text.contains(words), "{one:?}");
        assert!(one.repair.iter().any(|l| l == line), "{one:?}");
    }
}

#[test]
fn all_load_cells_reversed() {
    let mut setup = setup();
    setup.load_cells.iter_mut().for_each(|c| c.scale = -1.0);
    let (fault, text, repair) = named(&setup);
    assert!(matches!(fault, Fault::Reversed { .. }), "{fault:?}");
    assert!(text.contains("have the other sign"), "{text}");
    assert_eq!(repair.len(), 3 * setup.load_cells.len());
    assert_eq!(
        repair[..3],
        ["[[load_cell]]", "channel = \"cell1.x\"", "scale = 1"]
    );
    // One more is found beside it.
    setup.load_cells[2].scale = 1.0;
    let mut found: Vec<String> = examine(&setup)
        .suspects
        .iter()
        .map(|s| s.explanations[0].text.clone())
        .collect();
    found.sort();
    assert_eq!(found[0], "`cell1.z` has the other sign");
    assert!(found[1].starts_with("all load cells"), "{found:?}");
}

/// With a weighed mass the unit is named, not asked for; a mass that is right accuses nobody.
#[test]
fn all_accelerations_in_g_with_a_weighed_mass() {
    let mut setup = setup();
    setup.known_mass = Some(800.0);
    let findings = examine(&setup);
    assert!(findings.clean(), "{findings:?}");
    setup
        .accelerometers
        .iter_mut()
        .for_each(|a| a.scale = 1.0 / 9.806_65);
    let (fault, text, repair) = named(&setup);
    assert!(matches!(fault, Fault::Unit { .. }), "{fault:?}");
    assert!(text.contains("by the weighed mass"), "{text}");
    assert_eq!(repair.len(), 3 * setup.accelerometers.len());
    assert_eq!(repair[2], "scale = 1");
}

/// As somebody would meet it: recordings in g, and a set-up that says nothing of units.
/// A wrong weighed mass contradicts sensors that agree without it: no sensor is accused by itself.
#[test]
fn a_weighed_mass_that_is_wrong() {
    let mut setup = setup();
    setup.known_mass = Some(1200.0);
    let findings = examine(&setup);
    assert!(findings.suspects.is_empty(), "{:?}", findings.suspects);
    assert!(!findings.clean() && !findings.more_is_wrong());
    let texts: Vec<&str> = findings.whole.iter().map(|w| w.text.as_str()).collect();
    let text = texts.join("\n");
    assert!(
        text.contains(
            "nothing but `known_mass` contradicts the setup: it is 1200 kg, and the data say 799.8 kg"
        ),
        "{text}"
    );
    // Ten times the mass, which load cells in kgf explain as well.
    setup.known_mass = Some(7845.0);
    let findings = examine(&setup);
    let [suspect] = findings.suspects.as_slice() else {
        panic!("{:?}", findings.suspects);
    };
    assert!(matches!(suspect.explanations[0].fault, Fault::Unit { .. }));
    let culprits = findings.culprits().unwrap();
    assert!(
        culprits.contains("by the weighed mass; or `known_mass` is wrong"),
        "{culprits}"
    );
    // A sensor that is wrong is named with and without a weighed mass.
    setup.known_mass = Some(1200.0);
    accelerometer(&mut setup, "base1.y").scale *= -1.0;
    let findings = examine(&setup);
    assert!(
        findings
            .whole
            .iter()
            .all(|w| w.fault != WholeFault::Weighed)
    );
}

#[test]
fn recordings_in_g() {
    let folder = recorded("models/satellite.toml");
    let path = folder.path().join("setup.toml");
    bench::by_hand(&path);
    let mut setup = Setup::read(&path).unwrap();
    let channels: Vec<String> = setup
        .accelerometers
        .iter()
        .map(|a| a.channel.clone())
        .collect();
    for channel in &channels {
        each_reading(&setup, channel, |x| x / 9.806_65);
    }
    setup.known_mass = Some(800.0);
    let (_, text, repair) = named(&setup);
    assert_eq!(text, "all accelerometers are in g, by the weighed mass");
    assert!(repair[2].starts_with("unit = \"g\""), "{repair:?}");
}

/// The other sign of a vertical load cell is a body of half the mass elsewhere. In each of three mountings it
/// is another one, as long as no inertia makes up for it by rotations that are noise.
#[test]
fn an_inverted_load_cell_under_three_mountings() {
    let folder = recorded("models/uniaxial-remounted.toml");
    let clean = Setup::read(&folder.path().join("setup.toml")).unwrap();
    for cell in [2, 5, 8, 11] {
        let name = format!("`{}`", clean.load_cells[cell].channel);
        let mut setup = clean.clone();
        setup.load_cells[cell].scale = -1.0;
        let findings = examine(&setup);
        let [suspect] = findings.suspects.as_slice() else {
            panic!("{name}: {findings:?}");
        };
        let best = &suspect.explanations[0].text;
        assert_eq!(*best, format!("{name} has the other sign"));
    }
}

/// The satellite's set-up with the readings of one run changed, channel by channel, in a file of their own.
fn spoilt(folder: &Path, name: &str, change: impl Fn(&str, f64) -> f64) -> Setup {
    let mut setup = setup();
    let run = setup.runs.iter_mut().find(|run| run.name == name).unwrap();
    let text = std::fs::read_to_string(SATELLITE.path().join(&run.recording)).unwrap();
    let mut lines = text.lines();
    let header = lines.next().unwrap();
    let channels: Vec<&str> = header.split(',').collect();
    let mut changed = header.to_owned();
    for line in lines {
        let values = line.split(',').zip(&channels);
        let values = values.map(|(x, channel)| change(channel, x.parse().unwrap()).to_string());
        changed.push('\n');
        changed.push_str(&values.collect::<Vec<_>>().join(","));
    }
    run.recording = folder.join("changed.csv");
    run.checksum = None;
    std::fs::write(&run.recording, changed).unwrap();
    setup
}

/// Cables that were exchanged, amplifiers that were set anew and a specimen that was changed between two runs are a fault of no
/// sensor.
#[test]
fn a_fault_of_one_run_is_said_of_that_run() {
    let of = |which: &'static str, factor: f64| {
        move |channel: &str, x: f64| {
            if channel.starts_with(which) {
                factor * x
            } else {
                x
            }
        }
    };
    let in_g = |channel: &str, x: f64| match channel.starts_with("cell") || channel == "drive" {
        true => x,
        false => x / 9.80665,
    };
    type Change = Box<dyn Fn(&str, f64) -> f64>;
    let cases: [(&str, Change, &str); 5] = [
        (
            "about X",
            Box::new(in_g),
            "in it all accelerometers are in g",
        ),
        (
            "about X",
            Box::new(of("cell", -1.0)),
            "in it all load cells, or all accelerometers, have the other sign",
        ),
        (
            "about X",
            Box::new(of("base1.z", -1.0)),
            "in it `base1.z` has the other sign",
        ),
        (
            "about X",
            Box::new(of("cell1.z", -1.0)),
            "in it `cell1.z` has the other sign",
        ),
        // No usual factor: another specimen.
        (
            "Z",
            Box::new(of("cell", 1.5)),
            "kg, and they say 799.9 kg; compare its units, gains and specimen with theirs",
        ),
    ];
    for (run, change, words) in cases {
        let folder = tempfile::tempdir().unwrap();
        let findings = examine(&spoilt(folder.path(), run, change));
        let [one] = findings.whole.as_slice() else {
            panic!("{words}: {findings:?}");
        };
        assert_eq!(one.fault, WholeFault::RunApart);
        let begins = format!("run \"{run}\" contradicts the others");
        assert!(one.text.starts_with(&begins), "{one:?}");
        assert!(one.text.contains(words), "{words}: {one:?}");
        assert!(findings.suspects.is_empty(), "{words}: {findings:?}");
        assert!(
            !findings.clean() && !findings.more_is_wrong(),
            "{findings:?}"
        );
    }
}

/// A mounting whose rotation has the wrong sign, or is a quarter of a turn off, makes sensors on the structure seem inverted,
/// which a sensor that is does not make of a mounting.
#[test]
fn a_specimen_that_stood_otherwise_than_stated() {
    let folder = recorded("models/uniaxial-remounted.toml");
    let clean = Setup::read(&folder.path().join("setup.toml")).unwrap();
    assert_eq!(clean.runs[1].rotation, [89.7, 0.4, 0.0]);
    for (stated, expected) in [
        ([-89.7, -0.4, 0.0], "`rotation = [89.7, 0.4, 0]`"),
        // Three quarters of a turn too many are one too few.
        ([0.3, 0.3, 0.0], "`rotation = [90"),
    ] {
        let mut setup = clean.clone();
        setup.runs[1].rotation = stated;
        let findings = examine(&setup);
        let [one] = findings.whole.as_slice() else {
            panic!("{findings:?}");
        };
        assert_eq!(one.fault, WholeFault::RunApart);
        assert!(
            one.text.starts_with("run \"on its side\" contradicts"),
            "{one:?}"
        );
        assert!(one.text.contains(expected), "{one:?}");
    }
    let mut setup = clean.clone();
    accelerometer(&mut setup, "tank.y").scale = -1.0;
    assert_eq!(named(&setup).1, "`tank.y` has the other sign");
}

/// The satellite has 800 kg. One equation of a hundred hardly shows in their sum, and refuses the numbers all the same.
#[test]
fn a_mass_that_was_weighed_ten_percent_off() {
    for (weighed, wrong) in [(880.0, true), (720.0, true), (808.0, false)] {
        let mut setup = setup();
        setup.known_mass = Some(weighed);
        let findings = examine(&setup);
        assert!(findings.suspects.is_empty(), "{findings:?}");
        assert_eq!(findings.clean(), !wrong, "{findings:?}");
        for one in &findings.whole {
            assert_eq!(one.fault, WholeFault::Weighed);
            assert!(one.text.starts_with("nothing but `known_mass`"), "{one:?}");
        }
    }
}

/// Exit code 1 where nothing can be answered, and the lines on stdout.
#[test]
fn the_command_refuses_what_it_names() {
    let folder = recorded("models/satellite.toml");
    let path = folder.path().join("setup.toml");
    let clean = std::fs::read_to_string(&path).unwrap();
    let after = |channel: &str, key: &str| {
        let entry = format!("channel = \"{channel}\"\n");
        assert!(clean.contains(&entry), "{channel}");
        clean.replacen(&entry, &format!("{entry}{key}\n"), 1)
    };
    let mut reversed = clean.clone();
    for corner in 1..=4 {
        for axis in ["x", "y", "z"] {
            let entry = format!("channel = \"cell{corner}.{axis}\"\n");
            reversed = reversed.replacen(&entry, &format!("{entry}scale = -1.0\n"), 1);
        }
    }
    let cases = [
        (
            after("base2.y", "scale = -1.0"),
            "`base2.y` has the other sign",
        ),
        (
            after("cell1.z", "scale = -1.0"),
            "`cell1.z` has the other sign",
        ),
        (reversed, "all load cells, or all accelerometers"),
    ];
    for (text, words) in cases {
        std::fs::write(&path, text).unwrap();
        for command in ["check", "identify"] {
            let output = bench::massline(folder.path(), [command, "setup.toml"]);
            assert_eq!(output.code, Some(1), "{command}: {words}");
            let said = output.stdout + &output.stderr;
            assert!(said.contains(words), "{command}: {said}");
            assert_eq!(said.contains("scale = 1"), command == "check", "{said}");
        }
    }
    // Positions in another unit leave every number but the mass wrong, and the mass itself consistent.
    let metres = clean.replace("reference_point", "length_unit = \"m\"\nreference_point");
    for (factor, words) in [
        (1000.0, "positions are in millimetres"),
        (0.001, "positions are too small"),
    ] {
        let scaled = |line: &str| match line.strip_prefix("position = [") {
            Some(numbers) => {
                let numbers = numbers.trim_end_matches(']').split(", ");
                let scaled = numbers.map(|x| (factor * x.parse::<f64>().unwrap()).to_string());
                format!("position = [{}]", scaled.collect::<Vec<_>>().join(", "))
            }
            None => line.to_owned(),
        };
        let lines: Vec<String> = metres.lines().map(scaled).collect();
        std::fs::write(&path, lines.join("\n")).unwrap();
        for command in ["check", "identify"] {
            let output = bench::massline(folder.path(), [command, "setup.toml"]);
            assert_eq!(output.code, Some(1), "{command} {factor}");
            let said = output.stdout + &output.stderr;
            assert!(said.contains(words), "{command}: {said}");
            let refused = said.contains("no body has the density");
            assert_eq!(refused, command == "identify", "{command}: {said}");
        }
    }
}

/// Before the test: what six axes leave, and what one axis leaves beside it.
#[test]
fn what_a_test_will_not_tell_is_said_before() {
    let folder = recorded("models/satellite.toml");
    std::fs::remove_dir_all(folder.path().join("none")).ok();
    for entry in std::fs::read_dir(folder.path()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "csv") {
            std::fs::remove_file(path).unwrap();
        }
    }
    let untold = |arguments: &[&str]| -> Vec<String> {
        let all = [&["check", "setup.toml", "--plan", "--json"], arguments].concat();
        let output = bench::massline(folder.path(), all);
        assert_eq!(output.code, Some(0));
        let document: serde_json::Value = serde_json::from_str(&output.stdout).unwrap();
        assert_eq!(document["schema"], "massline/check-plan/1");
        serde_json::from_value(document["untold"].clone()).unwrap()
    };
    let lines = [
        "`cell1.x`, `cell2.x`",
        "`cell1.y`, `cell4.y`",
        "`cell2.y`, `cell3.y`",
        "`cell3.x`, `cell4.x`",
    ];
    let six = untold(&[]);
    for pair in lines {
        let both = |line: &String| pair.split(", ").all(|name| line.contains(name));
        assert!(six.iter().any(both), "{pair}: {six:?}");
    }
    assert!(
        six.iter().all(|line| line.starts_with("which is which")),
        "{six:?}"
    );
    let along = untold(&["--axes", "z"]);
    let parallel = "which is which of `base1.z`, `base2.z`, `base3.z`, `base4.z`";
    assert!(
        along.iter().any(|line| line.starts_with(parallel)),
        "{along:?}"
    );
    assert!(
        along
            .iter()
            .any(|l| l.starts_with("the gain of") && l.contains("`base1.x`")),
        "{along:?}"
    );
}
