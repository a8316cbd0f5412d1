//! A box on a bench: the instrument, a model of its board, and a host that keeps all messages.

use massline_firmware::calibration::Certificate;
use massline_firmware::instrument::{
    Identity, Instrument, Job, Memory, Persistent, RawSample, RunStorage, Transmit, WorkingStorage,
};
use massline_firmware::model_board::{IDENTITY, ModelBoard, TICK_HZ};
pub use massline_firmware::models::setup::start;
use massline_firmware::sampling;
use massline_firmware::wire::*;

/// Inputs of the box's own converters.
pub const INPUTS: u8 = sampling::INPUTS as u8;
/// Ticks of a millisecond.
pub const MILLISECOND: u64 = TICK_HZ as u64 / 1000;
/// Settings of the box.
pub type Settings = massline_firmware::settings::Settings<{ sampling::INPUTS }>;

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

/// The box on its bench.
pub struct Bench {
    pub instrument: Instrument<'static>,
    pub hardware: ModelBoard,
    pub host: Host,
    ids: RequestIds,
}

/// Memory that is never given back: a test ends soon.
fn lent<T: Default>() -> &'static mut T {
    Box::leak(Box::default())
}

impl Bench {
    /// A box that has just been switched on, to all inputs of which voltages are wired: counts stay
    /// counts.
    pub fn switch_on() -> Self {
        let unused = Certificate::UNUSED;
        let voltage = Input {
            circuit: Circuit::Voltage,
            ..unused.input(0)
        };
        let voltage = Certificate::new(&voltage).expect("it is like one that is unused");
        Self::with_inputs(&vec![voltage; sampling::INPUTS])
    }

    /// One whose first inputs have these calibrations; without any, it has no converters.
    pub fn with_inputs(inputs: &[Certificate]) -> Self {
        let memory = Memory {
            working: lent::<WorkingStorage>(),
            runs: lent::<RunStorage>(),
            persistent: lent::<Persistent>(),
        };
        let identity = Identity {
            inputs: inputs.len() as u8,
            ..IDENTITY
        };
        let mut delivered = Settings::DELIVERED;
        for (number, input) in (0..).zip(inputs) {
            let set = delivered.set(&Setting::Input(input.input(number)));
            set.expect("there is such an input");
        }
        Self {
            instrument: Instrument::new(memory, identity),
            hardware: ModelBoard::new(delivered),
            host: Host::default(),
            ids: RequestIds::new(),
        }
    }

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
    pub fn give_back(&mut self, job: Job<'static>) {
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

    /// Starts a run that measures.
    pub fn start(&mut self, run: u8, source: Source, gaps: Gaps, limit: Option<u64>) {
        self.done(&Request::Start(start(run, source, gaps, limit)));
    }

    /// Stops the run.
    pub fn stop(&mut self) -> Summary {
        self.summary(&Request::Stop)
    }

    /// The summary that this request asks for.
    pub fn summary(&mut self, request: &Request<'_>) -> Summary {
        match self.ask(request) {
            Said::Summary(summary) => summary,
            other => panic!("{other:?}"),
        }
    }

    /// All stored lines of a run.
    pub fn lines(&mut self, run: u8) -> Vec<Line> {
        let mut all = Vec::new();
        loop {
            let first = all.len() as u16;
            let count = u16::MAX;
            match self.ask(&Request::ReadLines(ReadLines { run, first, count })) {
                Said::Lines(lines) => all.extend(lines),
                Said::Refused(Problem::Index { .. }) => return all,
                other => panic!("{other:?}"),
            }
        }
    }

    /// The answer to a question.
    pub fn identify(&mut self, question: Question) -> Box<Identified> {
        match self.await_reply(&Request::Identify(question)) {
            Said::Identified(found) => found,
            other => panic!("{other:?}"),
        }
    }

    /// One sample of the converters, all of whose channels are good but those named.
    pub fn convert(&mut self, number: u64, counts: &[i32], health: &[Health]) {
        let sample = RawSample {
            ticks: self.hardware.ticks,
            number,
            counts,
            health,
        };
        self.hardware.ticks += 2 * MILLISECOND;
        self.instrument
            .sample(&sample, &mut self.hardware, &mut self.host);
    }

    /// The events so far, which are then forgotten.
    pub fn events(&mut self) -> Vec<Heard> {
        core::mem::take(&mut self.host.events)
    }
}
