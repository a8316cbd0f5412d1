//! `sensors.csv`: one row a sensor.

use super::InitError;
use super::channels::{Found, Sensor};
use super::names::{Kind, parse};
use crate::printable::quoted;
use crate::recording::split_label;
use crate::setup::{Mount, along, nearest, read_document};
use csv::{ReaderBuilder, StringRecord, Trim};
use std::path::Path;

/// Coordinate without a unit from which it cannot be guessed to be in m.
const FARTHEST: f64 = 10.0;

const COLUMNS: [&str; 8] = [
    "name",
    "x",
    "y",
    "z",
    "directions",
    "unit",
    "sensitivity",
    "mount",
];

/// Fills in what a table says of the sensors; those that it does not name are left out.
///
/// # Errors
/// [`InitError`] with file and line.
pub fn fill(found: &mut Found, file: &Path) -> Result<(), InitError> {
    let bytes = read_document(file).map_err(|e| InitError::Unreadable {
        file: file.to_owned(),
        reason: e.to_string(),
    })?;
    let text = String::from_utf8_lossy(&bytes);
    let text = text.trim_start_matches('\u{feff}');
    let separator = match text.lines().next().unwrap_or_default() {
        header if header.contains(';') => b';',
        header if header.contains('\t') => b'\t',
        _ => b',',
    };
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .delimiter(separator)
        .trim(Trim::All)
        .from_reader(text.as_bytes());
    let mut rows = Vec::new();
    let mut record = StringRecord::new();
    while reader
        .read_record(&mut record)
        .map_err(|e| InitError::Unreadable {
            file: file.to_owned(),
            reason: e.to_string(),
        })?
    {
        let line = line_before(text, reader.position().byte());
        rows.push((line, record.clone()));
    }
    let wrong = |line: u64, reason: String| InitError::Table {
        file: file.to_owned(),
        line,
        reason,
    };
    let mut rows = rows.into_iter();
    let (line, header) = rows.next().ok_or_else(|| {
        wrong(
            1,
            format!("it is empty; expected the columns {}", COLUMNS.join(", ")),
        )
    })?;
    let (columns, length) = columns(&header).map_err(|reason| wrong(line, reason))?;
    let has_unit = length.is_some();
    if let Some(length) = length {
        found.length_unit = length;
    }
    let mut filled: Vec<Sensor> = Vec::new();
    for (line, record) in rows {
        if record.len() != columns.len() {
            return Err(wrong(
                line,
                format!(
                    "the row has {} fields; expected {}, one for each column",
                    record.len(),
                    columns.len()
                ),
            ));
        }
        let field = |column: &str| {
            let at = columns.iter().position(|c| c == column)?;
            record.get(at).filter(|text| !text.is_empty())
        };
        let sensor = row(found, &field, separator).map_err(|reason| wrong(line, reason))?;
        let far = |x: &&f64| !has_unit && x.abs() > FARTHEST;
        if let Some(x) = sensor.position.iter().flatten().find(far) {
            let name = quoted(&sensor.name);
            return Err(wrong(
                line,
                format!(
                    "\"{name}\" is at {x}, and the header states no unit; write `x [mm],y [mm],z [mm]` there, or [m], [cm] or [in]"
                ),
            ));
        }
        let twice = |s: &Sensor| s.channels.iter().any(|c| sensor.channels.contains(c));
        if filled.iter().any(twice) {
            let name = quoted(&sensor.name);
            return Err(wrong(
                line,
                format!("the sensor \"{name}\" has a row already; leave one of them"),
            ));
        }
        filled.push(sensor);
    }
    let named = |channel: &String| filled.iter().any(|s| s.channels.contains(channel));
    let all = found.sensors.iter().flat_map(|s| &s.channels);
    let left_out: Vec<String> = all.filter(|c| !named(c)).cloned().collect();
    found.left_out.extend(left_out);
    found.sensors = filled;
    Ok(())
}

/// Line, from one, on which the row before a byte of the text ends: that of the reader lies before it where
/// comments stand, and does not know ends of two bytes.
fn line_before(text: &str, byte: u64) -> u64 {
    let end = usize::try_from(byte).unwrap_or(usize::MAX);
    let before = text.as_bytes().get(..end).unwrap_or(text.as_bytes());
    1 + before
        .trim_ascii_end()
        .iter()
        .filter(|b| **b == b'\n')
        .count() as u64
}

/// Names of the columns, and the unit of the positions where the header states it.
fn columns(header: &StringRecord) -> Result<(Vec<String>, Option<String>), String> {
    let mut names: Vec<String> = Vec::new();
    let mut lengths = Vec::new();
    for field in header {
        let (name, unit) = split_label(field);
        let name = name.to_lowercase();
        if !COLUMNS.contains(&name.as_str()) {
            let hint = nearest(&name, COLUMNS.into_iter());
            return Err(format!(
                "there is no column \"{}\" here; {hint}",
                quoted(&name)
            ));
        }
        if ["x", "y", "z"].contains(&name.as_str()) {
            lengths.push(unit.map(str::to_owned));
        }
        if names.contains(&name) {
            return Err(format!(
                "the column \"{name}\" stands there twice; leave one"
            ));
        }
        names.push(name);
    }
    for needed in ["name", "x", "y", "z"] {
        if !names.iter().any(|name| name == needed) {
            return Err(format!(
                "the column \"{needed}\" is missing; expected {}, of which name, x, y and z are needed",
                COLUMNS.join(", ")
            ));
        }
    }
    let first = lengths.first().cloned().flatten();
    if lengths.iter().any(|unit| *unit != first) {
        return Err("x, y and z have different units; give all three in one".to_owned());
    }
    match first {
        Some(unit) if !["m", "mm", "cm", "in"].contains(&unit.as_str()) => Err(format!(
            "positions are in \"{}\"; expected \"m\", \"mm\", \"cm\" or \"in\"",
            quoted(&unit)
        )),
        unit => Ok((names, unit)),
    }
}

/// The sensor that a row describes, whose fields `separator` parts.
fn row<'r>(
    found: &Found,
    field: &dyn Fn(&str) -> Option<&'r str>,
    separator: u8,
) -> Result<Sensor, String> {
    let name = field("name").ok_or("the row has no name; write that of the sensor")?;
    let mut sensor = sensor(found, name)?;
    let mut position = [0.0; 3];
    for (slot, column) in position.iter_mut().zip(["x", "y", "z"]) {
        let text = field(column).unwrap_or_default();
        // A comma is a decimal one where none lies between fields.
        let number = match separator {
            b',' => text.parse::<f64>(),
            _ => text.replace(',', ".").parse(),
        };
        let number = number.ok().filter(|x| x.is_finite());
        *slot = number.ok_or_else(|| {
            format!(
                "`{column}` of \"{}\" is \"{}\"; expected a number",
                quoted(name),
                quoted(text)
            )
        })?;
    }
    sensor.position = Some(position);
    if let Some(text) = field("directions") {
        let words: Vec<&str> = text.split_whitespace().collect();
        if words.len() != sensor.channels.len() || words.iter().any(|word| along(word).is_none()) {
            return Err(format!(
                "`directions` of \"{}\" is \"{}\"; expected a word such as +x or -z for each of its {} channels, with blanks between them",
                quoted(name),
                quoted(text),
                sensor.channels.len()
            ));
        }
        sensor.directions = words.iter().map(|word| word.to_lowercase()).collect();
    }
    if let Some(unit) = field("unit") {
        sensor.kind = parse(&sensor.channels[0], Some(unit)).kind.or(sensor.kind);
        sensor.unit = Some(unit.to_owned());
    }
    sensor.sensitivity = field("sensitivity").map(str::to_owned);
    match field("mount") {
        None => {}
        Some("interface") => sensor.mount = Some(Mount::Interface),
        Some("structure") => sensor.mount = Some(Mount::Structure),
        Some("load cell" | "load_cell") => {
            sensor.mount = None;
            if sensor.kind != Some(Kind::Moment) {
                sensor.kind = Some(Kind::Force);
            }
        }
        Some(other) => {
            return Err(format!(
                "`mount` of \"{}\" is \"{}\"; expected \"interface\", \"structure\" or \"load cell\"",
                quoted(name),
                quoted(other)
            ));
        }
    }
    if sensor.mount.is_some() && sensor.kind.is_none() {
        sensor.kind = Some(Kind::Acceleration);
    }
    Ok(sensor)
}

/// A sensor by its name, or by one of its channels.
fn sensor(found: &Found, name: &str) -> Result<Sensor, String> {
    let name = split_label(name).0;
    if let Some(sensor) = found.sensors.iter().find(|s| s.name == name) {
        return Ok(sensor.clone());
    }
    let with = |s: &&Sensor| s.channels.iter().any(|c| c == name);
    if let Some(sensor) = found.sensors.iter().find(with) {
        let at = sensor.channels.iter().position(|c| c == name).unwrap_or(0);
        return Ok(Sensor {
            name: name.to_owned(),
            channels: vec![name.to_owned()],
            directions: sensor.directions.get(at).cloned().into_iter().collect(),
            ..sensor.clone()
        });
    }
    let known = found.sensors.iter().map(|s| s.name.as_str());
    Err(format!(
        "the recordings have no sensor \"{}\"; {}",
        quoted(name),
        nearest(name, known)
    ))
}
