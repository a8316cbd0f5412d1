//! A box on a bench: the instrument, a board whose inputs and clock the test has in its
//! hand, and a host that keeps all it hears.

use massline_core::calibration::Certificate;
use massline_core::instrument::{
    Board, Identity, Instrument, Memory, Notebook, Outbox, RawSample, RunStorage, Vitals,
    WorkingStorage,
};
use massline_core::wire::*;

/// Inputs of the box's own converters.
pub const INPUTS: u8 = 16;

/// The board.
pub struct Hardware {
    pub ticks: u64,
    /// Rate at which the converters run.
    pub converting: Option<f64>,
    /// What the inputs' settings say.
    pub inputs: Vec<Certificate>,
}

impl Board for Hardware {
    fn ticks(&self) -> u64 {
        self.ticks
    }

    fn faults(&self) -> FaultCounters {
        FaultCounters::default()
    }

    fn forget_faults(&mut self) {}

    fn vitals(&mut self) -> Vitals {
        Vitals::default()
    }

    fn start_inputs(&mut self, rate: f64) -> Result<(), Problem> {
        self.converting = Some(rate);
        Ok(())
    }

    fn stop_inputs(&mut self) {
        self.converting = None;
    }

    fn setting(&self, key: SettingKey) -> Result<Setting<'_>, Problem> {
        match key {
            SettingKey::Input(number) => {
                let input = self.inputs.get(usize::from(number));
                let input = input.ok_or(Problem::Unsupported(Item::Setting))?;
                Ok(Setting::Input(input.input(number)))
            }
            SettingKey::SampleRate => Ok(Setting::SampleRate(512.0)),
            _ => Err(Problem::Unsupported(Item::Setting)),
        }
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

/// A reply, kept.
#[derive(Clone, Debug, PartialEq)]
pub enum Said {
    Done,
    Refused(Problem),
    Status(Status),
    Grid(Grid),
    Taken(Taken),
    Summary(Summary),
    Lines(Vec<Line>),
    Weights(Vec<f64>),
    Peaks(Vec<f64>),
    Identified(Box<Identified>),
    Selftest(Selftest),
    Other(u8),
}

/// Recorded samples, kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    pub first: u64,
    pub channels: usize,
    /// Faults of each channel; none of a message without faults.
    pub health: Vec<u16>,
    /// SI, or counts, which `f64` holds exactly.
    pub values: Vec<f64>,
}

impl Recorded {
    fn new(samples: &Samples<'_>, health: Vec<u16>) -> Self {
        Self {
            first: samples.first,
            channels: samples.channels.into(),
            health,
            values: match samples.values {
                Values::Readings(list) => list.iter().map(f64::from).collect(),
                Values::Counts(list) => list.iter().map(f64::from).collect(),
                Values::Counts24(list) => list.iter().map(|x| f64::from(x.get())).collect(),
            },
        }
    }
}

/// An event, kept.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    Started,
    Block(Block),
    Health(u64, Vec<u16>),
    RunEnded(Summary),
    Levels(u32, Vec<f32>),
    Recorded(Recorded),
    Telemetry,
    Fault(Fault),
}

/// The host's end of the link.
#[derive(Default)]
pub struct Host {
    /// Whether the plug is out: what the box sends is gone.
    pub unplugged: bool,
    pub replies: Vec<(u16, Said)>,
    pub events: Vec<Heard>,
}

impl Outbox for Host {
    fn reply(&mut self, request: u16, reply: &Reply<'_>) {
        if self.unplugged {
            return;
        }
        let said = match reply {
            Reply::Done => Said::Done,
            Reply::Error(refused) => Said::Refused(refused.problem),
            Reply::Status(status) => Said::Status(*status),
            Reply::Grid(grid) => Said::Grid(*grid),
            Reply::Taken(taken) => Said::Taken(*taken),
            Reply::Summary(summary) => Said::Summary(*summary),
            Reply::Lines(lines) => Said::Lines(lines.lines.iter().collect()),
            Reply::Weights(weights) => Said::Weights(weights.weights.iter().collect()),
            Reply::Peaks(peaks) => Said::Peaks(peaks.peaks.iter().collect()),
            Reply::Identified(found) => Said::Identified(Box::new(*found)),
            Reply::Selftest(found) => Said::Selftest(*found),
            other => Said::Other(other.number()),
        };
        self.replies.push((request, said));
    }

    fn event(&mut self, event: &Event<'_>) {
        if self.unplugged {
            return;
        }
        self.events.push(match event {
            Event::Started(_) => Heard::Started,
            Event::Block(block) => Heard::Block(*block),
            Event::Health(health) => Heard::Health(health.sample, health.channels.iter().collect()),
            Event::RunEnded(summary) => Heard::RunEnded(*summary),
            Event::Levels(levels) => Heard::Levels(levels.samples, levels.mean.iter().collect()),
            Event::Recorded(samples) => Heard::Recorded(Recorded::new(samples, Vec::new())),
            Event::RecordedFaulty(faulty) => {
                let health = faulty.health.iter().collect();
                Heard::Recorded(Recorded::new(&faulty.samples, health))
            }
            Event::Telemetry(_) => Heard::Telemetry,
            Event::Fault(fault) => Heard::Fault(*fault),
        });
    }
}

/// Memory for an instrument.
#[derive(Default)]
pub struct Shelf {
    working: Box<WorkingStorage>,
    runs: Box<RunStorage>,
    notebook: Box<Notebook>,
}

impl Shelf {
    /// A box that has just been switched on, to whose inputs voltages are wired: counts stay
    /// counts.
    pub fn switch_on(&mut self) -> Bench<'_> {
        let unused = Certificate::UNUSED;
        let voltage = Input {
            circuit: Circuit::Voltage,
            ..unused.input(0)
        };
        let voltage = Certificate::new(&voltage).expect("it is like one that is unused");
        self.with_inputs(vec![voltage; usize::from(INPUTS)])
    }

    /// One whose inputs are calibrated like this.
    pub fn with_inputs(&mut self, inputs: Vec<Certificate>) -> Bench<'_> {
        let memory = Memory {
            working: &mut self.working,
            runs: &mut self.runs,
            notebook: &mut self.notebook,
        };
        let identity = Identity {
            firmware: "bench",
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
        Bench {
            instrument: Instrument::new(memory, identity),
            hardware: Hardware {
                ticks: 0,
                converting: None,
                inputs,
            },
            host: Host::default(),
            ids: RequestIds::new(),
        }
    }
}

/// The box on its bench.
pub struct Bench<'m> {
    pub instrument: Instrument<'m>,
    pub hardware: Hardware,
    pub host: Host,
    ids: RequestIds,
}

impl Bench<'_> {
    /// Lets the box do what it has to, jobs included.
    pub fn work(&mut self) {
        loop {
            while self.poll() {}
            let Some(mut job) = self.instrument.take_job() else {
                return;
            };
            job.run();
            self.instrument
                .finish(job, &mut self.hardware, &mut self.host);
        }
    }

    /// One call of the box's idle task.
    pub fn poll(&mut self) -> bool {
        self.instrument.poll(&mut self.hardware, &mut self.host)
    }

    /// Sends a request and does not wait.
    pub fn send(&mut self, request: &Request<'_>) -> u16 {
        let id = self.ids.fresh();
        self.instrument
            .request(id, request, &mut self.hardware, &mut self.host);
        id
    }

    /// Sends a request, and returns the one reply that it has at once.
    pub fn ask(&mut self, request: &Request<'_>) -> Said {
        let id = self.send(request);
        self.reply_to(id)
    }

    /// Sends a request, lets the box work, and returns the one reply.
    pub fn await_reply(&mut self, request: &Request<'_>) -> Said {
        let id = self.send(request);
        self.work();
        self.reply_to(id)
    }

    fn reply_to(&mut self, id: u16) -> Said {
        let replies = core::mem::take(&mut self.host.replies);
        let [(to, said)] = replies.as_slice() else {
            panic!("one reply was expected: {replies:?}");
        };
        assert_eq!(*to, id);
        said.clone()
    }

    /// Asks for what must be done.
    pub fn done(&mut self, request: &Request<'_>) {
        assert_eq!(self.ask(request), Said::Done, "{request:?}");
    }

    /// The reason why a request is refused.
    pub fn refused(&mut self, request: &Request<'_>) -> Problem {
        match self.ask(request) {
            Said::Refused(problem) => problem,
            other => panic!("{request:?} was not refused: {other:?}"),
        }
    }

    pub fn status(&mut self) -> Status {
        match self.ask(&Request::Status) {
            Said::Status(status) => status,
            other => panic!("{other:?}"),
        }
    }

    /// One sample of the converters, all of whose channels are good but those named.
    pub fn convert(&mut self, number: u64, counts: &[i32], health: &[Health]) {
        let sample = RawSample {
            ticks: self.hardware.ticks(),
            number,
            counts,
            health,
        };
        self.hardware.ticks += 2;
        self.instrument
            .sample(&sample, &mut self.hardware, &mut self.host);
    }

    /// The events so far, which are then forgotten.
    pub fn events(&mut self) -> Vec<Heard> {
        core::mem::take(&mut self.host.events)
    }
}
