//! A small set-up that tells all ten numbers: six accelerometers on the interface, six load cells at
//! the same places, and a drive.

use crate::wire::{
    Accelerations, ChannelRole, Excitation, Gaps, Method, Mount, Pass, Plan, Procedure, Processing,
    Quantity, Question, Run, ScaleSource, Sensor, SensorKind, Source, Start, Weighting, Window,
};
use massline_core::identify;

/// Sensors: accelerometers, then load cells.
pub const SENSORS: u8 = 12;
/// Channels of a sample: sensors, then the drive.
pub const CHANNELS: usize = SENSORS as usize + 1;
/// The channels of every run.
pub const ROLES: [u8; CHANNELS] = {
    let mut roles = [ChannelRole::Drive.code(); CHANNELS];
    let mut sensor = 0;
    while sensor < SENSORS {
        roles[sensor as usize] = sensor;
        sensor += 1;
    }
    roles
};
/// Places, in units of a reach, and directions: three, two and one, which determine six motions and
/// six resultants.
const PLACES: [([f64; 2], [f64; 3]); 6] = [
    ([1.0, 1.0], [1.0, 0.0, 0.0]),
    ([1.0, 1.0], [0.0, 1.0, 0.0]),
    ([1.0, 1.0], [0.0, 0.0, 1.0]),
    ([-1.0, 1.0], [0.0, 1.0, 0.0]),
    ([-1.0, 1.0], [0.0, 0.0, 1.0]),
    ([1.0, -1.0], [0.0, 0.0, 1.0]),
];
/// Processing at 512 samples/s, in lines half a hertz apart.
pub const PROCESSING: Processing = Processing {
    sample_rate: 512.0,
    block_length: 1024,
    overlap: 0.5,
    window: Window::Hann,
    kept_band: [0.5, 40.0],
    averaging_band: [1.0, 15.0],
    mode_band: None,
    accelerations: Accelerations::Interface,
    weighting: Weighting::Given,
    minimum_weight: 0.1,
};

/// The plan of so many runs, about the origin.
#[must_use]
pub const fn plan(runs: u8, fingerprint: u32) -> Plan {
    Plan {
        sensors: SENSORS,
        runs,
        reference_point: [0.0; 3],
        fingerprint,
    }
}

/// The sensors, at most `reach` m from either axis, with a sensitivity in SI per unit.
pub fn sensors(reach: f64, per_unit: f64) -> impl Iterator<Item = Sensor<'static>> {
    let kinds = [
        SensorKind::Accelerometer(Mount::Interface),
        SensorKind::LoadCell(Quantity::Force),
    ];
    let places = kinds
        .into_iter()
        .flat_map(|kind| PLACES.map(|place| (kind, place)));
    (0..)
        .zip(places)
        .map(move |(sensor, (kind, ([x, y], direction)))| Sensor {
            sensor,
            name: "",
            kind,
            position: [x * reach, y * reach, 0.0],
            direction,
            scale: ScaleSource::Given {
                per_unit,
                offset: 0.0,
            },
        })
}

/// A run of random excitation.
#[must_use]
pub const fn run(run: u8) -> Run<'static> {
    Run {
        run,
        name: "",
        excitation: Excitation::Random,
        rotation: [0.0; 3],
        translation: [0.0; 3],
        channels: &ROLES,
    }
}

/// The start of a run that measures.
#[must_use]
pub const fn start(run: u8, source: Source, gaps: Gaps, limit: Option<u64>) -> Start {
    Start {
        run,
        pass: Pass::Measure,
        source,
        gaps,
        limit,
    }
}

/// A question about all stored runs, of which no mass is known.
#[must_use]
pub const fn question(method: Method, procedure: Procedure, modes: u8) -> Question {
    Question {
        method,
        identify: identify::Question::new(None, procedure),
        modes,
        fit_band: None,
        runs: 0,
    }
}
