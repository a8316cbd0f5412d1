//! The ADS131M08 at the level of its registers (data sheet SBAS950B).
//!
//! Modelled: all registers with their masks and reset values, NULL, RESET, STANDBY, WAKEUP,
//! LOCK, UNLOCK, RREG and WREG with their answers in the next frame, the checksums of both
//! directions, a write that is executed before its checksum is received, the event bits of the
//! status word and their clearing, two samples of buffer, amplifiers, inputs, offset and gain
//! correction, clipping, the range of the inputs (6.3), the pass of the register map's check (8.3.13),
//! noise of the test signals.
//! Not modelled: word lengths other than 24 bits, ANSI's checksum, global
//! chop, current detection, phase delays, the DC block filter, noise of the pins.

use crate::drivers::ads131m08::frame::{self, BYTES, BYTES_MAX, WORD, put, word};
use crate::drivers::ads131m08::registers::{CHANNELS, Register, command, mode, status};
use crate::drivers::ads131m08::{CLOCK_HZ, Oversampling};
use crate::models::random::Random;

/// Reference voltage, V: full scale at gain 1.
const REFERENCE: f64 = 1.2;
/// The test signals at gain 1, V.
const TEST: f64 = 0.16;
/// Counts of full scale.
const FULL_SCALE: f64 = (1 << 23) as f64;
/// Analog supply, V.
const SUPPLY: f64 = 3.3;
/// Distance of the inputs from the supply, V, from a gain of 8 on (6.3).
const HEADROOM: f64 = 1.8;
/// Cycles until the check of the register map has seen a change (8.3.13): what is left of the pass that
/// is going on, and another one of 90 µs.
const MAP_CYCLES: u64 = CLOCK_HZ as u64 * 180 / 1_000_000;
/// Largest of two errors whose sum is the noise of a test signal, counts: 17 counts RMS, which are 2.4 µV at
/// gain 1.
const NOISE: u64 = 21;
/// Samples that wait to be read.
const BUFFER: usize = 2;

/// The chip.
#[derive(Clone, Debug)]
pub struct Chip {
    registers: [u16; 64],
    /// Event bits of the status word, cleared when read.
    events: u16,
    locked: bool,
    running: bool,
    answer: Answer,
    /// Samples, the newest first.
    samples: [[i32; CHANNELS]; BUFFER],
    waiting: usize,
    /// `true` if a sample waited when the frame began.
    is_sent: bool,
    /// Voltage between ground and the middle of each channel's two inputs, V.
    common_mode: [f64; CHANNELS],
    /// Noise of the test signals.
    noise: Random,
    /// The present cycle of the clock.
    cycle: u64,
    /// Cycle at which the check of the register map sees the last change.
    seen: Option<u64>,
}

/// Answer at the beginning of the next frame.
#[derive(Clone, Copy, Debug)]
enum Answer {
    Status,
    Word(u16),
    Registers { first: Register, count: u16 },
}

impl Default for Chip {
    fn default() -> Self {
        Self::new()
    }
}

impl Chip {
    /// The chip after it was switched on.
    #[must_use]
    pub fn new() -> Self {
        let mut chip = Self {
            registers: [0; 64],
            events: 0,
            locked: false,
            running: true,
            answer: Answer::Status,
            samples: [[0; CHANNELS]; BUFFER],
            waiting: 0,
            is_sent: false,
            common_mode: [0.0; CHANNELS],
            noise: Random::new(0x131),
            cycle: 0,
            seen: None,
        };
        chip.reset();
        chip
    }

    /// A reset: by the pin, by command, or by the supply.
    pub fn reset(&mut self) {
        for (address, slot) in (0..).zip(&mut self.registers) {
            *slot = Register(address).after_reset();
        }
        self.events = status::RESET;
        self.locked = false;
        self.running = true;
        self.answer = Answer::Word(command::RESET_DONE);
        self.waiting = 0;
        self.seen = None;
    }

    /// Advances the time to a cycle of the clock.
    pub fn pass_until(&mut self, cycle: u64) {
        self.cycle = cycle;
        if self.seen.take_if(|at| *at <= cycle).is_some() {
            self.events |= status::REG_MAP;
        }
    }

    /// Sets the voltage between ground and the middle of a channel's two inputs, V.
    pub fn set_common_mode(&mut self, channel: usize, volts: f64) {
        if let Some(slot) = self.common_mode.get_mut(channel) {
            *slot = volts;
        }
    }

    /// The conversions are restarted.
    pub fn synchronise(&mut self) {
        self.events |= status::F_RESYNC;
    }

    /// `true` if DRDY is low: a sample waits to be read.
    #[must_use]
    pub const fn is_ready(&self) -> bool {
        self.waiting > 0
    }

    /// Cycles of the clock from one sample to the next.
    #[must_use]
    pub fn cycles(&self) -> u32 {
        let code = usize::from(self.register(Register::CLOCK) >> 2 & 0b111);
        Oversampling::ALL
            .get(code)
            .map_or(Oversampling::X1024.cycles(), |o| o.cycles())
    }

    /// Content of a register.
    #[must_use]
    pub fn register(&self, register: Register) -> u16 {
        match register {
            Register::STATUS => self.status(),
            Register(address) => self
                .registers
                .get(usize::from(address))
                .copied()
                .unwrap_or(0),
        }
    }

    /// Changes a register without a command.
    pub fn set_register(&mut self, register: Register, value: u16) {
        let kept = value & register.mask();
        let is_watched = self.register(Register::MODE) & mode::REG_CRC_EN != 0;
        if register.mask() != 0
            && let Some(slot) = self.registers.get_mut(usize::from(register.0))
        {
            if *slot != kept && is_watched {
                self.seen = Some(self.cycle + MAP_CYCLES);
            }
            *slot = kept;
        }
        if register == Register::MODE && value & mode::RESET == 0 {
            self.events &= !status::RESET;
        }
    }

    /// Converts the voltages at the pins, V.
    pub fn convert(&mut self, volts: &[f64; CHANNELS]) {
        if !self.running {
            return;
        }
        let mut counts = [0; CHANNELS];
        for (k, (slot, &volts)) in (0..).zip(counts.iter_mut().zip(volts)) {
            *slot = self.count(k, volts);
            if self.register(Register::channel_cfg(k)) & 0b11 != 0 {
                let [a, b] = [0; 2].map(|_| self.noise.below(2 * NOISE + 1) as i32);
                *slot += a + b - 2 * NOISE as i32;
            }
        }
        let [newest, older] = &mut self.samples;
        *older = *newest;
        *newest = counts;
        self.waiting = (self.waiting + 1).min(BUFFER);
    }

    /// The count of a channel at a voltage.
    #[must_use]
    pub fn count(&self, channel: u8, volts: f64) -> i32 {
        let gains = match channel {
            0..4 => Register::GAIN1,
            _ => Register::GAIN2,
        };
        let code = self.register(gains) >> (4 * (channel % 4)) & 0b111;
        let gain = f64::from(1_u8 << code);
        let volts = match self.register(Register::channel_cfg(channel)) & 0b11 {
            0 => {
                let room = if gain >= 8.0 {
                    SUPPLY - HEADROOM
                } else {
                    SUPPLY
                };
                let middle = self.common_mode.get(usize::from(channel)).copied();
                let [p, n] = [0.5, -0.5].map(|half| middle.unwrap_or(0.0) + half * volts);
                p.min(room) - n.min(room)
            }
            1 => 0.0,
            2 => TEST / gain,
            _ => -TEST / gain,
        };
        let two = |msb: Register| {
            let [high, middle] = self.register(msb).to_be_bytes();
            let [low, _] = self.register(Register(msb.0 + 1)).to_be_bytes();
            [high, middle, low]
        };
        let offset = frame::count(two(Register::offset_msb(channel)));
        let [high, middle, low] = two(Register::gain_msb(channel));
        let correction = u32::from_be_bytes([0, high, middle, low]);
        let clip = |counts: f64| libm::round(counts).clamp(-FULL_SCALE, FULL_SCALE - 1.0);
        let raw = clip(volts * gain / REFERENCE * FULL_SCALE);
        if correction == 0x80_0000 {
            return clip(raw - f64::from(offset)) as i32;
        }
        clip((raw - f64::from(offset)) * f64::from(correction) / FULL_SCALE) as i32
    }

    /// Exchanges a frame: the received bytes are replaced by the answer.
    pub fn transfer(&mut self, bytes: &mut [u8]) {
        let out = self.select();
        self.release(bytes);
        for (slot, byte) in bytes.iter_mut().zip(out) {
            *slot = byte;
        }
    }

    /// Begins a frame: the chip select has fallen. The bytes that will be sent.
    pub fn select(&mut self) -> [u8; BYTES_MAX] {
        let mut out = [0; BYTES_MAX];
        self.is_sent = self.is_ready();
        self.send(&mut out);
        out
    }

    /// Ends a frame with the bytes that came: the chip select has risen.
    pub fn release(&mut self, bytes: &[u8]) {
        if bytes.len() >= BYTES {
            // All data were shifted out. A sample that came meanwhile was not among them.
            self.waiting = self.waiting.saturating_sub(self.is_sent.into());
        }
        self.receive(bytes);
    }

    fn status(&self) -> u16 {
        let word_length = self.register(Register::MODE) & status::WLENGTH;
        let lock = if self.locked { status::LOCK } else { 0 };
        let ready = if self.is_ready() { status::DRDY } else { 0 };
        self.events | word_length | lock | ready
    }

    fn send(&mut self, out: &mut [u8]) {
        let mut words = out.chunks_exact_mut(WORD);
        let mut append = |value: u16| {
            if let Some(slot) = words.next() {
                put(slot, value);
            }
        };
        let covered = match self.answer {
            Answer::Registers { first, count } => {
                append(command::read_done(first, count));
                for k in 0..count {
                    append(self.register(Register(first.0.saturating_add(k as u8))));
                }
                usize::from(count) + 1
            }
            Answer::Status | Answer::Word(_) => {
                let word = match self.answer {
                    Answer::Word(word) => word,
                    _ => {
                        let status = self.status();
                        self.events &= status::RESET;
                        status
                    }
                };
                append(word);
                let oldest = self.waiting.saturating_sub(1);
                let sample = self.samples.get(oldest).copied().unwrap_or_default();
                for (slot, count) in words.by_ref().zip(sample) {
                    let [_, rest @ ..] = count.to_be_bytes();
                    slot.copy_from_slice(&rest);
                }
                CHANNELS + 1
            }
        };
        let checksum = out.get(..covered * WORD).map_or(0, frame::crc);
        if let Some(slot) = out.get_mut(covered * WORD..(covered + 1) * WORD) {
            put(slot, checksum);
        }
    }

    fn receive(&mut self, bytes: &[u8]) {
        let request = word(bytes, 0);
        let (first, count) = (Register((request >> 7 & 0x3F) as u8), (request & 0x7F) + 1);
        let is_write = request & 0xE000 == 0x6000;
        let words = 1 + if is_write { usize::from(count) } else { 0 };

        let checked = self.register(Register::MODE) & mode::RX_CRC_EN != 0;
        let body = bytes.get(..words * WORD).unwrap_or(bytes);
        let garbled = checked && frame::crc(body) != word(bytes, words);

        self.answer = Answer::Status;
        let read = request & 0xE000 == 0xA000;
        let allowed = !self.locked || read || request == command::UNLOCK;
        match request {
            _ if garbled && !is_write => {}
            _ if !allowed => {}
            command::RESET if bytes.len() >= BYTES => self.reset(),
            command::STANDBY | command::WAKEUP => {
                self.running = request == command::WAKEUP;
                self.answer = Answer::Word(request);
            }
            command::LOCK | command::UNLOCK => {
                self.locked = request == command::LOCK;
                self.answer = Answer::Word(request);
            }
            _ if read && count == 1 => self.answer = Answer::Word(self.register(first)),
            _ if read => self.answer = Answer::Registers { first, count },
            _ if is_write => {
                for k in 0..count {
                    let register = Register(first.0.saturating_add(k as u8));
                    self.set_register(register, word(bytes, usize::from(k) + 1));
                }
                self.answer = Answer::Word(command::write_done(first, count));
            }
            _ => {}
        }
        if garbled {
            self.events |= status::CRC_ERR;
            self.answer = Answer::Status;
        }
    }
}
