//! The fork's test in one run of a few seconds, and a box that measures it.

use massline::box_runs::{BoxRunError, BoxTest, Ended, Measuring, Operator, Progress, Stage};
use massline::device::{Client, Port};
use massline::inputs::InputEntry;
use massline::rig::Inputs;
use massline::setup::Setup;
use massline::simulate::{Model, Options, Simulation, simulate};
use massline_core::masslines::Method;
use tempfile::TempDir;

/// A simulated test on disk.
pub struct OneRun {
    pub folder: TempDir,
    pub simulation: Simulation,
    pub setup: Setup,
}

impl OneRun {
    pub fn simulate(seconds: f64) -> Self {
        let options = Options {
            duration: Some(seconds),
            ..Options::default()
        };
        let mut model = Model::fork().unwrap();
        model.runs.truncate(1);
        let simulation = simulate(&model, &options, &mut |_| ()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let setup = Setup::read(&simulation.write(folder.path()).unwrap()).unwrap();
        Self {
            folder,
            simulation,
            setup,
        }
    }
}

/// The inputs of a box with the names of their channels.
pub fn wired(inputs: &Inputs) -> Vec<InputEntry> {
    let known = inputs.certificates().into_iter().zip(inputs.channels());
    let entry = |(input, (certificate, name)): (u8, (_, &String))| InputEntry {
        input,
        channel: Some(name.clone()),
        certificate,
    };
    (0..).zip(known).map(entry).collect()
}

/// An operator who shakes at once and lets every run go to its end.
struct Hand;

impl Operator for Hand {
    fn shake(&mut self, _: &Stage<'_>) -> Result<(), BoxRunError> {
        Ok(())
    }

    fn watch(&mut self, _: &Stage<'_>, _: &Progress) -> bool {
        true
    }

    fn ended(&mut self, _: &Stage<'_>, _: &Ended) {}
}

/// Has a box measure the run for six seconds.
pub fn measured<'s, P: Port>(
    client: &mut Client<'_, P>,
    setup: &'s Setup,
    wired: &[InputEntry],
) -> Result<BoxTest<'s>, BoxRunError> {
    let test = BoxTest::new(client, setup, wired, Method::ApparentMass, true)?;
    test.load(client)?;
    let order = Measuring {
        runs: vec![0],
        seconds: Some(6.0),
    };
    test.measure(client, &order, &mut Hand)?;
    Ok(test)
}
