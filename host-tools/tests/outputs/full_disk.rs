//! A disk that takes no more, as the system has it: the largest file that a process may write is
//! limited (`ulimit -f`), which needs no rights and no disk of its own.

use crate::bench::{BAND, Bench, Finished, command, finish};
use crate::files;
use std::path::Path;
use std::process::Command;

/// Runs the command with files of at most so many bytes.
fn limited(folder: &Path, bytes: usize, arguments: &[&str]) -> Finished {
    let own = command(folder, arguments);
    let mut limited = Command::new("sh");
    // POSIX counts in blocks of 512 bytes. Without the trap a signal would end the command.
    let script = format!(
        "trap '' XFSZ; ulimit -f {}; exec \"$0\" \"$@\"",
        bytes / 512
    );
    limited.current_dir(folder).args(["-c", &script]);
    limited.arg(own.get_program()).args(own.get_args());
    finish(limited)
}

/// A command with less and less room, until there is none: every file is the old one, nothing
/// lies beside it, and the message says what to do.
fn leaves_the_old(bench: &Bench, rooms: &[usize], arguments: &[&str]) {
    let before = files(bench.path());
    for &room in rooms {
        let finished = limited(bench.path(), room, arguments);
        assert_eq!(finished.code, Some(2), "{room}: {finished:?}");
        finished.says("make room on the disk");
        assert!(files(bench.path()) == before, "{room}: {arguments:?}");
    }
}

#[test]
fn a_report() {
    let bench = Bench::fork();
    let own = ["identify", "setup.toml", "--report", "report.html"];
    let own = [&own[..], &BAND].concat();
    assert_eq!(bench.identify(&own[2..]).code, Some(0));
    leaves_the_old(&bench, &[0, 512, 32 << 10], &own);
    let study = ["study", "tuning-fork", "--draws", "0"];
    let report = ["--report", "report.html"];
    leaves_the_old(&bench, &[512], &[&study[..], &report].concat());
}

#[test]
fn exported_settings() {
    let bench = Bench::fork().write("inputs.toml", "# mine\n");
    let own = ["board", "settings", "--host", "--force"];
    let export = [&own[..], &["--export", "inputs.toml"]].concat();
    leaves_the_old(&bench, &[0, 512], &export);
}

#[test]
fn a_simulation() {
    let bench = Bench::fork();
    let own = ["simulate", "fork", "--out", ".", "--seed", "9"];
    let simulate = [&own[..], &["--duration", "6"]].concat();
    leaves_the_old(&bench, &[0, 512, 100 << 10], &simulate);
    let demo = ["demo", "--out", "."];
    leaves_the_old(&bench, &[512], &demo);
}

#[test]
fn a_recording() {
    let bench = Bench::fork().write("x.csv", "an older recording\n");
    let room = 64 << 10;
    let record = ["board", "record", "x.csv", "--host", "--seconds", "60"];
    let finished = limited(bench.path(), room, &[&record[..], &["--force"]].concat());
    assert_eq!(finished.code, Some(2), "{finished:?}");
    for words in ["make room on the disk", "kept in", "x.csv.part"] {
        finished.says(words);
    }
    let left = files(bench.path());
    assert_eq!(left["x.csv"], b"an older recording\n");
    // All that fitted.
    let part = &left["x.csv.part"];
    assert_eq!(part.len(), room);
    let text = String::from_utf8(part.clone()).unwrap();
    let (whole, _) = text.rsplit_once('\n').unwrap();
    let columns = |line: &str| line.split(',').count();
    let header = columns(whole.lines().next().unwrap());
    assert!(header > 3 && whole.lines().all(|line| columns(line) == header));
    assert!(!left.keys().any(|name| name.ends_with(".massline-tmp")));
    // Without room for a single byte there is nothing to be kept.
    let none = limited(bench.path(), 0, &["board", "record", "y.csv", "--host"]);
    assert_eq!(none.code, Some(2), "{none:?}");
    assert!(files(bench.path()) == left, "{none:?}");
}
