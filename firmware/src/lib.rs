//! The box without a chip: everything of the firmware that knows neither chip nor board, so that
//! hosts build it, test it and run it.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod acquisition;
pub mod calibration;
pub mod capacity;
pub mod crystal;
pub mod double;
pub mod drivers;
pub mod instrument;
pub mod link;
pub mod model_board;
pub mod models;
pub mod retained;
pub mod sampling;
pub mod settings;
pub mod status_light;
pub mod task_watchdog;
pub mod wire;
