//! Channels that come late, brought into step with the others while a recording is read.
//!
//! A channel that is `d` samples late has at sample `n + d` the reading of sample `n`. Whole samples are
//! shifted, without any change of a number. The rest of a sample is interpolated by a sinc in a
//! Kaiser window of 97 samples: 1e-5 of the reading at most up to 0.45 of the sample rate, where the
//! lines that are used end.

use super::source::Place;
use massline_firmware::wire::Health;
use std::collections::VecDeque;
use std::f64::consts::PI;

/// Most samples that a channel may be late or early.
pub(crate) const MOST_DELAY: u16 = 4096;
/// Samples on both sides that an interpolated reading rests on.
const REACH: i64 = 48;
/// Shape of the Kaiser window: side lobes 118 dB down.
const SHAPE: f64 = 12.0;

/// A sample of the file.
struct Row {
    readings: Vec<f64>,
    place: Place,
    health: Health,
}

/// A channel that is late: its reading is the sum of `weights` times the readings from `first`
/// samples after the sample on.
struct Late {
    first: i64,
    weights: Vec<f64>,
}

impl Late {
    fn new(delay: f64) -> Self {
        let whole = delay.round();
        let rest = delay - whole;
        let whole = whole as i64;
        if rest == 0.0 {
            return Self {
                first: whole,
                weights: vec![1.0],
            };
        }
        let weight = |k: i64| {
            let x = k as f64 - rest;
            let inside = 1.0 - (x / REACH as f64) * (x / REACH as f64);
            libm::sin(PI * x) / (PI * x) * bessel(SHAPE * inside.max(0.0).sqrt())
        };
        let weights: Vec<f64> = (-REACH..=REACH).map(weight).collect();
        let sum: f64 = weights.iter().sum();
        Self {
            first: whole - REACH,
            weights: weights.iter().map(|w| w / sum).collect(),
        }
    }

    fn last(&self) -> i64 {
        self.first + self.weights.len() as i64 - 1
    }
}

/// The modified Bessel function of the first kind and order zero, by its series.
fn bessel(x: f64) -> f64 {
    let (mut sum, mut term, mut k) = (1.0, 1.0, 1.0);
    while term > 1e-17 * sum {
        term *= (0.5 * x / k) * (0.5 * x / k);
        sum += term;
        k += 1.0;
    }
    sum
}

/// Samples of a file around the one that is handed out.
pub(super) struct Alignment {
    channels: Vec<Late>,
    /// Samples before and after the one that is handed out.
    behind: usize,
    ahead: usize,
    rows: VecDeque<Row>,
    /// Samples in `rows` that have faults.
    faulty: usize,
}

impl Alignment {
    /// `None` where no channel is late.
    pub(super) fn new(delays: &[f64]) -> Option<Self> {
        if delays.iter().all(|delay| *delay == 0.0) {
            return None;
        }
        let channels: Vec<Late> = delays.iter().map(|delay| Late::new(*delay)).collect();
        let reach = |of: &dyn Fn(&Late) -> i64| {
            let furthest = channels.iter().map(of).fold(0, i64::max);
            usize::try_from(furthest).unwrap_or(0)
        };
        Some(Self {
            behind: reach(&|late| -late.first),
            ahead: reach(&Late::last),
            rows: VecDeque::new(),
            faulty: 0,
            channels,
        })
    }

    /// Samples at the beginning and at the end of the file that are not handed out.
    pub(super) fn lost(&self) -> [usize; 2] {
        [self.behind, self.ahead]
    }

    /// Takes the next sample of the file. `true` if [`Alignment::sample`] has a new one.
    pub(super) fn push(&mut self, readings: Vec<f64>, place: Place, health: Health) -> bool {
        let whole = self.behind + self.ahead + 1;
        if self.rows.len() == whole
            && let Some(oldest) = self.rows.pop_front()
        {
            self.faulty -= usize::from(!oldest.health.is_good());
        }
        self.faulty += usize::from(!health.is_good());
        self.rows.push_back(Row {
            readings,
            place,
            health,
        });
        self.rows.len() == whole
    }

    /// Readings in step, handed to `store`, with place and faults: those of every sample that a
    /// reading rests on.
    pub(super) fn sample(&self, store: &mut dyn FnMut(usize, f64)) -> (Place, Health) {
        let at = |offset: i64| {
            let position = usize::try_from(self.behind as i64 + offset).ok()?;
            self.rows.get(position)
        };
        let mut health = at(0).map_or(Health::GOOD, |row| row.health);
        for (channel, late) in self.channels.iter().enumerate() {
            let mut sum = 0.0;
            for (offset, weight) in (late.first..).zip(&late.weights) {
                let Some(row) = at(offset) else { continue };
                sum += weight * row.readings.get(channel).copied().unwrap_or(0.0);
                if self.faulty > 0 {
                    health = health.union(row.health);
                }
            }
            store(channel, sum);
        }
        (at(0).map_or(Place::Record(0), |row| row.place), health)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn aligned(delay: f64, signal: impl Fn(f64) -> f64) -> Vec<[f64; 2]> {
        let mut alignment = Alignment::new(&[0.0, delay]).unwrap();
        let mut out = Vec::new();
        for n in 0..600 {
            let t = f64::from(n);
            let readings = vec![signal(t), signal(t - delay)];
            if alignment.push(readings, Place::Record(n as u64 + 1), Health::GOOD) {
                let mut row = [0.0; 2];
                alignment.sample(&mut |c, x| row[c] = x);
                out.push(row);
            }
        }
        let [begin, end] = alignment.lost();
        assert_eq!(out.len(), 600 - begin - end);
        out
    }

    #[test]
    fn a_late_channel_reads_what_the_others_do() {
        for delay in [1.0, -3.0, 4096.0 - 4000.0, 0.5, -0.5, 2.37, -7.81, 0.01] {
            for frequency in [0.0, 0.003, 0.1, 0.3, 0.45] {
                let signal = |t: f64| libm::cos(2.0 * PI * frequency * t + 0.4);
                let rows = aligned(delay, signal);
                let worst = rows.iter().map(|[a, b]| (a - b).abs()).fold(0.0, f64::max);
                // Whole samples: rounding of the cosine's argument. Others: 118 dB are 1.3e-6; at
                // 0.45 the edge of the band is within the window's transition.
                let bound = match delay.fract() == 0.0 {
                    true => 1e-11,
                    false if frequency < 0.4 => 2e-6,
                    false => 1e-5,
                };
                assert!(worst <= bound, "{delay} {frequency}: {worst}");
            }
        }
    }

    /// Half a sample is a whole one less a half: a reading rests on 47 samples before it and 49
    /// after it.
    #[test]
    fn a_fault_reaches_as_far_as_the_readings_that_rest_on_it() {
        for (delay, reach) in [(2.0, vec![98, 100]), (0.5, (51..=147).collect())] {
            let mut alignment = Alignment::new(&[0.0, delay]).unwrap();
            let mut faulty = Vec::new();
            for n in 0..300_u64 {
                let health = if n == 100 {
                    Health::STUCK
                } else {
                    Health::GOOD
                };
                if alignment.push(vec![0.0, 0.0], Place::Record(n), health) {
                    let (place, health) = alignment.sample(&mut |_, _| ());
                    if let (Place::Record(at), false) = (place, health.is_good()) {
                        faulty.push(at);
                    }
                }
            }
            assert_eq!(faulty, reach, "{delay}");
        }
    }
}
