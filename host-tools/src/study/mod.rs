//! The paper's numerical example, row by row, on its twin: `massline study tuning-fork`.
//!
//! # Design
//!
//! * **Exact data.** Noise-free rows are computed from the frequency responses of the
//!   simulator's beam model with all its modes, line by line, without a recording between.
//!   What a row errs by is its method's doing.
//! * **The core's own methods.** Every row is `masslines::condense` and `identify`; the
//!   study adds which accelerometers count how much, and which lines.
//! * **Noise where it arises.** The rows under noise are made from time recordings of every
//!   channel with white noise, averaged by the core as a measurement would be: 51 s at
//!   512 Hz, some hundred blocks of 1024 samples. Noise of 1 % of the RMS of a recording is
//!   then some 0.1 % of the RMS of a frequency response. Adding noise to the exact
//!   responses instead ([`NoiseKind::Responses`]) knows no leakage and no averaging, and the
//!   same number is ten times harsher.
//! * **Rotation under noise.** The tables' noise-free rows shake at 1 m/s² and 1 rad/s²,
//!   which matters for a and b only. Under noise it matters for all: the two vertical
//!   interface accelerometers stand 80 mm apart, and 1 rad/s² moves them no more than
//!   0.04 m/s². Rows under noise therefore shake at 10 rad/s², as `massline simulate fork`
//!   does.
//!
//! | file | does |
//! | --- | --- |
//! | `options` | what the paper leaves open |
//! | `paper` | tables 1 to 4 as printed |
//! | `twin` | the tuning fork, its exact responses and natural frequencies |
//! | `rows`, `estimate` | the rows, and one set of spectra to their numbers |
//! | `responses`, `recordings` | the spectra: exact or noisy responses, or recordings |
//! | `monte_carlo`, `errors` | root mean square errors over draws |
//! | `fits` | maximum likelihood fits of the same draws, and the Cramér-Rao bound |
//! | `pattern` | claims held against the figures |
//! | `document`, `terminal`, `page` | JSON, terminal, HTML |
//!
//! Beside the example, and with nothing of it: [`coverage`] counts how many intervals hold the
//! truth, [`plans`] tries whether what a test cannot tell has no number.
//!
//! | file | does |
//! | --- | --- |
//! | `coverage` | how many 95 % intervals hold the truth |
//! | `faults` | the detective on set-ups with faults |
//! | `likelihood` | the maximum likelihood fit beside the Cramér-Rao bound |
//! | `plans` | whether what a test cannot tell has no number |
//! | `trial` | one simulated test, identified at several levels of noise |
//! | `scratch` | recordings of a trial in files |
//! | `percent` | errors in per cent as text |
//! | `marked` | tables in Markdown pages |
//! | `structures` | random structures and sensors |
//! | `chance` | random choices |
//! | `false_alarms` | the test of consistency on sound tests, beside the distribution that it claims |

mod chance;
pub mod coverage;
mod document;
mod errors;
mod estimate;
#[cfg(test)]
mod false_alarms;
pub mod faults;
mod fits;
pub mod likelihood;
pub mod marked;
mod monte_carlo;
mod options;
mod page;
pub mod paper;
mod pattern;
mod percent;
pub mod plans;
mod recordings;
mod responses;
mod rows;
mod scratch;
mod structures;
mod terminal;
mod trial;
mod twin;

pub use document::Document;
pub use errors::Errors;
pub use estimate::{Answer, Numbers, Outcome, Solution};
pub use fits::Fits;
pub use monte_carlo::{Level, RowErrors};
pub use options::{NoiseKind, Options, WeightRule};
pub use page::render;
pub use pattern::{Check, NAMES};
pub use recordings::Recordings;
pub use responses::Responses;
pub use rows::{Range, Row};
pub use terminal::print;
pub use trial::TrialError;
pub use twin::Twin;

use crate::parallel;
use massline_core::masslines::Method;
use massline_core::modes::Pole;
use serde::Serialize;

/// Everything the study found.
#[derive(Debug)]
pub struct Study {
    /// Options of the study.
    pub options: Options,
    /// The twin as the noise-free rows shake it.
    pub twin: Twin,
    /// Its exact responses.
    pub responses: Responses,
    /// True values.
    pub exact: Numbers,
    /// Noise-free answers, in the order of [`Row::all`].
    pub answers: Vec<Answer>,
    /// Method e once more, with a modal analysis that misses a mode.
    pub fewer_modes: FewerModes,
    /// Weights of the accelerometers: those of each run, and those shared by all runs.
    pub weights: Weights,
    /// The rows under noise; empty if none was asked for.
    pub levels: Vec<Level>,
    /// Claims and figures.
    pub checks: Vec<Check>,
}

/// Method e where its modal analysis misses the highest of the modes in the lines, as it may
/// in a test: with all of them method e leaves nothing for the iteration to improve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FewerModes {
    /// Number of fitted modes.
    pub modes: usize,
    /// The rows of method e and their noise-free answers; none where only one mode was
    /// found.
    pub rows: Vec<(Row, Answer)>,
}

/// Weights of the accelerometers in the order of the setup.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    /// One list a run.
    pub per_run: Vec<Vec<f64>>,
    /// One for all runs.
    pub joined: Vec<f64>,
}

/// Why there is no study.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// An option outside its range.
    #[error("--{option} {found}: expected {expected}")]
    Option {
        /// Its name.
        option: &'static str,
        /// Value that was given.
        found: f64,
        /// Values that are accepted.
        expected: &'static str,
    },
    /// The built-in model cannot be read.
    #[error(transparent)]
    Model(#[from] crate::simulate::ModelError),
    /// The options do not suit a recording.
    #[error(transparent)]
    Simulation(#[from] crate::simulate::SimulationError),
    /// The sensors do not suit the identification.
    #[error(transparent)]
    Measure(#[from] crate::measure::MeasureError),
    /// The lines do not suit the blocks.
    #[error(transparent)]
    Spectra(#[from] massline_core::spectra::SpectraError),
    /// A band that reaches beyond the lines.
    #[error("{0}; choose it with --highest in mind, the last line")]
    Band(#[from] massline_core::spectra::BandError),
}

/// Runs the study. `progress` hears which share of the draws is done.
///
/// # Errors
/// [`StudyError`] if an option is out of its range or the options do not suit each other.
pub fn run(options: &Options, progress: &mut dyn FnMut(f64)) -> Result<Study, StudyError> {
    options.check()?;
    let twin = Twin::new(options, options.rotation)?;
    let responses = Responses::exact(&twin, options);
    let survey = responses.survey(&twin)?;
    let (band, least) = (survey.lines(options.mode_band)?, options.minimum_weight);
    let joined = survey.weights_joined(&twin.setup, band, least);
    let weights = Weights {
        per_run: survey.weights_per_run(&twin.setup, band, least),
        joined: joined.into_iter().next().unwrap_or_default(),
    };
    let answers = responses.answers(&twin, options)?;
    let levels = if options.draws > 0 {
        monte_carlo::levels(options, progress)?
    } else {
        Vec::new()
    };
    let exact = Numbers::exact(&twin);
    let fewer_modes = fewer_modes(&responses, &twin, options, &answers)?;
    let mut checks = pattern::Found::new(&answers, exact).checks(&fewer_modes);
    checks.extend(pattern::noisy(&levels));
    Ok(Study {
        options: options.clone(),
        exact,
        twin,
        responses,
        answers,
        fewer_modes,
        weights,
        levels,
        checks,
    })
}

fn fewer_modes(
    responses: &Responses,
    twin: &Twin,
    options: &Options,
    answers: &[Answer],
) -> Result<FewerModes, StudyError> {
    let of_e = |(row, _): &(Row, &Answer)| row.method == Method::Synthesis;
    let mut rows = Row::all().into_iter().zip(answers).filter(of_e);
    let found = rows.next().map_or(0, |(_, answer)| answer.poles.len());
    if found < 2 {
        return Ok(FewerModes::default());
    }
    let fewer = Options {
        modes: found - 1,
        ..options.clone()
    };
    let answers = responses.answers(twin, &fewer)?;
    let rows = Row::all().into_iter().zip(answers);
    Ok(FewerModes {
        modes: fewer.modes,
        rows: rows
            .filter(|(row, _)| row.method == Method::Synthesis)
            .collect(),
    })
}

impl Study {
    /// Rows and their noise-free answers.
    pub fn rows(&self) -> impl Iterator<Item = (Row, &Answer)> {
        Row::all().into_iter().zip(&self.answers)
    }

    /// First and last line of a range, Hz.
    #[must_use]
    pub fn range(&self, range: Range) -> [f64; 2] {
        estimate::range_of(&self.options, &self.twin, range)
    }

    /// Natural frequencies of the fixed structure (table 1) and of the free one (table 2), a row
    /// for each elastic mode.
    #[must_use]
    pub fn tables(&self) -> [Vec<FrequencyRow>; 2] {
        let table = |paper: &[f64], twin: &[f64], method: Method, first: usize| {
            let of_method = self.rows().find(|(row, _)| row.method == method);
            let poles = of_method.map_or(&[][..], |(_, answer)| answer.poles.as_slice());
            let pairs = paper.iter().zip(twin).zip(first..);
            pairs
                .map(|((paper, twin), number)| FrequencyRow::new(number, *paper, *twin, poles))
                .collect()
        };
        [
            table(&paper::FIXED, &self.twin.fixed, Method::ApparentMass, 1),
            table(&paper::FREE, &self.twin.free, Method::Synthesis, 4),
        ]
    }

    /// Rows of table 4 and their answers, and at the end those of method e with fewer modes, whose
    /// number is given.
    fn iterated(&self) -> Vec<(Row, Option<usize>, &Answer)> {
        let iterated = Row::iterated();
        let own = iterated.iter().filter_map(|wanted| {
            let found = self.rows().find(|(row, _)| row == wanted);
            found.map(|(row, answer)| (row, None, answer))
        });
        let fewer = self.fewer_modes.rows.iter();
        let fewer = fewer.filter(|(row, _)| iterated.contains(row));
        let fewer = fewer.map(|(row, answer)| (*row, Some(self.fewer_modes.modes), answer));
        own.chain(fewer).collect()
    }

    /// Rows that had no answer in some draws at a level of noise.
    fn failures(&self) -> impl Iterator<Item = Failure<'_>> {
        self.levels.iter().flat_map(|level| {
            let rows = Row::all().into_iter().zip(&level.rows);
            rows.filter_map(|(row, errors)| {
                Some(Failure {
                    row,
                    noise: level.noise,
                    failed: errors.direct.failed,
                    draws: errors.direct.failed + errors.direct.answered,
                    reason: errors.direct.reason.as_deref()?,
                })
            })
        })
    }
}

/// Draws of a row without an answer.
struct Failure<'a> {
    row: Row,
    noise: f64,
    failed: usize,
    draws: usize,
    /// Why the first of them has none.
    reason: &'a str,
}

/// One elastic mode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FrequencyRow {
    /// Its number in the paper; the free system's first three modes are rigid.
    #[serde(rename = "mode")]
    pub number: usize,
    /// The paper's natural frequency, Hz.
    pub paper: f64,
    /// The twin's, from its model, Hz.
    pub twin: f64,
    /// The twin's over the paper's, per cent.
    #[serde(rename = "difference_percent")]
    pub difference: f64,
    /// Natural frequency from the noise-free responses, Hz, where the mode lies in the lines.
    pub identified: Option<f64>,
    /// Share of critical damping, likewise.
    pub damping: Option<f64>,
}

impl FrequencyRow {
    fn new(number: usize, paper: f64, twin: f64, identified: &[Pole]) -> Self {
        let close = |p: &&Pole| (p.frequency / twin - 1.0).abs() < 0.02;
        let identified = identified.iter().find(close);
        Self {
            number,
            paper,
            twin,
            difference: 100.0 * (twin / paper - 1.0),
            identified: identified.map(|p| p.frequency),
            damping: identified.map(|p| p.damping),
        }
    }
}
