//! The embedded tuning fork against the numbers published with it.

use nalgebra::Complex;

use super::*;
use crate::simulate::specimen::Gains;
use crate::simulate::synthesis::modal_response;

fn published() -> serde_json::Value {
    serde_json::from_str(include_str!("../../../models/tuning-fork.json")).unwrap()
}

fn close(found: f64, expected: f64, relative: f64) {
    assert!(
        (found - expected).abs() <= relative * expected.abs(),
        "{found} is not {expected} to {relative}"
    );
}

#[test]
fn mass_properties_are_exact() {
    let truth = run(&Model::fork().unwrap(), &Options::default()).truth;
    let exact = &published()["exact"];
    let number = |key: &str| exact[key].as_f64().unwrap();
    // Sums of 22 elements: rounding reaches some 1e-14; 1e-9 is what is asked for.
    close(truth.mass, number("mass"), 1e-9);
    close(truth.centre_of_gravity[0].unwrap(), number("xi_S"), 1e-9);
    close(truth.centre_of_gravity[2].unwrap(), number("zeta_S"), 1e-9);
    close(truth.inertia_reference.yy.unwrap(), number("Theta_A"), 1e-9);
    close(truth.inertia_cg.yy.unwrap(), number("Theta_S"), 1e-9);
    assert_eq!(truth.centre_of_gravity[1], None);
    assert_eq!(truth.inertia_cg.xx, None);
}

#[test]
fn fixed_base_frequencies_match() {
    let model = Model::fork().unwrap();
    let expected = published()["f_fixed_Hz"].as_array().unwrap().clone();
    assert_eq!(expected.len(), 6);
    for (mode, expected) in model.specimen.modes.iter().zip(expected) {
        close(mode.frequency, expected.as_f64().unwrap(), 1e-6);
        assert_eq!(mode.damping, 0.01);
    }
}

/// Effective masses of all modes and the base node's own mass make the whole: none of the
/// quasi-static flexibility is lost. The base node carries a rigid share of its element.
#[test]
fn modes_are_complete() {
    let specimen = Model::fork().unwrap().specimen;
    let effective: f64 = specimen
        .modes
        .iter()
        .map(|m| m.participation[0].powi(2))
        .sum();
    let whole = specimen.mass_matrix[(0, 0)];
    assert_eq!(specimen.modes.len(), 66);
    assert!(effective < whole && effective > 0.95 * whole);
}

/// All 54 frequency responses at nine frequencies from 0.5 to 200 Hz, resonances included.
#[test]
fn frequency_responses_match() {
    let model = Model::fork().unwrap();
    let table = include_str!("../../../models/tuning-fork-frf.csv");
    let mut lines = table.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    assert_eq!((header.len(), rows.len()), (1 + 2 * 18 * 3, 9));

    let paths = load_paths(&model.load_cells, 0.0, 1);
    let gains = all_gains(&model, &Matrix6::identity(), &paths);
    for (motion, axis) in [("X", 0), ("Z", 2), ("RotY", 4)] {
        for ((_, gains), channel) in gains.iter().zip(channel_names(&model)) {
            let column = header
                .iter()
                .position(|name| *name == format!("{channel}_{motion}_re"))
                .unwrap();
            let of = |row: &Vec<f64>| Complex::new(row[column], row[column + 1]);
            let largest = rows.iter().map(|row| of(row).l1_norm()).fold(0.0, f64::max);
            for row in &rows {
                let found = response(&model, gains, axis, row[0]);
                // The file holds nine digits; the eigensolver adds less.
                let error = (found - of(row)).l1_norm();
                assert!(
                    error <= 1e-6 * largest,
                    "{channel} {motion} at {} Hz: {found} instead of {}",
                    row[0],
                    of(row)
                );
            }
        }
    }
}

/// Response of a channel to a unit motion of the origin.
fn response(model: &Model, gains: &Gains, axis: usize, frequency: f64) -> Complex<f64> {
    let mut motion = Vector6::zeros();
    motion[axis] = 1.0;
    let motion = TableMotion {
        steady: motion,
        resonant: Vector6::zeros(),
    };
    let modes: Vec<_> = model
        .specimen
        .modes
        .iter()
        .map(|mode| modal_response(mode, frequency))
        .collect();
    DriveResponse::new(gains, &model.specimen, &motion).at(Complex::default(), &modes)
}

#[test]
fn the_plane_test_is_ready_to_identify() {
    let simulation = run(&Model::fork().unwrap(), &Options::default());
    let processing = simulation.setup.processing.as_ref().unwrap();
    assert_eq!(processing.sample_rate, Some(512.0));
    assert_eq!(processing.averaging_band, [0.5, 26.0]);
    assert_eq!(simulation.setup.accelerometers.len(), 15);
    assert_eq!(simulation.recordings[0].samples[0].len(), 26_112);
    let interface = simulation
        .setup
        .accelerometers
        .iter()
        .filter(|entry| entry.mount == Mount::Interface);
    assert_eq!(interface.count(), 3);
}
