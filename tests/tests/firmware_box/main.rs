//! The ELF that is flashed, in the emulator: what the box says of itself, and what becomes of it
//! when things go wrong.
//!
//! Tests in files and folders named `firmware_*` need the firmware and QEMU. They are ignored by
//! a plain `cargo test`; `cargo xtask test` builds what they need and runs them.

mod abuse;
// What is borrowed from core's tests is used in part.
#[allow(dead_code)]
#[path = "../../../core/tests/instrument/bench.rs"]
mod bench;
mod budgets;
mod costs;
#[allow(dead_code)]
#[path = "../../../core/tests/wire/draw.rs"]
mod draw;
mod faults;
#[path = "../../../core/tests/protocol/frames.rs"]
mod frames;
mod golden;
mod hello;
mod hostile;
mod memory;
#[allow(dead_code)]
#[path = "../../../core/tests/wire/messages.rs"]
mod messages;
#[allow(dead_code)]
#[path = "../../../core/tests/wire/parts.rs"]
mod parts;
#[allow(dead_code)]
#[path = "../../../core/tests/wire/problems.rs"]
mod problems;
#[path = "../../../core/tests/protocol/random.rs"]
mod random;
#[allow(dead_code)]
#[path = "../../../core/tests/wire/reference.rs"]
mod reference;
mod sampling;
mod talk;
