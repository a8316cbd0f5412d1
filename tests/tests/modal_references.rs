//! Modal data against independent references: the mesh's matrices solved by scipy, and sdypy-EMA on
//! the same frequency responses.
//!
//! `cargo test --release -p massline-tests --test modal_references -- --nocapture` prints the
//! tables of the host tool's page "Checked against".

mod bench;

use bench::fork;
use massline::identification::modal::Modal;
use massline::identification::{Answer, Choice, Session};
use massline::setup::Setup;
use massline::study;
use serde_json::Value;

fn with_modes(setup: &Setup) -> Answer {
    Session::new(setup)
        .answer_with_modes(&Choice::default(), &mut |_| ())
        .unwrap_or_else(|error| panic!("{error}"))
}

fn modal(setup: &Setup) -> Modal {
    with_modes(setup).modal.unwrap()
}

fn noise_free(mode_band: [f64; 2]) -> Modal {
    let folder = tempfile::tempdir().unwrap();
    let mut setup = fork::sine(folder.path(), &fork::responses());
    setup.processing.as_mut().unwrap().mode_band = Some(mode_band);
    modal(&setup)
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

fn frequency(mode: &Value) -> f64 {
    mode["frequency"].as_f64().unwrap()
}

/// Indices of the plane's three axes in a matrix of six: along x, along z, about y.
const PLANE: [usize; 3] = [0, 2, 4];

fn effective(mode: &Value) -> [f64; 3] {
    core::array::from_fn(|i| mode["effective_mass"][i][i].as_f64().unwrap())
}

/// Modal assurance criterion: one for shapes that are multiples of each other.
fn mac(a: &[f64], b: &[f64]) -> f64 {
    let dot = |u: &[f64], v: &[f64]| -> f64 { u.iter().zip(v).map(|(x, y)| x * y).sum() };
    dot(a, b).powi(2) / (dot(a, a) * dot(b, b))
}

/// Relative error against a reference, per cent.
fn off(found: f64, reference: f64) -> f64 {
    100.0 * (found / reference - 1.0)
}

/// Effective masses of the first two modes: largest error, per cent.
#[track_caller]
fn effective_errors(modal: &Modal, references: &Value) -> f64 {
    let mut worst = 0.0_f64;
    assert!(modal.fixed.len() >= 2, "modes found: {}", modal.fixed.len());
    for (mode, reference) in modal
        .fixed
        .iter()
        .zip(references["matrices"]["fixed"].as_array().unwrap())
        .take(2)
    {
        let exact = effective(reference);
        for (axis, exact) in PLANE.into_iter().zip(exact) {
            let error = off(mode.mode.effective_mass[(axis, axis)], exact);
            println!(
                "{:8.3} Hz, axis {axis}: {exact:.6} {error:+.3} %",
                mode.mode.pole.frequency
            );
            worst = worst.max(error.abs());
        }
    }
    worst
}

#[test]
fn the_twin_of_the_study_is_the_mesh_that_scipy_solves() {
    let options = study::Options::default();
    let twin = study::Twin::new(&options, 1.0).unwrap();
    let references = fork::references();
    for (key, found) in [("fixed", &twin.fixed), ("free", &twin.free)] {
        let list = references["matrices"][key].as_array().unwrap();
        assert_eq!(list.len(), 4);
        for (reference, found) in list.iter().zip(found) {
            // 1e-6: stiffness over mass of axial against bending motion squares up to a
            // condition of 1e10, which leaves six of sixteen digits to the lowest modes.
            let error = found / frequency(reference) - 1.0;
            assert!(error.abs() < 1e-6, "{key} {found}: {error:e}");
        }
    }
    for (reference, mode) in references["matrices"]["fixed"]
        .as_array()
        .unwrap()
        .iter()
        .zip(&twin.model.specimen.modes)
    {
        for (axis, exact) in PLANE.into_iter().zip(effective(reference)) {
            let found = mode.participation[axis].powi(2);
            // As above, and twice for a square.
            assert!((found / exact - 1.0).abs() < 2e-6, "{found} {exact}");
        }
    }
}

#[test]
fn both_references_agree_with_each_other() {
    let references = fork::references();
    for key in ["fixed", "free"] {
        let matrices = references["matrices"][key].as_array().unwrap();
        let ema = references["ema"][key].as_array().unwrap();
        for (a, b) in matrices.iter().zip(ema) {
            // Damping on the fixed modes couples the free ones and moves their
            // frequencies by up to 2ζ², 0.09 % for the 2.1 % of mode 5.
            assert!(off(frequency(b), frequency(a)).abs() < 0.1);
            let mac = mac(&numbers(&a["shape"]), &numbers(&b["shape"]));
            assert!(mac > 0.999, "{key} {}: {mac}", frequency(a));
        }
    }
}

/// 0.5 % is the project's goal for noise-free responses; measured is 0.33 %.
#[test]
fn effective_masses_from_noise_free_responses() {
    let references = fork::references();
    let modal = noise_free([28.0, 50.0]);
    assert!(effective_errors(&modal, &references) < 0.5);
    assert!(modal.warnings.is_empty(), "{:?}", modal.warnings);
}

/// The goal is 5 %, for leakage with a damping of 1 %; measured is 4.8 %, in the direction in which the second
/// mode has 2 % of the mass. Blocks that overlap by three quarters, since by half it is 4.1 to 5.4 % by where
/// they begin.
#[test]
fn effective_masses_from_recordings_in_short_blocks() {
    let references = fork::references();
    let mut setup = fork::with_blocks(1024);
    setup.processing.as_mut().unwrap().overlap = 0.75;
    let modal = modal(&setup);
    assert!(effective_errors(&modal, &references) < 5.0);
    let coarse = modal.warnings.iter().find(|w| w.contains("too coarse"));
    let coarse = coarse.expect("blocks of 2 s are short for a damping of 1 %");
    assert!(coarse.contains("`block_length` of 4096"), "{coarse}");
}

/// The goal is 2 %; measured is 0.6 %, with noise of 1 % in 23 blocks.
#[test]
fn effective_masses_from_recordings_in_long_blocks() {
    let references = fork::references();
    let modal = modal(&fork::with_blocks(4096));
    assert!(effective_errors(&modal, &references) < 2.0);
    let coarse = modal.warnings.iter().find(|w| w.contains("too coarse"));
    assert_eq!(coarse, None);
    let free = &modal.free[0];
    let exact = frequency(&references["matrices"]["free"][0]);
    // The goal for free frequencies.
    assert!(off(free.pole.frequency, exact).abs() < 0.1);
}

#[test]
fn fixed_modes_beside_both_references() {
    let references = fork::references();
    let modal = noise_free([28.0, 50.0]);
    println!("fixed: matrices, sdypy-EMA, massline, Hz; damping %; 1 - MAC");
    for (i, mode) in modal.fixed.iter().enumerate() {
        let (matrices, ema) = (
            &references["matrices"]["fixed"][i],
            &references["ema"]["fixed"][i],
        );
        let pole = mode.mode.pole;
        let shape = mode.shape.as_ref().unwrap();
        let mac = mac(shape, &numbers(&matrices["shape"]));
        println!(
            "{:.4} {:.4} {:.4}  {:.3} {:.3}  {:.1e}",
            frequency(matrices),
            frequency(ema),
            pole.frequency,
            100.0 * ema["damping"].as_f64().unwrap(),
            100.0 * pole.damping,
            1.0 - mac
        );
        // The modes above 60 Hz enter as one term in ω²: measured is 0.01 %.
        assert!(off(pole.frequency, frequency(matrices)).abs() < 0.02);
        assert!(off(pole.frequency, frequency(ema)).abs() < 0.02);
        // The model's damping is 1 %; the measured error is 0.3 % of it.
        assert!(off(pole.damping, 0.01).abs() < 1.0);
        assert!(off(pole.damping, ema["damping"].as_f64().unwrap()).abs() < 1.0);
        // The lines end at 50 Hz, and one term in ω² stands for all modes above, which deflect as
        // much as the second one: measured is 1.2e-3.
        assert!(mac > 0.998, "{mac}");
    }
    assert_eq!(modal.fixed.len(), 2);
}

#[test]
fn free_modes_beside_both_references() {
    let references = fork::references();
    let modal = noise_free([28.0, 200.0]);
    println!("free: matrices, sdypy-EMA, massline, Hz; damping %; 1 - MAC");
    assert_eq!(modal.free.len(), 4);
    for (i, mode) in modal.free.iter().enumerate() {
        let (matrices, ema) = (
            &references["matrices"]["free"][i],
            &references["ema"]["free"][i],
        );
        let shape = mode.shape.as_ref().unwrap();
        let mac = mac(shape, &numbers(&matrices["shape"]));
        println!(
            "{:.4} {:.4} {:.4}  {:.3} {:.3}  {:.1e}",
            frequency(matrices),
            frequency(ema),
            mode.pole.frequency,
            100.0 * ema["damping"].as_f64().unwrap(),
            100.0 * mode.pole.damping,
            1.0 - mac
        );
        // The goal, against the undamped matrices.
        assert!(off(mode.pole.frequency, frequency(matrices)).abs() < 0.1);
        // Both fit the same damped lines: measured is 0.02 %.
        assert!(off(mode.pole.frequency, frequency(ema)).abs() < 0.05);
        assert!(off(mode.pole.damping, ema["damping"].as_f64().unwrap()).abs() < 2.0);
        assert!(mac > 0.999, "{mac}");
    }
}
