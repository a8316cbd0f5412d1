//! Files made by hand whose headers ask for more than there is, and files of this program that others
//! have changed.

use super::*;
use crate::recording::about::About;
use crate::recording::{Recording, RecordingError};
use massline_firmware::wire::Health;
use std::path::PathBuf;

/// A structure in Thrift's compact protocol, field by field.
#[derive(Default)]
struct Structure(Vec<u8>, u8);

impl Structure {
    fn head(&mut self, field: u8, kind: u8) {
        self.0.push((field - self.1) << 4 | kind);
        self.1 = field;
    }

    fn number(mut self, field: u8, value: i64) -> Self {
        self.head(field, 6);
        varint((value << 1 ^ value >> 63) as u64, &mut self.0);
        self
    }

    fn text(mut self, field: u8, text: &str) -> Self {
        self.head(field, 8);
        varint(text.len() as u64, &mut self.0);
        self.0.extend_from_slice(text.as_bytes());
        self
    }

    fn structure(mut self, field: u8, inner: Self) -> Self {
        self.head(field, 12);
        self.0.extend(inner.end());
        self
    }

    fn list(mut self, field: u8, inner: Vec<Self>) -> Self {
        self.head(field, 9);
        self.0.push(0xfc);
        varint(inner.len() as u64, &mut self.0);
        inner.into_iter().for_each(|one| self.0.extend(one.end()));
        self
    }

    fn end(mut self) -> Vec<u8> {
        self.0.push(0);
        self.0
    }
}

fn varint(mut value: u64, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn new() -> Structure {
    Structure::default()
}

/// Header of a page of so many bytes, packed and unpacked, with so many values.
fn header(kind: i64, unpacked: i64, packed: i64, values: i64, encoding: i64) -> Vec<u8> {
    let inner = new().number(1, values).number(2, encoding).number(3, 3);
    let field = [5, 0, 7][kind as usize];
    let page = new().number(1, kind).number(2, unpacked).number(3, packed);
    page.structure(field, inner).end()
}

/// A file of one column `a1` of doubles, whose pages are these bytes.
fn file(pages: &[u8], rows: i64, codec: i64) -> Vec<u8> {
    let root = new().text(4, "root").number(5, 1);
    let column = new().number(1, 5).number(3, 0).text(4, "a1");
    let chunk = new()
        .number(4, codec)
        .number(5, rows)
        .number(7, pages.len() as i64)
        .number(9, 4);
    let group = new()
        .list(1, vec![new().structure(3, chunk)])
        .number(3, rows);
    let footer = new()
        .list(2, vec![root, column])
        .number(3, rows)
        .list(4, vec![group]);
    with_footer(pages, &footer.end())
}

fn with_footer(pages: &[u8], footer: &[u8]) -> Vec<u8> {
    let length = (footer.len() as u32).to_le_bytes();
    [MAGIC, pages, footer, &length, MAGIC].concat()
}

/// Reads all samples of `a1`.
fn read(bytes: &[u8]) -> Result<Vec<f64>, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.parquet");
    std::fs::write(&path, bytes).unwrap();
    let all = || -> Result<Vec<f64>, RecordingError> {
        let mut recording = Recording::open(&path, &["a1"])?;
        let mut all = Vec::new();
        while recording.next_row_f64(|_, x| all.push(x))? {}
        Ok(all)
    };
    all().map_err(|error| error.to_string())
}

#[track_caller]
fn refused(bytes: &[u8], words: &str) {
    let error = read(bytes).unwrap_err();
    assert!(
        error.contains(words) && error.contains("x.parquet"),
        "{error}"
    );
}

#[test]
fn headers_that_ask_for_more_than_there_is() {
    const MOST: i64 = i32::MAX as i64;
    let values: Vec<u8> = [1.5_f64, -2.0]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let page = |header: Vec<u8>| [header, values.clone()].concat();
    assert_eq!(
        read(&file(&page(header(0, 16, 16, 2, 0)), 2, 0)),
        Ok(vec![1.5, -2.0])
    );
    let beyond = "a page of 2147483647 bytes, where at most 16 MiB";
    refused(&file(&page(header(0, 16, MOST, 2, 0)), 2, 0), beyond);
    refused(&file(&page(header(0, MOST, 16, 2, 0)), 2, 1), beyond);
    refused(
        &file(&page(header(0, -1, 16, 2, 0)), 2, 0),
        "fewer than no bytes",
    );
    // Pages within the limit that are not there, or unpack to another size than they state.
    let most = limits::PAGE as i64;
    refused(
        &file(&page(header(0, most, most, 2, 0)), 2, 0),
        "breaks off",
    );
    refused(&file(&page(header(0, 16, 15, 2, 0)), 2, 0), "another size");
    let bomb = snap::raw::Encoder::new()
        .compress_vec(&vec![0; 1 << 20])
        .unwrap();
    let bomb = [header(0, 16, bomb.len() as i64, 2, 0), bomb].concat();
    refused(&file(&bomb, 2, 1), "another size");
    // Values, dictionaries and differences that contradict their pages.
    refused(
        &file(&page(header(0, 16, 16, 3, 0)), 3, 0),
        "Not enough bytes",
    );
    refused(
        &file(&page(header(0, 16, 16, MOST, 0)), 2, 0),
        "more values than its footer",
    );
    refused(
        &file(&page(header(2, 16, 16, MOST, 0)), 2, 0),
        "no list of values",
    );
    refused(&file(&page(header(0, 16, 16, 2, 8)), 2, 0), "there is none");
    refused(
        &file(&page(header(0, 16, 16, 2, 5)), 2, 0),
        "encoding number 5",
    );
    refused(
        &file(&page(header(0, 16, 16, 1, 0)), 2, 0),
        "missing at its end",
    );
    refused(&file(&[], 2, 0), "missing at its end");
    refused(
        &file(&page(header(0, 16, 16, 2, 0)), 2, 4),
        "compressed by Brotli",
    );
}

#[test]
fn footers_that_ask_for_more_than_there_is() {
    // Lists of 2³¹ row groups, columns and notes, and a footer of 2³² bytes.
    for field in [2, 4, 5] {
        let mut footer = Structure::default();
        footer.head(field, 9);
        footer.0.extend([0xfc, 0xff, 0xff, 0xff, 0xff, 0x07]);
        refused(&with_footer(&[], &footer.end()), "breaks off");
    }
    let mut long = with_footer(&[], &[0]);
    let at = long.len() - 8;
    long[at..at + 4].copy_from_slice(&[0xff; 4]);
    refused(&long, "a footer of 4294967295 bytes");
    refused(b"PAR1\0\0", "no footer at its end");
    // Groups without columns, and a schema of more columns than it has.
    let group = || new().number(3, 1);
    let groups = new()
        .number(3, 9)
        .list(4, (0..9).map(|_| group()).collect());
    refused(&with_footer(&[], &groups.end()), "without columns");
    let root = new().text(4, "root").number(5, i64::from(i32::MAX));
    refused(
        &with_footer(&[], &new().list(2, vec![root]).end()),
        "a schema that breaks off",
    );
    let empty = with_footer(&[], &new().end());
    refused(&empty, "there is no channel `a1`");
}

/// A recording of this program, three samples of which the second never came.
fn own(folder: &Path) -> PathBuf {
    let about = About {
        nominal_sample_rate: Some(512.0),
        ..About::of_names(["a1"])
    };
    let mut bytes = Vec::new();
    let mut rows = ParquetRows::begin(&mut bytes, about, Some(512.0), true).unwrap();
    for (x, health) in [
        (1.5, Health::GOOD),
        (0.0, Health::MISSING),
        (2.5, Health::OPEN),
    ] {
        rows.row(&[x], health).unwrap();
    }
    rows.finish().unwrap();
    let path = folder.join("own.parquet");
    std::fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn a_reading_that_was_changed_has_another_checksum() {
    let folder = tempfile::tempdir().unwrap();
    let path = own(folder.path());
    let whole = std::fs::read(&path).unwrap();
    assert_eq!(read(&whole), Ok(vec![1.5, 0.0, 2.5]));
    let at = whole.windows(4).position(|w| w == 1.5_f32.to_le_bytes());
    let mut changed = whole.clone();
    changed[at.unwrap()] ^= 1;
    refused(&changed, "sample 3, channel `a1`: readings whose checksum");
    // The writer's name is no longer ours: the same file is one of others, whose column of time is read.
    let at = whole.windows(9).rposition(|w| w == b"massline ").unwrap();
    changed[at..at + 8].copy_from_slice(b"somebody");
    assert_eq!(read(&changed).map(|all| all.len()), Ok(3));
    std::fs::write(&path, &changed).unwrap();
    let recording = Recording::open(&path, &["a1"]).unwrap();
    assert_eq!(recording.in_file().len(), 3);
    assert!(recording.ignored().is_empty(), "time and health are used");
}

/// Samples with faults and missing ones at the ends of what is decoded together, in a row, alone and at the end,
/// among many that go into blocks by the column.
#[test]
fn faults_stay_with_their_samples() {
    const COUNT: u64 = 5000;
    let health = |n: u64| match n {
        1023 | 1024 | 4321 => Health::OPEN,
        700..705 | 2048 | COUNT => Health::MISSING,
        3000 => Health::CHECKSUM.union(Health::OPEN),
        _ => Health::GOOD,
    };
    let reading = |n: u64, channel: usize| n as f32 + 1e4 * channel as f32;
    let names = ["a1", "a2", "a3"];
    let about = About {
        nominal_sample_rate: Some(512.0),
        ..About::of_names(names)
    };
    let mut bytes = Vec::new();
    let mut rows = ParquetRows::begin(&mut bytes, about, Some(512.0), true).unwrap();
    for n in 1..=COUNT {
        rows.row(&[0, 1, 2].map(|c| reading(n, c)), health(n))
            .unwrap();
    }
    rows.finish().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.parquet");
    std::fs::write(&path, bytes).unwrap();
    // In another order than that of the file.
    let mut recording = Recording::open(&path, &["a3", "a1"]).unwrap();
    let mut readings = [0.0; 2];
    for n in 1..=COUNT {
        assert!(
            recording.next_row_f64(|c, x| readings[c] = x).unwrap(),
            "{n}"
        );
        assert_eq!(recording.health(), health(n), "{n}");
        if !health(n).contains(Health::MISSING) {
            assert_eq!(readings, [2, 0].map(|c| f64::from(reading(n, c))), "{n}");
        }
    }
    assert!(!recording.next_row_f64(|_, _| ()).unwrap());
}
