//! The tuning fork's shipped measurements, as recordings and as frequency responses.

use std::fmt::Write;
use std::io::Read;
use std::path::Path;

use flate2::read::GzDecoder;
use massline::setup::{Excitation, Setup};
use massline_tests::fixture;
use serde_json::Value;

/// The setup of the three recordings, weighed, range II.
pub fn recordings() -> Setup {
    Setup::read(&fixture("fork/setup.toml")).unwrap_or_else(|error| panic!("{error}"))
}

/// The setup of the three recordings with blocks of another length.
pub fn with_blocks(length: usize) -> Setup {
    let mut setup = recordings();
    setup.processing.as_mut().unwrap().block_length = length;
    setup
}

/// One run's frequency responses: a header, and one row a frequency.
pub struct Responses {
    pub header: String,
    /// Frequency, Hz, and the row of the file.
    pub rows: Vec<(f64, String)>,
}

impl Responses {
    pub fn write(&self, path: &Path) {
        let mut text = self.header.clone();
        for (_, row) in &self.rows {
            let _ = write!(text, "\n{row}");
        }
        std::fs::write(path, text + "\n").unwrap();
    }
}

/// The shipped noise-free responses of the three runs.
pub fn responses() -> [Responses; 3] {
    let file = std::fs::File::open(fixture("fork/frf-noise-free.csv.gz")).unwrap();
    let mut text = String::new();
    GzDecoder::new(file).read_to_string(&mut text).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let table: Vec<Vec<&str>> = lines.map(|l| l.split(',').collect()).collect();
    ["X", "Z", "RotY"].map(|run| {
        let mut header = "frequency".to_owned();
        let mut columns = vec![0];
        for (at, name) in names.iter().enumerate() {
            let parts: Vec<&str> = name.split('_').collect();
            if let [channel, of, part] = parts[..]
                && of == run
            {
                let _ = write!(header, ",{channel}.{part}");
                columns.push(at);
            }
        }
        let row = |cells: &Vec<&str>| {
            let picked: Vec<&str> = columns.iter().map(|&c| cells[c]).collect();
            (cells[0].parse().unwrap(), picked.join(","))
        };
        Responses {
            header,
            rows: table.iter().map(row).collect(),
        }
    })
}

/// The setup as a stepped sine test, whose responses are written into `folder`.
pub fn sine(folder: &Path, responses: &[Responses; 3]) -> Setup {
    let mut setup = recordings();
    for (run, responses) in setup.runs.iter_mut().zip(responses) {
        let name = format!("{}.csv", run.name.replace(' ', "-"));
        responses.write(&folder.join(&name));
        run.recording = folder.join(name);
        run.excitation = Excitation::Sine;
        run.references.clear();
    }
    setup
}

/// Modal references of independent programs: `fixtures/modal/references.py`.
pub fn references() -> Value {
    let text = std::fs::read_to_string(fixture("modal/modal.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}
