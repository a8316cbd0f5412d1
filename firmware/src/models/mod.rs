//! Converters made of software, register by register, after their data sheets: what drivers and
//! the acquisition are tested against, and what stands in for hardware on a host.
//!
//! | file | holds |
//! | --- | --- |
//! | [`ads131m08`] | the chip: registers, frames, conversions |
//! | [`adxl355`] | the accelerometer |
//! | [`flash`] | a flash that loses power, and whose bits flip |
//! | [`rig`] | some ADS131M08 on one clock, with time, and what can go wrong on the way |
//! | [`pattern`] | a converter that is not there, whose counts tell what they are |
//! | [`injector`] | faults at random, and what they should be counted as |
//! | [`random`] | random numbers |

pub mod ads131m08;
pub mod adxl355;
pub mod flash;
pub mod injector;
pub mod pattern;
pub mod random;
pub mod rig;

/// Why a model of a bus refuses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusError {
    /// The bus was made to fail.
    Failed,
    /// An operation that the models do not know: they exchange in place.
    Unsupported,
}

impl embedded_hal::spi::Error for BusError {
    fn kind(&self) -> embedded_hal::spi::ErrorKind {
        embedded_hal::spi::ErrorKind::Other
    }
}
