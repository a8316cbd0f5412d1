//! The fork's test in one short run, for a box in this process and for programs that ask it.

use crate::bench::one_run::{self, OneRun};
use massline::device::{Client, ClientMemory, HostBox};
use massline::inputs::to_toml;
use massline::rig::{Inputs, Troubles};
use std::ops::Deref;
use std::path::Path;
use std::sync::LazyLock;

/// The test of six seconds in one run, and the box that is told of it.
pub struct Fork {
    test: OneRun,
    /// The file that says which input reads which channel.
    pub wired: String,
}

pub static FORK: LazyLock<Fork> = LazyLock::new(|| {
    let test = OneRun::simulate(6.0);
    let wired = to_toml(&one_run::wired(&inputs(&test)));
    Fork { test, wired }
});

fn inputs(test: &OneRun) -> Inputs {
    let simulation = &test.simulation;
    let recording = &simulation.recordings[0];
    Inputs::new(&simulation.setup, recording, Troubles::default()).unwrap()
}

impl Deref for Fork {
    type Target = OneRun;

    fn deref(&self) -> &OneRun {
        &self.test
    }
}

impl Fork {
    /// Puts all its files into a folder.
    pub fn copy(&self, folder: &Path) {
        for file in std::fs::read_dir(self.folder.path()).unwrap() {
            let file = file.unwrap();
            std::fs::copy(file.path(), folder.join(file.file_name())).unwrap();
        }
        std::fs::write(folder.join("wired.toml"), &self.wired).unwrap();
    }

    /// The inputs of a box that are wired to the test's sensors.
    pub fn inputs(&self) -> Inputs {
        inputs(&self.test)
    }
}

/// Has the box measure the fork's run.
pub fn measured(host_box: &mut HostBox<'_>) {
    let mut memory = ClientMemory::new();
    let mut client = Client::new(host_box, &mut memory);
    let wired = one_run::wired(&FORK.inputs());
    one_run::measured(&mut client, &FORK.setup, &wired).unwrap();
}
