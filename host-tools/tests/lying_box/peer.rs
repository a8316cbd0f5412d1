//! A box that lies, at the other end of a pair of pseudo-terminals.

use crate::reference;
use massline_firmware::wire::{
    BODY_MAX, CHECKSUM, Capacity, Circuit, ClockSource, Event, FRAME_MAX, Fault, FaultCounters,
    FaultKind, Info, Input, MethodSet, Packed, Pong, Received, Receiver, Reply, Request,
    ResetReason, Samples, Saved, Sender, Setting, SettingKey, State, Status, Storage, Stream,
    ToBox, Values,
};
use serialport::{SerialPort, TTYPort};
use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A breach of the protocol.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lie {
    /// Nothing: it is sound, and its two inputs sample.
    None,
    /// It says nothing.
    Silent,
    /// It never reads.
    Deaf,
    /// It sends bytes without end: random ones, or one value.
    Noise(Option<u8>),
    /// It sends events without end, and answers nothing.
    Events,
    /// It sends the first half of each frame.
    HalfFrames,
    /// It answers with the last byte of the payload missing, in a sound frame.
    ShortPayload,
    /// It closes the port at the first request. Commands that run beside each other inherit it
    /// here, so that it may seem to go on silently.
    Close,
    /// It starts anew before each answer.
    Restart,
    /// It answers everything by a pong.
    WrongKind,
    /// It answers with a message number that there is none of.
    UnknownNumber,
    /// It speaks another version.
    Version,
    /// It sends each answer 200 times.
    Repeats,
    /// It answers a request that was not asked.
    OtherId,
    /// It sends each byte on its own, that long after the last.
    Drip(Duration),
    /// It states that sample rate, Hz.
    Rate(f64),
    /// It is at work at a self-test or an identification for ever.
    Busy,
    /// Its texts steer a terminal.
    Texts,
    /// Its samples jump ahead by that many at the fifth message, and at each one after it.
    Jump(u64),
    /// Its first sample has that number.
    First(u64),
    /// Each message of samples comes with fifty faults of the box, without pause.
    Faults,
    /// Messages of samples have so many channels.
    Channels(u8),
    /// A message with one sample comes twice a second.
    Trickle,
}

/// A name by which a box takes a terminal over.
pub const EVIL: &str = "\u{1b}]0;x\u{7}\u{1b}[2J\u{9b}31m\nerror: a\u{202e}b";
/// Samples of a message.
const SAMPLES: usize = 5;
/// Sample rate of the settings, Hz.
pub const RATE: f64 = 512.0;
/// Inputs of the box, all of which something is wired to.
pub const INPUTS: u8 = 2;

/// The box, for as long as this lives.
pub struct Peer {
    /// Path of the port for a program.
    pub path: String,
    stop: Arc<AtomicBool>,
    // The other end is not gone while nobody has it open.
    _held: Option<TTYPort>,
}

impl Drop for Peer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

struct Liar {
    lie: Lie,
    port: TTYPort,
    sender: Sender,
    session: u16,
    streams: bool,
    messages: u64,
    next: u64,
    random: u32,
    stop: Arc<AtomicBool>,
}

impl Peer {
    pub fn new(lie: Lie) -> Self {
        let (mut port, theirs) = TTYPort::pair().unwrap();
        port.set_timeout(Duration::from_millis(20)).unwrap();
        let path = theirs.name().unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let liar = Liar {
            lie,
            port,
            sender: Sender::new(77),
            session: 77,
            streams: false,
            messages: 0,
            next: 1000,
            random: 1,
            stop: Arc::clone(&stop),
        };
        // It may be kept by a write for ever, so that it is not waited for.
        std::thread::spawn(move || liar.live());
        // What closes the port has nobody at either end.
        let held = (lie != Lie::Close).then_some(theirs);
        Self {
            path,
            stop,
            _held: held,
        }
    }
}

impl Liar {
    fn live(mut self) {
        let mut body = [0; BODY_MAX];
        let mut receiver = Receiver::<ToBox>::new(&mut body);
        let mut chunk = [0; 1024];
        while !self.stop.load(Ordering::Relaxed) {
            self.speak();
            if self.lie == Lie::Deaf {
                std::thread::sleep(Duration::from_millis(20));
                continue;
            }
            // Nothing has come, or nobody is there yet.
            let Ok(count) = self.port.read(&mut chunk) else {
                std::thread::sleep(Duration::from_millis(1));
                continue;
            };
            let mut rest = &chunk[..count];
            while let Some(received) = receiver.next(&mut rest) {
                let Received::Message(header, request) = received else {
                    continue;
                };
                if self.lie == Lie::Close {
                    return;
                }
                self.answer(header.request, &request);
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) {
        let mut left = bytes;
        while !left.is_empty() && !self.stop.load(Ordering::Relaxed) {
            match self.port.write(&left[..left.len().min(256)]) {
                Ok(count) => left = &left[count..],
                Err(_) => std::thread::sleep(Duration::from_millis(5)),
            }
        }
    }

    fn number(&mut self) -> u32 {
        self.random = self
            .random
            .wrapping_mul(1_664_525)
            .wrapping_add(1_013_904_223);
        self.random >> 8
    }

    /// Sends events.
    fn speak(&mut self) {
        match self.lie {
            Lie::Noise(value) => {
                let bytes: Vec<u8> = (0..2048)
                    .map(|_| value.unwrap_or(self.number() as u8))
                    .collect();
                self.write(&bytes);
            }
            Lie::Events => {
                for _ in 0..20 {
                    self.fault();
                }
            }
            _ if self.streams => self.stream(),
            _ => {}
        }
    }

    fn event(&mut self, event: &Event<'_>) {
        let mut frame = [0; FRAME_MAX];
        let frame = self.sender.event(event, &mut frame).unwrap().to_vec();
        self.write(&frame);
    }

    fn fault(&mut self) {
        self.event(&Event::Fault(Fault {
            kind: FaultKind::Overrun,
            sample: u64::MAX,
            part: Some(255),
        }));
    }

    fn stream(&mut self) {
        self.messages += 1;
        match self.lie {
            Lie::Jump(by) if self.messages >= 5 => self.next = self.next.saturating_add(by),
            Lie::First(first) if self.messages == 1 => self.next = first,
            Lie::Trickle => std::thread::sleep(Duration::from_millis(500)),
            _ => {}
        }
        let channels = match self.lie {
            Lie::Channels(channels) => channels,
            _ => INPUTS,
        };
        let samples = match self.lie {
            Lie::Trickle => 1,
            // As many as fit a frame.
            _ => SAMPLES.min(Samples::fit(channels.max(1), 4)),
        };
        let counts: Vec<i32> = (0..samples * usize::from(channels))
            .map(|_| self.number() as i32 % 100_000)
            .collect();
        self.event(&Event::Recorded(Samples {
            first: self.next,
            channels,
            values: Values::Counts(Packed::new(&counts)),
        }));
        self.next = self.next.wrapping_add(samples as u64);
        if self.lie == Lie::Faults {
            for _ in 0..50 {
                self.fault();
            }
        } else if self.lie == Lie::None {
            // As fast as its rate says.
            std::thread::sleep(Duration::from_secs_f64(samples as f64 / RATE));
        }
    }

    fn answer(&mut self, id: u16, request: &Request<'_>) {
        let evil = self.lie == Lie::Texts;
        let text = |sound: &'static str| if evil { EVIL } else { sound };
        let busy = match (self.lie, request) {
            (Lie::Busy, Request::Selftest | Request::Identify(_)) => return,
            (Lie::Busy, _) => Some(Request::Selftest.number()),
            _ => None,
        };
        // Texts of a certificate have 32 bytes at the most, a message without end would not fit.
        let short = |sound: &'static str| {
            if evil {
                "\u{1b}[2J\u{9b}1m\n\u{202e}"
            } else {
                sound
            }
        };
        let reply = match request {
            Request::Hello => Reply::Info(Info {
                firmware: text("massline"),
                version: env!("CARGO_PKG_VERSION"),
                build: text("test"),
                chip: text("STM32F405"),
                serial: [0; 12],
                clock: ClockSource::CrystalPll,
                clock_hz: 168_000_000,
                tick_hz: 1_000_000,
                storage: Storage::Volatile,
                reset: ResetReason::PowerOn,
                resets: 0,
                panic: evil.then_some(EVIL),
                faults: FaultCounters::default(),
                capacity: Capacity {
                    channels: 48,
                    inputs: INPUTS,
                    sensors: 48,
                    runs: 6,
                    lines: 112,
                    block_length: 1024,
                    window: 3,
                    methods: MethodSet(255),
                },
            }),
            Request::Ping(ping) => Reply::Pong(Pong {
                stamp: ping.stamp,
                ticks: 0,
                samples: 0,
            }),
            Request::Status => Reply::Status(Status {
                state: State::Empty,
                busy,
                fingerprint: None,
                running: None,
                stored: 0,
                surveyed: 0,
                answer: false,
                unsaved: false,
            }),
            Request::ReadSetting(SettingKey::Name) => Reply::Setting(Setting::Name(short("box"))),
            Request::ReadSetting(SettingKey::LinkBaud) => {
                Reply::Setting(Setting::LinkBaud(921_600))
            }
            Request::ReadSetting(SettingKey::SampleRate) => {
                Reply::Setting(Setting::SampleRate(match self.lie {
                    Lie::Rate(rate) => rate,
                    _ => RATE,
                }))
            }
            Request::ReadSetting(SettingKey::Input(input)) => {
                Reply::Setting(Setting::Input(Input {
                    input: *input,
                    circuit: Circuit::Voltage,
                    serial: short("S-1"),
                    certificate: short("K-1"),
                    calibrated: None,
                    per_count: 1e-6,
                    offset: 0.0,
                    uncertainty: 0.0,
                    gain: 1,
                    limits: [-(1 << 23), (1 << 23) - 1],
                }))
            }
            Request::SaveSettings => Reply::Saved(Saved {
                storage: Storage::Volatile,
            }),
            Request::Subscribe(wanted) => {
                self.streams = wanted.samples != Stream::Off;
                self.messages = 0;
                Reply::Done
            }
            _ => Reply::Done,
        };
        self.say(id, &reply);
    }

    fn say(&mut self, id: u16, reply: &Reply<'_>) {
        let pong = Reply::Pong(Pong {
            stamp: 0,
            ticks: 0,
            samples: 0,
        });
        let mut frame = [0; FRAME_MAX];
        let (id, reply) = match self.lie {
            Lie::Silent | Lie::Noise(_) | Lie::Events => return,
            Lie::WrongKind => (id, &pong),
            Lie::OtherId => (id.wrapping_add(1), reply),
            _ => (id, reply),
        };
        if self.lie == Lie::Restart {
            self.session += 1;
            self.sender = Sender::new(self.session);
        }
        let frame = self.sender.reply(id, reply, &mut frame).unwrap();
        let frame = match self.lie {
            Lie::HalfFrames => frame[..frame.len() / 2].to_vec(),
            Lie::ShortPayload => rewritten(frame, |body| body.truncate(body.len() - 1)),
            Lie::UnknownNumber => rewritten(frame, |body| body[1] = 0xb7),
            Lie::Version => rewritten(frame, |body| body[0] = 9),
            Lie::Repeats => frame.repeat(200),
            _ => frame.to_vec(),
        };
        if let Lie::Drip(pause) = self.lie {
            for byte in frame {
                self.write(&[byte]);
                std::thread::sleep(pause);
            }
        } else {
            self.write(&frame);
        }
    }
}

/// The frame with header and payload changed and a checksum that fits.
fn rewritten(frame: &[u8], change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut body = reference::unstuffed(&frame[1..frame.len() - 1]).unwrap();
    body.truncate(body.len() - CHECKSUM);
    change(&mut body);
    let (header, payload) = body.split_first_chunk().unwrap();
    reference::frame(header, payload)
}
