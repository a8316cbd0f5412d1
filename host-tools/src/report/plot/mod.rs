//! Plots as inline SVG: scales, ticks, axes and line charts.
//!
//! Nothing here knows what a mass is. A chart is described by plain data
//! ([`LineChart`]) and drawn as one `<svg>` whose colours are classes, so that the page's
//! style sheet decides about light, dark and paper. No scripts, no identifiers that two
//! charts on one page could both claim.
//!
//! | file | does |
//! | --- | --- |
//! | `scale` | data to pixels: linear, logarithmic, "nines" |
//! | `ticks` | round numbers for axes |
//! | `axis` | axes with labels that never overlap |
//! | `path` | data to path strings, thinned to what can be seen |
//! | `series` | what is drawn in a chart, and legends |
//! | `line_chart` | the chart |
//! | `svg` | the document, and how wide text is |

mod axis;
mod line_chart;
pub mod path;
mod scale;
mod series;
mod svg;
mod ticks;

pub use axis::Axis;
pub use line_chart::LineChart;
pub use scale::{Extent, Mapping, Scale};
pub use series::{Mark, Rule, Series, Span, Tone, legend};
pub use svg::{Anchor, Svg, text_width};
pub use ticks::{Tick, Ticks, ticks};

/// Size of tick labels, in the units of the drawing; CSS has the same number.
pub const SMALL_TEXT: f64 = 10.5;
/// Size of titles and direct labels.
pub const TEXT: f64 = 12.0;
