//! Files that are not there, are empty, break off or are of another kind.

use crate::X;
use crate::bench::{self, Bench};
use flate2::Compression;
use flate2::write::GzEncoder;
use massline::recording::Recording;
use std::io::Write;

fn gzip(bytes: impl AsRef<[u8]>) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes.as_ref()).unwrap();
    encoder.finish().unwrap()
}

fn lines(text: &str, count: usize) -> String {
    text.lines().take(count).collect::<Vec<_>>().join("\n") + "\n"
}

#[test]
fn empty_file() {
    Bench::fork()
        .write(X, "")
        .refused_input("lateral-x.csv … the file is empty … expected a header");
}

#[test]
fn empty_file_in_gzip() {
    let bench = Bench::fork()
        .setup(X, "x.csv.gz")
        .write("x.csv.gz", gzip(""));
    bench.refused_input("x.csv.gz … the file is empty … expected a header");
}

#[test]
fn header_only() {
    Bench::fork()
        .edit(X, |text| lines(text, 1))
        .refused_input("lateral-x.csv … not one row of numbers … export the recording again");
}

#[test]
fn no_header() {
    Bench::fork()
        .edit(X, |text| text.split_once('\n').unwrap().1.to_owned())
        .refused_input(
            "lateral-x.csv … line 1 … starts with the number … put a line with the channel names",
        );
}

#[test]
fn too_short_a_recording() {
    Bench::fork()
        .edit(X, |text| lines(text, 1000))
        .refused_data("lateral-x.csv … 999 samples give 0 block(s) of 1024 … record longer");
}

#[test]
fn files_that_are_not_there() {
    Bench::fork()
        .setup(X, "lateral-y.csv")
        .refused_input("lateral-y.csv … cannot be read … check the `recording`");
    Bench::fork()
        .setup(X, ".")
        .refused_input("cannot be read … directory … check the `recording`");
    let bench = Bench::fork();
    bench::massline(bench.path(), ["identify", "nowhere.toml"])
        .refused_input("nowhere.toml … cannot be read … check the path");
}

#[test]
fn files_of_another_kind() {
    let bench = Bench::fork();
    let text = std::fs::read_to_string(bench.file(X)).unwrap();
    let utf16: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    // Without the mark by which it is known.
    Bench::fork()
        .write(X, utf16)
        .refused_input("lateral-x.csv … line 1 … UTF-16 without its mark … in UTF-8");
    bench
        .write(X, [0x1f, 0x8b, 9])
        .refused_input("lateral-x.csv … line 1 … breaks off or is damaged");
}

/// A browser may unpack what it loads, and leaves the name.
#[test]
fn a_kind_is_told_by_content_and_not_by_name() {
    let bench = Bench::fork();
    let text = std::fs::read_to_string(bench.file(X)).unwrap();
    let expected = bench.identify(&["--json"]).stdout;
    let packed = bench.write(X, gzip(&text));
    assert_eq!(packed.identify(&["--json"]).stdout, expected);
    let plain = Bench::fork().setup(X, "x.csv.gz").write("x.csv.gz", &text);
    assert_eq!(plain.identify(&["--json"]).stdout, expected);
    let twice = Bench::fork().write(X, gzip(gzip(&text)));
    twice.refused_input("lateral-x.csv … line 1 … gzip twice");
}

#[test]
fn gzip_that_breaks_off() {
    let bench = Bench::fork();
    let zipped = gzip(std::fs::read_to_string(bench.file(X)).unwrap());
    let bench = bench
        .setup(X, "x.csv.gz")
        .write("x.csv.gz", &zipped[..zipped.len() / 2]);
    bench.refused_input("x.csv.gz, line … breaks off or is damaged … copy or export it again");
}

#[test]
fn a_number_that_may_be_cut_is_noted() {
    // Three digits of the last number are missing, and then all of it.
    let cut = |bytes: usize| {
        Bench::fork().edit(X, |text| {
            let end = text.trim_end().len();
            text[..end - bytes].to_owned()
        })
    };
    let finished = cut(3).identify(&[]);
    assert_eq!(finished.code, Some(0), "{finished:?}");
    let note = finished.stderr.lines().find(|l| l.contains("no line end"));
    assert!(note.unwrap().contains(X), "{finished:?}");
    let whole = Bench::fork().identify(&[]);
    assert!(!whole.stderr.contains("no line end"), "{whole:?}");
    let fields = cut(0);
    let text = std::fs::read_to_string(fields.file(X)).unwrap();
    let last = text.rsplit_once(',').unwrap().0;
    fields
        .write(X, last)
        .refused_input("lateral-x.csv … fields where the header has … cut");
}

#[test]
fn columns_by_the_hundred_thousand_are_left_out_with_a_short_note() {
    let names: String = (0..100_000)
        .map(|k| format!(",unused column {k:06}"))
        .collect();
    let fields = ",0".repeat(100_000);
    let bench = Bench::fork().edit(X, |text| {
        let rows = text.lines().take(4).enumerate();
        let wide = rows.map(|(row, line)| match row {
            0 => format!("{line}{names}\n"),
            _ => format!("{line}{fields}\n"),
        });
        wide.collect()
    });
    let mut recording = Recording::open(&bench.file(X), &["a1", "fx"]).unwrap();
    let mut row = [0.0; 2];
    let rows = std::iter::from_fn(|| recording.next_row(&mut row).unwrap().then_some(()));
    assert_eq!(rows.count(), 3);
    let mut notes = Vec::new();
    recording.notice_columns(&mut notes);
    assert!(notes[0].contains("columns not used: "), "{}", notes[0]);
    assert!(
        notes[0].len() < 2000 && notes[0].contains(" of them)"),
        "{}",
        notes[0]
    );
    // A comparison of each name with all before it would take half a minute.
    bench.refused_data("lateral-x.csv … 3 samples give 0 block(s)");
    // One more than there may be.
    let names: String = (0..131_073).map(|k| format!("c{k},")).collect();
    Bench::fork()
        .write(X, format!("{}\n", names.trim_end_matches(',')))
        .refused_input("lateral-x.csv … 131073 columns … at most 131072");
}

#[cfg(unix)]
#[test]
fn a_pipe_is_no_recording() {
    let bench = Bench::fork().setup(X, "pipe");
    let made = std::process::Command::new("mkfifo")
        .arg(bench.file("pipe"))
        .status();
    assert!(made.unwrap().success());
    bench.refused_input("pipe … no file … save it to a file");
    Bench::fork()
        .setup(X, "/dev/zero")
        .refused_input("/dev/zero … no file … save it to a file");
}

#[cfg(unix)]
#[test]
fn a_setup_may_come_through_a_pipe() {
    use std::process::Stdio;
    let bench = Bench::fork().edit("setup.toml", |text| {
        let place = |name: &str| format!("recording = \"{}\"", name);
        // The folder of the setup is the pipe's.
        crate::RECORDINGS
            .iter()
            .fold(text.to_owned(), |text, name| {
                text.replace(&place(name), &place(&format!("MARK{name}")))
            })
    });
    let folder = bench.path().display().to_string() + "/";
    let text = std::fs::read_to_string(bench.file("setup.toml")).unwrap();
    let mut child = bench::command(bench.path(), ["identify", "/dev/stdin"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin
        .write_all(text.replace("MARK", &folder).as_bytes())
        .unwrap();
    drop(stdin);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
}
