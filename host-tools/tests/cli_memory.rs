//! Memory does not grow with the length of a recording, nor beyond what the limits of a row and of
//! a set-up take.
//!
//! The system keeps the most memory that a process ever had resident; it is read until the
//! process is gone.
#![cfg(target_os = "linux")]

mod bench;
#[path = "bench/watched.rs"]
mod watched;

use bench::{Bench, RECORDINGS, command};
use flate2::Compression;
use flate2::write::GzEncoder;
use massline::limits;
use std::io::Write;
use std::process::{Command, Stdio};
use std::time::Duration;
use watched::watched;

/// Most memory that `identify` has resident, bytes: in three times, since on a busy machine the last
/// milliseconds of a short one are not looked at.
fn peak(bench: &Bench) -> u64 {
    let once = || {
        let identify = ["identify", "setup.toml", "--report", "report.html"];
        let identify = identify.iter().chain(&bench::BAND);
        let (peak, success, said) = watched(command(bench.path(), identify));
        assert!(success, "{said}");
        peak
    };
    (0..3).map(|_| once()).max().unwrap_or(0)
}

/// One run of the fork, its rows written `times` over.
fn repeated(times: usize) -> (Bench, u64) {
    let bench = Bench::fork()
        .edit("setup.toml", |text| {
            text.rsplitn(3, "[[run]]").last().unwrap().to_owned()
        })
        .edit(RECORDINGS[0], |text| {
            let (header, rows) = text.split_once('\n').unwrap();
            format!("{header}\n{}", rows.repeat(times))
        });
    let size = std::fs::metadata(bench.file(RECORDINGS[0])).unwrap().len();
    (bench, size)
}

/// Bytes that a command has read by the time it was last looked at.
fn bytes_read(mut command: Command) -> u64 {
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.spawn().unwrap();
    let counts = format!("/proc/{}/io", child.id());
    let mut read = 0;
    while child.try_wait().unwrap().is_none() {
        let text = std::fs::read_to_string(&counts).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("rchar: "));
        read = line.and_then(|n| n.parse().ok()).unwrap_or(read).max(read);
        std::thread::sleep(Duration::from_micros(200));
    }
    read
}

/// Levels, survey, and the averages of both selections of accelerometers, from one pass.
#[test]
fn identify_reads_each_recording_once() {
    let bench = Bench::satellite();
    let recordings = ["x", "y", "z", "about-x", "about-y", "about-z"];
    let sizes = recordings.map(|name| std::fs::metadata(bench.file(&format!("{name}.csv"))));
    let whole: u64 = sizes.into_iter().map(|size| size.unwrap().len()).sum();
    for threads in ["1", "3"] {
        let identify = ["identify", "setup.toml", "--threads", threads];
        let identify = identify.iter().chain(&bench::BAND);
        let read = bytes_read(command(bench.path(), identify));
        println!("{read} bytes read of {whole}");
        // Beside one pass: the head of the first recording once more, the program's libraries, and the setup.
        assert!(
            read > whole / 2 && read < whole + 600_000,
            "{read} of {whole}"
        );
    }
}

#[test]
fn ten_times_the_recording_takes_the_same_memory() {
    // A minute and ten minutes of nineteen channels at 512 Hz.
    let (short, before) = repeated(10);
    let (long, after) = repeated(100);
    assert!(
        after > 50_000_000,
        "{after} bytes are long enough to be seen"
    );
    let (short, long) = (peak(&short), peak(&long));
    println!("{before} bytes: {short} resident; {after} bytes: {long} resident");
    // The readings as f32, the least that a program could keep of them.
    let readings = 19 * 4 * 3072 * 90;
    // Measured: 0.1 MB, whatever the allocator and the looking leave by chance. Keeping
    // a tenth of the added readings would be 2.1 MB.
    let bound = readings / 10;
    assert!(long < short + bound, "{short} bytes grew to {long}");
}

/// Columns of a row group, and a page of each when they are read.
#[test]
fn ten_times_the_recording_takes_the_same_memory_in_parquet() {
    let resident = [10, 100].map(|times| {
        let (bench, _) = repeated(times);
        let text = std::fs::read_to_string(bench.file(RECORDINGS[0])).unwrap();
        let (header, rows) = text.split_once('\n').unwrap();
        let lines = format!("{header},health\n{}", rows.replace('\n', ",\n"));
        let bench = bench.write("x.csv.part", lines);
        let recover = ["recover", "x.csv.part", "--out", "x.parquet"];
        let (written, success, said) = watched(command(bench.path(), recover));
        assert!(success, "{said}");
        std::fs::rename(bench.file("x.parquet"), bench.file(RECORDINGS[0])).unwrap();
        [written, peak(&bench)]
    });
    println!("Parquet, written and read: {resident:?} resident");
    let [[short_written, short_read], [long_written, long_read]] = resident;
    // As for CSV: a tenth of the readings that were added.
    let bound = 19 * 4 * 3072 * 90 / 10;
    assert!(long_read < short_read + bound, "{resident:?}");
    // A whole row group of eight mebibytes in lists that grow by doubling, where the short one has less.
    assert!(
        long_written < short_written + bound + (16 << 20),
        "{resident:?}"
    );
}

/// So much text, 64 MiB, by repeating some.
fn much(of: &str) -> String {
    of.repeat((64 << 20) / of.len())
}

fn gzip(parts: &[&str]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    for part in parts {
        encoder.write_all(part.as_bytes()).unwrap();
    }
    encoder.finish().unwrap()
}

/// Memory of a row at its limit: its text in a buffer that doubles, the old one beside the new,
/// and in the same way a number of eight bytes for the end of each field, of which the shortest
/// has no byte but its comma. Twice and once again for each.
const ROW: u64 = 3 * (1 + 8) * limits::ROW;

#[test]
fn a_row_without_end_is_not_read_to_its_end() {
    let plain = peak(&Bench::fork());
    let fork = Bench::fork();
    let text = std::fs::read_to_string(fork.file(RECORDINGS[0])).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let header = format!("{header}\n");
    let readings = much("0.25,");
    let start: String = rows.lines().take(3).flat_map(|row| [row, "\n"]).collect();
    for (what, parts) in [
        ("a header", &[&*much("column,")][..]),
        ("a header of commas", &[&*much(",")]),
        ("a header in quotes", &["\"", &*much("a\n")]),
        ("a row", &[&*header, &start, &readings]),
        ("a comment", &[&*header, &start, "#", &readings]),
        ("empty lines", &[&*header, &start, &much("\n")]),
    ] {
        let zipped = gzip(parts);
        assert!(zipped.len() < 1 << 20, "{what}");
        let bench = Bench::fork()
            .setup(RECORDINGS[0], "x.csv.gz")
            .write("x.csv.gz", zipped);
        let (peak, success, said) = watched(command(bench.path(), ["identify", "setup.toml"]));
        println!(
            "{what}: {peak} resident, {plain} for a good one; {}",
            said.trim_end()
        );
        assert!(
            !success && said.contains("a row of more than 4 MiB"),
            "{said}"
        );
        assert!(peak < plain + ROW, "{what}: {peak}");
    }
}

#[test]
fn a_document_without_end_is_not_read_to_its_end() {
    let plain = peak(&Bench::fork());
    // What a parser makes of a byte of text: a value takes two, and some hundred bytes in memory.
    let document = 160 * limits::DOCUMENT;
    let most = limits::DOCUMENT as usize;
    let fill = |of: &str| of.repeat(most / of.len());
    let good = Bench::fork();
    let recording = good.file(RECORDINGS[0]);
    for (what, text, words) in [
        (
            "many sensors",
            fill("[[accelerometer]]\n"),
            "at most 64 can be used",
        ),
        ("many runs", fill("[[run]]\n"), "at most 1000 can be used"),
        (
            "many values",
            format!("a=[{}", &fill("1,")[4..]),
            "not TOML",
        ),
        (
            "more than fits",
            fill("# text\n") + "# text\n# text\n",
            "longer than 1 MiB",
        ),
    ] {
        let bench = Bench::fork().write("setup.toml", text);
        let (peak, success, said) = watched(command(bench.path(), ["identify", "setup.toml"]));
        println!(
            "{what}: {peak} resident, {plain} for a good one; {}",
            said.trim_end()
        );
        assert!(!success && said.contains(words), "{what}: {said}");
        assert!(peak < plain + document, "{what}: {peak}");
    }
    for (arguments, words) in [
        (&["identify", "/dev/zero"][..], "longer than 1 MiB"),
        (
            &["simulate", "model.toml", "--out", "o"],
            "longer than 1 MiB",
        ),
        (
            &["board", "settings", "--host", "--inputs", "/dev/zero"],
            "longer than 1 MiB",
        ),
        (
            &["identify", "setup.toml", "--truth", "/dev/zero"],
            "longer than 1 MiB",
        ),
    ] {
        let bench = Bench::fork();
        std::os::unix::fs::symlink("/dev/zero", bench.file("model.toml")).unwrap();
        let (peak, success, said) = watched(command(bench.path(), arguments));
        println!("{arguments:?}: {peak} resident; {}", said.trim_end());
        assert!(!success && said.contains(words), "{arguments:?}: {said}");
        assert!(peak < plain + document, "{arguments:?}: {peak}");
    }
    assert!(recording.exists());
}
