//! The sensors of a set-up with their rows, which a hypothesis changes.

use super::model::{Kind, Sensor};
use super::table::Row;

/// The state of a set-up: its sensors and rows, perhaps repaired.
#[derive(Clone)]
pub(super) struct State {
    pub(super) sensors: Vec<Sensor>,
    pub(super) rows: Vec<Option<Row>>,
    /// The rows as they are if an interface accelerometer is taken for another sensor, and the other
    /// way round.
    pub(super) others: Vec<Option<Row>>,
}

impl State {
    /// Exchanges the readings of two channels.
    pub(super) fn swap(&mut self, [a, b]: [usize; 2]) {
        self.rows.swap(a, b);
        self.others.swap(a, b);
        let elastic = |kind: Kind| kind != Kind::Interface;
        if elastic(self.sensors[a].kind) != elastic(self.sensors[b].kind) {
            for channel in [a, b] {
                std::mem::swap(&mut self.rows[channel], &mut self.others[channel]);
            }
        }
    }
}
