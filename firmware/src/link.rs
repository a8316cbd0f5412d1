//! What the box says to the host.

use core::fmt::{self, Write};

use crate::clocks::Clock;

/// Name the box answers by.
const NAME: &str = "massline";
/// Chip the firmware was built for.
const CHIP: &str = "STM32F405";

/// Says who is there and on which clock, in one line that ends in CR LF:
/// `massline 0.1.0 STM32F405 clock=hsi 16000000 Hz`.
///
/// # Errors
///
/// Those of `out`.
pub fn greet(out: &mut impl Write, clock: &Clock) -> fmt::Result {
    write!(
        out,
        "{NAME} {version} {CHIP} clock={source} {hertz} Hz\r\n",
        version = env!("CARGO_PKG_VERSION"),
        source = clock.source,
        hertz = clock.core.raw(),
    )
}
