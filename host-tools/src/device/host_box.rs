//! The box in this program: the instrument that the firmware runs, behind the same bytes.
//!
//! Nothing runs beside the caller. Requests are dealt with while they are sent, all else
//! while the answer is read; when nothing is left to be done there is nothing more to wait
//! for, so a timeout comes at once. Tests that lose frames by the thousand stay fast and
//! repeat exactly.
//!
//! If sensors are wired to its inputs, time while they run is that of their samples, as
//! fast as they can be computed.

use super::host_board::{HostBoard, TICK_HZ};
use super::{Port, PortError};
use crate::rig::Inputs;
use crate::simulate::Stream;
use massline_firmware::instrument::{
    Board, Identity, Instrument, Memory, Persistent, RawSample, RunStorage, Transmit,
    WorkingStorage,
};
use massline_firmware::link::WINDOW;
use massline_firmware::sampling::INPUTS;
use massline_firmware::wire::{
    BODY_MAX, ClockSource, Event, FRAME_MAX, FaultKind, Health, Item, LinkCounters, Problem,
    Received, Receiver, Refused, Reply, Request, ResetReason, Sender, Storage, ToBox,
};
use std::time::Duration;

/// Shortest delay of the link, and the range of its variation, s.
const DELAY: f64 = 1e-3;

/// Memory that a [`HostBox`] is lent: as much as the instrument has on the chip.
pub struct HostBoxMemory {
    working: Box<WorkingStorage>,
    runs: Box<RunStorage>,
    persistent: Box<Persistent>,
    body: [u8; BODY_MAX],
}

impl HostBoxMemory {
    /// Empty.
    #[must_use]
    pub fn new() -> Self {
        Self {
            working: Box::new(WorkingStorage::new()),
            runs: Box::new(RunStorage::new()),
            persistent: Box::new(Persistent::new()),
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
    /// The sample taken last.
    counts: Vec<i32>,
    health: Vec<Health>,
    /// Delays of the link.
    delays: Stream,
    /// When the bytes that were handed over last came, s.
    arrived: f64,
}

/// Frames on their way to the host.
struct Out {
    sender: Sender,
    bytes: Vec<u8>,
}

impl<'m> HostBox<'m> {
    /// A box without inputs that was switched on for the `session`-th time.
    #[must_use]
    pub fn new(memory: &'m mut HostBoxMemory, session: u16) -> Self {
        Self::wired(memory, session, None)
    }

    /// The same with something wired to its inputs, and told of it in its settings.
    #[must_use]
    pub fn with_inputs(memory: &'m mut HostBoxMemory, session: u16, inputs: Inputs) -> Self {
        Self::wired(memory, session, Some(inputs))
    }

    fn wired(memory: &'m mut HostBoxMemory, session: u16, inputs: Option<Inputs>) -> Self {
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
            inputs: inputs.as_ref().map_or(0, |_| INPUTS as u8),
            window: WINDOW,
        };
        let lent = Memory {
            working: &mut memory.working,
            runs: &mut memory.runs,
            persistent: &mut memory.persistent,
        };
        Self {
            instrument: Instrument::new(lent, identity),
            receiver: Receiver::new(&mut memory.body),
            delays: Stream::new(
                inputs.as_ref().map_or(0, Inputs::seed),
                &["delays of the link"],
            ),
            board: HostBoard::new(inputs),
            out: Out {
                sender: Sender::new(session),
                bytes: Vec::new(),
            },
            counts: Vec::new(),
            health: Vec::new(),
            arrived: 0.0,
        }
    }

    /// Counters of the host's frames, as the box has seen them.
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
    /// is not plugged in. It comes back once the inputs have stopped, too.
    pub fn unplugged(&mut self) {
        while self.work() {}
        self.out.bytes.clear();
    }

    /// Has the box notice a fault of its own.
    pub fn fault(&mut self, kind: FaultKind, part: Option<u8>) {
        let (board, out) = (&mut self.board, &mut self.out);
        self.instrument.fault(kind, part, board, out);
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
        if let Some(mut job) = self.instrument.take_job() {
            job.run();
            self.instrument.finish(job, &mut self.board, &mut self.out);
            return true;
        }
        self.convert()
    }

    /// Has the inputs take a sample, if they run.
    fn convert(&mut self) -> bool {
        let Some(number) = self.board.convert(&mut self.counts, &mut self.health) else {
            return false;
        };
        let sample = RawSample {
            number,
            ticks: self.board.ticks(),
            counts: &self.counts,
            health: &self.health,
        };
        let (board, out) = (&mut self.board, &mut self.out);
        self.instrument.sample(&sample, board, out);
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
        self.arrived = self.board.seconds() + DELAY * (1.0 + self.delays.signed());
        let count = self.out.bytes.len();
        into.append(&mut self.out.bytes);
        Ok(count)
    }

    /// A receive that brings nothing ends the wait. One that is never without samples, since a
    /// reply is lost while they stream, ends by this.
    fn patience(&self) -> Duration {
        Duration::from_secs(5)
    }

    /// For ever: it works while it is received from.
    fn longest_work(&self) -> Duration {
        Duration::from_secs(3600)
    }

    fn seconds(&self) -> f64 {
        self.arrived
    }
}

impl Transmit for Out {
    fn reply(&mut self, request: u16, reply: &Reply<'_>) {
        let mut frame = [0; FRAME_MAX];
        // The protocol's messages fit a frame; one that did not would be counted as lost.
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
