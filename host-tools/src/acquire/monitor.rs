//! Levels some times a second.

use super::follow::{Course, Taker, follow, sample_rate};
use super::{AcquireError, Intake, Level};
use crate::device::{Client, Port};
use crate::inputs::InputEntry;
use crate::limits;
use massline_firmware::wire::{Event, Fault};
use std::cell::RefCell;
use std::rc::Rc;

/// Levels over a short time.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// Its end, s of samples since the beginning.
    pub seconds: f64,
    /// One for each input.
    pub levels: Vec<Level>,
    /// Faults of the box since the one before.
    pub box_faults: Vec<Fault>,
}

struct Monitor {
    intake: Intake,
    rate: f64,
    /// Samples of a snapshot, and of all of them.
    every: u64,
    limit: Option<u64>,
    rows: u64,
    levels: Vec<Level>,
    box_faults: Vec<Fault>,
    ready: Vec<Snapshot>,
}

impl Taker for Monitor {
    fn take(&mut self, event: &Event<'_>, _: f64) -> Result<bool, AcquireError> {
        let Self {
            intake,
            rate,
            every,
            limit,
            rows,
            levels,
            box_faults,
            ready,
        } = self;
        let last = intake.take(event, &mut |row| {
            if limit.is_some_and(|limit| *rows >= limit) {
                return;
            }
            *rows += 1;
            Level::add(levels, row);
            if rows.is_multiple_of(*every) {
                ready.push(Snapshot {
                    seconds: *rows as f64 / *rate,
                    levels: levels.clone(),
                    box_faults: std::mem::take(box_faults),
                });
                levels.iter_mut().for_each(Level::restart);
            }
        })?;
        Ok(last.is_some())
    }

    fn fault(&mut self, fault: &Fault) {
        // They are shown some times a second; nobody reads more of them in that time.
        if self.box_faults.len() < limits::LISTED_FAULTS {
            self.box_faults.push(*fault);
        }
    }

    fn is_done(&self) -> bool {
        self.limit.is_some_and(|limit| self.rows >= limit)
    }
}

/// Shows `show` the levels of the inputs every so many seconds of samples, until so many
/// seconds have gone by or it says `false`.
///
/// # Errors
/// [`AcquireError`].
pub fn monitor<P: Port>(
    client: &mut Client<'_, P>,
    inputs: &[InputEntry],
    every: f64,
    seconds: Option<f64>,
    show: &mut dyn FnMut(&Snapshot) -> bool,
) -> Result<(), AcquireError> {
    let rate = sample_rate(client)?;
    let every = ((every * rate).round() as u64).max(1);
    // Whole snapshots, one at the least.
    let whole = |seconds: f64| {
        ((seconds * rate).round() as u64)
            .max(1)
            .div_ceil(every)
            .saturating_mul(every)
    };
    let monitor = Monitor {
        intake: Intake::new(inputs, rate),
        rate,
        every,
        limit: seconds.map(whole),
        rows: 0,
        levels: Level::of(inputs),
        box_faults: Vec::new(),
        ready: Vec::new(),
    };
    let mut stopped = false;
    let mut tell = |monitor: &mut Monitor| {
        for snapshot in monitor.ready.drain(..) {
            stopped = stopped || !show(&snapshot);
        }
        !stopped
    };
    let monitor = Rc::new(RefCell::new(monitor));
    let result = follow(client, Course { rate, seconds }, &monitor, &mut tell);
    tell(&mut monitor.borrow_mut());
    result
}
