//! The box as a state machine, promise by promise.

mod alignment;
mod answers;
mod bench;
mod capacity;
mod faults;
mod plan;
mod recorder;
mod refusals;
mod runs;
mod selftest;
mod shaken;
mod sizes;
mod unplugged;
