//! Samples of a file on both sides of one, for what reads more than that one.

use super::source::Place;
use massline_firmware::wire::Health;
use std::collections::VecDeque;

/// A sample of the file.
pub(super) struct Row {
    pub(super) readings: Vec<f64>,
    pub(super) place: Place,
    pub(super) health: Health,
}

/// The sample that is handed out, with so many before and after it.
pub(super) struct Around {
    pub(super) behind: usize,
    pub(super) ahead: usize,
    rows: VecDeque<Row>,
    /// Samples in `rows` that have faults.
    faulty: usize,
}

impl Around {
    pub(super) fn new(behind: usize, ahead: usize) -> Self {
        Self {
            behind,
            ahead,
            rows: VecDeque::new(),
            faulty: 0,
        }
    }

    /// Takes the next sample of the file. `true` if there is a sample with all of its neighbours.
    pub(super) fn push(&mut self, row: Row) -> bool {
        let whole = self.behind + self.ahead + 1;
        if self.rows.len() == whole
            && let Some(oldest) = self.rows.pop_front()
        {
            self.faulty -= usize::from(!oldest.health.is_good());
        }
        self.faulty += usize::from(!row.health.is_good());
        self.rows.push_back(row);
        self.rows.len() == whole
    }

    /// The sample so many after the one that is handed out.
    pub(super) fn at(&self, offset: i64) -> Option<&Row> {
        let position = usize::try_from(self.behind as i64 + offset).ok()?;
        self.rows.get(position)
    }

    /// All of them, the oldest first.
    pub(super) fn all(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter()
    }

    /// `true` if one of them has faults.
    pub(super) fn is_faulty(&self) -> bool {
        self.faulty > 0
    }
}
