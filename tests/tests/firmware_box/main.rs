//! The ELF that is flashed, in the emulator: what the box says of itself, and what becomes of it
//! when things go wrong.
//!
//! Tests in files and folders named `firmware_*` need the firmware and QEMU. They are ignored by
//! a plain `cargo test`; `cargo xtask test` builds what they need and runs them.

mod abuse;
mod budgets;
mod faults;
mod golden;
mod hello;
mod memory;
mod sampling;
mod talk;
