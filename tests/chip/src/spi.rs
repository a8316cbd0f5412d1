//! SPI1 to SPI3 as masters, with their requests of DMA (RM0090, 28).

use crate::{Moment, Words, flag, periods};

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SR: u32 = 0x08;
/// Offset of the data register.
pub const DR: u32 = 0x0C;

const ON: u32 = 1 << 6;
const MASTER: u32 = 1 << 2;
const WIDE: u32 = 1 << 11;
const RECEIVE_BY_DMA: u32 = 1;
const SEND_BY_DMA: u32 = 1 << 1;
const RECEIVED: u32 = 1;
const EMPTY: u32 = 1 << 1;
const OVERRUN: u32 = 1 << 6;
const BUSY: u32 = 1 << 7;

/// A word that has been exchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word {
    /// Bits that went out.
    pub out: u16,
    /// 8 or 16.
    pub bits: u32,
    /// Clock of the bus, Hz.
    pub hz: u32,
    /// Mode: polarity and phase of the clock.
    pub mode: u8,
}

/// A bus.
#[derive(Clone, Debug, Default)]
pub struct Spi {
    /// `true` if its clock is that of APB2.
    is_on_apb2: bool,
    words: Words<9>,
    received: Option<u16>,
    overrun: bool,
    waiting: Option<u16>,
    /// Word on its way, and the time at which its last bit is sampled.
    shifted: Option<(u16, u64)>,
    /// Time at which the clock of the last word has come to rest.
    rests: u64,
}

impl Spi {
    /// After a reset, on APB1 or APB2.
    #[must_use]
    pub fn new(is_on_apb2: bool) -> Self {
        Self {
            is_on_apb2,
            ..Self::default()
        }
    }

    fn cr1(&self) -> u32 {
        self.words.get(CR1)
    }

    fn hz(&self, at: &Moment<'_>) -> u32 {
        let clock = if self.is_on_apb2 {
            at.clocks.apb2
        } else {
            at.clocks.apb1
        };
        clock >> ((self.cr1() >> 3 & 7) + 1)
    }

    /// `true` if a stream is asked to take a word that was received.
    #[must_use]
    pub fn asks_to_take(&self) -> bool {
        self.received.is_some() && self.words.get(CR2) & RECEIVE_BY_DMA != 0
    }

    /// `true` if a stream is asked for a word to send.
    #[must_use]
    pub fn asks_to_give(&self) -> bool {
        self.waiting.is_none() && self.words.get(CR2) & SEND_BY_DMA != 0
    }

    /// Bits of a word.
    #[must_use]
    pub fn bits(&self) -> u32 {
        if self.cr1() & WIDE != 0 { 16 } else { 8 }
    }

    /// `true` while a word is on its way.
    #[must_use]
    pub const fn is_busy(&self, now: u64) -> bool {
        self.shifted.is_some() || self.waiting.is_some() || now < self.rests
    }

    /// Reads a register.
    pub fn read(&mut self, offset: u32, now: u64) -> u32 {
        match offset {
            SR => {
                flag(RECEIVED, self.received.is_some())
                    | flag(EMPTY, self.waiting.is_none())
                    | flag(OVERRUN, self.overrun)
                    | flag(BUSY, self.is_busy(now))
            }
            DR => {
                self.overrun = false;
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
                if self.cr1() & (ON | MASTER) != ON | MASTER {
                    at.forbid("28.3.3: a word is written while the bus is off");
                } else if self.waiting.replace(value as u16).is_some() {
                    at.forbid("28.3.7: a word is written over one that was not sent");
                }
                self.shift(at);
            }
            _ => {
                if offset == CR2 && value & (SEND_BY_DMA | RECEIVE_BY_DMA) == SEND_BY_DMA {
                    at.forbid("28.3.9: words are sent by DMA, and nothing takes the answers");
                }
                if offset == CR1 {
                    let changed = self.cr1() ^ value;
                    if changed & ON != 0 && value & ON == 0 && self.is_busy(at.now) {
                        at.forbid("28.3.8: the bus is switched off within a word");
                    }
                    if self.cr1() & ON != 0 && value & ON != 0 && changed & WIDE != 0 {
                        at.forbid("28.5.1: the width of words is changed while the bus is on");
                    }
                    if self.is_busy(at.now) && changed & 0x3F != 0 {
                        at.forbid("28.5.1: clock or mode are changed within a word");
                    }
                }
                self.words.set(offset, value);
            }
        }
    }

    fn shift(&mut self, at: &Moment<'_>) {
        if self.shifted.is_none()
            && let Some(word) = self.waiting.take()
        {
            // The last bit is sampled half a period before the clock rests, or a word follows.
            let begin = at.now.max(self.rests);
            let (halves, hz) = (u64::from(2 * self.bits()), 2 * self.hz(at));
            self.shifted = Some((word, begin + periods(halves - 1, hz)));
            self.rests = begin + periods(halves, hz);
        }
    }

    /// Time of the next event.
    #[must_use]
    pub fn next(&self) -> Option<u64> {
        self.shifted.map(|(_, ends)| ends)
    }

    /// Ends the word on its way if that is due at the latest; `exchange` gets a word from the device on
    /// the bus. The time of its end.
    pub fn end_word(
        &mut self,
        at: &mut Moment<'_>,
        exchange: impl FnOnce(Word) -> u16,
    ) -> Option<u64> {
        let (out, ends) = self.shifted.filter(|(_, ends)| *ends <= at.now)?;
        let word = Word {
            out,
            bits: self.bits(),
            hz: self.hz(at),
            mode: ((self.cr1() & 1) | (self.cr1() >> 1 & 1) << 1) as u8,
        };
        let answer = exchange(word);
        self.shifted = None;
        if self.received.is_some() {
            self.overrun = true;
            at.forbid("28.3.10: a word came while the one before had not been read");
        } else {
            self.received = Some(answer);
        }
        at.now = ends;
        self.shift(at);
        Some(ends)
    }
}
