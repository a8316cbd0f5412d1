//! Series, rules and spans of a chart, and legends.

use super::{Svg, path};
use crate::report::markup::escape;

/// Meaning of a series, which has its colour in the style sheet. Each colour is
/// told from its neighbours by lightness as well as by hue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// Measured data: ink.
    Measured,
    /// A fit to them.
    Fit,
    /// The answer.
    Identified,
    /// The truth.
    Truth,
    /// In the background.
    Muted,
    /// One of several equals, counted from zero; the eighth has the first's colour again.
    Colour(usize),
}

/// Colours of [`Tone::Colour`].
const COLOURS: usize = 7;

impl Tone {
    /// Its class in the style sheet.
    #[must_use]
    pub fn class(self) -> String {
        match self {
            Self::Measured => "measured".to_owned(),
            Self::Fit => "fit".to_owned(),
            Self::Identified => "identified".to_owned(),
            Self::Truth => "truth".to_owned(),
            Self::Muted => "muted".to_owned(),
            Self::Colour(n) => format!("c{}", n % COLOURS),
        }
    }
}

/// Mark of a series.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    /// A line.
    #[default]
    Line,
    /// A thin line.
    Thin,
    /// A dashed line.
    Dashed,
    /// Dots, not connected.
    Dots,
    /// Larger dots, for a few points that count each.
    Points,
    /// A line with a dot at every point.
    Knots,
    /// The area between [`Series::points`] and [`Series::floor`].
    Area,
}

/// Data to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Its colour.
    pub tone: Tone,
    /// Line, dots or points.
    pub mark: Mark,
    /// In ascending x where they are connected; a point that is not finite is a gap.
    pub points: Vec<[f64; 2]>,
    /// Lower edge of an area.
    pub floor: Vec<[f64; 2]>,
    /// `true` if the name stands at its right end.
    pub labelled: bool,
}

impl Series {
    /// A series without label.
    #[must_use]
    pub fn new(name: impl Into<String>, tone: Tone, mark: Mark, points: Vec<[f64; 2]>) -> Self {
        Self {
            name: name.into(),
            tone,
            mark,
            points,
            floor: Vec::new(),
            labelled: false,
        }
    }

    /// The area between two lines.
    #[must_use]
    pub fn area(
        name: impl Into<String>,
        tone: Tone,
        upper: Vec<[f64; 2]>,
        lower: Vec<[f64; 2]>,
    ) -> Self {
        Self {
            floor: lower,
            ..Self::new(name, tone, Mark::Area, upper)
        }
    }

    /// The same with its name at its right end.
    #[must_use]
    pub fn labelled(self) -> Self {
        Self {
            labelled: true,
            ..self
        }
    }

    /// Draws it; `at` takes data to pixels.
    pub(super) fn draw(&self, svg: &mut Svg, at: impl Fn(&[f64; 2]) -> Option<[f64; 2]>) {
        let points: Vec<_> = self.points.iter().map(&at).collect();
        let floor: Vec<_> = self.floor.iter().map(&at).collect();
        draw_mark(svg, self.mark, self.tone, &points, &floor);
    }
}

fn draw_mark(
    svg: &mut Svg,
    mark: Mark,
    tone: Tone,
    points: &[Option<[f64; 2]>],
    floor: &[Option<[f64; 2]>],
) {
    let tone = tone.class();
    match mark {
        Mark::Line => svg.path(&format!("line {tone}"), &path::line(points)),
        Mark::Thin => svg.path(&format!("line thin {tone}"), &path::line(points)),
        Mark::Dashed => svg.path(&format!("line dashed {tone}"), &path::line(points)),
        Mark::Dots => svg.path(&format!("dots {tone}"), &path::dots(points)),
        Mark::Points => svg.path(&format!("dots large {tone}"), &path::dots(points)),
        Mark::Knots => {
            svg.path(&format!("line {tone}"), &path::line(points));
            svg.path(&format!("dots large {tone}"), &path::dots(points));
        }
        Mark::Area => svg.path(&format!("area {tone}"), &path::area(points, floor)),
    }
}

/// A stretch of the x axis that is shaded.
#[derive(Clone, Debug, PartialEq)]
pub struct Span {
    /// From where to where.
    pub x: [f64; 2],
    /// Written at its top, if there is room.
    pub label: String,
}

/// A straight line through the whole plot.
#[derive(Clone, Debug, PartialEq)]
pub enum Rule {
    /// At one x, its label at the top.
    Vertical {
        /// Place on the axis.
        x: f64,
        /// Text beside it.
        label: String,
        /// Its colour.
        tone: Tone,
    },
    /// At one y, its label at the right end.
    Horizontal {
        /// Place on the axis.
        y: f64,
        /// Text beside it.
        label: String,
        /// Its colour.
        tone: Tone,
    },
}

impl Rule {
    /// A line at one x.
    #[must_use]
    pub fn vertical(x: f64, label: impl Into<String>, tone: Tone) -> Self {
        let label = label.into();
        Self::Vertical { x, label, tone }
    }

    /// A line at one y.
    #[must_use]
    pub fn horizontal(y: f64, label: impl Into<String>, tone: Tone) -> Self {
        let label = label.into();
        Self::Horizontal { y, label, tone }
    }
}

/// A legend as an HTML list, for charts that share it.
#[must_use]
pub fn legend(entries: &[(Tone, Mark, &str)]) -> String {
    let mut list = String::from("<ul class=\"legend\">");
    for (tone, mark, name) in entries {
        let mut svg = Svg::new(28.0, 12.0, "");
        let points: Vec<_> = match mark {
            Mark::Dots | Mark::Points => (0..4)
                .map(|i| Some([4.0 + 6.5 * f64::from(i), [7.5, 4.5, 6.5, 4.0][i as usize]]))
                .collect(),
            Mark::Knots => [3.0, 14.0, 25.0].map(|x| Some([x, 6.0])).to_vec(),
            Mark::Area => vec![Some([1.0, 2.0]), Some([27.0, 2.0])],
            _ => vec![Some([1.0, 6.0]), Some([27.0, 6.0])],
        };
        let floor = [Some([1.0, 10.0]), Some([27.0, 10.0])];
        draw_mark(&mut svg, *mark, *tone, &points, &floor);
        list.push_str("<li>");
        list.push_str(&svg.finish_inline());
        list.push_str(&escape(name));
        list.push_str("</li>");
    }
    list.push_str("</ul>");
    list
}
