//! Text into HTML and SVG.

use crate::printable::steers;

/// The text with everything escaped that HTML or XML would read as markup, good for
/// content and for quoted attributes. Characters that XML forbids, or
/// that would turn the direction of what stands beside them, become U+FFFD.
#[must_use]
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\t' | '\n' | '\r' => out.push(' '),
            '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c if steers(c) => out.push('\u{fffd}'),
            _ => out.push(c),
        }
    }
    out
}

/// Adds a cell of a table with a number in it, HTML.
pub fn push_number(html: &mut String, number: &str) {
    html.push_str("<td class=\"num\">");
    html.push_str(number);
    html.push_str("</td>");
}

/// At most `most` characters, the last an ellipsis where something was cut off.
#[must_use]
pub fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let mut kept: String = text.chars().take(most.saturating_sub(1)).collect();
    kept.truncate(kept.trim_end().len());
    kept.push('…');
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_is_text_afterwards() {
        assert_eq!(
            escape("a<b & \"c\" > 'd'"),
            "a&lt;b &amp; &quot;c&quot; &gt; &#39;d&#39;"
        );
        assert_eq!(escape("x\u{0}\u{1b}y\nz"), "x\u{fffd}\u{fffd}y z");
        assert_eq!(escape("a\u{202e}b\u{9b}"), "a\u{fffd}b\u{fffd}");
        assert_eq!(escape("Θ ü −"), "Θ ü −");
    }

    #[test]
    fn long_names_end_in_an_ellipsis() {
        assert_eq!(shortened("short", 5), "short");
        assert_eq!(shortened("lateral excitation", 9), "lateral…");
        assert_eq!(shortened("ΘΘΘΘ", 3), "ΘΘ…");
    }
}
