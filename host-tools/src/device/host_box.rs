//! The box in this program: the instrument that the firmware runs, behind the same bytes.
//!
//! Nothing runs beside the caller. Requests are dealt with while they are sent, all else
//! while the answer is read; when nothing is left to be done there is nothing more to wait
//! for, so a timeout comes at once. Tests that lose frames by the thousand stay fast and
//! repeat exactly.

use super::{Port, PortError};
use massline_core::instrument::{
    Board, Identity, Instrument, Memory, Notebook, Outbox, RunStorage, Vitals, WorkingStorage,
};
use massline_core::wire::{
    BODY_MAX, ClockSource, Event, FRAME_MAX, FaultCounters, Field, Item, LinkCounters, NAME_MAX,
    Problem, Provoke, Received, Receiver, Refused, Reply, Request, ResetReason, Sender, Setting,
    SettingKey, Storage, ToBox,
};
use std::time::{Duration, Instant};

/// Requests of samples that may be on their way: what the firmware allows, so that replays
/// take the same turns.
const WINDOW: u8 = 3;

/// Memory that a [`HostBox`] is lent: as much as the instrument has on the chip.
pub struct HostBoxMemory {
    working: Box<WorkingStorage>,
    runs: Box<RunStorage>,
    notebook: Box<Notebook>,
    body: [u8; BODY_MAX],
}

impl HostBoxMemory {
    /// Empty.
    #[must_use]
    pub fn new() -> Self {
        Self {
            working: Box::new(WorkingStorage::new()),
            runs: Box::new(RunStorage::new()),
            notebook: Box::new(Notebook::new()),
            body: [0; BODY_MAX],
        }
    }
}

impl Default for HostBoxMemory {
    fn default() -> Self {
        Self::new()
    }
}

/// A box in this program.
pub struct HostBox<'m> {
    instrument: Instrument<'m>,
    receiver: Receiver<'m, ToBox>,
    board: HostBoard,
    out: Out,
}

/// Frames on their way to the host.
struct Out {
    sender: Sender,
    bytes: Vec<u8>,
}

impl<'m> HostBox<'m> {
    /// A box that was switched on for the `session`-th time.
    #[must_use]
    pub fn new(memory: &'m mut HostBoxMemory, session: u16) -> Self {
        let identity = Identity {
            firmware: "massline",
            version: env!("CARGO_PKG_VERSION"),
            build: "host",
            chip: "this computer",
            serial: [0; 12],
            clock: ClockSource::Internal,
            clock_hz: TICK_HZ,
            tick_hz: TICK_HZ,
            storage: Storage::Volatile,
            reset: ResetReason::PowerOn,
            resets: 0,
            panic: None,
            inputs: 0,
            window: WINDOW,
        };
        let lent = Memory {
            working: &mut memory.working,
            runs: &mut memory.runs,
            notebook: &mut memory.notebook,
        };
        Self {
            instrument: Instrument::new(lent, identity),
            receiver: Receiver::new(&mut memory.body),
            board: HostBoard::new(),
            out: Out {
                sender: Sender::new(session),
                bytes: Vec::new(),
            },
        }
    }

    /// What the box has seen of the host's frames.
    #[must_use]
    pub const fn link(&self) -> &LinkCounters {
        self.receiver.counters()
    }

    /// Frames that the box has produced.
    #[must_use]
    pub const fn produced(&self) -> u32 {
        self.out.sender.produced()
    }

    /// Does what is left to be done; what it says meanwhile goes nowhere, as on a box that
    /// is not plugged in.
    pub fn unplugged(&mut self) {
        while self.work() {}
        self.out.bytes.clear();
    }

    fn take(&mut self, mut bytes: &[u8]) {
        while let Some(received) = self.receiver.next(&mut bytes) {
            match received {
                Received::Message(header, request) => {
                    let (board, out) = (&mut self.board, &mut self.out);
                    match request {
                        // Both would take the whole program along.
                        Request::Reboot | Request::Provoke(_) => out.reply(
                            header.request,
                            &Reply::Error(Refused {
                                request: header.number,
                                problem: Problem::Unsupported(Item::Provoke),
                            }),
                        ),
                        request => self
                            .instrument
                            .request(header.request, &request, board, out),
                    }
                }
                Received::Refused(header, refusal) => self.out.reply(
                    header.request,
                    &Reply::Error(Refused::because(&header, refusal)),
                ),
            }
            while self.instrument.poll(&mut self.board, &mut self.out) {}
        }
    }

    /// Does some of what is due; whether there was anything.
    fn work(&mut self) -> bool {
        self.board.link = *self.receiver.counters();
        if self.instrument.poll(&mut self.board, &mut self.out) {
            return true;
        }
        let Some(mut job) = self.instrument.take_job() else {
            return false;
        };
        job.run();
        self.instrument.finish(job, &mut self.board, &mut self.out);
        true
    }
}

impl Port for HostBox<'_> {
    fn name(&self) -> String {
        "box in this program".to_owned()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.take(bytes);
        Ok(())
    }

    fn receive(&mut self, into: &mut Vec<u8>, _: Duration) -> Result<usize, PortError> {
        while self.out.bytes.is_empty() && self.work() {}
        let count = self.out.bytes.len();
        into.append(&mut self.out.bytes);
        Ok(count)
    }

    /// For ever: a receive that brings nothing ends the wait.
    fn patience(&self) -> Duration {
        Duration::from_secs(3600)
    }
}

impl Outbox for Out {
    fn reply(&mut self, request: u16, reply: &Reply<'_>) {
        let mut frame = [0; FRAME_MAX];
        // The contract's messages fit a frame; what did not would show as a lost one.
        if let Ok(frame) = self.sender.reply(request, reply, &mut frame) {
            self.bytes.extend_from_slice(frame);
        }
    }

    fn event(&mut self, event: &Event<'_>) {
        let mut frame = [0; FRAME_MAX];
        if let Ok(frame) = self.sender.event(event, &mut frame) {
            self.bytes.extend_from_slice(frame);
        }
    }
}

/// Ticks are microseconds here.
const TICK_HZ: u32 = 1_000_000;

/// What there is of a board: a clock, and settings that last as long as the program.
struct HostBoard {
    started: Instant,
    link: LinkCounters,
    kept: Settings,
    settings: Settings,
}

#[derive(Clone, PartialEq)]
struct Settings {
    name: String,
    baud: u32,
    rate: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            name: "massline".to_owned(),
            baud: super::BAUD,
            rate: 512.0,
        }
    }
}

impl HostBoard {
    fn new() -> Self {
        Self {
            started: Instant::now(),
            link: LinkCounters::default(),
            kept: Settings::default(),
            settings: Settings::default(),
        }
    }
}

const fn no_input(found: u8) -> Problem {
    Problem::Index {
        item: Item::Input,
        found: found as u32,
        limit: 0,
    }
}

fn within(field: Field, found: f64, low: f64, high: f64) -> Result<(), Problem> {
    if (low..=high).contains(&found) {
        return Ok(());
    }
    Err(Problem::Range {
        field,
        index: 0,
        found: found.into(),
        low: low.into(),
        high: high.into(),
    })
}

impl Board for HostBoard {
    fn ticks(&self) -> u64 {
        self.started.elapsed().as_micros() as u64
    }

    fn faults(&self) -> FaultCounters {
        FaultCounters::default()
    }

    fn forget_faults(&mut self) {}

    fn vitals(&mut self) -> Vitals {
        Vitals {
            link: self.link,
            ..Vitals::default()
        }
    }

    fn start_inputs(&mut self, _: f64) -> Result<(), Problem> {
        Err(Problem::Unsupported(Item::Input))
    }

    fn stop_inputs(&mut self) {}

    fn setting(&self, key: SettingKey) -> Result<Setting<'_>, Problem> {
        match key {
            SettingKey::Name => Ok(Setting::Name(&self.settings.name)),
            SettingKey::LinkBaud => Ok(Setting::LinkBaud(self.settings.baud)),
            SettingKey::SampleRate => Ok(Setting::SampleRate(self.settings.rate)),
            SettingKey::Input(input) => Err(no_input(input)),
        }
    }

    fn write_setting(&mut self, setting: &Setting<'_>) -> Result<(), Problem> {
        match setting {
            Setting::Name(name) if name.len() > NAME_MAX => Err(Problem::Capacity {
                item: Item::Byte,
                found: name.len() as u32,
                limit: NAME_MAX as u32,
            }),
            Setting::Name(name) => {
                (*name).clone_into(&mut self.settings.name);
                Ok(())
            }
            Setting::LinkBaud(baud) => {
                within(Field::LinkBaud, f64::from(*baud), 9600.0, 3e6)?;
                self.settings.baud = *baud;
                Ok(())
            }
            Setting::SampleRate(rate) => {
                within(Field::SampleRate, *rate, 1.0, 65536.0)?;
                self.settings.rate = *rate;
                Ok(())
            }
            Setting::Input(input) => Err(no_input(input.input)),
        }
    }

    fn save_settings(&mut self) -> Result<Storage, Problem> {
        self.kept = self.settings.clone();
        Ok(Storage::Volatile)
    }

    fn reset_settings(&mut self) {
        self.settings = Settings::default();
    }

    fn unsaved(&self) -> bool {
        self.settings != self.kept
    }

    fn reboot(&mut self) {}

    fn provoke(&mut self, _: Provoke) -> bool {
        false
    }
}
