//! Limits of the values in a request, and the refusals of those beyond.

use crate::wire::{Field, Item, Problem};

pub(super) fn below(item: Item, found: u8, limit: u8) -> Result<usize, Problem> {
    if found < limit {
        return Ok(usize::from(found));
    }
    Err(Problem::Index {
        item,
        found: u32::from(found),
        limit: u32::from(limit),
    })
}

pub(super) fn fits(item: Item, found: usize, limit: usize) -> Result<(), Problem> {
    if found <= limit {
        return Ok(());
    }
    Err(Problem::Capacity {
        item,
        found: u32::try_from(found).unwrap_or(u32::MAX),
        limit: limit as u32,
    })
}

pub(super) fn range(field: Field, index: u32, found: f64, low: f64, high: f64) -> Problem {
    Problem::Range {
        field,
        index,
        found,
        low,
        high,
    }
}

pub(super) fn within(
    field: Field,
    index: u32,
    found: f64,
    low: f64,
    high: f64,
) -> Result<(), Problem> {
    if (low..=high).contains(&found) && found.is_finite() {
        return Ok(());
    }
    Err(range(field, index, found, low, high))
}

pub(super) fn finite(field: Field, index: u32, found: f64) -> Result<(), Problem> {
    within(field, index, found, f64::MIN, f64::MAX)
}

/// The same problem, of the sensor or input of this number.
pub(super) fn about(problem: Problem, number: u32) -> Problem {
    match problem {
        Problem::Range {
            field,
            found,
            low,
            high,
            ..
        } => Problem::Range {
            field,
            index: number,
            found,
            low,
            high,
        },
        other => other,
    }
}

/// The refusal of a request that needs something that is not there.
pub(super) fn missing(item: Item, index: usize) -> Problem {
    Problem::Missing {
        item,
        index: index as u32,
    }
}
