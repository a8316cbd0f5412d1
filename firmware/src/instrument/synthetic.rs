//! A body that the box computes: known to the last digit, shaken, and read by whatever
//! sensors the set-up has. A test of everything but the sensors.
//!
//! # Design
//!
//! The body is rigid but for a mass on a spring. The table moves along and about one axis,
//! by noise that repeats every [`PERIOD`] samples: blocks of that length without a window
//! see the same lines each time, and no leakage.
//!
//! Noise and spring are integers, so that every machine computes the same. The swing w, the
//! acceleration of the sprung mass against the table, follows the table's acceleration s by
//!
//! ```text
//! w(n+1) = a₁ w(n) - a₂ w(n-1) + Σ c_k d(n+k),   d(n) = s(n+1) - 2 s(n) + s(n-1),   k = -2 … 2
//! ```
//!
//! whose poles are those of a mode in continuous time, e^((-ζ ± j√(1-ζ²)) ω₀T), and whose c_k are
//! the least-squares fit of its amplification D = ω² / (ω₀² - ω² + 2jζω₀ω). The difference is below
//! a millionth of D up to a tenth of the sample rate, and two ten-thousandths at a fifth of it.
//! At rest and towards ω = 0 the mass is carried along, so the rigid body is exact.

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

/// a₁ and a₂ of θ = ω₀T = 2π 40/512 and ζ = 0.03, in units of 2⁻²⁰: 2 e^(-ζθ) cos(√(1-ζ²) θ) and
/// e^(-2ζθ).
const NOW: Wrapping<i64> = Wrapping(1_822_701);
const BEFORE: Wrapping<i64> = Wrapping(1_018_143);
/// c₋₂ to c₂ in units of 2⁻²⁰, fitted to D from 1/1024 to 100/1024 of the sample rate.
const DRIVEN: [Wrapping<i64>; TAPS] = [
    Wrapping(-114),
    Wrapping(184),
    Wrapping(-1_009_828),
    Wrapping(-3_333),
    Wrapping(388),
];
const TAPS: usize = 5;
/// Samples that the swing lies behind the acceleration it is computed from.
const AHEAD: u32 = 2;
const COEFFICIENT_BITS: usize = 20;
/// Fractional bits of the swing.
const SWING_BITS: usize = 16;
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
/// Its numbers never wrap: the magnitudes of its impulse response add up to 22.3, so that the swing
/// stays below 2⁵ times the drive's 2³⁰, and products with its coefficients below 2⁵⁶.
#[derive(Clone, Copy, Debug, Default)]
struct Spring {
    swing: Wrapping<i64>,
    before: Wrapping<i64>,
    /// The newest accelerations, the oldest first.
    accelerations: [Wrapping<i64>; TAPS + 2],
}

impl Spring {
    /// Takes the acceleration `s`; returns that of the swing [`AHEAD`] samples before, both in units
    /// of the noise, the latter with fractional bits.
    fn step(&mut self, s: i64) -> i64 {
        self.accelerations.rotate_left(1);
        if let Some(newest) = self.accelerations.last_mut() {
            *newest = Wrapping(s);
        }
        let mut sum = NOW * self.swing - BEFORE * self.before;
        for (around, tap) in self.accelerations.windows(3).zip(DRIVEN) {
            if let [before, at, after] = around {
                sum += tap * ((after - Wrapping(2) * at + before) << SWING_BITS);
            }
        }
        let half = Wrapping(1 << (COEFFICIENT_BITS - 1));
        self.before = self.swing;
        self.swing = (sum + half) >> COEFFICIENT_BITS;
        self.swing.0
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
        for n in 0..3 * PERIOD + AHEAD {
            source.spring.step(noise(n % PERIOD));
        }
        source
    }

    /// The next sample in SI, channel by channel.
    pub(super) fn sample(&mut self, into: &mut [f32; CHANNELS]) -> usize {
        let s = noise(self.n);
        let swing = self.spring.step(noise(self.n.wrapping_add(AHEAD) % PERIOD));
        self.n = self.n.wrapping_add(1) % PERIOD;
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
    use nalgebra::Complex;

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

    fn real(x: Wrapping<i64>) -> f64 {
        x.0 as f64 / f64::from(1 << COEFFICIENT_BITS)
    }

    /// Frequency in radians a sample and damping ratio of the mode whose poles these are.
    fn mode() -> [f64; 2] {
        let (now, before) = (real(NOW), real(BEFORE));
        let decay = -0.5 * libm::log(before);
        let damped = libm::acos(0.5 * now / libm::sqrt(before));
        let own = libm::hypot(decay, damped);
        [own, decay / own]
    }

    fn amplification(theta: f64) -> Complex<f64> {
        let [own, damping] = mode();
        let square = Complex::from(theta * theta);
        square / Complex::new(own * own - theta * theta, 2.0 * damping * own * theta)
    }

    #[test]
    fn the_spring_is_a_mode_in_continuous_time() {
        // Poles in steps of 2⁻²⁰: of ζθ = 0.0147 that is 3e-5 at the most.
        let [own, damping] = mode();
        let wanted = 2.0 * core::f64::consts::PI * 40.0 / 512.0;
        assert!((own / wanted - 1.0).abs() < 1e-6, "{own}");
        assert!((damping / 0.03 - 1.0).abs() < 3e-5, "{damping}");
        for line in 1..=204 {
            let theta = 2.0 * core::f64::consts::PI * f64::from(line) / f64::from(PERIOD);
            let (sin, cos) = libm::sincos(theta);
            let turn = Complex::new(cos, sin);
            let mut found = Complex::from(0.0);
            for (k, tap) in (-2..).zip(DRIVEN) {
                found += turn.powi(k) * real(tap);
            }
            found *= turn - 2.0 + turn.conj();
            found /= turn - real(NOW) + turn.conj() * real(BEFORE);
            let off = (found / amplification(theta) - 1.0).l1_norm();
            // Real and imaginary part together. Where the taps are fitted, they are rounded by half a
            // unit of 2⁻²⁰ each; beyond it, the module says two ten-thousandths.
            let bound = if line > 100 { 3e-4 } else { 2.5e-6 };
            assert!(off < bound, "line {line}: {off}");
        }
    }

    #[test]
    fn the_spring_steps_as_its_response_says() {
        // A slow sine: at 5 Hz the swing follows by 0.0159.
        let mut spring = Spring::default();
        let theta = 2.0 * core::f64::consts::PI / 102.4;
        // Forty periods, once the beginning has died away, against a turning pointer: what
        // rounding the drive shakes up near resonance falls out.
        let (mut swung, mut driven) = (Complex::from(0.0), Complex::from(0.0));
        let mut drives = [0; AHEAD as usize + 1];
        for n in 0..8192 {
            let (sin, cos) = libm::sincos(theta * f64::from(n));
            drives.rotate_left(1);
            drives[AHEAD as usize] = (16000.0 * cos) as i64;
            let swing = spring.step(drives[AHEAD as usize]);
            if n >= 4096 {
                // Both are of the sample that lies `AHEAD` behind.
                let back = Complex::new(cos, -sin);
                swung += back * (swing as f64 / f64::from(1 << SWING_BITS));
                driven += back * drives[0] as f64;
            }
        }
        // Rounding of the drive is one of 16000.
        let off = (swung / driven / amplification(theta) - 1.0).l1_norm();
        assert!(off < 1e-4, "{off}");
    }
}
