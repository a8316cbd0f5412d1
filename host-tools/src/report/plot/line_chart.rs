//! The chart: title, axes, shaded spans, rules, series and their labels.

use super::axis::{self, Frame};
use super::{Anchor, Axis, Mark, Rule, SMALL_TEXT, Series, Span, Svg, TEXT, Tone, text_width};
use crate::report::markup::shortened;

/// A chart, or one panel of several.
#[derive(Clone, Debug, PartialEq)]
pub struct LineChart {
    /// Title, bold.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis; its title stands behind the chart's.
    pub y: Axis,
    /// Shaded stretches.
    pub spans: Vec<Span>,
    /// Straight lines.
    pub rules: Vec<Rule>,
    /// The data, drawn in this order.
    pub series: Vec<Series>,
    /// Width and height in units of the drawing; text is about 11 of them high.
    pub size: [f64; 2],
}

/// A name at the right end of what it names.
struct Label {
    y: f64,
    text: String,
    tone: Tone,
}

impl LineChart {
    /// A panel of the size that three of a row have on a wide screen.
    #[must_use]
    pub fn panel(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            spans: Vec::new(),
            rules: Vec::new(),
            series: Vec::new(),
            size: [360.0, 214.0],
        }
    }

    /// Adds a series without label.
    pub fn draw(&mut self, name: impl Into<String>, tone: Tone, mark: Mark, points: Vec<[f64; 2]>) {
        self.series.push(Series::new(name, tone, mark, points));
    }

    /// Shades a stretch of the x axis.
    pub fn shade(&mut self, x: [f64; 2], label: impl Into<String>) {
        let label = label.into();
        self.spans.push(Span { x, label });
    }

    /// The chart as an `<svg>` element.
    #[must_use]
    pub fn svg(&self) -> String {
        let mut svg = Svg::new(self.size[0], self.size[1], &self.description());
        let frame = self.frame();
        self.draw_header(&mut svg, &frame);
        let x = self.x.scale([frame.left, frame.right()]);
        for span in &self.spans {
            if let (Some(a), Some(b)) = (x.at(span.x[0]), x.at(span.x[1])) {
                let a = a.clamp(frame.left, frame.right());
                let b = b.clamp(frame.left, frame.right());
                svg.rectangle("span", [a, frame.top], [b - a, frame.height]);
            }
        }
        axis::draw_x(&mut svg, &frame, &self.x, self.size[0]);
        axis::draw_y(&mut svg, &frame, &self.y);
        svg.place([frame.left, frame.top], self.data(&frame));
        self.draw_tags(&mut svg, &frame);
        self.draw_labels(&mut svg, &frame);
        svg.finish()
    }

    fn description(&self) -> String {
        let mut text = format!("{} {}, over {}", self.title, self.y.title, self.x.title);
        for (i, series) in self.series.iter().enumerate() {
            text.push_str(if i == 0 { ": " } else { ", " });
            text.push_str(&series.name);
        }
        text
    }

    fn frame(&self) -> Frame {
        let header = if self.title.is_empty() && self.y.title.is_empty() {
            6.0
        } else {
            24.0
        };
        let footer = if self.x.title.is_empty() { 18.0 } else { 31.0 };
        let height = (self.size[1] - header - footer).max(10.0);
        let left = axis::label_room(&axis::y_ticks(&self.y, height));
        let widest = self
            .labels(&Frame {
                left: 0.0,
                top: 0.0,
                width: 1.0,
                height,
            })
            .iter()
            // They are bold, which is a tenth wider.
            .map(|l| 1.1 * text_width(&l.text, SMALL_TEXT) + 8.0)
            .fold(8.0, f64::max);
        let right = widest.min(0.35 * self.size[0]);
        Frame {
            left,
            top: header,
            width: (self.size[0] - left - right).max(10.0),
            height,
        }
    }

    fn draw_header(&self, svg: &mut Svg, frame: &Frame) {
        let most = self.size[0];
        // Digits are the widest common characters; nothing is cut that would fit.
        let fit = |text: &str, size: f64, room: f64| {
            let width = text_width(text, size);
            if width <= room {
                text.to_owned()
            } else {
                let share = room.max(0.0) / width;
                shortened(text, (share * text.chars().count() as f64) as usize)
            }
        };
        let title = fit(&self.title, TEXT * 1.05, most);
        // Short titles stand above the axis, long ones begin at the left edge.
        let needed = text_width(&title, TEXT) + text_width(&self.y.title, SMALL_TEXT) + 8.0;
        let left = frame.left.min((most - needed).max(0.0));
        let room = most - left - text_width(&title, TEXT * 1.05) - 6.0;
        let detail = fit(&self.y.title, SMALL_TEXT, room);
        svg.two_texts([left, TEXT], ("title", &title), ("axis-title", &detail));
    }

    /// Everything that is clipped at the frame.
    fn data(&self, frame: &Frame) -> Svg {
        let mut inner = Svg::new(frame.width, frame.height, "");
        let x = self.x.scale([0.0, frame.width]);
        let y = self.y.scale([frame.height, 0.0]);
        for rule in &self.rules {
            match rule {
                Rule::Vertical { x: at, tone, .. } => {
                    if let Some(x) = x.at(*at) {
                        let class = format!("rule {}", tone.class());
                        inner.line(&class, [x, 0.0], [x, frame.height]);
                    }
                }
                Rule::Horizontal { y: at, tone, .. } => {
                    if let Some(y) = y.at(*at) {
                        let class = format!("rule {}", tone.class());
                        inner.line(&class, [0.0, y], [frame.width, y]);
                    }
                }
            }
        }
        for series in &self.series {
            series.draw(&mut inner, |p| Some([x.at(p[0])?, y.at(p[1])?]));
        }
        inner
    }

    /// Labels of vertical rules and spans, along the top inside the frame; each goes to
    /// the first of two rows where it is free, and is left out where neither is.
    fn draw_tags(&self, svg: &mut Svg, frame: &Frame) {
        let x = self.x.scale([frame.left, frame.right()]);
        let mut rows = [f64::NEG_INFINITY; 2];
        let mut tags: Vec<(f64, &str, String)> = Vec::new();
        for span in &self.spans {
            if let Some(at) = x.at(span.x[0]) {
                let at = at.max(frame.left);
                tags.push((at, &span.label, "tag".to_owned()));
            }
        }
        for rule in &self.rules {
            if let Rule::Vertical { x: at, label, tone } = rule
                && let Some(at) = x.at(*at)
            {
                tags.push((at, label, format!("tag {}", tone.class())));
            }
        }
        tags.retain(|(at, label, _)| {
            !label.is_empty() && *at >= frame.left - 1.0 && *at <= frame.right()
        });
        tags.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (at, label, class) in tags {
            let width = text_width(label, SMALL_TEXT);
            let start = (at + 3.0).min(self.size[0] - width);
            for (row, end) in rows.iter_mut().enumerate() {
                if start > *end + 4.0 {
                    *end = start + width;
                    let y = frame.top + SMALL_TEXT * (1.0 + 1.15 * row as f64);
                    svg.text(&class, [start, y], Anchor::Start, label);
                    break;
                }
            }
        }
    }

    fn labels(&self, frame: &Frame) -> Vec<Label> {
        let y = self.y.scale([frame.bottom(), frame.top]);
        let inside = |y: &f64| *y >= frame.top - 1.0 && *y <= frame.bottom() + 1.0;
        let in_x = |p: &&[f64; 2]| p[0] >= self.x.domain[0] && p[0] <= self.x.domain[1];
        let mut labels = Vec::new();
        for series in self.series.iter().filter(|s| s.labelled) {
            let end = series.points.iter().rev().filter(in_x);
            // Where the last point left the frame, the label stands at its edge.
            let end = end.filter_map(|p| y.at(p[1])).next();
            if let Some(end) = end {
                labels.push(Label {
                    y: end.clamp(frame.top, frame.bottom()),
                    text: shortened(&series.name, 18),
                    tone: series.tone,
                });
            }
        }
        for rule in &self.rules {
            if let Rule::Horizontal { y: at, label, tone } = rule
                && let Some(y) = y.at(*at).filter(inside)
            {
                labels.push(Label {
                    y,
                    text: label.clone(),
                    tone: *tone,
                });
            }
        }
        labels.retain(|l| !l.text.is_empty());
        spread(&mut labels, frame.top, frame.bottom());
        labels
    }

    fn draw_labels(&self, svg: &mut Svg, frame: &Frame) {
        for label in self.labels(frame) {
            svg.text(
                &format!("label {}", label.tone.class()),
                [frame.right() + 4.0, label.y + 0.35 * SMALL_TEXT],
                Anchor::Start,
                &label.text,
            );
        }
    }
}

/// Moves labels apart until none covers another, as little as that takes from the top.
fn spread(labels: &mut [Label], top: f64, bottom: f64) {
    const PITCH: f64 = SMALL_TEXT + 1.5;
    labels.sort_by(|a, b| a.y.total_cmp(&b.y));
    let mut free = top;
    for label in labels.iter_mut() {
        label.y = label.y.max(free);
        free = label.y + PITCH;
    }
    let mut free = bottom;
    for label in labels.iter_mut().rev() {
        label.y = label.y.min(free);
        free = label.y - PITCH;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::plot::Mapping;

    fn chart() -> LineChart {
        let mut chart = LineChart::panel(
            "Error <of> Θ & co",
            Axis::new("noise, %", Mapping::Log, [0.01, 10.0]),
            Axis::new("error, %", Mapping::Log, [1e-4, 100.0]),
        );
        for n in 0..9 {
            let points = (0..50).map(|i| {
                let x = 0.01 * 1.15_f64.powi(i);
                [x, x * f64::from(n)]
            });
            let name = format!("method \"{n}\"");
            let series = Series::new(
                name,
                Tone::Colour(n as usize),
                Mark::Knots,
                points.collect(),
            );
            chart.series.push(series.labelled());
        }
        chart.shade([0.1, 1.0], "usual");
        chart.rules.push(Rule::vertical(3.0, "3 %", Tone::Muted));
        chart
    }

    #[test]
    fn a_chart_is_well_formed_whatever_it_shows() {
        let mut broken = chart();
        broken.series[3].points = vec![[f64::NAN, 1.0], [1.0, f64::INFINITY], [0.0, -1.0]];
        broken.y.domain = [f64::NAN, 1.0];
        broken.x.domain = [1.0, 1.0];
        let mut empty = chart();
        empty.series.clear();
        empty.size = [0.0, 0.0];
        for chart in [chart(), broken, empty] {
            let text = chart.svg();
            let parsed = roxmltree::Document::parse(&text);
            assert!(parsed.is_ok(), "{parsed:?} in {text}");
            assert!(!text.contains("NaN") && !text.contains("inf"));
        }
    }

    #[test]
    fn labels_at_the_right_end_keep_their_distance() {
        let text = chart().svg();
        let parsed = roxmltree::Document::parse(&text).unwrap();
        let mut heights: Vec<f64> = parsed
            .descendants()
            .filter(|n| n.attribute("class").is_some_and(|c| c.starts_with("label")))
            .map(|n| n.attribute("y").unwrap().parse().unwrap())
            .collect();
        // One of the nine lies at zero, which has no place on a logarithmic axis.
        assert_eq!(heights.len(), 8);
        heights.sort_by(f64::total_cmp);
        assert!(heights.windows(2).all(|w| w[1] - w[0] >= SMALL_TEXT));
    }
}
