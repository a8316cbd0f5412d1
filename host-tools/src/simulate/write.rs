//! A simulated test as a folder: setup.toml, one CSV a run, truth.json.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::{Recording, Simulation};
use crate::recording::{HEALTH_COLUMN, field, spell};
use massline_core::wire::Health;

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be written: {source}", path.display())]
pub struct WriteError {
    /// The file or folder.
    pub path: PathBuf,
    /// The system's reason.
    pub source: io::Error,
}

impl Simulation {
    /// Writes everything into a folder, which is made if it is missing; files of the same
    /// names are replaced. Returns the path of the setup file.
    ///
    /// # Errors
    /// Names the first file that could not be written.
    pub fn write(&self, folder: &Path) -> Result<PathBuf, WriteError> {
        at(folder, std::fs::create_dir_all(folder))?;
        for recording in &self.recordings {
            let path = folder.join(&recording.file);
            at(&path, write_csv(&path, recording))?;
        }
        let truth = folder.join("truth.json");
        at(&truth, self.write_truth(&truth))?;
        // Last, so that a setup never stands there without its recordings.
        let setup = folder.join("setup.toml");
        at(&setup, std::fs::write(&setup, self.setup.to_toml()))?;
        Ok(setup)
    }

    fn write_truth(&self, path: &Path) -> io::Result<()> {
        let mut file = BufWriter::new(File::create(path)?);
        serde_json::to_writer_pretty(&mut file, &self.truth)?;
        file.write_all(b"\n")?;
        file.flush()
    }
}

fn at(path: &Path, result: io::Result<()>) -> Result<(), WriteError> {
    result.map_err(|source| WriteError {
        path: path.to_owned(),
        source,
    })
}

/// Header of channel names, then one row a sample; every number is the shortest text
/// that reads back to the same f32. A sample that never came has none.
fn write_csv(path: &Path, recording: &Recording) -> io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    recording.preamble.write(&mut file)?;
    let mut header: Vec<String> = recording.channels.iter().map(|name| field(name)).collect();
    let tells = !recording.health.is_empty();
    if tells {
        header.push(HEALTH_COLUMN.to_owned());
    }
    writeln!(file, "{}", header.join(","))?;
    let rows = recording.samples.first().map_or(0, Vec::len);
    let mut line = String::new();
    for row in 0..rows {
        line.clear();
        let health = recording.health.get(row).copied().unwrap_or_default();
        for (column, samples) in recording.samples.iter().enumerate() {
            if column > 0 {
                line.push(',');
            }
            if !health.contains(Health::MISSING) {
                // Writing to a String cannot fail. `{:?}` turns to exponents where `{}`
                // would print a long row of zeros.
                let _ = write!(line, "{:?}", samples[row]);
            }
        }
        if tells {
            line.push(',');
            line.push_str(&spell(health));
        }
        line.push('\n');
        file.write_all(line.as_bytes())?;
    }
    file.flush()
}
