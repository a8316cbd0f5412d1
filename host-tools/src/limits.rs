//! The limits of what is taken from a box and from files.
//!
//! A box may be broken, or be something else that pretends to be one; a file may be damaged,
//! or no file of this program at all. Whatever comes from either is held against these limits
//! before memory, disk space or time is spent on it. Each lies far beyond what a sound box or a
//! test can bring, so that a message that names one speaks of something that is wrong.
//!
//! The manual has them as a table, in the words of [`table`].

use std::ops::RangeInclusive;
use std::time::Duration;

/// Sample rates that a box's converters may be set to, Hz. The converters of the firmware have
/// 256 to 32 768 Hz.
pub const SAMPLE_RATES: RangeInclusive<f64> = 1.0..=200_000.0;
/// Highest number of a sample: numbers up to it are exact in double precision, and a box that
/// samples at the highest rate takes 1400 years to get there.
pub const LAST_SAMPLE: u64 = 1 << 53;
/// Longest time without samples that a recording bridges by rows without readings, s.
pub const LONGEST_GAP: f64 = 60.0;
/// Furthest that the numbers of a box's samples may run ahead of this computer's clock, s. The
/// clock of a box is good to a percent, which [`CLOCK`] allows for.
pub const LONGEST_LEAD: f64 = 60.0;
/// Largest share by which a box's clock may differ from this computer's.
pub const CLOCK: f64 = 0.05;
/// Longest that no sample may come while samples are waited for. At the lowest rate a message
/// takes a tenth of a second.
pub const SILENCE: Duration = Duration::from_secs(5);
/// Longest that a recording, a run or a look at the levels that was asked for N seconds may take,
/// by this computer's clock: `OVERTIME[0]` N + `OVERTIME[1]` seconds.
pub const OVERTIME: [f64; 2] = [2.0, 30.0];
/// Times that a request is sent before the box counts as silent.
pub const ATTEMPTS: u32 = 8;
/// Longest that a box on a serial port may work at one request. An identification takes it up to
/// 290 million instructions, the self-test fewer: some two seconds at its usual clock.
pub const LONGEST_WORK: Duration = Duration::from_secs(50);
/// Longest that the settings of all inputs may take to be read.
pub const READING_SETTINGS: Duration = Duration::from_secs(60);
/// Longest that bytes may take to be handed to a serial port.
pub const SENDING: Duration = Duration::from_secs(5);
/// Most blocks of a run: of 16 samples each, as many as [`LAST_SAMPLE`] would have at a
/// thousandth of it.
pub const BLOCKS: u32 = 1 << 30;
/// Most faults of a box that one recording lists; further ones are counted.
pub const LISTED_FAULTS: usize = 10_000;

/// Most bytes of a set-up, a model, a file of inputs or of the truth of a simulation. As a set-up
/// of [`SENSORS`] sensors and [`RUNS`] runs it has three hundred thousand.
pub const DOCUMENT: u64 = 1 << 20;
/// Most bytes of a result document. With [`RUNS`] runs of [`SENSORS`] calibrated channels it has
/// some twenty million.
pub const RESULT: u64 = 64 << 20;
/// Longest that a set-up that comes through a pipe may take.
pub const PIPE: Duration = Duration::from_secs(30);
/// Most sensors of a set-up: as many channels as the core takes.
pub const SENSORS: usize = massline_core::geometry::MAX_CHANNELS;
/// Most runs of a set-up.
pub const RUNS: usize = 1000;
/// Most bytes of one row of a recording, comments before it included.
pub const ROW: u64 = 4 << 20;
/// Most bytes of a page of a Parquet file, packed or not. Writers make pages of a mebibyte.
pub const PAGE: u64 = 16 << 20;
/// Most bytes of all pages of a Parquet file that are read at a time.
pub const PAGES: u64 = 256 << 20;
/// Most bytes of the footer of a Parquet file.
pub const FOOTER: u64 = 16 << 20;
/// Most columns of a recording.
pub const COLUMNS: usize = 1 << 17;
/// Most bytes of the structure of an HDF5 file that are read before its first sample; each part
/// counts 64 more. A dataset takes some five hundred to a thousand of them.
pub const STRUCTURE: u64 = 128 << 20;
/// Most bytes of compressed chunks of an HDF5 file that are held unpacked.
pub const UNPACKED: u64 = 32 << 20;

/// Longest time, s, that something that was asked for `seconds` may take by this computer's clock.
#[must_use]
pub fn overtime(seconds: f64) -> f64 {
    OVERTIME[0] * seconds + OVERTIME[1]
}

/// The limits in words: what is limited, the limit, and what happens beyond it.
#[must_use]
pub fn table() -> Vec<[String; 3]> {
    let seconds = |time: Duration| format!("{} s", time.as_secs_f64());
    let mega = |bytes: u64| format!("{} MiB", bytes >> 20);
    let row = |what: &str, limit: String, then: &str| [what.to_owned(), limit, then.to_owned()];
    let [low, high] = [SAMPLE_RATES.start(), SAMPLE_RATES.end()];
    vec![
        row(
            "sample rate that a box states",
            format!("{low} to {high} Hz"),
            "the command ends",
        ),
        row(
            "number of a sample",
            "2^53".to_owned(),
            "the recording ends and is kept",
        ),
        row(
            "gap that a recording bridges by rows without readings",
            format!("{LONGEST_GAP} s"),
            "the recording ends and is kept",
        ),
        row(
            "lead of a box's samples over this computer's clock",
            format!("{LONGEST_LEAD} s and {} %", 100.0 * CLOCK),
            "the recording ends and is kept",
        ),
        row(
            "time without a sample",
            seconds(SILENCE),
            "the recording ends and is kept; a run is thrown away",
        ),
        row(
            "time for what was asked to last N seconds",
            format!("{} N + {} s", OVERTIME[0], OVERTIME[1]),
            "the recording ends and is kept; a run is thrown away",
        ),
        row(
            "times that a request is sent",
            format!("{ATTEMPTS}, a second apart on a serial port"),
            "the command ends",
        ),
        row(
            "time for an identification or a self-test on a serial port",
            seconds(LONGEST_WORK),
            "the command ends",
        ),
        row(
            "time to read the settings of all inputs",
            seconds(READING_SETTINGS),
            "the command ends",
        ),
        row(
            "time to hand a frame to a serial port",
            seconds(SENDING),
            "the command ends",
        ),
        row("blocks of a run", BLOCKS.to_string(), "the command ends"),
        row(
            "faults of a box that a recording lists",
            LISTED_FAULTS.to_string(),
            "further ones are counted",
        ),
        row(
            "size of a set-up, a model, a file of inputs or of the truth",
            mega(DOCUMENT),
            "the command ends",
        ),
        row(
            "size of a result document",
            mega(RESULT),
            "the command ends",
        ),
        row(
            "time for such a file to come through a pipe",
            seconds(PIPE),
            "the command ends",
        ),
        row(
            "sensors of a set-up",
            SENSORS.to_string(),
            "the command ends",
        ),
        row("runs of a set-up", RUNS.to_string(), "the command ends"),
        row(
            "a row of a recording, comments before it included",
            mega(ROW),
            "the command ends",
        ),
        row(
            "a page of a Parquet file, packed or not",
            mega(PAGE),
            "the command ends",
        ),
        row(
            "all pages of a Parquet file that are read at a time",
            mega(PAGES),
            "the command ends",
        ),
        row(
            "the footer of a Parquet file",
            mega(FOOTER),
            "the command ends",
        ),
        row(
            "columns of a recording",
            COLUMNS.to_string(),
            "the command ends",
        ),
        row(
            "structure of an HDF5 file",
            mega(STRUCTURE),
            "the command ends",
        ),
        row(
            "compressed chunks of an HDF5 file that are held unpacked",
            mega(UNPACKED),
            "the command ends",
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manual_has_every_limit() {
        let manual = include_str!("../README.md");
        for row in table() {
            let line = format!("| {} |\n", row.join(" | "));
            assert!(manual.contains(&line), "{line}");
        }
    }
}
