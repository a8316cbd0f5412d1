//! Fields of a recording that are no readings.

use crate::X;
use crate::bench::{Bench, Finished};

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
    with_field("1.2.3").refused_input(
        "lateral-x.csv … line 102 … channel `a4` … `1.2.3` is not a number … decimal point",
    );
    with_field("off")
        .refused_input("lateral-x.csv … line 102 … channel `a4` … `off` is not a number");
    with_field("").refused_input("lateral-x.csv … line 102 … channel `a4` … `` is not a number");
}

#[test]
fn nan() {
    with_field("NaN").refused_input(
        "lateral-x.csv … line 102 … channel `a4` … NaN is not a finite reading … cut the \
             recording",
    );
}

#[test]
fn infinity() {
    with_field("-inf").refused_input(
        "lateral-x.csv … line 102 … channel `a4` … -inf is not a finite reading … cut the \
             recording",
    );
    with_field("1e39")
        .refused_input("lateral-x.csv … line 102 … channel `a4` … 1e39 is not a finite reading");
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
    Bench::fork().edit(X, cut).identify(&[]).refused_input(
        "lateral-x.csv … line 201 … 3 fields where the header has 19 … cut the recording \
             before this line",
    );
}
