//! A box without hardware: the instrument on the host, fed with a set-up's recordings.

// Every test program takes a part of this.
#![allow(dead_code)]

use massline::measure::WINDOW;
use massline::recording::Recording;
use massline::setup::{self, Setup};
use massline_core::calibration::Certificate;
use massline_core::instrument::{
    Board, Identity, Instrument, Memory, Notebook, Outbox, RunStorage, Vitals, WorkingStorage,
};
use massline_core::wire::*;

/// A board that has a clock, and converters if it was given calibrations of their inputs.
#[derive(Default)]
pub struct Bare {
    ticks: std::cell::Cell<u64>,
    inputs: Vec<Certificate>,
}

impl Board for Bare {
    fn ticks(&self) -> u64 {
        self.ticks.set(self.ticks.get() + 1);
        self.ticks.get()
    }

    fn faults(&self) -> FaultCounters {
        FaultCounters::default()
    }

    fn forget_faults(&mut self) {}

    fn vitals(&mut self) -> Vitals {
        Vitals::default()
    }

    fn start_inputs(&mut self, _rate: f64) -> Result<(), Problem> {
        if self.inputs.is_empty() {
            return Err(Problem::Unsupported(Item::Input));
        }
        Ok(())
    }

    fn stop_inputs(&mut self) {}

    fn setting(&self, key: SettingKey) -> Result<Setting<'_>, Problem> {
        if let SettingKey::Input(k) = key
            && let Some(certificate) = self.inputs.get(usize::from(k))
        {
            return Ok(Setting::Input(certificate.input(k)));
        }
        Err(Problem::Unsupported(Item::Setting))
    }

    fn write_setting(&mut self, _setting: &Setting<'_>) -> Result<(), Problem> {
        Err(Problem::Unsupported(Item::Setting))
    }

    fn save_settings(&mut self) -> Result<Storage, Problem> {
        Ok(Storage::Volatile)
    }

    fn reset_settings(&mut self) {}

    fn unsaved(&self) -> bool {
        false
    }

    fn reboot(&mut self) {}

    fn provoke(&mut self, _fault: Provoke) -> bool {
        false
    }
}

/// What came back, as far as tests look at it.
#[derive(Clone, Debug)]
pub enum Said {
    Done,
    Refused(Problem),
    Grid(Grid),
    Taken(Taken),
    Summary(Summary),
    Lines(Vec<Line>),
    Peaks(Vec<f64>),
    Weights(Vec<f64>),
    Identified(Box<Identified>),
    Selftest(Selftest),
    Other(u8),
}

/// Replies by id, and blocks.
#[derive(Default)]
pub struct Pile {
    pub replies: Vec<(u16, Said)>,
    pub blocks: Vec<Block>,
    pub ended: Vec<Summary>,
}

impl Outbox for Pile {
    fn reply(&mut self, request: u16, reply: &Reply<'_>) {
        let said = match reply {
            Reply::Done => Said::Done,
            Reply::Error(refused) => Said::Refused(refused.problem),
            Reply::Grid(grid) => Said::Grid(*grid),
            Reply::Taken(taken) => Said::Taken(*taken),
            Reply::Summary(summary) => Said::Summary(*summary),
            Reply::Lines(lines) => Said::Lines(lines.lines.iter().collect()),
            Reply::Peaks(peaks) => Said::Peaks(peaks.peaks.iter().collect()),
            Reply::Weights(weights) => Said::Weights(weights.weights.iter().collect()),
            Reply::Identified(found) => Said::Identified(Box::new(*found)),
            Reply::Selftest(found) => Said::Selftest(*found),
            other => Said::Other(other.number()),
        };
        self.replies.push((request, said));
    }

    fn event(&mut self, event: &Event<'_>) {
        match event {
            Event::Block(block) => self.blocks.push(*block),
            Event::RunEnded(summary) => self.ended.push(*summary),
            _ => {}
        }
    }
}

/// Memory for an instrument.
pub struct Rack {
    working: Box<WorkingStorage>,
    runs: Box<RunStorage>,
    notebook: Box<Notebook>,
}

impl Rack {
    pub fn new() -> Self {
        Self {
            working: Box::default(),
            runs: Box::default(),
            notebook: Box::default(),
        }
    }

    /// A box that stands in the rack.
    pub fn stand_in(&mut self) -> StandIn<'_> {
        self.with_inputs(Vec::new())
    }

    /// One with converters, whose inputs are calibrated like this.
    pub fn with_inputs(&mut self, inputs: Vec<Certificate>) -> StandIn<'_> {
        let memory = Memory {
            working: &mut self.working,
            runs: &mut self.runs,
            notebook: &mut self.notebook,
        };
        let identity = Identity {
            firmware: "stand-in",
            version: "0",
            build: "host",
            chip: "none",
            serial: [0; 12],
            clock: ClockSource::Internal,
            clock_hz: 1,
            tick_hz: 1000,
            storage: Storage::Volatile,
            reset: ResetReason::PowerOn,
            resets: 0,
            panic: None,
            inputs: inputs.len() as u8,
            window: 8,
        };
        StandIn {
            instrument: Instrument::new(memory, identity),
            board: Bare {
                inputs,
                ..Bare::default()
            },
            pile: Pile::default(),
            ids: RequestIds::new(),
            weighting: Weighting::Given,
        }
    }
}

/// The box.
pub struct StandIn<'m> {
    pub instrument: Instrument<'m>,
    pub board: Bare,
    pub pile: Pile,
    ids: RequestIds,
    /// Where the weights of the next set-up come from.
    pub weighting: Weighting,
}

impl StandIn<'_> {
    /// Asks, works, and returns the one reply.
    pub fn ask(&mut self, request: &Request<'_>) -> Said {
        let id = self.ids.fresh();
        self.instrument
            .request(id, request, &mut self.board, &mut self.pile);
        while self.instrument.poll(&mut self.board, &mut self.pile) {}
        while let Some(mut job) = self.instrument.take_job() {
            job.run();
            self.instrument.finish(job, &mut self.board, &mut self.pile);
            while self.instrument.poll(&mut self.board, &mut self.pile) {}
        }
        let mine: Vec<Said> = self
            .pile
            .replies
            .drain(..)
            .map(|(to, said)| {
                assert_eq!(to, id);
                said
            })
            .collect();
        let [said] = mine.as_slice() else {
            panic!("{request:?} was answered {mine:?}");
        };
        said.clone()
    }

    /// Asks for what must be done.
    pub fn done(&mut self, request: &Request<'_>) {
        let said = self.ask(request);
        assert!(matches!(said, Said::Done), "{request:?}: {said:?}");
    }

    /// Sends a set-up.
    pub fn set_up(&mut self, setup: &Setup, accelerations: Accelerations) -> Grid {
        let processing = setup.processing.as_ref().unwrap();
        let rate = processing.sample_rate.unwrap();
        let sensors = setup.accelerometers.len() + setup.load_cells.len();
        self.done(&Request::BeginSetup(Plan {
            sensors: sensors as u8,
            runs: setup.runs.len() as u8,
            reference_point: setup.reference_point,
            fingerprint: 7,
        }));
        assert_eq!(WINDOW, massline_core::spectra::Window::Hann);
        self.done(&Request::SetProcessing(Processing {
            sample_rate: rate,
            block_length: processing.block_length as u32,
            overlap: processing.overlap,
            window: Window::Hann,
            kept_band: [
                processing.averaging_band[0],
                processing.kept_up_to(Some(rate)),
            ],
            averaging_band: processing.averaging_band,
            mode_band: processing.mode_band,
            accelerations,
            weighting: self.weighting,
            minimum_weight: setup.estimation.minimum_weight,
        }));
        let is_wired = !self.board.inputs.is_empty();
        for mut sensor in sensor_pieces(setup) {
            if is_wired {
                sensor.scale = Scale::Stored;
            }
            self.done(&Request::SetSensor(sensor));
        }
        let mut channels: Vec<u8> = (0..sensors as u8).collect();
        channels.push(Carries::Drive.code());
        for (k, run) in setup.runs.iter().enumerate() {
            self.done(&Request::SetRun(Run {
                run: k as u8,
                name: &run.name,
                excitation: Excitation::Random,
                rotation: run.rotation,
                translation: run.translation,
                channels: &channels,
            }));
        }
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

    /// Runs through a run's samples, which `change` may change, and stops it.
    pub fn run(
        &mut self,
        setup: &Setup,
        number: usize,
        pass: Pass,
        mut change: impl FnMut(usize, &mut [f32]),
    ) -> Summary {
        self.done(&Request::Start(Start {
            run: number as u8,
            pass,
            source: Source::Host,
            gaps: Gaps::Refuse,
            limit: None,
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
            let Said::Taken(taken) = self.ask(&Request::Samples(samples)) else {
                panic!("samples were not taken");
            };
            assert_eq!(taken.next, (k * together + chunk.len()) as u64);
        }
        match self.ask(&Request::Stop) {
            Said::Summary(summary) => summary,
            other => panic!("{other:?}"),
        }
    }

    /// Asks for the ten numbers.
    pub fn identify(&mut self, question: Question) -> Answer {
        match self.ask(&Request::Identify(question)) {
            Said::Identified(found) => found.answer,
            other => panic!("{other:?}"),
        }
    }

    /// The weights of a run as they are now.
    pub fn weights(&mut self, run: usize) -> Vec<f64> {
        match self.ask(&Request::ReadWeights(run as u8)) {
            Said::Weights(weights) => weights,
            other => panic!("{other:?}"),
        }
    }

    /// All lines of a stored run.
    pub fn lines(&mut self, run: usize) -> Vec<Line> {
        let mut all = Vec::new();
        loop {
            let read = ReadLines {
                run: run as u8,
                first: all.len() as u16,
                count: u16::MAX,
            };
            match self.ask(&Request::ReadLines(read)) {
                Said::Lines(lines) => all.extend(lines),
                Said::Refused(Problem::Index { .. }) => return all,
                other => panic!("{other:?}"),
            }
        }
    }
}

fn sensor_pieces(setup: &Setup) -> Vec<Sensor<'_>> {
    let scale = |per_unit| Scale::Given {
        per_unit,
        offset: 0.0,
    };
    let mut pieces = Vec::new();
    for a in &setup.accelerometers {
        pieces.push(Sensor {
            sensor: pieces.len() as u8,
            name: &a.channel,
            kind: SensorKind::Accelerometer(match a.mount {
                setup::Mount::Interface => Mount::Interface,
                setup::Mount::Structure => Mount::Structure,
            }),
            position: a.position,
            direction: a.direction,
            scale: scale(a.scale),
        });
    }
    for c in &setup.load_cells {
        pieces.push(Sensor {
            sensor: pieces.len() as u8,
            name: &c.channel,
            kind: SensorKind::LoadCell(match c.quantity {
                setup::Quantity::Force => Quantity::Force,
                setup::Quantity::Moment => Quantity::Moment,
            }),
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
        .chain(run.reference.as_deref())
        .collect();
    let mut recording = Recording::open(&setup.recording_path(run), &names).unwrap();
    let mut rows = Vec::new();
    let mut row = vec![0.0; names.len()];
    while recording.next_row(&mut row).unwrap() {
        rows.push(row.clone());
    }
    rows
}
