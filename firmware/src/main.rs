//! The box next to the shaking table: `massline-core` on an STM32F405.
//!
//! This is what only the box has: the tasks and pins of a chip ([`board`]), and the application
//! that connects them with the library `massline_firmware` ([`app`], [`services`],
//! [`settings_store`], [`faults`]), and arithmetic that its processor lacks ([`aeabi`]). [`board`] alone
//! names the chip.
//!
//! ```text
//! cargo build --profile chip -p massline-firmware --target thumbv7em-none-eabihf
//! ```
//!
//! The ELF that this produces also boots in the emulator; `cargo xtask test` does that.

#![cfg_attr(target_os = "none", no_std, no_main)]
#![deny(missing_docs)]

#[cfg(target_os = "none")]
mod aeabi;
#[cfg(target_os = "none")]
mod app;
#[cfg(target_os = "none")]
mod board;
#[cfg(target_os = "none")]
mod build_id;
#[cfg(target_os = "none")]
mod faults;
#[cfg(target_os = "none")]
mod services;
#[cfg(target_os = "none")]
mod settings_store;
#[cfg(target_os = "none")]
mod stack;

// Linked for what it defines: the log's transport.
#[cfg(target_os = "none")]
use defmt_rtt as _;

/// Says how to build the firmware, since a host cannot run it.
#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    eprintln!(
        "massline-firmware runs on the STM32F405, not here.\n\
         build:    cargo build --profile chip -p massline-firmware --target thumbv7em-none-eabihf\n\
         emulate:  cargo xtask test --only emulator"
    );
    std::process::ExitCode::from(2)
}
