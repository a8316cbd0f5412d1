//! IWDG: the independent watchdog (RM0090, 21).

use crate::rcc::LSI;
use crate::{Moment, periods};

/// The registers.
#[derive(Clone, Debug)]
pub struct Watchdog {
    prescaler: u32,
    reload: u32,
    is_open: bool,
    /// Time at which it resets the chip; `None` before it is started.
    pub ends: Option<u64>,
}

impl Default for Watchdog {
    fn default() -> Self {
        Self {
            prescaler: 0,
            reload: 0xFFF,
            is_open: false,
            ends: None,
        }
    }
}

impl Watchdog {
    /// Reads a register.
    #[must_use]
    pub const fn read(&self, offset: u32) -> u32 {
        match offset {
            4 => self.prescaler,
            8 => self.reload,
            _ => 0,
        }
    }

    fn fed(&mut self, now: u64) {
        let divider = 4_u64 << self.prescaler.min(6);
        let cycles = (u64::from(self.reload) + 1) * divider;
        self.ends = Some(now + periods(cycles, LSI));
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, at: &mut Moment<'_>) {
        match (offset, value) {
            (0, 0x5555) => self.is_open = true,
            (0, 0xAAAA) => {
                self.is_open = false;
                if self.ends.is_some() {
                    self.fed(at.now);
                }
            }
            (0, 0xCCCC) => self.fed(at.now),
            (4 | 8, _) if !self.is_open => {
                at.forbid(
                    "21.3.2: a protected register of the watchdog is written without the key",
                );
            }
            (4, _) => self.prescaler = value & 7,
            (8, _) => self.reload = value & 0xFFF,
            _ => {}
        }
    }
}
