//! The box as a state machine, promise by promise.

mod answers;
mod bench;
mod capacity;
mod faults;
mod plan;
mod recorder;
mod refusals;
mod runs;
mod selftest;
mod sizes;
mod unplugged;
