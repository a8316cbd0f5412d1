//! A box without hardware: the instrument on the host, fed with a set-up's recordings.

// Each test program uses a part of this.
#![allow(dead_code)]

use massline::measure::WINDOW;
use massline::recording::Recording;
use massline::setup::Setup;
use massline::simulate::{Model, Options, Simulation, simulate};
use massline_firmware::calibration::Certificate;
use massline_firmware::wire::*;

#[path = "../../../firmware/tests/instrument/bench.rs"]
pub mod bench;

use bench::{Bench, Said};

/// The box on a test bench, with the host's side of a test.
pub struct StandIn {
    pub bench: Bench,
    is_wired: bool,
    /// Source of the weights of the next set-up.
    pub weighting: Weighting,
}

impl StandIn {
    /// A box with converters whose inputs have these calibrations; without any, without converters.
    pub fn new(inputs: &[Certificate]) -> Self {
        Self {
            bench: Bench::with_inputs(inputs),
            is_wired: !inputs.is_empty(),
            weighting: Weighting::Given,
        }
    }

    /// Sends a request, polls the box, and returns the one reply.
    pub fn ask(&mut self, request: &Request<'_>) -> Said {
        self.bench.await_reply(request)
    }

    /// Sends a request whose reply must be "done".
    pub fn done(&mut self, request: &Request<'_>) {
        assert_eq!(self.ask(request), Said::Done, "{request:?}");
    }

    /// Sends a set-up.
    pub fn set_up(&mut self, setup: &Setup, accelerations: Accelerations) -> Grid {
        let (weighting, is_wired) = (self.weighting, self.is_wired);
        pieces(setup, accelerations, weighting, is_wired, &mut |request| {
            self.done(request);
        });
        match self.ask(&Request::EndSetup) {
            Said::Grid(grid) => grid,
            other => panic!("{other:?}"),
        }
    }

    /// Sends the weights of all runs, of the accelerometers in the order of the set-up.
    pub fn weigh(&mut self, setup: &Setup, weights: &[Vec<f64>]) {
        for (k, weights) in weights.iter().enumerate() {
            let mut all = weights.clone();
            all.resize(weights.len() + setup.load_cells.len(), 1.0);
            self.done(&Request::SetWeights(Weights {
                run: k as u8,
                weights: Packed::new(&all),
            }));
        }
    }

    /// Feeds the samples of a run, which `change` may change, and stops it.
    pub fn run(
        &mut self,
        setup: &Setup,
        number: usize,
        pass: Pass,
        mut change: impl FnMut(usize, &mut [f32]),
    ) -> Summary {
        self.done(&Request::Start(Start {
            pass,
            ..bench::start(number as u8, Source::Host, Gaps::Refuse, None)
        }));
        let mut rows = rows(setup, number);
        let channels = rows[0].len();
        for (n, row) in rows.iter_mut().enumerate() {
            change(n, row);
        }
        let together = Samples::fit(channels as u8, 4);
        for (k, chunk) in rows.chunks(together).enumerate() {
            let values = chunk.concat();
            let samples = Samples {
                first: (k * together) as u64,
                channels: channels as u8,
                values: Values::Readings(Packed::new(&values)),
            };
            let Said::Progress(taken) = self.ask(&Request::Samples(samples)) else {
                panic!("samples were not taken");
            };
            assert_eq!(taken.next, (k * together + chunk.len()) as u64);
        }
        self.bench.stop()
    }

    /// The present weights of a run.
    pub fn weights(&mut self, run: usize) -> Vec<f64> {
        match self.ask(&Request::ReadWeights(run as u8)) {
            Said::Weights(weights) => weights,
            other => panic!("{other:?}"),
        }
    }
}

/// The simulated fork at 1 % noise, runs of so many seconds, with the drive as the last channel, as a set-up
/// has it.
pub fn fork(seconds: f64) -> Simulation {
    let options = Options {
        noise: Some(0.01),
        duration: Some(seconds),
        ..Options::default()
    };
    let model = Model::fork().unwrap();
    let mut simulation = simulate(&model, &options, &mut |_| ()).unwrap();
    for recording in &mut simulation.recordings {
        recording.channels.rotate_left(1);
        recording.samples.rotate_left(1);
    }
    simulation
}

/// The requests of a set-up before its end. Inputs that are wired have their own calibrations.
pub fn pieces(
    setup: &Setup,
    accelerations: Accelerations,
    weighting: Weighting,
    is_wired: bool,
    send: &mut dyn FnMut(&Request<'_>),
) {
    let processing = setup.processing.as_ref().unwrap();
    let rate = processing.sample_rate.unwrap();
    let sensors = setup.accelerometers.len() + setup.load_cells.len();
    send(&Request::BeginSetup(Plan {
        sensors: sensors as u8,
        runs: setup.runs.len() as u8,
        reference_point: setup.reference_point,
        fingerprint: 7,
    }));
    send(&Request::SetProcessing(Processing {
        sample_rate: rate,
        block_length: processing.block_length as u32,
        overlap: processing.overlap,
        window: WINDOW,
        kept_band: [
            processing.averaging_band[0],
            processing.kept_up_to(Some(rate)),
        ],
        averaging_band: processing.averaging_band,
        mode_band: processing.mode_band,
        accelerations,
        weighting,
        minimum_weight: setup.estimation.minimum_weight,
    }));
    for mut sensor in sensor_pieces(setup) {
        if is_wired {
            sensor.scale = ScaleSource::Stored;
        }
        send(&Request::SetSensor(sensor));
    }
    let mut channels: Vec<u8> = (0..sensors as u8).collect();
    channels.push(ChannelRole::Drive.code());
    for (k, run) in setup.runs.iter().enumerate() {
        send(&Request::SetRun(Run {
            run: k as u8,
            name: &run.name,
            excitation: Excitation::Random,
            rotation: run.rotation,
            translation: run.translation,
            channels: &channels,
        }));
    }
}

fn sensor_pieces(setup: &Setup) -> Vec<Sensor<'_>> {
    let scale = |per_unit| ScaleSource::Given {
        per_unit,
        offset: 0.0,
    };
    let mut pieces = Vec::new();
    for a in &setup.accelerometers {
        pieces.push(Sensor {
            sensor: pieces.len() as u8,
            name: &a.channel,
            kind: SensorKind::Accelerometer(a.mount),
            position: a.position,
            direction: a.direction,
            scale: scale(a.scale),
        });
    }
    for c in &setup.load_cells {
        pieces.push(Sensor {
            sensor: pieces.len() as u8,
            name: &c.channel,
            kind: SensorKind::LoadCell(c.quantity),
            position: c.position,
            direction: c.direction,
            scale: scale(c.scale),
        });
    }
    pieces
}

/// All samples of a run: accelerometers, load cells, drive.
pub fn rows(setup: &Setup, number: usize) -> Vec<Vec<f32>> {
    let run = &setup.runs[number];
    let sensors = setup.accelerometers.iter().map(|a| a.channel.as_str());
    let cells = setup.load_cells.iter().map(|c| c.channel.as_str());
    let names: Vec<&str> = sensors
        .chain(cells)
        .chain(run.references.first().map(String::as_str))
        .collect();
    let mut recording = Recording::open(&setup.recording_path(run), &names).unwrap();
    let mut rows = Vec::new();
    let mut row = vec![0.0; names.len()];
    while recording.next_row(&mut row).unwrap() {
        rows.push(row.clone());
    }
    rows
}
