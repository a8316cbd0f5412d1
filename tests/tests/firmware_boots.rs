//! The ELF that is flashed boots in the emulator and says who it is.
//!
//! Tests in files named `firmware_*` need the firmware and QEMU. They are ignored by a plain
//! `cargo test`; `cargo xtask test` builds what they need and runs them.

use std::time::Duration;

use massline::device::{Emulator, firmware};

/// How long a boot may take before the test gives up; it takes well under a second.
const PATIENCE: Duration = Duration::from_secs(30);

// The emulator raises neither "crystal ready" nor "PLL locked", so the last fallback must run.
#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn greets_and_reports_the_clock_that_runs() {
    let elf = firmware::find(None).unwrap_or_else(|error| panic!("{error}"));
    let mut board = Emulator::start(&elf).unwrap_or_else(|error| panic!("{error}"));
    let greeting = board
        .read_line(PATIENCE)
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(
        greeting,
        concat!(
            "massline ",
            env!("CARGO_PKG_VERSION"),
            " STM32F405 clock=hsi 16000000 Hz\r\n"
        )
    );
}

#[test]
fn xtask_and_the_host_tool_name_firmware_and_emulator_alike() {
    use massline::device::emulator;
    use massline_tests::emulator as xtask;
    assert_eq!(firmware::FIRMWARE_ELF, xtask::FIRMWARE_ELF);
    assert_eq!(emulator::QEMU, xtask::QEMU);
    assert_eq!(emulator::DEFAULT_PROGRAM, xtask::DEFAULT_PROGRAM);
}
