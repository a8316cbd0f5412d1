//! A test with six accelerometers on the interface, six load cells and a drive.

use crate::bench::{Bench, Said};
use massline_core::identify;
use massline_firmware::wire::*;

/// Sensors, and with them channels: the drive comes last.
pub const SENSORS: usize = 12;
/// Channels of a sample.
pub const CHANNELS: usize = SENSORS + 1;

/// Pieces of the set-up.
pub struct Pieces {
    pub plan: Plan,
    pub processing: Processing,
    pub sensors: Vec<Sensor<'static>>,
    pub channels: Vec<u8>,
}

impl Pieces {
    pub fn new() -> Self {
        let places = [
            ([0.2, 0.2, 0.0], [1.0, 0.0, 0.0]),
            ([0.2, 0.2, 0.0], [0.0, 1.0, 0.0]),
            ([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]),
            ([-0.2, 0.2, 0.0], [0.0, 1.0, 0.0]),
            ([-0.2, 0.2, 0.0], [0.0, 0.0, 1.0]),
            ([0.2, -0.2, 0.0], [0.0, 0.0, 1.0]),
        ];
        let kinds = [
            SensorKind::Accelerometer(Mount::Interface),
            SensorKind::LoadCell(Quantity::Force),
        ];
        let sensors = kinds
            .iter()
            .flat_map(|kind| places.map(|place| (*kind, place)));
        let sensors = sensors
            .zip(0..)
            .map(|((kind, (position, direction)), sensor)| Sensor {
                sensor,
                name: "s",
                kind,
                position,
                direction,
                scale: ScaleSource::Given {
                    per_unit: 0.1,
                    offset: 0.0,
                },
            });
        Self {
            plan: Plan {
                sensors: SENSORS as u8,
                runs: 3,
                reference_point: [0.0; 3],
                fingerprint: 99,
            },
            processing: Processing {
                sample_rate: 512.0,
                block_length: 1024,
                overlap: 0.5,
                window: Window::Hann,
                kept_band: [0.5, 40.0],
                averaging_band: [1.0, 15.0],
                mode_band: Some([28.0, 40.0]),
                accelerations: Accelerations::Interface,
                weighting: Weighting::Given,
                minimum_weight: 0.1,
            },
            sensors: sensors.collect(),
            channels: (0..SENSORS as u8)
                .chain([ChannelRole::Drive.code()])
                .collect(),
        }
    }

    pub fn run(&self, run: u8) -> Run<'_> {
        Run {
            run,
            name: "r",
            excitation: Excitation::Random,
            rotation: [0.0; 3],
            translation: [0.0; 3],
            channels: &self.channels,
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

/// A question about all stored runs, with this number of modes.
pub fn question(method: Method, modes: u8) -> Question {
    Question {
        method,
        identify: identify::Question::default(),
        modes,
        fit_band: None,
        runs: 0,
    }
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
