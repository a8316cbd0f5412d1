//! An SVG document, element by element.

use crate::report::markup::escape;
use std::fmt::Write;

/// End of a text that stands at its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// It begins there.
    Start,
    /// It is centred there.
    Middle,
    /// It ends there.
    End,
}

/// An inline `<svg>` under construction. What is drawn later lies above.
///
/// Elements carry classes and no colours. Coordinates are rounded to a tenth of a unit,
/// and those that are not finite or absurdly far out are pulled in, so that no input
/// makes the document unreadable.
#[derive(Clone, Debug)]
pub struct Svg {
    width: f64,
    height: f64,
    label: String,
    body: String,
    nested: usize,
}

impl Svg {
    /// An empty drawing with a text for those who cannot see it.
    #[must_use]
    pub fn new(width: f64, height: f64, label: &str) -> Self {
        Self {
            width,
            height,
            label: label.to_owned(),
            body: String::new(),
            nested: 0,
        }
    }

    /// A straight line.
    pub fn line(&mut self, class: &str, from: [f64; 2], to: [f64; 2]) {
        self.push(format_args!(
            "<path class=\"{class}\" d=\"M{} {}L{} {}\"/>",
            Number(from[0]),
            Number(from[1]),
            Number(to[0]),
            Number(to[1])
        ));
    }

    /// A rectangle; nothing if it has no area.
    pub fn rectangle(&mut self, class: &str, corner: [f64; 2], size: [f64; 2]) {
        if size.iter().all(|s| *s > 0.0) {
            self.push(format_args!(
                "<rect class=\"{class}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>",
                Number(corner[0]),
                Number(corner[1]),
                Number(size[0]),
                Number(size[1])
            ));
        }
    }

    /// A circle.
    pub fn circle(&mut self, class: &str, centre: [f64; 2], radius: f64) {
        self.push(format_args!(
            "<circle class=\"{class}\" cx=\"{}\" cy=\"{}\" r=\"{}\"/>",
            Number(centre[0]),
            Number(centre[1]),
            Number(radius)
        ));
    }

    /// A path from [`super::path`], or nothing if that is empty.
    pub fn path(&mut self, class: &str, data: &str) {
        if !data.is_empty() {
            self.push(format_args!("<path class=\"{class}\" d=\"{data}\"/>"));
        }
    }

    /// A text. It is escaped here.
    pub fn text(&mut self, class: &str, at: [f64; 2], anchor: Anchor, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        self.push(format_args!(
            "<text class=\"{class}\" x=\"{}\" y=\"{}\"{anchor}>{}</text>",
            Number(at[0]),
            Number(at[1]),
            escape(text)
        ));
    }

    /// A text with a second one behind it, wherever the first ends: its width is only
    /// known to the reader's font.
    pub fn two_texts(&mut self, at: [f64; 2], first: (&str, &str), second: (&str, &str)) {
        self.push(format_args!(
            "<text x=\"{}\" y=\"{}\"><tspan class=\"{}\">{}</tspan>",
            Number(at[0]),
            Number(at[1]),
            first.0,
            escape(first.1)
        ));
        let gap = if first.1.is_empty() { "" } else { " dx=\"6\"" };
        self.push(format_args!(
            "<tspan class=\"{}\"{gap}>{}</tspan></text>",
            second.0,
            escape(second.1)
        ));
    }

    /// Opens a group that shows `tip` where a pointer rests on it. Close it.
    pub fn open_group(&mut self, tip: &str) {
        self.nested += 1;
        self.body.push_str("<g>");
        if !tip.is_empty() {
            self.push(format_args!("<title>{}</title>", escape(tip)));
        }
    }

    /// Closes the group opened last.
    pub fn close_group(&mut self) {
        if self.nested > 0 {
            self.nested -= 1;
            self.body.push_str("</g>");
        }
    }

    /// Adds a whole drawing that clips at its own border, at a place of this one.
    ///
    /// A drawing inside a drawing clips by itself; a clip path would need an identifier.
    pub fn place(&mut self, corner: [f64; 2], inner: Self) {
        let (width, height) = (inner.width, inner.height);
        self.push(format_args!(
            "<svg x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\">",
            Number(corner[0]),
            Number(corner[1]),
            Number(width),
            Number(height)
        ));
        self.body.push_str(&inner.closed());
        self.body.push_str("</svg>");
    }

    /// The element, as wide as the page lets it be.
    #[must_use]
    pub fn finish(self) -> String {
        let (width, height) = (Number(self.width), Number(self.height));
        let label = escape(&self.label);
        let body = self.closed();
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             role=\"img\" aria-label=\"{label}\">{body}</svg>"
        )
    }

    /// The element, as wide as the page lets it be, but no larger than it was drawn.
    #[must_use]
    pub fn finish_at_most(self) -> String {
        // On a narrow page it scrolls rather than shrinks to nothing.
        let style = format!(
            "<svg style=\"max-width:{}px;min-width:{}px\" ",
            Number(self.width),
            Number(self.width.min(SHRUNK))
        );
        self.finish().replacen("<svg ", &style, 1)
    }

    /// The element at its own size, to stand in a line of text.
    #[must_use]
    pub fn finish_inline(self) -> String {
        let size = format!(
            "<svg width=\"{}\" height=\"{}\" ",
            Number(self.width),
            Number(self.height)
        );
        self.finish().replacen("<svg ", &size, 1)
    }

    fn closed(self) -> String {
        let mut body = self.body;
        for _ in 0..self.nested {
            body.push_str("</g>");
        }
        body
    }

    fn push(&mut self, what: std::fmt::Arguments<'_>) {
        // Writing to a String cannot fail.
        let _ = self.body.write_fmt(what);
    }
}

/// Width below which a large drawing does not shrink.
const SHRUNK: f64 = 520.0;

/// A coordinate: one decimal, none where it is zero, always finite.
pub(super) struct Number(pub f64);

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        const FAR: f64 = 1e5;
        let value = if self.0.is_finite() { self.0 } else { 0.0 };
        let tenths = (value.clamp(-FAR, FAR) * 10.0).round() as i64;
        let sign = if tenths < 0 { "-" } else { "" };
        let (whole, tenth) = (tenths.abs() / 10, tenths.abs() % 10);
        if tenth == 0 {
            write!(f, "{sign}{whole}")
        } else {
            write!(f, "{sign}{whole}.{tenth}")
        }
    }
}

/// About how wide a text is at a font size. The fonts of a reader are unknown; this errs
/// towards wide.
#[must_use]
pub fn text_width(text: &str, size: f64) -> f64 {
    let share = |c: char| match c {
        'i' | 'j' | 'l' | '.' | ',' | ':' | ';' | '|' | '\'' | '!' | ' ' => 0.33,
        '\u{202f}' | '\u{2009}' => 0.2,
        'f' | 't' | 'r' | '(' | ')' | '-' | '/' | '·' => 0.4,
        '⁰' | '¹' | '²' | '³' | '⁴'..='⁹' | '⁻' => 0.42,
        'm' | 'w' | 'M' | 'W' | '…' => 0.95,
        '−' | '+' | '±' => 0.84,
        'A'..='Z' | 'Θ' | 'Δ' => 0.74,
        _ => 0.64,
    };
    text.chars().map(share).sum::<f64>() * size
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short_and_finite() {
        let shown = |x: f64| Number(x).to_string();
        assert_eq!(shown(12.0), "12");
        assert_eq!(shown(-0.04), "0");
        assert_eq!(shown(-0.06), "-0.1");
        assert_eq!(shown(-12.34), "-12.3");
        assert_eq!(shown(f64::NAN), "0");
        assert_eq!(shown(f64::INFINITY), "0");
        assert_eq!(shown(-1e300), "-100000");
    }

    #[test]
    fn a_drawing_is_well_formed_even_if_groups_stay_open() {
        let mut inner = Svg::new(10.0, 10.0, "");
        inner.open_group("tip <1>");
        inner.circle("dot", [1.0, f64::NAN], 2.0);
        let mut svg = Svg::new(100.0, 50.0, "a \"label\" & more");
        svg.open_group("");
        svg.place([5.0, 5.0], inner);
        svg.text("t", [0.0, 0.0], Anchor::Middle, "<&>");
        svg.rectangle("none", [0.0, 0.0], [0.0, 5.0]);
        svg.path("none", "");
        let text = svg.finish_inline();
        let parsed = roxmltree::Document::parse(&text).unwrap();
        let root = parsed.root_element();
        assert_eq!(root.attribute("aria-label"), Some("a \"label\" & more"));
        assert_eq!(root.attribute("width"), Some("100"));
        assert_eq!(
            parsed
                .descendants()
                .filter(|n| n.has_tag_name(("http://www.w3.org/2000/svg", "circle")))
                .count(),
            1
        );
        assert!(!text.contains("class=\"none\""));
    }
}
