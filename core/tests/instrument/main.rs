//! The box as a state machine, promise by promise.

mod bench;
mod selftest;
mod sizes;
