//! One set of averaged lines to the rows of the study.

use super::rows::{Range, Row};
use super::twin::range_end;
use super::{Options, Twin, WeightRule};
use crate::measure::{Accelerations, RunGeometry, Survey};
use massline_core::identify::{Estimate, Identification, Procedure, Question, identify};
use massline_core::masslines::{
    Bands, EquationWeights, Lines, Masslines, Method, condense, lines_between,
};
use massline_core::modes::Pole;
use massline_core::spectra::BandError;
use nalgebra::Complex;
use serde::Serialize;

/// Numbers that the study compares, SI units: m, kg m², 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Numbers {
    /// The CG along x, the paper's ξ_S.
    pub x: f64,
    /// The CG along z, the paper's ζ_S.
    pub z: f64,
    /// Inertia about the y axis through A.
    pub theta_a: f64,
    /// Inertia about the y axis through S.
    pub theta_s: f64,
    /// Δ.
    pub indicator: f64,
}

impl From<[f64; Numbers::COUNT]> for Numbers {
    fn from([x, z, theta_a, theta_s, indicator]: [f64; Numbers::COUNT]) -> Self {
        Self {
            x,
            z,
            theta_a,
            theta_s,
            indicator,
        }
    }
}

impl Numbers {
    /// Number of them.
    pub const COUNT: usize = 5;

    /// In the order of the fields.
    #[must_use]
    pub fn list(&self) -> [f64; Self::COUNT] {
        [self.x, self.z, self.theta_a, self.theta_s, self.indicator]
    }

    /// True values of a twin.
    #[must_use]
    pub fn exact(twin: &Twin) -> Self {
        let known = |x: Option<f64>| x.unwrap_or(f64::NAN);
        let [x, _, z] = twin.truth.centre_of_gravity;
        let about_a = known(twin.truth.inertia_reference.yy);
        let about_s = known(twin.truth.inertia_cg.yy);
        Self::from([known(x), known(z), about_a, about_s, 1.0])
    }

    /// Relative errors of these numbers, in per cent, in the order of the fields.
    #[must_use]
    pub fn errors(&self, exact: &Self) -> [f64; Self::COUNT] {
        let (found, exact) = (self.list(), exact.list());
        core::array::from_fn(|i| 100.0 * (found[i] / exact[i] - 1.0))
    }

    pub(super) fn of(identification: &Identification) -> Option<Self> {
        let value = |e: Option<Estimate>| e.map(|e| e.value);
        Some(Self {
            x: value(identification.centre_of_gravity[0])?,
            z: value(identification.centre_of_gravity[2])?,
            theta_a: value(identification.inertia_reference[1])?,
            theta_s: value(identification.inertia_cg[1])?,
            indicator: value(identification.indicator)?,
        })
    }
}

/// Answer of one procedure for one row: the numbers, or the reason why there are none.
pub type Outcome = Result<Solution, String>;

/// The numbers, and after how many iterations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// The numbers.
    pub numbers: Numbers,
    /// One for the direct procedure.
    pub iterations: u32,
}

/// Answer of a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Solved once at A.
    pub direct: Outcome,
    /// With A moved to S until both coincide.
    pub iterative: Outcome,
    /// Poles of the modes that the method took account of: of the fixed structure for the
    /// apparent mass, of the free one for methods d and e.
    pub poles: Vec<Pole>,
}

impl Answer {
    /// None, and why.
    fn none(why: &str) -> Self {
        Self {
            direct: Err(why.to_owned()),
            iterative: Err(why.to_owned()),
            poles: Vec::new(),
        }
    }
}

/// Weights of the accelerometers; rows of one selection share their lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Selection {
    Interface,
    Alike,
    PerRun,
    Joined,
}

impl Selection {
    pub(super) const ALL: [Self; 4] = [Self::Interface, Self::Alike, Self::PerRun, Self::Joined];

    fn of(row: &Row, rule: WeightRule) -> Self {
        let per_run = match rule {
            WeightRule::ByMethod => row.method == Method::FrequencyResponses,
            WeightRule::PerRun => true,
            WeightRule::Joined => false,
        };
        if row.method.interface_only() {
            Self::Interface
        } else if !row.weighted {
            Self::Alike
        } else if per_run {
            Self::PerRun
        } else {
            Self::Joined
        }
    }
}

/// All rows of the study, asked of one set of spectra.
pub(super) struct Task<'t> {
    twin: &'t Twin,
    options: &'t Options,
    rows: Vec<Row>,
    per_run: Vec<Vec<f64>>,
    joined: Vec<Vec<f64>>,
}

impl<'t> Task<'t> {
    pub(super) fn new(
        twin: &'t Twin,
        options: &'t Options,
        survey: &Survey,
    ) -> Result<Self, BandError> {
        let (setup, least) = (&twin.setup, options.minimum_weight);
        let band = survey.lines(options.mode_band)?;
        Ok(Self {
            rows: Row::all(),
            per_run: survey.weights_per_run(setup, band, least),
            joined: survey.weights_joined(setup, band, least),
            twin,
            options,
        })
    }

    pub(super) fn none_yet(&self) -> Vec<Answer> {
        let empty = |_| Answer::none("not asked");
        self.rows.iter().map(empty).collect()
    }

    pub(super) fn ranges(&self) -> [Range; 3] {
        [Range::I, Range::II, Range::Fit]
    }

    /// First and last frequency of a range, Hz.
    pub(super) fn band(&self, range: Range) -> [f64; 2] {
        range_of(self.options, self.twin, range)
    }

    pub(super) fn accelerations(&self, selection: Selection) -> Accelerations {
        match selection {
            Selection::Interface => Accelerations::Interface,
            Selection::Alike => Accelerations::All(None),
            Selection::PerRun => Accelerations::All(Some(self.per_run.clone())),
            Selection::Joined => Accelerations::All(Some(self.joined.clone())),
        }
    }

    /// Answers the rows of one selection and range.
    pub(super) fn answer<L: Lines>(
        &self,
        selection: Selection,
        range: Range,
        lines: &L,
        geometry: &RunGeometry,
        answers: &mut [Answer],
    ) {
        let wanted =
            |row: &Row| row.range == range && Selection::of(row, self.options.weights) == selection;
        for (row, answer) in self.rows.iter().zip(answers) {
            if wanted(row) {
                *answer = self.row(row, lines, geometry);
            }
        }
    }

    fn row<L: Lines>(&self, row: &Row, lines: &L, geometry: &RunGeometry) -> Answer {
        let bands = match self.bands(row, lines) {
            Ok(bands) => bands,
            Err(e) => return Answer::none(&e.to_string()),
        };
        let mut work = vec![Complex::new(0.0, 0.0); 2 * lines.count()];
        let condensed = condense(
            row.method,
            lines,
            &bands,
            geometry.reference,
            &geometry.equations,
            &mut work,
        );
        match condensed {
            Ok(condensed) => Answer {
                direct: self.solve(&condensed.masslines, Procedure::Direct),
                iterative: self.solve(
                    &condensed.masslines,
                    Procedure::Iterative {
                        tolerance: self.options.tolerance,
                        limit: self.options.iterations,
                    },
                ),
                poles: match (condensed.apparent_mass, condensed.free_modes) {
                    (Some(fit), _) => fit.poles.to_vec(),
                    (_, Some(modes)) => modes.poles.to_vec(),
                    _ => Vec::new(),
                },
            },
            Err(e) => Answer::none(&e.to_string()),
        }
    }

    fn bands<L: Lines>(&self, row: &Row, lines: &L) -> Result<Bands, BandError> {
        let mut bands = Bands::new(lines_between(lines, self.band(row.range))?);
        bands.modes = self.options.modes;
        // The paper's rows are the paper's least squares.
        bands.equations = EquationWeights::Unit;
        let fit_band = match row.method {
            Method::ApparentMass => Some(self.options.pole_band),
            _ => self.options.fit_band,
        };
        if let Some(band) = fit_band {
            bands.fit = lines_between(lines, band)?;
        }
        Ok(bands)
    }

    fn solve(&self, masslines: &Masslines, procedure: Procedure) -> Outcome {
        let question = Question::new(self.twin.setup.known_mass, procedure);
        let found =
            identify(std::slice::from_ref(masslines), &question).map_err(|e| e.to_string())?;
        let numbers = Numbers::of(&found)
            .ok_or_else(|| "not all of x, z, Θ and Δ are observable".to_owned())?;
        Ok(Solution {
            numbers,
            iterations: found.iterations,
        })
    }
}

/// First and last frequency of a range, Hz. Method d averages nothing; what tells whether
/// the excitation is strong enough are the lines of range I.
pub(super) fn range_of(options: &Options, twin: &Twin, range: Range) -> [f64; 2] {
    let first = twin.fixed.first().copied().unwrap_or(0.0);
    let number = usize::from(range == Range::II);
    [options.spacing, range_end(options, first, number)]
}
