//! The sensors of a set-up with their rows, which a hypothesis changes.

use super::sensor::{Kind, Sensor};
use super::table::Row;

/// The rows of all channels in the runs of one mounting.
#[derive(Clone)]
pub(super) struct Rows {
    pub(super) rows: Vec<Option<Row>>,
    /// The rows as they are if an interface accelerometer is taken for another sensor, and the other
    /// way round.
    pub(super) others: Vec<Option<Row>>,
}

/// The state of a set-up: its sensors and rows, perhaps repaired.
#[derive(Clone)]
pub(super) struct State {
    /// As the set-up has them: those on the structure in the specimen's frame.
    pub(super) sensors: Vec<Sensor>,
    /// One a mounting.
    pub(super) mountings: Vec<Rows>,
}

impl State {
    /// Exchanges the readings of two channels.
    pub(super) fn swap(&mut self, [a, b]: [usize; 2]) {
        let elastic = |kind: Kind| kind != Kind::Interface;
        let differ = elastic(self.sensors[a].kind) != elastic(self.sensors[b].kind);
        for Rows { rows, others } in &mut self.mountings {
            rows.swap(a, b);
            others.swap(a, b);
            if differ {
                for channel in [a, b] {
                    std::mem::swap(&mut rows[channel], &mut others[channel]);
                }
            }
        }
    }

    /// `true` if a channel has rows.
    pub(super) fn is_live(&self, channel: usize) -> bool {
        self.mountings.iter().any(|m| m.rows[channel].is_some())
    }

    /// The channels that have rows.
    pub(super) fn live(&self) -> Vec<usize> {
        (0..self.sensors.len())
            .filter(|&i| self.is_live(i))
            .collect()
    }

    /// The rows of a channel in all mountings.
    pub(super) fn rows_mut(&mut self, channel: usize) -> impl Iterator<Item = &mut Row> {
        self.mountings
            .iter_mut()
            .filter_map(move |m| m.rows[channel].as_mut())
    }
}
