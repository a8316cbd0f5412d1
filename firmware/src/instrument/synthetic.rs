//! A body that the box computes: known to the last digit, shaken, and read by whatever
//! sensors the set-up has. A test of everything but the sensors.
//!
//! # Design
//!
//! The body is rigid but for a mass on a spring. The table moves along and about one axis,
//! by noise that repeats every [`PERIOD`] samples: blocks of that length without a window
//! see the same lines each time, and no leakage.
//!
//! Noise and spring are integers, so that every machine computes the same. The spring's
//! equation of motion is stepped by central differences,
//!
//! ```text
//! y(n+1) (1 + ζθ) = (2 - θ²) y(n) - (1 - ζθ) y(n-1) - s(n),   θ = ω₀ T
//! ```
//!
//! which is not an approximation here but the definition: a mode that has the frequency
//! response `D = ω̃² / (ω₀² - ω̃² + 2jζω₀ sin(ωT)/T)` with `ω̃ = 2/T sin(ωT/2)`. At rest and
//! towards ω = 0 the mass is carried along, so the rigid body is exact. The self-test's bound
//! is the effect of the difference between ω̃ and ω on the fit of a continuous mode.

use super::setup::Arrangement;
use crate::capacity::CHANNELS;
use crate::wire::ChannelRole;
use core::num::Wrapping;
use massline_core::geometry::{LoadShares, Mount, RunSensor};
use massline_core::rigid_body::{Inertia, RigidBody};
use nalgebra::{RowVector6, Vector3, Vector6};

/// Samples after which the noise repeats.
pub(super) const PERIOD: u32 = 1024;

/// Mass on the spring, kg.
pub(super) const SPRUNG: f64 = 1.5;
/// Place of the mass on the spring, m.
pub(super) const PLACE: Vector3<f64> = Vector3::new(0.05, 0.02, 0.35);
/// Direction in which it swings, a unit vector.
const SWING: Vector3<f64> = Vector3::new(0.6, 0.64, 0.48);
/// Share of the swing that an accelerometer on the structure sees.
const SHARE: f64 = 0.5;
/// Rotation, rad/s² for each m/s² along the same axis.
const TURN: f64 = 3.0;

/// θ = 2π 40/512 and ζ = 0.03 in units of 2⁻²⁰: 1/(1+ζθ), (2-θ²)/(1+ζθ), (1-ζθ)/(1+ζθ).
const ONE_OVER: Wrapping<i64> = Wrapping(1_033_359);
const NOW: Wrapping<i64> = Wrapping(1_817_722);
const BEFORE: Wrapping<i64> = Wrapping(1_018_141);
const COEFFICIENT_BITS: usize = 20;
/// Fractional bits of the swing.
const SWING_BITS: u32 = 16;
/// Noise that stands for 1 m/s².
const UNIT: f32 = 16384.0;

/// The body, with the mass on its spring where it rests.
pub(super) fn body() -> RigidBody {
    RigidBody {
        mass: 12.0,
        centre_of_gravity: Vector3::new(0.04, -0.03, 0.22),
        inertia: Inertia::from_terms([0.34, 0.39, 0.27, 0.02, -0.03, 0.015]),
    }
}

/// Noise at sample `n` of the period: uniform, ±2¹⁴.
fn noise(n: u32) -> i64 {
    // Two rounds of multiply and fold mix every bit of the number into the upper ones.
    let mut x = n.wrapping_add(1).wrapping_mul(0x9E37_79B1);
    x ^= x >> 15;
    x = x.wrapping_mul(0x85EB_CA77);
    x ^= x >> 13;
    x = x.wrapping_mul(0xC2B2_AE3D);
    i64::from(x >> 17) - (1 << 14)
}

/// The mass on its spring, driven by the noise.
///
/// Its numbers never wrap: the magnitudes of its impulse response add up to 92, so that it
/// stays below 2⁷ times the drive's 2³⁰, and products with its coefficients below 2⁵⁸.
#[derive(Clone, Copy, Debug, Default)]
struct Spring {
    y: Wrapping<i64>,
    before: Wrapping<i64>,
}

impl Spring {
    /// Takes one step under the acceleration `s`; returns that of the swing, both in units
    /// of the noise, the latter with fractional bits.
    fn step(&mut self, s: i64) -> i64 {
        let drive = Wrapping(s << SWING_BITS);
        let half = Wrapping(1 << (COEFFICIENT_BITS - 1));
        let sum = NOW * self.y - BEFORE * self.before - ONE_OVER * drive;
        let next = (sum + half) >> COEFFICIENT_BITS;
        let swing = next - Wrapping(2) * self.y + self.before;
        self.before = self.y;
        self.y = next;
        swing.0
    }
}

/// The source of one run's samples.
#[derive(Debug)]
pub(super) struct Synthetic {
    /// Gains of each channel: of the table's motion, and of the swing.
    gains: heapless::Vec<[f32; 2], CHANNELS>,
    spring: Spring,
    n: u32,
}

impl Synthetic {
    /// The source of run `run` of an arrangement.
    pub(super) fn new(arrangement: &Arrangement, run: usize) -> Self {
        let reference = arrangement.reference();
        let placement = arrangement.placement(run);
        let motion = motion(run);
        let swing_row = row(&PLACE, &SWING, &reference);
        let swing = (swing_row * motion)[0];
        let force = body().mass_matrix(&reference) * motion;
        let elastic = swing_row.transpose() * (SPRUNG * swing);
        let cells =
            (0..arrangement.sensors()).filter_map(|sensor| match arrangement.sensor(sensor) {
                Some(RunSensor::LoadCell(cell)) => Some(placement.load_cell(&cell)),
                _ => None,
            });
        let shares = LoadShares::new(cells, &reference);
        let gain = |code: &u8| match ChannelRole::from_code(*code) {
            ChannelRole::Drive => [1.0, 0.0],
            ChannelRole::Unused => [0.0, 0.0],
            ChannelRole::Sensor(sensor) => match arrangement.sensor(usize::from(sensor)) {
                Some(RunSensor::Accelerometer(a, _)) => {
                    let a = placement.accelerometer(&a);
                    let rigid = (a.rigid_body_row(&reference) * motion)[0];
                    let elastic = match a.mount {
                        Mount::Interface => 0.0,
                        Mount::Structure => SHARE * swing * a.direction().dot(&SWING),
                    };
                    [rigid as f32, elastic as f32]
                }
                Some(RunSensor::LoadCell(cell)) => {
                    let cell = placement.load_cell(&cell);
                    [&force, &elastic].map(|f| shares.load(&cell, f) as f32)
                }
                None => [0.0, 0.0],
            },
        };
        let mut source = Self {
            gains: arrangement.channels(run).iter().map(gain).collect(),
            spring: Spring::default(),
            n: 0,
        };
        // The swing's beginning dies away by ζθ = 0.0147 a sample: three periods leave e⁻⁴⁵.
        for n in 0..3 * PERIOD {
            source.spring.step(noise(n % PERIOD));
        }
        source
    }

    /// The next sample in SI, channel by channel.
    pub(super) fn sample(&mut self, into: &mut [f32; CHANNELS]) -> usize {
        let s = noise(self.n);
        self.n = self.n.wrapping_add(1) % PERIOD;
        let swing = self.spring.step(s);
        let s = s as f32 / UNIT;
        let swing = swing as f32 / (UNIT * (1 << SWING_BITS) as f32);
        for (slot, [of_table, of_swing]) in into.iter_mut().zip(&self.gains) {
            *slot = of_table * s + of_swing * swing;
        }
        self.gains.len()
    }
}

/// The table's motion in a run: along one axis and about it, both ways round in turn.
fn motion(run: usize) -> Vector6<f64> {
    let axis = run % 3;
    let turn = if run % 6 < 3 { TURN } else { -TURN };
    let mut motion = Vector6::zeros();
    motion[axis] = 1.0;
    motion[3 + axis] = turn;
    motion
}

fn row(
    place: &Vector3<f64>,
    direction: &Vector3<f64>,
    reference: &Vector3<f64>,
) -> RowVector6<f64> {
    let d = direction / direction.norm();
    let moment = (place - reference).cross(&d);
    RowVector6::new(d.x, d.y, d.z, moment.x, moment.y, moment.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_repeats_and_has_power_on_every_line() {
        let n = PERIOD as usize;
        let samples: [f64; PERIOD as usize] = core::array::from_fn(|k| noise(k as u32) as f64);
        let mean = samples.iter().sum::<f64>() / n as f64;
        // Uniform over 2¹⁵: standard deviation 9459, of the mean a 32nd of it; four of them.
        assert!(mean.abs() < 4.0 * 9459.0 / 32.0, "{mean}");
        for line in 1..100 {
            let (mut re, mut im) = (0.0, 0.0);
            for (k, x) in samples.iter().enumerate() {
                let phase = 2.0 * core::f64::consts::PI * (k * line % n) as f64 / n as f64;
                re += x * libm::cos(phase);
                im += x * libm::sin(phase);
            }
            let power = (re * re + im * im) / (n as f64 * 9459.0 * 9459.0);
            // Exponential of mean one: below 1e-4 on one of a hundred lines once in a
            // hundred generators.
            assert!(power > 1e-4, "line {line}: {power}");
        }
    }

    #[test]
    fn the_spring_has_the_response_it_is_meant_to_have() {
        // A slow sine: the swing follows by D = ω̃² / (ω₀² - ω̃²), 0.0170 at 5 Hz.
        let mut spring = Spring::default();
        let theta = 2.0 * core::f64::consts::PI / 102.4;
        // Forty periods, once the beginning has died away, against a turning pointer: what
        // rounding the drive shakes up near resonance falls out.
        let (mut swung, mut driven) = ([0.0; 2], [0.0; 2]);
        for n in 0..8192 {
            let (cos, sin) = (
                libm::cos(theta * f64::from(n)),
                libm::sin(theta * f64::from(n)),
            );
            let s = (16000.0 * cos) as i64;
            let swing = spring.step(s) as f64 / f64::from(1 << SWING_BITS);
            if n >= 4096 {
                for (sum, x) in [(&mut swung, swing), (&mut driven, s as f64)] {
                    sum[0] += x * cos;
                    sum[1] += x * sin;
                }
            }
        }
        let [swung, driven] = [swung, driven].map(|[re, im]| libm::hypot(re, im));
        let warped = 4.0 * libm::sin(theta / 2.0) * libm::sin(theta / 2.0);
        let own = libm::pow(2.0 * core::f64::consts::PI * 40.0 / 512.0, 2.0);
        let damped = 2.0 * 0.03 * libm::sqrt(own) * libm::sin(theta);
        let expected = warped / libm::hypot(own - warped, damped);
        // Rounding of the drive is one of 16000.
        let found = swung / driven;
        assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
    }
}
