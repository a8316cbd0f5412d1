#![doc = include_str!("../README.md")]

pub mod acquire;
pub mod box_runs;
pub mod bringup;
pub mod cli;
pub mod commands;
pub mod detective;
pub mod device;
#[cfg(test)]
#[path = "../../core/tests/draws/mod.rs"]
mod draws;
pub mod export;
pub mod format;
pub mod frame;
pub mod identification;
mod init;
pub mod inputs;
pub mod journal;
pub mod likelihood;
pub mod limits;
pub mod measure;
pub mod on_box;
pub mod output;
mod parallel;
pub mod prediction;
pub mod printable;
pub mod recording;
pub mod replay;
pub mod report;
pub mod result;
pub mod rig;
pub mod sample_rate;
pub mod setup;
pub mod simulate;
pub mod study;
