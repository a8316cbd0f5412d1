//! Axes with labels that never overlap.

use super::ticks::{Tick, Ticks};
use super::{Anchor, Mapping, SMALL_TEXT, Scale, Svg, text_width, ticks};

/// Range, mapping and label of an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Quantity and unit.
    pub title: String,
    /// Mapping of values to places.
    pub mapping: Mapping,
    /// First and last value.
    pub domain: [f64; 2],
}

impl Axis {
    /// A linear axis.
    #[must_use]
    pub fn linear(title: impl Into<String>, domain: [f64; 2]) -> Self {
        Self::new(title, Mapping::Linear, domain)
    }

    /// An axis.
    #[must_use]
    pub fn new(title: impl Into<String>, mapping: Mapping, domain: [f64; 2]) -> Self {
        Self {
            title: title.into(),
            mapping,
            domain,
        }
    }

    pub(super) fn scale(&self, pixels: [f64; 2]) -> Scale {
        Scale::new(self.mapping, self.domain, pixels)
    }

    /// Ticks for so many pixels: a label and as much air every `pitch` of them.
    pub(super) fn ticks(&self, pixels: f64, pitch: f64) -> Ticks {
        ticks(
            self.mapping,
            self.domain,
            (pixels / pitch).max(2.0) as usize,
        )
    }
}

/// The plot area of a chart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

impl Frame {
    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }

    pub fn right(&self) -> f64 {
        self.left + self.width
    }
}

/// Length of a tick without label.
const MINOR: f64 = 3.5;

/// Pixels between two labels below which they read as one.
const AIR: f64 = 5.0;

/// The horizontal axis: grid lines, the axis itself, labels below it.
pub(super) fn draw_x(svg: &mut Svg, frame: &Frame, axis: &Axis, limit: f64) {
    let scale = axis.scale([frame.left, frame.right()]);
    let ticks = axis.ticks(frame.width, 44.0);
    let bottom = frame.bottom();
    for value in &ticks.minor {
        if let Some(x) = scale.at(*value) {
            svg.line("minor", [x, bottom - MINOR], [x, bottom]);
        }
    }
    let mut end = f64::NEG_INFINITY;
    for (tick, x) in placed(&ticks, &scale) {
        svg.line("grid", [x, frame.top], [x, bottom]);
        let half = 0.5 * text_width(&tick.label, SMALL_TEXT);
        if x - half > end + AIR && x + half <= limit {
            svg.text(
                "tick",
                [x, bottom + SMALL_TEXT + 4.0],
                Anchor::Middle,
                &tick.label,
            );
            end = x + half;
        }
    }
    svg.line("axis", [frame.left, bottom], [frame.right(), bottom]);
    if !axis.title.is_empty() {
        svg.text(
            "axis-title",
            [frame.right(), bottom + 2.0 * SMALL_TEXT + 7.0],
            Anchor::End,
            &axis.title,
        );
    }
}

/// The vertical axis: grid lines and labels left of them.
pub(super) fn draw_y(svg: &mut Svg, frame: &Frame, axis: &Axis) {
    let scale = axis.scale([frame.bottom(), frame.top]);
    let ticks = y_ticks(axis, frame.height);
    for value in &ticks.minor {
        if let Some(y) = scale.at(*value) {
            svg.line("minor", [frame.left, y], [frame.left + MINOR, y]);
        }
    }
    let mut free_below = f64::INFINITY;
    for (tick, y) in placed(&ticks, &scale) {
        let class = if tick.value == 0.0 && axis.mapping == Mapping::Linear {
            "axis"
        } else {
            "grid"
        };
        svg.line(class, [frame.left, y], [frame.right(), y]);
        if y + 0.5 * SMALL_TEXT < free_below {
            svg.text(
                "tick",
                [frame.left - 5.0, y + 0.35 * SMALL_TEXT],
                Anchor::End,
                &tick.label,
            );
            free_below = y - 0.5 * SMALL_TEXT - 1.0;
        }
    }
}

pub(super) fn y_ticks(axis: &Axis, height: f64) -> Ticks {
    axis.ticks(height, 26.0)
}

/// Room that the labels of a vertical axis need left of it.
pub(super) fn label_room(ticks: &Ticks) -> f64 {
    let widest = ticks
        .major
        .iter()
        .map(|t| text_width(&t.label, SMALL_TEXT))
        .fold(0.0, f64::max);
    (widest + 8.0).max(24.0)
}

fn placed<'a>(ticks: &'a Ticks, scale: &'a Scale) -> impl Iterator<Item = (&'a Tick, f64)> {
    ticks
        .major
        .iter()
        .filter_map(|t| Some((t, scale.at(t.value)?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places and widths of the labels of an x axis.
    fn labels(axis: &Axis, width: f64) -> Vec<(f64, f64)> {
        let frame = Frame {
            left: 30.0,
            top: 0.0,
            width,
            height: 100.0,
        };
        let mut svg = Svg::new(width + 40.0, 140.0, "");
        draw_x(&mut svg, &frame, axis, width + 40.0);
        let text = svg.finish();
        let parsed = roxmltree::Document::parse(&text).unwrap();
        parsed
            .descendants()
            .filter(|n| n.attribute("class") == Some("tick"))
            .map(|n| {
                let x: f64 = n.attribute("x").unwrap().parse().unwrap();
                (x, text_width(n.text().unwrap(), SMALL_TEXT))
            })
            .collect()
    }

    #[test]
    fn labels_never_overlap() {
        for (mapping, domain) in [
            (Mapping::Linear, [-123_456.0, 987_654.0]),
            (Mapping::Linear, [0.001_2, 0.001_3]),
            (Mapping::Log, [1e-12, 1e9]),
            (Mapping::Nines, [0.0, 0.999_999_9]),
        ] {
            for width in [20.0, 90.0, 300.0, 1000.0] {
                let axis = Axis::new("f, Hz", mapping, domain);
                for pair in labels(&axis, width).windows(2) {
                    let [(x0, w0), (x1, w1)] = [pair[0], pair[1]];
                    assert!(x0 + 0.5 * w0 < x1 - 0.5 * w1, "{axis:?} at {width}");
                }
            }
        }
    }
}
