//! SYSCFG and EXTI: interrupts by edges of pins (RM0090, 9 and 12).

use crate::Words;
use crate::gpio::Pin;

const IMR: u32 = 0x00;
const RISING: u32 = 0x08;
const FALLING: u32 = 0x0C;
const SOFTWARE: u32 = 0x10;
const PENDING: u32 = 0x14;

/// Number of the interrupt of lines 5 to 9.
pub const LINES_5_TO_9: u16 = 23;

/// The registers.
#[derive(Clone, Debug, Default)]
pub struct Exti {
    words: Words<6>,
    /// Port of each line.
    sources: [u32; 4],
    pending: u32,
}

impl Exti {
    /// Reads a register of EXTI.
    #[must_use]
    pub fn read(&self, offset: u32) -> u32 {
        match offset {
            PENDING => self.pending,
            _ => self.words.get(offset),
        }
    }

    /// Writes a register of EXTI.
    pub fn write(&mut self, offset: u32, value: u32) {
        if offset == PENDING {
            self.pending &= !value;
            return;
        }
        if offset == SOFTWARE {
            self.pending |= value & self.read(IMR);
        }
        self.words.set(offset, value);
    }

    /// Reads a register of SYSCFG.
    #[must_use]
    pub fn read_source(&self, offset: u32) -> u32 {
        let at = (offset as usize / 4).wrapping_sub(2);
        self.sources.get(at).copied().unwrap_or(0)
    }

    /// Writes a register of SYSCFG.
    pub fn write_source(&mut self, offset: u32, value: u32) {
        if let Some(word) = self.sources.get_mut((offset as usize / 4).wrapping_sub(2)) {
            *word = value & 0xFFFF;
        }
    }

    /// A pin has changed its level.
    pub fn edge(&mut self, (port, number): Pin, level: bool) {
        let source = self.sources[number as usize / 4] >> (4 * (number % 4)) & 0xF;
        let edges = self.read(if level { RISING } else { FALLING });
        if source as usize == port && edges >> number & 1 != 0 {
            self.pending |= 1 << number;
        }
    }

    /// `true` if the interrupt of lines 5 to 9 is asked for.
    #[must_use]
    pub fn asks(&self) -> bool {
        self.pending & self.read(IMR) & 0x3E0 != 0
    }
}
