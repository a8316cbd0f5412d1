//! A body without elastic modes and without noise through the whole chain: samples in CSV
//! files, spectra in f32, the solution in f64.

mod bench;

use bench::{Bench, identify, model, terms, value};
use massline::simulate::Options;

/// Bound of the relative error of each of the sixteen numbers: the project's goal. Samples and
/// twiddle factors are f32, 6e-8 relative, and the FFT adds a few of those; products of inertia are
/// a hundredth of the terms whose difference they are.
const BOUND: f64 = 1e-5;

fn worst_error(drive: bool) -> f64 {
    let options = Options {
        noise: Some(0.0),
        drive: Some(drive),
        ..Options::default()
    };
    let bench = Bench::shake(&model("rigid-body.toml"), &options);
    let answer = identify(&bench.setup);
    let (i, truth) = (&answer.identification, &bench.truth);
    let mut pairs = vec![(i.mass, Some(truth.mass))];
    pairs.extend(i.centre_of_gravity.into_iter().zip(truth.centre_of_gravity));
    let about_a = i.inertia_reference.into_iter();
    pairs.extend(about_a.zip(terms(&truth.inertia_reference)));
    pairs.extend(i.inertia_cg.into_iter().zip(terms(&truth.inertia_cg)));
    assert_eq!(pairs.len(), 16);
    pairs
        .into_iter()
        .map(|(found, truth)| (value(found) / truth.unwrap() - 1.0).abs())
        .fold(0.0, f64::max)
}

#[test]
fn all_ten_come_back_through_the_whole_chain() {
    let worst = worst_error(true);
    println!("worst relative error {worst:.2e}");
    assert!(worst < BOUND, "{worst:e}");
}

#[test]
fn all_ten_come_back_without_a_drive_channel() {
    let worst = worst_error(false);
    println!("worst relative error {worst:.2e}");
    assert!(worst < BOUND, "{worst:e}");
}
