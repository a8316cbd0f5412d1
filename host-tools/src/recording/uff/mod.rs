//! Universal files (UFF, UNV): dataset 58, in ASCII and binary. Time histories are channels;
//! responses over frequency are those of a stepped sine, with a channel `frequency` and two a
//! response, `NAME.re` and `NAME.im`.

mod header;
mod nodes;
mod scan;
mod series;
mod units;

use super::bytes::Bytes;
use super::columns::{Columns, Reading, Series, most_common};
use super::names::with_units;
use super::source::{Channel, Place, StatedRate};
use super::{Format, Mismatch, RecordingError};
use scan::Set;
use series::Part;
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
    let scan::Found { sets, notes, nodes } = scan::scan(&bytes)?;
    let Some(first) = sets.first() else {
        return Err(without_sets(&bytes, &notes));
    };
    let complex = first.header.is_complex();
    // Channels of one recording share their samples. A set that does not is refused when it is
    // asked for.
    let usual = most_common(sets.iter().map(|set| set.header.abscissa()));
    let shared = sets.iter().find(|set| Some(set.header.abscissa()) == usual);
    let shared = shared.unwrap_or(first).clone();
    let uneven = !shared.header.even;
    let Listed {
        mut channels,
        mut parts,
        positions,
    } = listed(&sets, &nodes, complex);
    let abscissa = match (complex, uneven) {
        (true, _) => Some(("frequency", "Hz")),
        (false, true) => Some(("time", "s")),
        (false, false) => None,
    };
    if let Some((name, unit)) = abscissa {
        channels.push(Channel {
            name: name.to_owned(),
            unit: Some(unit.to_owned()),
            direction: None,
        });
        parts.push((None, Part::Abscissa));
    }
    let channels = with_units(channels);
    let binary = sets.iter().filter(|set| set.binary.is_some()).count();
    let over = if complex {
        ", responses over frequency"
    } else {
        ""
    };
    let form = format!(
        "universal file, {} of dataset 58 ({binary} binary){over}",
        sets.len()
    );
    Ok(Columns {
        positions,
        samples: shared.header.points,
        rate: (!uneven && !complex).then(|| StatedRate {
            value: 1.0 / shared.header.step,
            place: "its abscissa",
        }),
        time: (uneven && !complex).then_some(sets.len()),
        form,
        notes,
        open: {
            let labels: Vec<String> = channels.iter().map(|c| c.name.clone()).collect();
            Box::new(
                move |channel: usize| -> Result<Box<dyn Series>, RecordingError> {
                    let label = labels.get(channel).map_or("", String::as_str);
                    let set = |number: Option<usize>| match number {
                        Some(number) => sets.get(number),
                        None => Some(&shared),
                    };
                    let part = parts.get(channel);
                    let Some((set, part)) = part.and_then(|(of, part)| Some((set(*of)?, *part)))
                    else {
                        return Err(bytes.malformed(Place::Byte(0), label, "nothing", "a channel"));
                    };
                    suits(set, &shared, &bytes, label)?;
                    series::open(&bytes, set, label, part, Some(&shared).filter(|_| uneven))
                },
            )
        },
        channels,
        reading: Reading::default(),
    })
}

/// The error of a file without a set that can be read, by what was noted of the others.
fn without_sets(bytes: &Bytes, notes: &[String]) -> RecordingError {
    RecordingError::Malformed {
        file: bytes.file.clone(),
        place: None,
        mismatch: Box::new(Mismatch {
            channel: String::new(),
            found: match notes {
                [] => "it holds no dataset".to_owned(),
                notes => notes.join("; "),
            },
            expected: "time histories or complex frequency responses in datasets 58".to_owned(),
            advice: "export the time histories of the test",
        }),
    }
}

/// Channels of all sets, side by side with the set and the part of its points that each is.
struct Listed {
    channels: Vec<Channel>,
    /// Without the number of a set: of that which all share.
    parts: Vec<(Option<usize>, Part)>,
    positions: Vec<Option<[f64; 3]>>,
}

fn listed(sets: &[Set], nodes: &nodes::Nodes, complex: bool) -> Listed {
    let mut listed = Listed {
        channels: Vec::new(),
        parts: Vec::new(),
        positions: Vec::new(),
    };
    let parts_of_set: &[(&str, Part)] = match complex {
        true => &[(".re", Part::Ordinate), (".im", Part::Imaginary)],
        false => &[("", Part::Ordinate)],
    };
    for (number, (set, name)) in sets.iter().zip(names(sets, complex)).enumerate() {
        let node = set.header.response.node;
        let direction = set.header.response.direction();
        let turned = nodes.turned(node);
        // A name that looks like a direction of the global system would be taken for one.
        let name = turned.map_or_else(|| name.clone(), |system| format!("{name} in {system}"));
        for (end, part) in parts_of_set {
            listed.positions.push(nodes.position(node));
            listed.channels.push(Channel {
                name: format!("{name}{end}"),
                unit: set.unit.clone(),
                direction: direction.filter(|_| turned.is_none()),
            });
            listed.parts.push((Some(number), *part));
        }
    }
    listed
}

/// Checks that a set shares the samples of the others, and of responses the drive and its unit.
fn suits(set: &Set, shared: &Set, bytes: &Bytes, label: &str) -> Result<(), RecordingError> {
    let other = |found: String, expected: String, advice| RecordingError::Malformed {
        file: bytes.file.clone(),
        place: Some(Place::Line(set.line)),
        mismatch: Box::new(Mismatch {
            channel: label.to_owned(),
            found,
            expected: format!("{expected} as the other channels have"),
            advice,
        }),
    };
    if set.header.abscissa() != shared.header.abscissa() {
        return Err(other(
            set.header.described(),
            shared.header.described(),
            "channels of one recording share their samples: export the others to a file of their own",
        ));
    }
    let per = |set: &Set| set.header.denominator.clone();
    if shared.header.is_complex() && per(set) != per(shared) {
        let unit = |set| match per(set) {
            Some((_, _, Some(unit))) => format!("a response per {unit}"),
            Some((quantity, ..)) => format!("a response per quantity of type {quantity}"),
            None => "a response per nothing".to_owned(),
        };
        return Err(other(
            unit(set),
            unit(shared),
            "the responses of a run are to one drive in one unit: export them alike",
        ));
    }
    Ok(())
}

/// A way to name a set; `None` where it has no such name.
type Way<'a> = &'a dyn Fn(&Set) -> Option<String>;

/// Names of the channels: node and direction of the response, such as `12:+Z`, with the entity
/// before them where it is given, and of responses to several references with that of the
/// reference behind a slash; without a node, or where several sets share it, the first line of the
/// set's description, with the fourth where several share the first.
fn names(sets: &[Set], complex: bool) -> Vec<String> {
    let mut references = sets.iter().map(|set| &set.header.reference);
    let first = references.next();
    let several = complex && references.any(|reference| Some(reference) != first);
    let point = |set: &Set| {
        let name = set.header.response.name()?;
        let reference = set.header.reference.name().filter(|_| several);
        Some(reference.map_or_else(|| name.clone(), |reference| format!("{name}/{reference}")))
    };
    let line = |set: &Set| set.header.description.clone();
    let both = |set: &Set| Some(format!("{} ({})", line(set)?, set.header.remark.as_ref()?));
    let ways: [Way<'_>; 3] = [&point, &line, &both];
    let counts = ways.map(|way| {
        let mut count: HashMap<String, usize> = HashMap::new();
        for name in sets.iter().filter_map(way) {
            *count.entry(name).or_default() += 1;
        }
        count
    });
    let name = |(number, set): (usize, &Set)| {
        let mut alone = ways.iter().zip(&counts).filter_map(|(way, count)| {
            let name = way(set)?;
            (count.get(&name) == Some(&1)).then_some(name)
        });
        alone
            .next()
            .unwrap_or_else(|| format!("set {}", number + 1))
    };
    sets.iter().enumerate().map(name).collect()
}
