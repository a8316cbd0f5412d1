//! Fields of a recording that are no readings.

use crate::bench::{Bench, Finished};
use crate::{X, refused};

/// Row 100 from 0 stands in line 102, below the header.
fn with_field(field: &str) -> Finished {
    let change = |row: usize, old: &str| {
        if row == 100 {
            field.to_owned()
        } else {
            old.to_owned()
        }
    };
    Bench::fork().channel(X, "a4", change).identify(&[])
}

#[test]
fn text_in_a_number() {
    refused(
        &with_field("1.2.3"),
        2,
        &[
            X,
            "line 102",
            "channel `a4`",
            "`1.2.3` is not a number",
            "decimal point",
        ],
    );
    refused(
        &with_field("off"),
        2,
        &[X, "line 102", "channel `a4`", "`off` is not a number"],
    );
    refused(
        &with_field(""),
        2,
        &[X, "line 102", "channel `a4`", "`` is not a number"],
    );
}

#[test]
fn nan() {
    refused(
        &with_field("NaN"),
        2,
        &[
            X,
            "line 102",
            "channel `a4`",
            "NaN is not a finite reading",
            "cut the recording",
        ],
    );
}

#[test]
fn infinity() {
    refused(
        &with_field("-inf"),
        2,
        &[
            X,
            "line 102",
            "channel `a4`",
            "-inf is not a finite reading",
            "cut the recording",
        ],
    );
    refused(
        &with_field("1e39"),
        2,
        &[
            X,
            "line 102",
            "channel `a4`",
            "1e39 is not a finite reading",
        ],
    );
}

#[test]
fn short_row() {
    let cut = |text: &str| {
        text.lines()
            .enumerate()
            .map(|(n, l)| {
                if n == 200 {
                    "1,2,3\n".to_owned()
                } else {
                    format!("{l}\n")
                }
            })
            .collect()
    };
    let finished = Bench::fork().edit(X, cut).identify(&[]);
    refused(
        &finished,
        2,
        &[
            X,
            "line 201",
            "3 fields where the header has 19",
            "cut the recording before this line",
        ],
    );
}
