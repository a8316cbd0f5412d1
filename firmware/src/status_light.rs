//! The status LED: what a person next to the table sees of the box.
//!
//! | LED | box |
//! | --- | --- |
//! | lit | ready |
//! | half a second lit, half a second dark | converters run |
//! | five times a second | converters run, and a sample had a fault in the last two seconds |
//! | one or two blinks every two seconds | the board does not start; not from here |

/// Rounds of a second.
pub const ROUNDS: u32 = 10;
/// Rounds for which a fault is shown.
const SHOWN: u32 = 2 * ROUNDS;

/// State of the LED.
#[derive(Debug, Default)]
pub struct StatusLight {
    round: u32,
    /// Faults so far.
    faults: u32,
    /// Rounds for which the last one is still shown.
    shown: u32,
}

impl StatusLight {
    /// The LED of a box that has just started.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            round: 0,
            faults: 0,
            shown: 0,
        }
    }

    /// `true` if the LED is lit in the next round, in which converters run or do not; `faults` counts those of
    /// samples, and begins anew when the host says so. To be called [`ROUNDS`] times a second.
    #[must_use]
    pub const fn round(&mut self, is_sampling: bool, faults: u32) -> bool {
        self.shown = if faults > self.faults {
            SHOWN
        } else {
            self.shown.saturating_sub(1)
        };
        self.faults = faults;
        self.round = if is_sampling {
            self.round.wrapping_add(1) % ROUNDS
        } else {
            0
        };
        if self.shown > 0 && is_sampling {
            self.round.is_multiple_of(2)
        } else {
            self.round < ROUNDS / 2
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::String;

    /// The LED over rounds with these counts of faults: `#` where it is lit.
    fn seen(light: &mut StatusLight, is_sampling: bool, faults: &[u32]) -> String {
        let round = |faults: &u32| match light.round(is_sampling, *faults) {
            true => '#',
            false => '.',
        };
        faults.iter().map(round).collect()
    }

    #[test]
    fn each_state_has_its_own_rhythm() {
        let mut light = StatusLight::new();
        assert_eq!(seen(&mut light, false, &[0; 5]), "#####");
        assert_eq!(seen(&mut light, true, &[0; 20]), "####.....#####.....#");
        // Two seconds of a fault, and the rhythm goes on where it would be.
        let faulty = seen(&mut light, true, &[7; 30]);
        assert_eq!(faulty, ".#.#.#.#.#.#.#.#.#.#####.....#");
        // Counters were cleared: that is no fault.
        assert!(!seen(&mut light, true, &[0; 10]).contains(".#."));
        assert_eq!(seen(&mut light, false, &[1; 5]), "#####");
    }
}
