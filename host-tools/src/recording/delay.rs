//! Channels that come late, brought into step with the others while a recording is read.
//!
//! A channel that is `d` samples late has at sample `n + d` the reading of sample `n`. Whole samples are
//! shifted, without any change of a number. The rest of a sample is interpolated by a sinc in a
//! Kaiser window of 97 samples: 1e-5 of the reading at most up to 0.45 of the sample rate, where the
//! lines that are used end.

use super::around::{Around, Row};
use super::source::Place;
use massline_firmware::wire::Health;
use std::f64::consts::PI;
use std::ops::Range;

/// Most samples that a channel may be late or early.
pub(crate) const MOST_DELAY: u16 = 4096;
/// Samples on both sides that an interpolated reading rests on.
const REACH: i64 = 48;
/// Shape of the Kaiser window: side lobes 118 dB down.
const SHAPE: f64 = 12.0;

/// Channels beside each other whose readings rest on the same samples: sums of `weights` times the readings from `first`
/// samples after the sample on.
struct Late {
    channels: Range<usize>,
    first: i64,
    /// Sample by sample, the weight of each channel.
    weights: Vec<Vec<f64>>,
}

impl Late {
    /// All channels, by the samples that they rest on.
    fn groups(delays: &[f64]) -> Vec<Self> {
        let mut groups: Vec<Self> = Vec::new();
        for (channel, delay) in delays.iter().enumerate() {
            let (first, weights) = interpolation(*delay, REACH, SHAPE);
            match groups.last_mut() {
                Some(last) if (last.first, last.weights.len()) == (first, weights.len()) => {
                    last.channels.end += 1;
                    let all = last.weights.iter_mut().zip(weights);
                    all.for_each(|(own, weight)| own.push(weight));
                }
                _ => groups.push(Self {
                    channels: channel..channel + 1,
                    first,
                    weights: weights.into_iter().map(|weight| vec![weight]).collect(),
                }),
            }
        }
        groups
    }

    fn last(&self) -> i64 {
        self.first + self.weights.len() as i64 - 1
    }
}

/// The reading of a channel so many samples later: the first of the samples that it rests on, and the weights of all of
/// them. A sample between others rests on `reach` of them on both sides of the nearest one, in a Kaiser window of this
/// shape.
pub(super) fn interpolation(later: f64, reach: i64, shape: f64) -> (i64, Vec<f64>) {
    let whole = later.round();
    let rest = later - whole;
    let whole = whole as i64;
    if rest == 0.0 {
        return (whole, vec![1.0]);
    }
    let weight = |k: i64| {
        let x = k as f64 - rest;
        let inside = 1.0 - (x / reach as f64) * (x / reach as f64);
        libm::sin(PI * x) / (PI * x) * bessel(shape * inside.max(0.0).sqrt())
    };
    let weights: Vec<f64> = (-reach..=reach).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    (whole - reach, weights.iter().map(|w| w / sum).collect())
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
    late: Vec<Late>,
    rows: Around,
    /// Readings in step of each channel.
    sums: Vec<f64>,
}

impl Alignment {
    /// `None` where no channel is late.
    pub(super) fn new(delays: &[f64]) -> Option<Self> {
        if delays.iter().all(|delay| *delay == 0.0) {
            return None;
        }
        let late = Late::groups(delays);
        let reach = |of: &dyn Fn(&Late) -> i64| {
            let furthest = late.iter().map(of).fold(0, i64::max);
            usize::try_from(furthest).unwrap_or(0)
        };
        Some(Self {
            rows: Around::new(reach(&|late| -late.first), reach(&Late::last)),
            late,
            sums: vec![0.0; delays.len()],
        })
    }

    /// Samples at the beginning and at the end of the file that are not handed out.
    pub(super) fn lost(&self) -> [usize; 2] {
        [self.rows.behind, self.rows.ahead]
    }

    /// Takes the next sample of the file. `true` if [`Alignment::sample`] has a new one.
    pub(super) fn push(&mut self, row: Row) -> bool {
        self.rows.push(row)
    }

    /// Readings in step, handed to `store`, with place and faults: those of every sample that a
    /// reading rests on.
    pub(super) fn sample(&mut self, store: &mut dyn FnMut(usize, f64)) -> (Place, Health) {
        let own = self.rows.at(0);
        let mut health = own.map_or(Health::GOOD, |row| row.health);
        self.sums.fill(0.0);
        for late in &self.late {
            let sums = self.sums.get_mut(late.channels.clone()).unwrap_or_default();
            for (offset, weights) in (late.first..).zip(&late.weights) {
                let Some(row) = self.rows.at(offset) else {
                    continue;
                };
                let readings = row.readings.get(late.channels.clone()).unwrap_or_default();
                for ((sum, reading), weight) in sums.iter_mut().zip(readings).zip(weights) {
                    *sum += weight * reading;
                }
                if self.rows.is_faulty() {
                    health = health.union(row.health);
                }
            }
        }
        for (channel, sum) in self.sums.iter().enumerate() {
            store(channel, *sum);
        }
        (own.map_or(Place::Record(0), |row| row.place), health)
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
            if alignment.push(Row {
                readings: vec![signal(t), signal(t - delay)],
                place: Place::Record(n as u64 + 1),
                health: Health::GOOD,
            }) {
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
                if alignment.push(Row {
                    readings: vec![0.0, 0.0],
                    place: Place::Record(n),
                    health,
                }) {
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
