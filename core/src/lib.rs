#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod geometry;
pub mod identify;
pub mod masslines;
pub mod modes;
pub mod rigid_body;
pub mod spectra;
pub mod weighting;

pub use nalgebra;

mod algebra;
mod cells;
