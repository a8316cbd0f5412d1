//! From a bench full of cables to a setup that is right.

#[path = "../bench/mod.rs"]
mod bench;
mod corner;
mod delay;
mod init;
mod shorthand;
mod test;
mod units;
