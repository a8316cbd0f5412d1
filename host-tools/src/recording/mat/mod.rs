//! MAT files of version 5 (to which MATLAB's `-v6` and `-v7` belong): numeric vectors, one a
//! channel, and matrices of samples and channels, which may be fields of structs.

mod elements;
mod inflater;

use super::bytes::Bytes;
use super::columns::{Columns, Reading, Series, most_common};
use super::rate;
use super::source::{Channel, Place, StatedRate};
use super::testlab::{Part, Signal, Signals};
use super::{Format, Mismatch, RecordingError};
use crate::limits;
use crate::printable::{printable, quoted};
use elements::{Contents, Numbers, Variable};
use inflater::Places;
use std::collections::HashMap;
use std::rc::Rc;

/// Names of the field of a struct that is time, in lower case.
const TIMES: [&str; 2] = ["time", "t"];

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

/// The channels of a file, and the numbers of each.
#[derive(Default)]
struct Channels {
    channels: Vec<Channel>,
    slices: Vec<Slice>,
    rate: Option<StatedRate>,
    notes: Vec<String>,
}

impl Channels {
    /// Takes the numbers of a variable, whose samples go along the longer side.
    fn add(
        &mut self,
        bytes: &Bytes,
        (number, variable): (usize, &Variable),
        labels: impl FnOnce(usize) -> Vec<(String, Option<String>)>,
    ) -> Result<(), RecordingError> {
        let [rows, across] = variable.dimensions;
        let (count, others) = (rows.max(across), rows.min(across));
        if self.channels.len() as u64 + others > limits::COLUMNS as u64 {
            return Err(RecordingError::TooManyColumns {
                file: bytes.file.clone(),
                found: self.channels.len().saturating_add(others as usize),
            });
        }
        for (other, (name, unit)) in (0..).zip(labels(others as usize)) {
            self.channels.push(Channel {
                name: printable(&name).into_owned(),
                unit: unit.map(|unit| printable(&unit).into_owned()),
                direction: None,
            });
            // Numbers lie column by column.
            let [first, stride] = if rows >= across {
                [other * rows, 1]
            } else {
                [other, rows]
            };
            self.slices.push(Slice {
                variable: number,
                first,
                count,
                stride,
            });
        }
        Ok(())
    }

    /// Takes a signal of Testlab, if its samples are those of the same times as others.
    fn add_signal(
        &mut self,
        bytes: &Bytes,
        variable: (usize, &Variable),
        (owner, signal): (&str, &Signal),
    ) -> Result<(), RecordingError> {
        match signal.rate(self.rate.map(|rate| rate.value)) {
            Err(why) => {
                let name = quoted(owner);
                let note = format!("variable `{name}` not read: {why}");
                self.notes.push(note);
                return Ok(());
            }
            Ok(value) => {
                self.rate.get_or_insert(StatedRate {
                    value,
                    place: "an increment beside its samples",
                });
            }
        }
        self.add(bytes, variable, |count| signal.labels(owner, count))
    }
}

fn columns(bytes: Rc<Bytes>) -> Result<Columns, RecordingError> {
    let contents = elements::contents(&bytes)?;
    let places = Places::default();
    let names = contents.variables.iter().map(|variable| &*variable.name);
    let scalars = contents.variables.iter().filter(|v| v.dimensions == [1, 1]);
    let scalars: HashMap<&str, &Variable> = scalars.map(|v| (&*v.name, v)).collect();
    let number = |name: &str| {
        let value = |v: &&Variable| Numbers::new(&bytes, v, (0, 1), name, &places)?.next();
        scalars.get(name).map(value).transpose()
    };
    let signals = Signals::of(names, &contents.texts, number)?;
    let mut found = Channels::default();
    for variable in contents.variables.iter().enumerate() {
        let name = &variable.1.name;
        let is_scalar = variable.1.dimensions == [1, 1];
        match signals.part(name) {
            Some(Part::Samples(owner, signal)) => {
                found.add_signal(&bytes, variable, (owner, signal))?;
            }
            Some(Part::Beside) => {}
            None if is_scalar => {
                found.rate = found.rate.or(stated_rate(&bytes, variable.1, &places)?)
            }
            None => found.add(&bytes, variable, |count| match count {
                1 => vec![(name.clone(), None)],
                _ => (1..=count).map(|n| (format!("{name}:{n}"), None)).collect(),
            })?,
        }
    }
    let Contents {
        variables,
        mut notes,
        ..
    } = contents;
    notes.extend(found.notes);
    let (channels, slices, rate) = (found.channels, found.slices, found.rate);
    let Some(samples) = most_common(slices.iter().map(|slice| slice.count)) else {
        return Err(RecordingError::Malformed {
            file: bytes.file.clone(),
            place: None,
            mismatch: Box::new(Mismatch {
                channel: String::new(),
                found: "no numeric vector or matrix".to_owned(),
                expected: "vectors, one a channel, or a matrix of samples and channels".to_owned(),
                advice: "save the samples as such variables, or as fields of a struct",
            }),
        });
    };
    let is_time = |(channel, slice): (&Channel, &Slice)| {
        let (_, field) = channel.name.rsplit_once('.').unwrap_or_default();
        slice.count == samples && TIMES.contains(&&*field.to_lowercase())
    };
    let time = channels.iter().zip(&slices).position(is_time);
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
        let numbers = Numbers::new(
            &bytes,
            variable,
            (slice.first, slice.stride),
            label,
            &places,
        )?;
        Ok(Box::new(numbers))
    };
    Ok(Columns {
        channels,
        positions: Vec::new(),
        samples,
        rate,
        time,
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
    places: &Places,
) -> Result<Option<StatedRate>, RecordingError> {
    let number = Numbers::new(bytes, variable, (0, 1), &variable.name, places)?.next()?;
    let (_, name) = variable
        .name
        .rsplit_once('.')
        .unwrap_or(("", &variable.name));
    Ok(rate::stated(name, || Some(number)).map(|value| StatedRate {
        value,
        place: "a scalar beside its samples",
    }))
}
