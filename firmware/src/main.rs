//! The box next to the shaking table: `massline-core` on an STM32F405.
//!
//! This file holds the tasks and nothing else. Pins and peripherals are in [`board`], the choice
//! of clock in [`clocks`], what goes over the serial port in [`link`].
//!
//! The chip is the only target on which this binary does its job:
//!
//! ```text
//! cargo build --release -p massline-firmware --target thumbv7em-none-eabihf
//! ```
//!
//! The very ELF this produces also boots in the emulator; `cargo xtask test` does that.

#![cfg_attr(target_os = "none", no_std, no_main)]
#![deny(missing_docs)]

#[cfg(target_os = "none")]
mod board;
#[cfg(target_os = "none")]
mod clocks;
#[cfg(target_os = "none")]
mod link;

// Linked for what they define: the log's transport and the panic handler, which logs and stops.
#[cfg(target_os = "none")]
use {defmt_rtt as _, panic_probe as _};

#[cfg(target_os = "none")]
#[rtic::app(device = stm32f4xx_hal::pac)]
mod app {
    use crate::board::{self, Board, LinkTx};
    use crate::clocks::Clock;
    use crate::link;

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        clock: Clock,
        link_tx: LinkTx,
    }

    #[init]
    fn init(cx: init::Context) -> (Shared, Local) {
        match Board::start(cx.device) {
            Ok(Board { clock, link_tx }) => (Shared {}, Local { clock, link_tx }),
            Err(fault) => board::halt(fault),
        }
    }

    // The greeting is sent from here, not from `init`, which runs with interrupts masked: at
    // 921600 baud a line takes half a millisecond that sampling must not lose.
    #[idle(local = [clock, link_tx])]
    fn idle(cx: idle::Context) -> ! {
        if link::greet(cx.local.link_tx, cx.local.clock).is_err() {
            defmt::warn!("the greeting did not go out");
        }
        loop {
            cortex_m::asm::wfi();
        }
    }
}

/// Says how to build the firmware, since a host cannot run it.
#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    eprintln!(
        "massline-firmware runs on the STM32F405, not here.\n\
         build:    cargo build --release -p massline-firmware --target thumbv7em-none-eabihf\n\
         emulate:  cargo xtask test --only emulator"
    );
    std::process::ExitCode::from(2)
}
