//! Benchmarks that anyone can run: costs beside those of what a user would take instead.

pub mod host;
