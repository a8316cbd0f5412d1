//! Sound tests are hardly ever called inconsistent: the distribution that
//! [`crate::identification::Consistency`] claims, beside draws.

use super::coverage::test_of;
use super::trial::Trial;
use crate::identification::WARNED;
use crate::parallel;

/// Draws of one kind of test.
const DRAWS: usize = 200;

/// Probabilities of sound draws, ascending: uniform between 0 and 1 if the distribution is right.
fn probabilities(case: &'static str) -> Vec<f64> {
    let one = |number: usize| -> Result<f64, String> {
        let (model, conditions) = test_of(case, 1 + number as u64)?;
        let trial = Trial::new(model, 1 + number as u64, &conditions).map_err(|e| e.to_string())?;
        let answers = trial
            .whole_answers(0.01, &[None])
            .map_err(|e| e.to_string())?;
        let answer = answers.into_iter().next().ok_or("no answer")??;
        let test = answer.consistency.ok_or("nothing is left over")?;
        Ok(test.probability)
    };
    let drawn = parallel::each(DRAWS, None, &one, &mut |_, _| ());
    let mut all = drawn
        .map(|(all, _)| all)
        .unwrap_or_else(|e| panic!("{case}: {e}"));
    all.sort_by(f64::total_cmp);
    all
}

fn below(all: &[f64], level: f64) -> usize {
    all.iter().filter(|p| **p < level).count()
}

/// Of 200 sound tests 0.2 fall below the level of a warning; four or more do so once in 18,000
/// times (binomial). Below 5 % lie 10; more than 25 do so once in 25,000 times.
fn check(case: &'static str) {
    let all = probabilities(case);
    let counts = [WARNED, 0.01, 0.05, 0.25, 0.5, 0.75].map(|level| below(&all, level));
    println!("{case}: {counts:?} of {DRAWS} below 0.001, 0.01, 0.05, 0.25, 0.5, 0.75");
    assert!(counts[0] <= 3, "{case}: {counts:?}");
    assert!(counts[2] <= 25, "{case}: {counts:?}");
    // A test that never speaks were none: of 200, 50 lie below a quarter, and fewer than 20 do so
    // once in 10⁷ times.
    assert!(counts[3] >= 20, "{case}: {counts:?}");
}

#[test]
fn random_runs_give_no_false_alarms() {
    check("twelve-blocks");
}

#[test]
fn plane_runs_give_no_false_alarms() {
    check("fork");
}

#[test]
fn stepped_sines_give_no_false_alarms() {
    check("sine");
}

#[test]
fn poses_give_no_false_alarms() {
    check("poses");
}
