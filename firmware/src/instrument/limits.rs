//! Limits of the values in a request, and the refusals of those beyond.

use crate::wire::{Field, Item, Problem};

pub(super) fn below(item: Item, found: u8, limit: u8) -> Result<usize, Problem> {
    if found < limit {
        return Ok(usize::from(found));
    }
    Err(Problem::index(item, usize::from(found), usize::from(limit)))
}

pub(super) fn fits(item: Item, found: usize, limit: usize) -> Result<(), Problem> {
    if found <= limit {
        return Ok(());
    }
    Err(Problem::capacity(item, found, limit))
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
    Err(Problem::range(field, index, found, [low, high]))
}

pub(super) fn finite(field: Field, index: u32, found: f64) -> Result<(), Problem> {
    within(field, index, found, f64::MIN, f64::MAX)
}
