//! GPIO: pins and their functions (RM0090, 8).

use crate::Words;

/// Number of ports, A to I.
const PORTS: usize = 9;

const MODER: u32 = 0x00;
const PUPDR: u32 = 0x0C;
const IDR: u32 = 0x10;
const ODR: u32 = 0x14;
const BSRR: u32 = 0x18;
const AFRL: u32 = 0x20;
const AFRH: u32 = 0x24;

/// A pin: port from 0 for A on, and number.
pub type Pin = (usize, u32);

/// The pin of a name such as `PB13`.
///
/// # Panics
///
/// If it is no name of a pin: names are written in tests.
#[must_use]
pub fn pin(name: &str) -> Pin {
    let (port, number) = name.strip_prefix('P').expect("a pin").split_at(1);
    let port = port.as_bytes()[0] - b'A';
    (port.into(), number.parse().expect("the number of a pin"))
}

/// The ports.
#[derive(Clone, Debug)]
pub struct Gpio {
    words: [Words<10>; PORTS],
    /// Levels that the board drives: mask and bits.
    driven: [(u32, u32); PORTS],
}

impl Default for Gpio {
    fn default() -> Self {
        Self::new()
    }
}

impl Gpio {
    /// After a reset; nothing drives a pin.
    #[must_use]
    pub fn new() -> Self {
        let mut gpio = Self {
            words: [Words::default(); PORTS],
            driven: [(0, 0); PORTS],
        };
        gpio.reset();
        gpio
    }

    /// The registers go to their initial values; the board drives what it drove.
    pub fn reset(&mut self) {
        self.words = [Words::default(); PORTS];
        // PA13 to PA15, PB3 and PB4 belong to the debugger.
        self.words[0].set(MODER, 0xA800_0000);
        self.words[0].set(PUPDR, 0x6400_0000);
        self.words[1].set(MODER, 0x0000_0280);
        self.words[1].set(PUPDR, 0x0000_0100);
    }

    fn word(&self, port: usize, offset: u32) -> u32 {
        self.words.get(port).map_or(0, |words| words.get(offset))
    }

    fn mode(&self, (port, number): Pin) -> u32 {
        self.word(port, MODER) >> (2 * number) & 3
    }

    /// Level of a pin.
    #[must_use]
    pub fn level(&self, (port, number): Pin) -> bool {
        let bit = 1 << number;
        if self.mode((port, number)) == 1 {
            return self.word(port, ODR) & bit != 0;
        }
        match self.driven.get(port) {
            Some((mask, bits)) if mask & bit != 0 => bits & bit != 0,
            _ => self.word(port, PUPDR) >> (2 * number) & 3 == 1,
        }
    }

    /// `true` if a pin is an output.
    #[must_use]
    pub fn is_output(&self, pin: Pin) -> bool {
        self.mode(pin) == 1
    }

    /// `true` if a pin has an alternate function of this number.
    #[must_use]
    pub fn has_function(&self, pin: Pin, function: u32) -> bool {
        let (port, number) = pin;
        let register = if number < 8 { AFRL } else { AFRH };
        let found = self.word(port, register) >> (4 * (number % 8)) & 0xF;
        self.mode(pin) == 2 && found == function
    }

    /// Sets the level that the board drives a pin to.
    pub fn drive(&mut self, (port, number): Pin, level: bool) {
        if let Some((mask, bits)) = self.driven.get_mut(port) {
            *mask |= 1 << number;
            *bits = *bits & !(1 << number) | u32::from(level) << number;
        }
    }

    /// Reads a register of a port.
    #[must_use]
    pub fn read(&self, port: usize, offset: u32) -> u32 {
        match offset {
            IDR => (0..16).fold(0, |bits, number| {
                bits | u32::from(self.level((port, number))) << number
            }),
            BSRR => 0,
            _ => self.word(port, offset),
        }
    }

    /// Writes a register of a port.
    pub fn write(&mut self, port: usize, offset: u32, value: u32) {
        let Some(words) = self.words.get_mut(port) else {
            return;
        };
        match offset {
            IDR => {}
            BSRR => words.set(ODR, words.get(ODR) & !(value >> 16) | value & 0xFFFF),
            _ => words.set(offset, value),
        }
    }
}
