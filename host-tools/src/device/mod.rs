//! The box next to the table, and everything that stands for it.
//!
//! * [`Port`] is an end of the link: bytes out, bytes in. [`Serial`] is one, [`Emulator`]
//!   another: the firmware in QEMU.
//! * [`firmware`] knows where the file is that is flashed and emulated.

pub mod emulator;
pub mod firmware;
mod port;
mod serial;

pub use emulator::{Emulator, EmulatorError};
pub use port::{Port, PortError};
pub use serial::{BAUD, Serial, names as serial_ports};
