//! The half of the firmware that knows neither chip nor board, so that hosts build it and test
//! it: what the tasks of the binary call.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod acquisition;
pub mod calibration;
pub mod drivers;
pub mod instrument;
pub mod link_rate;
pub mod models;
pub mod retained;
pub mod roll_call;
pub mod sampling;
pub mod settings;
pub mod wire;
