//! `massline init`: a first setup from recordings.

use super::{Failure, print_line};
use crate::commands::Verbosity;
use crate::init;
use crate::output::{self, Existing};
use crate::printable::printable;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};

/// Write a first setup from the channels of recordings
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline init x.csv y.csv z.csv\n  massline init *.csv --sensors sensors.csv --band 2,20\n\nsensors.csv has a row for each sensor, with the columns name, x, y, z and, where needed, directions,\nunit, sensitivity, mount:\n  name,x [mm],y [mm],z [mm],directions,unit,mount\n  T1,600,550,0,,g,interface\n  LC1,450,450,0,+x +y +z,N,load cell\nWithout a table, and on a terminal, the command asks. What stays unknown is a comment to fill in."
)]
pub struct Arguments {
    /// The recordings, one a run
    #[arg(required = true, value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// A table of sensors: name, x, y, z, directions, unit, sensitivity, mount
    #[arg(long, value_name = "FILE")]
    sensors: Option<PathBuf>,
    /// Averaging band, Hz
    #[arg(long, value_name = "LOW,HIGH", value_parser = band)]
    band: Option<[f64; 2]>,
    /// Sample rate, Hz, where the recordings do not say it
    #[arg(long, value_name = "HZ", value_parser = rate)]
    sample_rate: Option<f64>,
    /// The setup to write
    #[arg(long, value_name = "FILE", default_value = "setup.toml")]
    out: PathBuf,
    /// Replace the file if it is there already
    #[arg(long)]
    force: bool,
}

fn band(text: &str) -> Result<[f64; 2], String> {
    let ends = text.split_once(',').and_then(|(low, high)| {
        let (low, high) = (
            low.trim().parse::<f64>().ok()?,
            high.trim().parse::<f64>().ok()?,
        );
        (low >= 0.0 && low < high && high.is_finite()).then_some([low, high])
    });
    ends.ok_or_else(|| "expected two frequencies in Hz such as 2,20, the lower first".to_owned())
}

fn rate(text: &str) -> Result<f64, String> {
    let rate = text
        .parse()
        .ok()
        .filter(|x: &f64| x.is_finite() && *x > 0.0);
    rate.ok_or_else(|| "expected samples per second, more than 0".to_owned())
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let inputs = arguments.recordings.iter().chain(&arguments.sensors);
    let existing = Existing::Keep.or_force(arguments.force);
    output::check(&arguments.out, inputs.map(PathBuf::as_path), existing)?;
    // `*.csv` has the table of sensors among the recordings where it lies beside them.
    let is_table = |file: &&PathBuf| {
        let table = arguments.sensors.as_ref();
        table.is_some_and(|table| output::same_file(table, file))
    };
    let recordings = arguments.recordings.iter().filter(|file| !is_table(file));
    let recordings: Vec<PathBuf> = recordings.cloned().collect();
    if recordings.is_empty() {
        return Err(Failure::input(
            "no recording is left beside the table of sensors; name the recordings, one a run",
        ));
    }
    let mut found = init::find(&recordings)?;
    (found.band, found.sample_rate) = (arguments.band, arguments.sample_rate);
    match &arguments.sensors {
        Some(table) => init::fill(&mut found, table)?,
        None if std::io::stdin().is_terminal() && std::io::stderr().is_terminal() => {
            init::ask(&mut found, &mut question);
        }
        None => {}
    }
    found.check()?;
    let text = init::draft(&found, &arguments.out);
    output::write(&arguments.out, text.as_bytes())?;
    print_line(&arguments.out.display().to_string())?;
    if !verbosity.quiet {
        tell(&found, &text, &arguments.out);
    }
    Ok(())
}

fn tell(found: &init::Found, text: &str, out: &Path) {
    let missing = text.lines().filter(|line| line.contains("fill in")).count();
    // The head explains the words.
    let missing = missing.saturating_sub(1);
    let mut err = anstream::stderr();
    let _ = writeln!(
        err,
        "{} sensors, {} channels; {} without an entry",
        found.sensors.len(),
        found.channels(),
        found.left_out.len()
    );
    let out = printable(&out.display().to_string()).into_owned();
    let next = match missing {
        0 => format!("next: massline sketch {out} --out sketch.svg, massline check {out}"),
        n => format!("next: fill in {n} lines of {out} that say `fill in`"),
    };
    let _ = writeln!(err, "{next}");
}

/// Asks on the terminal; `None` at the end of the input.
fn question(text: &str) -> Option<String> {
    let mut err = anstream::stderr();
    let _ = write!(err, "{} (empty: later): ", printable(text));
    let _ = err.flush();
    let mut answer = String::new();
    match std::io::stdin().read_line(&mut answer) {
        Ok(read) if read > 0 => Some(answer),
        _ => None,
    }
}
