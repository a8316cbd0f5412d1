//! What the end-to-end tests share: the firmware in an emulator, and the command that runs all
//! tests of the project.
//!
//! * [`emulator`] boots the ELF that is flashed and talks to it over its serial link.
//! * [`xtask`] is `cargo xtask test`: everything a change has to pass, on a machine that may have
//!   nothing but cargo.

#![forbid(unsafe_code)]

pub mod emulator;
pub mod xtask;
