//! The box next to the table, and everything that stands for it.
//!
//! * [`Port`] is an end of the link: bytes out, bytes in. [`Serial`] is one, [`Emulator`]
//!   another: the firmware in QEMU. [`HostBox`] is the box in this program.
//! * [`Client`] is the conversation over any of them.
//! * [`firmware`] knows where the file is that is flashed and emulated.

mod client;
mod cut_line;
pub mod emulator;
#[cfg(test)]
pub(crate) mod failing;
pub mod firmware;
mod host_board;
mod host_box;
mod noisy_line;
pub(crate) mod port;
mod serial;
#[cfg(test)]
mod tests;

pub use client::{
    BoxInfo, Client, ClientError, ClientMemory, LinkReport, SampleSource, StreamError,
};
pub use cut_line::{Cut, CutLine, Place};
pub use emulator::{Emulator, EmulatorError};
pub use host_box::{HostBox, HostBoxMemory};
pub use noisy_line::{Damage, Noise, NoisyLine};
pub use port::{Port, PortError};
pub use serial::{BAUD, Serial, names as serial_ports};
