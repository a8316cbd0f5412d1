//! A test bench: the instrument, and a board with the firmware's settings whose clock and
//! converters are controlled by a script.

use crate::link::{self, Piece};
use massline_firmware::instrument::{
    Board, Identity, Instrument, Memory, Persistent, RunStorage, Transmit, Vitals, WorkingStorage,
};
use massline_firmware::sampling::{INPUTS, Plan};
use massline_firmware::settings::Settings;
use massline_firmware::wire::{
    BODY_MAX, ClockSource, Event, FRAME_MAX, FaultCounters, FromBox, Problem, Provoke, Received,
    Receiver, Reply, Request, ResetReason, Sender, Setting, SettingKey, Storage, ToHost,
};

/// Ticks per second.
pub const TICK_HZ: u32 = 1_000_000;

/// The board.
#[derive(Debug)]
pub struct Hardware {
    /// Time, ticks.
    pub ticks: u64,
    /// Sample rate of the running converters, Hz.
    pub converting: Option<f64>,
    /// Number of the converters' next sample.
    pub samples: u64,
    settings: Box<Settings<INPUTS>>,
    kept: Box<Settings<INPUTS>>,
}

impl Board for Hardware {
    fn ticks(&self) -> u64 {
        self.ticks
    }

    fn input_samples(&self) -> u64 {
        self.samples
    }

    fn faults(&self) -> FaultCounters {
        FaultCounters::default()
    }

    fn forget_faults(&mut self) {}

    fn vitals(&mut self) -> Vitals {
        Vitals::default()
    }

    fn start_inputs(&mut self, sample_rate: f64) -> Result<(), Problem> {
        if self.converting.is_none() {
            Plan::new(&self.settings, sample_rate, TICK_HZ)?;
            self.converting = Some(sample_rate);
            self.samples = 0;
        }
        Ok(())
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
        *self.settings = Settings::DELIVERED;
    }

    fn unsaved(&self) -> bool {
        self.settings != self.kept
    }

    fn reboot(&mut self) {}

    fn provoke(&mut self, _: Provoke) -> bool {
        false
    }
}

/// A message from the box.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sent {
    /// Number of its type on the wire.
    pub number: u8,
    /// Id of the request that it answers; zero for events.
    pub id: u16,
    /// Payload of the message.
    pub payload: Vec<u8>,
}

impl Sent {
    /// Decodes the message as a reply.
    ///
    /// # Panics
    /// If it is no reply.
    pub fn read(&self, see: impl FnOnce(&Reply<'_>)) {
        let wire = link::frame(&link::header(self.number, 1, 0, self.id), &self.payload);
        let mut buffer = [0; BODY_MAX];
        let mut receiver = Receiver::<ToHost>::new(&mut buffer);
        match receiver.next(&mut &wire[..]) {
            Some(Received::Message(_, FromBox::Reply(reply))) => see(&reply),
            other => panic!("{self:?} is no reply: {other:?}"),
        }
    }
}

/// Messages from the box, each of which was encoded as a frame and decoded again.
#[derive(Debug, Default)]
pub struct Out {
    /// Messages in order.
    pub sent: Vec<Sent>,
}

impl Out {
    fn keep(&mut self, frame: &[u8]) {
        let Piece::Sound(header, payload) = link::classify(&frame[1..frame.len() - 1]) else {
            panic!("this is no frame: {frame:?}");
        };
        self.sent.push(Sent {
            number: header[1],
            id: u16::from_le_bytes([header[8], header[9]]),
            payload,
        });
    }
}

impl Transmit for Out {
    fn reply(&mut self, id: u16, reply: &Reply<'_>) {
        let mut out = [0; FRAME_MAX];
        match Sender::new(1).reply(id, reply, &mut out) {
            Ok(frame) => self.keep(frame),
            Err(error) => panic!("{error}: {reply:?}"),
        }
    }

    fn event(&mut self, event: &Event<'_>) {
        let mut out = [0; FRAME_MAX];
        match Sender::new(1).event(event, &mut out) {
            Ok(frame) => self.keep(frame),
            Err(error) => panic!("{error}: {event:?}"),
        }
    }
}

/// Memory for an instrument.
#[derive(Debug, Default)]
pub struct Shelf {
    working: Box<WorkingStorage>,
    runs: Box<RunStorage>,
    persistent: Box<Persistent>,
}

/// The box on the test bench.
#[derive(Debug)]
pub struct Bench<'m> {
    /// The instrument.
    pub instrument: Instrument<'m>,
    /// The board of the instrument.
    pub hardware: Hardware,
    /// The messages that it sends.
    pub out: Out,
}

impl<'m> Bench<'m> {
    /// A box that has just been switched on, as delivered.
    #[must_use]
    pub fn new(shelf: &'m mut Shelf) -> Self {
        let memory = Memory {
            working: &mut shelf.working,
            runs: &mut shelf.runs,
            persistent: &mut shelf.persistent,
        };
        let identity = Identity {
            firmware: "bench",
            version: "0",
            build: "host",
            chip: "none",
            serial: [0; 12],
            clock: ClockSource::Internal,
            clock_hz: TICK_HZ,
            tick_hz: TICK_HZ,
            storage: Storage::Volatile,
            reset: ResetReason::PowerOn,
            resets: 0,
            panic: None,
            inputs: INPUTS as u8,
            window: 3,
        };
        let settings = Box::new(Settings::DELIVERED);
        Self {
            instrument: Instrument::new(memory, identity),
            hardware: Hardware {
                ticks: 0,
                converting: None,
                samples: 0,
                kept: settings.clone(),
                settings,
            },
            out: Out::default(),
        }
    }

    /// Sends a request.
    pub fn send(&mut self, id: u16, request: &Request<'_>) {
        self.instrument
            .request(id, request, &mut self.hardware, &mut self.out);
    }

    /// Sends a request and removes its reply, which must come at once.
    ///
    /// # Panics
    /// If there is no reply, or more than one.
    pub fn request(&mut self, request: &Request<'_>) -> Sent {
        let before = self.out.sent.len();
        self.send(OWN_ID, request);
        let mut replies = self.out.sent.split_off(before);
        replies.retain(|sent| sent.id == OWN_ID);
        assert_eq!(replies.len(), 1, "{request:?}: {replies:?}");
        replies.remove(0)
    }

    /// One call of the box's idle task.
    pub fn poll(&mut self) -> bool {
        self.instrument.poll(&mut self.hardware, &mut self.out)
    }
}

/// Id of the bench's own requests.
pub const OWN_ID: u16 = u16::MAX;
