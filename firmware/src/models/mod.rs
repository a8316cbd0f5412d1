//! Models of converters and memories at the level of registers, after their data sheets: drivers
//! and the acquisition are tested against them, and on a host they replace the hardware.
//!
//! | file | holds |
//! | --- | --- |
//! | [`ads131m08`] | the converter ADS131M08: registers, frames, conversions |
//! | [`adxl355`] | the accelerometer ADXL355 |
//! | [`flash`] | a NOR flash with power cuts and wrong bits |
//! | [`rig`] | some ADS131M08 on one clock, with time and faults of wires |
//! | [`lanes`] | buses that exchange frames by themselves |
//! | [`pattern`] | a converter of test patterns |
//! | [`injector`] | random faults, with the counters they should raise |
//! | [`random`] | random numbers |
//! | [`setup`] | a small set-up, for tests and the self-test |

pub mod ads131m08;
pub mod adxl355;
pub mod flash;
pub mod injector;
pub mod lanes;
pub mod pattern;
pub mod random;
pub mod rig;
pub mod setup;

/// Error of a model of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusError {
    /// An injected fault of the bus.
    Failed,
    /// An operation other than an exchange in place or a delay.
    Unsupported,
}

impl embedded_hal::spi::Error for BusError {
    fn kind(&self) -> embedded_hal::spi::ErrorKind {
        embedded_hal::spi::ErrorKind::Other
    }
}
