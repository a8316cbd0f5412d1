//! The datasets of a universal file: those that are read, and the numbers of the others.

use super::header::{self, Header};
use super::nodes::Nodes;
use super::units::{self, System};
use crate::limits;
use crate::recording::bytes::{Bytes, Part};
use crate::recording::columns::most_common;
use crate::recording::{Place, RecordingError};
use std::collections::BTreeMap;
use std::io::{BufRead, Read};
use std::rc::Rc;

/// Most bytes of a line. Lines have 80 characters; programs that print doubles have twice that.
const LINE: u64 = 64 << 10;

/// A time history or a response over frequency of dataset 58.
#[derive(Clone)]
pub(super) struct Set {
    pub(super) header: Header,
    pub(super) unit: Option<String>,
    /// Line of its number, counted from one.
    pub(super) line: u64,
    /// First byte of its data and the byte behind them.
    pub(super) data: [u64; 2],
    /// Line of its first data.
    pub(super) data_line: u64,
    /// Of binary data: `true` if the most significant byte comes first.
    pub(super) binary: Option<bool>,
}

/// The time histories of a file, or the responses of one that has no time history, and notes on the
/// rest.
pub(super) struct Found {
    pub(super) sets: Vec<Set>,
    pub(super) notes: Vec<String>,
    pub(super) nodes: Nodes,
}

/// The lines of a file.
pub(super) struct Lines {
    bytes: Rc<Bytes>,
    pub(super) part: Part,
    /// Number of the line that was read last, from one.
    pub(super) number: u64,
    line: Vec<u8>,
}

impl Lines {
    pub(super) fn new(bytes: &Rc<Bytes>, [at, end]: [u64; 2], line: u64) -> Self {
        Self {
            bytes: Rc::clone(bytes),
            part: bytes.part(at, end),
            number: line.saturating_sub(1),
            line: Vec::new(),
        }
    }

    /// The next line without its end; `None` at the end of the file.
    pub(super) fn next(&mut self) -> Result<Option<&[u8]>, RecordingError> {
        self.line.clear();
        let at = self.part.at;
        let mut limited = self.part.by_ref().take(LINE);
        let count = limited.read_until(b'\n', &mut self.line);
        let count = count.map_err(|e| self.bytes.damaged(at, &e))?;
        self.number += 1;
        if count as u64 == LINE {
            let found = format!("a line of more than {} KiB", LINE >> 10);
            let place = Place::Line(self.number);
            return Err(self
                .bytes
                .malformed(place, "", found, "lines of 80 characters"));
        }
        Ok((count > 0).then(|| self.line.trim_ascii_end()))
    }

    fn text(&mut self) -> Result<Option<String>, RecordingError> {
        // Labels of single bytes, as on Windows, are labels still.
        let single = |line: &[u8]| line.iter().copied().map(char::from).collect();
        let line = self.next()?;
        Ok(line.map(|line| std::str::from_utf8(line).map_or_else(|_| single(line), str::to_owned)))
    }
}

pub(super) fn is_delimiter(line: &[u8]) -> bool {
    line.trim_ascii() == b"-1"
}

pub(super) fn scan(bytes: &Rc<Bytes>) -> Result<Found, RecordingError> {
    let mut lines = Lines::new(bytes, [0, bytes.len], 1);
    let mut found = Found {
        sets: Vec::new(),
        notes: Vec::new(),
        nodes: Nodes::default(),
    };
    let mut others: BTreeMap<u32, u64> = BTreeMap::new();
    let mut functions: BTreeMap<i64, u64> = BTreeMap::new();
    let mut responses: Vec<Set> = Vec::new();
    let mut system = None;
    while let Some(line) = lines.next()? {
        if line.trim_ascii().is_empty() {
            continue;
        }
        if !is_delimiter(line) {
            let text = String::from_utf8_lossy(line).into_owned();
            let place = Place::Line(lines.number);
            return Err(bytes.malformed(
                place,
                "",
                header::shown(&text),
                "-1, which begins a dataset",
            ));
        }
        let Some(title) = lines.text()? else { break };
        let place = Place::Line(lines.number);
        let Some(number) = header::number(title.as_bytes()) else {
            return Err(bytes.malformed(
                place,
                "",
                header::shown(&title),
                "the number of a dataset",
            ));
        };
        match number {
            58 => {
                let set = set(bytes, &mut lines, &title, system)?;
                if set.header.is_time_history() {
                    found.sets.push(set);
                } else if set.header.is_response() {
                    responses.push(set);
                } else {
                    *functions.entry(set.header.function).or_default() += 1;
                }
                if found.sets.len() + responses.len() > limits::COLUMNS {
                    let most = format!("at most {}", limits::COLUMNS);
                    return Err(bytes.malformed(place, "", "more datasets 58", most));
                }
            }
            164 => {
                // Code, and on the next lines the factors.
                system = units::system(&text(bytes, &mut lines, number, 3)?);
            }
            15 | 781 | 2411 if !title.contains('b') => {
                let begin = lines.number + 1;
                let pairs = number != 15;
                let most = 2 * limits::COLUMNS + 2;
                let text = text(bytes, &mut lines, number, most)?;
                let added = found.nodes.add(&text, pairs, system);
                added.map_err(|(line, wrong)| {
                    let expected =
                        "a node: its number, two coordinate systems, a colour, x, y and z";
                    bytes.malformed(Place::Line(begin + line), "", wrong, expected)
                })?;
            }
            // Header, and qualifiers of a dataset 58.
            151 | 1858 => rest(bytes, &mut lines, number)?,
            _ => {
                *others.entry(number).or_default() += 1;
                if title.contains('b') {
                    skip_binary(bytes, &mut lines, &title)?;
                }
                rest(bytes, &mut lines, number)?;
            }
        }
    }
    // Responses of one kind make a recording, where there are no time histories.
    let usual = most_common(responses.iter().map(|set| set.header.function));
    for set in responses {
        if found.sets.iter().all(|set| set.header.is_complex())
            && Some(set.header.function) == usual
        {
            found.sets.push(set);
        } else {
            *functions.entry(set.header.function).or_default() += 1;
        }
    }
    for (function, count) in functions {
        let name = function_name(function);
        found
            .notes
            .push(format!("{count} of dataset 58 not read: {name}"));
    }
    for (number, count) in others {
        let name = dataset_name(number);
        found
            .notes
            .push(format!("{count} of dataset {number} not read: {name}"));
    }
    found.notes.extend(found.nodes.notes());
    Ok(found)
}

/// The first lines of a dataset, `most` at most; the rest and the delimiter are left out.
fn text(
    bytes: &Bytes,
    lines: &mut Lines,
    number: u32,
    most: usize,
) -> Result<Vec<String>, RecordingError> {
    let mut text = Vec::new();
    while text.len() < most {
        match lines.text()? {
            Some(line) if is_delimiter(line.as_bytes()) => return Ok(text),
            // No line of these datasets is longer.
            Some(line) => text.push(line.chars().take(160).collect()),
            None => break,
        }
    }
    rest(bytes, lines, number)?;
    Ok(text)
}

/// Leaves out the lines of a dataset and the delimiter behind it.
fn rest(bytes: &Bytes, lines: &mut Lines, number: u32) -> Result<(), RecordingError> {
    while let Some(line) = lines.next()? {
        if is_delimiter(line) {
            return Ok(());
        }
    }
    let found = format!("the file ends within a dataset {number}");
    Err(bytes.malformed(Place::Line(lines.number), "", found, "-1, which ends it"))
}

/// Order of bytes (`true`: most significant first), lines of text and bytes of a binary dataset.
fn binary(
    bytes: &Bytes,
    title: &str,
    place: Place,
) -> Result<Option<(bool, u64, u64)>, RecordingError> {
    let Some((_, fields)) = title.split_once('b') else {
        return Ok(None);
    };
    let fields: Vec<u64> = fields
        .split_whitespace()
        .map_while(|f| f.parse().ok())
        .collect();
    match *fields.as_slice() {
        [order @ (1 | 2), 2, lines, count, ..] => Ok(Some((order == 2, lines, count))),
        [_, format @ (1 | 3), ..] => {
            let format = ["DEC VMS", "IBM 5/370"][usize::from(format == 3)];
            let found = format!("numbers in the form of {format}");
            Err(bytes.malformed(place, "", found, "IEEE 754"))
        }
        _ => Err(bytes.malformed(
            place,
            "",
            header::shown(title),
            "58b, order of bytes (1 or 2), form of numbers, lines of text, bytes of data",
        )),
    }
}

/// Leaves out the binary part of a dataset that is not read.
fn skip_binary(bytes: &Bytes, lines: &mut Lines, title: &str) -> Result<(), RecordingError> {
    if let Some((_, text, count)) = binary(bytes, title, Place::Line(lines.number))? {
        for _ in 0..text {
            if lines.next()?.is_none() {
                break;
            }
        }
        lines.part.at = lines.part.at.saturating_add(count).min(bytes.len);
    }
    Ok(())
}

/// `true` if a delimiter stands at a byte, or behind the end of a line there.
fn ends_behind(bytes: &Rc<Bytes>, at: u64) -> bool {
    let mut next = Vec::new();
    let read = bytes.part(at, at.saturating_add(16)).read_to_end(&mut next);
    read.is_ok() && next.trim_ascii_start().starts_with(b"-1")
}

fn set(
    bytes: &Rc<Bytes>,
    lines: &mut Lines,
    title: &str,
    system: Option<System>,
) -> Result<Set, RecordingError> {
    let line = lines.number;
    let binary = binary(bytes, title, Place::Line(line))?;
    let mut text = Vec::with_capacity(Header::LINES);
    while text.len() < Header::LINES {
        let Some(line) = lines.text()? else { break };
        text.push(line);
    }
    let header = Header::read(&text).map_err(|(number, found, expected)| {
        bytes.malformed(Place::Line(line + number), "", found, expected)
    })?;
    let unit = units::unit(&header, system);
    let start = lines.part.at;
    let data_line = lines.number + 1;
    if let Some((_, text, _)) = binary
        && text != Header::LINES as u64
    {
        let found = format!("{text} lines of text");
        return Err(bytes.malformed(Place::Line(line), "", found, "11"));
    }
    let Some((big, _, stated)) = binary else {
        let mut end = start;
        loop {
            match lines.next()? {
                Some(line) if is_delimiter(line) => break,
                Some(_) => end = lines.part.at,
                None => {
                    let found = "the file ends within its data";
                    let place = Place::Line(lines.number);
                    return Err(bytes.malformed(place, "", found, "-1 behind them"));
                }
            }
        }
        return Ok(Set {
            header,
            unit,
            line,
            data: [start, end],
            data_line,
            binary: None,
        });
    };
    let number = if header.is_double() { 8 } else { 4 };
    let parts = if header.is_complex() { 2 } else { 1 };
    // Abscissae have single precision; some programs write them as the ordinates.
    let pairs: &[u64] = if header.even { &[0] } else { &[4, number] };
    let sizes = pairs
        .iter()
        .map(|pair| header.points.checked_mul(parts * number + pair));
    let needed = sizes.clone().next().flatten();
    // Some programs state no length, or that of the points' real parts alone: then that one holds
    // behind which the dataset ends.
    let length = match needed {
        Some(needed) if stated < needed => {
            let mut sizes = sizes.flatten();
            let ended = sizes.find(|size| ends_behind(bytes, start.saturating_add(*size)));
            ended.unwrap_or(if stated == 0 { needed } else { stated })
        }
        _ => stated,
    };
    if needed.is_none_or(|needed| length < needed) || length > bytes.len - start.min(bytes.len) {
        let found = format!(
            "{length} bytes of data, and {} behind this place",
            bytes.len - start
        );
        let expected = format!("those of {} points", header.points);
        return Err(bytes.malformed(Place::Byte(start), "", found, expected));
    }
    lines.part.at = start + length;
    // The delimiter follows at once, or behind the end of a line.
    loop {
        match lines.next()? {
            Some(line) if is_delimiter(line) => break,
            Some([]) => {}
            _ => {
                let place = Place::Byte(start + length);
                return Err(bytes.malformed(place, "", "something else", "-1 behind binary data"));
            }
        }
    }
    Ok(Set {
        header,
        unit,
        line,
        data: [start, start + length],
        data_line,
        binary: Some(big),
    })
}

fn function_name(function: i64) -> String {
    const NAMES: [&str; 12] = [
        "time responses that are complex or not over time",
        "auto spectra",
        "cross spectra",
        "frequency responses",
        "transmissibilities",
        "coherences",
        "auto correlations",
        "cross correlations",
        "power spectral densities",
        "energy spectral densities",
        "probability densities",
        "spectra",
    ];
    let name = usize::try_from(function).ok();
    let name = name.and_then(|f| NAMES.get(f.checked_sub(1)?));
    name.map_or_else(
        || format!("functions of type {function}"),
        |name| (*name).to_owned(),
    )
}

fn dataset_name(number: u32) -> &'static str {
    match number {
        18 | 2420 => "coordinate systems",
        55 => "data at nodes",
        71 | 780 | 2412 => "elements",
        82 => "trace lines",
        2414 => "analysis data",
        2429 | 2467 | 2477 => "groups",
        _ => "its content is not known here",
    }
}
