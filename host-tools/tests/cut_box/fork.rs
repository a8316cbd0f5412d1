//! The fork's test in one short run, for a box in this process and for programs that ask it.

use massline::box_runs::{BoxRunError, BoxTest, Ended, Measuring, Operator, Progress, Stage};
use massline::device::{Client, ClientMemory, HostBox};
use massline::inputs::{InputEntry, to_toml};
use massline::rig::{Inputs, Troubles};
use massline::setup::Setup;
use massline::simulate::{Model, Options, Simulation, simulate};
use massline_core::masslines::Method;
use std::path::Path;
use std::sync::LazyLock;
use tempfile::TempDir;

/// The fork's test of a few seconds in one run: what the box feels, and what it is told.
pub struct Fork {
    /// Set-up and recording.
    pub folder: TempDir,
    simulation: Simulation,
    /// As it is read from there.
    pub setup: Setup,
    /// The file that says which input reads which channel.
    pub wired: String,
}

pub static FORK: LazyLock<Fork> = LazyLock::new(|| {
    let options = Options {
        duration: Some(6.0),
        ..Options::default()
    };
    let mut model = Model::fork().unwrap();
    model.runs.truncate(1);
    let simulation = simulate(&model, &options, &mut |_| ()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let setup = Setup::read(&simulation.write(folder.path()).unwrap()).unwrap();
    let mut fork = Fork {
        folder,
        simulation,
        setup,
        wired: String::new(),
    };
    fork.wired = to_toml(&wired(&fork.inputs()));
    fork
});

impl Fork {
    /// Puts all its files into a folder.
    pub fn copy(&self, folder: &Path) {
        for file in std::fs::read_dir(self.folder.path()).unwrap() {
            let file = file.unwrap();
            std::fs::copy(file.path(), folder.join(file.file_name())).unwrap();
        }
        std::fs::write(folder.join("wired.toml"), &self.wired).unwrap();
    }

    /// What is wired to a box.
    pub fn inputs(&self) -> Inputs {
        let recording = &self.simulation.recordings[0];
        Inputs::new(&self.simulation.setup, recording, Troubles::default()).unwrap()
    }
}

fn wired(inputs: &Inputs) -> Vec<InputEntry> {
    let known = inputs.certificates().into_iter().zip(inputs.channels());
    let entry = |(input, (certificate, name)): (u8, (_, &String))| InputEntry {
        input,
        channel: Some(name.clone()),
        certificate,
    };
    (0..).zip(known).map(entry).collect()
}

/// Shakes without being asked.
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

/// Has the box measure the fork's run.
pub fn measured(host_box: &mut HostBox<'_>) {
    let mut memory = ClientMemory::new();
    let mut client = Client::new(host_box, &mut memory);
    let wired = wired(&FORK.inputs());
    let method = Method::ApparentMass;
    let test = BoxTest::new(&mut client, &FORK.setup, &wired, method, true).unwrap();
    test.load(&mut client).unwrap();
    let order = Measuring {
        runs: vec![0],
        seconds: Some(6.0),
    };
    test.measure(&mut client, &order, &mut Hand).unwrap();
}
