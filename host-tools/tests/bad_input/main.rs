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

use bench::{Bench, Finished, RECORDINGS};

/// The file most complaints are about, and its fourth accelerometer.
const X: &str = RECORDINGS[0];

/// Asserts a refusal: exit code, nothing on stdout, one line on stderr with these words.
#[track_caller]
fn refused(finished: &Finished, code: i32, words: &[&str]) {
    println!("{}", finished.stderr.trim_end());
    assert_eq!(finished.code, Some(code), "{}", finished.stderr);
    assert_eq!(finished.stdout, "");
    let line = finished.stderr.strip_prefix("error: ").unwrap();
    assert_eq!(line.lines().count(), 1, "one sentence: {line}");
    assert!(!line.contains('\u{1b}'), "colours without a terminal");
    assert!(!line.contains("panicked"));
    for word in words {
        assert!(line.contains(word), "«{word}» is not in: {line}");
    }
}

#[test]
fn what_is_spoilt_below_was_good() {
    let finished = Bench::fork().identify(&[]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
}
