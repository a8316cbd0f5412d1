//! Builds for a chip: `cargo build -p massline-core --example on_chip --target thumbv7em-none-eabihf`.
//!
//! It is a library, so that it needs no run-time of a certain chip: firmware would hold the memory
//! in a static and call these from its tasks.

#![no_std]

mod weigher;

pub use weigher::{RUNS, Refusal, SAMPLE_RATE, Weigher};
