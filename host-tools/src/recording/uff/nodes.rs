//! Nodes of datasets 15, 781 and 2411: the places of sensors.

use super::header::shown;
use super::units::System;
use crate::limits;
use std::collections::HashMap;

/// Coordinate systems that stand for the global Cartesian one.
const GLOBAL: [i64; 2] = [0, 1];

/// Nodes by their numbers, with their positions in m; `None`: in a coordinate system of its own.
#[derive(Debug, Default)]
pub(super) struct Nodes {
    positions: HashMap<i64, Option<[f64; 3]>>,
    /// Nodes whose directions are along a coordinate system of their own, with its number.
    turned: HashMap<i64, i64>,
    /// Numbers of coordinate systems that are not read.
    systems: Vec<i64>,
    without_unit: bool,
    too_many: bool,
}

/// A line that is no node: its number from the first line of the dataset, and what was found.
pub(super) type Wrong = (u64, String);

impl Nodes {
    /// Adds the nodes of a dataset by its lines; of one with two lines a node, `pairs` is `true`.
    ///
    /// # Errors
    /// The first line that is none of a node.
    pub(super) fn add(
        &mut self,
        lines: &[String],
        pairs: bool,
        system: Option<System>,
    ) -> Result<(), Wrong> {
        let per_node = if pairs { 2 } else { 1 };
        for (k, node) in lines.chunks(per_node).enumerate() {
            let text = node.join(" ").replace(['d', 'D'], "e");
            let fields: Vec<&str> = text.split_whitespace().collect();
            let whole = |n: usize| fields.get(n).and_then(|field| field.parse::<i64>().ok());
            let real = |n: usize| {
                let number = fields.get(n).and_then(|field| field.parse::<f64>().ok());
                number.filter(|x| x.is_finite())
            };
            let read = || {
                let heads = [whole(0)?, whole(1)?, whole(2)?];
                Some((heads, [real(4)?, real(5)?, real(6)?]))
            };
            let Some(([number, own, directions], place)) = read() else {
                let line = (k * per_node) as u64;
                return Err((line, shown(node.first().map_or("", String::as_str))));
            };
            if self.positions.len() == limits::COLUMNS {
                self.too_many = true;
                return Ok(());
            }
            let metres = system.and_then(|(length, _)| metres(length));
            self.without_unit |= metres.is_none();
            let known = GLOBAL.contains(&own);
            for system in [own, directions] {
                if !GLOBAL.contains(&system) && !self.systems.contains(&system) {
                    self.systems.push(system);
                }
            }
            if !GLOBAL.contains(&directions) {
                self.turned.insert(number, directions);
            }
            let position = metres.filter(|_| known).map(|metres| place.map(metres));
            self.positions.insert(number, position);
        }
        Ok(())
    }

    /// Position of a node in m, where it is known.
    pub(super) fn position(&self, node: i64) -> Option<[f64; 3]> {
        self.positions.get(&node).copied().flatten()
    }

    /// Coordinate system of the directions at a node, unless it is the global one.
    pub(super) fn turned(&self, node: i64) -> Option<i64> {
        self.turned.get(&node).copied()
    }

    /// Notes on nodes that are not read.
    pub(super) fn notes(&self) -> impl Iterator<Item = String> {
        let systems: Vec<String> = self.systems.iter().map(i64::to_string).collect();
        let systems = (!systems.is_empty()).then(|| {
            let systems = systems.join(", ");
            format!("positions and directions not read: those in the coordinate systems {systems}; export them in the global Cartesian one")
        });
        let unit = "positions of nodes not read: no dataset 164 states their unit";
        let unit = self.without_unit.then(|| unit.to_owned());
        let most = limits::COLUMNS;
        let many =
            (self.too_many).then(|| format!("positions of nodes behind the first {most} not read"));
        [systems, unit, many].into_iter().flatten()
    }
}

/// The way of a length in a unit to m; whole mm and cm give the number nearest to them in m.
fn metres(unit: &str) -> Option<fn(f64) -> f64> {
    Some(match unit {
        "m" => |x| x,
        "mm" => |x| x / 1000.0,
        "cm" => |x| x / 100.0,
        "in" => |x| x * 0.0254,
        "ft" => |x| x * 0.3048,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nodes(lines: &[&str], pairs: bool, unit: Option<&'static str>) -> Nodes {
        let lines: Vec<String> = lines.iter().map(|line| (*line).to_owned()).collect();
        let mut nodes = Nodes::default();
        nodes
            .add(&lines, pairs, unit.map(|unit| (unit, "N")))
            .unwrap();
        nodes
    }

    #[test]
    fn nodes_of_one_line_and_of_two() {
        let line =
            "        12         0         0        11  6.00000E+02 -5.50000E+02  0.00000E+00";
        let of_one = nodes(&[line], false, Some("mm"));
        assert_eq!(of_one.position(12), Some([0.6, -0.55, 0.0]));
        let head = "         7         1         1        11";
        let place = "   1.0000000000000000D+01  -2.0000000000000000D+00   5.0000000000000000D-01";
        let of_two = nodes(&[head, place], true, Some("in"));
        assert_eq!(of_two.position(7), Some([0.254, -0.0508, 0.0127]));
        assert_eq!(of_two.notes().count(), 0);
    }

    #[test]
    fn what_is_not_known_is_said() {
        let line = |own, directions| format!("1 {own} {directions} 11 1.0 2.0 3.0");
        let without_unit = nodes(&[&line(0, 0)], false, None);
        assert_eq!(without_unit.position(1), None);
        assert!(
            without_unit
                .notes()
                .any(|note| note.contains("dataset 164"))
        );
        let own = nodes(&[&line(5, 6)], false, Some("m"));
        assert_eq!((own.position(1), own.turned(1)), (None, Some(6)));
        assert!(own.notes().any(|note| note.contains("systems 5, 6;")));
        let wrong = ["1 0 0 11 1.0 2.0 x".to_owned()];
        let wrong = Nodes::default().add(&wrong, false, None);
        assert_eq!(wrong, Err((0, "`1 0 0 11 1.0 2.0 x`".to_owned())));
    }
}
