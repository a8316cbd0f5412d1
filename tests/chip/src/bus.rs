//! The registers by their addresses, and the interrupts (RM0090, 2.3 and 12.2).

use std::sync::Arc;

use massline_firmware::models::random::Random;
use rsemu::core::space::RamStore;

use crate::bench::{BUSES, Bench};
use crate::dma::Dma;
use crate::flash::{Cells, Flash};
use crate::gpio::{Gpio, Pin, pin};
use crate::rcc::{Oscillators, Rcc, Reset};
use crate::spi::Spi;
use crate::timers::Timer;
use crate::usart::Usart;
use crate::watchdog::Watchdog;
use crate::{Moment, Words, flash, spi};

/// Register of RCC and bit in it that switch a peripheral's clock on.
type Enable = (u32, u32);

/// A block of registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Block {
    Timer(usize),
    Watchdog,
    Power,
    Spi(usize),
    Usart,
    Port(usize),
    Rcc,
    Flash,
    Dma(usize),
    Debug,
}

/// The block at an address, its first address, and the switch of its clock.
fn block(address: u32) -> Option<(Block, u32, Option<Enable>)> {
    const AHB1: u32 = 0x30;
    const APB1: u32 = 0x40;
    const APB2: u32 = 0x44;
    let base = address & !0x3FF;
    let (block, enable) = match base {
        0x4000_0000 => (Block::Timer(0), Some((APB1, 0))),
        0x4000_0400 => (Block::Timer(3), Some((APB1, 1))),
        0x4000_0800 => (Block::Timer(4), Some((APB1, 2))),
        0x4000_0C00 => (Block::Timer(1), Some((APB1, 3))),
        0x4000_3000 => (Block::Watchdog, None),
        0x4000_3800 => (Block::Spi(0), Some((APB1, 14))),
        0x4000_3C00 => (Block::Spi(1), Some((APB1, 15))),
        0x4000_4400 => (Block::Usart, Some((APB1, 17))),
        0x4000_7000 => (Block::Power, Some((APB1, 28))),
        0x4001_3000 => (Block::Spi(2), Some((APB2, 12))),
        0x4001_4800 => (Block::Timer(2), Some((APB2, 18))),
        0x4002_0000..=0x4002_2000 => {
            let port = (base - 0x4002_0000) / 0x400;
            (Block::Port(port as usize), Some((AHB1, port)))
        }
        0x4002_3800 => (Block::Rcc, None),
        0x4002_3C00 => (Block::Flash, None),
        0x4002_6000 => (Block::Dma(0), Some((AHB1, 21))),
        0x4002_6400 => (Block::Dma(1), Some((AHB1, 22))),
        0xE004_2000 => (Block::Debug, None),
        _ => return None,
    };
    Some((block, base, enable))
}

/// Numbers of the interrupts of the timers that ask for any, in the order of [`Chip::timers`].
const TIMERS: [(usize, u16); 4] = [(0, 28), (1, 50), (3, 29), (4, 30)];
const USART: u16 = 38;
/// Number of interrupts: those and the streams'.
pub const INTERRUPTS: usize = 5 + 16;
/// Timer, channel from 0 on, and pin of each capture, by function 2 (data sheet, table 9).
const CAPTURES: [(usize, u32, &str); 4] =
    [(3, 0, "PC6"), (3, 1, "PC7"), (4, 2, "PB8"), (4, 3, "PB9")];
/// Numbers of the buses' SPI.
const SPI_NUMBERS: [usize; BUSES] = [2, 3, 1];

/// The timers after a reset: TIM2 and TIM5 have 32 bits.
fn timers() -> [Timer; 5] {
    [u32::MAX, u32::MAX, 0xFFFF, 0xFFFF, 0xFFFF].map(Timer::new)
}

/// The buses after a reset.
fn buses() -> [Spi; BUSES] {
    SPI_NUMBERS.map(|number| Spi::new(number == 1))
}

/// The chip without its processor, on its board.
pub struct Chip {
    /// Time, ps.
    pub now: u64,
    /// Accesses that the manual forbids.
    pub forbidden: Vec<String>,
    /// The link's port.
    pub usart: Usart,
    /// The flash.
    pub flash: Flash,
    /// The board's parts.
    pub bench: Bench,
    /// The watchdog.
    pub watchdog: Watchdog,
    rcc: Rcc,
    gpio: Gpio,
    /// TIM2, TIM5, TIM11, TIM3, TIM4.
    timers: [Timer; 5],
    /// Pins of [`CAPTURES`].
    capture_pins: [Pin; 4],
    /// SPI2, SPI3, SPI1: in the order of the board's buses.
    spi: [Spi; BUSES],
    /// The controllers of DMA.
    pub dma: [Dma; 2],
    power: Words<2>,
    debug: Words<4>,
}

impl Chip {
    /// The supply has come.
    #[must_use]
    pub fn new(
        cells: Cells,
        oscillators: Oscillators,
        bench: Bench,
        baud: u32,
        sram: &Arc<RamStore>,
    ) -> Self {
        Self {
            now: 0,
            forbidden: Vec::new(),
            usart: Usart::new(baud),
            flash: Flash::new(cells),
            bench,
            watchdog: Watchdog::default(),
            rcc: Rcc::new(oscillators),
            gpio: Gpio::new(),
            timers: timers(),
            capture_pins: CAPTURES.map(|(.., name)| pin(name)),
            spi: buses(),
            dma: [1, 2].map(|number| Dma::new(number, Arc::clone(sram))),
            power: power(),
            debug: debug(),
        }
    }

    /// Level of a pin, `true` where it is high.
    #[must_use]
    pub fn level(&self, pin: Pin) -> bool {
        self.gpio.level(pin)
    }

    /// A reset of the chip, which the board does not notice.
    pub fn reset(&mut self, cause: Reset, random: &mut Random) {
        self.usart.reset();
        let flash = std::mem::replace(&mut self.flash, Flash::new(Cells::default()));
        self.flash = flash.reset(random);
        self.watchdog = Watchdog::default();
        self.rcc.reset(cause);
        self.gpio.reset();
        self.timers = timers();
        self.spi = buses();
        self.dma.iter_mut().for_each(Dma::reset);
        self.power = power();
        self.look();
    }

    /// Clock of the processor, Hz.
    #[must_use]
    pub fn core_hz(&self) -> u32 {
        self.rcc.clocks(self.now).core
    }

    fn look(&mut self) {
        let now = self.now;
        let is_busy = self.spi.each_ref().map(|bus| bus.is_busy(now));
        let wrong = self.bench.look(&self.gpio, is_busy, self.now);
        let mut at = moment(&self.rcc, self.now, &mut self.forbidden);
        wrong.into_iter().for_each(|words| at.forbid(words));
        self.drive(self.now, |_| true);
    }

    /// Levels of these DRDY lines that have changed reach their pins at a time, ps.
    fn drive(&mut self, at: u64, is_meant: impl Fn(Pin) -> bool) {
        let ready: Vec<_> = self.bench.ready().collect();
        for (pin, level) in ready {
            if is_meant(pin) && self.gpio.level(pin) != level {
                self.gpio.drive(pin, level);
                self.capture(pin, level, at);
            }
        }
    }

    /// The timer whose channel a pin leads to, if it has that function, sees the pin's new level.
    fn capture(&mut self, pin: Pin, level: bool, at: u64) {
        let clock = self.rcc.clocks(at).timers1;
        for ((timer, channel, _), place) in CAPTURES.into_iter().zip(self.capture_pins) {
            if place == pin && self.gpio.has_function(pin, 2) {
                self.timers[timer].edge(channel, level, at, clock);
            }
        }
    }

    /// Time of the next event, ps.
    #[must_use]
    pub fn next(&self) -> u64 {
        let clocks = self.rcc.clocks(self.now);
        let events = [
            self.usart.next(),
            self.spi[0].next(),
            self.spi[1].next(),
            self.spi[2].next(),
            self.timers[1].next(clocks.timers1),
            self.flash.busy_until(),
            self.watchdog.ends,
            Some(self.bench.next()),
        ];
        events.into_iter().flatten().min().unwrap_or(u64::MAX)
    }

    /// Advances to a time.
    pub fn pass(&mut self, now: u64) {
        self.now = now;
        let fallen = self.bench.pass(now);
        for (pin, _) in &fallen {
            // A new conversion raises the line before it falls, whether the last was read or not.
            self.gpio.drive(*pin, true);
        }
        for (pin, at) in fallen {
            self.drive(at, |changed| changed == pin);
        }
        self.drive(now, |_| true);
        self.flash.pass(now);
        let clocks = self.rcc.clocks(now);
        self.timers[1].pass(now, clocks.timers1);
        let mut at = moment(&self.rcc, now, &mut self.forbidden);
        self.usart.pass(&mut at);
        for number in 0..BUSES {
            while let Some(ended) = self.end_word(number) {
                self.serve(number, ended);
            }
        }
    }

    /// Ends a bus's word that is due: the time of its end.
    fn end_word(&mut self, number: usize) -> Option<u64> {
        let mut at = moment(&self.rcc, self.now, &mut self.forbidden);
        let (bench, gpio) = (&mut self.bench, &self.gpio);
        let mut wrong = None;
        let ended = self.spi[number].end_word(&mut at, |word| {
            let (answer, words) = bench.exchange(number, word, gpio);
            wrong = words;
            answer
        });
        if let Some(words) = wrong {
            at.forbid(words);
        }
        ended
    }

    /// Serves a bus's requests of DMA at a time.
    fn serve(&mut self, number: usize, now: u64) {
        let name = SPI_NUMBERS[number];
        let mut at = moment(&self.rcc, now, &mut self.forbidden);
        let bus = &mut self.spi[number];
        for dma in &mut self.dma {
            let bits = bus.bits();
            if bus.asks_to_take() {
                dma.take(name, bits, || bus.read(spi::DR, now) as u16, &mut at);
            }
            while bus.asks_to_give()
                && let Some(word) = dma.give(name, bits, &mut at)
            {
                bus.write(spi::DR, word.into(), &mut at);
            }
        }
    }

    /// Interrupts and whether they are asked for.
    #[must_use]
    pub fn interrupts(&self) -> [(u16, bool); INTERRUPTS] {
        let timers = TIMERS.map(|(timer, number)| (number, self.timers[timer].asks()));
        let mut all = timers
            .into_iter()
            .chain([(USART, self.usart.asks())])
            .chain(self.dma.iter().flat_map(Dma::interrupts));
        std::array::from_fn(|_| all.next().expect("so many"))
    }

    /// Reads registers; `None` where there are none.
    pub fn read(&mut self, address: u32) -> Option<u32> {
        let (block, base, enable) = block(address)?;
        let offset = (address - base) & !3;
        let mut at = moment(&self.rcc, self.now, &mut self.forbidden);
        if let Some(enable) = enable.filter(|enable| !self.rcc.is_enabled(*enable)) {
            at.forbid(format!(
                "{address:#010x} is read, and its clock is off ({enable:x?})"
            ));
            return Some(0);
        }
        let clocks = at.clocks;
        Some(match block {
            Block::Timer(n) => {
                let clock = if n == 2 {
                    clocks.timers2
                } else {
                    clocks.timers1
                };
                self.timers[n].read(offset, clock, &at)
            }
            Block::Watchdog => self.watchdog.read(offset),
            Block::Power => self.power.get(offset),
            Block::Spi(n) => self.spi[n].read(offset, self.now),
            Block::Usart => self.usart.read(offset, &mut at),
            Block::Port(n) => self.gpio.read(n, offset),
            Block::Rcc => self.rcc.read(offset, self.now),
            Block::Flash => self.flash.read(offset),
            Block::Dma(n) => self.dma[n].read(offset),
            Block::Debug => self.debug.get(offset),
        })
    }

    /// Writes a register; `false` where there is none.
    pub fn write(&mut self, address: u32, value: u32) -> bool {
        let Some((block, base, enable)) = block(address) else {
            return false;
        };
        let offset = (address - base) & !3;
        let mut at = moment(&self.rcc, self.now, &mut self.forbidden);
        if let Some(enable) = enable.filter(|enable| !self.rcc.is_enabled(*enable)) {
            at.forbid(format!(
                "{address:#010x} is written, and its clock is off ({enable:x?})"
            ));
            return true;
        }
        match block {
            Block::Timer(n) => self.timers[n].write(offset, value, &mut at),
            Block::Watchdog => self.watchdog.write(offset, value, &mut at),
            Block::Power => self.power.set(offset, value),
            Block::Spi(n) => {
                self.spi[n].write(offset, value, &mut at);
                self.serve(n, self.now);
            }
            Block::Dma(n) => {
                self.dma[n].write(offset, value, &mut at);
                (0..BUSES).for_each(|bus| self.serve(bus, self.now));
            }
            Block::Usart => self.usart.write(offset, value, &mut at),
            Block::Port(n) => {
                self.gpio.write(n, offset, value);
                self.look();
            }
            Block::Rcc => {
                let clocks = self.rcc.clocks(self.now);
                let mut at = Moment {
                    now: self.now,
                    clocks,
                    forbidden: &mut self.forbidden,
                };
                let states = self.flash.wait_states();
                let resets = self.rcc.write(offset, value, states, &mut at);
                self.reset_blocks(offset, resets);
            }
            Block::Flash => self.flash.write(offset, value, &mut at),
            Block::Debug => self.debug.set(offset, value),
        }
        true
    }

    /// Resets of peripherals by RCC's registers: those of APB1 and APB2.
    fn reset_blocks(&mut self, offset: u32, bits: u32) {
        const AHB1: u32 = 0x10;
        const APB1: u32 = 0x20;
        const APB2: u32 = 0x24;
        for bit in (0..32).filter(|bit| bits >> bit & 1 != 0) {
            match (offset, bit) {
                (APB1, 0) => self.timers[0] = Timer::new(u32::MAX),
                (APB1, 1) => self.timers[3] = Timer::new(0xFFFF),
                (APB1, 2) => self.timers[4] = Timer::new(0xFFFF),
                (APB1, 3) => self.timers[1] = Timer::new(u32::MAX),
                (AHB1, 21) => self.dma[0].reset(),
                (AHB1, 22) => self.dma[1].reset(),
                (APB1, 14) => self.spi[0] = Spi::new(false),
                (APB1, 15) => self.spi[1] = Spi::new(false),
                (APB2, 12) => self.spi[2] = Spi::new(true),
                (APB1, 17) => self.usart.reset(),
                _ => {}
            }
        }
    }

    /// Reads data of the settings' sectors; `offset` is from their first byte on.
    pub fn load(&mut self, offset: u32, bytes: &mut [u8]) {
        if !self.flash.load(offset, bytes) {
            let mut at = moment(&self.rcc, self.now, &mut self.forbidden);
            at.forbid("3.5.2: data come from a line of the cache that an erase has made stale");
        }
    }

    /// Programs the settings' sectors.
    pub fn store(&mut self, offset: u32, bytes: &[u8]) {
        let mut at = moment(&self.rcc, self.now, &mut self.forbidden);
        self.flash.store(offset, bytes, &mut at);
    }
}

const _: () = assert!(flash::SETTINGS.start.is_multiple_of(0x400));

fn moment<'a>(rcc: &Rcc, now: u64, forbidden: &'a mut Vec<String>) -> Moment<'a> {
    Moment {
        now,
        clocks: rcc.clocks(now),
        forbidden,
    }
}

/// PWR after a reset: the scale of the regulator for 168 MHz.
fn power() -> Words<2> {
    let mut words = Words::default();
    words.set(0, 0x0000_C000);
    words
}

/// DBGMCU: the chip's identity.
fn debug() -> Words<4> {
    let mut words = Words::default();
    words.set(0, 0x1007_6413);
    words
}
