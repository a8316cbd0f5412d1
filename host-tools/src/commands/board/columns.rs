//! The inputs that are read, and the names of their channels.

use crate::commands::Failure;
use crate::device::{Client, Port};
use crate::inputs::{self, InputEntry};
use crate::recording::HEALTH_COLUMN;
use std::path::{Path, PathBuf};

/// Value of `--inputs`.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Wanted {
    /// A file of inputs.
    File(PathBuf),
    /// Inputs from zero, some with the name of their channel.
    These(Vec<(u8, Option<String>)>),
}

impl Wanted {
    /// The file of inputs, if it is one.
    pub(super) fn file(&self) -> Option<&Path> {
        match self {
            Self::File(file) => Some(file),
            Self::These(_) => None,
        }
    }
}

/// Reads `inputs.toml`, or a list such as `1,3-6,drive=8`.
pub(super) fn parse(text: &str) -> Result<Wanted, String> {
    if text.to_ascii_lowercase().ends_with(".toml") {
        return Ok(Wanted::File(text.into()));
    }
    let number = |text: &str| {
        let number: u32 = text.trim().parse().ok()?;
        u8::try_from(number.checked_sub(1)?).ok()
    };
    let mut wanted: Vec<(u8, Option<String>)> = Vec::new();
    for part in text.split(',').map(str::trim) {
        let (name, range) = match part.rsplit_once('=') {
            Some((name, range)) => (Some(name.trim().to_owned()), range),
            None => (None, part),
        };
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        let (Some(first), Some(last)) = (number(first), number(last)) else {
            return Err(format!(
                "{part}: write numbers of inputs from 1 on, such as 1,3-6,drive=8, or a file of inputs (.toml)"
            ));
        };
        if name.is_some() && first != last {
            return Err(format!("{part}: one name is for one input"));
        }
        for input in first..=last {
            if wanted.iter().any(|(other, _)| *other == input) {
                return Err(format!("input {} is there twice", u32::from(input) + 1));
            }
            wanted.push((input, name.clone()));
        }
    }
    if wanted.is_empty() {
        return Err(format!("{text}: no input lies in that range"));
    }
    Ok(Wanted::These(wanted))
}

/// The inputs that are wanted of a box, in the order in which they are wanted; all that
/// something is wired to if `wanted` is `None`.
pub(super) fn choose<P: Port>(
    client: &mut Client<'_, P>,
    wanted: Option<&Wanted>,
) -> Result<Vec<InputEntry>, Failure> {
    let inputs = client.hello()?.capacity.inputs;
    if inputs == 0 {
        return Err(Failure::input(
            "this box has no inputs of its own; `massline replay` sends it recordings",
        ));
    }
    let wired = client.wired_inputs(inputs)?;
    let chosen = match wanted {
        None => wired,
        Some(Wanted::These(list)) => {
            let mut chosen = Vec::new();
            for (input, name) in list {
                let entry = find(&wired, *input)?;
                chosen.push(InputEntry {
                    channel: name.clone(),
                    ..entry.clone()
                });
            }
            chosen
        }
        Some(Wanted::File(file)) => {
            let entries = inputs::read(file)?;
            for entry in entries.iter().filter(|e| e.is_used()) {
                if find(&wired, entry.input)?.certificate != entry.certificate {
                    return Err(Failure::input(format!(
                        "input {} is calibrated otherwise in {} than on the box; `massline board settings --inputs {}` takes the file's over",
                        entry.number(),
                        file.display(),
                        file.display()
                    )));
                }
            }
            entries.into_iter().filter(InputEntry::is_used).collect()
        }
    };
    if chosen.is_empty() {
        return Err(Failure::input(
            "nothing is wired to this box by its settings; say what is by `massline board settings --inputs FILE`",
        ));
    }
    check_names(&chosen)?;
    Ok(chosen)
}

fn find(wired: &[InputEntry], input: u8) -> Result<&InputEntry, Failure> {
    wired.iter().find(|e| e.input == input).ok_or_else(|| {
        Failure::input(format!(
            "nothing is wired to input {} by the box's settings; say what is by `massline board settings --inputs FILE`",
            u32::from(input) + 1
        ))
    })
}

/// Refuses names that cannot be told apart in a recording.
fn check_names(chosen: &[InputEntry]) -> Result<(), Failure> {
    for (k, entry) in chosen.iter().enumerate() {
        let name = entry.column();
        let taken = chosen[..k].iter().any(|e| e.column() == name);
        let own = name.eq_ignore_ascii_case("time") || name == HEALTH_COLUMN;
        if taken || own || name.trim().is_empty() || name.parse::<f64>().is_ok() {
            return Err(Failure::input(format!(
                "channel name \"{name}\" of input {}: take one that is no number, not time or {HEALTH_COLUMN}, and no other input's",
                entry.number()
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_and_files_are_told_apart() {
        let named = |input, name: &str| (input, Some(name.to_owned()));
        assert_eq!(
            parse("1, 3-5,drive=8,a=b=9"),
            Ok(Wanted::These(vec![
                (0, None),
                (2, None),
                (3, None),
                (4, None),
                named(7, "drive"),
                named(8, "a=b"),
            ]))
        );
        assert_eq!(parse("My.TOML"), Ok(Wanted::File("My.TOML".into())));
        for (text, words) in [
            ("0", "from 1 on"),
            ("a1", "from 1 on"),
            ("", "from 1 on"),
            ("1,257", "from 1 on"),
            ("3-1", "no input"),
            ("1-3,2", "input 2 is there twice"),
            ("x=1-2", "one name"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
