//! Channels that are coupled to alternating current, brought to one lower limit with the others while a recording is
//! read.
//!
//! # Design
//!
//! A coupling with the corner frequency `c` passes `s / (s + 2π c)`. It is not undone, which would integrate an offset
//! without end, but given to all: a channel behind a coupling with the corner `c` is filtered by
//! `(s + 2π c) / (s + 2π t)`, where `t` is the highest corner of all sensors. That is the channel less `1 - c/t` of its
//! low pass `2π t / (s + 2π t)`.
//!
//! The low pass is the mean of what came before, whose weights fall by `exp(-2π t)` a second. It takes the mean of the
//! signal over each step between two samples, by a sinc in a Kaiser window at three points of Gauss and Legendre, so that
//! it is right up to 0.44 of the sample rate. The trapezoid of two samples would be wrong by 7 % of it at 0.15 of that, which a
//! fit with 0.1 % of noise sees. Samples before the first one and those with faults are left out of the mean. Until their
//! share of its variance has fallen to [`UNKNOWN`] samples are not handed out, or have the faults of those.

use super::around::{Around, Row};
use super::delay::interpolation;
use super::source::Place;
use massline_firmware::wire::Health;
use std::f64::consts::TAU;

/// Highest corner frequency, Hz.
pub(crate) const MOST_CORNER: f64 = 100.0;
/// Share of the low pass's variance that samples which are not known may have: two per cent of its deviation, itself a
/// twentieth of the signal's.
const UNKNOWN: f64 = 4e-4;
/// Samples on both sides of a step that its mean rests on, and the shape of their window: side lobes 81 dB down.
const REACH: i64 = 24;
const SHAPE: f64 = 8.0;
/// Points of Gauss and Legendre in the step before a sample, and their weights.
const POINTS: [[f64; 2]; 3] = [
    [-0.887_298_334_620_741_7, 5.0 / 18.0],
    [-0.5, 8.0 / 18.0],
    [-0.112_701_665_379_258_3, 5.0 / 18.0],
];

/// Corner of the couplings that all channels get, and those that they have.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Corners {
    /// The highest corner of all sensors, Hz.
    pub(crate) highest: f64,
    /// Share of its low pass that is taken off each channel.
    pub(crate) taken: Vec<f64>,
}

/// Samples of a file around the one that is handed out, and the low pass of all before it.
pub(super) struct Coupling {
    taken: Vec<f64>,
    rows: Around,
    /// Weights of these samples in the mean over the step before the one that is handed out.
    weights: Vec<f64>,
    /// Share of the low pass that a sample later is left.
    kept: f64,
    /// Weighted sum of each channel's means, and the sum of their weights.
    sums: Vec<f64>,
    weight: f64,
    /// Share of the low pass's variance that is not known.
    unknown: f64,
    /// Samples that are not handed out until it is known, and those that have come of them.
    settling: usize,
    passed: usize,
    /// Faults of the samples that are left out of it.
    cause: Health,
}

impl Coupling {
    /// Filters at a sample rate, Hz.
    pub(super) fn new(corners: &Corners, rate: f64) -> Self {
        let decay = TAU * corners.highest / rate;
        // Weights fall within the step, too.
        let points = POINTS.map(|[at, weight]| (at, weight * (decay * at).exp()));
        let whole: f64 = points.iter().map(|(_, weight)| weight).sum();
        let (mut first, mut last) = (0, 0);
        let parts = points.map(|(at, weight)| {
            let (begin, of) = interpolation(at, REACH, SHAPE);
            first = first.min(begin);
            last = last.max(begin + of.len() as i64 - 1);
            (begin, of, weight / whole)
        });
        let mut all = vec![0.0; (last - first + 1) as usize];
        for (begin, of, weight) in parts {
            let slots = all.iter_mut().skip((begin - first) as usize);
            slots.zip(of).for_each(|(slot, w)| *slot += weight * w);
        }
        Self {
            taken: corners.taken.clone(),
            rows: Around::new(-first as usize, last as usize),
            weights: all,
            kept: (-decay).exp(),
            sums: vec![0.0; corners.taken.len()],
            weight: 0.0,
            unknown: 1.0,
            settling: (-0.5 * UNKNOWN.ln() / decay).ceil() as usize,
            passed: 0,
            cause: Health::GOOD,
        }
    }

    /// Samples at the beginning and at the end of the file that are not handed out.
    pub(super) fn lost(&self) -> [usize; 2] {
        [self.rows.behind + self.settling, self.rows.ahead]
    }

    /// Takes the next sample of the file. `true` if [`Coupling::sample`] has a new one.
    pub(super) fn push(&mut self, row: Row) -> bool {
        if !self.rows.push(row) {
            return false;
        }
        self.go_on();
        let is_settled = self.is_settled();
        self.passed += usize::from(!is_settled);
        is_settled
    }

    /// `true` if all samples from here on are handed out.
    pub(super) fn is_settled(&self) -> bool {
        self.passed >= self.settling
    }

    /// Takes the step before the sample into the low pass.
    fn go_on(&mut self) {
        let fresh = 1.0 - self.kept;
        self.sums.iter_mut().for_each(|sum| *sum *= self.kept);
        self.weight *= self.kept;
        self.unknown *= self.kept * self.kept;
        let ends = [self.rows.at(-1), self.rows.at(0)];
        let bad = ends.iter().flatten().find(|row| !row.health.is_good());
        if let Some(bad) = bad {
            self.cause = self.cause.union(bad.health);
            self.unknown += 1.0 - self.kept * self.kept;
            return;
        }
        self.weight += fresh;
        let mut add = |row: &Row, weight: f64| {
            for (sum, reading) in self.sums.iter_mut().zip(&row.readings) {
                *sum += weight * reading;
            }
        };
        if self.rows.is_faulty() {
            ends.iter().flatten().for_each(|row| add(row, 0.5 * fresh));
        } else {
            let rows = self.rows.all().zip(&self.weights);
            rows.for_each(|(row, weight)| add(row, fresh * weight));
        }
    }

    /// Readings behind the highest corner, handed to `store`, with place and faults.
    pub(super) fn sample(&mut self, store: &mut dyn FnMut(usize, f64)) -> (Place, Health) {
        let Some(row) = self.rows.at(0) else {
            return (Place::Record(0), Health::GOOD);
        };
        let scale = 1.0 / self.weight.max(f64::MIN_POSITIVE);
        let channels = row.readings.iter().zip(&self.sums).zip(&self.taken);
        for (channel, ((reading, sum), taken)) in channels.enumerate() {
            store(channel, reading - taken * sum * scale);
        }
        if self.unknown <= UNKNOWN {
            self.cause = Health::GOOD;
        }
        (row.place, row.health.union(self.cause))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;

    const RATE: f64 = 512.0;
    /// Corners of the channels, Hz.
    const CORNERS: [f64; 3] = [0.0, 0.2, 0.5];

    fn coupling() -> Coupling {
        let highest = CORNERS[2];
        let taken = CORNERS.map(|c| 1.0 - c / highest).to_vec();
        Coupling::new(&Corners { highest, taken }, RATE)
    }

    /// Frequency in Hz, amplitude and phase of what the channels measure; no coupling passes the first.
    const PARTS: [(f64, f64, f64); 6] = [
        (0.0, 30.0, 0.0),
        (0.3, 1.0, 0.5),
        (2.0, 1.0, 1.0),
        (75.0, 1.0, 2.0),
        (160.0, 1.0, 3.0),
        (220.0, 1.0, 4.0),
    ];

    /// Error of samples that are handed out: those that are not known have at most a weight of √UNKNOWN, which is 2 %,
    /// in a low pass with amplitudes of 0.86 at 0.3 Hz and 0.24 at 2 Hz, and are off by twice these.
    const SETTLED: f64 = 0.02 * 2.0 * (0.86 + 0.24);

    /// The same behind a coupling, by its frequency response.
    fn behind(corner: f64, sample: f64) -> f64 {
        let parts = PARTS.map(|(f, amplitude, phase)| {
            let s = Complex::new(0.0, TAU * f);
            let passed = match corner {
                0.0 => Complex::new(1.0, 0.0),
                _ => s / (s + TAU * corner),
            };
            let turned = Complex::from_polar(amplitude, TAU * f * sample / RATE + phase);
            (passed * turned).re
        });
        parts.iter().sum()
    }

    /// Readings that are handed out, with the number of the sample and its faults.
    fn filtered(samples: u64, faults: std::ops::Range<u64>) -> Vec<(u64, Vec<f64>, Health)> {
        let mut coupling = coupling();
        let mut out = Vec::new();
        for n in 0..samples {
            let is_faulty = faults.contains(&n);
            let row = Row {
                readings: CORNERS
                    .map(|corner| match is_faulty {
                        true => 1e9,
                        false => behind(corner, n as f64),
                    })
                    .to_vec(),
                place: Place::Record(n),
                health: if is_faulty {
                    Health::STUCK
                } else {
                    Health::GOOD
                },
            };
            if coupling.push(row) {
                let mut readings = vec![0.0; CORNERS.len()];
                let (place, health) = coupling.sample(&mut |c, x| readings[c] = x);
                let Place::Record(n) = place else { panic!() };
                out.push((n, readings, health));
            }
        }
        let [begin, end] = coupling.lost();
        assert_eq!(out.len() as u64, samples - (begin + end) as u64);
        assert_eq!(out[0].0, begin as u64);
        out
    }

    /// Largest deviation of a reading from what a channel behind the highest corner reads.
    fn worst(rows: &[(u64, Vec<f64>, Health)]) -> f64 {
        let off = rows.iter().flat_map(|(n, readings, _)| {
            let expected = behind(CORNERS[2], *n as f64);
            readings.iter().map(move |x| (x - expected).abs())
        });
        off.fold(0.0, f64::max)
    }

    #[test]
    fn all_channels_read_what_the_one_with_the_highest_corner_does() {
        let rows = filtered(8000, 0..0);
        assert!(rows.iter().all(|(.., health)| health.is_good()));
        // A channel with the highest corner already is left alone.
        let own = rows
            .iter()
            .map(|(n, x, _)| x[2] - behind(CORNERS[2], *n as f64));
        assert!(own.into_iter().all(|off| off == 0.0));
        assert!(worst(&rows) < SETTLED, "{}", worst(&rows));
        // Later they have none. By the frequency response of the weights, which numpy gives, the parts are wrong by 1.0e-6,
        // 1.9e-6, 0.1e-6, 0.1e-6 and 0.3e-6; with weights that do not fall within a step it would be 14e-6 in all, by the
        // trapezoid of two samples 5e-4 at 75 Hz alone.
        let late = &rows[rows.len() - 2000..];
        let bound = 4e-6;
        assert!(worst(late) < bound, "{} {bound}", worst(late));
    }

    #[test]
    fn faults_end_when_what_they_hide_does_not_matter() {
        let sound = filtered(8000, 0..0);
        for length in [1, 40, 2000] {
            let rows = filtered(8000, 4000..4000 + length);
            let bad: Vec<u64> = rows
                .iter()
                .filter(|r| !r.2.is_good())
                .map(|r| r.0)
                .collect();
            let (first, last) = (bad[0], bad[bad.len() - 1]);
            assert_eq!(first, 4000);
            assert_eq!(
                bad.len() as u64,
                last - first + 1,
                "without an interruption"
            );
            // The share that is not known falls by exp(-4π t) a second. Steps on both sides of a fault are not known.
            let decay = TAU * CORNERS[2] / RATE;
            let hidden = 1.0 - (-2.0 * decay * (length + 1) as f64).exp();
            let wanted = (hidden / UNKNOWN).ln() / (2.0 * decay);
            let after = (last + 1 - (4000 + length)) as f64;
            assert!((after - wanted).abs() < 2.0, "{length}: {after} {wanted}");
            for (row, sound) in rows.iter().zip(&sound).filter(|(row, _)| row.2.is_good()) {
                assert_eq!(row.0, sound.0);
                let off = row.1.iter().zip(&sound.1).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f64::max) < SETTLED, "{length}: {}", row.0);
            }
        }
    }
}
