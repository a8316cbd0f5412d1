//! Gradient, leakage and bound beside independent computations.

mod about;
mod directions;

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

/// Variance of sensors that tell rotations badly, (rad/s²)².
const RESTING: f64 = 0.03;
/// Rotation per translation that 900 lines of this noise, and translations with a variance of two,
/// just hide: √(RESTING / 2 / (900 · 2)).
const HIDDEN: f64 = 0.0029;

/// A record of random base accelerations, whose forces are those of the model but for noise.
fn record(model: &Model, run: usize, lines: usize, noisy: bool) -> Record {
    moving((6, 1.0), 3, model, run, lines, noisy)
}

/// The same whose base moves along the first directions only, and along the others by `size` times as much as its
/// noise just hides.
fn moving(
    (directions, size): (usize, f64),
    seed: u64,
    model: &Model,
    run: usize,
    lines: usize,
    noisy: bool,
) -> Record {
    let mut stream = Stream::new(seed, &["likelihood", &run.to_string()]);
    let resting = Matrix6::from_fn(|i, j| {
        if i == j && i >= directions {
            RESTING
        } else {
            0.0
        }
    });
    let noise = Noise {
        base: Matrix6::from_diagonal(&Vector6::repeat(1e-4)) + Matrix6::repeat(2e-5) + resting,
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
    let mut tilt = Stream::new(seed, &["tilt"]);
    let tilt = Matrix6::from_fn(|i, j| {
        let drawn = size * HIDDEN * tilt.normal().re;
        if i >= directions && j < directions {
            drawn
        } else {
            0.0
        }
    });
    for k in 0..lines {
        let frequency = 1.0 + 59.0 * (k + 1) as f64 / lines as f64;
        let base = Complex6::from_fn(|i, _| {
            let drawn = stream.normal();
            if i < directions {
                drawn
            } else {
                Complex::new(0.0, 0.0)
            }
        });
        let base = base + tilt.map(Complex::from) * base;
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
    gradient_is_that_of_differences(&records, &away(&truth));
}

fn gradient_is_that_of_differences(records: &[Record], model: &Model) {
    for leakage in [false, true] {
        let problem = Problem::new(records, leakage, 1);
        let system = problem
            .system(model, Freedom::all([true; RIGID]), Detail::Step)
            .unwrap();
        let at = |i: usize, h: f64| {
            let mut step = vec![0.0; model.parameters()];
            step[i] = h;
            let mut moved = model.clone();
            moved.step(&step);
            problem
                .misfit(&moved, Freedom::all([true; RIGID]))
                .unwrap()
                .0
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

/// An orthogonal matrix that mixes forces and moments.
fn mixed() -> Matrix6<f64> {
    let mut stream = Stream::new(7, &["equations"]);
    Matrix6::from_fn(|_, _| stream.normal().re).qr().q()
}

/// Equations of motion that are turned among each other say the same: V and its slopes are equal but for
/// some thousand roundings.
#[test]
fn equations_may_be_turned() {
    let truth = two_modes(2);
    let records = [record(&truth, 0, 60, true), record(&truth, 1, 80, true)];
    let turned = records.clone().map(|r| Record {
        equations: mixed(),
        ..r
    });
    let model = away(&truth);
    for leakage in [false, true] {
        let of = |records: &[Record]| {
            Problem::new(records, leakage, 1)
                .system(&model, Freedom::all([true; RIGID]), Detail::Test)
                .unwrap()
        };
        let (a, b) = (of(&records), of(&turned));
        assert!((a.misfit / b.misfit - 1.0).abs() < 1e-10);
        for i in 0..model.parameters() {
            let of = |m: &nalgebra::DMatrix<f64>, i: usize| m[(i, i)].max(1e-12);
            let size = of(&a.information, i).sqrt();
            assert!(
                (a.score[i] - b.score[i]).abs() < 1e-9 * size * a.misfit.sqrt(),
                "leakage {leakage}, slope {i}"
            );
            for j in 0..model.parameters() {
                let size = size * of(&a.information, j).sqrt();
                assert!(
                    (a.information[(i, j)] - b.information[(i, j)]).abs() < 1e-8 * size,
                    "leakage {leakage}, information {i} {j}"
                );
            }
        }
        for (a, b) in a
            .residuals
            .iter()
            .flatten()
            .zip(b.residuals.iter().flatten())
        {
            assert!((a / b - 1.0).abs() < 1e-8, "leakage {leakage}: {a} {b}");
        }
    }
}

/// Some of the equations are measured, and not each for itself: the gradient is that of differences, as
/// accurate as with all of them.
#[test]
fn some_equations_have_their_gradient() {
    let truth = two_modes(2);
    let mut equations = mixed();
    equations.fill_row(1, 0.0);
    equations.fill_row(4, 0.0);
    let records = [60, 80].map(|lines| Record {
        equations,
        ..record(&truth, usize::from(lines == 80), lines, true)
    });
    gradient_is_that_of_differences(&records, &away(&truth));
}

/// One line after the other or four at a time: the same bits.
#[test]
fn lanes_do_not_change_bits() {
    use super::leakage::leakage;
    use super::normal::{all_sums, evaluation, misfit, sums};
    let truth = two_modes(2);
    let record = record(&truth, 0, 77, true);
    let model = away(&truth);
    let scalar = pulp::Scalar::new();
    for leaks in [false, true] {
        let wide = misfit(&record, &model, leaks).unwrap();
        let narrow = leakage(scalar, &evaluation(&record, &model, leaks)).unwrap();
        assert_eq!(wide.misfit.to_bits(), narrow.misfit.to_bits());
        assert_eq!(wide.coefficients, narrow.coefficients);
        for detail in [Detail::Step, Detail::Test] {
            let wide = sums(&record, &model, detail, leaks, &wide).unwrap();
            let evaluation = evaluation(&record, &model, leaks);
            let narrow = all_sums(scalar, &evaluation, detail, &narrow).unwrap();
            assert_eq!(wide.information, narrow.information);
            assert_eq!(wide.score, narrow.score);
            assert_eq!(wide.residuals, narrow.residuals);
        }
    }
}

/// A mode that moves between the runs, and one whose damping is not viscous, leave residuals of some hundred times
/// the noise beside a mode that does neither. Each is one mode all the same, and is found where it is.
#[test]
fn modes_that_move_between_runs_are_not_several() {
    let mut truth = two_modes(3);
    truth.offsets[1][0] = [-0.005, 0.0];
    truth.modes[1].exponent = 0.0;
    let records: Vec<Record> = (0..3).map(|run| record(&truth, run, 400, true)).collect();
    let options = Options {
        threads: 1,
        ..Options::default()
    };
    let fit = fit(&records, &options, &mut |_| ()).unwrap();
    let found: Vec<f64> = fit.model.modes.iter().map(FittedMode::frequency).collect();
    assert_eq!(found.len(), 2, "{found:?}");
    for (r, mode) in truth.modes.iter().enumerate() {
        let (first, moved) = (truth.mode_in(0, r).0, truth.mode_in(1, r).0);
        let near = |m: &usize| (found[*m] / mode.frequency() - 1.0).abs() < 0.01;
        let at = (0..2).find(near).unwrap();
        let fitted = fit.model.mode_in(1, at).0 / fit.model.mode_in(0, at).0;
        // Ten lines within the resonance, a hundred times the noise: 1 % of its half width of 1 % or 2 %, over √10.
        assert!((fitted - moved / first).abs() < 5e-4, "{r}: {fitted}");
    }
    assert!(fit.doubt().is_none(), "{:?}", fit.doubt());
}

/// An outlying sample in one force of one run has thirty times the noise at every line, which no mode explains. Beside two
/// modes that are there the search tries no more than twice the five that tell so, in one order alone; it would go on to
/// thirty in both.
#[test]
fn a_search_for_what_is_no_mode_ends() {
    let truth = two_modes(3);
    let mut records: Vec<Record> = (0..3).map(|run| record(&truth, run, 400, true)).collect();
    for (k, force) in records[0].force.iter_mut().enumerate() {
        force[0] += Complex::from_polar(30.0 * 0.1_f64.sqrt(), -2.1 * k as f64);
    }
    let options = Options {
        threads: 1,
        ..Options::default()
    };
    let (mut most, mut rounds) = (0, 0);
    let fit = fit(&records, &options, &mut |p| {
        if p.stage == Stage::Modes {
            most = most.max(p.modes);
            rounds += 1;
        }
    });
    assert!(most <= 12 && rounds <= 13, "{most} {rounds}");
    assert!(matches!(fit.unwrap().doubt(), Some(Doubt::Residuals(_))));
}

/// Prior squares are part of V: half of (δ/σ)².
#[test]
fn offsets_cost_what_their_prior_says() {
    let truth = two_modes(2);
    let records = [record(&truth, 0, 20, false)];
    let problem = Problem::new(&records, false, 1);
    let before = problem
        .misfit(&truth, Freedom::all([true; RIGID]))
        .unwrap()
        .0;
    let mut model = truth.clone();
    // The record is of run 0, so that only the prior sees run 1.
    model.offsets[1][0] = [OFFSET, 0.0];
    let after = problem
        .misfit(&model, Freedom::all([true; RIGID]))
        .unwrap()
        .0;
    assert!((after - before - 0.5).abs() < 1e-9, "{before} {after}");
}

/// The information about everything, base accelerations of every line included, from differences
/// of the means of what is measured; its inverse over σ is the bound.
#[test]
fn the_bound_is_the_inverse_of_the_whole_information() {
    let truth = {
        let mut model = Model::rigid(body(), 60.0, 6);
        model.modes.push(two_modes(6).modes[0].clone());
        model
    };
    let records: Vec<Record> = (0..6).map(|e| record(&truth, e, 9, false)).collect();
    let bounded = bound::bound(&records, &truth, [true; RIGID]).unwrap();

    let whiten = |m: &Matrix6<f64>| m.cholesky().unwrap().l().try_inverse().unwrap();
    let places = Freedom::least([true; RIGID]).places(&truth);
    let lines: usize = records.iter().map(|r| r.frequencies.len()).sum();
    let count = places.len() + 12 * lines;
    let mut information = nalgebra::DMatrix::<f64>::zeros(count, count);
    let mut line = 0;
    for record in &records {
        let (base, force) = (
            whiten(&record.noise.base).map(Complex::from),
            whiten(&record.noise.force).map(Complex::from),
        );
        for (k, &frequency) in record.frequencies.iter().enumerate() {
            let own = places.len() + 12 * line;
            let mut slopes: Vec<(usize, Complex6, Complex6)> = Vec::new();
            for (i, &place) in places.iter().enumerate() {
                let h = 1e-6;
                let at = |d: f64| {
                    let mut step = vec![0.0; truth.parameters()];
                    step[place] = d;
                    let mut moved = truth.clone();
                    moved.step(&step);
                    moved.at(record.run, frequency) * record.base[k]
                };
                let slope = (at(h) - at(-h)) * Complex::from(0.5 / h);
                slopes.push((i, Complex6::zeros(), force * slope));
            }
            let m = truth.at(record.run, frequency);
            for j in 0..12 {
                let mut unit = Complex6::zeros();
                unit[j % 6] = if j < 6 {
                    Complex::from(1.0)
                } else {
                    Complex::new(0.0, 1.0)
                };
                slopes.push((own + j, base * unit, force * (m * unit)));
            }
            for (a, xa, ya) in &slopes {
                for (b, xb, yb) in &slopes {
                    // Twice the real part: amplitudes have independent real and imaginary parts.
                    information[(*a, *b)] += 2.0 * (xa.dotc(xb) + ya.dotc(yb)).re;
                }
            }
            line += 1;
        }
    }
    let full =
        super::solve::solve_symmetric(information, &nalgebra::DMatrix::identity(count, count))
            .unwrap();
    for i in 0..RIGID {
        let (a, b) = (bounded[(i, i)], full[(i, i)]);
        // Differences of step 1e-6 err by some 1e-8 of a slope, and by (1e-6 / ζ)² = 1e-8.
        assert!((a / b - 1.0).abs() < 1e-5, "{i}: {a} {b}");
    }
}

/// Records of a structure that rings when they begin and end: with its leakage terms the true model
/// leaves the noise, without them a hundred times as much.
#[test]
fn leakage_terms_explain_how_a_record_begins_and_ends() {
    use crate::simulate::{Options, simulate};
    let model = crate::simulate::Model::fork().unwrap();
    let options = Options {
        noise: Some(0.0),
        duration: Some(20.0),
        ..Options::default()
    };
    let simulation = simulate(&model, &options, &mut |_| ()).unwrap();
    let highest = 60.0;
    let truth = true_model(&model, highest);
    let mut misfits = Vec::new();
    let records: Vec<Record> = (0..3)
        .map(|run| fork_record(&simulation, run, highest))
        .collect();
    for leakage in [true, false] {
        let problem = Problem::new(&records, leakage, 1);
        misfits.push(
            problem
                .misfit(&truth, Freedom::least([true; RIGID]))
                .unwrap()
                .0,
        );
    }
    println!(
        "V with leakage terms {}, without {}",
        misfits[0], misfits[1]
    );
    assert!(misfits[0] * 100.0 < misfits[1], "{misfits:?}");
}

fn true_model(model: &crate::simulate::Model, unit: f64) -> Model {
    let matrix = &model.specimen.mass_matrix;
    let mut sigma = sigma_of(matrix);
    // A plane model has no row fy, where the first moment in x is read otherwise.
    sigma[1] = -matrix[(2, 4)];
    let mut truth = Model::rigid(sigma, unit, model.runs.len());
    for mode in &model.specimen.modes {
        truth.push(FittedMode::new(
            mode.frequency,
            mode.damping,
            mode.participation,
        ));
    }
    truth
}

/// Lines of a run of the simulated fork, whose noise counts as a thousandth of what moves it.
fn fork_record(simulation: &crate::simulate::Simulation, run: usize, highest: f64) -> Record {
    use crate::measure::{Accelerations, RunGeometry};
    let geometry = RunGeometry::new(&simulation.setup, run, &Accelerations::Interface).unwrap();
    let recording = &simulation.recordings[run];
    let at = |name: &String| recording.channels.iter().position(|c| c == name).unwrap();
    let columns: Vec<usize> = geometry.channels.iter().map(at).collect();
    let samples = recording.samples[0].len();
    let mut signals = vec![vec![0.0_f32; samples]; 12];
    for n in 0..samples {
        let sample: Vec<f32> = columns.iter().map(|&c| recording.samples[c][n]).collect();
        for (signal, x) in signals.iter_mut().zip(geometry.resultants(&sample)) {
            signal[n] = x;
        }
    }
    let lines = transform(&signals, recording.sample_rate.unwrap(), [1.0, highest]);
    let six = |first: usize| -> Vec<Complex6> {
        let at = |k: usize| Complex6::from_fn(|i, _| lines.signals[first + i][k]);
        (0..lines.frequencies.len()).map(at).collect()
    };
    let (base, force) = (six(0), six(6));
    // A thousandth of 1 m/s², 10 rad/s² and of the forces and moments that go with them.
    let of = |linear: f64, angular: f64| {
        Matrix6::from_diagonal(&Vector6::new(
            linear, linear, linear, angular, angular, angular,
        ))
    };
    Record {
        run,
        frequencies: lines.frequencies.clone(),
        noise: Noise {
            base: of(1e-6, 1e-4),
            force: of(4e-7, 4e-8),
        },
        base,
        force,
        level: Vec::new(),
        equations: *geometry.equations.rows(),
    }
}

/// Lines of a drive that is recorded with noise, and of resultants that respond to it and have noise
/// of their own: the drive's noise, as they respond to it, has ten times the power of theirs.
#[test]
fn noise_of_the_drive_is_not_that_of_the_sensors() {
    let mut stream = Stream::new(5, &["noise of a drive"]);
    let lines = 2500;
    let mut normal = |size: f64| stream.normal() * (size * std::f64::consts::FRAC_1_SQRT_2);
    let mut drive = Vec::new();
    let mut resultants: [Vec<Complex<f64>>; 12] = Default::default();
    for _ in 0..lines {
        let true_drive = normal(100.0);
        drive.push(true_drive + normal(10_f64.sqrt()));
        for (c, signal) in resultants.iter_mut().enumerate() {
            let response = if c == 0 || c == 6 { 1.0 } else { 0.1 };
            signal.push(true_drive * response + normal(1.0));
        }
    }
    let views: [&[Complex<f64>]; 12] = core::array::from_fn(|c| resultants[c].as_slice());
    let found = noise::beside_drives(&[&drive], &views).unwrap();
    assert!(found.level.is_empty(), "white noise has one level");
    for i in 0..6 {
        for v in [found.noise.base[(i, i)], found.noise.force[(i, i)]] {
            // Fifty windows of fifteen degrees of freedom: 4 % of a variance, and where the drive's
            // noise is ten times as large √(2 · 10) as much: five of those 16 % are 0.8. Left in, it
            // would be eleven.
            assert!((v - 1.0).abs() < 0.8, "{i}: {v}");
        }
    }
}

/// Resultants that have next to no noise, beside accelerations whose noise they are fitted to: what is left after
/// that noise is taken off is nothing or less in half of them, and their variance is what the difference scatters.
#[test]
fn noise_of_resultants_is_never_zero() {
    let mut stream = Stream::new(8, &["quiet load cells"]);
    let mut normal = |size: f64| stream.normal() * (size * std::f64::consts::FRAC_1_SQRT_2);
    let mut resultants: [Vec<Complex<f64>>; 12] = Default::default();
    for _ in 0..2500 {
        let motion = normal(100.0);
        for (c, signal) in resultants.iter_mut().enumerate() {
            let response = if c == 0 || c >= 6 { 1.0 } else { 0.1 };
            signal.push(motion * response + normal(if c < 6 { 1.0 } else { 1e-3 }));
        }
    }
    let views: [&[Complex<f64>]; 12] = core::array::from_fn(|c| resultants[c].as_slice());
    let found = noise::beside_base(&Matrix6::identity(), &views).unwrap();
    for i in 0..6 {
        // Fifty windows of fifteen degrees of freedom, 3.7 % of one; the mean may be four of these away from nothing.
        let v = found.noise.force[(i, i)];
        assert!((0.02..0.2).contains(&v), "{i}: {v}");
    }
}
