//! A recording, plain or compressed.
//!
//! The first byte chooses the file's name, the channels and what the setup states of the form; the
//! rest is the file, or its uncompressed content.

use crate::scratch::{Scratch, assert_message};
use crate::script::Bytes;
use flate2::Compression;
use flate2::write::GzEncoder;
use massline::recording::{Form, HEALTH_COLUMN, Recording, RecordingError, spell};
use massline_firmware::wire::Health;
use std::io::Write;
use std::path::Path;

/// Channels that are requested.
const CHANNELS: [&str; 2] = ["a1", "fx"];
/// The same in files whose channels have numbers.
const NUMBERS: [&str; 2] = ["1", "2"];

/// The request of an input.
struct Request {
    channels: [&'static str; 2],
    /// Sample rate of the setup, Hz.
    rate: Option<f64>,
    form: Form,
}

impl Request {
    fn of(choice: u8) -> Self {
        let lines = choice & 32 != 0;
        Self {
            channels: if choice & 8 != 0 { NUMBERS } else { CHANNELS },
            rate: (choice & 4 != 0).then_some(512.0),
            form: Form {
                delimiter: (choice & 16 != 0).then_some(b';'),
                decimal: (choice & 16 != 0).then_some(b','),
                header: lines.then_some(2),
                first_row: lines.then_some(4),
                time: (choice & 64 != 0).then(|| "fz".to_owned()),
            },
        }
    }
}

/// Runs the target; see the module.
pub fn run(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    let choice = bytes.u8();
    let text = bytes.0;
    let scratch = Scratch::new();
    let request = Request::of(choice);
    match choice & 3 {
        // Any bytes with a name for compressed files.
        0 => {
            let file = scratch.file("any.csv.gz", text);
            drop(read(&file, &request));
        }
        // A compressed text reads as the plain one; bytes that are compressed already do not.
        1 if !text.starts_with(&[0x1f, 0x8b]) => {
            let plain = outcome(read(&scratch.file("a.csv", text), &request));
            let packed = outcome(read(&scratch.file("a.csv.gz", &gzip(text)), &request));
            // Channels that lie one after the other are not read while they are unpacked.
            let refused = |text: &String| text.contains("compressed by gzip");
            if !packed.as_ref().is_err_and(refused) {
                assert_eq!(plain, packed);
            }
        }
        _ => {
            let found = read(&scratch.file("a.csv", text), &request);
            let plain = choice & !3 == 0;
            if let Some(expected) = naive(text).filter(|_| plain) {
                match found {
                    Ok((rows, _)) => assert_eq!(bits(&rows), bits(&expected)),
                    Err(error) => panic!("{error}"),
                }
            }
        }
    }
}

/// Rows of readings, and of faults.
type Table = (Vec<Vec<f64>>, Vec<Health>);

fn read(file: &Path, request: &Request) -> Result<Table, RecordingError> {
    let table = rows(file, request);
    if let Err(error) = &table {
        let text = error.to_string();
        assert_message(&text);
        assert!(text.contains(".csv"), "no file is named: {text}");
    }
    table
}

fn rows(file: &Path, request: &Request) -> Result<Table, RecordingError> {
    let mut recording = Recording::open_in(file, &request.channels, &request.form)?;
    let mut notes = Vec::new();
    recording.notice_columns(&mut notes);
    notes.extend(recording.described());
    notes.iter().for_each(|note| assert_message(note));
    if request.rate.is_some() || request.form.time.is_some() {
        let rate = recording.settle_rate(request.rate)?;
        assert!(rate > 0.0 && rate.is_finite());
    }
    let mut preamble = Vec::new();
    // A recording read from lines can be written as lines.
    let written = recording.preamble().write(&mut preamble);
    written.expect("a list takes all that is written to it");
    let (mut readings, mut faults) = (Vec::new(), Vec::new());
    loop {
        let mut row = vec![f64::NAN; CHANNELS.len()];
        if !recording.next_row_f64(|channel, value| row[channel] = value)? {
            break;
        }
        assert!(row.iter().all(|x| x.is_finite()), "{row:?}");
        let health = recording.health();
        assert_eq!(spell(health).is_empty(), health.is_good());
        readings.push(row);
        faults.push(health);
        assert_eq!(recording.rows(), readings.len() as u64);
    }
    assert!(!readings.is_empty());
    Ok((readings, faults))
}

/// Comparable results: the numbers, or the error without the file's name.
fn outcome(table: Result<Table, RecordingError>) -> Result<(Vec<u64>, Vec<Health>), String> {
    match table {
        Ok((rows, faults)) => Ok((bits(&rows), faults)),
        Err(error) => {
            let text = error.to_string();
            let (_, reason) = text.split_once(".csv").unwrap_or_default();
            Err(reason.trim_start_matches(".gz").to_owned())
        }
    }
}

fn bits(rows: &[Vec<f64>]) -> Vec<u64> {
    rows.iter().flatten().map(|x| x.to_bits()).collect()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.expect("a list takes all that is written to it")
}

/// A simple reader of plain tables: names without blanks or quotes, numbers between commas, lines
/// that end in line feeds. `None` for anything else.
fn naive(text: &[u8]) -> Option<Vec<Vec<f64>>> {
    let text = std::str::from_utf8(text).ok()?.strip_suffix('\n')?;
    let mut lines = text.split('\n');
    let name = |name: &&str| !name.is_empty() && name.bytes().all(|b| b.is_ascii_alphanumeric());
    let names: Vec<&str> = lines.next()?.split(',').collect();
    let named = names.iter().all(name) && !names.contains(&HEALTH_COLUMN);
    let once = |name: &&&str| names.iter().filter(|n| n == name).count() == 1;
    if !named || !names.iter().all(|n| once(&n)) {
        return None;
    }
    let place = |channel: &str| names.iter().position(|name| *name == channel);
    let places = [place(CHANNELS[0])?, place(CHANNELS[1])?];
    let mut rows = Vec::new();
    for line in lines {
        let fields: Vec<&str> = line.split(',').collect();
        let plain = |b: u8| b.is_ascii_digit() || b"+-.eE".contains(&b);
        if fields.len() != names.len() || !line.bytes().all(|b| plain(b) || b == b',') {
            return None;
        }
        let mut row = Vec::new();
        for place in places {
            let number: f64 = fields[place].parse().ok()?;
            // Readings have single precision.
            (number as f32).is_finite().then(|| row.push(number))?;
        }
        rows.push(row);
    }
    (!rows.is_empty()).then_some(rows)
}
