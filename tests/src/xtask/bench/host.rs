//! `cargo xtask bench host`: reading and spectra on this machine, beside pandas, polars and scipy.
//!
//! All of them work on the same files, in turns, so that a machine which slows down slows all of them. Ratios are
//! taken turn by turn, and medians over the turns are shown.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::readme;
use crate::xtask::packages;
use crate::xtask::process::{self, StepError};
use crate::xtask::readers;

/// The packages, with exact versions.
const REQUIREMENTS: &str = "tests/fixtures/bench/requirements.txt";
/// The yardsticks.
const PROGRAM: &str = "tests/fixtures/bench/host.py";
/// The page of the tables.
const README: &str = "host-tools/README.md";
/// Seconds of each of the six recordings.
const DURATION: u32 = 60;

/// Options of the command.
#[derive(Debug, PartialEq)]
pub struct Order {
    /// Turns.
    pub runs: usize,
    /// `true` to write the tables into the page.
    pub table: bool,
}

/// Cost of one run of a program.
#[derive(Clone, Copy)]
struct Cost {
    /// Processor time and time on the clock, s.
    processor: f64,
    clock: f64,
    /// Largest memory, bytes.
    memory: f64,
}

/// A program that is measured.
struct Rival {
    name: &'static str,
    command: Vec<String>,
}

/// Measures, and shows the tables.
///
/// # Errors
///
/// [`StepError`] of a program that fails.
pub fn run(root: &Path, cargo: &dyn Fn() -> Command, order: &Order) -> Result<String, StepError> {
    let target = packages::target().unwrap_or_else(|| root.join("target"));
    let mut build = cargo();
    build.args([
        "build",
        "--release",
        "-p",
        "massline",
        "--bins",
        "--examples",
    ]);
    process::run(&mut build)?;
    let python = match readers::provide(root, REQUIREMENTS, &target.join("bench"))? {
        Ok(python) => python,
        Err(reason) => return Ok(format!("skipped, NOT measured: {reason}\n")),
    };
    let bench = Bench {
        script: root.join(PROGRAM),
        program: target.join("release/massline"),
        spectra: target.join("release/examples/spectra"),
        files: target.join("bench-files"),
        model: root.join("host-tools/models/satellite.toml"),
        python,
        runs: order.runs,
    };
    let whole = bench.whole_job()?;
    let spectra = bench.spectra_alone()?;
    let sizes = bench.sizes()?;
    let _ = fs::remove_dir_all(&bench.files);
    let text = format!("{whole}\n{spectra}\n{sizes}");
    if order.table {
        readme::put(README, "bench", &text).map_err(|e| StepError::file(README.as_ref(), e))?;
    }
    Ok(text)
}

struct Bench {
    script: PathBuf,
    program: PathBuf,
    spectra: PathBuf,
    files: PathBuf,
    model: PathBuf,
    python: PathBuf,
    runs: usize,
}

/// Names the method of the averages that are compared.
const BAND: [&str; 2] = ["--method", "apparent-mass"];

impl Bench {
    /// From six CSV recordings to averaged spectra, and ours to the answer.
    fn whole_job(&self) -> Result<String, StepError> {
        let (setup, files) = self.recordings("six", DURATION, "csv")?;
        let (packed, _) = self.recordings("six-parquet", DURATION, "parquet")?;
        let identify = |kind: &str, setup: &Path, threads: &str| {
            let mut command = vec![kind.to_owned(), text(&self.program)];
            command.extend(["identify", "--quiet", "--threads", threads].map(str::to_owned));
            command.extend(BAND.map(str::to_owned));
            command.push(text(setup));
            command
        };
        let python = |kind: &str| {
            let mut command = [kind, "1", "130", "1024"].map(str::to_owned).to_vec();
            command.extend(files.iter().map(|file| text(file)));
            command
        };
        let rivals = [
            ("pandas, scipy.fft", python("pandas")),
            ("polars, scipy.fft", python("polars")),
            (
                "`massline identify`, one thread",
                identify("run", &setup, "1"),
            ),
            (
                "`massline identify`, two threads",
                identify("run", &setup, "2"),
            ),
            (
                "two of it beside each other, one thread each",
                identify("twice", &setup, "1"),
            ),
            (
                "`massline identify` of Parquet, one thread",
                identify("run", &packed, "1"),
            ),
        ];
        let rivals = rivals.map(|(name, command)| Rival { name, command });
        let costs = self.in_turns(&rivals)?;
        let megabytes: u64 = files
            .iter()
            .filter_map(|file| fs::metadata(file).ok())
            .map(|m| m.len())
            .sum();
        let mut table = format!(
            "Six CSV recordings of {DURATION} s at 512 Hz with 32 columns ({} MB) to averaged spectra; `identify`, by the averaging band's method, \
             goes on to its answer and the modes. The last row is of the same recordings in Parquet. Medians of {} turns; the ratio is that of processor time to `identify` on one thread, turn by turn.\n\n\
             | program | processor s | clock s | peak MB | ratio |\n| --- | --- | --- | --- | --- |\n",
            megabytes / 1_000_000,
            self.runs
        );
        for (rival, of_rival) in rivals.iter().zip(&costs) {
            let ratios = of_rival
                .iter()
                .zip(&costs[2])
                .map(|(theirs, ours)| theirs.processor / ours.processor);
            table += &format!(
                "| {} | {:.3} | {:.3} | {:.0} | {:.2} |\n",
                rival.name,
                median(of_rival.iter().map(|c| c.processor)),
                median(of_rival.iter().map(|c| c.clock)),
                median(of_rival.iter().map(|c| c.memory * 1e-6)),
                median(ratios)
            );
        }
        // One thread, two threads, and two programs.
        let clock = |rival: usize| costs[rival].iter().map(|cost| cost.clock);
        let of_threads = median(clock(2).zip(clock(3)).map(|(one, two)| one / two));
        let of_programs = median(clock(2).zip(clock(4)).map(|(one, two)| 2.0 * one / two));
        table += &format!(
            "\nBy the clock two threads are {of_threads:.2} times as fast as one; two processors of this machine do {of_programs:.2} times the work of one, \
             by the two programs beside each other.\n"
        );
        Ok(table)
    }

    /// Samples in memory to averaged spectra.
    fn spectra_alone(&self) -> Result<String, StepError> {
        const SAMPLES: usize = 2_400_000;
        let shape = [SAMPLES.to_string(), "64".to_owned(), "1024".to_owned()];
        let mut theirs = vec!["scipy".to_owned(), "12".to_owned()];
        theirs.extend(shape.clone());
        let (mut their_rates, mut our_rates, mut driven) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..self.runs {
            let million = 12.0 * SAMPLES as f64 * 1e-6;
            their_rates.push(million / self.python(&theirs)?.processor);
            let shape = shape.each_ref().map(String::as_str);
            our_rates.push(million / self.ours("matrix", shape)?);
            driven.push(million / self.ours("12", shape)?);
        }
        let ratios = our_rates
            .iter()
            .zip(&their_rates)
            .map(|(ours, theirs)| ours / theirs);
        let ratio = median(ratios);
        let ratios = driven
            .iter()
            .zip(&their_rates)
            .map(|(ours, theirs)| ours / theirs);
        Ok(format!(
            "Spectra alone: 12 channels of {SAMPLES} samples in memory, blocks of 1024, 64 lines, one thread.\n\n\
             | program | million channel-samples per s | ratio |\n| --- | --- | --- |\n\
             | scipy.fft in single precision and a product of matrices per line | {:.0} | 1 |\n\
             | core, all 78 products of 12 channels | {:.0} | {ratio:.2} |\n\
             | core, 11 channels referred to a drive | {:.0} | {:.2} |\n",
            median(their_rates.iter().copied()),
            median(our_rates.iter().copied()),
            median(driven.iter().copied()),
            median(ratios)
        ))
    }

    /// Cost over channels, lines, block length and length of the recording.
    fn sizes(&self) -> Result<String, StepError> {
        let mut table = "Cost of averages over their sizes, one thread; the first row is the reference.\n\n\
             | channels | lines | block | samples | million channel-samples per s |\n| --- | --- | --- | --- | --- |\n"
            .to_owned();
        let shapes = [
            ["12", "64", "1024", "480000"],
            ["3", "64", "1024", "480000"],
            ["48", "64", "1024", "480000"],
            ["12", "16", "1024", "480000"],
            ["12", "130", "1024", "480000"],
            ["12", "400", "1024", "480000"],
            ["12", "16", "256", "480000"],
            ["12", "512", "8192", "480000"],
            ["12", "64", "1024", "48000"],
            ["12", "64", "1024", "4800000"],
        ];
        for [channels, lines, block, samples] in shapes {
            let number = |text: &str| text.parse().unwrap_or(0.0);
            let million = number(channels) * number(samples) * 1e-6;
            let rates: Result<Vec<f64>, StepError> = (0..self.runs)
                .map(|_| Ok(million / self.ours(channels, [samples, lines, block])?))
                .collect();
            let rate = median(rates?);
            table += &format!("| {channels} | {lines} | {block} | {samples} | {rate:.0} |\n");
        }
        table += "\n| length of six recordings | processor s of `identify` | peak MB |\n| --- | --- | --- |\n";
        for duration in [15, 60, 240] {
            let (setup, _) = self.recordings(&format!("for-{duration}"), duration, "csv")?;
            let mut command = vec!["run".to_owned(), text(&self.program)];
            command.extend(["identify", "--quiet", "--threads", "1"].map(str::to_owned));
            command.extend(BAND.map(str::to_owned));
            command.push(text(&setup));
            let rival = [Rival { name: "", command }];
            let costs = self.in_turns(&rival)?;
            table += &format!(
                "| {duration} s | {:.3} | {:.0} |\n",
                median(costs[0].iter().map(|c| c.processor)),
                median(costs[0].iter().map(|c| c.memory * 1e-6))
            );
        }
        Ok(table)
    }

    /// Simulates six recordings; the setup and the files.
    fn recordings(
        &self,
        name: &str,
        seconds: u32,
        format: &str,
    ) -> Result<(PathBuf, Vec<PathBuf>), StepError> {
        let folder = self.files.join(name);
        let mut simulate = Command::new(&self.program);
        simulate
            .arg("simulate")
            .arg(&self.model)
            .arg("--out")
            .arg(&folder);
        simulate.args(["--quiet", "--force", "--noise", "0.01", "--format", format]);
        simulate.arg("--duration");
        process::run(simulate.arg(seconds.to_string()))?;
        let listed = fs::read_dir(&folder).map_err(|e| StepError::file(&folder, e))?;
        let files = listed.filter_map(|entry| Some(entry.ok()?.path()));
        let mut files: Vec<PathBuf> = files
            .filter(|f| f.extension().is_some_and(|e| e == format))
            .collect();
        files.sort();
        Ok((folder.join("setup.toml"), files))
    }

    /// Costs of programs that run in turns, after one turn that does not count.
    fn in_turns(&self, rivals: &[Rival]) -> Result<Vec<Vec<Cost>>, StepError> {
        let mut costs: Vec<Vec<Cost>> = rivals.iter().map(|_| Vec::new()).collect();
        for turn in 0..=self.runs {
            for (rival, costs) in rivals.iter().zip(&mut costs) {
                let cost = self.python(&rival.command)?;
                if turn > 0 {
                    costs.push(cost);
                }
            }
        }
        Ok(costs)
    }

    /// Runs the yardsticks' program.
    fn python(&self, arguments: &[String]) -> Result<Cost, StepError> {
        let mut command = Command::new(&self.python);
        command.arg(&self.script).args(arguments);
        for threads in [
            "OMP_NUM_THREADS",
            "OPENBLAS_NUM_THREADS",
            "MKL_NUM_THREADS",
            "POLARS_MAX_THREADS",
        ] {
            command.env(threads, "1");
        }
        let output = process::run(&mut command)?;
        let numbers: Vec<f64> = output
            .split_whitespace()
            .filter_map(|word| word.parse().ok())
            .collect();
        match numbers.as_slice() {
            &[processor, clock, memory] => Ok(Cost {
                processor,
                clock,
                memory,
            }),
            _ => Err(unexpected(&self.script, &output)),
        }
    }

    /// Seconds of our spectra.
    fn ours(&self, channels: &str, shape: [&str; 3]) -> Result<f64, StepError> {
        let output = process::run(Command::new(&self.spectra).arg(channels).args(shape))?;
        output
            .trim()
            .parse()
            .map_err(|_| unexpected(&self.spectra, &output))
    }
}

fn unexpected(program: &Path, output: &str) -> StepError {
    StepError::file(program, format!("it printed no figures: {}", output.trim()))
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

/// The middle one of some figures, the mean of the two in the middle; 0 of none.
fn median(figures: impl IntoIterator<Item = f64>) -> f64 {
    let mut figures: Vec<f64> = figures.into_iter().collect();
    figures.sort_by(f64::total_cmp);
    let middle = |at: usize| figures.get(at).copied().unwrap_or(0.0);
    let count = figures.len();
    0.5 * (middle(count.saturating_sub(1) / 2) + middle(count / 2))
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn the_median_lies_in_the_middle() {
        assert_eq!(median([3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median([4.0, 1.0, 2.0, 8.0]), 3.0);
        assert_eq!(median([]), 0.0);
    }
}
