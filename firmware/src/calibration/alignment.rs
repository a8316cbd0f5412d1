//! Inputs whose converters have other filters than the others', brought into step with them.
//!
//! # Design
//!
//! The filters of two kinds of converters differ in delay and magnitude: between an ADXL355 and an ADS131M08
//! by up to two milliseconds and some percent, of which each goes into the mass where one
//! measures forces and the other accelerations. Readings of the *prompt* inputs, which are those of the
//! first kind, are delayed by whole samples. Readings of the *late* ones are filtered by [`TAPS`] taps that
//! have the ratio of both magnitudes and what is left of the phase: the inverse transform of that response in
//! a Kaiser window. The window blurs the response, so that what is missing is asked for on top, some rounds
//! long. It is then right to 1e-4 of the amplitude up to 0.3 of the sample rate, and to 4e-4 up to 0.39, where
//! the lines that are kept end.

use crate::drivers::Lowpass;
use core::f64::consts::{PI, TAU};

/// Taps of the filter of late inputs.
pub const TAPS: usize = 2 * REACH + 1;
/// Most late inputs.
pub const LATE: usize = 3;

/// Samples on both sides of the one that an output stands for.
const REACH: usize = 12;
/// Most whole samples that a late input is behind or ahead of the others.
const SHIFT: usize = 2;
/// Most samples by which prompt inputs are delayed.
const DEPTH: usize = REACH + SHIFT;
/// Shape of the Kaiser window: side lobes 90 dB down.
const SHAPE: f64 = 9.0;
/// Frequencies at which the response is asked for.
const FREQUENCIES: usize = 64;
/// Half steps between frequencies, once around.
const POINTS: usize = 4 * FREQUENCIES;
/// Highest frequency that is used, in sample rates.
const USED: f64 = 0.4;
/// Rounds in which the response within what is used approaches the one that is asked for.
const ROUNDS: usize = 10;

/// Alignment of up to `PLACES` inputs.
#[derive(Clone, Debug)]
pub struct Alignment<const PLACES: usize> {
    /// Filters of the late inputs and of the prompt ones, and their taps, that of the oldest reading first.
    filters: Option<[Lowpass; 2]>,
    taps: [f32; TAPS],
    /// Late inputs.
    late: heapless::Vec<Late, LATE>,
    /// Last readings of all inputs, each of which is overwritten by that `delay` samples later.
    rows: [[f32; PLACES]; DEPTH],
    delay: usize,
    /// Place of the next reading in `rows`.
    next: usize,
    /// Samples since the last gap, up to [`TAPS`].
    samples: usize,
}

/// A late input: its place, and its last readings, the newest last.
#[derive(Clone, Copy, Debug)]
struct Late {
    place: usize,
    readings: [f32; TAPS],
}

impl<const PLACES: usize> Alignment<PLACES> {
    /// All inputs in step.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            filters: None,
            taps: [0.0; TAPS],
            late: heapless::Vec::new(),
            rows: [[0.0; PLACES]; DEPTH],
            delay: 0,
            next: 0,
            samples: 0,
        }
    }

    /// Takes all inputs to be in step.
    pub fn clear(&mut self) {
        self.filters = None;
        self.late.clear();
        self.delay = 0;
        self.restart();
    }

    /// Takes the input at this place as late: it has these filters, where the prompt inputs have those. Sample
    /// rate in Hz. `false`, and nothing is changed, if it has no room, is out of reach, or if its filters are
    /// those of neither kind.
    #[must_use]
    pub fn add(&mut self, place: usize, own: Lowpass, prompt: Lowpass, rate: f64) -> bool {
        let both = [own, prompt];
        if place >= PLACES || self.late.is_full() || self.filters.is_some_and(|known| known != both)
        {
            return false;
        }
        if self.filters.is_none() {
            let shift = (own.delay - prompt.delay) * rate;
            let whole = libm::round(shift);
            let is_near = libm::fabs(whole) <= SHIFT as f64;
            if !is_near {
                return false;
            }
            // Between 10 and 14.
            self.delay = (REACH as f64 + whole) as usize;
            self.taps = taps(&own, &prompt, self.delay as f64 - shift, self.delay, rate);
            self.filters = Some(both);
        }
        let late = Late {
            place,
            readings: [0.0; TAPS],
        };
        self.late.push(late).is_ok()
    }

    /// Samples before an aligned one that its readings rest on, and samples by which it is late.
    #[must_use]
    pub const fn reach(&self) -> [usize; 2] {
        match self.filters {
            Some(_) => [TAPS - 1, self.delay],
            None => [0, 0],
        }
    }

    /// Begins anew behind a gap.
    pub const fn restart(&mut self) {
        self.samples = 0;
        self.next = 0;
    }

    /// Takes the readings of the next sample, the first `used` of which and the last one are in use, and puts
    /// aligned ones into their places. `false` while there have been too few since the last gap.
    #[inline]
    #[must_use]
    pub fn align(&mut self, readings: &mut [f32; PLACES], used: usize) -> bool {
        self.filters.is_none() || self.exchange(readings, used)
    }

    #[inline(never)] // Most runs have no late input.
    fn exchange(&mut self, readings: &mut [f32; PLACES], used: usize) -> bool {
        let mut aligned = [0.0; LATE];
        for (late, sum) in self.late.iter_mut().zip(&mut aligned) {
            late.readings.copy_within(1.., 0);
            let newest = readings.get(late.place).copied().unwrap_or(0.0);
            let [.., last] = &mut late.readings;
            *last = newest;
            for (tap, reading) in self.taps.iter().zip(&late.readings) {
                *sum += tap * reading;
            }
        }
        if let Some(row) = self.rows.get_mut(self.next) {
            let pairs = readings.iter_mut().zip(row);
            for (place, (reading, old)) in pairs.enumerate() {
                if place < used || place.wrapping_add(1) == PLACES {
                    core::mem::swap(reading, old);
                }
            }
        }
        for (late, sum) in self.late.iter().zip(aligned) {
            if let Some(reading) = readings.get_mut(late.place) {
                *reading = sum;
            }
        }
        let next = self.next.saturating_add(1);
        self.next = if next < self.delay { next } else { 0 };
        self.samples = self.samples.saturating_add(1).min(TAPS);
        self.samples == TAPS
    }
}

impl<const PLACES: usize> Default for Alignment<PLACES> {
    fn default() -> Self {
        Self::new()
    }
}

/// Taps that turn the response of `own` into that of `prompt`, delayed by so many samples; their window is
/// centred on `centre` samples. That of the oldest reading comes first.
#[inline(never)] // Not on the stack of what else its caller does.
fn taps(own: &Lowpass, prompt: &Lowpass, centre: f64, delay: usize, rate: f64) -> [f32; TAPS] {
    let circle = Circle::new();
    let omega = |n: usize| PI * (n as f64 + 0.5) / FREQUENCIES as f64;
    let window = |k: usize| {
        let x = (k as f64 - centre) / (REACH as f64 + 1.0);
        bessel(SHAPE * libm::sqrt((1.0 - x * x).max(0.0))) / bessel(SHAPE)
    };
    let windows: [f64; TAPS] = core::array::from_fn(window);
    let wanted: [[f64; 2]; FREQUENCIES] = core::array::from_fn(|n| {
        let frequency = omega(n) / TAU * rate;
        let magnitude = prompt.magnitude(frequency) / own.magnitude(frequency);
        let lag = prompt.lag(frequency) - own.lag(frequency) + omega(n) * delay as f64;
        let (sin, cos) = libm::sincos(lag);
        [magnitude * cos, -magnitude * sin]
    });
    let mut response = wanted;
    let mut taps = [0.0; TAPS];
    for _ in 0..ROUNDS {
        for (k, (tap, window)) in taps.iter_mut().zip(&windows).enumerate() {
            let mut sum = 0.0;
            for (n, [re, im]) in response.iter().enumerate() {
                let [cos, sin] = circle.at(n, k);
                sum += re * cos - im * sin;
            }
            *tap = window * sum / FREQUENCIES as f64;
        }
        // What the window took away is asked for on top.
        for (n, (asked, wanted)) in response.iter_mut().zip(&wanted).enumerate() {
            if omega(n) > TAU * USED {
                break;
            }
            let mut found = [0.0; 2];
            for (k, tap) in taps.iter().enumerate() {
                let [cos, sin] = circle.at(n, k);
                found[0] += tap * cos;
                found[1] -= tap * sin;
            }
            asked[0] += wanted[0] - found[0];
            asked[1] += wanted[1] - found[1];
        }
    }
    let mut oldest_first = [0.0; TAPS];
    for (tap, found) in oldest_first.iter_mut().rev().zip(taps) {
        *tap = found as f32;
    }
    oldest_first
}

/// Cosines of the multiples of half a step between frequencies, once around.
struct Circle([f64; POINTS]);

impl Circle {
    fn new() -> Self {
        let step = TAU / POINTS as f64;
        Self(core::array::from_fn(|k| libm::cos(step * k as f64)))
    }

    /// Cosine and sine of the phase of frequency number `n` after `k` samples.
    fn at(&self, n: usize, k: usize) -> [f64; 2] {
        let Self(circle) = self;
        let turned = n.wrapping_mul(2).wrapping_add(1).wrapping_mul(k);
        let quarter = turned.wrapping_add(3 * FREQUENCIES);
        [turned, quarter].map(|at| circle.get(at % POINTS).copied().unwrap_or(0.0))
    }
}

/// The modified Bessel function of the first kind and order zero, for the window: x up to 9.
fn bessel(x: f64) -> f64 {
    let quarter = 0.25 * x * x;
    let (mut sum, mut term) = (1.0, 1.0);
    for k in 1..40 {
        let k = f64::from(k);
        term *= quarter / (k * k);
        sum += term;
    }
    sum
}
