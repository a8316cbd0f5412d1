//! The names of a recording's channels, and the search for one of them.

use super::RecordingError;
use super::source::{Channel, Place};
use crate::printable::quoted;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Names shown before a list is cut off.
const SHOWN: usize = 30;

/// The first names of a list, fit for a message.
pub(crate) fn some_of<'n>(names: impl ExactSizeIterator<Item = &'n String>) -> String {
    let more = if names.len() > SHOWN { ", …" } else { "" };
    let some: Vec<String> = names.take(SHOWN).map(|name| quoted(name)).collect();
    some.join(", ") + more
}

/// Typing errors between two names that still count as the same word.
const TYPOS: usize = 2;

/// Position of a channel, which may be asked for with its unit: `T1:X [g]`.
pub(super) fn position(channels: &[Channel], label: &str) -> Option<usize> {
    let (name, unit) = split(label);
    let own = channels.iter().position(|c| c.name == label);
    own.or_else(|| {
        let same = |c: &Channel| c.name == name && c.unit.as_deref() == unit;
        channels.iter().position(same)
    })
}

/// Units of acceleration, force, moment and voltage as they stand in round or other brackets, in which names have
/// other things as well.
const UNITS: [&str; 34] = [
    "g", "G", "gn", "g_n", "m/s²", "m/s^2", "m/s2", "m/s/s", "m/s**2", "mm/s²", "mm/s^2", "mm/s2",
    "in/s²", "in/s^2", "ft/s²", "ft/s^2", "N", "kN", "lbf", "lb", "kgf", "N m", "Nm", "N·m", "N*m",
    "N.m", "N-m", "kNm", "kN m", "V", "mV", "pC", "counts", "count",
];

/// A label such as `T1:X [g]` or `T1:X (g)` as name and unit; a number in brackets is a part of the name.
pub(crate) fn split(label: &str) -> (&str, Option<&str>) {
    for (open, close) in [('(', ')'), ('{', '}'), ('<', '>')] {
        let parts = label
            .strip_suffix(close)
            .and_then(|rest| rest.rsplit_once(open));
        if let Some((name, unit)) = parts.map(|(name, unit)| (name.trim_end(), unit.trim()))
            && !name.is_empty()
            && UNITS.contains(&unit)
        {
            return (name, Some(unit));
        }
    }
    let parts = label
        .strip_suffix(']')
        .and_then(|rest| rest.rsplit_once('['));
    match parts.map(|(name, unit)| (name.trim_end(), unit.trim())) {
        Some((name, unit)) if !name.is_empty() && unit.parse::<f64>().is_err() => {
            (name, Some(unit).filter(|unit| !unit.is_empty()))
        }
        _ => (label, None),
    }
}

/// Channels of a file from their labels. A name without its unit that another channel has, too,
/// stays as it was.
pub(super) fn labelled(labels: &[String]) -> Vec<Channel> {
    let mut count: HashMap<&str, usize> = HashMap::with_capacity(labels.len());
    for label in labels {
        *count.entry(split(label).0).or_default() += 1;
    }
    let channel = |label: &String| {
        let (name, unit) = split(label);
        let alone = count.get(name) == Some(&1);
        Channel {
            name: if alone { name } else { label }.to_owned(),
            unit: unit.map(str::to_owned),
            direction: None,
        }
    };
    labels.iter().map(channel).collect()
}

/// The channels of a file that states units elsewhere than in names: where it states none, the one in the name counts.
pub(super) fn with_units(channels: Vec<Channel>) -> Vec<Channel> {
    let labels: Vec<String> = channels.iter().map(|c| c.name.clone()).collect();
    let both = channels.into_iter().zip(labelled(&labels));
    both.map(|(own, labelled)| match own.unit {
        Some(_) => own,
        None => Channel {
            direction: own.direction,
            ..labelled
        },
    })
    .collect()
}

/// The names of all channels of a file.
pub(super) struct Names<'a> {
    channels: &'a [Channel],
    at: Option<Place>,
    file: &'a Path,
}

impl<'a> Names<'a> {
    /// The names, of which none may be there twice.
    pub(super) fn new(
        channels: &'a [Channel],
        at: Option<Place>,
        file: &'a Path,
    ) -> Result<Self, RecordingError> {
        let mut positions = HashMap::with_capacity(channels.len());
        for (i, channel) in channels.iter().enumerate() {
            if let Some(first) = positions.insert(channel.name.as_str(), i) {
                return Err(RecordingError::DuplicateChannel {
                    file: file.to_owned(),
                    place: at,
                    channel: quoted(&channel.name),
                    first: first + 1,
                    second: i + 1,
                });
            }
        }
        Ok(Self { channels, at, file })
    }

    /// Position of a channel; `wanted` are all channels that are looked for.
    pub(super) fn position(&self, channel: &str, wanted: &[&str]) -> Result<usize, RecordingError> {
        let position = position(self.channels, channel);
        position.ok_or_else(|| RecordingError::MissingChannel {
            file: self.file.to_owned(),
            place: self.at,
            channel: channel.to_owned(),
            hint: self.hint(channel, wanted),
        })
    }

    /// The channel that is meant, if one is near that no other sensor claims.
    fn hint(&self, channel: &str, wanted: &[&str]) -> String {
        let wanted: HashSet<&str> = wanted.iter().copied().collect();
        let all = || self.channels.iter().map(|c| &c.name);
        let free: Vec<&String> = all().filter(|n| !wanted.contains(n.as_str())).collect();
        let length = channel.chars().count();
        // The distance of two texts takes time and memory by the product of their lengths.
        let similar_length = |name: &&&String| name.chars().count().abs_diff(length) <= TYPOS;
        let near = free
            .iter()
            .filter(similar_length)
            .map(|name| (strsim::damerau_levenshtein(channel, name), name))
            .filter(|(typos, name)| *typos <= TYPOS && *typos < name.chars().count())
            .min();
        if let Some((_, name)) = near {
            return format!("did you mean `{}`?", quoted(name));
        }
        let (which, list) = if free.is_empty() {
            ("the file has", all().collect())
        } else {
            ("columns without a sensor are", free)
        };
        let list = some_of(list.into_iter());
        format!("{which} {list}; correct `channel` in the setup or the column's name")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hint(names: &[&str], channel: &str, wanted: &[&str]) -> String {
        let named = |name: &&str| Channel {
            name: (*name).to_owned(),
            ..Channel::default()
        };
        let channels: Vec<Channel> = names.iter().map(named).collect();
        let names = Names::new(&channels, Some(Place::Line(1)), Path::new("x.csv")).unwrap();
        names.position(channel, wanted).unwrap_err().to_string()
    }

    #[test]
    fn a_unit_in_brackets_is_no_part_of_the_name() {
        let labels = [
            "T1:X [g]",
            "T1:Y[m/s²]",
            "a[0]",
            "a[1]",
            "[V]",
            "b [V]",
            "b [N]",
            "c []",
            "T2:X (g)",
            "F (kN)",
            "side (A)",
            "M<N m>",
        ];
        let channels = labelled(&labels.map(str::to_owned));
        let found: Vec<(&str, Option<&str>)> = channels
            .iter()
            .map(|c| (c.name.as_str(), c.unit.as_deref()))
            .collect();
        let expected = [
            ("T1:X", Some("g")),
            ("T1:Y", Some("m/s²")),
            ("a[0]", None),
            ("a[1]", None),
            ("[V]", None),
            // Of one name without their units: both keep them.
            ("b [V]", Some("V")),
            ("b [N]", Some("N")),
            ("c", None),
            ("T2:X", Some("g")),
            ("F", Some("kN")),
            ("side (A)", None),
            ("M", Some("N m")),
        ];
        assert_eq!(found, expected);
        for (label, at) in [
            ("T1:X", 0),
            ("T1:X [g]", 0),
            ("T1:Y [m/s²]", 1),
            ("b [N]", 6),
        ] {
            assert_eq!(position(&channels, label), Some(at), "{label}");
        }
        assert_eq!(position(&channels, "T1:X [N]"), None);
        assert_eq!(position(&channels, "b"), None);
    }

    /// The unit in a name counts where the file states none elsewhere; what else it states of a channel stays.
    #[test]
    fn a_unit_that_the_file_states_goes_before_the_one_in_the_name() {
        let channel = |name: &str, unit: Option<&str>| Channel {
            name: name.to_owned(),
            unit: unit.map(str::to_owned),
            direction: Some([0.0, 0.0, 1.0]),
        };
        let found = with_units(vec![
            channel("a1 [g]", None),
            channel("a2 (g)", None),
            channel("a3 [g]", Some("m/s²")),
            channel("a4", None),
        ]);
        let expected = [
            channel("a1", Some("g")),
            channel("a2", Some("g")),
            channel("a3 [g]", Some("m/s²")),
            channel("a4", None),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn only_columns_without_a_sensor_are_suggested() {
        let text = hint(&["a1", "a2", "A3"], "a3", &["a1", "a2", "a3"]);
        assert!(text.contains("did you mean `A3`?"), "{text}");
        let text = hint(&["a1", "a2", "left"], "a3", &["a1", "a2", "a3"]);
        assert!(
            text.contains("columns without a sensor are left;"),
            "{text}"
        );
        let text = hint(&["a1", "a2"], "a3", &["a1", "a2", "a3"]);
        assert!(text.contains("the file has a1, a2;"), "{text}");
    }
}
