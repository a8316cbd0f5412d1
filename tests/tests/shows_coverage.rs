//! The share of 95 % intervals that hold the truth. The table is `massline study coverage`; these
//! tests check the counting itself.

use massline::study::coverage::{self, Coverage, Options};

fn count(cases: &[&str], draws: usize, threads: usize) -> Coverage {
    let options = Options {
        draws,
        cases: cases.iter().map(|&name| name.to_owned()).collect(),
        threads: Some(threads),
        ..Options::default()
    };
    coverage::run(&options, &mut |_, _| ()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn counts_do_not_depend_on_threads() {
    let cases = ["fork", "elastic", "sine", "poses"];
    let one = count(&cases, 2, 1);
    assert_eq!(one.cells, count(&cases, 2, 4).cells);
    assert!(one.cells.iter().all(|cell| cell.tally.draws == 2));
}

#[test]
fn every_case_gives_numbers_that_its_truth_knows() {
    let found = count(&[], 1, 2);
    assert_eq!(found.cases.len(), coverage::case_names().len());
    for (name, _) in &found.cases {
        let of_case = found.over(|cell| cell.case == *name && cell.method.is_none());
        assert!(of_case.numbers[1].given > 0, "{name}: {of_case:?}");
    }
    // A plane model does not determine y, so no number may be given for it.
    let fork = found.over(|cell| cell.case == "fork");
    assert_eq!(fork.numbers[2].given, 0);
}

#[test]
fn wrong_options_are_named() {
    let error = |options: Options| match coverage::run(&options, &mut |_, _| ()) {
        Ok(_) => panic!("taken"),
        Err(error) => error.to_string(),
    };
    let cases = vec!["spoon".to_owned()];
    assert!(
        error(Options {
            cases,
            ..Options::default()
        })
        .contains("spoon: expected one of fork, satellite")
    );
    let noise = vec![0.01, f64::NAN];
    assert!(
        error(Options {
            noise,
            ..Options::default()
        })
        .starts_with("--noise NaN")
    );
    let none = Options {
        draws: 0,
        ..Options::default()
    };
    assert!(error(none).starts_with("--draws 0"));
}
