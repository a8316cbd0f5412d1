//! The ELF that is flashed, in the emulator: its answers, and its behaviour under faults.
//!
//! Tests in files and folders named `firmware_*` need the firmware and QEMU. They are ignored by
//! a plain `cargo test`; `cargo xtask test` provides both and runs them.

mod abuse;
// The module borrowed from core's tests is used in part.
#[allow(dead_code)]
#[path = "../../../firmware/tests/instrument/bench.rs"]
mod bench;
mod budgets;
mod costs;
#[allow(dead_code)]
#[path = "../../../firmware/tests/wire/draw.rs"]
mod draw;
mod faults;
#[path = "../../../firmware/tests/protocol/frames.rs"]
mod frames;
mod golden;
mod hello;
mod hostile;
mod memory;
#[allow(dead_code)]
#[path = "../../../firmware/tests/wire/messages.rs"]
mod messages;
#[path = "../../../firmware/tests/protocol/random.rs"]
mod random;
#[allow(dead_code)]
#[path = "../../../firmware/tests/wire/reference.rs"]
mod reference;
mod sampling;
mod talk;
