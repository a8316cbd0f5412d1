//! A box on a bench: the instrument, a board whose inputs and clock the test has in its
//! hand, and a host that keeps all it hears.

use massline_firmware::calibration::Certificate;
use massline_firmware::instrument::{
    Board, Identity, Instrument, Job, Memory, Persistent, RawSample, RunStorage, Transmit, Vitals,
    WorkingStorage,
};
use massline_firmware::wire::*;

/// Inputs of the box's own converters.
pub const INPUTS: u8 = 16;

/// Settings, as a board keeps them.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    pub name: String,
    pub baud: u32,
    pub rate: f64,
    /// Calibrations of the inputs.
    pub inputs: Vec<Certificate>,
}

impl Settings {
    fn delivered(inputs: Vec<Certificate>) -> Self {
        Self {
            name: String::new(),
            baud: 921_600,
            rate: 512.0,
            inputs,
        }
    }

    pub fn get(&self, key: SettingKey) -> Result<Setting<'_>, Problem> {
        Ok(match key {
            SettingKey::Name => Setting::Name(&self.name),
            SettingKey::LinkBaud => Setting::LinkBaud(self.baud),
            SettingKey::SampleRate => Setting::SampleRate(self.rate),
            SettingKey::Input(number) => {
                let input = self.inputs.get(usize::from(number));
                Setting::Input(input.ok_or(self.no_input(number))?.input(number))
            }
        })
    }

    pub fn set(&mut self, setting: &Setting<'_>) -> Result<(), Problem> {
        let within = |field, found: f64, [low, high]: [f64; 2]| {
            if (low..=high).contains(&found) {
                return Ok(());
            }
            Err(Problem::Range {
                field,
                index: 0,
                found,
                low,
                high,
            })
        };
        match *setting {
            Setting::Name(name) if name.len() > NAME_MAX => {
                return Err(Problem::Capacity {
                    item: Item::Byte,
                    found: name.len() as u32,
                    limit: NAME_MAX as u32,
                });
            }
            Setting::Name(name) => self.name = name.to_owned(),
            Setting::LinkBaud(baud) => {
                within(Field::LinkBaud, baud.into(), [9_600.0, 2_000_000.0])?;
                self.baud = baud;
            }
            Setting::SampleRate(rate) => {
                within(Field::SampleRate, rate, [256.0, 32_768.0])?;
                self.rate = rate;
            }
            Setting::Input(ref input) => {
                let certificate = Certificate::new(input)?;
                let none = self.no_input(input.input);
                let place = self.inputs.get_mut(usize::from(input.input));
                *place.ok_or(none)? = certificate;
            }
        }
        Ok(())
    }

    fn no_input(&self, number: u8) -> Problem {
        Problem::Index {
            item: Item::Input,
            found: number.into(),
            limit: self.inputs.len() as u32,
        }
    }
}

/// The board.
pub struct Hardware {
    pub ticks: u64,
    /// Rate at which the converters run.
    pub converting: Option<f64>,
    pub settings: Settings,
    /// As they were when they were kept last, and as they are delivered.
    pub kept: Settings,
    delivered: Settings,
    /// Times that it was told to fail or to start afresh.
    pub endings: u32,
    pub rehearsals: u32,
}

impl Hardware {
    fn new(inputs: Vec<Certificate>) -> Self {
        let settings = Settings::delivered(inputs);
        Self {
            ticks: 0,
            converting: None,
            kept: settings.clone(),
            delivered: settings.clone(),
            settings,
            endings: 0,
            rehearsals: 0,
        }
    }
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
        match self.converting {
            Some(running) if running != rate => Err(Problem::Range {
                field: Field::SampleRate,
                index: 0,
                found: rate,
                low: running,
                high: running,
            }),
            _ => {
                self.converting = Some(rate);
                Ok(())
            }
        }
    }

    fn stop_inputs(&mut self) {
        self.converting = None;
    }

    fn setting(&self, key: SettingKey) -> Result<Setting<'_>, Problem> {
        self.settings.get(key)
    }

    fn write_setting(&mut self, setting: &Setting<'_>) -> Result<(), Problem> {
        self.settings.set(setting)
    }

    fn save_settings(&mut self) -> Result<Storage, Problem> {
        self.kept = self.settings.clone();
        Ok(Storage::Volatile)
    }

    fn reset_settings(&mut self) {
        self.settings = self.delivered.clone();
    }

    fn unsaved(&self) -> bool {
        self.settings != self.kept
    }

    fn reboot(&mut self) {
        self.endings += 1;
    }

    fn provoke(&mut self, fault: Provoke) -> bool {
        match fault {
            Provoke::TestPattern => self.rehearsals += 1,
            _ => self.endings += 1,
        }
        true
    }
}

/// A reply, kept.
#[derive(Clone, Debug, PartialEq)]
pub enum Said {
    Done,
    Refused(Problem),
    Status(Status),
    Grid(Grid),
    Progress(Progress),
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
    /// `true` while the plug is out: all that the box sends is lost.
    pub unplugged: bool,
    pub replies: Vec<(u16, Said)>,
    pub events: Vec<Heard>,
}

impl Transmit for Host {
    fn reply(&mut self, request: u16, reply: &Reply<'_>) {
        if self.unplugged {
            return;
        }
        let said = match reply {
            Reply::Done => Said::Done,
            Reply::Error(refused) => Said::Refused(refused.problem),
            Reply::Status(status) => Said::Status(*status),
            Reply::Grid(grid) => Said::Grid(*grid),
            Reply::Progress(taken) => Said::Progress(*taken),
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
    persistent: Box<Persistent>,
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
            persistent: &mut self.persistent,
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
            hardware: Hardware::new(inputs),
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

impl<'m> Bench<'m> {
    /// Lets the box do what it has to, jobs included.
    pub fn work(&mut self) {
        loop {
            while self.poll() {}
            let Some(mut job) = self.instrument.take_job() else {
                return;
            };
            job.run();
            self.give_back(job);
        }
    }

    /// Gives a job back.
    pub fn give_back(&mut self, job: Job<'m>) {
        self.instrument
            .finish(job, &mut self.hardware, &mut self.host);
    }

    /// One call of the box's idle task.
    pub fn poll(&mut self) -> bool {
        self.instrument.poll(&mut self.hardware, &mut self.host)
    }

    /// Sends a request and does not wait.
    pub fn send(&mut self, request: &Request<'_>) -> u16 {
        let id = self.ids.fresh();
        self.hear(id, request);
        id
    }

    /// Hears a request that somebody else has given this id.
    pub fn hear(&mut self, id: u16, request: &Request<'_>) {
        self.instrument
            .request(id, request, &mut self.hardware, &mut self.host);
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
