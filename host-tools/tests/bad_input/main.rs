//! Bad input as a user meets it: the real binary refuses it in one sentence that says
//! where, what and what to do, with exit code 1 (the data do not allow an answer) or 2
//! (unreadable input).

mod channels;
mod files;
mod readings;
mod setups;
mod times;

#[path = "../bench/mod.rs"]
mod bench;

use bench::{Bench, RECORDINGS};

/// The file most complaints are about, and its fourth accelerometer.
const X: &str = RECORDINGS[0];

#[test]
fn what_is_spoilt_below_was_good() {
    let finished = Bench::fork().identify(&[]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
}
