//! `massline study tuning-fork`: the paper's numerical example, row by row.

use crate::commands::{Bar, Failure, Verbosity, print_json};
use crate::output::{self, Existing};
use crate::study::{self, Document, NoiseKind, Options, StudyError, WeightRule};
use std::path::PathBuf;

/// Repeat the paper's numerical example, row by row, and more under noise
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline study tuning-fork\n  massline study tuning-fork --draws 0\n  massline study tuning-fork --noise 0.003,0.01 --draws 200 --report study.html\n  massline study tuning-fork --json | jq '.pattern[] | select(.holds | not)'\n\nThe paper (Schedlinski and Link) leaves its set-up open in places: what it leaves open is an option, and stands in the JSON."
)]
pub struct Arguments {
    /// Draws per level of noise; 0 for the noise-free rows only
    #[arg(long, value_name = "N", default_value_t = Options::default().draws)]
    draws: usize,
    /// Levels of noise, each a share of a channel's RMS over all runs
    #[arg(long, value_name = "R,R,…", value_delimiter = ',', default_values_t = Options::default().noise)]
    noise: Vec<f64>,
    /// Seed of the first draw; each next one has the next
    #[arg(long, value_name = "N", default_value_t = Options::default().seed)]
    seed: u64,
    /// Signals that noise is added to: recordings of every channel, or responses line by line
    #[arg(
        long,
        value_enum,
        hide_possible_values = true,
        value_name = "WHERE",
        default_value_t
    )]
    noise_on: NoiseKind,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
    /// Write a report with plots; an earlier report is replaced
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Have the report replace a file that is none
    #[arg(long, requires = "report")]
    force: bool,
    #[command(flatten)]
    paper: Unknowns,
}

/// Choices that the paper leaves open.
#[derive(clap::Args)]
#[command(next_help_heading = "What the paper leaves open")]
struct Unknowns {
    /// Amplitude of runs X and Z, m/s²
    #[arg(long, value_name = "A", default_value_t = Options::default().translation)]
    translation: f64,
    /// Amplitude of the rotational run in the noise-free rows, rad/s²
    #[arg(long, value_name = "A", default_value_t = Options::default().rotation)]
    rotation: f64,
    /// The same under noise; `massline simulate fork` has as much
    #[arg(long, value_name = "A", default_value_t = Options::default().noise_rotation)]
    noise_rotation: f64,
    /// Distance of the frequency lines and the first of them, Hz
    #[arg(long, value_name = "HZ", default_value_t = Options::default().spacing)]
    spacing: f64,
    /// Highest line, Hz
    #[arg(long, value_name = "HZ", default_value_t = Options::default().highest)]
    highest: f64,
    /// Ends of ranges I and II, shares of the fixed system's first natural frequency
    #[arg(long, value_name = "I,II", value_parser = pair, default_value = "0.45,0.8")]
    ranges: Pair,
    /// W_min, the weight of the accelerometer that sees the first modes most
    #[arg(long, value_name = "W", default_value_t = Options::default().minimum_weight)]
    minimum_weight: f64,
    /// Band in which the weighting looks for the first modes, Hz
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, default_value = "28,50")]
    mode_band: Pair,
    /// Which runs share weights: by-method (each its own for a, one set for b to e), per-run, joined
    #[arg(
        long,
        value_enum,
        hide_possible_values = true,
        value_name = "RULE",
        default_value_t
    )]
    weights: WeightRule,
    /// Band in which methods d and e fit elastic modes, Hz [default: all lines]
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair)]
    fit_band: Option<Pair>,
    /// Band in which the apparent mass looks for the fixed system's poles, Hz
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, default_value = "0.5,50")]
    pole_band: Pair,
    /// Most elastic modes that methods d and e fit
    #[arg(long, value_name = "N", default_value_t = Options::default().modes)]
    modes: usize,
    /// Distance of A and S at which the iteration ends, m
    #[arg(long, value_name = "M", default_value_t = Options::default().tolerance)]
    tolerance: f64,
    /// Most iterations
    #[arg(long, value_name = "N", default_value_t = Options::default().iterations)]
    iterations: u32,
    /// Length of a simulated recording, s
    #[arg(long, value_name = "S", default_value_t = Options::default().duration)]
    duration: f64,
}

/// Two numbers in one value, `0.5,50`: with several values to an option, the word after it
/// would be taken for one.
#[derive(Clone, Copy)]
struct Pair([f64; 2]);

fn pair(text: &str) -> Result<Pair, String> {
    let two = text
        .split_once(',')
        .ok_or("two numbers are expected, such as 0.5,50")?;
    let number = |t: &str| {
        let t = t.trim();
        t.parse::<f64>()
            .map_err(|_| format!("`{t}` is not a number"))
    };
    Ok(Pair([number(two.0)?, number(two.1)?]))
}

impl Arguments {
    fn options(&self) -> Options {
        let p = &self.paper;
        Options {
            translation: p.translation,
            rotation: p.rotation,
            spacing: p.spacing,
            highest: p.highest,
            ranges: p.ranges.0,
            minimum_weight: p.minimum_weight,
            mode_band: p.mode_band.0,
            weights: p.weights,
            fit_band: p.fit_band.map(|b| b.0),
            pole_band: p.pole_band.0,
            modes: p.modes,
            tolerance: p.tolerance,
            iterations: p.iterations,
            noise_kind: self.noise_on,
            noise: self.noise.clone(),
            draws: self.draws,
            seed: self.seed,
            duration: p.duration,
            noise_rotation: p.noise_rotation,
        }
    }
}

impl From<StudyError> for Failure {
    fn from(error: StudyError) -> Self {
        Self::input(error)
    }
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    if let Some(path) = &arguments.report {
        let existing = Existing::KeepUnlessReport.or_force(arguments.force);
        output::check(path, [], existing)?;
    }
    let bar = Bar::new("studying", verbosity);
    let options = arguments.options();
    let study = study::run(&options, &mut |share| {
        let done = (share * options.draws as f64 * (1.0 + options.noise.len() as f64)).round();
        bar.set(share, &format!("draw {done}"));
    })?;
    drop(bar);
    if let Some(path) = &arguments.report {
        output::write(path, study::render(&study).as_bytes())?;
    }
    if arguments.json {
        return print_json(&Document::new(&study));
    }
    study::print(&mut anstream::stdout(), &study)
        .map_err(|e| Failure::input(format!("stdout: {e}")))?;
    if let Some(path) = &arguments.report
        && !verbosity.quiet
    {
        eprintln!("report: {}", path.display());
    }
    Ok(())
}
