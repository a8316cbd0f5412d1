//! The ADXL355 at the level of its registers.
//!
//! Modelled: identity, reset, stand-by, status, the data registers, ranges, offsets, reading and
//! writing of any number of registers at once, the time until samples are valid. Not modelled: the FIFO, activity detection,
//! temperature, self-test, filters, noise.

use super::BusError;
use crate::drivers::adxl355::registers as at;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};

/// Registers of the chip.
const REGISTERS: usize = 0x30;

/// Time from the end of the stand-by to the first valid sample, ns.
const START_NS: u64 = 10_000_000;

/// The chip, on a bus of its own.
#[derive(Clone, Debug)]
pub struct Chip {
    registers: [u8; REGISTERS],
    /// Level of a stuck data line, if it is stuck.
    pub stuck: Option<bool>,
    /// Waits since the end of the stand-by, ns.
    awake_ns: u64,
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
            registers: [0; REGISTERS],
            stuck: None,
            awake_ns: 0,
        };
        chip.reset();
        chip
    }

    /// A reset.
    pub fn reset(&mut self) {
        self.registers = [0; REGISTERS];
        self.awake_ns = 0;
        let known = [
            (at::DEVID_AD, at::MAKER),
            (0x01, 0x1D),
            (at::PARTID, at::DEVICE),
            (0x03, 1),
            (0x27, 1),
            (0x29, 0x60),
            (at::RANGE, at::RANGE_AFTER_RESET | 1),
            (at::POWER_CTL, at::STANDBY),
        ];
        for (address, value) in known {
            self.set(address, value);
        }
    }

    /// `true` if pulses at its SYNC pin sample, `false` if its own clock does.
    #[must_use]
    pub fn is_led(&self) -> bool {
        self.register(at::SYNC) & 0b11 != 0
    }

    /// Converts the acceleration along the axes, in units of standard gravity.
    pub fn convert(&mut self, g: [f64; 3]) {
        if self.register(at::POWER_CTL) & at::STANDBY != 0 {
            return;
        }
        let shift = (self.register(at::RANGE) & 0b11).max(1) - 1;
        let per_g = f64::from(256_000_u32 >> shift);
        for (axis, g) in (0_u8..).zip(g) {
            let address = at::OFFSET_X_H + 2 * axis;
            let offset = i16::from_be_bytes([self.register(address), self.register(address + 1)]);
            let end = f64::from(1 << 19);
            let raw = if self.awake_ns < START_NS {
                // Filters that have not settled.
                end
            } else {
                libm::round(g * per_g) - 16.0 * f64::from(offset)
            };
            let counts = raw.clamp(-end, end - 1.0) as i32;
            let [high, middle, low, _] = (counts << 12).to_be_bytes();
            for (k, byte) in (0..).zip([high, middle, low]) {
                self.set(at::XDATA3 + 3 * axis + k, byte);
            }
        }
        let status = self.register(at::STATUS) | at::DATA_RDY;
        self.set(at::STATUS, status);
    }

    /// Content of a register.
    #[must_use]
    pub fn register(&self, address: u8) -> u8 {
        self.registers
            .get(usize::from(address))
            .copied()
            .unwrap_or(0)
    }

    fn set(&mut self, address: u8, value: u8) {
        if let Some(slot) = self.registers.get_mut(usize::from(address)) {
            *slot = value;
        }
    }

    /// Lets a time pass, ns.
    pub const fn pass_ns(&mut self, ns: u64) {
        self.awake_ns = self.awake_ns.saturating_add(ns);
    }

    /// Exchanges a byte, and returns the one to send. The first byte of an exchange, before which
    /// `head` is `None`, holds address and direction; the address counts up.
    pub fn shift(&mut self, head: &mut Option<u8>, byte: u8) -> u8 {
        let answer = match head {
            None => {
                *head = Some(byte);
                0
            }
            Some(head) => {
                let answer = self.exchange(*head >> 1, *head & 1 != 0, byte);
                *head = head.wrapping_add(2);
                answer
            }
        };
        self.stuck
            .map_or(answer, |level| if level { 0xFF } else { 0 })
    }

    /// Reads or writes a register, and returns the byte to send.
    fn exchange(&mut self, address: u8, is_read: bool, byte: u8) -> u8 {
        let found = self.register(address);
        if is_read {
            // A read of the last axis clears the status bit of a new sample.
            if address == at::XDATA3 + 8 {
                let status = self.register(at::STATUS) & !at::DATA_RDY;
                self.set(at::STATUS, status);
            }
            return found;
        }
        match address {
            at::RESET if byte == at::RESET_CODE => self.reset(),
            at::POWER_CTL => {
                self.awake_ns = 0;
                self.set(address, byte);
            }
            0x1E..=0x2E => self.set(address, byte),
            _ => {}
        }
        0
    }
}

impl ErrorType for Chip {
    type Error = BusError;
}

impl SpiDevice for Chip {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusError> {
        let mut head: Option<u8> = None;
        for operation in operations {
            let bytes = match operation {
                Operation::TransferInPlace(bytes) => bytes,
                Operation::DelayNs(ns) => {
                    self.pass_ns(u64::from(*ns));
                    continue;
                }
                _ => return Err(BusError::Unsupported),
            };
            for byte in bytes.iter_mut() {
                *byte = self.shift(&mut head, *byte);
            }
        }
        Ok(())
    }
}
