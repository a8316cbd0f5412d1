//! Three views of one scale, projected onto each other as in a drawing: above the front
//! view lies the view from above, right of it the view from the right.

use super::scene::Scene;
use crate::report::plot::{Mapping, Scale};

/// Room around the drawn points for symbols and names.
const PAD: f64 = 38.0;
/// Room for tick labels.
const LEFT: f64 = 50.0;
const BETWEEN: f64 = 58.0;
const BELOW: f64 = 36.0;
const ABOVE: f64 = 20.0;
const EDGE: f64 = 8.0;
/// Largest drawing.
const WIDTH: f64 = 1000.0;
const HEIGHT: f64 = 720.0;
/// An extent shorter than this share of the longest is drawn as long as that.
const SHORTEST: f64 = 0.12;

/// One view: its axes and its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct View {
    pub title: &'static str,
    /// Axis to the right, axis upwards.
    pub axes: [usize; 2],
    /// Axis along the line of sight, and whether its positive direction points at the
    /// reader.
    pub sight: (usize, bool),
    pub corner: [f64; 2],
    pub size: [f64; 2],
    /// `true` for tick labels below and left of the view.
    pub labelled: [bool; 2],
}

/// The whole drawing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    pub size: [f64; 2],
    pub views: [View; 3],
    pub pixels_per_metre: f64,
    /// Lowest and highest coordinate of each axis, m.
    domains: [[f64; 2]; 3],
}

impl Layout {
    pub fn new(scene: &Scene) -> Self {
        let mut domains = [0, 1, 2].map(|axis| scene.extent(axis));
        let longest = scene.longest();
        let shortest = if longest > 0.0 {
            SHORTEST * longest
        } else {
            0.1
        };
        for domain in &mut domains {
            let missing = shortest - (domain[1] - domain[0]);
            if missing > 0.0 {
                domain[0] -= 0.5 * missing;
                domain[1] += 0.5 * missing;
            }
        }
        let span = domains.map(|[a, b]| b - a);
        let across = (WIDTH - LEFT - BETWEEN - EDGE - 4.0 * PAD) / (span[0] + span[1]);
        let up = (HEIGHT - 2.0 * ABOVE - 2.0 * BELOW - 4.0 * PAD) / (span[1] + span[2]);
        let pixels_per_metre = across.min(up);
        // The domains grow by the padding, so that ticks run on under the symbols.
        let pad = PAD / pixels_per_metre;
        let domains = domains.map(|[a, b]| [a - pad, b + pad]);
        let long = domains.map(|[a, b]| (b - a) * pixels_per_metre);
        let second_column = LEFT + long[0] + BETWEEN;
        let second_row = ABOVE + long[1] + BELOW + ABOVE;
        let view = |title, axes: [usize; 2], sight, corner, labelled| View {
            title,
            axes,
            sight,
            corner,
            size: [long[axes[0]], long[axes[1]]],
            labelled,
        };
        Self {
            size: [second_column + long[1] + EDGE, second_row + long[2] + BELOW],
            views: [
                view("from above", [0, 1], (2, true), [LEFT, ABOVE], [true, true]),
                view(
                    "from the front",
                    [0, 2],
                    (1, false),
                    [LEFT, second_row],
                    [true, true],
                ),
                view(
                    "from the right",
                    [1, 2],
                    (0, true),
                    [second_column, second_row],
                    [true, true],
                ),
            ],
            pixels_per_metre,
            domains,
        }
    }

    /// Lowest and highest coordinate of an axis, m.
    pub fn domain(&self, axis: usize) -> [f64; 2] {
        self.domains[axis]
    }

    /// Metres to units of the drawing, to the right and upwards.
    pub fn scales(&self, view: &View) -> [Scale; 2] {
        let [x, y] = view.corner;
        let [width, height] = view.size;
        [
            Scale::new(Mapping::Linear, self.domains[view.axes[0]], [x, x + width]),
            Scale::new(Mapping::Linear, self.domains[view.axes[1]], [y + height, y]),
        ]
    }
}
