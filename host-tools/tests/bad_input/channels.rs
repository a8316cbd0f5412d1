//! Channels that are missing, twice there, dead or clipped.

use crate::X;
use crate::bench::{self, Bench, Finished, RECORDINGS};

#[test]
fn missing_channel() {
    Bench::fork()
        .edit(X, |text| text.replacen(",a4,", ",A4,", 1))
        .refused_input("lateral-x.csv … line 1 … there is no channel `a4` … did you mean `A4`?");
}

#[test]
fn missing_drive() {
    Bench::fork()
        .with("reference", "\"generator\"")
        .refused_input(
            "lateral-x.csv … there is no channel `generator` … columns without a sensor are drive \
             … correct",
        );
}

#[test]
fn duplicate_channel_in_the_recording() {
    Bench::fork()
        .edit(X, |text| text.replacen(",a4,", ",a5,", 1))
        .refused_input(
            "lateral-x.csv … line 1 … channel `a5` stands there twice, in columns 5 and 6 … \
             rename one",
        );
}

/// A row of units that nobody knows is none of names, even if they repeat each other.
#[test]
fn units_that_nobody_knows() {
    let below = |text: String| {
        let (names, rows) = text.split_once('\n').unwrap();
        let units = vec!["EU"; names.split(',').count()].join(",");
        format!("{names}\n{units}\n{rows}")
    };
    Bench::fork()
        .edit(X, |text| below(text.to_owned()))
        .refused_input("lateral-x.csv, line 2, channel … the recording says \"EU\"; accepted are");
}

#[test]
fn duplicate_channel_in_the_setup() {
    Bench::fork().setup("\"a4\"", "\"a5\"").refused_input(
        "setup.toml, line … [[accelerometer]] 5 … channel \"a5\" belongs to [[accelerometer]] \
             4 … correct the name",
    );
}

#[test]
fn a_sensor_as_the_drive() {
    Bench::fork().with("reference", "\"a1\"").refused_input(
        "setup.toml, line … `reference` names \"a1\", which is a sensor … leave `reference` \
             out",
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
            let said = reading.trim_end_matches(".0");
            constant_everywhere(channel, reading).refused_data(&format!(
                "{X} … channel `{channel}` … it reads {said} throughout … {repair}"
            ));
        }
    }
}

#[test]
fn channel_that_dies_between_runs() {
    Bench::fork()
        .channel(RECORDINGS[1], "a1", |_, _| "0.0".to_owned())
        .channel(RECORDINGS[2], "a1", |_, _| "0.0".to_owned())
        .refused_data("lateral-z.csv … channel `a1` … it reads 0 throughout … repair it");
}

#[test]
fn dead_drive() {
    Bench::fork()
        .channel(X, "drive", |_, _| "0.0".to_owned())
        .refused_data(
            "lateral-x.csv … channel `drive` … nothing can be referred to it … check the \
             generator's cable",
        );
}

#[test]
fn clipped_channel() {
    let stop = |_: usize, field: &str| {
        let reading: f64 = field.parse().unwrap();
        reading.clamp(-1.5, 1.5).to_string()
    };
    Bench::fork().channel(X, "a1", stop).refused_data(
        "lateral-x.csv … channel `a1` … samples sit at 1.5 … the signal is clipped … lower \
             the gain",
    );
}

/// One reading of 16,000 times the others' RMS.
#[test]
fn a_reading_with_more_power_than_all_others() {
    let wild = |row: usize, reading: &str| if row == 1999 { "100" } else { reading }.to_owned();
    Bench::fork().channel(X, "a3", wild).refused_data(
        "lateral-x.csv … channel `a3` … sample 2000, counted from one, reads 1e2 … cut the \
             recording there",
    );
}

/// A recorder that repeats one reading for a hundred samples.
#[test]
fn a_sensor_that_was_held() {
    let text = std::fs::read_to_string(Bench::fork().file(X)).unwrap();
    let a1 = text
        .lines()
        .next()
        .unwrap()
        .split(',')
        .position(|name| name == "a1");
    let reading = text
        .lines()
        .nth(1001)
        .unwrap()
        .split(',')
        .nth(a1.unwrap())
        .unwrap();
    let hold = |row: usize, own: &str| {
        let held = (1000..1100).contains(&row);
        if held { reading } else { own }.to_owned()
    };
    let finished = Bench::fork().channel(X, "a1", hold).identify(&[]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    finished.says(
        "run \"lateral X\": one and the same reading for 100 samples from sample 1001 on … in a1: … \
         record the run again",
    );
}

#[test]
fn runs_that_are_copies_of_each_other() {
    let words = "runs \"lateral X\" and \"lateral Z\" hold the very same samples … give each run \
                 its own";
    // Named twice.
    let named = Bench::fork().setup(RECORDINGS[1], X);
    named.refused_data(words);
    // Copied under another name and exported anew, so that the texts differ.
    let bench = Bench::fork();
    let text = std::fs::read_to_string(bench.file(X)).unwrap();
    let copied = bench.write(RECORDINGS[1], text.replace(',', ", "));
    copied.refused_data(words);
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
        finished.says(rests);
    }
}
