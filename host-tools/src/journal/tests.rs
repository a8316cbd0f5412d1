//! Journals that are cut and damaged, and what is recovered of them.

use super::*;
use crate::recording::{About, Recording, TrueRate, Written};
use massline_firmware::wire::Health;
use std::path::{Path, PathBuf};

/// Readings of a row, which tell its number.
fn row(n: u64) -> ([f32; 2], Health) {
    let health = match n % 7 {
        3 => Health::OVERLOAD,
        5 => Health::MISSING,
        _ => Health::GOOD,
    };
    let missing = health == Health::MISSING;
    let x = if missing { 0.0 } else { n as f32 };
    ([x, -0.1 * x], health)
}

fn about() -> About {
    About {
        nominal_sample_rate: Some(512.0),
        setup: "# a set-up\n".to_owned(),
        ..About::of_names(["a 1, left", "fx"])
    }
}

/// A journal of frames of so many rows, and where each frame ends with the number of rows up to there.
fn journal(frames: &[u64]) -> (Vec<u8>, Vec<(usize, u64)>) {
    let mut journal = Journal::new(&about());
    let (mut bytes, mut ends, mut next) = (Vec::new(), Vec::new(), 0);
    for (k, rows) in frames.iter().enumerate() {
        for _ in 0..*rows {
            let (si, health) = row(next);
            journal.row(&si, health);
            next += 1;
        }
        if k == 1 {
            journal.rate(&TrueRate {
                value: 511.5,
                uncertainty: 0.25,
                clock: "host".to_owned(),
            });
        }
        journal.write_to(&mut bytes).unwrap();
        ends.push((bytes.len(), next));
    }
    (bytes, ends)
}

/// All rows of a recording, with the readings that are there.
fn read(file: &Path) -> Vec<([f32; 2], Health)> {
    let mut recording = Recording::open(file, &["a 1, left", "fx"]).unwrap();
    let (mut rows, mut sample) = (Vec::new(), [0.0; 2]);
    while recording.next_row(&mut sample).unwrap() {
        rows.push((sample, recording.health()));
    }
    rows
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn with(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

#[test]
fn every_whole_frame_of_a_cut_journal_is_recovered() {
    let (bytes, ends) = journal(&[1, 30, 2, 17, 40]);
    let folder = Folder::new();
    for cut in 0..=bytes.len() {
        let whole = ends.iter().rev().find(|(end, _)| *end <= cut);
        let whole = whole.map_or(0, |(_, rows)| *rows);
        // All of them through the reader, some of them to a file.
        let mut reader = Reader::new(&bytes[..cut]);
        let mut rows = 0;
        while let Some(part) = reader.next().unwrap() {
            if let Part::Rows { first, content, .. } = part {
                assert_eq!(first, rows);
                rows += super::rows(content).count() as u64;
            }
        }
        assert_eq!(rows, whole, "cut at {cut}");
        if !cut.is_multiple_of(61) && cut != bytes.len() {
            continue;
        }
        let part = folder.with("x.parquet.part", &bytes[..cut]);
        match recover(&part, None, true) {
            Ok(recovered) => {
                assert_eq!(recovered.samples, whole);
                assert_eq!((recovered.lost.samples, recovered.lost.bytes), (0, 0));
                let found = read(&recovered.file);
                let expected: Vec<_> = (0..whole).map(row).collect();
                assert_eq!(found, expected, "cut at {cut}");
            }
            Err(error) => {
                assert_eq!(whole, 0, "cut at {cut}: {error}");
                assert!(error.to_string().contains("x.parquet.part"), "{error}");
            }
        }
        assert_eq!(
            std::fs::read(&part).unwrap(),
            bytes[..cut],
            "it stays as it is"
        );
    }
}

/// Each byte in turn: at most the rows of its frame are lost, those behind it do not shift.
#[test]
fn damage_in_the_middle_costs_the_rows_of_its_frame() {
    let (bytes, ends) = journal(&[3, 5, 4, 6]);
    let folder = Folder::new();
    let head = ends[0].0 - (super::frame::BEFORE + super::frame::BEHIND + 2 + 3 * 10);
    for at in (head..bytes.len()).step_by(5) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x20;
        let part = folder.with("x.csv.part", &damaged);
        let recovered = recover(&part, None, true).unwrap();
        let frame = ends.iter().position(|(end, _)| at < *end).unwrap();
        let before = frame.checked_sub(1).map_or(0, |k| ends[k].1);
        let lost = before..ends[frame].1;
        let is_last = frame + 1 == ends.len();
        let found = read(&recovered.file);
        let mut rows = found.iter().zip(0..);
        // The frame of the rate lies before the rows that were written with it.
        let of_rate = recovered.lost.samples == 0 && !is_last;
        assert!(
            !of_rate || frame == 1 && recovered.lost.bytes > 0,
            "byte {at}"
        );
        assert!(
            rows.all(|(found, n)| *found == row(n)
                || !of_rate && lost.contains(&n) && found.1 == Health::MISSING),
            "byte {at}: {found:?}"
        );
        let whole = if is_last { before } else { ends[3].1 };
        assert_eq!(
            (found.len() as u64, recovered.samples),
            (whole, whole),
            "byte {at}"
        );
        if is_last {
            assert!(
                recovered.unfinished > 0 && recovered.lost.bytes == 0,
                "byte {at}"
            );
        } else if !of_rate {
            assert_eq!(recovered.lost.samples, lost.end - lost.start, "byte {at}");
            assert!(recovered.lost.places.len() == 1 && recovered.lost.bytes > 0);
        }
    }
}

#[test]
fn a_head_that_is_damaged_stands_there_again() {
    let (mut bytes, ends) = journal(&[2; 70]);
    bytes[30] ^= 1;
    let folder = Folder::new();
    let part = folder.with("x.parquet.part", &bytes);
    let recovered = recover(&part, None, false).unwrap();
    assert_eq!(recovered.channels, ["a 1, left", "fx"]);
    assert_eq!(recovered.samples, ends[69].1);
    assert_eq!(recovered.lost.samples, 0);
    // Of fewer frames nobody knows whose readings they are.
    let part = folder.with("y.parquet.part", &bytes[..ends[20].0]);
    let error = recover(&part, None, false).unwrap_err().to_string();
    assert!(error.contains("names of its channels"), "{error}");
}

#[test]
fn a_journal_becomes_each_format_with_what_was_known() {
    let (bytes, ends) = journal(&[10, 20, 30]);
    let folder = Folder::new();
    let part = folder.with("x.parquet.part", &bytes);
    for name in ["x.parquet", "y.csv", "y.csv.gz"] {
        let file = folder.0.path().join(name);
        let recovered = recover(&part, Some(&file), false).unwrap();
        assert_eq!((&recovered.file, recovered.samples), (&file, ends[2].1));
        assert_eq!(recovered.unfinished, 0);
        assert_eq!(read(&file), (0..60).map(row).collect::<Vec<_>>(), "{name}");
        let mut opened = Recording::open(&file, &["fx"]).unwrap();
        let rate = opened.preamble().sample_rate.clone().unwrap();
        assert_eq!((rate.value, rate.uncertainty), (511.5, 0.25), "{name}");
        assert_eq!(opened.settle_rate(None).unwrap(), 511.5, "{name}");
        // A second one does not replace it.
        let error = recover(&part, Some(&file), false).unwrap_err().to_string();
        assert!(error.contains("is there already"), "{error}");
    }
    let error = recover(&part, Some(&part), true).unwrap_err().to_string();
    assert!(error.contains("ends in .parquet"), "{error}");
    assert_eq!(
        Written::of(Path::new("a/X.PARQUET")),
        Some(Written::Parquet)
    );
}

#[test]
fn whole_lines_of_csv_are_recovered() {
    let folder = Folder::new();
    let text = "\"a 1, left\",fx,health\n0.0,-0.0,\n1.5,2e-3,overload\n,,missing\n3.0,4.0,\n";
    for cut in 0..text.len() {
        let part = folder.with("x.csv.part", &text.as_bytes()[..cut]);
        let lines = text[..cut].matches('\n').count();
        match recover(&part, None, true) {
            Ok(recovered) => {
                assert_eq!(recovered.samples as usize, lines - 1, "{cut}");
                assert_eq!(recovered.lost.bytes, 0);
                let expected = [
                    ([0.0, -0.0], Health::GOOD),
                    ([1.5, 2e-3], Health::OVERLOAD),
                    ([0.0; 2], Health::MISSING),
                ];
                assert_eq!(read(&recovered.file), expected[..lines - 1], "{cut}");
            }
            Err(error) => assert!(lines < 2, "{cut}: {error}"),
        }
    }
    // A line in the middle that is none.
    let damaged = text.replace("2e-3,over", "2e\0-3,over");
    let part = folder.with("x.csv.part", damaged.as_bytes());
    let recovered = recover(&part, None, true).unwrap();
    assert_eq!((recovered.samples, recovered.lost.samples), (4, 1));
    assert_eq!(read(&recovered.file)[1], ([0.0; 2], Health::MISSING));
    // Zeros in place of a page, from the middle of a row to that of another: rows are of 21 bytes.
    let row = |i: usize| format!("{i:07}.0,{i:07}.0,\n");
    let rows: String = (0..400).map(row).collect();
    let mut bytes = format!("\"a 1, left\",fx,health\n{rows}").into_bytes();
    bytes[1005..5101].fill(0);
    let part = folder.with("y.csv.part", &bytes);
    let recovered = recover(&part, None, true).unwrap();
    assert_eq!((recovered.samples, recovered.lost.samples), (400, 196));
    assert_eq!(read(&recovered.file)[399], ([399.0; 2], Health::GOOD));
    let other = folder.with("z.part", b"a,b\n1,2\n");
    let error = recover(&other, Some(&folder.0.path().join("z.csv")), true);
    assert!(
        error
            .unwrap_err()
            .to_string()
            .contains("neither a journal nor")
    );
    let error = recover(&other, None, true).unwrap_err().to_string();
    assert!(error.contains("by --out"), "{error}");
}
