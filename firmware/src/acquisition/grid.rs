//! Which sample an edge belongs to.
//!
//! # Design
//!
//! Converters do not number their samples. Their clock does: edges come a period apart, so that
//! the time from one edge to the next tells how many samples lie between them. Samples are thus
//! numbered by when they were *produced*, whether anybody was in time to read them or not.
//!
//! The period is measured from edge to edge, since the box's clock may be off by a percent
//! (without its crystal) and a gap of some hundred samples must still be counted right.
//!
//! When the converters are restarted, the grid of their samples moves by a part of a period.
//! That part is added up, so that thousands of restarts do not add up to wrong numbers: the
//! number of a sample is always within half a period of the time since the first one.

/// Fraction bits of times.
const FRACTION: u32 = 16;
/// The measured period follows the edges with this power of two of samples as its time constant.
const FOLLOW: u32 = 8;
/// Largest deviation of the period from the nominal one, as its inverse: 2 %.
const OFF: u64 = 50;
/// Share of a period, as its inverse, by which an edge may be off and still say where the grid
/// is. One that is further off came while the box was busy. More than the box's clock may be off
/// by, 1 %.
const PROMPT: i64 = 64;
/// Edges in a row that are further off and then do say where the grid is.
const INSIST: u8 = 3;

/// The grid of samples in time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    /// Ends of what the period may be.
    shortest: u64,
    longest: u64,
    /// Measured time from sample to sample.
    period: u64,
    /// Time of the last sample's edge; it may wrap, only differences count.
    last: u64,
    /// When that edge was expected.
    expected: u64,
    /// Edges in a row that were not prompt.
    late: u8,
    /// By how much later samples come now than they would have without restarts.
    phase: i64,
    state: State,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// No edge has come yet.
    Idle,
    /// Edges are expected on the grid.
    Running,
    /// The grid has moved; the next edge shows where to.
    Moved,
}

/// Where an edge falls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// On the grid, that many samples after the last one.
    On(u64),
    /// Beside the grid; the nearest sample is that many after the last one.
    Beside(u64),
    /// Much less than a period after the last sample: the same one again.
    Same,
}

impl Grid {
    /// A grid with a period of ticks, which need not be whole.
    pub(super) fn new(ticks: f32) -> Self {
        // The cast saturates; a period of no length would divide by zero.
        let nominal = ((ticks * (1 << FRACTION) as f32) as u64).max(1 << FRACTION);
        let margin = nominal / OFF;
        Self {
            shortest: nominal - margin,
            longest: nominal.saturating_add(margin),
            period: nominal,
            last: 0,
            expected: 0,
            late: 0,
            phase: 0,
            state: State::Idle,
        }
    }

    /// Ticks from sample to sample, as measured.
    pub(super) fn period(&self) -> f32 {
        self.period as f32 / (1 << FRACTION) as f32
    }

    /// Whether that many periods have gone by since the last edge.
    pub(super) fn is_silent(&self, ticks: u64, periods: u64) -> bool {
        self.state == State::Idle || self.since(ticks) > (self.period * periods).cast_signed()
    }

    /// The converters were restarted: wherever the next edge falls, the grid is there.
    pub(super) fn moved(&mut self) {
        if self.state == State::Running {
            self.state = State::Moved;
            // Restarts follow faults, and edges that follow faults come late: that must not add
            // up from restart to restart.
            self.last = self.expected;
        }
    }

    /// Takes an edge.
    pub(super) fn edge(&mut self, ticks: u64) -> Place {
        let time = ticks << FRACTION;
        if self.state == State::Idle {
            self.state = State::Running;
            self.last = time;
            self.expected = time;
            return Place::On(0);
        }
        // Negative where the last sample was expected but came early.
        let elapsed = self.since(ticks);
        let period = self.period as i64;
        let rounded = elapsed + period / 2;
        // Nearly always the next one; the chip takes some hundred instructions to divide.
        let samples = if (0..period).contains(&(rounded - period)) {
            1
        } else {
            (rounded / period).max(0)
        };
        let off = elapsed - samples * period;

        if self.state == State::Moved {
            self.state = State::Running;
            self.phase += off;
            self.last = time;
            self.expected = time;
            return self.on(samples);
        }
        if samples == 0 {
            return Place::Same;
        }
        self.expected = self.last.wrapping_add_signed(samples * period);
        if off.abs() > period / 4 {
            self.last = self.expected;
            return Place::Beside(samples.unsigned_abs());
        }
        if off.abs() > period / PROMPT && self.late < INSIST {
            self.late += 1;
            self.last = self.expected;
            return self.on(samples);
        }
        self.late = 0;
        self.last = time;
        if samples == 1 {
            // An arithmetic shift: what it cuts off is 2^-16 ticks at the most.
            let followed = self.period.saturating_add_signed(off >> FOLLOW);
            self.period = followed.max(self.shortest).min(self.longest);
        }
        self.on(samples)
    }

    /// That many samples on, and one more or less where restarts have added up to it.
    fn on(&mut self, mut samples: i64) -> Place {
        let period = self.period as i64;
        if self.phase > period / 2 {
            self.phase -= period;
            samples += 1;
        } else if self.phase < -(period / 2) && samples > 0 {
            self.phase += period;
            samples -= 1;
        }
        match u64::try_from(samples) {
            Ok(0) | Err(_) => Place::Same,
            Ok(samples) => Place::On(samples),
        }
    }

    fn since(&self, ticks: u64) -> i64 {
        (ticks << FRACTION).wrapping_sub(self.last).cast_signed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::random::Random;

    /// Ticks of 1 MHz at 512 samples/s.
    const PERIOD: f64 = 1e6 / 512.0;

    #[test]
    fn gaps_are_counted_by_a_clock_that_is_off() {
        for off in [-0.01, 0.0, 0.01] {
            let period = PERIOD * (1.0 + off);
            let mut random = Random::new(7);
            let mut grid = Grid::new(PERIOD as f32);
            let mut sample = 0_u64;
            assert_eq!(grid.edge(1000), Place::On(0));
            for k in 0..20_000 {
                // Long gaps only once the period has been measured.
                let longest = if k < 2000 { 3 } else { 500 };
                let step = 1 + if random.chance(0.01) {
                    random.below(longest)
                } else {
                    0
                };
                sample += step;
                let jitter = random.below(20);
                let ticks = 1000 + (sample as f64 * period) as u64 + jitter;
                assert_eq!(
                    grid.edge(ticks),
                    Place::On(step),
                    "sample {sample}, off by {off}"
                );
            }
            // Jitter of 20 ticks shifts neighbours by that, the mean of 256 by 20/16 or so.
            assert!((f64::from(grid.period()) / period - 1.0).abs() < 2e-3);
        }
    }

    #[test]
    fn restarts_do_not_add_up() {
        let mut random = Random::new(3);
        let mut grid = Grid::new(PERIOD as f32);
        let mut time = 0.0;
        let mut number = 0;
        for k in 0..50_000 {
            match grid.edge(time as u64) {
                Place::On(samples) => number += samples,
                Place::Same => {}
                Place::Beside(_) => panic!("edge {k}"),
            }
            // Within half a period, and what whole ticks leave: the difference of two rounded
            // times, 0.41 ticks RMS, adds up over 5000 restarts like a random walk to 29 ticks,
            // 0.015 periods. Four times that.
            let exact = time / PERIOD;
            assert!((number as f64 - exact).abs() < 0.56, "{number} {exact}");
            if random.chance(0.1) {
                grid.moved();
                time += PERIOD * (0.2 + random.below(1000) as f64 / 1000.0);
            } else {
                time += PERIOD;
            }
        }
    }

    #[test]
    fn an_edge_beside_the_grid_leaves_it_where_it_is() {
        let mut grid = Grid::new(100.0);
        assert_eq!(grid.edge(0), Place::On(0));
        assert_eq!(grid.edge(100), Place::On(1));
        assert_eq!(grid.edge(240), Place::Beside(1));
        assert_eq!(grid.edge(300), Place::On(1));
        assert_eq!(grid.edge(310), Place::Same);
        assert_eq!(grid.edge(400), Place::On(1));
    }

    #[test]
    fn time_may_begin_anywhere_and_wrap() {
        let mut grid = Grid::new(100.0);
        let start = (u64::MAX >> FRACTION) - 250;
        assert_eq!(grid.edge(start), Place::On(0));
        for k in 1..10 {
            assert_eq!(grid.edge(start + 100 * k), Place::On(1));
        }
    }
}
