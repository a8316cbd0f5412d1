//! The study as JSON, `massline/study/1`: all rows, so that a script can check the pattern.

use super::errors::Errors;
use super::estimate::{Answer, Numbers, Outcome};
use super::fits::Fits;
use super::monte_carlo::RowErrors;
use super::paper::{self, Printed};
use super::rows::{Range, Row};
use super::{Check, FrequencyRow, Options, Study};
use crate::identification::LIKELIHOOD;
use serde::Serialize;

/// The document. Lengths in m, inertia in kg m², frequencies in Hz, errors in per cent.
#[derive(Debug, Serialize)]
pub struct Document {
    /// Version of the document's form.
    pub schema: &'static str,
    /// Model that is studied.
    pub model: &'static str,
    /// Definition of the numbers.
    pub units: &'static str,
    /// All choices, the defaults included.
    pub options: Options,
    /// True values.
    pub exact: Numbers,
    /// Mass that was given as weighed, kg.
    pub mass: f64,
    /// First and last line of averaging ranges I and II, Hz.
    pub ranges: [[f64; 2]; 2],
    /// Table 1.
    pub fixed_frequencies: Vec<FrequencyRow>,
    /// Table 2.
    pub free_frequencies: Vec<FrequencyRow>,
    /// Weights of chapter 7.
    pub weights: Weights,
    /// Tables 3 and 4 and the rows that the paper lacks, noise-free.
    pub rows: Vec<RowEntry>,
    /// Method e, noise-free, with a modal analysis that misses a mode.
    pub e_with_fewer_modes: FewerEntry,
    /// The rows under noise.
    pub noise: Vec<LevelEntry>,
    /// Claims and figures.
    pub pattern: Vec<Check>,
    /// Notes to the reader.
    pub notes: Vec<&'static str>,
}

/// Weights of the accelerometers.
#[derive(Debug, Serialize)]
pub struct Weights {
    /// Their names.
    pub channels: Vec<String>,
    /// The same for all runs, from the responses to unit interface forces.
    pub joined: Vec<f64>,
    /// Weights from each run's own responses.
    pub per_run: Vec<RunWeights>,
}

/// Weights of one run.
#[derive(Debug, Serialize)]
pub struct RunWeights {
    /// Its name.
    pub run: String,
    /// In the order of the channels.
    pub weights: Vec<f64>,
}

/// One row, noise-free.
#[derive(Debug, Serialize)]
pub struct RowEntry {
    /// The row.
    #[serde(flatten)]
    pub key: Key,
    /// Solved once at A: table 3.
    pub direct: Answered,
    /// With A moved to S: table 4.
    pub iterative: Answered,
    /// Table 3 as printed.
    pub paper_table_3: Option<PrintedEntry>,
    /// Table 4 as printed.
    pub paper_table_4: Option<PrintedPair>,
}

/// Method e with fewer modes than there are.
#[derive(Debug, Serialize)]
pub struct FewerEntry {
    /// Modes fitted.
    pub modes: usize,
    /// The rows of method e.
    pub rows: Vec<RowEntry>,
}

/// Identity of a row.
#[derive(Debug, Serialize)]
pub struct Key {
    /// Method, range and weights in words.
    pub row: String,
    /// As `massline identify --method` takes it.
    pub method: &'static str,
    /// Averaging range; null for method d, which averages nothing.
    pub range: Option<Range>,
    /// `true` if the accelerometers were weighted.
    pub weighted: bool,
}

/// Answer of a row.
#[derive(Debug, Serialize)]
pub struct Answered {
    /// The numbers, or null.
    pub values: Option<Numbers>,
    /// Their errors, per cent.
    pub errors_percent: Option<Numbers>,
    /// Solutions until A and S coincided.
    pub iterations: Option<u32>,
    /// Why there are no numbers.
    pub failure: Option<String>,
}

/// A row of table 3 or 4 as printed, in SI units.
#[derive(Debug, Serialize)]
pub struct PrintedEntry {
    /// CG along x.
    pub x: f64,
    /// CG along z.
    pub z: f64,
    /// Inertia about A in table 3, about S in table 4.
    pub theta: f64,
    /// Δ, table 3 only.
    pub indicator: Option<f64>,
    /// Printed errors of x, z and Θ, per cent.
    pub errors_percent: [f64; 3],
}

/// Table 4's two lines of a method.
#[derive(Debug, Serialize)]
pub struct PrintedPair {
    /// Solved once at A.
    pub direct: PrintedEntry,
    /// With A moved to S.
    pub iterative: PrintedEntry,
}

/// All rows at one level of noise.
#[derive(Debug, Serialize)]
pub struct LevelEntry {
    /// Share of each channel's RMS.
    pub noise: f64,
    /// The rows.
    pub rows: Vec<NoisyEntry>,
    /// Maximum likelihood fits of the first draws; null without noise, and where none were wanted.
    pub likelihood: Option<FitsEntry>,
}

/// Maximum likelihood fits, the band's method on the same draws, and the bound of both.
#[derive(Debug, Serialize)]
pub struct FitsEntry {
    /// Name of the row.
    pub row: &'static str,
    /// As `massline identify --method` takes it.
    pub method: &'static str,
    /// Its errors.
    pub direct: Errors,
    /// Root mean square of the standard deviations that it claims, per cent.
    pub claimed_percent: Numbers,
    /// Draws that have the band's numbers.
    pub stepped_back: usize,
    /// Errors of `apparent-mass` in averaging range II, with its equations weighed by their noise.
    pub band: Errors,
    /// Root mean square of the standard deviations that it claims, per cent.
    pub band_claimed_percent: Numbers,
    /// Bound of Cramér and Rao of all lines, per cent.
    pub bound_percent: Numbers,
}

impl FitsEntry {
    fn new(fits: &Fits) -> Self {
        Self {
            row: Fits::NAME,
            method: LIKELIHOOD,
            direct: fits.fit.clone(),
            claimed_percent: fits.claimed.into(),
            stepped_back: fits.stepped_back,
            band: fits.band.clone(),
            band_claimed_percent: fits.band_claimed.into(),
            bound_percent: fits.bound.into(),
        }
    }
}

/// One row over the draws.
#[derive(Debug, Serialize)]
pub struct NoisyEntry {
    /// The row.
    #[serde(flatten)]
    pub key: Key,
    /// Its errors, direct and iterative.
    #[serde(flatten)]
    pub errors: RowErrors,
}

impl From<&Row> for Key {
    fn from(row: &Row) -> Self {
        Self {
            row: row.name(),
            method: row.method.name(),
            range: (row.range != Range::Fit).then_some(row.range),
            weighted: row.weighted,
        }
    }
}

impl From<Printed> for PrintedEntry {
    fn from(printed: Printed) -> Self {
        let [x, z, theta, indicator] = printed.values;
        Self {
            x: x * 1e-3,
            z: z * 1e-3,
            theta: theta * 1e-3,
            indicator: indicator.is_finite().then_some(indicator * 1e-2),
            errors_percent: printed.errors,
        }
    }
}

impl Answered {
    fn new(outcome: &Outcome, exact: &Numbers) -> Self {
        match outcome {
            Ok(solution) => Self {
                values: Some(solution.numbers),
                errors_percent: Some(solution.numbers.errors(exact).into()),
                iterations: Some(solution.iterations),
                failure: None,
            },
            Err(reason) => Self {
                values: None,
                errors_percent: None,
                iterations: None,
                failure: Some(reason.clone()),
            },
        }
    }
}

impl RowEntry {
    fn new(row: &Row, answer: &Answer, exact: &Numbers) -> Self {
        Self {
            key: row.into(),
            direct: Answered::new(&answer.direct, exact),
            iterative: Answered::new(&answer.iterative, exact),
            paper_table_3: paper::table_3(row).map(PrintedEntry::from),
            paper_table_4: paper::table_4(row).map(|[direct, iterative]| PrintedPair {
                direct: direct.into(),
                iterative: iterative.into(),
            }),
        }
    }
}

impl Document {
    /// The document of a study.
    #[must_use]
    pub fn new(study: &Study) -> Self {
        let [fixed, free] = study.tables();
        let setup = &study.twin.setup;
        let per_run = setup.runs.iter().zip(&study.weights.per_run);
        Self {
            schema: "massline/study/1",
            model: "tuning-fork",
            units: "m, kg, kg m2, Hz; errors in per cent; inertia about the y axis",
            options: study.options.clone(),
            exact: study.exact,
            mass: study.twin.truth.mass,
            ranges: [study.range(Range::I), study.range(Range::II)],
            fixed_frequencies: fixed,
            free_frequencies: free,
            weights: Weights {
                channels: setup
                    .accelerometers
                    .iter()
                    .map(|a| a.channel.clone())
                    .collect(),
                joined: study.weights.joined.clone(),
                per_run: per_run
                    .map(|(run, weights)| RunWeights {
                        run: run.name.clone(),
                        weights: weights.clone(),
                    })
                    .collect(),
            },
            rows: study
                .rows()
                .map(|(row, answer)| RowEntry::new(&row, answer, &study.exact))
                .collect(),
            e_with_fewer_modes: FewerEntry {
                modes: study.fewer_modes.modes,
                rows: study
                    .fewer_modes
                    .rows
                    .iter()
                    .map(|(row, answer)| RowEntry::new(row, answer, &study.exact))
                    .collect(),
            },
            noise: study
                .levels
                .iter()
                .map(|level| LevelEntry {
                    noise: level.noise,
                    likelihood: level.fits.as_ref().map(FitsEntry::new),
                    rows: Row::all()
                        .iter()
                        .zip(&level.rows)
                        .map(|(row, errors)| NoisyEntry {
                            key: row.into(),
                            errors: errors.clone(),
                        })
                        .collect(),
                })
                .collect(),
            pattern: study.checks.clone(),
            notes: vec![paper::FOOTNOTE],
        }
    }
}
