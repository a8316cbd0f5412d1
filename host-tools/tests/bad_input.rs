//! Bad input as a user meets it: the real binary refuses it in one sentence that says
//! where, what and what to do, with exit code 1 (the data do not allow an answer) or 2
//! (unreadable input).

mod bench;

use bench::{Bench, Finished, RECORDINGS};
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write;

/// The file most complaints are about, and its fourth accelerometer.
const X: &str = RECORDINGS[0];

/// Asserts a refusal: exit code, nothing on stdout, one line on stderr with these words.
#[track_caller]
fn refused(finished: &Finished, code: i32, words: &[&str]) {
    println!("{}", finished.stderr.trim_end());
    assert_eq!(finished.code, Some(code), "{}", finished.stderr);
    assert_eq!(finished.stdout, "");
    let line = finished.stderr.strip_prefix("error: ").unwrap();
    assert_eq!(line.lines().count(), 1, "one sentence: {line}");
    assert!(!line.contains('\u{1b}'), "colours without a terminal");
    assert!(!line.contains("panicked"));
    for word in words {
        assert!(line.contains(word), "«{word}» is not in: {line}");
    }
}

fn gzip(text: &str) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(text.as_bytes()).unwrap();
    encoder.finish().unwrap()
}

fn lines(text: &str, count: usize) -> String {
    text.lines().take(count).collect::<Vec<_>>().join("\n") + "\n"
}

/// With a column of times at `rate` samples per second, after some rows `late` samples off.
fn with_time(text: &str, rate: f64, late: usize) -> String {
    let mut rows = text.lines();
    let mut timed = format!("time,{}\n", rows.next().unwrap());
    for (row, line) in rows.enumerate() {
        let sample = if row < 1500 { row } else { row + late };
        timed += &format!("{:.6},{line}\n", sample as f64 / rate);
    }
    timed
}

#[test]
fn what_is_spoilt_below_was_good() {
    let finished = Bench::fork().identify(&[]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
}

#[test]
fn empty_file() {
    let finished = Bench::fork().write(X, "").identify(&[]);
    refused(&finished, 2, &[X, "the file is empty", "expected a header"]);
}

#[test]
fn empty_file_in_gzip() {
    let bench = Bench::fork()
        .setup(X, "x.csv.gz")
        .write("x.csv.gz", gzip(""));
    refused(
        &bench.identify(&[]),
        2,
        &["x.csv.gz", "the file is empty", "expected a header"],
    );
}

#[test]
fn header_only() {
    let finished = Bench::fork().edit(X, |text| lines(text, 1)).identify(&[]);
    refused(
        &finished,
        2,
        &[X, "not one row of numbers", "export the recording again"],
    );
}

#[test]
fn no_header() {
    let finished = Bench::fork()
        .edit(X, |text| text.split_once('\n').unwrap().1.to_owned())
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            X,
            "line 1",
            "starts with the number",
            "put a line with the channel names",
        ],
    );
}

#[test]
fn missing_channel() {
    let finished = Bench::fork()
        .edit(X, |text| text.replacen(",a4,", ",A4,", 1))
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            X,
            "line 1",
            "there is no channel `a4`",
            "did you mean `A4`?",
        ],
    );
}

#[test]
fn missing_drive() {
    let finished = Bench::fork()
        .setup("reference = \"drive\"", "reference = \"generator\"")
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            X,
            "there is no channel `generator`",
            "columns without a sensor are drive",
            "correct",
        ],
    );
}

#[test]
fn duplicate_channel_in_the_recording() {
    let finished = Bench::fork()
        .edit(X, |text| text.replacen(",a4,", ",a5,", 1))
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            X,
            "line 1",
            "channel `a5` stands there twice, in columns 5 and 6",
            "rename one",
        ],
    );
}

#[test]
fn duplicate_channel_in_the_setup() {
    let finished = Bench::fork().setup("\"a4\"", "\"a5\"").identify(&[]);
    refused(
        &finished,
        2,
        &[
            "setup.toml, line ",
            "[[accelerometer]] 5",
            "channel \"a5\" belongs to [[accelerometer]] 4",
            "correct the name",
        ],
    );
}

#[test]
fn a_sensor_as_the_drive() {
    let finished = Bench::fork()
        .setup("reference = \"drive\"", "reference = \"a1\"")
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            "setup.toml, line ",
            "`reference` names \"a1\", which is a sensor",
            "leave `reference` out",
        ],
    );
}

/// Row 100 from 0 stands in line 102, below the header.
fn with_field(field: &str) -> Finished {
    let change = |row: usize, old: &str| {
        if row == 100 {
            field.to_owned()
        } else {
            old.to_owned()
        }
    };
    Bench::fork().channel(X, "a4", change).identify(&[])
}

#[test]
fn text_in_a_number() {
    refused(
        &with_field("1.2.3"),
        2,
        &[
            X,
            "line 102",
            "channel `a4`",
            "`1.2.3` is not a number",
            "decimal point",
        ],
    );
    refused(
        &with_field("off"),
        2,
        &[X, "line 102", "channel `a4`", "`off` is not a number"],
    );
    refused(
        &with_field(""),
        2,
        &[X, "line 102", "channel `a4`", "`` is not a number"],
    );
}

#[test]
fn nan() {
    refused(
        &with_field("NaN"),
        2,
        &[
            X,
            "line 102",
            "channel `a4`",
            "NaN is not a finite reading",
            "cut the recording",
        ],
    );
}

#[test]
fn infinity() {
    refused(
        &with_field("-inf"),
        2,
        &[
            X,
            "line 102",
            "channel `a4`",
            "-inf is not a finite reading",
            "cut the recording",
        ],
    );
    refused(
        &with_field("1e39"),
        2,
        &[
            X,
            "line 102",
            "channel `a4`",
            "1e39 is not a finite reading",
        ],
    );
}

#[test]
fn short_row() {
    let cut = |text: &str| {
        text.lines()
            .enumerate()
            .map(|(n, l)| {
                if n == 200 {
                    "1,2,3\n".to_owned()
                } else {
                    format!("{l}\n")
                }
            })
            .collect()
    };
    let finished = Bench::fork().edit(X, cut).identify(&[]);
    refused(
        &finished,
        2,
        &[
            X,
            "line 201",
            "3 fields where the header has 19",
            "cut the recording before this line",
        ],
    );
}

#[test]
fn wrong_sample_rate() {
    let finished = Bench::fork()
        .edit(X, |text| with_time(text, 256.0, 0))
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            X,
            "its time column says 256 samples per second, the setup says 512",
            "correct `sample_rate`",
        ],
    );
}

#[test]
fn no_sample_rate() {
    let finished = Bench::fork()
        .setup("sample_rate", "# sample_rate")
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            X,
            "no `time` column",
            "no `sample_rate`",
            "write `sample_rate`",
        ],
    );
}

#[test]
fn lost_samples() {
    // Two samples are gone before row 1500, which stands in line 1502.
    let finished = Bench::fork()
        .edit(X, |text| with_time(text, 512.0, 2))
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            X,
            "line 1502",
            "samples are missing or doubled",
            "record again",
        ],
    );
}

#[test]
fn runs_at_different_rates() {
    let finished = Bench::fork()
        .setup("sample_rate", "# sample_rate")
        .edit(X, |text| with_time(text, 512.0, 0))
        .edit(RECORDINGS[1], |text| with_time(text, 256.0, 0))
        .identify(&[]);
    refused(
        &finished,
        2,
        &[RECORDINGS[1], "256", "512", "record all runs at one rate"],
    );
}

#[test]
fn band_outside_the_spectrum() {
    let finished = Bench::fork()
        .setup(
            "averaging_band = [0.5, 26.0]",
            "averaging_band = [0.5, 300.0]",
        )
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            "setup.toml, line ",
            "[processing]",
            "`averaging_band` ends at 300 Hz",
            "the spectrum ends at 255 Hz",
            "lower the band",
        ],
    );
    let finished = Bench::fork()
        .setup("mode_band = [27.5, 48.5]", "mode_band = [27.5, 480.5]")
        .identify(&[]);
    refused(
        &finished,
        2,
        &["setup.toml, line ", "`mode_band` ends at 480.5 Hz"],
    );
}

#[test]
fn band_outside_the_spectrum_of_the_recording() {
    let finished = Bench::fork()
        .setup("sample_rate", "# sample_rate")
        .setup(
            "averaging_band = [0.5, 26.0]",
            "averaging_band = [0.5, 300.0]",
        )
        .edit(X, |text| with_time(text, 512.0, 0))
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            X,
            "`averaging_band` ends at 300 Hz",
            "the spectrum ends at 255 Hz",
            "lower the band",
        ],
    );
}

#[test]
fn band_with_fewer_than_three_lines() {
    let finished = Bench::fork()
        .setup(
            "averaging_band = [0.5, 26.0]",
            "averaging_band = [0.5, 1.2]",
        )
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            "setup.toml, line ",
            "`averaging_band` from 0.5 to 1.2 Hz holds 2 line",
            "at least three",
            "widen the band",
        ],
    );
}

#[test]
fn band_that_is_none() {
    let finished = Bench::fork()
        .setup(
            "averaging_band = [0.5, 26.0]",
            "averaging_band = [26.0, 0.5]",
        )
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            "setup.toml, line ",
            "`averaging_band` is [26, 0.5]",
            "the lower first",
        ],
    );
}

#[test]
fn zero_direction() {
    let finished = Bench::fork()
        .setup("direction = [1.0, 0.0, 0.0]", "direction = [0, 0, 0]")
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            "setup.toml, line ",
            "(channel \"a1\")",
            "`direction` is the zero vector",
            "for example [0, 0, 1]",
        ],
    );
}

#[test]
fn known_mass_of_zero_or_below() {
    for mass in ["0", "-0.63", "0.0"] {
        let finished = Bench::fork()
            .edit("setup.toml", |text| {
                let old = text.lines().find(|l| l.starts_with("known_mass")).unwrap();
                text.replace(old, &format!("known_mass = {mass}"))
            })
            .identify(&[]);
        refused(
            &finished,
            2,
            &[
                "setup.toml, line 3",
                "`known_mass` is ",
                "more than 0",
                "leave it out",
            ],
        );
    }
}

#[test]
fn sensors_that_leave_nothing_observable() {
    // Accelerations along x, forces along z: no equation holds both.
    let finished = Bench::fork().only(&["a1", "fz"]).identify(&[]);
    refused(
        &finished,
        1,
        &[
            "the accelerometers see ax",
            "the load cells measure fz",
            "nothing of the ten",
            "add load cells",
        ],
    );
    let finished = Bench::fork().only(&["a1"]).identify(&[]);
    refused(
        &finished,
        2,
        &[
            "setup.toml",
            "there is no [[load_cell]]",
            "add at least one",
            "no force is known",
        ],
    );
    let finished = Bench::fork().only(&["fx", "fz", "ty"]).identify(&[]);
    refused(
        &finished,
        2,
        &[
            "setup.toml",
            "there is no [[accelerometer]]",
            "add at least one",
            "no motion is known",
        ],
    );
}

fn constant_everywhere(channel: &str, reading: &str) -> Finished {
    let mut bench = Bench::fork();
    for file in RECORDINGS {
        bench = bench.channel(file, channel, |_, _| reading.to_owned());
    }
    bench.identify(&[])
}

#[test]
fn dead_channel() {
    let repair =
        "the sensor is dead or unplugged: repair it and record again, or take it out of the setup";
    // a1 is the only interface accelerometer along x, fx the only force along x, and the
    // other accelerometers have neighbours that look their way.
    for channel in ["a1", "a2", "a6", "fx", "ty"] {
        for reading in ["0.0", "0.01"] {
            let words = [
                X,
                &format!("channel `{channel}`"),
                &format!("it reads {} throughout", reading.trim_end_matches(".0")),
                repair,
            ];
            refused(&constant_everywhere(channel, reading), 1, &words);
        }
    }
}

#[test]
fn channel_that_dies_between_runs() {
    let finished = Bench::fork()
        .channel(RECORDINGS[1], "a1", |_, _| "0.0".to_owned())
        .channel(RECORDINGS[2], "a1", |_, _| "0.0".to_owned())
        .identify(&[]);
    refused(
        &finished,
        1,
        &[
            RECORDINGS[1],
            "channel `a1`",
            "it reads 0 throughout",
            "repair it",
        ],
    );
}

#[test]
fn dead_drive() {
    let finished = Bench::fork()
        .channel(X, "drive", |_, _| "0.0".to_owned())
        .identify(&[]);
    refused(
        &finished,
        1,
        &[
            X,
            "channel `drive`",
            "nothing can be referred to it",
            "check the generator's cable",
        ],
    );
}

#[test]
fn clipped_channel() {
    let stop = |_: usize, field: &str| {
        let reading: f64 = field.parse().unwrap();
        reading.clamp(-1.5, 1.5).to_string()
    };
    let finished = Bench::fork().channel(X, "a1", stop).identify(&[]);
    refused(
        &finished,
        1,
        &[
            X,
            "channel `a1`",
            "samples sit at 1.5",
            "the signal is clipped",
            "lower the gain",
        ],
    );
}

#[test]
fn runs_that_are_copies_of_each_other() {
    let same = "runs \"lateral X\" and \"lateral Z\" hold the very same samples";
    // Named twice.
    let finished = Bench::fork().setup(RECORDINGS[1], X).identify(&[]);
    refused(&finished, 1, &[same, "give each run its own"]);
    // Copied under another name and exported anew, so that the texts differ.
    let bench = Bench::fork();
    let text = std::fs::read_to_string(bench.file(X))
        .unwrap()
        .replace(',', ", ");
    refused(
        &bench.write(RECORDINGS[1], text).identify(&[]),
        1,
        &[same, "give each run its own"],
    );
}

#[test]
fn too_short_a_recording() {
    let finished = Bench::fork()
        .edit(X, |text| lines(text, 1000))
        .identify(&[]);
    refused(
        &finished,
        1,
        &[X, "999 samples give 0 block(s) of 1024", "record longer"],
    );
}

#[test]
fn files_that_are_not_there() {
    let finished = Bench::fork().setup(X, "lateral-y.csv").identify(&[]);
    refused(
        &finished,
        2,
        &["lateral-y.csv", "cannot be read", "check the `recording`"],
    );
    let finished = Bench::fork().setup(X, ".").identify(&[]);
    refused(
        &finished,
        2,
        &["cannot be read", "directory", "check the `recording`"],
    );
    let bench = Bench::fork();
    let finished = bench::massline(bench.path(), ["identify", "nowhere.toml"]);
    refused(
        &finished,
        2,
        &["nowhere.toml", "cannot be read", "check the path"],
    );
}

#[test]
fn files_of_another_kind() {
    let bench = Bench::fork();
    let text = std::fs::read_to_string(bench.file(X)).unwrap();
    let finished = bench.write(X, gzip(&text)).identify(&[]);
    refused(
        &finished,
        2,
        &[
            X,
            "line 1",
            "compressed by gzip",
            "let its name end in .csv.gz",
        ],
    );
    let utf16: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let finished = Bench::fork()
        .write(X, [&[0xff, 0xfe], utf16.as_slice()].concat())
        .identify(&[]);
    refused(&finished, 2, &[X, "line 1", "UTF-16", "save it as UTF-8"]);
    let finished = Bench::fork().write(X, text.replace(',', ";")).identify(&[]);
    refused(
        &finished,
        2,
        &[X, "line 1", "separated by semicolons", "with commas"],
    );
    let bench = Bench::fork().setup(X, "x.csv.gz").write("x.csv.gz", &text);
    refused(
        &bench.identify(&[]),
        2,
        &[
            "x.csv.gz",
            "line 1",
            "invalid gzip header",
            "export it again",
        ],
    );
}

#[test]
fn gzip_that_breaks_off() {
    let bench = Bench::fork();
    let zipped = gzip(&std::fs::read_to_string(bench.file(X)).unwrap());
    let bench = bench
        .setup(X, "x.csv.gz")
        .write("x.csv.gz", &zipped[..zipped.len() / 2]);
    refused(
        &bench.identify(&[]),
        2,
        &[
            "x.csv.gz, line ",
            "breaks off or is damaged",
            "copy or export it again",
        ],
    );
}

#[test]
fn setups_that_say_something_else() {
    let finished = Bench::fork()
        .setup("averaging_band", "avergaing_band")
        .identify(&[]);
    refused(
        &finished,
        2,
        &[
            "setup.toml, line ",
            "[processing]",
            "no key `avergaing_band`",
            "did you mean `averaging_band`?",
        ],
    );
    let finished = Bench::fork()
        .setup("[processing]", "[processing")
        .identify(&[]);
    refused(&finished, 2, &["setup.toml, line 5", "this is not TOML"]);
    let finished = Bench::fork()
        .write("setup.toml", [0xff, 0, 7])
        .identify(&[]);
    refused(
        &finished,
        2,
        &["setup.toml", "not UTF-8", "save the file as UTF-8"],
    );
    let finished = Bench::fork().write("setup.toml", "").identify(&[]);
    refused(
        &finished,
        2,
        &[
            "setup.toml",
            "there is no [[accelerometer]]",
            "add at least one",
        ],
    );
}

/// Without noise, a sensor that looks across the motion reads exactly zero and is well.
#[test]
fn channels_that_rest_without_noise_are_not_dead() {
    let models = concat!(env!("CARGO_MANIFEST_DIR"), "/models/");
    for (model, rests) in [
        (
            "fork".to_owned(),
            "run \"lateral X\": no reading changes in a2, a3",
        ),
        (
            models.to_owned() + "uniaxial-remounted.toml",
            "either the table never moved their way",
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let simulate = [
            "simulate",
            &model,
            "--out",
            ".",
            "--noise",
            "0",
            "--duration",
            "6",
        ];
        let finished = bench::massline(folder.path(), simulate);
        assert_eq!(finished.code, Some(0), "{}", finished.stderr);
        let finished = bench::massline(folder.path(), ["identify", "setup.toml"]);
        assert_eq!(finished.code, Some(0), "{}", finished.stderr);
        assert!(finished.stderr.contains(rests), "{}", finished.stderr);
    }
}
