//! The converters of this box, in the order of their inputs: the only file that names their kinds.
//!
//! | inputs | converter |
//! | --- | --- |
//! | 0 to 31 | four ADS131M08, eight each, with DRDY lines |
//! | 32 to 34 | ADXL355: x, y, z, read at the others' edges |
//!
//! | lane | converters, in the order in which they are read |
//! | --- | --- |
//! | 0 | ADS131M08 number 0, 1 |
//! | 1 | ADS131M08 number 2, 3 |
//! | 2 | ADXL355 |

use crate::drivers::ads131m08::{self, Ads131m08, Oversampling, registers};
use crate::drivers::adxl355::{self, Adxl355};
use crate::drivers::lanes::{Lane, Step};
use crate::drivers::{Converter, Lowpass};
use embedded_hal::spi::SpiDevice;

/// Number of converters with a DRDY line, which come first.
pub const CONVERTERS: usize = 4;
/// Number of converters of a box.
pub const CHIPS: usize = CONVERTERS + 1;
/// Number of inputs of a box.
pub const INPUTS: usize = CONVERTERS * registers::CHANNELS + adxl355::CHANNELS;
/// Clock of the converters with a DRDY line, Hz.
pub const CLOCK_HZ: u32 = ads131m08::CLOCK_HZ;

/// Number of inputs of each converter.
pub(super) const CHANNELS: [usize; CHIPS] = {
    let mut channels = [registers::CHANNELS; CHIPS];
    channels[CONVERTERS] = adxl355::CHANNELS;
    channels
};

/// Number of lanes of a box.
pub const LANES: usize = 3;
/// Frames that each lane exchanges at a conversion.
pub const ORDER: [Lane; LANES] = [&[ads(0), ads(1)], &[ads(2), ads(3)], &ADXL];
/// Bytes that read a sample of each converter, of which a [`Step`] is a part.
pub const REQUESTS: [&[u8]; CHIPS] = [
    &ads131m08::REQUEST,
    &ads131m08::REQUEST,
    &ads131m08::REQUEST,
    &ads131m08::REQUEST,
    &adxl355::REQUEST,
];

const fn ads(converter: u8) -> Step {
    Step {
        converter,
        first: 0,
        bytes: ads131m08::REQUEST.len() as u8,
    }
}

const ADXL: [Step; 2] = {
    let data = adxl355::DATA_BYTES as u8;
    [
        Step {
            converter: CONVERTERS as u8,
            first: 0,
            bytes: data,
        },
        Step {
            converter: CONVERTERS as u8,
            first: data,
            bytes: adxl355::REQUEST.len() as u8 - data,
        },
    ]
};

/// The bits of all converters.
pub(super) const ALL: u32 = (1 << CHIPS) - 1;
/// The bits of those with a DRDY line.
pub(super) const WITH_EDGES: u32 = (1 << CONVERTERS) - 1;

/// Fastest sample rate, Hz. The firmware's README says what it takes.
const FASTEST_HZ: f64 = 16384.0;
/// Fastest sample rate with two converters on a bus, Hz: at twice this rate their frames take 46 of a sample's 61 µs,
/// and what is left does not empty a buffer after a fault.
const SHARED_FASTEST_HZ: f64 = 8192.0;
/// Fastest sample rate with the ADXL355, whose filter gives 4000 values a second at most, Hz: at twice this rate
/// every second one would be a repetition.
const ADXL_FASTEST_HZ: f64 = 4096.0;

/// The fastest sample rate at which these converters, by bits, are read together, Hz.
#[must_use]
pub const fn fastest(read: u32) -> f64 {
    if read & !WITH_EDGES != 0 {
        ADXL_FASTEST_HZ
    } else if share_a_lane(read) {
        SHARED_FASTEST_HZ
    } else {
        FASTEST_HZ
    }
}

/// `true` if two of these converters, by bits, are read over one lane.
const fn share_a_lane(read: u32) -> bool {
    let mut lane = 0;
    while lane < LANES {
        let (mut step, mut converters) = (0, 0_u32);
        while step < ORDER[lane].len() {
            converters |= ORDER[lane][step].bit() & read;
            step += 1;
        }
        if converters.count_ones() > 1 {
            return true;
        }
        lane += 1;
    }
    false
}

/// The next sample rates below and above `rate` that these converters, by bits, have together, Hz; equal if they
/// have this rate.
pub(super) fn rates_near(rate: f64, read: u32) -> [f64; 2] {
    let fastest = fastest(read);
    Oversampling::neighbours(rate, CLOCK_HZ).map(|near| near.min(fastest))
}

/// The filters of an input's converter at a sample rate, Hz; `None` if the box has no such input.
#[must_use]
pub fn lowpass(input: usize, rate: f64) -> Option<Lowpass> {
    if input < CONVERTERS * registers::CHANNELS {
        Some(ads131m08::lowpass(rate))
    } else if input < INPUTS {
        Some(adxl355::Configuration::following(rate).lowpass())
    } else {
        None
    }
}

/// The converters of a box, behind their buses.
pub(super) struct Bank<A, D> {
    ads: [Ads131m08<A>; CONVERTERS],
    adxl: Adxl355<D>,
}

impl<A: SpiDevice, D: SpiDevice> Bank<A, D> {
    pub(super) fn new(ads: [A; CONVERTERS], adxl: D) -> Self {
        Self {
            ads: ads.map(|spi| Ads131m08::new(spi, ads131m08::Configuration::PLAIN)),
            adxl: Adxl355::new(adxl, adxl355::Configuration::following(0.0)),
        }
    }

    /// All converters, in the order of their inputs.
    pub(super) fn all(&mut self) -> [&mut dyn Converter; CHIPS] {
        let [a, b, c, d] = &mut self.ads;
        [a, b, c, d, &mut self.adxl]
    }
}
