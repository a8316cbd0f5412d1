//! Fields of a recording that are no readings.

use crate::X;
use crate::bench::Bench;

#[test]
fn a_field_that_is_no_reading_is_refused_by_its_line_and_channel() {
    for (field, words) in [
        ("1.2.3", "`1.2.3` is not a number … decimal point"),
        ("off", "`off` is not a number"),
        ("", "`` is not a number"),
        ("NaN", "NaN is not a finite reading … cut the recording"),
        ("-inf", "-inf is not a finite reading … cut the recording"),
        ("1e39", "1e39 is not a finite reading"),
    ] {
        let change = |row: usize, old: &str| if row == 100 { field } else { old }.to_owned();
        let bench = Bench::fork().channel(X, "a4", change);
        // Row 100 from 0 stands in line 102, below the header.
        bench.refused_input(&format!("{X} … line 102 … channel `a4` … {words}"));
    }
}

#[test]
fn short_row() {
    let cut = |text: &str| {
        let mut lines: Vec<&str> = text.lines().collect();
        lines[200] = "1,2,3";
        lines.join("\n") + "\n"
    };
    Bench::fork().edit(X, cut).refused_input(
        "lateral-x.csv … line 201 … 3 fields where the header has 19 … cut the recording before \
         this line",
    );
}
