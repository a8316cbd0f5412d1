//! Memory does not grow with the length of a recording.
//!
//! The system keeps the most memory that a process ever had resident; it is read until the
//! process is gone.
#![cfg(target_os = "linux")]

mod bench;

use bench::{Bench, RECORDINGS, command};
use std::process::Stdio;
use std::time::Duration;

/// Most memory that `identify` has resident, bytes.
fn peak(bench: &Bench) -> u64 {
    let mut child = command(
        bench.path(),
        ["identify", "setup.toml", "--report", "report.html"],
    )
    .stdout(Stdio::null())
    .stderr(Stdio::null())
    .spawn()
    .unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kilobytes = line
            .and_then(|l| l.trim().strip_suffix(" kB"))
            .map(str::parse::<u64>);
        if let Some(Ok(kilobytes)) = kilobytes {
            peak = peak.max(1024 * kilobytes);
        }
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success());
            assert!(peak > 0, "the process was gone before it was looked at");
            return peak;
        }
        std::thread::sleep(Duration::from_micros(200));
    }
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
