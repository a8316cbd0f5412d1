//! The satellite's test on disk, as it is recorded and as it is changed.

use crate::bench::massline;
use massline::setup::Setup;
use massline::simulate::{Model, Options, simulate};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder with a setup and recordings without checksums.
pub struct Recorded {
    folder: TempDir,
}

impl Recorded {
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// The setup as it was simulated, of recordings that may be changed.
    pub fn setup(&self) -> Setup {
        let mut setup = Setup::read(&self.path().join("simulated.toml")).unwrap();
        setup.runs.iter_mut().for_each(|run| run.checksum = None);
        setup
    }

    /// The recordings.
    pub fn recordings(&self) -> Vec<PathBuf> {
        let setup = self.setup();
        setup
            .runs
            .iter()
            .map(|run| setup.recording_path(run))
            .collect()
    }
}

/// The satellite shaken for 15 seconds with 1 % of noise.
pub fn recorded() -> Recorded {
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/satellite.toml");
    let options = Options {
        noise: Some(0.01),
        duration: Some(15.0),
        ..Options::default()
    };
    let simulation = simulate(&Model::read(&model).unwrap(), &options, &mut |_| ()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    simulation.write(folder.path()).unwrap();
    let setup = folder.path().join("setup.toml");
    std::fs::rename(setup, folder.path().join("simulated.toml")).unwrap();
    Recorded { folder }
}

/// Writes all recordings again, with other names of their columns.
pub fn rewrite_headers(test: &Recorded, name: impl Fn(&str) -> String) {
    rewrite(test, |header, _| {
        header.iter_mut().for_each(|h| *h = name(h));
    });
}

/// Writes all recordings again, with a header and rows that were changed.
pub fn rewrite(test: &Recorded, change: impl Fn(&mut Vec<String>, &mut Vec<Vec<String>>)) {
    for file in test.recordings() {
        let text = std::fs::read_to_string(&file).unwrap();
        let (remarks, rows): (Vec<&str>, Vec<&str>) =
            text.lines().partition(|l| l.starts_with('#'));
        let mut rows = rows
            .iter()
            .map(|row| row.split(',').map(str::to_owned).collect::<Vec<_>>());
        let mut header = rows.next().unwrap();
        let mut rows: Vec<Vec<String>> = rows.collect();
        change(&mut header, &mut rows);
        let mut out: Vec<String> = remarks.iter().map(|l| (*l).to_owned()).collect();
        out.push(header.join(","));
        out.extend(rows.iter().map(|row| row.join(",")));
        std::fs::write(&file, out.join("\n") + "\n").unwrap();
    }
}

/// Asserts that the box gets the samples that this machine averages, so many blocks of each run.
#[track_caller]
pub fn assert_replayed(test: &Recorded, setup: &str, blocks: &str) {
    // A box holds fewer lines than this machine.
    let setup = setup.replace("mode_band = [30.0, 75.0]", "mode_band = [30.0, 50.0]");
    std::fs::write(test.path().join("replayed.toml"), setup).unwrap();
    let replay = ["replay", "replayed.toml", "--host", "--blocks", blocks];
    let out = massline(test.path(), replay);
    assert_eq!(out.code, Some(0), "{}{}", out.stdout, out.stderr);
}
