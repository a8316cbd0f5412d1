//! Tables in READMEs: those that tests write and compare, and those that a command writes.
//!
//! A table stands between `<!-- name: begin -->` and `<!-- name: end -->`.

use std::fs;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// Environment variable that accepts new outputs if set to 1.
pub const ACCEPT: &str = "MASSLINE_ACCEPT";

/// Largest relative deviation from the number that is shown. Interrupts fall differently in every
/// run, about 1e-4 of an identification; another compiler's counts and sizes differ by a few
/// percent.
const CLOSE: f64 = 0.05;

/// `true` if new outputs are to be accepted.
#[must_use]
pub fn accepts() -> bool {
    std::env::var_os(ACCEPT).is_some_and(|value| value == "1")
}

/// Compares the table of this name with `found`, or writes it if [`ACCEPT`] is set.
///
/// # Errors
///
/// The first lines that differ, in a word or in a number by more than 5 %.
pub fn compare(name: &str, found: &str) -> Result<(), String> {
    /// Protects the file, since tests of one program run at the same time.
    static FILE: Mutex<()> = Mutex::new(());
    let _file = FILE.lock().unwrap_or_else(PoisonError::into_inner);

    const FIRMWARE: &str = "firmware/README.md";
    if accepts() {
        return put(FIRMWARE, name, found);
    }
    let text = read(FIRMWARE)?;
    let [_, shown, _] = parts_of(&text, name)?;
    differ(shown, found).map_or(Ok(()), |(ours, theirs)| {
        Err(format!(
            "the README has {ours:?}, the firmware {theirs:?}. If that is right, run this again \
             with {ACCEPT}=1 and commit the file.\n{found}"
        ))
    })
}

/// Writes the table of this name into a file of the workspace.
///
/// # Errors
///
/// A message if the table cannot be written.
pub fn put(file: &str, name: &str, table: &str) -> Result<(), String> {
    let text = read(file)?;
    let [before, _, after] = parts_of(&text, name)?;
    let path = place(file);
    fs::write(&path, format!("{before}\n\n{table}\n{after}"))
        .map_err(|e| format!("{}: {e}", path.display()))
}

fn place(file: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("..")
        .join(file)
}

fn read(file: &str) -> Result<String, String> {
    let path = place(file);
    fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))
}

/// A text up to and with the mark at which the table begins, the table, and the rest.
fn parts_of<'t>(text: &'t str, name: &str) -> Result<[&'t str; 3], String> {
    let mark = |word: &str| format!("<!-- {name}: {word} -->");
    let find = |mark: String| text.find(&mark).ok_or(format!("the README has no {mark}"));
    let begin = find(mark("begin"))? + mark("begin").len();
    let end = find(mark("end"))?;
    let (before, rest) = text.split_at(begin);
    let shown = end
        .checked_sub(begin)
        .and_then(|length| rest.split_at_checked(length));
    let (shown, after) = shown.ok_or(format!("the README ends {name} before it begins"))?;
    Ok([before, shown, after])
}

/// The first lines of two tables that differ, if any do.
fn differ<'t>(shown: &'t str, found: &'t str) -> Option<(&'t str, &'t str)> {
    let (mut shown, mut found) = (shown.trim().lines(), found.trim().lines());
    loop {
        let (ours, theirs) = match (shown.next(), found.next()) {
            (None, None) => return None,
            (ours, theirs) => (ours.unwrap_or_default(), theirs.unwrap_or_default()),
        };
        let (words, numbers) = parts(ours);
        let (their_words, their_numbers) = parts(theirs);
        let close = |(a, b): (&f64, &f64)| a == b || (a / b - 1.0).abs() < CLOSE;
        let is_close = words == their_words
            && numbers.len() == their_numbers.len()
            && numbers.iter().zip(&their_numbers).all(close);
        if !is_close {
            return Some((ours, theirs));
        }
    }
}

/// The words and the numbers of a line.
fn parts(line: &str) -> (Vec<&str>, Vec<f64>) {
    let is_number = |c: char| c.is_ascii_digit() || c == '.';
    let numbers = line.split(|c| !is_number(c));
    let words = line.split(is_number).map(str::trim);
    (
        words.filter(|word| !word.is_empty()).collect(),
        numbers.filter_map(|number| number.parse().ok()).collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHOWN: &str = "| what | bytes |\n| --- | ---: |\n| stack | 1000 |\n| rest | 2.5 % |\n";

    #[test]
    fn a_table_lies_between_its_marks() {
        let text = "a<!-- t: begin -->\n1\n<!-- t: end -->b";
        let [before, shown, after] = parts_of(text, "t").unwrap();
        assert_eq!(shown, "\n1\n");
        assert_eq!(format!("{before}{shown}{after}"), text);
        assert!(parts_of(text, "u").is_err());
        assert!(parts_of("<!-- t: end --><!-- t: begin -->", "t").is_err());
    }

    #[test]
    fn numbers_may_differ_a_little_and_words_may_not() {
        for (found, same) in [
            (SHOWN.to_owned(), true),
            (SHOWN.replace("1000", "1040"), true),
            (SHOWN.replace("1000", "1060"), false),
            (SHOWN.replace("1000", "940"), false),
            (SHOWN.replace("2.5", "2.7"), false),
            (SHOWN.replace("2.5", "25"), false),
            (SHOWN.replace("stack", "heap"), false),
            (SHOWN.replace("| rest | 2.5 % |\n", ""), false),
            (format!("{SHOWN}| more | 1 |"), false),
        ] {
            assert_eq!(differ(SHOWN, &found).is_none(), same, "{found}");
            assert_eq!(differ(&found, SHOWN).is_none(), same, "{found}");
        }
    }
}
