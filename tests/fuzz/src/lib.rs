//! Fuzz targets: each takes any bytes, and panics if a property of the project does not hold.
//!
//! | target | bytes are | properties beyond "does not panic, hang or fill the memory" |
//! | --- | --- | --- |
//! | [`wire`] | frames and noise on the link | a second decoder finds the same valid frames; chunks do not matter; messages that are read can be written and read again |
//! | [`instrument`] | requests to the box, with samples and time in between | one reply each; a refused request changes nothing |
//! | [`setup`] | a set-up file | a valid set-up can be printed and read again |
//! | [`recording`] | a recording, plain or compressed | a plain table has the numbers that a simple reader finds |
//! | [`inputs`] | a file of inputs | valid inputs can be printed and read again; counts become finite numbers |
//! | [`flash`] | the box's settings in flash | saved settings are found again, whatever was there before |
//! | [`client`] | answers of a box to a host | every command ends; `record` counts the samples in its file |
//!
//! `cargo xtask fuzz` runs them under libFuzzer, guided by coverage; the test `corpus` of this
//! crate repeats the inputs of the folder `corpus` on every test run, without it.

#![forbid(unsafe_code)]

pub mod bench;
pub mod client;
pub mod flash;
pub mod inputs;
pub mod instrument;
pub mod link;
pub mod recording;
pub mod scratch;
pub mod script;
pub mod seeds;
pub mod setup;
pub mod wire;

/// Body of a target.
pub type Run = fn(&[u8]);

/// All targets, by the names of their programs and of their folders of inputs.
pub const TARGETS: [(&str, Run); 7] = [
    ("wire", wire::run),
    ("instrument", instrument::run),
    ("setup", setup::run),
    ("recording", recording::run),
    ("inputs", inputs::run),
    ("flash", flash::run),
    ("client", client::run),
];
