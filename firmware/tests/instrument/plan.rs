//! A test with six accelerometers on the interface, six load cells and a drive.

use crate::bench::{Bench, Said};
use massline_firmware::models::setup;
pub use massline_firmware::models::setup::CHANNELS;
use massline_firmware::wire::*;

/// Sensors, and with them channels: the drive comes last.
pub const SENSORS: usize = setup::SENSORS as usize;

/// Pieces of the set-up.
pub struct Pieces {
    pub plan: Plan,
    pub processing: Processing,
    pub sensors: Vec<Sensor<'static>>,
    pub channels: Vec<u8>,
}

impl Pieces {
    pub fn new() -> Self {
        Self {
            plan: setup::plan(3, 99),
            processing: Processing {
                mode_band: Some([28.0, 40.0]),
                ..setup::PROCESSING
            },
            sensors: setup::sensors(0.2, 0.1).collect(),
            channels: setup::ROLES.to_vec(),
        }
    }

    pub fn run(&self, run: u8) -> Run<'_> {
        Run {
            channels: &self.channels,
            ..setup::run(run)
        }
    }

    /// Sends all of them but the end.
    pub fn send(&self, bench: &mut Bench) {
        bench.done(&Request::BeginSetup(self.plan));
        bench.done(&Request::SetProcessing(self.processing));
        for sensor in &self.sensors {
            bench.done(&Request::SetSensor(*sensor));
        }
        for run in 0..self.plan.runs {
            bench.done(&Request::SetRun(self.run(run)));
        }
    }
}

/// A box that has just been set up.
pub fn ready() -> Bench {
    let mut bench = Bench::switch_on();
    set_up(&mut bench);
    bench
}

/// Sets the box up.
pub fn set_up(bench: &mut Bench) {
    Pieces::new().send(bench);
    let said = bench.ask(&Request::EndSetup);
    assert!(matches!(said, Said::Grid(_)), "{said:?}");
}

/// Shares of the channels, all different.
const SHARES: [i32; CHANNELS] = [7, 3, 5, 11, 2, 13, 17, 6, 9, 4, 19, 8, 10];

/// A sample as counts: noise, of which every channel has another share.
pub fn counts(n: u64) -> [i32; CHANNELS] {
    let mut x = (n as u32).wrapping_add(1).wrapping_mul(0x9E37_79B1);
    x ^= x >> 15;
    x = x.wrapping_mul(0x85EB_CA77);
    x ^= x >> 13;
    let noise = (x >> 16) as i32 - (1 << 15);
    SHARES.map(|share| noise * share)
}

/// Sends samples `first` to `end` as one request each.
pub fn feed(bench: &mut Bench, first: u64, end: u64) -> Said {
    let mut last = Said::Done;
    for n in first..end {
        last = bench.ask(&Request::Samples(Samples {
            first: n,
            channels: CHANNELS as u8,
            values: Values::Counts(Packed::new(&counts(n))),
        }));
    }
    last
}

/// Holds two runs of the same shares against each other. What is averaged differs, so only
/// rounding may: a few of f32's 6e-8 of the largest response, with room for cancellation.
pub fn assert_same_shares(one: &[Line], other: &[Line]) {
    assert_eq!(one.len(), other.len());
    for (one, other) in one.iter().zip(other) {
        let sizes = one.responses.map(|r| r[0].hypot(r[1]));
        let largest = sizes.iter().fold(0.0_f32, |a, b| a.max(*b));
        for (a, b) in one.responses.iter().zip(other.responses) {
            let off = (a[0] - b[0]).hypot(a[1] - b[1]);
            assert!(off < 1e-5 * largest, "{a:?} {b:?} of {largest}");
        }
    }
}
