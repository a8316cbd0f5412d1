//! Faults that these runs would not show.

use nalgebra::Vector3;

use super::hypothesis::{Fault, Mistake, places};
use super::mend::{GAIN_OF, mended};
use super::model::Bench;
use super::state::State;

/// Faults that would contradict nothing, since the runs do not move what would show them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Untold {
    /// Channels whose sign nothing tells.
    pub(super) signs: Vec<usize>,
    /// Channels of which nothing tells a gain that is twice what it should be.
    pub(super) gains: Vec<usize>,
    /// Channels that nothing tells apart.
    pub(super) pairs: Vec<[usize; 2]>,
    /// Channels at a place, where a position that is off by a fifth of the distance between sensors,
    /// along any axis, shows nowhere.
    pub(super) places: Vec<Vec<usize>>,
}

impl Untold {
    /// Those that would contradict a state by less than a fault has to.
    /// Sensors differ by so much of the usual `tolerance`.
    pub(super) fn of(bench: &Bench, state: &State, tolerance: f64) -> Option<Self> {
        let base = bench.score(state, tolerance)?;
        let motion = bench.motion(state, tolerance)?;
        let least = GAIN_OF[0] + GAIN_OF[1] * tolerance * tolerance;
        let shows = |fault: &Fault| match mended(bench, state, fault, tolerance, &motion) {
            Some(left) => left.chi2 > base.chi2 + least,
            None => true,
        };
        let live = state.live();
        let mut untold = Self::default();
        for (n, &a) in live.iter().enumerate() {
            if !shows(&Fault::Inverted { channel: a }) {
                untold.signs.push(a);
            }
            let twice = Fault::Factor {
                channel: a,
                factor: 2.0,
            };
            if !shows(&twice) {
                untold.gains.push(a);
            }
            for &b in &live[n + 1..] {
                let alike = state.sensors[a].kind.is_cell() == state.sensors[b].kind.is_cell();
                if alike && !shows(&Fault::Swapped { channels: [a, b] }) {
                    untold.pairs.push([a, b]);
                }
            }
        }
        for place in places(&state.sensors, &|i| state.is_live(i)) {
            let moved = |axis: usize| Fault::Position {
                place: place.clone(),
                position: state.sensors[place[0]].position + Vector3::ith(axis, 0.2 * bench.length),
                mistake: Mistake::Offset,
            };
            if !(0..3).any(|axis| shows(&moved(axis))) {
                untold.places.push(place);
            }
        }
        Some(untold)
    }
}
