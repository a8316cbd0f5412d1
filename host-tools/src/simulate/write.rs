//! A simulated test as a folder: setup.toml, one recording a run, truth.json.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use super::{Recording, Simulation};
use crate::output::{self, Existing, Output, OutputError};
use crate::recording::{About, Channel, Checksum, Rows, Summed, Written};
use crate::setup::Setup;

const SETUP: &str = "setup.toml";
const TRUTH: &str = "truth.json";

/// First line of every setup that [`Simulation::write`] has written.
const WRITTEN_BY: &str = "# Written by `massline simulate`.";

impl Simulation {
    /// Writes everything into a folder, which is made if it is missing; files of the same
    /// names are replaced. Returns the path of the setup file.
    ///
    /// All files are made beside their places first. Then the setup is put in its place, which
    /// carries the checksums of the recordings to come, and they last: should this program be
    /// killed in between, no recording of an earlier test passes for one of this.
    ///
    /// # Errors
    /// Names the first file that could not be written. Unless files were being put in their
    /// places, those of the same names are as they were.
    pub fn write(&self, folder: &Path) -> Result<PathBuf, OutputError> {
        let mut setup = self.setup.clone();
        let mut recordings = Vec::with_capacity(self.recordings.len());
        for (run, recording) in setup.runs.iter_mut().zip(&self.recordings) {
            let file = folder.join(&recording.file);
            let (ready, checksum) = write_recording(&file, recording, &self.setup)?;
            recordings.push(ready);
            run.checksum = Some(checksum);
        }
        let truth = ready(&folder.join(TRUTH), |out| {
            serde_json::to_writer_pretty(&mut *out, &self.truth)?;
            out.write_all(b"\n")
        })?;
        let path = folder.join(SETUP);
        let text = format!("{WRITTEN_BY}\n{}", setup.to_toml());
        ready(&path, |out| out.write_all(text.as_bytes()))?.place()?;
        truth.place()?;
        for recording in recordings {
            recording.place()?;
        }
        Ok(path)
    }

    /// Has the recordings written in another format than CSV.
    pub(crate) fn record_as(&mut self, format: Written) {
        let ending = match format {
            Written::Csv => "csv",
            Written::PackedCsv => "csv.gz",
            Written::Parquet => "parquet",
        };
        for (run, recording) in self.setup.runs.iter_mut().zip(&mut self.recordings) {
            let stem = recording.file.trim_end_matches(".csv");
            recording.file = format!("{stem}.{ending}");
            run.recording = recording.file.clone().into();
        }
    }

    /// Checks that all files may be written into a folder: none is one of `inputs`, and none takes
    /// the place of another's work, unless that is what the user wants (`force`). An earlier
    /// simulation may be replaced.
    ///
    /// # Errors
    /// Names the first file that would be lost.
    pub(crate) fn check(
        &self,
        folder: &Path,
        inputs: &[PathBuf],
        force: bool,
    ) -> Result<(), OutputError> {
        let existing = if force || is_simulated(folder) {
            Existing::Replace
        } else {
            Existing::KeepUnlessSimulated
        };
        let recordings = self.recordings.iter().map(|r| r.file.as_str());
        for file in [SETUP, TRUTH].into_iter().chain(recordings) {
            let inputs = inputs.iter().map(PathBuf::as_path);
            output::check(&folder.join(file), inputs, existing)?;
        }
        Ok(())
    }
}

/// `true` if a folder holds a test that [`Simulation::write`] has written.
fn is_simulated(folder: &Path) -> bool {
    let file = folder.join(SETUP);
    // A pipe would wait for somebody to write.
    if !std::fs::metadata(&file).is_ok_and(|found| found.is_file()) {
        return false;
    }
    let mut line = String::new();
    let read = std::fs::File::open(file).and_then(|file| {
        let head = file.take(WRITTEN_BY.len() as u64 + 2);
        BufReader::new(head).read_line(&mut line)
    });
    read.is_ok() && line.trim_end() == WRITTEN_BY
}

/// A file that is whole, but not in its place yet.
fn ready(
    file: &Path,
    write: impl FnOnce(&mut Output) -> io::Result<()>,
) -> Result<output::Ready, OutputError> {
    let mut out = Output::create(file)?;
    write(&mut out).map_err(|source| OutputError::write(file, source))?;
    out.finish()
}

fn write_recording(
    file: &Path,
    recording: &Recording,
    setup: &Setup,
) -> Result<(output::Ready, Checksum), OutputError> {
    let mut checksum = None;
    let ready = ready(file, |out| {
        let mut summed = Summed::new(out);
        let format = Written::of(file).unwrap_or(Written::Csv);
        let tells = !recording.health.is_empty();
        let mut rows = Rows::begin(format, &mut summed, &about(recording, setup), tells)?;
        let count = recording.samples.first().map_or(0, Vec::len);
        let mut row = Vec::with_capacity(recording.samples.len());
        for n in 0..count {
            row.clear();
            row.extend(
                recording
                    .samples
                    .iter()
                    .filter_map(|channel| channel.get(n)),
            );
            rows.row(&row, recording.health.get(n).copied().unwrap_or_default())?;
        }
        rows.finish()?;
        checksum = Some(summed.checksum());
        Ok(())
    })?;
    // There is one where there was no error.
    Ok((ready, checksum.unwrap_or(Checksum { crc32: 0, bytes: 0 })))
}

/// Facts about a recording that a Parquet file states.
fn about(recording: &Recording, setup: &Setup) -> About {
    let channel = |name: &String| {
        let (unit, direction) = setup.described(name).unzip();
        Channel {
            name: name.clone(),
            unit: unit.map(str::to_owned),
            direction,
        }
    };
    About {
        nominal_sample_rate: recording.sample_rate,
        setup: setup.to_toml(),
        ..About::new(
            recording.channels.iter().map(channel).collect(),
            &recording.preamble,
        )
    }
}
