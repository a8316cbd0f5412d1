//! Files that are not there, are empty, break off or are of another kind.

use crate::bench::{self, Bench};
use crate::{X, refused};
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write;

fn gzip(text: &str) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(text.as_bytes()).unwrap();
    encoder.finish().unwrap()
}

fn lines(text: &str, count: usize) -> String {
    text.lines().take(count).collect::<Vec<_>>().join("\n") + "\n"
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
