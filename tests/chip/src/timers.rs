//! Timers: TIM2 counts freely, TIM5 interrupts periodically, TIM3 and TIM4 capture edges of pins, TIM11
//! captures the crystal (RM0090, 18 and 19).

use crate::{Moment, Words, counted, flag, periods};

const CR1: u32 = 0x00;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CCMR1: u32 = 0x18;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2C;
const CCR1: u32 = 0x34;
const CCR4: u32 = 0x40;
const OPTIONS: u32 = 0x50;

const ENABLED: u32 = 1;
const DOWN: u32 = 1 << 4;
const UPDATE: u32 = 1;
const CAPTURE: u32 = 1 << 1;
/// All captures, in DIER and SR; what was captured and not read when another came is eight bits higher.
const CAPTURES: u32 = 0xF << 1;

/// A timer.
#[derive(Clone, Debug)]
pub struct Timer {
    words: Words<{ 0x54 / 4 }>,
    /// Time at which the counter was zero, or began to count down, ps.
    since: u64,
    /// Number of captures that were read.
    captured: u64,
}

impl Timer {
    /// A timer after a reset, whose counter ends at `last`.
    #[must_use]
    pub fn new(last: u32) -> Self {
        let mut words = Words::default();
        words.set(ARR, last);
        Self {
            words,
            since: 0,
            captured: 0,
        }
    }

    fn is_on(&self) -> bool {
        self.words.get(CR1) & ENABLED != 0
    }

    fn hz(&self, clock: u32) -> u32 {
        clock / (self.words.get(PSC) + 1)
    }

    fn count(&self, now: u64, clock: u32) -> u32 {
        let period = u64::from(self.words.get(ARR)) + 1;
        let ticks = counted(now.saturating_sub(self.since), self.hz(clock)) % period;
        let ticks = if self.is_on() { ticks } else { 0 };
        match self.words.get(CR1) & DOWN {
            0 => ticks as u32,
            _ => (period - 1 - ticks) as u32,
        }
    }

    /// Counts and time of the capture of number `n`, from 1 on: every eight periods of the divided crystal.
    fn capture(&self, n: u64, at: (u32, u32)) -> (u32, u64) {
        let (clock, crystal) = at;
        let time = periods(8 * n, crystal);
        (counted(time, self.hz(clock)) as u32 & 0xFFFF, time)
    }

    /// Flags of the channels that compare. Each is set at every round of the counter, and so is taken for
    /// set while the timer is on.
    fn compared(&self) -> u32 {
        let compares = |channel: &u32| self.mode(*channel) & 0b11 == 0;
        let all = (0..4).filter(compares).filter(|_| self.is_on());
        all.fold(0, |bits, channel| bits | CAPTURE << channel)
    }

    /// Mode of a channel, from 0 on: its bits in CCMR1 or CCMR2.
    fn mode(&self, channel: u32) -> u32 {
        self.words.get(CCMR1 + 4 * (channel / 2)) >> (8 * (channel % 2)) & 0xFF
    }

    /// Number of captures so far.
    fn captures(&self, now: u64, divided_crystal: Option<u32>) -> u64 {
        let is_led = self.words.get(OPTIONS) & 3 == 2 && self.is_on();
        let crystal = divided_crystal.filter(|_| is_led);
        crystal.map_or(0, |hz| counted(now - self.since, hz) / 8)
    }

    /// Reads a register; `clock` is that of the timer, Hz.
    pub fn read(&mut self, offset: u32, clock: u32, at: &Moment<'_>) -> u32 {
        let crystal = at.clocks.divided_crystal;
        match offset {
            CNT => self.count(at.now, clock),
            SR if self.captures(at.now, crystal) > self.captured => self.words.get(SR) | CAPTURE,
            SR => self.words.get(SR) | self.compared(),
            CCR1 if crystal.is_some() && self.words.get(OPTIONS) & 3 == 2 => {
                let last = self.captures(at.now, crystal);
                self.captured = last;
                match crystal {
                    Some(crystal) if last > 0 => self.capture(last, (clock, crystal)).0,
                    _ => 0,
                }
            }
            CCR1..=CCR4 => {
                // Reading the capture clears its flag (18.4.5).
                let bit = CAPTURE << ((offset - CCR1) / 4);
                self.words.set(SR, self.words.get(SR) & !bit);
                self.words.get(offset)
            }
            _ => self.words.get(offset),
        }
    }

    /// A pin that leads to a channel, from 0 on, has changed its level at `now`, ps.
    pub fn edge(&mut self, channel: u32, level: bool, now: u64, clock: u32) {
        // Without a filter and a prescaler, from the channel's own pin (18.4.7).
        let is_direct = self.mode(channel) == 0b01;
        let enabled = self.words.get(CCER) >> (4 * channel);
        let is_wanted = match enabled & 0b1011 {
            0b0001 => level,
            0b0011 => !level,
            0b1011 => true,
            _ => false,
        };
        if !self.is_on() || !is_direct || !is_wanted {
            return;
        }
        let count = self.count(now, clock);
        self.words.set(CCR1 + 4 * channel, count);
        let (status, bit) = (self.words.get(SR), CAPTURE << channel);
        let again = flag(bit << 8, status & bit != 0);
        self.words.set(SR, status | bit | again);
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, at: &mut Moment<'_>) {
        let was_on = self.is_on();
        if offset == SR {
            // Zeros clear.
            self.words.set(SR, self.words.get(SR) & value);
            return;
        }
        self.words.set(offset, value);
        let starts = offset == CR1 && self.is_on() && !was_on;
        if starts || (offset == EGR && value & UPDATE != 0) {
            self.since = at.now;
            self.captured = 0;
        }
        if offset == EGR {
            self.words.set(EGR, 0);
        }
    }

    /// Time of the next update, ps; `None` if nobody waits for it.
    #[must_use]
    pub fn next(&self, clock: u32) -> Option<u64> {
        let waits = self.is_on() && self.words.get(DIER) & UPDATE != 0;
        waits.then(|| self.since + periods(u64::from(self.words.get(ARR)) + 1, self.hz(clock)))
    }

    /// Advances to a time.
    pub fn pass(&mut self, now: u64, clock: u32) {
        while let Some(next) = self.next(clock).filter(|next| *next <= now) {
            self.since = next;
            self.words.set(SR, self.words.get(SR) | UPDATE);
        }
    }

    /// `true` if the interrupt is asked for.
    #[must_use]
    pub fn asks(&self) -> bool {
        self.words.get(SR) & self.words.get(DIER) & (UPDATE | CAPTURES) != 0
    }
}
