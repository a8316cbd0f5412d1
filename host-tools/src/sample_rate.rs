//! The true sample rate, against this computer's clock.
//!
//! # Design
//!
//! Converters sample by a crystal of their own. Each message with samples tells how far they
//! have come, and arrives a little later than that: by what link and system take, never
//! earlier, and by another amount each time. A straight line through arrivals over sample
//! numbers has the true rate as its slope; a delay that is always there does not change it.
//!
//! The uncertainty is that of the slope from the scatter about the line. Delays that come in
//! spells, when the computer is busy, say less than they are many: the scatter counts as that
//! of a first-order autoregression with the correlation of neighbours.
//!
//! The rate is as true as the clock of this computer, a few parts in a million where it is
//! disciplined by network time.

use crate::recording::TrueRate;

/// Points kept; when there are more, every other one is dropped.
const POINTS: usize = 2048;
/// Points from which on a scatter is one.
const FEWEST: usize = 16;

/// Collects arrivals, in memory that does not grow.
#[derive(Clone, Debug)]
pub struct SampleRate {
    /// Samples and seconds, since the first arrival.
    points: Vec<[f64; 2]>,
    origin: Option<(u64, f64)>,
    /// Arrivals from one kept point to the next.
    stride: u32,
    waiting: u32,
}

impl Default for SampleRate {
    fn default() -> Self {
        Self {
            points: Vec::with_capacity(POINTS),
            origin: None,
            stride: 1,
            waiting: 0,
        }
    }
}

impl SampleRate {
    /// Takes note that the sample of this number had been taken at that time, s, by any
    /// clock that runs evenly.
    pub fn arrival(&mut self, number: u64, seconds: f64) {
        if self.waiting > 0 {
            self.waiting -= 1;
            return;
        }
        self.waiting = self.stride - 1;
        let (first, start) = *self.origin.get_or_insert((number, seconds));
        let samples = number as f64 - first as f64;
        self.points.push([samples, seconds - start]);
        if self.points.len() == POINTS {
            let mut keep = false;
            self.points.retain(|_| {
                keep = !keep;
                keep
            });
            // The last one was dropped, the next one is kept.
            self.waiting = self.stride - 1;
            self.stride *= 2;
        }
    }

    /// The rate and its uncertainty, Hz, by the clock of this name; `None` before there are
    /// enough arrivals.
    #[must_use]
    pub fn estimate(&self, clock: &str) -> Option<TrueRate> {
        let count = self.points.len();
        if count < FEWEST {
            return None;
        }
        let mean = |i: usize| self.points.iter().map(|p| p[i]).sum::<f64>() / count as f64;
        let (samples, seconds) = (mean(0), mean(1));
        let (mut spread, mut product) = (0.0, 0.0);
        for [n, t] in &self.points {
            spread += (n - samples) * (n - samples);
            product += (n - samples) * (t - seconds);
        }
        let slope = product / spread;
        let residual = |p: &[f64; 2]| p[1] - seconds - slope * (p[0] - samples);
        let (mut power, mut neighbours) = (0.0, 0.0);
        let mut last = 0.0;
        for point in &self.points {
            let r = residual(point);
            power += r * r;
            neighbours += r * last;
            last = r;
        }
        // Two numbers were fitted.
        let variance = power / (count - 2) as f64;
        let correlation = if power > 0.0 {
            (neighbours / power).clamp(0.0, 0.99)
        } else {
            0.0
        };
        let inflation = (1.0 + correlation) / (1.0 - correlation);
        let of_slope = (variance * inflation / spread).sqrt();
        let value = 1.0 / slope;
        let uncertainty = value * of_slope / slope;
        // Arrivals of a box that does not count on have no slope.
        let known = value.is_finite() && value > 0.0 && uncertainty.is_finite();
        known.then(|| TrueRate {
            value,
            uncertainty,
            clock: clock.to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::Stream;

    const RATE: f64 = 511.987;

    /// Arrivals over `seconds`, ten a second, each late by 0.2 ms and a random part with a
    /// memory of `memory` arrivals.
    fn arrivals(seed: u64, seconds: f64, memory: f64) -> SampleRate {
        let mut stream = Stream::new(seed, &["delay"]);
        let mut rate = SampleRate::default();
        let keep = if memory > 0.0 {
            (-1.0 / memory).exp()
        } else {
            0.0
        };
        let mut delay: f64 = 0.0;
        for k in 0..(10.0 * seconds) as u64 {
            let number = 51 * k;
            delay = keep * delay + (1.0 - keep * keep).sqrt() * stream.signed();
            rate.arrival(number, 5e4 + number as f64 / RATE + 2e-4 + 1e-3 * delay);
        }
        rate
    }

    /// Of 400 estimates, the share within two standard uncertainties is 0.954 for scatter
    /// without memory; 0.92 is three standard deviations of a share of 400 below that. With
    /// memory the correlation is itself estimated, from some 60 independent delays: 0.85.
    #[test]
    fn the_truth_lies_within_the_uncertainty() {
        for (memory, least) in [(0.0, 0.92), (5.0, 0.85)] {
            let hits = (0..400).filter(|&seed| {
                let found = arrivals(seed, 60.0, memory).estimate("host").unwrap();
                (found.value - RATE).abs() < 2.0 * found.uncertainty
            });
            let share = hits.count() as f64 / 400.0;
            assert!(share > least, "memory {memory}: {share}");
        }
    }

    /// Uniform delays of ±1 ms have 0.58 ms RMS; over 60 s and 600 arrivals the slope is
    /// known to 0.58 ms sqrt(12 / 600) / 60 s = 1.4 parts in a million.
    #[test]
    fn a_minute_gives_parts_in_a_million() {
        let found = arrivals(1, 60.0, 0.0).estimate("host").unwrap();
        let relative = found.uncertainty / found.value;
        assert!((1.0e-6..1.9e-6).contains(&relative), "{relative:e}");
    }

    #[test]
    fn hours_take_no_more_memory_and_tell_more() {
        let day = arrivals(2, 86_400.0, 0.0);
        assert!(day.points.len() < POINTS && day.points.capacity() == POINTS);
        let found = day.estimate("host").unwrap();
        assert!((found.value - RATE).abs() < 4.0 * found.uncertainty);
        assert!(found.uncertainty < 1e-8 * RATE);
    }

    #[test]
    fn few_arrivals_tell_nothing() {
        assert_eq!(arrivals(3, 1.5, 0.0).estimate("host"), None);
    }
}
