//! Links, permissions, devices, pipes.

use crate::bench::{BAND, Bench, command, finish, massline};
use crate::files;
use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
use std::process::{Command, Stdio};

fn report<'a>(name: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let own = ["identify", "setup.toml", "--report", name];
    [&own[..], more, &BAND].concat()
}

const HTML: &str = "<!DOCTYPE html>";

#[test]
fn a_link_stays_one_and_its_target_keeps_its_permissions() {
    let bench = Bench::fork();
    std::fs::create_dir(bench.file("reports")).unwrap();
    let target = bench.file("reports/real.html");
    std::fs::write(&target, "<p>old</p>").unwrap();
    std::fs::set_permissions(&target, PermissionsExt::from_mode(0o640)).unwrap();
    symlink("reports/real.html", bench.file("link.html")).unwrap();
    symlink("reports/new.html", bench.file("dangling.html")).unwrap();
    for (link, target) in [("link.html", "real.html"), ("dangling.html", "new.html")] {
        let finished = massline(bench.path(), report(link, &["--force"]));
        assert_eq!(finished.code, Some(0), "{finished:?}");
        assert!(bench.file(link).is_symlink());
        let text = std::fs::read_to_string(bench.file("reports").join(target)).unwrap();
        assert!(text.starts_with(HTML), "{target}");
    }
    let mode = target.metadata().unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o640);
    assert_eq!(files(&bench.file("reports")).len(), 2);
    symlink("round.html", bench.file("round.html")).unwrap();
    let finished = massline(bench.path(), report("round.html", &[]));
    assert_eq!(finished.code, Some(2));
    finished.says("circles");
}

#[test]
fn devices_take_reports_and_stay_devices() {
    let bench = Bench::fork();
    let before = files(bench.path());
    for device in ["/dev/null", "/dev/stderr"] {
        let finished = massline(bench.path(), report(device, &[]));
        assert_eq!(finished.code, Some(0), "{finished:?}");
        assert_eq!(finished.stderr.contains(HTML), device == "/dev/stderr");
    }
    let null = std::fs::metadata("/dev/null").unwrap();
    assert!(null.file_type().is_char_device());
    let finished = massline(bench.path(), report("/dev/full", &[]));
    assert_eq!(finished.code, Some(2), "{finished:?}");
    finished.says("/dev/full: cannot be written");
    assert!(files(bench.path()) == before);
}

/// The report and the table after one another, whatever stdout is.
#[test]
fn stdout_takes_a_report() {
    let bench = Bench::fork();
    let finished = massline(bench.path(), report("/dev/stdout", &[]));
    assert_eq!(finished.code, Some(0), "{finished:?}");
    let expected = finished.stdout;
    assert!(expected.starts_with(HTML) && expected.contains("</html>\n"));
    for name in ["/dev/stdout", "/dev/fd/1"] {
        let file = bench.file("both.txt");
        std::fs::write(&file, "before\n").unwrap();
        let both = std::fs::File::options().append(true).open(&file).unwrap();
        let mut child = command(bench.path(), report(name, &[]));
        child.stdout(Stdio::from(both)).stderr(Stdio::null());
        assert!(child.status().unwrap().success());
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(text == format!("before\n{expected}"), "{name}: {text}");
    }
}

#[test]
fn pipes_take_reports_but_no_recordings() {
    let bench = Bench::fork();
    let made = Command::new("mkfifo").arg(bench.file("x.csv")).status();
    assert!(made.unwrap().success());
    let mut reader = Command::new("cat");
    let reader = reader.arg(bench.file("x.csv")).stdout(Stdio::piped());
    let reader = reader.spawn().unwrap();
    let finished = massline(bench.path(), report("x.csv", &[]));
    assert_eq!(finished.code, Some(0), "{finished:?}");
    let read = reader.wait_with_output().unwrap().stdout;
    assert!(read.starts_with(HTML.as_bytes()));
    let is_pipe = || {
        bench
            .file("x.csv")
            .metadata()
            .unwrap()
            .file_type()
            .is_fifo()
    };
    assert!(is_pipe());
    let record = [
        "board",
        "record",
        "x.csv",
        "--host",
        "--seconds",
        "1",
        "--force",
    ];
    let finished = finish(command(bench.path(), record));
    assert_eq!(finished.code, Some(2), "{finished:?}");
    finished.says("no regular file");
    assert!(is_pipe() && !bench.file("x.csv.part").exists());
}
