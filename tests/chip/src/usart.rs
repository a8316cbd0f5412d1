//! USART2: the link, a byte at a time (RM0090, 30).

use std::collections::VecDeque;

use crate::{Moment, SECOND, Words, flag, periods};

const SR: u32 = 0x00;
const DR: u32 = 0x04;
const BRR: u32 = 0x08;
const CR1: u32 = 0x0C;

const OVERRUN: u32 = 1 << 3;
const RECEIVED: u32 = 1 << 5;
const COMPLETE: u32 = 1 << 6;
const EMPTY: u32 = 1 << 7;

const RECEIVER: u32 = 1 << 2;
const TRANSMITTER: u32 = 1 << 3;
const ON: u32 = 1 << 13;

/// The port, and the line to its host.
#[derive(Clone, Debug)]
pub struct Usart {
    words: Words<7>,
    received: Option<u8>,
    overrun: bool,
    /// Byte that waits for the shift register.
    waiting: Option<u8>,
    /// Byte in the shift register, and the time of its end.
    shifted: Option<(u8, u64)>,
    /// Bytes from the host that are on their way, and the end of the first one.
    incoming: VecDeque<u8>,
    arrives: Option<u64>,
    /// Bytes that have reached the host.
    pub sent: VecDeque<u8>,
    /// Bytes that came while the one before had not been read.
    pub lost: u64,
    /// Bit rate of the host.
    pub baud: u32,
}

impl Usart {
    /// After a reset, with a host at a bit rate.
    #[must_use]
    pub fn new(baud: u32) -> Self {
        Self {
            words: Words::default(),
            received: None,
            overrun: false,
            waiting: None,
            shifted: None,
            incoming: VecDeque::new(),
            arrives: None,
            sent: VecDeque::new(),
            lost: 0,
            baud,
        }
    }

    /// The registers go to their initial values; the line stays.
    pub fn reset(&mut self) {
        self.words = Words::default();
        (self.received, self.waiting, self.shifted) = (None, None, None);
        self.overrun = false;
    }

    fn status(&self) -> u32 {
        flag(OVERRUN, self.overrun)
            | flag(RECEIVED, self.received.is_some())
            | flag(EMPTY, self.waiting.is_none())
            | flag(COMPLETE, self.waiting.is_none() && self.shifted.is_none())
    }

    fn is_on(&self, part: u32) -> bool {
        self.words.get(CR1) & (ON | part) == ON | part
    }

    /// Bytes from the host, from now on.
    pub fn send(&mut self, bytes: &[u8], now: u64) {
        if self.incoming.is_empty() && !bytes.is_empty() {
            self.arrives = Some(now + self.byte());
        }
        self.incoming.extend(bytes);
    }

    /// Time of ten bits at the host's rate.
    fn byte(&self) -> u64 {
        10 * SECOND / u64::from(self.baud)
    }

    /// Reads a register.
    pub fn read(&mut self, offset: u32, at: &mut Moment<'_>) -> u32 {
        match offset {
            SR => self.status(),
            DR => {
                let ends_overrun = std::mem::take(&mut self.overrun);
                if self.received.is_none() && !ends_overrun {
                    at.forbid("30.6.2: the port is read without a byte in it");
                }
                self.received.take().unwrap_or(0).into()
            }
            _ => self.words.get(offset),
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, at: &mut Moment<'_>) {
        match offset {
            SR => {}
            DR => {
                if !self.is_on(TRANSMITTER) {
                    at.forbid("30.3.2: a byte is sent while the transmitter is off");
                } else if self.waiting.replace(value as u8).is_some() {
                    at.forbid("30.3.2: a byte is written over one that was not sent");
                }
                self.shift(at);
            }
            _ => {
                self.words.set(offset, value);
                if offset == BRR {
                    self.check(at);
                }
            }
        }
    }

    fn shift(&mut self, at: &Moment<'_>) {
        if self.shifted.is_none()
            && let Some(byte) = self.waiting.take()
        {
            let bits = periods(10 * u64::from(self.words.get(BRR)), at.clocks.apb1);
            self.shifted = Some((byte, at.now + bits));
        }
    }

    fn check(&self, at: &mut Moment<'_>) {
        let baud = f64::from(at.clocks.apb1) / f64::from(self.words.get(BRR).max(1));
        let off = baud / f64::from(self.baud) - 1.0;
        // Half of what ten bits bear, for the other half is the host's.
        if off.abs() > 0.025 {
            at.forbid(format!(
                "30.3.4: {baud:.0} bit/s, the host has {}",
                self.baud
            ));
        }
    }

    /// Time of the next event.
    #[must_use]
    pub fn next(&self) -> Option<u64> {
        let sent = self.shifted.map(|(_, ends)| ends);
        sent.into_iter().chain(self.arrives).min()
    }

    /// Advances to a time.
    pub fn pass(&mut self, at: &mut Moment<'_>) {
        let now = at.now;
        while let Some((byte, ends)) = self.shifted.filter(|(_, ends)| *ends <= now) {
            self.sent.push_back(byte);
            self.shifted = None;
            at.now = ends;
            self.shift(at);
        }
        at.now = now;
        while let Some(time) = self.arrives.filter(|time| *time <= now) {
            let byte = self.incoming.pop_front();
            self.arrives = (!self.incoming.is_empty()).then(|| time + self.byte());
            if !self.is_on(RECEIVER) {
                continue;
            }
            if self.received.is_some() {
                self.overrun = true;
                self.lost += 1;
            } else {
                self.received = byte;
            }
        }
    }

    /// `true` if the interrupt is asked for.
    #[must_use]
    pub fn asks(&self) -> bool {
        let enabled = self.words.get(CR1);
        let mut status = self.status();
        if self.overrun {
            status |= RECEIVED;
        }
        // The bits that enable an interrupt lie where its flag does.
        enabled & ON != 0 && status & enabled & (RECEIVED | COMPLETE | EMPTY) != 0
    }
}
