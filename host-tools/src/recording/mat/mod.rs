//! MAT files of version 5 (to which MATLAB's `-v6` and `-v7` belong): numeric vectors, one a
//! channel, and matrices of samples and channels.

mod elements;

use super::bytes::Bytes;
use super::columns::{Columns, Reading, Series, most_common};
use super::rate;
use super::source::{Channel, Place, StatedRate};
use super::{Format, Mismatch, RecordingError};
use crate::limits;
use crate::printable::printable;
use elements::{Numbers, Variable};
use std::rc::Rc;

/// The format.
pub(super) const FORMAT: Format = Format {
    recognises: |start| {
        matches!(
            start.get(124..128),
            Some([0, 1, b'I', b'M'] | [1, 0, b'M', b'I'])
        )
    },
    open: |input, _| Ok(Box::new(columns(Bytes::open(input, "a MAT file")?)?)),
};

/// A channel: numbers of a variable.
#[derive(Clone)]
struct Slice {
    variable: usize,
    /// Number of its first value, of values, and from one to the next.
    first: u64,
    count: u64,
    stride: u64,
}

fn columns(bytes: Rc<Bytes>) -> Result<Columns, RecordingError> {
    let (variables, mut notes) = elements::variables(&bytes)?;
    let mut rate = None;
    let mut channels = Vec::new();
    let mut slices = Vec::new();
    for (number, variable) in variables.iter().enumerate() {
        let [rows, across] = variable.dimensions;
        let name = printable(&variable.name).into_owned();
        if rows * across <= 1 {
            rate = rate.or(stated_rate(&bytes, variable)?);
            continue;
        }
        // Samples go along the longer side.
        let [count, others] = if rows >= across {
            [rows, across]
        } else {
            [across, rows]
        };
        if channels.len() as u64 + others > limits::COLUMNS as u64 {
            return Err(RecordingError::TooManyColumns {
                file: bytes.file.clone(),
                found: channels.len().saturating_add(others as usize),
            });
        }
        for other in 0..others {
            let name = match others {
                1 => name.clone(),
                _ => format!("{name}:{}", other + 1),
            };
            channels.push(Channel {
                name,
                ..Channel::default()
            });
            // Numbers lie column by column.
            let [first, stride] = if rows >= across {
                [other * rows, 1]
            } else {
                [other, rows]
            };
            slices.push(Slice {
                variable: number,
                first,
                count,
                stride,
            });
        }
    }
    let Some(samples) = most_common(slices.iter().map(|slice| slice.count)) else {
        return Err(RecordingError::Malformed {
            file: bytes.file.clone(),
            place: None,
            mismatch: Box::new(Mismatch {
                channel: String::new(),
                found: "no numeric vector or matrix".to_owned(),
                expected: "vectors, one a channel, or a matrix of samples and channels".to_owned(),
                advice: "save the samples as such variables: those within a struct or a cell are not read",
            }),
        });
    };
    let form = format!("MAT file of version 5, {} variables", variables.len());
    notes.dedup();
    let labels: Vec<String> = channels.iter().map(|c| c.name.clone()).collect();
    let open = move |channel: usize| -> Result<Box<dyn Series>, RecordingError> {
        let label = labels.get(channel).map_or("", String::as_str);
        let slice = slices.get(channel);
        let variable = slice.and_then(|slice| variables.get(slice.variable));
        let (Some(slice), Some(variable)) = (slice, variable) else {
            return Err(bytes.malformed(Place::Byte(0), label, "nothing", "a channel"));
        };
        if slice.count != samples {
            let found = format!("{} samples", slice.count);
            let expected = format!("{samples} as the other channels have");
            return Err(bytes.malformed(Place::Byte(variable.at), label, found, expected));
        }
        let numbers = Numbers::new(&bytes, variable, slice.first, slice.stride, label)?;
        Ok(Box::new(numbers))
    };
    Ok(Columns {
        channels,
        positions: Vec::new(),
        samples,
        rate,
        time: None,
        form,
        notes,
        open: Box::new(open),
        reading: Reading::default(),
    })
}

/// The sample rate that a scalar states by its name.
fn stated_rate(
    bytes: &Rc<Bytes>,
    variable: &Variable,
) -> Result<Option<StatedRate>, RecordingError> {
    if variable.dimensions != [1, 1] {
        return Ok(None);
    }
    let number = Numbers::new(bytes, variable, 0, 1, &variable.name)?.next()?;
    Ok(
        rate::stated(&variable.name, || Some(number)).map(|value| StatedRate {
            value,
            place: "a scalar beside its samples",
        }),
    )
}
