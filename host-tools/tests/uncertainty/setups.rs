//! Setups whose recordings a test changes, and their answers.

use crate::draws::Draws;
use massline::identification::{Answer, Choice, Session, TypeB};
use massline::setup::{Setup, Uncertainty};
use massline::simulate::{Model, Options, simulate};
use massline_core::masslines::Method;
use std::fmt::Write as _;
use std::path::Path;
use tempfile::TempDir;

/// A short test of the rigid box: six runs, six-axis table.
pub fn rigid_box(folder: &TempDir, drive: bool, noise: f64) -> Setup {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/rigid-body.toml");
    let options = Options {
        // Without a drive it takes more blocks to tell noise from signal.
        duration: Some(if drive { 8.0 } else { 20.0 }),
        noise: Some(noise),
        drive: Some(drive),
        ..Options::default()
    };
    let simulation = simulate(&Model::read(&path).unwrap(), &options, &mut |_| ()).unwrap();
    Setup::read(&simulation.write(folder.path()).unwrap()).unwrap()
}

pub fn identify(setup: &Setup, method: Option<Method>) -> Answer {
    let choice = Choice {
        method,
        ..Choice::default()
    };
    let mut session = Session::new(setup).with_type_b();
    session.answer(&choice, &mut |_| ()).unwrap()
}

/// Uniaxial: one accelerometer, one load cell, a body of 12.5 kg under it.
pub fn uniaxial(folder: &TempDir) -> Setup {
    uniaxial_of(folder, 8192, &mut |_, reading| reading)
}

/// The same of so many samples, whose readings of acceleration (m/s²) and force change with the moment (0 to 1).
pub fn uniaxial_of(
    folder: &TempDir,
    samples: u32,
    change: &mut dyn FnMut(f64, [f64; 2]) -> [f64; 2],
) -> Setup {
    let mut rng = Draws::new(7);
    let mut rows = "az,fz,drive\n".to_owned();
    let mut z = 0.0_f64;
    for row in 0..samples {
        z = 0.7 * z + rng.normal();
        let [a, f] = change(f64::from(row) / f64::from(samples), [z, 12.5 * z]);
        // The accelerometer counts in g.
        let _ = writeln!(rows, "{:e},{f:e},{z:e}", a / 9.80665);
    }
    std::fs::write(folder.path().join("z.csv"), rows).unwrap();
    let text = "[processing]\nsample_rate = 512.0\naveraging_band = [2, 40]\n\
        [[accelerometer]]\nchannel = \"az\"\nposition = [0, 0, 0]\ndirection = [0, 0, 1]\nscale = 9.80665\nmount = \"interface\"\n\
        [[load_cell]]\nchannel = \"fz\"\nposition = [0, 0, 0]\ndirection = [0, 0, 1]\n\
        [[run]]\nname = \"z\"\nrecording = \"z.csv\"\nreference = \"drive\"\n";
    Setup::from_str(text, &folder.path().join("setup.toml")).unwrap()
}

pub fn share(u: f64) -> Uncertainty {
    Uncertainty {
        calibration: Some(u),
        ..Uncertainty::default()
    }
}

pub fn type_b(answer: &Answer) -> &TypeB {
    answer.type_b.as_ref().expect("uncertainties are stated")
}

/// The satellite for so many seconds at 1 % noise, with readings that are changed by run, channel and moment (0 to 1).
pub fn satellite(
    folder: &TempDir,
    (seconds, seed, drive): (f64, u64, bool),
    change: &mut dyn FnMut(&str, &str, f64, f64) -> f64,
) -> Setup {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/satellite.toml");
    let options = Options {
        duration: Some(seconds),
        noise: Some(0.01),
        seed,
        drive: Some(drive),
        ..Options::default()
    };
    let simulation = simulate(&Model::read(&path).unwrap(), &options, &mut |_| ()).unwrap();
    let mut setup = Setup::read(&simulation.write(folder.path()).unwrap()).unwrap();
    for run in &mut setup.runs {
        run.checksum = None;
        let file = folder.path().join(&run.recording);
        let text = std::fs::read_to_string(&file).unwrap();
        let mut lines = text.lines();
        let header = lines.next().unwrap();
        let channels: Vec<&str> = header.split(',').collect();
        let rows = lines.clone().count() as f64;
        let mut changed = format!("{header}\n");
        for (row, line) in lines.enumerate() {
            let readings = line.split(',').zip(&channels).map(|(reading, channel)| {
                let moment = row as f64 / rows;
                change(&run.name, channel, moment, reading.parse().unwrap()).to_string()
            });
            changed += &readings.collect::<Vec<_>>().join(",");
            changed.push('\n');
        }
        std::fs::write(file, changed).unwrap();
    }
    setup
}
