//! Sample rates and times that do not belong to the recording.

use crate::X;
use crate::bench::{Bench, RECORDINGS};

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
fn wrong_sample_rate() {
    Bench::fork()
        .edit(X, |text| with_time(text, 256.0, 0))
        .refused_input(
            "lateral-x.csv … its time column says 256 samples per second, the setup says 512 … \
             correct `sample_rate`",
        );
}

#[test]
fn no_sample_rate() {
    Bench::fork()
        .setup("sample_rate", "# sample_rate")
        .refused_input("lateral-x.csv … no `time` column … no `sample_rate` … write `sample_rate`");
}

#[test]
fn lost_samples() {
    // Two samples are gone before row 1500, which stands in line 1502.
    Bench::fork()
        .edit(X, |text| with_time(text, 512.0, 2))
        .refused_input("lateral-x.csv … line 1502 … samples are missing or doubled … record again");
}

#[test]
fn times_that_do_not_ascend() {
    for (rate, times) in [
        (f64::INFINITY, "time is 0 s after 0 s"),
        (-512.0, "time is -0.001953 s after"),
    ] {
        let words = format!("lateral-x.csv, line 3 … {times} … export it with times that ascend");
        Bench::fork()
            .edit(X, |text| with_time(text, rate, 0))
            .refused_input(&words);
    }
    // The time of one sample neither ascends nor descends.
    let one = |text: &str| {
        with_time(text, 512.0, 0)
            .lines()
            .take(2)
            .map(|l| format!("{l}\n"))
            .collect()
    };
    Bench::fork()
        .edit(X, one)
        .refused_data("lateral-x.csv … 1 samples give 0 block(s)");
}

#[test]
fn runs_at_different_rates() {
    Bench::fork()
        .setup("sample_rate", "# sample_rate")
        .edit(X, |text| with_time(text, 512.0, 0))
        .edit(RECORDINGS[1], |text| with_time(text, 256.0, 0))
        .refused_input("lateral-z.csv … 256 … 512 … record all runs at one rate");
}

#[test]
fn band_outside_the_spectrum_of_the_recording() {
    Bench::fork()
        .setup("sample_rate", "# sample_rate")
        .with("averaging_band", "[0.5, 300.0]")
        .with("rigid_up_to", "400.0")
        .edit(X, |text| with_time(text, 512.0, 0))
        .refused_input(
            "lateral-x.csv … `averaging_band` ends at 300 Hz … the spectrum ends at 255 Hz … \
             lower the band",
        );
}
