//! Names where there is room for them.

use crate::report::plot::{Anchor, SMALL_TEXT, Svg, text_width};

/// A rectangle: left, top, right, bottom.
type Area = [f64; 4];

/// Parts of a view that are taken.
#[derive(Clone, Debug)]
pub(super) struct Room {
    bounds: Area,
    taken: Vec<Area>,
}

impl Room {
    /// A free view.
    pub fn new(corner: [f64; 2], size: [f64; 2]) -> Self {
        Self {
            bounds: [
                corner[0],
                corner[1],
                corner[0] + size[0],
                corner[1] + size[1],
            ],
            taken: Vec::new(),
        }
    }

    /// Takes what lies between two points, and a margin.
    pub fn take(&mut self, a: [f64; 2], b: [f64; 2], margin: f64) {
        self.taken.push([
            a[0].min(b[0]) - margin,
            a[1].min(b[1]) - margin,
            a[0].max(b[0]) + margin,
            a[1].max(b[1]) + margin,
        ]);
    }

    /// Writes a name near a point, or nothing if there is no room.
    pub fn name(&mut self, svg: &mut Svg, class: &str, at: [f64; 2], text: &str) {
        let width = text_width(text, SMALL_TEXT);
        let half = 0.5 * SMALL_TEXT;
        for distance in [9.0, 13.0, 19.0, 26.0] {
            // The middle of the text's left or right end, or of the text itself.
            let places = [
                ([at[0] + distance, at[1]], Anchor::Start),
                ([at[0] - distance, at[1]], Anchor::End),
                ([at[0], at[1] - distance], Anchor::Middle),
                ([at[0], at[1] + distance], Anchor::Middle),
                (
                    [at[0] + 0.7 * distance, at[1] - 0.8 * distance],
                    Anchor::Start,
                ),
                (
                    [at[0] + 0.7 * distance, at[1] + 0.8 * distance],
                    Anchor::Start,
                ),
                (
                    [at[0] - 0.7 * distance, at[1] - 0.8 * distance],
                    Anchor::End,
                ),
                (
                    [at[0] - 0.7 * distance, at[1] + 0.8 * distance],
                    Anchor::End,
                ),
            ];
            for (place, anchor) in places {
                let left = match anchor {
                    Anchor::Start => place[0],
                    Anchor::Middle => place[0] - 0.5 * width,
                    Anchor::End => place[0] - width,
                };
                let area = [left, place[1] - half, left + width, place[1] + half];
                if self.is_free(&area) {
                    self.taken.push(area);
                    svg.text(
                        class,
                        [place[0], place[1] + 0.35 * SMALL_TEXT],
                        anchor,
                        text,
                    );
                    return;
                }
            }
        }
    }

    fn is_free(&self, area: &Area) -> bool {
        let b = &self.bounds;
        let inside = area[0] >= b[0] && area[1] >= b[1] && area[2] <= b[2] && area[3] <= b[3];
        inside
            && !self
                .taken
                .iter()
                .any(|t| area[0] < t[2] && area[2] > t[0] && area[1] < t[3] && area[3] > t[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_find_different_places_or_none() {
        let mut room = Room::new([0.0, 0.0], [60.0, 60.0]);
        let mut svg = Svg::new(60.0, 60.0, "");
        for _ in 0..20 {
            room.name(&mut svg, "name", [30.0, 30.0], "a12");
        }
        let placed = room.taken.len();
        assert!((2..20).contains(&placed), "{placed}");
        for (i, a) in room.taken.iter().enumerate() {
            for b in &room.taken[..i] {
                let apart = a[0] >= b[2] || a[2] <= b[0] || a[1] >= b[3] || a[3] <= b[1];
                assert!(apart);
            }
        }
    }
}
