//! Text that a terminal shows as it stands, whoever wrote it.
//!
//! Names, serial numbers, titles and quoted fields come from boxes and from files. A character
//! among them that steers a terminal (an escape sequence moves the cursor, changes colours or
//! the window's title, and in some terminals types on the keyboard), that begins a line, or that
//! turns the direction of reading could pass off what it wrote as this program's own words. All
//! such text goes through [`printable`] before it is shown.

use std::borrow::Cow;

/// `true` if a character steers a terminal or the order of the characters around it in place of
/// being shown: the control characters of ASCII and of Unicode's first page, line and paragraph
/// separators, marks and overrides of the direction of writing, spaces of no width, and tags. The
/// joiners that some scripts write words with are none of them.
#[must_use]
pub const fn steers(c: char) -> bool {
    matches!(c,
        '\u{0}'..='\u{1f}'
        | '\u{7f}'..='\u{9f}'
        | '\u{61c}'
        | '\u{180e}'
        | '\u{200b}'
        | '\u{200e}'..='\u{200f}'
        | '\u{2028}'..='\u{202e}'
        | '\u{2060}'..='\u{206f}'
        | '\u{feff}'
        | '\u{fff9}'..='\u{fffb}'
        | '\u{e0000}'..='\u{e007f}')
}

/// The text with every character that [`steers`] written out: `\n`, `\t`, `\r`, else its number
/// as in `\u{1b}`. Text without one is borrowed.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(steers) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if steers(c) {
            shown.extend(c.escape_default());
        } else {
            shown.push(c);
        }
    }
    Cow::Owned(shown)
}

/// The same for a message of several lines that this program has put together: ends of lines
/// stay.
#[must_use]
pub fn printable_lines(text: &str) -> String {
    let lines: Vec<Cow<'_, str>> = text.split('\n').map(printable).collect();
    lines.join("\n")
}

/// A JSON document with every character that [`steers`] written as `\u001b`, which reads back to
/// the same text. Ends of lines, which stand between values only, stay.
#[must_use]
pub fn printable_json(document: &str) -> Cow<'_, str> {
    let hidden = |c: char| steers(c) && c != '\n';
    if !document.contains(hidden) {
        return Cow::Borrowed(document);
    }
    let mut shown = String::with_capacity(document.len() + 8);
    for c in document.chars() {
        if hidden(c) {
            // JSON counts in units of UTF-16.
            for unit in c.encode_utf16(&mut [0; 2]) {
                shown += &format!("\\u{unit:04x}");
            }
        } else {
            shown.push(c);
        }
    }
    Cow::Owned(shown)
}

/// Most characters of a file's text that a message repeats.
const QUOTED: usize = 80;

/// The beginning of a file's text, fit for a message.
pub(crate) fn quoted(text: &str) -> String {
    let mut rest = text.chars();
    let start: String = rest.by_ref().take(QUOTED).collect();
    let more = if rest.next().is_some() { "…" } else { "" };
    format!("{}{more}", printable(&start))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_steers_a_terminal_is_written_out() {
        for (text, shown) in [
            ("\u{1b}[2Jgone", "\\u{1b}[2Jgone"),
            ("\u{9b}31m", "\\u{9b}31m"),
            ("a\nerror: b\r\t", "a\\nerror: b\\r\\t"),
            ("gpj.\u{202e}exe", "gpj.\\u{202e}exe"),
            ("\u{2066}x\u{2069}\u{200b}", "\\u{2066}x\\u{2069}\\u{200b}"),
            ("\u{0}\u{7f}\u{feff}", "\\u{0}\\u{7f}\\u{feff}"),
        ] {
            assert_eq!(printable(text), shown);
        }
        for text in ["", "Θxx about S ü − 測定 😀", "a \"b\" \\ 'c'"] {
            assert!(matches!(printable(text), Cow::Borrowed(same) if same == text));
        }
        assert_eq!(printable_lines("a\u{1b}\nb"), "a\\u{1b}\nb");
    }

    proptest! {
        #[test]
        fn nothing_that_is_shown_steers(text in any::<String>()) {
            prop_assert!(!printable(&text).contains(steers));
            prop_assert!(!printable(&text).contains(char::is_control));
        }

        #[test]
        fn a_document_reads_back_to_the_same(text in any::<String>(), key in ".*") {
            let value = serde_json::json!({ key: [text, "\u{9b}\u{e0001}\u{7f}\u{202e}"] });
            let document = serde_json::to_string_pretty(&value).unwrap();
            let shown = printable_json(&document);
            prop_assert!(!shown.contains(|c| steers(c) && c != '\n'));
            prop_assert_eq!(serde_json::from_str::<serde_json::Value>(&shown).unwrap(), value);
        }
    }
}
