//! A body of 100 kg with two sprung masses on a shaken table: samples with noise, equal in their bits
//! on every machine.
//!
//! The drive repeats, so that the sprung masses follow it as modes in continuous time do, line by line.

#[path = "../../../core/tests/golden/noise.rs"]
mod noise;
use noise::Noise;

use nalgebra::{Complex, Vector6};

/// Channels of a sample: the twelve sensors of the plan at a reach of 0.2 m, two accelerometers on the
/// structure, and the drive.
pub const CHANNELS: usize = 15;
/// Distance of the sensors from either axis, m.
pub const REACH: f64 = 0.2;
/// Time after which the drive repeats, s.
const PERIOD: f64 = 2.0;
/// Highest frequency of the drive, in sample rates.
const HIGHEST: f64 = 0.45;
/// Standard deviation of the drive, m/s².
const DRIVE: f64 = 0.6;
/// Rotation about an axis that is shaken, rad/s² for each m/s² of the drive.
const TURN: f64 = 3.0;
/// Noise of each sensor in its unit, uniform between plus and minus this.
const NOISE: f64 = 0.01;

/// A sprung mass: its effective mass in kg, frequency in Hz, damping ratio, and the share of each of the
/// table's motions that drives it.
struct Sprung(f64, f64, f64, [f64; 6]);

const SPRUNG: [Sprung; 2] = [
    Sprung(5.0, 33.0, 0.025, [1.0, 0.0, 0.0, 0.0, 0.9, 0.0]),
    Sprung(3.0, 45.0, 0.02, [0.0, 1.0, 0.0, -0.6, 0.0, 0.15]),
];

/// Lines of the drive, one each `1 / PERIOD` from that frequency on.
type Lines = [Complex<f64>];

/// One period, at this sample rate, of the sum of these lines, each times its own response.
fn period(rate: f64, lines: &Lines, response: impl Fn(f64) -> Complex<f64>) -> Vec<f64> {
    let count = (PERIOD * rate) as usize;
    let turn = |k: usize| core::f64::consts::TAU * k as f64;
    let lines: Vec<_> = (1..)
        .zip(lines)
        .map(|(k, line)| (k, line * response(turn(k) / PERIOD)))
        .collect();
    let at = |n: usize| {
        let rotated = lines.iter().map(|(k, line)| {
            let (sin, cos) = libm::sincos(turn(k * n % count) / count as f64);
            line.re * cos - line.im * sin
        });
        rotated.sum()
    };
    (0..count).map(at).collect()
}

/// So many samples of a run at a rate in 1/s: the table mostly moves along or about one of its axes, the body
/// answers, each sprung mass with its mass times one of `masses`, and every sensor has noise of its own.
pub fn samples(run: usize, rate: f64, count: usize, masses: [f64; 2]) -> Vec<[f32; CHANNELS]> {
    let mut noise = Noise(run as u32 + 1);
    let number = (HIGHEST * rate * PERIOD) as usize;
    let amplitude = DRIVE * libm::sqrt(2.0 / number as f64);
    let lines: Vec<_> = (0..number)
        .map(|_| {
            let (sin, cos) = libm::sincos(core::f64::consts::PI * noise.next());
            Complex::new(amplitude * cos, amplitude * sin)
        })
        .collect();
    let drive = period(rate, &lines, |_| Complex::new(1.0, 0.0));
    // Acceleration of each mass against the table, for a drive of its own.
    let swings = SPRUNG.map(|Sprung(_, frequency, damping, _)| {
        let own = core::f64::consts::TAU * frequency;
        period(rate, &lines, |w| {
            Complex::from(w * w) / Complex::new(own * own - w * w, 2.0 * damping * own * w)
        })
    });
    let share = |axis: usize| match axis == run {
        true => {
            if axis < 3 {
                1.0
            } else {
                TURN
            }
        }
        false => 0.05 * (axis as f64 + 1.0) - 0.02 * run as f64,
    };
    let motion = Vector6::from_fn(|axis, _| share(axis));
    let one = |n: usize| {
        let n = n % drive.len();
        let a = motion * drive[n];
        // Of the rigid body, its centre of gravity half a metre up.
        let mut force = Vector6::new(
            100.0 * (a[0] + 0.5 * a[4]),
            100.0 * (a[1] - 0.5 * a[3]),
            100.0 * a[2],
            60.0 * a[3] - 50.0 * a[1],
            70.0 * a[4] + 50.0 * a[0],
            20.0 * a[5],
        );
        let mut swung = [0.0; 2];
        for (((Sprung(mass, _, _, shares), swing), of), swung) in
            SPRUNG.iter().zip(&swings).zip(masses).zip(&mut swung)
        {
            let shares = Vector6::from(*shares);
            *swung = of * shares.dot(&motion) * swing[n];
            force += shares * (mass * *swung);
        }
        // As the plan's sensors are placed: three at (0.2, 0.2, 0), and so on.
        let at = |[x, y]: [f64; 2], k: usize| match k {
            0 => a[0] - a[5] * y,
            1 => a[1] + a[5] * x,
            _ => a[2] + a[3] * y - a[4] * x,
        };
        let accelerations = [
            ([REACH, REACH], 0),
            ([REACH, REACH], 1),
            ([REACH, REACH], 2),
            ([-REACH, REACH], 1),
            ([-REACH, REACH], 2),
            ([REACH, -REACH], 2),
        ]
        .map(|(place, k)| at(place, k));
        let structure = [
            a[0] + 0.6 * a[4] + 0.4 * swung[0],
            a[1] - 0.6 * a[3] + 0.3 * swung[1],
        ];
        let clean = accelerations
            .into_iter()
            .chain(cells(&force))
            .chain(structure);
        let mut sample = [drive[n] as f32; CHANNELS];
        for (noisy, clean) in sample.iter_mut().zip(clean) {
            *noisy = (clean + NOISE * noise.next()) as f32;
        }
        sample
    };
    (0..count).map(one).collect()
}

/// Readings of the load cells, placed as the accelerometers are, for forces and moments about A.
fn cells(f: &Vector6<f64>) -> [f64; 6] {
    // Cells 1 and 3 along y, 2, 4 and 5 along z at (±0.2, ±0.2): moments fix their shares.
    let y = (f[5] + REACH * (f[0] + f[1])) / (2.0 * REACH);
    let third = (REACH * f[2] - f[3]) / (2.0 * REACH);
    let second = (REACH * f[2] + f[4]) / (2.0 * REACH);
    [f[0], y, f[2] - second - third, f[1] - y, second, third]
}
