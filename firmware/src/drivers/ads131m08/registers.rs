//! Registers and commands of the ADS131M08 (data sheet SBAS950B, chapters 8.5 and 8.6).

/// Channels of the chip.
pub const CHANNELS: usize = 8;

/// The address of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Register(pub u8);

impl Register {
    /// Number of channels, in bits 8 to 11. Read only.
    pub const ID: Self = Self(0x00);
    /// Status, with the bits of [`status`]. Read only.
    pub const STATUS: Self = Self(0x01);
    /// Mode, with the bits of [`mode`].
    pub const MODE: Self = Self(0x02);
    /// Channels that run, oversampling, power.
    pub const CLOCK: Self = Self(0x03);
    /// Gains of channels 0 to 3, a nibble each.
    pub const GAIN1: Self = Self(0x04);
    /// Gains of channels 4 to 7.
    pub const GAIN2: Self = Self(0x05);
    /// Global chop and current detection.
    pub const CFG: Self = Self(0x06);
    /// Threshold of the current detection, upper bits.
    pub const THRSHLD_MSB: Self = Self(0x07);
    /// Lower bits of that threshold, and the DC block filter.
    pub const THRSHLD_LSB: Self = Self(0x08);
    /// The last register of the last channel.
    pub const LAST: Self = Self(0x30);
    /// Checksum over the register map. Read only.
    pub const REGMAP_CRC: Self = Self(0x3E);

    /// Registers from [`Self::MODE`] to [`Self::LAST`], which are all that can be written.
    pub const WRITABLE: usize = (Self::LAST.0 - Self::MODE.0) as usize + 1;

    /// Register `which`, 0 to 4, of a channel.
    const fn of_channel(channel: u8, which: u8) -> Self {
        Self(0x09 + 5 * (channel % CHANNELS as u8) + which)
    }

    /// Phase delay and input of a channel.
    #[must_use]
    pub const fn channel_cfg(channel: u8) -> Self {
        Self::of_channel(channel, 0)
    }

    /// Upper bits of a channel's offset; the lower ones are in the next register.
    #[must_use]
    pub const fn offset_msb(channel: u8) -> Self {
        Self::of_channel(channel, 1)
    }

    /// Upper bits of a channel's gain correction; the lower ones are in the next register.
    #[must_use]
    pub const fn gain_msb(channel: u8) -> Self {
        Self::of_channel(channel, 3)
    }

    /// Bits that can be written.
    #[must_use]
    pub const fn mask(self) -> u16 {
        match self.0 {
            0x02 => 0x3F1F,
            0x03 => 0xFFDF,
            0x04 | 0x05 => 0x7777,
            0x06 => 0x1FFF,
            0x07 => 0xFFFF,
            0x08 => 0xFF0F,
            0x09..=0x30 => match (self.0 - 0x09) % 5 {
                0 => 0xFFC7,
                1 | 3 => 0xFFFF,
                _ => 0xFF00,
            },
            _ => 0,
        }
    }

    /// Content after a reset.
    #[must_use]
    pub const fn after_reset(self) -> u16 {
        match self.0 {
            0x00 => 0x2800,
            0x01 => 0x0500,
            0x02 => 0x0510,
            0x03 => 0xFF0E,
            0x06 => 0x0600,
            0x09..=0x30 if (self.0 - 0x09) % 5 == 3 => 0x8000,
            _ => 0,
        }
    }
}

/// Bits of [`Register::STATUS`].
pub mod status {
    /// Only NULL, UNLOCK and RREG are executed.
    pub const LOCK: u16 = 1 << 15;
    /// Conversions were restarted.
    pub const F_RESYNC: u16 = 1 << 14;
    /// The register map has changed.
    pub const REG_MAP: u16 = 1 << 13;
    /// The frame sent before had a wrong checksum.
    pub const CRC_ERR: u16 = 1 << 12;
    /// Checksum CRC-16-ANSI; CCITT if clear.
    pub const CRC_TYPE: u16 = 1 << 11;
    /// The chip has been reset.
    pub const RESET: u16 = 1 << 10;
    /// Word length.
    pub const WLENGTH: u16 = 0b11 << 8;
    /// Words of 24 bits.
    pub const WLENGTH_24: u16 = 0b01 << 8;
    /// Channels with a new count.
    pub const DRDY: u16 = 0xFF;
}

/// Bits of [`Register::CLOCK`].
pub mod clock {
    /// The oscillator for a crystal is off: the clock comes from outside.
    pub const XTAL_DIS: u16 = 1 << 7;
}

/// Bits of [`Register::MODE`].
pub mod mode {
    /// The register map is checked by a checksum.
    pub const REG_CRC_EN: u16 = 1 << 13;
    /// Received frames are checked.
    pub const RX_CRC_EN: u16 = 1 << 12;
    /// A reset has occurred; zero clears it.
    pub const RESET: u16 = 1 << 10;
    /// Words of 24 bits.
    pub const WLENGTH_24: u16 = 0b01 << 8;
    /// A frame that stalls is aborted.
    pub const TIMEOUT: u16 = 1 << 4;
}

/// Commands, and their answers in the next frame.
pub mod command {
    use super::Register;

    /// No operation; answered by STATUS.
    pub const NULL: u16 = 0x0000;
    /// Reset; a whole frame must be sent.
    pub const RESET: u16 = 0x0011;
    /// Answer to [`RESET`] when the chip is ready again.
    pub const RESET_DONE: u16 = 0xFF28;
    /// Stops the conversions; answered by itself.
    pub const STANDBY: u16 = 0x0022;
    /// Starts the conversions again; answered by itself.
    pub const WAKEUP: u16 = 0x0033;
    /// Locks the registers; answered by itself.
    pub const LOCK: u16 = 0x0555;
    /// Unlocks the registers; answered by itself.
    pub const UNLOCK: u16 = 0x0655;

    /// Reads `count` registers. One is answered by its content, more by [`read_done`] and the
    /// contents.
    #[must_use]
    pub const fn read(from: Register, count: u16) -> u16 {
        0xA000 | block(from, count)
    }

    /// Writes `count` registers; answered by [`write_done`].
    #[must_use]
    pub const fn write(from: Register, count: u16) -> u16 {
        0x6000 | block(from, count)
    }

    /// Answer to a read of more than one register.
    #[must_use]
    pub const fn read_done(from: Register, count: u16) -> u16 {
        0xE000 | block(from, count)
    }

    /// Answer to a write of `count` registers.
    #[must_use]
    pub const fn write_done(from: Register, count: u16) -> u16 {
        0x4000 | block(from, count)
    }

    const fn block(from: Register, count: u16) -> u16 {
        ((from.0 as u16 & 0x3F) << 7) | (count.saturating_sub(1) & 0x7F)
    }
}
