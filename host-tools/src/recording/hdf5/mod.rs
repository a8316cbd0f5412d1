//! HDF5: datasets of one and two dimensions, as MATLAB (MAT files of version 7.3), netCDF-4 and
//! programs of laboratories write them.
//!
//! The reader is our own, by the description of the format: crates that read it take a part of a
//! dataset along its first dimension only, which is the one of the channels in files of MATLAB and
//! of netCDF-4, or read the index of all chunks again for each part.

mod attributes;
mod channels;
mod chunks;
mod dataset;
mod file;
mod filters;
mod heap;
mod links;
mod names;
mod object;
mod readings;
mod tables;
mod types;

use super::bytes::Bytes;
use super::columns::{Columns, Reading, Series, most_common};
use super::source::{Channel, Place, StatedRate};
use super::{Format, Mismatch, RecordingError};
use crate::format::plain;
use crate::limits;
use file::{File, SIGNATURE, STARTS};
use readings::{Numbers, Readings};
use std::cell::Cell;
use std::rc::Rc;
use tables::{Found, Table};

/// The format.
pub(super) const FORMAT: Format = Format {
    recognises: |start| {
        let mut starts = STARTS.iter().filter_map(|at| start.get(*at as usize..));
        starts.any(|start| start.starts_with(SIGNATURE))
    },
    open: |input, _| {
        let matlab = input.start.starts_with(b"MATLAB");
        Ok(Box::new(columns(
            Bytes::open(input, "an HDF5 file")?,
            matlab,
        )?))
    },
};

/// A channel: its table, and its number in it.
struct Slice {
    table: usize,
    number: u64,
}

fn columns(bytes: Rc<Bytes>, matlab: bool) -> Result<Columns, RecordingError> {
    let file = Rc::new(File::open(bytes)?);
    let Found { tables, notes } = tables::tables(&file, matlab)?;
    let across: u64 = tables
        .iter()
        .map(|table| table.across)
        .fold(0, u64::saturating_add);
    if across > limits::COLUMNS as u64 {
        return Err(RecordingError::TooManyColumns {
            file: file.bytes.file.clone(),
            found: usize::try_from(across).unwrap_or(usize::MAX),
        });
    }
    let usual = most_common(tables.iter().flat_map(|table| {
        let each = usize::try_from(table.across).unwrap_or(usize::MAX);
        std::iter::repeat_n(table.samples, each.min(limits::COLUMNS))
    }));
    let Some(samples) = usual else {
        return Err(RecordingError::Malformed {
            file: file.bytes.file.clone(),
            place: None,
            mismatch: Box::new(Mismatch {
                channel: String::new(),
                found: match notes.as_slice() {
                    [] => "no dataset of numbers".to_owned(),
                    notes => notes.join("; "),
                },
                expected: "vectors, one a channel, or a matrix of samples and channels".to_owned(),
                advice: "save the samples as such datasets",
            }),
        });
    };
    let usual = tables.iter().filter(|table| table.samples == samples);
    let rate = usual.clone().find_map(|table| table.rate);
    let form = match matlab {
        true => format!("MAT file of version 7.3, variables: {}", tables.len()),
        false => format!("HDF5 file, datasets of numbers: {}", tables.len()),
    };
    let channels = channels::channels(&tables);
    let slices: Vec<Slice> = (0..)
        .zip(&tables)
        .flat_map(|(number, table): (usize, &Table)| {
            (0..table.across).map(move |own| Slice {
                table: number,
                number: own,
            })
        })
        .collect();
    file.known();
    let held = Rc::new(Cell::new(0));
    let shared: Vec<(u64, u64, Option<f64>, Rc<Numbers>)> = tables
        .into_iter()
        .map(|table| {
            let at = table.dataset.at;
            let (samples, rate) = (table.samples, table.rate);
            let numbers = Numbers::new(&file, table.dataset, table.coding, table.time, &held);
            (at, samples, rate, Rc::new(numbers))
        })
        .collect();
    let labels: Vec<String> = channels.iter().map(|c: &Channel| c.name.clone()).collect();
    let open = move |channel: usize| -> Result<Box<dyn Series>, RecordingError> {
        let label = labels.get(channel).map_or("", String::as_str);
        let slice = slices.get(channel);
        let table = slice.and_then(|slice| shared.get(slice.table));
        let (Some(slice), Some((at, count, own, numbers))) = (slice, table) else {
            return Err(file
                .bytes
                .malformed(Place::Byte(0), label, "nothing", "a channel"));
        };
        let other = |found: String, expected: String| RecordingError::Malformed {
            file: file.bytes.file.clone(),
            place: Some(Place::Byte(file.byte(*at))),
            mismatch: Box::new(Mismatch {
                channel: label.to_owned(),
                found,
                expected: format!("{expected} as the other channels have"),
                advice: "channels of one recording share their samples: export the others to a file of their own",
            }),
        };
        if *count != samples {
            return Err(other(format!("{count} samples"), samples.to_string()));
        }
        if let (Some(own), Some(rate)) = (own, rate)
            && *own != rate
        {
            let found = format!("{} samples per second", plain(*own, 6));
            return Err(other(found, plain(rate, 6)));
        }
        Ok(Box::new(Readings::new(numbers, slice.number, label)))
    };
    Ok(Columns {
        channels,
        positions: Vec::new(),
        samples,
        rate: rate.map(|value| StatedRate {
            value,
            place: "a number beside its samples",
        }),
        time: None,
        form,
        notes,
        open: Box::new(open),
        reading: Reading::default(),
    })
}
