//! The number of the sample that an edge belongs to.
//!
//! # Design
//!
//! Converters do not number their samples, but edges come a period apart, so that the time from one
//! edge to the next gives the number of samples between them. Samples are thus numbered by the time
//! they were *produced*, read or not.
//!
//! The period is measured from edge to edge, since the box's clock may be off by 1 % without its
//! crystal, and a gap of some hundred samples must still be counted right.
//!
//! When the converters are restarted, the grid of their samples moves by a part of a period. These
//! parts are summed, so that the number of a sample is always within half a period of the time
//! since the first one, after thousands of restarts, too.

/// Fraction bits of times.
const FRACTION: u32 = 16;
/// Longest nominal period, ticks. Sums and products of a few periods stay far below 2^63.
const LONGEST: u64 = 1 << 32;
/// Base-2 logarithm of the time constant of the measured period, samples.
const TIME_CONSTANT: u32 = 8;
/// Inverse of the largest relative deviation of the period from the nominal one: 2 %.
const TOLERANCE: u64 = 50;
/// Inverse of the share of a period by which an edge may be off and still set the grid: more than
/// the 1 % of the box's clock. An edge that is further off came while the box was busy.
const PROMPT: i64 = 64;
/// Late edges in a row after which the next late edge sets the grid.
const LATE_MAX: u8 = 3;

/// The grid of samples in time. Times are in ticks, with [`FRACTION`] fraction bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    /// Limits of the measured period.
    shortest: u64,
    longest: u64,
    /// Measured time from sample to sample.
    period: u64,
    /// Time of the last sample's edge; it may wrap, only differences count.
    last: u64,
    /// Expected time of that edge.
    expected: u64,
    /// Edges in a row that were not prompt.
    late: u8,
    /// Delay of the samples by all restarts, less the whole periods that were counted.
    phase: i64,
    state: State,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// No edge has come yet.
    Idle,
    /// Edges are expected on the grid.
    Running,
    /// The grid has moved; the next edge sets it.
    Moved,
}

/// Place of an edge on the grid.
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
    /// A grid with a nominal period, ticks, not necessarily whole.
    pub(super) fn new(ticks: f32) -> Self {
        // The cast saturates.
        let nominal = (ticks * (1 << FRACTION) as f32) as u64;
        let nominal = nominal.clamp(1 << FRACTION, LONGEST << FRACTION);
        let margin = nominal / TOLERANCE;
        Self {
            shortest: nominal - margin,
            longest: nominal + margin,
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

    /// `true` if that many periods have gone by since the last edge.
    pub(super) fn is_silent(&self, ticks: u64, periods: u64) -> bool {
        self.state == State::Idle
            || self.since(ticks) > self.period.wrapping_mul(periods).cast_signed()
    }

    /// Sets the grid at the next edge, after a restart of the converters.
    pub(super) fn moved(&mut self) {
        if self.state == State::Running {
            self.state = State::Moved;
            // Edges after faults come late; their delays must not add up from restart to restart.
            self.last = self.expected;
        }
    }

    /// Places an edge at a time in ticks.
    ///
    /// Its sums wrap, as times do: `elapsed` is right for gaps below 2^47 ticks, the products are
    /// no longer than it, and periods are below 2^49.
    pub(super) fn edge(&mut self, ticks: u64) -> Place {
        let time = ticks << FRACTION;
        if self.state == State::Idle {
            self.state = State::Running;
            self.last = time;
            self.expected = time;
            return Place::On(0);
        }
        // Negative if the last sample came before its expected time.
        let elapsed = self.since(ticks);
        let period = self.period as i64;
        let rounded = elapsed.wrapping_add(period / 2);
        // The common case is one sample; the chip takes some hundred instructions to divide.
        let samples = if (0..period).contains(&rounded.wrapping_sub(period)) {
            1
        } else {
            rounded.checked_div(period).unwrap_or(0).max(0)
        };
        let off = elapsed.wrapping_sub(samples.wrapping_mul(period));

        if self.state == State::Moved {
            self.state = State::Running;
            self.phase = self.phase.saturating_add(off);
            self.last = time;
            self.expected = time;
            return self.on(samples);
        }
        if samples == 0 {
            return Place::Same;
        }
        self.expected = self.last.wrapping_add_signed(samples.wrapping_mul(period));
        let deviation = off.wrapping_abs();
        if deviation > period / 4 {
            self.last = self.expected;
            return Place::Beside(samples.unsigned_abs());
        }
        if deviation > period / PROMPT && self.late < LATE_MAX {
            self.late += 1;
            self.last = self.expected;
            return self.on(samples);
        }
        self.late = 0;
        self.last = time;
        if samples == 1 {
            // An arithmetic shift cuts off 2^-16 ticks at the most.
            let measured = self.period.wrapping_add_signed(off >> TIME_CONSTANT);
            self.period = measured.max(self.shortest).min(self.longest);
        }
        self.on(samples)
    }

    /// The place so many samples on, one more or less once restarts have added up to it.
    fn on(&mut self, mut samples: i64) -> Place {
        let period = self.period as i64;
        if self.phase > period / 2 {
            self.phase = self.phase.wrapping_sub(period);
            samples = samples.wrapping_add(1);
        } else if self.phase < -(period / 2) && samples > 0 {
            self.phase = self.phase.wrapping_add(period);
            samples = samples.wrapping_sub(1);
        }
        match u64::try_from(samples) {
            Ok(0) | Err(_) => Place::Same,
            Ok(samples) => Place::On(samples),
        }
    }

    /// Time since the last sample's edge.
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
            // Jitter of 20 ticks shifts one period by as much, the mean of 256 by about 20/16.
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
            // Half a period, and four times the rounding to whole ticks: the difference of two
            // rounded times, 0.41 ticks RMS, adds up over 5000 restarts like a random walk to 29
            // ticks, 0.015 periods.
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
