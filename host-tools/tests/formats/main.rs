//! The same test in every form in which a laboratory may offer it gives the same ten numbers:
//! with equal bits where the form keeps the readings' bits, else within its rounding.

mod binary;
mod hdf5;
mod others;
mod responses;
mod spoilt;
mod text;
mod write;

#[path = "../bench/mod.rs"]
mod bench;

use bench::{Bench, RECORDINGS};

/// A recording as a table.
struct Table {
    names: Vec<String>,
    /// Sample by sample, as they stand in the file.
    rows: Vec<Vec<String>>,
}

impl Table {
    fn of(csv: &str) -> Self {
        let fields = |line: &str| line.split(',').map(str::to_owned).collect();
        let mut lines = csv.lines();
        Self {
            names: fields(lines.next().unwrap()),
            rows: lines.map(fields).collect(),
        }
    }

    /// Readings, channel by channel.
    fn readings(&self) -> Vec<Vec<f32>> {
        let reading = |row: &Vec<String>, c: usize| row[c].parse::<f32>().unwrap();
        let channel = |c| self.rows.iter().map(|row| reading(row, c)).collect();
        (0..self.names.len()).map(channel).collect()
    }

    /// The table with time in front of it: its name, and the text of each sample's.
    fn timed(mut self, name: &str, time: impl Fn(usize) -> String) -> Self {
        self.names.insert(0, name.to_owned());
        for (n, row) in self.rows.iter_mut().enumerate() {
            row.insert(0, time(n));
        }
        self
    }

    /// The table as text with these line ends and a character between fields.
    fn text(&self, between: &str, line_end: &str) -> String {
        let lines = std::iter::once(&self.names).chain(&self.rows);
        lines.map(|line| line.join(between) + line_end).collect()
    }

    /// The same with decimal commas.
    fn commas(mut self) -> Self {
        for field in self.rows.iter_mut().flatten() {
            *field = field.replace('.', ",");
        }
        self
    }
}

/// The test whose three recordings are written in another form.
fn offered(form: impl Fn(Table) -> Vec<u8>) -> Bench {
    RECORDINGS.iter().fold(Bench::fork(), |bench, name| {
        let text = std::fs::read_to_string(bench.file(name)).unwrap();
        bench.write(name, form(Table::of(&text)))
    })
}

/// The result document of the test as it was simulated.
fn expected() -> String {
    let finished = Bench::fork().identify(&["--json"]);
    assert_eq!(finished.code, Some(0), "{finished:?}");
    finished.stdout
}

/// Asserts equal bits of the whole result.
#[track_caller]
fn same(bench: &Bench) {
    let finished = bench.identify(&["--json"]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    assert_eq!(finished.stdout, expected());
}

/// The ten numbers, each with its standard deviation.
fn numbers(document: &str) -> Vec<[f64; 2]> {
    let document: serde_json::Value = serde_json::from_str(document).unwrap();
    let inertia = document["inertia_cg"].as_object().unwrap();
    let mut all = vec![&document["mass"]];
    all.extend(document["centre_of_gravity"].as_array().unwrap());
    all.extend(inertia.values());
    let number =
        |entry: &serde_json::Value| Some([entry["value"].as_f64()?, entry["std"].as_f64()?]);
    let all: Vec<[f64; 2]> = all.into_iter().filter_map(number).collect();
    assert!(all.len() >= 3, "{document}");
    all
}

/// Asserts that each number is within a share of its standard deviation; 0 asserts equal bits.
#[track_caller]
fn close(bench: &Bench, share: f64) {
    let finished = bench.identify(&["--json"]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    let (found, expected) = (numbers(&finished.stdout), numbers(&expected()));
    assert_eq!(found.len(), expected.len());
    for ([found, _], [expected, std]) in found.iter().zip(&expected) {
        let off = (found - expected).abs();
        // The mass was weighed, and has no deviation.
        assert!(
            off <= share * std,
            "{found} and {expected}: {} of {std}",
            off / std
        );
    }
}
