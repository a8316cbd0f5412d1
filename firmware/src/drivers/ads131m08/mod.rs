//! ADS131M08: eight channels of 24 bits, sampled together.
//!
//! # Design
//!
//! The chip answers a command in the frame after it, so that every exchange here is one frame
//! with the command and one with NULL. While samples are read, each frame holds the NULL command;
//! its answer is the status word, with the counts behind it.
//!
//! A sample is valid if its checksum is right, the bits that fill the status word and the checksum
//! word are zeros, and the status word is bit for bit that of a locked, configured chip with eight
//! new counts. A frame of random bits passes each of these checks with probability 2^-16, all of
//! them with 2^-48.
//!
//! After it is configured, the chip is locked and checks its own registers: a frame that is
//! garbled on its way to the chip cannot change them, not even one that looks like a write,
//! which the chip would execute before it receives the checksum.

pub mod frame;
pub mod registers;

use self::frame::{Frame, WORD, WORDS, word};
use self::registers::{CHANNELS, Register, clock, command, mode, status};
use super::{Converter, Fault, Lowpass, Reading, Signal};
use embedded_hal::spi::{MODE_1, Mode, Operation, SpiDevice};

/// Mode of the SPI bus: clock low when idle, data sampled at the falling edge.
pub const SPI_MODE: Mode = MODE_1;
/// Fastest clock of the SPI bus at a supply of 2.7 V or more, Hz.
pub const SPI_HZ_MAX: u32 = 25_000_000;
/// Clock of the converter for power-of-two sample rates up to 16384 Hz, in Hz. Twice as much would
/// be beyond [`clock_max`] for every gain above 2.
pub const CLOCK_HZ: u32 = 4_194_304;
/// Shortest low pulse on the SYNC/RESET pin that resets the chip, cycles of the converter's clock;
/// shorter pulses of one cycle or more restart the conversions.
pub const RESET_CYCLES: u32 = 2048;
/// Start-up time after a reset, ns: twice the 5 µs of the data sheet.
const RESET_NS: u32 = 10_000;
/// Time after a change of registers until the check of the register map has seen it, ns: twice a
/// pass of it, which takes about 90 µs (8.3.13). Until then it may set [`status::REG_MAP`] once more.
const MAP_NS: u32 = 200_000;

/// Fastest clock of the converter at a gain, Hz (6.3).
#[must_use]
pub const fn clock_max(gain: u8) -> u32 {
    if gain <= 2 { 8_400_000 } else { 8_200_000 }
}

// The box offers all gains.
const _: () = assert!(CLOCK_HZ <= clock_max(128));

/// Oversampling ratio: cycles of the modulator, half the converter's clock, for a count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Oversampling {
    /// 16384 samples/s at [`CLOCK_HZ`].
    X128 = 0,
    /// 8192 samples/s.
    X256 = 1,
    /// 4096 samples/s.
    X512 = 2,
    /// 2048 samples/s.
    X1024 = 3,
    /// 1024 samples/s.
    X2048 = 4,
    /// 512 samples/s.
    X4096 = 5,
    /// 256 samples/s.
    X8192 = 6,
    /// 128 samples/s.
    X16384 = 7,
}

impl Oversampling {
    /// All ratios, the fastest first.
    pub const ALL: [Self; 8] = [
        Self::X128,
        Self::X256,
        Self::X512,
        Self::X1024,
        Self::X2048,
        Self::X4096,
        Self::X8192,
        Self::X16384,
    ];

    /// Cycles of the converter's clock from one sample to the next.
    #[must_use]
    pub const fn cycles(self) -> u32 {
        256 << self as u8
    }

    /// Samples per second at a clock in Hz.
    #[must_use]
    pub fn rate(self, clock: u32) -> f64 {
        f64::from(clock) / f64::from(self.cycles())
    }

    /// The next sample rates below and above a rate, Hz, at a clock in Hz; equal if there is
    /// such a rate. Beyond the ends both are the lowest, or the highest rate.
    #[must_use]
    pub fn neighbours(rate: f64, clock: u32) -> [f64; 2] {
        let rates = Self::ALL.map(|o| o.rate(clock));
        let [highest, .., lowest] = rates;
        let below = rates.into_iter().find(|r| *r <= rate);
        let above = rates.into_iter().rfind(|r| *r >= rate);
        [below.unwrap_or(lowest), above.unwrap_or(highest)]
    }

    /// The ratio for a sample rate, Hz, at a clock in Hz; `None` if there is none.
    #[must_use]
    pub fn of_rate(rate: f64, clock: u32) -> Option<Self> {
        let exact = |o: &Self| f64::from(clock) == rate * f64::from(o.cycles());
        Self::ALL.into_iter().find(exact)
    }
}

/// Samples per second of the sinc3 filter at its largest ratio, 1024, at [`CLOCK_HZ`].
const SINC3_HZ: f64 = CLOCK_HZ as f64 / 2.0 / 1024.0;

/// The filters at a sample rate, Hz, at [`CLOCK_HZ`] (8.3.7): a sinc3 filter, behind which samples are averaged
/// where the oversampling ratio is above 1024.
#[must_use]
pub fn lowpass(rate: f64) -> Lowpass {
    let sinc3 = 1.0 / rate.max(SINC3_HZ);
    let sample = 1.0 / rate;
    // The average of m samples has the magnitude of one over their time, divided by that of one over a
    // single one, and half of that difference as its delay.
    Lowpass {
        delay: sinc3 + 0.5 * sample,
        averages: [(sinc3, 2), (sample, 1)],
        pole: 0.0,
    }
}

/// Gain of a channel's amplifier. Full scale is 1.2 V divided by the gain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gain(u8);

impl Gain {
    /// No gain.
    pub const ONE: Self = Self(0);

    /// A gain; `None` unless it is a power of two up to 128.
    #[must_use]
    pub const fn new(gain: u8) -> Option<Self> {
        if gain.is_power_of_two() {
            Some(Self(gain.trailing_zeros() as u8))
        } else {
            None
        }
    }

    /// The factor.
    #[must_use]
    pub const fn factor(self) -> u8 {
        1 << self.0
    }
}

/// One channel's settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Gain of the amplifier.
    pub gain: Gain,
    /// Voltage that is converted: the test voltage is 160 mV divided by the gain.
    pub signal: Signal,
    /// Count that the chip subtracts, 24 bits.
    pub offset: i32,
    /// Factor of the count less its offset, in units of 2^-23: 0x80_0000 is one.
    pub correction: u32,
}

impl Channel {
    /// The pins at a gain, without correction inside the chip: the calibration corrects in SI
    /// units.
    #[must_use]
    pub const fn pins(gain: Gain) -> Self {
        Self {
            gain,
            signal: Signal::Pins,
            offset: 0,
            correction: 0x80_0000,
        }
    }
}

/// All settings of a chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Configuration {
    /// Oversampling ratio, which sets the sample rate.
    pub oversampling: Oversampling,
    /// The channels.
    pub channels: [Channel; CHANNELS],
}

impl Configuration {
    /// 512 samples/s at [`CLOCK_HZ`], all pins at a gain of one.
    pub const PLAIN: Self = Self {
        oversampling: Oversampling::X4096,
        channels: [Channel::pins(Gain::ONE); CHANNELS],
    };

    /// All writable registers, from [`Register::MODE`] on.
    #[must_use]
    pub fn registers(&self) -> [u16; Register::WRITABLE] {
        // Addresses end at `Register::LAST`.
        core::array::from_fn(|i| self.register(Register(Register::MODE.0.wrapping_add(i as u8))))
    }

    fn register(&self, register: Register) -> u16 {
        match register {
            Register::MODE => mode::REG_CRC_EN | mode::RX_CRC_EN | mode::WLENGTH_24 | mode::TIMEOUT,
            // All channels run, in high resolution, by a clock from outside.
            Register::CLOCK => 0xFF02 | clock::XTAL_DIS | (u16::from(self.oversampling as u8) << 2),
            Register::GAIN1 => self.gains(0),
            Register::GAIN2 => self.gains(4),
            Register(address @ 0x09..=0x30) => {
                let (channel, which) = ((address - 0x09) / 5, (address - 0x09) % 5);
                let Some(channel) = self.channels.get(usize::from(channel)) else {
                    return register.after_reset();
                };
                let [_, high, middle, low] = match which {
                    1 | 2 => channel.offset.to_be_bytes(),
                    _ => channel.correction.to_be_bytes(),
                };
                match which {
                    0 => u16::from(channel.signal as u8),
                    1 | 3 => u16::from_be_bytes([high, middle]),
                    _ => u16::from_be_bytes([low, 0]),
                }
            }
            other => other.after_reset(),
        }
    }

    fn gains(&self, first: usize) -> u16 {
        let four = self.channels.iter().skip(first).take(4);
        four.rev()
            .fold(0, |gains, c| gains << 4 | u16::from(c.gain.0))
    }
}

/// One chip.
#[derive(Debug)]
pub struct Ads131m08<SPI> {
    spi: SPI,
    configuration: Configuration,
}

impl<SPI: SpiDevice> Ads131m08<SPI> {
    /// The chip behind a device of an SPI bus in [`SPI_MODE`].
    pub const fn new(spi: SPI, configuration: Configuration) -> Self {
        Self { spi, configuration }
    }

    /// The settings that [`Converter::prepare`] writes.
    pub const fn configuration(&self) -> &Configuration {
        &self.configuration
    }

    /// Sets the settings of the next [`Converter::prepare`].
    pub const fn configure(&mut self, configuration: Configuration) {
        self.configuration = configuration;
    }

    /// The bus.
    pub const fn bus(&mut self) -> &mut SPI {
        &mut self.spi
    }

    /// Gives the bus back.
    pub fn release(self) -> SPI {
        self.spi
    }

    /// Reads a register.
    ///
    /// # Errors
    ///
    /// [`Fault::Bus`], [`Fault::Checksum`], [`Fault::Stuck`].
    pub fn read_register(&mut self, register: Register) -> Result<u16, Fault> {
        self.command(command::read(register, 1))
    }

    /// Writes a register and reads it back.
    ///
    /// # Errors
    ///
    /// [`Fault::Command`] if the write is not acknowledged, [`Fault::Register`] if the register
    /// reads otherwise then; [`Fault::Bus`], [`Fault::Checksum`], [`Fault::Stuck`].
    pub fn write_register(&mut self, register: Register, value: u16) -> Result<(), Fault> {
        self.write_registers(register, &[value])?;
        let found = self.read_register(register)?;
        if found == value {
            return Ok(());
        }
        Err(Fault::Register {
            address: register.0,
            found,
            expected: value,
        })
    }

    /// Resets the chip by command.
    ///
    /// # Errors
    ///
    /// [`Fault::Command`] if the chip does not acknowledge; [`Fault::Bus`], [`Fault::Checksum`].
    pub fn reset(&mut self) -> Result<(), Fault> {
        let mut frame = Frame::command(command::RESET);
        // The answer to the frame before is ignored, readable or not: the chip may be in any state.
        self.transfer(&mut frame, RESET_NS)?;
        let answer = self.command(command::NULL);
        // The frame after the reset holds its answer.
        expect(answer?, command::RESET_DONE)
    }

    /// Locks the registers: only reads of samples and registers are executed from now on.
    ///
    /// # Errors
    ///
    /// [`Fault::Command`]; [`Fault::Bus`], [`Fault::Checksum`], [`Fault::Stuck`].
    pub fn lock(&mut self) -> Result<(), Fault> {
        self.acknowledged(command::LOCK)
    }

    /// Unlocks the registers.
    ///
    /// # Errors
    ///
    /// [`Fault::Command`]; [`Fault::Bus`], [`Fault::Checksum`], [`Fault::Stuck`].
    pub fn unlock(&mut self) -> Result<(), Fault> {
        self.acknowledged(command::UNLOCK)
    }

    /// Stops the conversions.
    ///
    /// # Errors
    ///
    /// [`Fault::Command`]; [`Fault::Bus`], [`Fault::Checksum`], [`Fault::Stuck`].
    pub fn standby(&mut self) -> Result<(), Fault> {
        self.acknowledged(command::STANDBY)
    }

    /// Starts the conversions again.
    ///
    /// # Errors
    ///
    /// [`Fault::Command`]; [`Fault::Bus`], [`Fault::Checksum`], [`Fault::Stuck`].
    pub fn wake_up(&mut self) -> Result<(), Fault> {
        self.acknowledged(command::WAKEUP)
    }

    fn acknowledged(&mut self, word: u16) -> Result<(), Fault> {
        let answer = self.command(word)?;
        expect(answer, word)
    }

    /// Sends a command and reads its answer.
    fn command(&mut self, word: u16) -> Result<u16, Fault> {
        let mut frame = Frame::command(word);
        if word != command::NULL {
            self.transfer(&mut frame, 0)?;
            frame = Frame::command(command::NULL);
        }
        self.transfer(&mut frame, 0)?;
        let words = frame.checked(WORDS - 1)?;
        Ok(self::word(words, 0))
    }

    fn write_registers(&mut self, first: Register, values: &[u16]) -> Result<(), Fault> {
        let count = u16::try_from(values.len()).unwrap_or(u16::MAX);
        let mut frame = Frame::with_registers(command::write(first, count), values);
        self.transfer(&mut frame, 0)?;
        let answer = self.command(command::NULL)?;
        expect(answer, command::write_done(first, count))
    }

    /// Reads registers from `first` on and compares them.
    fn compare_registers(&mut self, first: Register, expected: &[u16]) -> Result<(), Fault> {
        let count = u16::try_from(expected.len()).unwrap_or(u16::MAX);
        let mut frame = Frame::command(command::read(first, count));
        self.transfer(&mut frame, 0)?;
        let mut frame = Frame::null_for(expected.len());
        self.transfer(&mut frame, 0)?;
        let words = frame.checked(expected.len() + 1)?;
        expect(word(words, 0), command::read_done(first, count))?;
        for (k, &expected) in expected.iter().enumerate() {
            let found = word(words, k + 1);
            if found != expected {
                return Err(Fault::Register {
                    address: first.0.saturating_add(k as u8),
                    found,
                    expected,
                });
            }
        }
        Ok(())
    }

    fn transfer(&mut self, frame: &mut Frame, then_ns: u32) -> Result<(), Fault> {
        let exchange = Operation::TransferInPlace(frame.bytes_mut());
        let result = match then_ns {
            0 => self.spi.transaction(&mut [exchange]),
            ns => self
                .spi
                .transaction(&mut [exchange, Operation::DelayNs(ns)]),
        };
        result.map_err(|_| Fault::Bus)
    }
}

impl<SPI: SpiDevice> Converter for Ads131m08<SPI> {
    fn channels(&self) -> usize {
        CHANNELS
    }

    fn choose(&mut self, rate: f64, gains: &[u8], signal: Signal) -> Result<(), Fault> {
        let oversampling = Oversampling::of_rate(rate, CLOCK_HZ).ok_or(Fault::Unsupported)?;
        let gain = |channel: usize| gains.get(channel).copied().and_then(Gain::new);
        self.configuration = Configuration {
            oversampling,
            channels: core::array::from_fn(|k| Channel {
                signal,
                ..Channel::pins(gain(k).unwrap_or(Gain::ONE))
            }),
        };
        Ok(())
    }

    fn prepare(&mut self) -> Result<(), Fault> {
        // A locked chip ignores a reset; a chip after a reset may not acknowledge UNLOCK.
        let mut unlock = Frame::command(command::UNLOCK);
        self.transfer(&mut unlock, 0)?;
        self.reset()?;
        let found = self.read_register(Register::ID)?;
        let expected = Register::ID.after_reset();
        if found & 0x0F00 != expected & 0x0F00 {
            return Err(Fault::Identity { found, expected });
        }
        let registers = self.configuration.registers();
        self.write_registers(Register::MODE, &registers)?;
        // The next frame brings the status, which clears what the check says of the write above.
        self.transfer(&mut Frame::command(command::NULL), MAP_NS)?;
        self.compare_registers(Register::MODE, &registers)?;
        self.lock()?;
        // This answer shows the effects of the commands above; samples come with the next one.
        let seen = self.command(command::NULL)?;
        expect(seen & (status::LOCK | status::RESET), status::LOCK)
    }

    fn read(&mut self, counts: &mut [i32]) -> Result<Reading, Fault> {
        let mut bytes = REQUEST;
        let mut exchange = [Operation::TransferInPlace(&mut bytes)];
        self.spi
            .transaction(&mut exchange)
            .map_err(|_| Fault::Bus)?;
        self.decode(&bytes, counts)
    }

    fn decode(&mut self, received: &[u8], counts: &mut [i32]) -> Result<Reading, Fault> {
        let bytes: &[u8; frame::BYTES] = received.first_chunk().ok_or(Fault::Bus)?;
        let words = frame::checked(bytes, WORDS - 1)?;
        let status = word(words, 0);
        let refused = status & status::CRC_ERR != 0;
        let status = status & !status::CRC_ERR;
        if status != GOOD {
            return Err(no_sample(status));
        }
        if let Some(counts) = counts.first_chunk_mut() {
            *counts = frame::counts(words);
        }
        Ok(Reading { refused })
    }
}

/// Status of a prepared chip with a new sample.
const GOOD: u16 = status::LOCK | status::WLENGTH_24 | status::DRDY;

/// The fault that any other status shows.
#[cold]
fn no_sample(status: u16) -> Fault {
    let settings = !(status::DRDY | status::F_RESYNC);
    if status & settings != GOOD & settings {
        // Reset, not locked, another checksum or word length, or changed registers.
        Fault::Reset
    } else if status & status::F_RESYNC != 0 {
        Fault::Resynchronised
    } else {
        Fault::Stale
    }
}

/// Bytes that read a sample, in one frame: the NULL command with its checksum.
pub const REQUEST: [u8; frame::BYTES] = {
    let mut bytes = [0; frame::BYTES];
    // Checksum of three zeros.
    bytes[WORD] = 0xCC;
    bytes[WORD + 1] = 0x9C;
    bytes
};

fn expect(found: u16, expected: u16) -> Result<(), Fault> {
    if found == expected {
        Ok(())
    } else {
        Err(Fault::Command { found, expected })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn null_frame_has_its_checksum() {
        assert_eq!(Frame::command(command::NULL).bytes_mut(), REQUEST);
    }

    #[test]
    fn rates_come_from_the_clock() {
        for (rate, expected) in [
            (512.0, Some(Oversampling::X4096)),
            (4096.0, Some(Oversampling::X512)),
            (16384.0, Some(Oversampling::X128)),
            (32768.0, None),
            (500.0, None),
            (0.0, None),
            (f64::NAN, None),
        ] {
            assert_eq!(Oversampling::of_rate(rate, CLOCK_HZ), expected);
        }
    }

    #[test]
    fn gains_are_powers_of_two() {
        let gains = (0..=u8::MAX).filter_map(Gain::new).map(Gain::factor);
        assert!(gains.eq([1, 2, 4, 8, 16, 32, 64, 128]));
    }
}
