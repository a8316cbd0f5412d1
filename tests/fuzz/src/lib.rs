//! Fuzz targets: each takes any bytes and panics if they break a promise of the project.
//!
//! | target | bytes are | promises beyond "does not panic, hang or fill the memory" |
//! | --- | --- | --- |
//! | [`wire`] | frames and noise on the link | what is sound is told from what is not as a second decoder does; chunks do not matter; what was read is written and read again |
//! | [`instrument`] | requests to the box, with samples and time between them | one reply each; what is refused changes nothing |
//! | [`setup`] | a set-up file | what is read is printed and read again |
//! | [`recording`] | a recording, plain or compressed | a plain table gives the numbers that a naive reader finds |
//! | [`inputs`] | a file of inputs | what is read is printed and read again; counts become finite numbers |
//! | [`flash`] | the box's settings in flash | what is saved is found again, whatever was there before |
//! | [`client`] | what a box answers to a host | every command ends; what `record` counts is in its file |
//!
//! `cargo xtask fuzz` runs them under libFuzzer, guided by coverage; the test `corpus` of this
//! crate repeats what was found in the folder `corpus` on every test run, without it.

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

/// A target's body.
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
