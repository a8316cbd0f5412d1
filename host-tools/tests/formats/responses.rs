//! Frequency responses and nodes in universal files.

use crate::bench::{Bench, RECORDINGS, massline};
use massline::recording::Recording;
use std::io::Read;
use std::path::Path;

/// Form of a dataset 58.
#[derive(Clone, Copy)]
struct Form {
    even: bool,
    binary: bool,
}

/// A response: channel, node, direction, unit that it is divided by.
#[derive(Clone, Copy)]
struct Response<'a> {
    name: &'a str,
    node: i64,
    direction: i64,
    per: &'a str,
}

fn set(response: Response<'_>, frequencies: &[f64], values: &[[f64; 2]], form: Form) -> Vec<u8> {
    let Response {
        name,
        node,
        direction,
        per,
    } = response;
    let size = if form.even { 16 } else { 20 } * values.len();
    let mut out = b"    -1\n    58".to_vec();
    if form.binary {
        out.extend(
            format!("b     1     2          11{size:12}     0     0           0           0")
                .bytes(),
        );
    }
    let step = if form.even {
        frequencies[1] - frequencies[0]
    } else {
        0.0
    };
    let axis =
        |kind: i64, unit: &str| format!("{kind:10}    0    0    0 {:<20} {unit:<20}", "NONE");
    let lines = [
        String::new(),
        name.to_owned(),
        "NONE".to_owned(),
        "NONE".to_owned(),
        "run 1".to_owned(),
        "NONE".to_owned(),
        format!(
            "    4         0    0         0 NONE      {node:10}{direction:4} NONE              99   3"
        ),
        format!(
            "         6{:10}{:10}{:13.5e}{step:13.5e}{:13.5e}",
            values.len(),
            u8::from(form.even),
            frequencies[0],
            0.0
        ),
        axis(18, "Hz"),
        axis(12, "NONE"),
        axis(0, per),
        axis(0, "NONE"),
        String::new(),
    ];
    out.extend(lines.join("\n").bytes());
    for (frequency, value) in frequencies.iter().zip(values) {
        if form.binary {
            if !form.even {
                out.extend((*frequency as f32).to_le_bytes());
            }
            out.extend(value.iter().flat_map(|x| x.to_le_bytes()));
        } else {
            if !form.even {
                out.extend(format!("{frequency:13.5e}").bytes());
            }
            out.extend(format!("{:20.12e}{:20.12e}\n", value[0], value[1]).bytes());
        }
    }
    out.extend(b"    -1\n");
    out
}

/// Responses of a run: names of the channels, frequencies, values channel by channel.
struct Run {
    names: Vec<String>,
    frequencies: Vec<f64>,
    values: Vec<Vec<[f64; 2]>>,
}

/// The noise-free responses of the fork to its three drives.
fn runs() -> [Run; 3] {
    let file =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/fork/frf-noise-free.csv.gz");
    let mut text = String::new();
    let file = std::fs::File::open(file).unwrap();
    flate2::read::GzDecoder::new(file)
        .read_to_string(&mut text)
        .unwrap();
    let mut lines = text.lines();
    let heads: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    let of = |drive: &str| {
        let end = format!("_{drive}_re");
        let columns = heads.iter().enumerate();
        let columns =
            columns.filter_map(|(c, head)| Some((c, head.strip_suffix(&end)?.to_owned())));
        let (places, names): (Vec<usize>, Vec<String>) = columns.unzip();
        Run {
            names,
            frequencies: rows.iter().map(|row| row[0]).collect(),
            values: places
                .iter()
                .map(|&c| rows.iter().map(|row| [row[c], row[c + 1]]).collect())
                .collect(),
        }
    };
    let mut drives: Vec<&str> = heads
        .iter()
        .filter_map(|head| head.strip_prefix("a1_")?.strip_suffix("_re"))
        .collect();
    drives.dedup();
    [0, 1, 2].map(|k| of(drives[k]))
}

/// The fork by stepped sines, whose recordings are written in some form.
fn stepped(form: impl Fn(&Run) -> Vec<u8>) -> Bench {
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/fork/setup.toml");
    let text = std::fs::read_to_string(fixture).unwrap();
    let mut setup = text[..text.find("[[run]]").unwrap()].to_owned();
    for name in RECORDINGS {
        setup +=
            &format!("[[run]]\nname = \"{name}\"\nrecording = \"{name}\"\nexcitation = \"sine\"\n");
    }
    let bench = Bench::fork().write("setup.toml", setup);
    let offered = |bench: Bench, (name, run): (&&str, &Run)| bench.write(name, form(run));
    RECORDINGS.iter().zip(&runs()).fold(bench, offered)
}

fn csv(run: &Run) -> Vec<u8> {
    let heads = run.names.iter().map(|name| format!(",{name}.re,{name}.im"));
    let mut text = format!("frequency{}\n", heads.collect::<String>());
    for (line, frequency) in run.frequencies.iter().enumerate() {
        let values = run
            .values
            .iter()
            .map(|v| format!(",{},{}", v[line][0], v[line][1]));
        text += &format!("{frequency}{}\n", values.collect::<String>());
    }
    text.into_bytes()
}

/// Node and direction of no channel: names are the first lines.
fn uff(run: &Run, form: Form, per: impl Fn(&str) -> &'static str) -> Vec<u8> {
    let sets = run
        .names
        .iter()
        .zip(&run.values)
        .flat_map(|(name, values)| {
            let response = Response {
                name,
                node: 0,
                direction: 0,
                per: per(name),
            };
            set(response, &run.frequencies, values, form)
        });
    sets.collect()
}

const EVEN: Form = Form {
    even: true,
    binary: false,
};

/// Thirteen digits have the nine of the responses, and frequencies are whole halves: all bits stay.
#[test]
fn responses_in_universal_files_give_the_same_numbers() {
    let expected = stepped(csv).identify(&["--json"]);
    assert_eq!(expected.code, Some(0), "{expected:?}");
    for (even, binary) in [(true, false), (false, false), (true, true), (false, true)] {
        let form = Form { even, binary };
        let found = stepped(|run| uff(run, form, |_| "V")).identify(&["--json"]);
        assert_eq!(found.code, Some(0), "{found:?}");
        assert_eq!(found.stdout, expected.stdout);
    }
    // pyuff states the length of the real parts.
    for even in [true, false] {
        let form = Form { even, binary: true };
        let short = |run: &Run| {
            let size = if even { 16 } else { 20 } * run.frequencies.len();
            let right = format!("          11{size:12}").into_bytes();
            let wrong = format!("          11{:12}", 8 * run.frequencies.len()).into_bytes();
            let mut file = uff(run, form, |_| "V");
            let places: Vec<usize> = (0..file.len() - right.len())
                .filter(|&at| file[at..].starts_with(&right))
                .collect();
            assert_eq!(places.len(), run.names.len());
            for at in places {
                file[at..at + wrong.len()].copy_from_slice(&wrong);
            }
            file
        };
        let found = stepped(short).identify(&["--json"]);
        assert_eq!(found.stdout, expected.stdout, "{}", found.stderr);
    }
    // An analyser's line at 0 Hz.
    let with_zero = |run: &Run| {
        let mut run = Run {
            names: run.names.clone(),
            frequencies: run.frequencies.clone(),
            values: run.values.clone(),
        };
        run.frequencies.insert(0, 0.0);
        run.values.iter_mut().for_each(|v| v.insert(0, [7.0, 0.0]));
        uff(&run, EVEN, |_| "V")
    };
    let found = stepped(with_zero).identify(&["--json"]);
    assert_eq!(found.stdout, expected.stdout, "{}", found.stderr);
}

#[test]
fn responses_that_do_not_belong_together_are_refused() {
    let other = |name: &str| if name == "a3" { "mV" } else { "V" };
    stepped(|run| uff(run, EVEN, other)).refused_input(
        "lateral-x.csv, line … channel `a3.re`: a response per mV, expected a response per V as the other channels have; … one drive",
    );
    let short = |run: &Run| {
        let sets = run
            .names
            .iter()
            .zip(&run.values)
            .flat_map(|(name, values)| {
                let response = Response {
                    name,
                    node: 0,
                    direction: 0,
                    per: "V",
                };
                let count = if name == "a3" { 300 } else { values.len() };
                set(response, &run.frequencies, &values[..count], EVEN)
            });
        sets.collect()
    };
    stepped(short).refused_input(
        "lateral-x.csv, line … channel `a3.re`: 300 points every 0.5 Hz from 0.5 Hz on, expected 400 points",
    );
    let cut = |run: &Run| {
        let mut file = uff(run, EVEN, |_| "V");
        // Within the tenth of eighteen sets.
        file.truncate(file.len() / 2 + 2000);
        file
    };
    stepped(cut).refused_input("lateral-x.csv, line … the file ends within its data");
}

/// Names tell the reference where there are several.
#[test]
fn responses_to_several_references_have_names_of_both() {
    let response = |direction| Response {
        name: "NONE",
        node: 12,
        direction,
        per: "N",
    };
    let values = [[1.0, -1.0], [2.0, -2.0]];
    let of = |reference: &str| -> Vec<u8> {
        let sets = [3, -1].map(|d| set(response(d), &[1.0, 2.0], &values, EVEN));
        let text = String::from_utf8(sets.concat()).unwrap();
        text.replace("99   3", reference).into_bytes()
    };
    let folder = tempfile::tempdir().unwrap();
    let names = |bytes: Vec<u8>| {
        let file = folder.path().join("x.unv");
        std::fs::write(&file, bytes).unwrap();
        let recording = Recording::open(&file, &[]).unwrap();
        let all = recording.in_file().iter().map(|c| c.name.clone());
        all.collect::<Vec<_>>()
    };
    let one = ["12:+Z.re", "12:+Z.im", "12:-X.re", "12:-X.im", "frequency"];
    assert_eq!(names(of("99   3")), one);
    let several = names([of("99   3"), of("98  -2")].concat());
    assert_eq!(several[..2], ["12:+Z/99:+Z.re", "12:+Z/99:+Z.im"]);
    assert_eq!(several[6], "12:-X/98:-Y.re");
}

/// The numbers of our own export are read as they stand there.
#[test]
fn our_own_responses_come_back() {
    let bench = Bench::fork();
    let finished = bench.identify(&["--export", "out.uff"]);
    assert_eq!(finished.code, Some(0), "{finished:?}");
    let text = std::fs::read_to_string(bench.file("out.uff")).unwrap();
    let sets: Vec<&str> = text.split("    -1\n    58\n").skip(1).collect();
    assert!(sets.len() > 9, "{} sets", sets.len());
    for set in sets {
        let lines: Vec<&str> = set.lines().collect();
        let name = format!("{} ({})", lines[0].trim(), lines[3].trim());
        let numbers = lines[11..].iter().flat_map(|line| line.split_whitespace());
        let expected: Vec<f64> = numbers.filter_map(|x| x.parse().ok()).collect();
        // The delimiter is a number as well.
        let expected = &expected[..expected.len() - 1];
        let channels = ["re", "im"].map(|part| format!("{name}.{part}"));
        let wanted = channels.each_ref().map(String::as_str);
        let mut recording = Recording::open(&bench.file("out.uff"), &wanted).unwrap();
        let (mut found, mut row) = (Vec::new(), [0.0; 2]);
        while recording.next_row_f64(|c, x| row[c] = x).unwrap() {
            found.extend(row);
        }
        assert_eq!(found, expected, "{name}");
    }
}

/// Nodes tell where sensors are, in the units of the dataset 164 above them.
#[test]
fn nodes_are_the_places_of_the_sensors() {
    let of_system = |code: &str, factors: &str| {
        format!(
            "    -1\n   164\n         {code}  units                  2\n{factors}\n  2.73150E+02\n    -1\n"
        )
    };
    let of_one = "    -1\n    15\n        12         0         0        11  6.00000E+02 -5.50000E+02  5.00000E+00\n    -1\n";
    let of_two = "    -1\n  2411\n        13         1         1        11\n   1.0000000000000000D+03   0.0000000000000000D+00  -2.5000000000000000D+02\n        14         1         7        11\n   1.0D+00   0.0D+00  -2.5D+00\n    -1\n";
    let histories = [12, 13, 14].map(|node| {
        let text = crate::write::set58(
            "NONE",
            node,
            -1,
            &[1.0, 2.0, 3.0],
            crate::write::Numbers::Double,
        );
        String::from_utf8(text).unwrap()
    });
    let own = "  1.00000E+03  1.00000E+00  1.00000E+00";
    for system in [of_system("5", own), of_system("9", own)] {
        let folder = tempfile::tempdir().unwrap();
        let file = [&system, of_one, of_two, &histories.concat()].concat();
        std::fs::write(folder.path().join("x.unv"), file).unwrap();
        let finished = massline(folder.path(), ["init", "x.unv"]);
        assert_eq!(finished.code, Some(0), "{finished:?}");
        let setup = std::fs::read_to_string(folder.path().join("setup.toml")).unwrap();
        for line in [
            "channel = \"12:-X\"\ntype = \"accelerometer\"\nposition = [0.6, -0.55, 0.005]\ndirection = \"-x\"",
            "channel = \"13:-X\"\ntype = \"accelerometer\"\nposition = [1.0, 0.0, -0.25]\ndirection = \"-x\"",
            "channel = \"14:-X in 7\"\ntype = \"accelerometer\"\nposition = [0.001, 0.0, -0.0025]\n# direction",
        ] {
            assert!(setup.contains(line), "{setup}");
        }
        // The rate is in the file.
        assert!(!setup.contains("# sample_rate"), "{setup}");
    }
}
