//! ADXL355: an accelerometer with three axes of 20 bits (data sheet ADXL354/ADXL355, revision D).
//!
//! # Design
//!
//! The chip has no checksum. Each sample is therefore read together with the status bit of a new
//! sample and the registers of range, filter and power. These detect a stuck line, a reset (after
//! which the chip stands by, in another range) and a missing chip, but not a single wrong bit in a
//! count: keep its wires short.
//!
//! The chip samples by its own clock, or with [`Clocking::External`] at pulses on its SYNC pin.
//! Wire the other converters' DRDY line there, so that the samples belong to the same instants.

use super::{Converter, Fault, Lowpass, Reading, Signal};
use core::f64::consts::TAU;
use embedded_hal::spi::{MODE_0, Mode, Operation, SpiDevice};

/// Mode of the SPI bus.
pub const SPI_MODE: Mode = MODE_0;
/// Fastest clock of the SPI bus, Hz.
pub const SPI_HZ_MAX: u32 = 10_000_000;
/// Frequency at which the sensor's own filter begins, Hz.
const SENSOR_HZ: f64 = 1500.0;
/// Axes.
pub const CHANNELS: usize = 3;

/// Addresses of registers.
pub mod registers {
    /// Manufacturer: [`MAKER`].
    pub const DEVID_AD: u8 = 0x00;
    /// Device: [`DEVICE`].
    pub const PARTID: u8 = 0x02;
    /// Status: [`DATA_RDY`].
    pub const STATUS: u8 = 0x04;
    /// First of nine bytes: x, y, z, three each, 20 bits at the top.
    pub const XDATA3: u8 = 0x08;
    /// First of six bytes of offsets: x, y, z, two each.
    pub const OFFSET_X_H: u8 = 0x1E;
    /// Filters: the high-pass in the upper nibble, the sample rate in the lower one.
    pub const FILTER: u8 = 0x28;
    /// Sources of the clock and of the sampling pulses.
    pub const SYNC: u8 = 0x2B;
    /// Range, and polarity of the interrupts.
    pub const RANGE: u8 = 0x2C;
    /// Stand-by, temperature, data ready.
    pub const POWER_CTL: u8 = 0x2D;
    /// Reset, by [`RESET_CODE`].
    pub const RESET: u8 = 0x2F;

    /// Content of [`DEVID_AD`].
    pub const MAKER: u8 = 0xAD;
    /// Content of [`PARTID`].
    pub const DEVICE: u8 = 0xED;
    /// Value that resets the chip when written to [`RESET`].
    pub const RESET_CODE: u8 = 0x52;
    /// Bit of [`STATUS`]: there is a new sample.
    pub const DATA_RDY: u8 = 1;
    /// Bit of [`POWER_CTL`]: the chip stands by, as it does after a reset.
    pub const STANDBY: u8 = 1;
    /// Content of [`RANGE`] after a reset, without the range.
    pub const RANGE_AFTER_RESET: u8 = 0x80;
}

use registers as at;

/// Bytes of the first of the two frames that read a sample: the address, and the registers from
/// STATUS to the last axis.
pub const DATA_BYTES: usize = 14;
/// Bytes that read a sample, in two frames: status and axes, then the settings, each behind its
/// address.
pub const REQUEST: [u8; DATA_BYTES + 7] = {
    let mut bytes = [0; DATA_BYTES + 7];
    bytes[0] = at::STATUS << 1 | 1;
    bytes[DATA_BYTES] = at::FILTER << 1 | 1;
    bytes
};

/// Largest acceleration, in units of standard gravity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Range {
    /// 2.048 g, 256000 counts per g.
    G2 = 1,
    /// 4.096 g, 128000 counts per g.
    G4 = 2,
    /// 8.192 g, 64000 counts per g.
    G8 = 3,
}

/// Source of the sampling pulses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Clocking {
    /// The chip's own clock.
    Internal = 0,
    /// Pulses at its SYNC pin; samples are interpolated to them.
    External = 2,
}

/// All settings of a chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Configuration {
    /// Largest acceleration.
    pub range: Range,
    /// The sample rate of its filter is 4000 Hz halved that many times, up to 10.
    pub halvings: u8,
    /// Source of the sampling pulses.
    pub clocking: Clocking,
    /// Offsets subtracted from the axes, in units of 16 counts.
    pub offsets: [i16; CHANNELS],
}

impl Configuration {
    /// 2.048 g, sampled at pulses on the SYNC pin, with the filter of the next rate at or above
    /// `rate`, Hz.
    #[must_use]
    pub fn following(rate: f64) -> Self {
        let fits = |halvings: &u8| 4000.0 / f64::from(1_u16 << halvings) >= rate;
        Self {
            range: Range::G2,
            halvings: (0..=10).rev().find(fits).unwrap_or(0),
            clocking: Clocking::External,
            offsets: [0; CHANNELS],
        }
    }

    /// Sample rate of the filter, Hz.
    fn filter_hz(&self) -> f64 {
        4000.0 / f64::from(1_u16 << self.halvings.min(10))
    }

    /// The filters (table of their group delay): their attenuation at a quarter of their sample rate, 1.83 dB,
    /// is that of two averages over its period; from 1000 Hz on the sensor's own filter adds to it.
    #[must_use]
    pub fn lowpass(&self) -> Lowpass {
        /// Delays in periods of the filter's sample rate, by halvings.
        const PERIODS: [f64; 11] = [
            2.52, 2.00, 1.78, 1.63, 1.57, 1.54, 1.51, 1.49, 1.50, 1.50, 1.50,
        ];
        let period = 1.0 / self.filter_hz();
        let [.., slowest] = PERIODS;
        let halvings = usize::from(self.halvings);
        Lowpass {
            delay: PERIODS.get(halvings).unwrap_or(&slowest) * period,
            averages: [(period, 2), (0.0, 0)],
            pole: 1.0 / (TAU * SENSOR_HZ),
        }
    }

    /// FILTER, FIFO_SAMPLES, INT_MAP, SYNC, RANGE and POWER_CTL.
    const fn registers(&self) -> [u8; 6] {
        let halvings = if self.halvings > 10 {
            10
        } else {
            self.halvings
        };
        [
            halvings,
            0x60,
            0,
            self.clocking as u8,
            at::RANGE_AFTER_RESET | self.range as u8,
            0,
        ]
    }

    fn offsets(&self) -> [u8; 6] {
        let [x, y, z] = self.offsets.map(i16::to_be_bytes);
        [x[0], x[1], y[0], y[1], z[0], z[1]]
    }
}

/// One chip.
#[derive(Debug)]
pub struct Adxl355<SPI> {
    spi: SPI,
    configuration: Configuration,
}

impl<SPI: SpiDevice> Adxl355<SPI> {
    /// The chip behind a device of an SPI bus in [`SPI_MODE`].
    pub const fn new(spi: SPI, configuration: Configuration) -> Self {
        Self { spi, configuration }
    }

    /// Sets the settings of the next [`Converter::prepare`].
    pub const fn configure(&mut self, configuration: Configuration) {
        self.configuration = configuration;
    }

    /// The bus.
    pub const fn bus(&mut self) -> &mut SPI {
        &mut self.spi
    }

    /// Reads registers from an address on.
    ///
    /// # Errors
    ///
    /// [`Fault::Bus`].
    pub fn read_registers<const LENGTH: usize>(
        &mut self,
        first: u8,
    ) -> Result<[u8; LENGTH], Fault> {
        let mut bytes = [0; LENGTH];
        let mut head = [first << 1 | 1];
        self.spi
            .transaction(&mut [
                Operation::TransferInPlace(&mut head),
                Operation::TransferInPlace(&mut bytes),
            ])
            .map_err(|_| Fault::Bus)?;
        Ok(bytes)
    }

    /// Writes a register and reads it back.
    ///
    /// # Errors
    ///
    /// [`Fault::Bus`]; [`Fault::Register`] if it reads otherwise.
    pub fn write_register(&mut self, address: u8, value: u8) -> Result<(), Fault> {
        self.write(address, value, 0)?;
        let [found] = self.read_registers(address)?;
        if found == value {
            return Ok(());
        }
        Err(Fault::Register {
            address,
            found: found.into(),
            expected: value.into(),
        })
    }

    fn write(&mut self, address: u8, value: u8, then_ns: u32) -> Result<(), Fault> {
        let mut bytes = [address << 1, value];
        self.spi
            .transaction(&mut [
                Operation::TransferInPlace(&mut bytes),
                Operation::DelayNs(then_ns),
            ])
            .map_err(|_| Fault::Bus)
    }
}

impl<SPI: SpiDevice> Converter for Adxl355<SPI> {
    fn channels(&self) -> usize {
        CHANNELS
    }

    fn choose(&mut self, rate: f64, _: &[u8], _: Signal) -> Result<(), Fault> {
        self.configuration = Configuration::following(rate);
        Ok(())
    }

    fn prepare(&mut self) -> Result<(), Fault> {
        /// Time to load the trim after a reset, well rounded up.
        const RESET_NS: u32 = 1_000_000;
        /// Time from the end of the stand-by to the first valid sample.
        const START_NS: u32 = 10_000_000;

        self.write(at::RESET, at::RESET_CODE, RESET_NS)?;
        let [maker, _, device] = self.read_registers(at::DEVID_AD)?;
        let (found, expected) = ([maker, device], [at::MAKER, at::DEVICE]);
        if found != expected {
            return Err(Fault::Identity {
                found: u16::from_be_bytes(found),
                expected: u16::from_be_bytes(expected),
            });
        }
        for (address, value) in (at::OFFSET_X_H..).zip(self.configuration.offsets()) {
            self.write_register(address, value)?;
        }
        // Power comes last: settings may change only while the chip stands by.
        for (address, value) in (at::FILTER..).zip(self.configuration.registers()) {
            self.write_register(address, value)?;
        }
        self.spi
            .transaction(&mut [Operation::DelayNs(START_NS)])
            .map_err(|_| Fault::Bus)
    }

    fn read(&mut self, counts: &mut [i32]) -> Result<Reading, Fault> {
        let mut bytes = REQUEST;
        let (data, settings) = bytes.split_at_mut(DATA_BYTES);
        for frame in [data, settings] {
            self.spi
                .transaction(&mut [Operation::TransferInPlace(frame)])
                .map_err(|_| Fault::Bus)?;
        }
        self.decode(&bytes, counts)
    }

    fn decode(&mut self, received: &[u8], counts: &mut [i32]) -> Result<Reading, Fault> {
        let bytes: &[u8; REQUEST.len()] = received.first_chunk().ok_or(Fault::Bus)?;
        let (data, settings) = bytes.split_at(DATA_BYTES);
        if settings.last_chunk() != Some(&self.configuration.registers()) {
            return Err(Fault::Reset);
        }
        // Nothing is said while the address is received.
        let [_, status, _, _, _, axes @ ..] = data else {
            return Err(Fault::Bus);
        };
        if status & at::DATA_RDY == 0 {
            return Err(Fault::Stale);
        }
        for (slot, bytes) in counts.iter_mut().zip(axes.chunks_exact(3)) {
            if let [high, middle, low] = *bytes {
                // 20 bits at the top of 24.
                *slot = i32::from_be_bytes([high, middle, low, 0]) >> 12;
            }
        }
        Ok(Reading::default())
    }
}
