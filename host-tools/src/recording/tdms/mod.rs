//! TDMS of LabVIEW and DIAdem: raw data, contiguous or interleaved, in any number of segments.

mod metadata;
mod segments;

use super::bytes::Bytes;
use super::columns::{Columns, Reading, Series, most_common};
use super::names::with_units;
use super::source::{Channel, Place, StatedRate};
use super::{Format, Mismatch, RecordingError};
use crate::printable::printable;
use metadata::Object;
use segments::{Stretches, Values};
use std::collections::HashMap;
use std::rc::Rc;

/// The format.
pub(super) const FORMAT: Format = Format {
    recognises: |start| start.starts_with(b"TDSm") || start.starts_with(b"TDSh"),
    open: |input, _| {
        if input.start.starts_with(b"TDSh") {
            return Err(RecordingError::OtherKind {
                file: input.file,
                kind: "the index of a TDMS file".to_owned(),
                advice: "name the file without _index, which has the samples",
            });
        }
        Ok(Box::new(columns(Bytes::open(input, "a TDMS file")?)?))
    },
};

fn columns(bytes: Rc<Bytes>) -> Result<Columns, RecordingError> {
    let segments::Found {
        objects,
        segments,
        notes,
    } = segments::read(&bytes)?;
    let segments = Rc::new(segments);
    let mut counts = vec![0_u64; objects.len()];
    for segment in segments.iter() {
        for values in &segment.layout.values {
            if let Some(count) = counts.get_mut(values.object) {
                *count = count.saturating_add(segment.chunks.saturating_mul(values.count));
            }
        }
    }
    let numbers = (0..objects.len()).filter(|n| counts.get(*n).is_some_and(|count| *count > 0));
    let numbers: Vec<usize> = numbers.collect();
    let count = |n: &usize| counts.get(*n).copied().unwrap_or(0);
    let Some(samples) = most_common(numbers.iter().map(count)) else {
        return Err(RecordingError::Malformed {
            file: bytes.file.clone(),
            place: None,
            mismatch: Box::new(Mismatch {
                channel: String::new(),
                found: "no channel with numbers".to_owned(),
                expected: "channels with samples".to_owned(),
                advice: "export the recording again, or as CSV",
            }),
        });
    };
    let used: Vec<&Object> = numbers.iter().filter_map(|n| objects.get(*n)).collect();
    let mut named: HashMap<&str, usize> = HashMap::new();
    for object in &used {
        *named.entry(object.channel.as_str()).or_default() += 1;
    }
    let channel = |object: &&Object| Channel {
        // Channels of one name in several groups keep those.
        name: match named.get(object.channel.as_str()) {
            Some(1) => printable(&object.channel).into_owned(),
            _ => printable(&format!("{}/{}", object.group, object.channel)).into_owned(),
        },
        unit: object.unit.clone(),
        direction: None,
    };
    let channels = with_units(used.iter().map(channel).collect());
    let step = numbers.iter().filter(|n| count(n) == samples);
    let step = step.filter_map(|n| objects.get(*n)?.step).next();
    let rate = step.map(|step| StatedRate {
        value: 1.0 / step,
        place: "wf_increment of its channels",
    });
    let form = format!("TDMS, {} segments with samples", segments.len());
    let own: Vec<(usize, u64, Option<f64>, String)> = numbers
        .iter()
        .zip(&channels)
        .map(|(n, c)| {
            let step = objects.get(*n).and_then(|object| object.step);
            (*n, count(n), step, c.name.clone())
        })
        .collect();
    let scaled: Vec<bool> = used.iter().map(|object| object.unscaled).collect();
    let open = move |channel: usize| -> Result<Box<dyn Series>, RecordingError> {
        let Some((object, count, own_step, label)) = own.get(channel) else {
            return Err(bytes.malformed(Place::Byte(0), "", "nothing", "a channel"));
        };
        if scaled.get(channel) == Some(&true) {
            return Err(RecordingError::OtherKind {
                file: bytes.file.clone(),
                kind: format!(
                    "a TDMS file whose channel `{label}` has raw counts and a DAQmx scale"
                ),
                advice: "export it with scaled data: in DIAdem or LabVIEW save it as float, or export it as CSV",
            });
        }
        if *count != samples || own_step.zip(step).is_some_and(|(own, step)| own != step) {
            let every =
                |step: Option<f64>| step.map_or_else(String::new, |s| format!(" every {s} s"));
            let found = format!("{count} samples{}", every(*own_step));
            let expected = format!("{samples}{} as the other channels have", every(step));
            return Err(bytes.malformed(Place::Byte(0), label, found, expected));
        }
        let stretches = Stretches::new(Rc::clone(&segments), *object);
        Ok(Box::new(Values::new(&bytes, stretches, label)))
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
