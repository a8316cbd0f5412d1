//! Gradient, leakage and bound beside independent computations.

use super::descent::{Freedom, OFFSET, Problem};
use super::normal::Detail;
use super::*;
use crate::simulate::Stream;
use nalgebra::{Complex, Matrix6, Vector6};

fn body() -> [f64; RIGID] {
    [12.0, 1.2, -0.6, 3.0, 2.0, 2.5, 1.5, 0.1, -0.2, 0.15]
}

fn two_modes(runs: usize) -> Model {
    let mut model = Model::rigid(body(), 60.0, runs);
    model.push(FittedMode::new(
        30.0,
        0.01,
        Vector6::new(2.0, 0.3, -0.2, 0.1, 0.8, 0.05),
    ));
    model.push(FittedMode::new(
        44.0,
        0.02,
        Vector6::new(-0.2, 1.5, 0.4, -0.6, 0.1, 0.2),
    ));
    model
}

/// A record of random base accelerations, whose forces are those of the model but for noise.
fn record(model: &Model, run: usize, lines: usize, noisy: bool) -> Record {
    let mut stream = Stream::new(3, &["likelihood", &run.to_string()]);
    let noise = Noise {
        base: Matrix6::from_diagonal(&Vector6::repeat(1e-4)) + Matrix6::repeat(2e-5),
        force: Matrix6::from_diagonal(&Vector6::new(0.1, 0.2, 0.1, 0.02, 0.03, 0.01)),
    };
    let root = |m: &Matrix6<f64>| m.cholesky().map(|c| c.l()).unwrap_or_else(Matrix6::zeros);
    let (base_root, force_root) = (root(&noise.base), root(&noise.force));
    let mut record = Record {
        run,
        frequencies: Vec::new(),
        base: Vec::new(),
        force: Vec::new(),
        noise,
        level: Vec::new(),
        equations: Matrix6::identity(),
    };
    let share = if noisy {
        std::f64::consts::FRAC_1_SQRT_2
    } else {
        0.0
    };
    for k in 0..lines {
        let frequency = 1.0 + 59.0 * (k + 1) as f64 / lines as f64;
        let base = Complex6::from_fn(|_, _| stream.normal());
        let mut draw = |root: &Matrix6<f64>| {
            let white = Complex6::from_fn(|_, _| stream.normal() * share);
            root.map(Complex::from) * white
        };
        let (na, nf) = (draw(&base_root), draw(&force_root));
        record.frequencies.push(frequency);
        record.force.push(model.at(run, frequency) * base + nf);
        record.base.push(base + na);
    }
    record
}

/// A model near the true one, with every kind of parameter away from its default.
fn away(truth: &Model) -> Model {
    let mut model = truth.clone();
    model.upper = Some(core::array::from_fn(|i| 0.01 * (i as f64 - 10.0)));
    model.rigid[0] += 0.1;
    model.modes[0].ln_frequency += 3e-3;
    model.modes[1].exponent = 0.4;
    model.offsets[1][0] = [2e-3, -0.02];
    model
}

/// V is a sum of some 2000 squares up to 1e7, whose rounding a central difference of step h
/// divides by h: 1e-9 / 1e-5 of a gradient of 1e4 and more. What the difference itself errs by is
/// h² times a third derivative, relative (h / ζ)² = 1e-6 where h = 1e-5.
#[test]
fn the_gradient_is_that_of_differences() {
    let truth = two_modes(2);
    let records = [record(&truth, 0, 60, true), record(&truth, 1, 80, true)];
    let model = away(&truth);
    for leakage in [false, true] {
        let problem = Problem {
            records: &records,
            leakage,
            threads: 1,
        };
        let system = problem.system(&model, Freedom::ALL, Detail::Step).unwrap();
        let at = |i: usize, h: f64| {
            let mut step = vec![0.0; model.parameters()];
            step[i] = h;
            let mut moved = model.clone();
            moved.step(&step);
            problem.misfit(&moved, Freedom::ALL).unwrap()
        };
        for i in 0..model.parameters() {
            let h = 1e-5;
            let slope = (at(i, h) - at(i, -h)) / (2.0 * h);
            let exact = -2.0 * system.score[i];
            // Of the typical slope: V falls by about its information times a step.
            let size = exact.abs().max(system.information[(i, i)] * 1e-2);
            assert!(
                (slope - exact).abs() < 1e-4 * size,
                "leakage {leakage}, parameter {i}: {slope} against {exact}"
            );
        }
    }
}

/// Prior squares are part of V: half of (δ/σ)².
#[test]
fn offsets_cost_what_their_prior_says() {
    let truth = two_modes(2);
    let records = [record(&truth, 0, 20, false)];
    let problem = Problem {
        records: &records,
        leakage: false,
        threads: 1,
    };
    let before = problem.misfit(&truth, Freedom::ALL).unwrap();
    let mut model = truth.clone();
    // The record is of run 0, so that only the prior sees run 1.
    model.offsets[1][0] = [OFFSET, 0.0];
    let after = problem.misfit(&model, Freedom::ALL).unwrap();
    assert!((after - before - 0.5).abs() < 1e-9, "{before} {after}");
}
