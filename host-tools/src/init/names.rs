//! The meaning of a channel's name: its sensor, its axis and its quantity.

pub(super) use crate::setup::Measured as Kind;
use crate::setup::measured_in;

/// A channel's name in its parts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Parsed {
    /// Name of the sensor: that of the channel without its axis.
    pub(super) stem: String,
    /// Axis of the sensor, 0 to 2, and its sign where one is written.
    pub(super) axis: Option<(usize, Option<char>)>,
    pub(super) kind: Option<Kind>,
    /// `true` if the name is that of a generator's signal.
    pub(super) is_reference: bool,
    /// `true` if the name is that of a sensor on the table.
    pub(super) on_interface: bool,
}

const REFERENCE: [&str; 14] = [
    "drive",
    "dac",
    "shaker",
    "generator",
    "gen",
    "source",
    "excitation",
    "ref",
    "reference",
    "command",
    "exciter",
    "ao",
    "sigout",
    "drv",
];
const ACCELERATION: [&str; 10] = [
    "a",
    "acc",
    "accel",
    "accelerometer",
    "acceleration",
    "beschl",
    "t",
    "tri",
    "triax",
    "imu",
];
const FORCE: [&str; 9] = [
    "f",
    "force",
    "lc",
    "cell",
    "load",
    "loadcell",
    "fc",
    "forcecell",
    "kmd",
];
const MOMENT: [&str; 4] = ["m", "moment", "torque", "mom"];
const INTERFACE: [&str; 6] = ["base", "table", "interface", "adapter", "adaptor", "if"];

/// A name as words: letters, digits and signs apart.
fn words(name: &str) -> Vec<&str> {
    let mut words = Vec::new();
    let kind = |c: char| match c {
        '+' | '-' => 1,
        c if c.is_ascii_digit() => 2,
        c if c.is_alphanumeric() => 3,
        _ => 0,
    };
    let mut start = 0;
    let mut last = 0;
    for (at, c) in name.char_indices() {
        if kind(c) != last {
            if last != 0 {
                words.push(&name[start..at]);
            }
            start = at;
            last = kind(c);
        }
    }
    if last != 0 {
        words.push(&name[start..]);
    }
    words
}

fn axis_of(letter: &str) -> Option<usize> {
    ["x", "y", "z"]
        .iter()
        .position(|a| letter.eq_ignore_ascii_case(a))
}

fn kind_of(word: &str) -> Option<Kind> {
    let lists: [(&[&str], Kind); 3] = [
        (&ACCELERATION, Kind::Acceleration),
        (&FORCE, Kind::Force),
        (&MOMENT, Kind::Moment),
    ];
    let found = lists.iter().find(|(list, _)| list.contains(&word));
    found.map(|(_, kind)| *kind)
}

/// Reads a channel's name; its unit says more of the kind than the name does.
pub(super) fn parse(name: &str, unit: Option<&str>) -> Parsed {
    let words = words(name);
    let lower: Vec<String> = words.iter().map(|w| w.to_lowercase()).collect();
    let mut axis = None;
    let mut kind = None;
    let mut stem = name;
    if let Some(last) = words.last() {
        let before = words.len().checked_sub(2).map(|at| words[at]);
        let sign = before.filter(|word| *word == "+" || *word == "-");
        let end = name.trim_end_matches(|c: char| !c.is_alphanumeric());
        let cut = |letters: usize| {
            let left = &end[..end.len() - letters];
            let left = left.trim_end_matches(|c: char| !c.is_alphanumeric());
            if left.is_empty() { name } else { left }
        };
        let letters = last.to_lowercase();
        let (head, tail) =
            letters.split_at(letters.len() - letters.chars().last().map_or(0, char::len_utf8));
        if let Some(number) = axis_of(&letters) {
            // A minus between two words is a hyphen where no blank or colon stands before it.
            let sign = sign.filter(|s| *s == "+" || spaced(name, end));
            axis = Some((number, sign.and_then(|s| s.chars().next())));
            stem = cut(1);
        } else if let (Some(number), true) = (axis_of(tail), head == "t" || kind_of(head).is_some())
        {
            axis = Some((number, None));
            // A moment about x is written Mx or Tx, and an accelerometer's name is no such word.
            kind = if head == "t" {
                Some(Kind::Moment)
            } else {
                kind_of(head)
            };
            stem = cut(1);
        }
    }
    let by_name = || lower.iter().find_map(|word| kind_of(word));
    Parsed {
        stem: stem.to_owned(),
        axis,
        kind: unit.and_then(measured_in).or(kind).or_else(by_name),
        is_reference: lower.iter().any(|word| REFERENCE.contains(&word.as_str())),
        on_interface: lower.iter().any(|word| INTERFACE.contains(&word.as_str())),
    }
}

/// `true` if a blank or a colon stands before the sign in front of the last letter.
fn spaced(name: &str, end: &str) -> bool {
    let mut back = end[..end.len() - 1].chars().rev();
    back.next();
    name.len() >= end.len() && back.next().is_none_or(|c| c.is_whitespace() || c == ':')
}

#[cfg(test)]
mod tests {
    use super::*;
    use Kind::{Acceleration, Force, Moment};

    #[test]
    fn names_of_laboratories_are_understood() {
        let plus = Some('+');
        for (name, stem, axis, kind) in [
            ("T1:X", "T1", Some((0, None)), Some(Acceleration)),
            ("LC2_Z", "LC2", Some((2, None)), Some(Force)),
            ("Acc 3 +Z", "Acc 3", Some((2, plus)), Some(Acceleration)),
            (
                "Acc 3 -Y",
                "Acc 3",
                Some((1, Some('-'))),
                Some(Acceleration),
            ),
            ("12:-X", "12", Some((0, Some('-'))), None),
            ("acc-3-y", "acc-3", Some((1, None)), Some(Acceleration)),
            ("Force/Fz", "Force/F", Some((2, None)), Some(Force)),
            ("a12x", "a12", Some((0, None)), Some(Acceleration)),
            ("accx", "acc", Some((0, None)), Some(Acceleration)),
            ("Mx", "M", Some((0, None)), Some(Moment)),
            ("base1.z", "base1", Some((2, None)), None),
            ("antenna.x", "antenna", Some((0, None)), None),
            ("cell4.y", "cell4", Some((1, None)), Some(Force)),
            ("AI7", "AI7", None, None),
            ("matrix", "matrix", None, None),
            ("X", "X", Some((0, None)), None),
            ("Größe:Z", "Größe", Some((2, None)), None),
            ("", "", None, None),
            ("+", "+", None, None),
        ] {
            let found = parse(name, None);
            assert_eq!(
                (found.stem.as_str(), found.axis, found.kind),
                (stem, axis, kind),
                "{name}"
            );
            assert!(!found.is_reference, "{name}");
        }
        for name in ["drive", "DAC 1", "Shaker:V", "REF", "Gen_out"] {
            assert!(parse(name, None).is_reference, "{name}");
        }
        assert!(parse("table 3 z", None).on_interface && parse("Base1:X", None).on_interface);
        // The unit decides.
        assert_eq!(parse("T1:X", Some("N")).kind, Some(Force));
        assert_eq!(parse("F1:X", Some("g")).kind, Some(Acceleration));
        assert_eq!(parse("F1:X", Some("mV")).kind, Some(Force));
    }
}
