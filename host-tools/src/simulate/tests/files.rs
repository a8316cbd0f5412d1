//! Model files, good and bad, and what a simulation leaves on the disk.

use super::*;
use crate::recording::Checksum;

#[test]
fn every_example_simulates() {
    for (name, runs, modes) in [
        ("satellite.toml", 6, 4),
        ("three-rotations.toml", 3, 4),
        ("three-translations.toml", 3, 4),
        ("uniaxial-remounted.toml", 3, 4),
        ("rigid-body.toml", 6, 0),
        ("tuning-fork.json", 3, 6),
    ] {
        let model = Model::read(&example(name)).unwrap();
        let options = Options {
            duration: Some(4.0),
            noise: Some(0.01),
            ..Options::default()
        };
        let simulation = run(&model, &options);
        assert_eq!(simulation.recordings.len(), runs, "{name}");
        // The setup that is written passes its own checks.
        Setup::from_str(&simulation.setup.to_toml(), "setup.toml".as_ref()).unwrap();
        let below_rate = simulation
            .truth
            .modes
            .iter()
            .filter(|m| m.frequency < 500.0);
        assert_eq!(below_rate.count(), modes, "{name}");
        let truth = &simulation.truth;
        if name != "tuning-fork.json" {
            for product in [
                truth.inertia_cg.xy,
                truth.inertia_cg.xz,
                truth.inertia_cg.yz,
            ] {
                assert!(product.unwrap() != 0.0);
            }
        }
    }
}

/// The formats as documented are the formats as read.
#[test]
fn documented_formats_are_read() {
    let readme = include_str!("../../../models/README.md");
    let block = |language: &str| {
        let (_, rest) = readme.split_once(&format!("```{language}\n")).unwrap();
        rest.split_once("```").unwrap().0
    };
    let toml: String = block("toml")
        .lines()
        .filter(|line| !line.starts_with("extends"))
        .map(|line| format!("{line}\n"))
        .collect();
    let model = Model::from_toml(&toml, "README.md".as_ref()).unwrap();
    assert_eq!((model.runs.len(), model.load_cells.len()), (2, 3));
    assert!(run(&model, &Options::default()).setup.processing.is_some());
    let beam = Model::from_json(block("json"), "README.md".as_ref()).unwrap();
    assert_eq!(beam.specimen.modes.len(), 3);
}

#[test]
fn truth_follows_from_the_parts() {
    let model = small_with("title = \"Small\"", "reference_point = [0.1, 0.0, 0.0]");
    let truth = run(&model, &Options::default()).truth;
    // 10 kg at (0.01, 0.02, 0.10) and 1 kg at (0.05, 0, 0.2).
    assert!((truth.mass - 11.0).abs() < 1e-13);
    for (found, expected) in truth.centre_of_gravity.iter().zip([0.15, 0.2, 1.2]) {
        assert!((found.unwrap() - expected / 11.0).abs() < 1e-15);
    }
    // About A at (0.1, 0, 0): the products of two points and the block's own 0.002.
    let product = 0.002 + 10.0 * (-0.09 * 0.02) + 1.0 * (-0.05 * 0.0);
    assert!((truth.inertia_reference.xy.unwrap() - product).abs() < 1e-14);
    let moment = 0.06 + 10.0 * (0.09_f64.powi(2) + 0.1 * 0.1) + (0.05 * 0.05 + 0.2 * 0.2);
    assert!((truth.inertia_reference.yy.unwrap() - moment).abs() < 1e-14);
    // u_z = y α - x β, so that L = (0, 0, 1, y, -x, 0), with x = -0.05 and y = 0 from A.
    let effective = truth.modes[0].effective_mass;
    assert!((effective[2][2] - 1.0).abs() < 1e-15);
    assert!((effective[2][4] - 0.05).abs() < 1e-15);
    assert!((effective[4][4] - 0.0025).abs() < 1e-15);
}

#[test]
fn what_is_written_reads_back() {
    let folder = std::env::temp_dir().join(format!("massline-simulate-{}", std::process::id()));
    let options = Options {
        weighed: true,
        ..Options::default()
    };
    let simulation = run(&small(), &options);
    let path = simulation.write(&folder.join("deep")).unwrap();
    let setup = Setup::read(&path).unwrap();
    assert_eq!(setup.known_mass, Some(simulation.truth.mass));
    assert_eq!(setup.folder, folder.join("deep"));
    assert_eq!(setup.accelerometers, simulation.setup.accelerometers);
    let mut runs = simulation.setup.runs.clone();
    for run in &mut runs {
        let file = setup.recording_path(run);
        run.checksum = Some(Checksum::of_file(&file).unwrap());
    }
    assert_eq!(setup.runs, runs);

    let recording = &simulation.recordings[0];
    let text = std::fs::read_to_string(setup.recording_path(&setup.runs[0])).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next().unwrap(), recording.channels.join(","));
    for (row, line) in lines.enumerate() {
        for (column, cell) in line.split(',').enumerate() {
            let number: f32 = cell.parse().unwrap();
            assert_eq!(number.to_bits(), recording.samples[column][row].to_bits());
        }
    }
    let truth = std::fs::read_to_string(folder.join("deep").join("truth.json")).unwrap();
    let truth: serde_json::Value = serde_json::from_str(&truth).unwrap();
    assert_eq!(truth["mass"].as_f64(), Some(simulation.truth.mass));
    std::fs::remove_dir_all(&folder).unwrap();

    let blocked = simulation.write("/dev/null/folder".as_ref()).unwrap_err();
    assert!(blocked.to_string().contains("/dev/null/folder"));
}

#[test]
fn file_names_suit_every_file_system() {
    let mut taken = BTreeSet::new();
    assert_eq!(file_name("lateral X", &mut taken), "lateral-x.csv");
    assert_eq!(file_name("Lateral: x?", &mut taken), "lateral-x-2.csv");
    assert_eq!(file_name("../../etc", &mut taken), "etc.csv");
    assert_eq!(file_name("äß", &mut taken), "run.csv");
    assert_eq!(file_name("", &mut taken), "run-2.csv");
}

#[test]
fn extending_hides_whole_sections() {
    let base = Model::read(&example("satellite.toml")).unwrap();
    let child = Model::read(&example("three-translations.toml")).unwrap();
    assert_eq!(child.specimen, base.specimen);
    assert_eq!(child.runs[..], base.runs[..3]);
    assert_eq!(child.table.axes, [true, true, true, false, false, false]);
    assert_ne!(child.title, base.title);
}

/// Wrong changes of the small model, each with words of its message; `\n` ends a line.
const MISTAKES: &str = r#"
title = "Small" => title => small.toml, line 2 | not TOML
mass = 10.0 => mass = -10.0 => line 6 | `mass` is -10
mass = 10.0\n => => [[body]] 1 (name "block") | `mass` is missing
xx = 0.05 => xx = 0.5 => line 8 | principal moments
xx = 0.05 => xxx = 0.05 => did you mean `xx`?
direction = [0, 0, 2] => direction = [0, 0, 0] => zero vector
name = "board" => name = "block" => [[body]] 1 | another
on = "board" => on = "bord" => did you mean `board`?
name = "board.z" => name = "base.x" => "base.x" | [[accelerometer]] 1
name = "board.z" => name = "drive" => the drive signal
[table] => [table]\naxes = ["x", "w"] => a list with "w" | "rx"
[table] => [table]\naxes = ["x"] => `motion` | axis "z"
cross_talk = 0.02 => cross_talk = 2 => a share from 0 to 1
[2.0, 20.0] => [20.0, 2.0] => the lower first
[2.0, 20.0] => [2.0, 400.0] => ends at 252 Hz
motion = [0, 0, 1, 0, 0, 0] => => [[run]] 1 | either `motion`
motion = [0, 0, 1, 0, 0, 0] => motion = [0, 1] => a list of 2 values
motion = [0, 0, 1, 0, 0, 0] => poses = [[0, 1]] => lists of 3
motion = [0, 0, 1, 0, 0, 0] => drive = 1 => `drive` is the integer 1 | true or false
title = "Small" => extends = "no-such.toml" => no-such.toml
"#;

#[test]
fn every_mistake_is_located_and_explained() {
    let refused = |text: &str| {
        let model = Model::from_toml(text, "small.toml".as_ref());
        model.expect_err("must be refused").to_string()
    };
    for case in MISTAKES.trim().lines() {
        let case = case.replace("\\n", "\n");
        let [from, to, parts] = case.split("=>").collect::<Vec<_>>()[..] else {
            panic!("{case}");
        };
        let [from, to] = [from, to].map(|text| text.trim_matches(' '));
        let message = refused(&text_with(from, to));
        for part in parts.split('|').map(str::trim) {
            assert!(message.contains(part), "«{part}» is not in: {message}");
        }
    }
    assert!(refused("").contains("there is no [[body]]"));
}

#[test]
fn a_file_that_extends_itself_ends() {
    let folder = std::env::temp_dir().join(format!("massline-extends-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("self.toml");
    std::fs::write(&file, "extends = \"self.toml\"").unwrap();
    let message = Model::read(&file).unwrap_err().to_string();
    assert!(message.contains("more than 8 files"), "{message}");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn broken_beams_are_refused() {
    let good = include_str!("../../../models/tuning-fork.json");
    for (from, to, part) in [
        ("\"base_node\": 0", "\"base_node\": 99", "node 99"),
        ("\"n2\": 22", "\"n2\": 23", "element 22 refers to node 23"),
        (
            "\"n2\": 22",
            "\"n2\": 20",
            "no chain of elements joins node 22",
        ),
        (
            "\"rho\": 7850.0",
            "\"rho\": -1",
            "the rho of element 1 is -1",
        ),
        ("\"dir\": \"x\"", "\"dir\": \"y\"", "line"),
        ("\"zeta\": 0.01", "\"zeta\": -0.01", "the zeta"),
        ("\"base_node\": 0", "\"base_node\": 1", "base plate"),
        ("\"A\": 0.00020860971648049349", "\"A\": 1e300", "singular"),
    ] {
        assert!(good.contains(from), "{from}");
        let message = Model::from_json(&good.replacen(from, to, 1), "fork.json".as_ref())
            .expect_err("must be refused")
            .to_string();
        assert!(message.contains(part), "«{part}» is not in: {message}");
        assert!(message.starts_with("fork.json"), "{message}");
    }
    let message = Model::read("fork.xml".as_ref()).unwrap_err().to_string();
    assert!(message.contains(".toml"));
}
