//! Universal files (UFF, UNV): time histories of dataset 58, in ASCII and binary.

mod header;
mod scan;
mod series;
mod units;

use super::bytes::Bytes;
use super::columns::{Columns, Reading, Series, most_common};
use super::source::{Channel, Place, StatedRate};
use super::{Format, Mismatch, RecordingError};
use header::Header;
use scan::Set;
use std::collections::HashMap;
use std::rc::Rc;

/// The format.
pub(super) const FORMAT: Format = Format {
    recognises,
    open: |input, _| Ok(Box::new(columns(Bytes::open(input, "a universal file")?)?)),
};

/// `true` if a file begins with the delimiter of a dataset and a line with its number.
fn recognises(start: &[u8]) -> bool {
    let lines = start.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    let mut lines = lines.skip_while(|line| line.is_empty());
    lines.next() == Some(b"-1")
        && lines
            .next()
            .is_some_and(|line| header::number(line).is_some())
}

fn columns(bytes: Rc<Bytes>) -> Result<Columns, RecordingError> {
    let scan::Found { sets, notes } = scan::scan(&bytes)?;
    let Some(first) = sets.first() else {
        return Err(RecordingError::Malformed {
            file: bytes.file.clone(),
            place: None,
            mismatch: Box::new(Mismatch {
                channel: String::new(),
                found: match notes.as_slice() {
                    [] => "it holds no dataset".to_owned(),
                    notes => notes.join("; "),
                },
                expected: "time histories in datasets 58".to_owned(),
                advice: "export the time histories of the test",
            }),
        });
    };
    let names = names(&sets);
    // Channels of one recording share their samples. A set that does not is refused when it is
    // asked for.
    let usual = most_common(sets.iter().map(|set| set.header.abscissa()));
    let shared = sets.iter().find(|set| Some(set.header.abscissa()) == usual);
    let shared = shared.unwrap_or(first).clone();
    let channel = |(set, name): (&Set, String)| Channel {
        name,
        unit: set.unit.clone(),
        direction: set.header.direction(),
    };
    let mut channels: Vec<Channel> = sets.iter().zip(names).map(channel).collect();
    let step = shared.header.step;
    let (samples, uneven) = (shared.header.points, !shared.header.even);
    if uneven {
        channels.push(Channel {
            name: "time".to_owned(),
            unit: Some("s".to_owned()),
            direction: None,
        });
    }
    let time = uneven.then_some(sets.len());
    let rate = (!uneven).then(|| StatedRate {
        value: 1.0 / step,
        place: "its abscissa",
    });
    let binary = sets.iter().filter(|set| set.binary.is_some()).count();
    let form = format!(
        "universal file, {} of dataset 58 ({binary} binary)",
        sets.len()
    );
    let labels: Vec<String> = channels.iter().map(|c| c.name.clone()).collect();
    let open = move |channel: usize| -> Result<Box<dyn Series>, RecordingError> {
        let label = labels.get(channel).map_or("", String::as_str);
        let abscissa = time == Some(channel);
        let set = if abscissa {
            Some(&shared)
        } else {
            sets.get(channel)
        };
        let Some(set) = set else {
            return Err(bytes.malformed(Place::Byte(0), label, "nothing", "a channel"));
        };
        if set.header.abscissa() != shared.header.abscissa() {
            return Err(RecordingError::Malformed {
                file: bytes.file.clone(),
                place: Some(Place::Line(set.line)),
                mismatch: Box::new(Mismatch {
                    channel: label.to_owned(),
                    found: set.header.described(),
                    expected: format!("{} as the other channels have", shared.header.described()),
                    advice: "channels of one recording share their samples: export the others to a file of their own",
                }),
            });
        }
        series::open(
            &bytes,
            set,
            label,
            abscissa,
            Some(&shared).filter(|_| uneven),
        )
    };
    Ok(Columns {
        channels,
        samples,
        rate,
        time,
        form,
        notes,
        open: Box::new(open),
        reading: Reading::default(),
    })
}

/// Names of the channels: node and direction of the response, such as `12:+Z`, with the entity
/// before them where it is given; without a node, or where several sets share it, the first
/// line of the set's description.
fn names(sets: &[Set]) -> Vec<String> {
    let own = |h: &Header| h.node_and_direction();
    let mut count: HashMap<String, usize> = HashMap::new();
    for set in sets {
        if let Some(name) = own(&set.header) {
            *count.entry(name).or_default() += 1;
        }
    }
    let name = |(number, set): (usize, &Set)| {
        let own = own(&set.header);
        let alone = own.clone().filter(|name| count.get(name) == Some(&1));
        alone
            .or_else(|| set.header.description.clone())
            .or(own)
            .unwrap_or_else(|| format!("set {}", number + 1))
    };
    sets.iter().enumerate().map(name).collect()
}
