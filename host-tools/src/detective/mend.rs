//! A set-up without a fault, its contradiction, and how much less of it makes a fault.

use super::hypothesis::Fault;
use super::model::{Bench, Motion, Score};
use super::state::State;

/// Sum of squares that a fault must explain, and its part that goes with the square of the tolerance.
pub(super) const GAIN_OF: [f64; 2] = [15.0, 25.0];
/// Sum of squares that a fault must explain at the usual tolerance: a third of what it takes to count as
/// visible. With a sum of six, a clean set-up was accused.
pub(super) const AT_LEAST: f64 = 10.0;

/// A set-up without a fault.
pub(super) fn without(state: &State, fault: &Fault) -> State {
    let mut other = state.clone();
    fault.repair(&mut other);
    other
}

/// Score without a fault. `motion` is that of the state, which load cells do not change.
pub(super) fn mended(
    bench: &Bench,
    state: &State,
    fault: &Fault,
    tolerance: f64,
    motion: &[Motion],
) -> Option<Score> {
    let other = without(state, fault);
    let cells = |channel: &usize| state.sensors[*channel].kind.is_cell();
    if fault.channels().iter().all(cells) {
        bench.score_moved(&other, tolerance, motion)
    } else {
        bench.score(&other, tolerance)
    }
}
