//! A body of 100 kg with two sprung masses on a shaken table: samples with noise, equal in their bits
//! on every machine.

#[path = "../../../core/tests/golden/shaking.rs"]
mod shaking;
use shaking::{Noise, Sprung};

/// Channels of a sample: the twelve sensors of the plan at a reach of 0.2 m, two accelerometers on the
/// structure, and the drive.
pub const CHANNELS: usize = 15;
/// Distance of the sensors from either axis, m.
pub const REACH: f64 = 0.2;

/// So many samples of a run: the table mostly moves along or about one of its axes, the body answers, each
/// sprung mass with this share of its motion, and every sensor has noise of its own.
pub fn samples(run: usize, count: usize, shares: [f64; 2]) -> Vec<[f32; CHANNELS]> {
    let mut noise = Noise(run as u32 + 1);
    // Near 33 and 45 Hz at 512 samples a second.
    let (mut bending, mut other) = (Sprung::default(), Sprung::default());
    let share = |axis: usize| match axis == run {
        true => 1.0,
        false => 0.05 * (axis as f64 + 1.0) - 0.02 * run as f64,
    };
    let mut all = Vec::new();
    for _ in 0..count {
        let drive = noise.next();
        let a: [f64; 6] = core::array::from_fn(|axis| share(axis) * drive);
        let (u, v) = (
            shares[0] * bending.follow(1.821, 0.02 * (a[0] + a[4])),
            shares[1] * other.follow(1.687, 0.03 * (a[1] - 0.5 * a[3] + 0.2 * a[5])),
        );
        // Of the rigid body, its centre of gravity half a metre up, and of the sprung masses.
        let force = [
            100.0 * (a[0] + 0.5 * a[4]) + 40.0 * u,
            100.0 * (a[1] - 0.5 * a[3]) + 30.0 * v,
            100.0 * a[2],
            60.0 * a[3] - 50.0 * a[1] - 20.0 * v,
            70.0 * a[4] + 50.0 * a[0] + 35.0 * u,
            20.0 * a[5] + 4.0 * v,
        ];
        // As the plan's sensors are placed: three at (0.2, 0.2, 0), and so on.
        let at = |p: [f64; 3], of: [f64; 6], k: usize| match k {
            0 => of[0] - of[5] * p[1],
            1 => of[1] + of[5] * p[0],
            _ => of[2] + of[3] * p[1] - of[4] * p[0],
        };
        let places = [
            ([REACH, REACH, 0.0], 0),
            ([REACH, REACH, 0.0], 1),
            ([REACH, REACH, 0.0], 2),
            ([-REACH, REACH, 0.0], 1),
            ([-REACH, REACH, 0.0], 2),
            ([REACH, -REACH, 0.0], 2),
        ];
        let mut sample = [0.0; CHANNELS];
        for (x, (p, k)) in sample.iter_mut().zip(places) {
            *x = at(p, a, k);
        }
        for (x, f) in sample.iter_mut().skip(6).zip(cells(force)) {
            *x = f;
        }
        sample[12] = a[0] + 0.6 * a[4] + 3.0 * u;
        sample[13] = a[1] - 0.6 * a[3] + 2.0 * v;
        let mut noisy = sample.map(|x| (x + 0.01 * noise.next()) as f32);
        noisy[14] = drive as f32;
        all.push(noisy);
    }
    all
}

/// Readings of the load cells, placed as the accelerometers are, for forces and moments about A.
fn cells(f: [f64; 6]) -> [f64; 6] {
    // Cells 1 and 3 along y, 2, 4 and 5 along z at (±0.2, ±0.2): moments fix their shares.
    let along_x = f[0];
    let y = [(f[5] + 0.2 * along_x + 0.2 * f[1]) / 0.4, 0.0];
    let y = [y[0], f[1] - y[0]];
    let third = (0.2 * f[2] - f[3]) / 0.4;
    let second = (0.2 * f[2] + f[4]) / 0.4;
    let first = f[2] - second - third;
    [along_x, y[0], first, y[1], second, third]
}
