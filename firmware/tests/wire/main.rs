//! The link between host and box, as its two ends see it.

mod abuse;
mod any_bytes;
mod draw;
mod golden;
mod messages;
mod reference;
mod round_trip;
