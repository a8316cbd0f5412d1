//! From averaged spectra to the answer: chooses the method, condenses groups of runs to
//! masslines and asks the core for the ten numbers.

use crate::measure::{
    self, Accelerations, MeasureError, MeasuredPoses, MeasuredRun, Measurement, Progress, Spectra,
    WINDOW,
};
use crate::setup::{Mount, Setup};
use massline_core::identify::{self, Identification, IdentifyError, Procedure, Question};
use massline_core::masslines::{
    self, ApparentMass, Bands, Condensed, CrossLines, DriveLines, FreeModes, Lines, MasslineError,
    Masslines, Method, StaticFit,
};
use massline_core::rigid_body::{Inertia, RigidBody};
use massline_core::spectra::{CrossAverage, RunResponses};
use nalgebra::{Complex, Vector6};

/// What the user chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// `None`: the recommended one.
    pub method: Option<Method>,
    /// Direct or iterative.
    pub procedure: Procedure,
    /// Whether weights of the accelerometers are used.
    pub weighted: bool,
}

impl Default for Choice {
    fn default() -> Self {
        Self {
            method: None,
            procedure: Procedure::Direct,
            weighted: true,
        }
    }
}

/// The answer, and what it was made of.
pub struct Answer {
    /// The method used.
    pub method: Method,
    /// Why this one, if the user left the choice.
    pub why: Option<&'static str>,
    /// Whether accelerometer weights were used.
    pub weighted: bool,
    /// Direct or iterative.
    pub procedure: Procedure,
    /// The ten numbers.
    pub identification: Identification,
    /// Averaged spectra.
    pub measurement: Measurement,
    /// The fit of each group of runs, where the method is the apparent mass.
    pub fits: Vec<ApparentMass>,
    /// The modes of the free structure behind each group of runs, where the method fits them.
    pub free_modes: Vec<FreeModes>,
    /// Constant offsets of the six resultants of each static run, N and N m.
    pub offsets: Vec<(String, [f64; 6])>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum AnswerError {
    /// The recordings cannot be measured.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// The spectra do not give masslines.
    #[error("{source}; {advice}")]
    Masslines {
        /// What is wrong.
        source: MasslineError,
        /// What to do.
        advice: &'static str,
    },
    /// The masslines do not give an answer.
    #[error("{source}; {advice}")]
    Identify {
        /// What is wrong.
        source: IdentifyError,
        /// What to do.
        advice: &'static str,
    },
}

impl AnswerError {
    /// 1 where the data do not allow an answer, 2 where the input is unusable.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Measure(e) if !e.is_data() => 2,
            _ => 1,
        }
    }
}

impl From<MasslineError> for AnswerError {
    fn from(source: MasslineError) -> Self {
        let advice = match source {
            MasslineError::TooFewLines(_) => {
                "widen `averaging_band` or lengthen `block_length` for finer lines"
            }
            MasslineError::NoExcitation => {
                "shake harder, record longer, or check that the interface accelerometers and the drive belong to this recording"
            }
            MasslineError::NoResultant => "add load cells until every load path is measured",
            MasslineError::TooManyPairs => "identify from fewer runs",
            MasslineError::NoReference => {
                "record the generator's signal and name it as `reference`, or use --method apparent-mass"
            }
            MasslineError::TooFewRuns { .. } => {
                "add runs that move the table in other directions, or use --method apparent-mass, which needs fewer"
            }
            MasslineError::NoMode => {
                "extend `mode_band` to where the structure rings, or use --method c-squared, which needs no modes"
            }
            MasslineError::Singular => "check the recordings for channels without signal",
        };
        Self::Masslines { source, advice }
    }
}

impl From<IdentifyError> for AnswerError {
    fn from(source: IdentifyError) -> Self {
        let advice = match source {
            IdentifyError::NoMasslines => "the setup needs at least one run",
            IdentifyError::NothingObservable => {
                "check that load cells and accelerometers share one recording and that the table moved"
            }
            IdentifyError::KnownMass(_) => "correct `known_mass` or leave it out",
            IdentifyError::Diverged(_) | IdentifyError::NotConverged(_) => {
                "use --direct, or a reference point nearer to the specimen"
            }
            IdentifyError::NotFinite => "check the recordings for channels without signal",
        };
        Self::Identify { source, advice }
    }
}

/// The recommended method for a setup, and why it is.
#[must_use]
pub fn recommended(setup: &Setup) -> (Method, &'static str) {
    let interface = |m: &crate::setup::AccelerometerEntry| m.mount == Mount::Interface;
    if setup.accelerometers.iter().any(interface) {
        (
            Method::ApparentMass,
            "its base acceleration comes from the interface, so the structure's elasticity does not bias it",
        )
    } else {
        (
            Method::PowerSpectraCholesky,
            "no accelerometer is marked `mount = \"interface\"`, which the apparent mass would need",
        )
    }
}

/// Reads the recordings of a setup and identifies the body.
///
/// # Errors
/// [`AnswerError`].
pub fn answer(
    setup: &Setup,
    choice: &Choice,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Answer, AnswerError> {
    let (method, why) = match choice.method {
        Some(method) => (method, None),
        None => {
            let (method, why) = recommended(setup);
            (method, Some(why))
        }
    };
    let accelerations = if method.interface_only() {
        Accelerations::Interface
    } else {
        Accelerations::All {
            weighted: choice.weighted,
        }
    };
    let measurement = measure::measure(setup, accelerations, progress)?;
    let mut answer = from_measurement(setup, method, choice, measurement)?;
    answer.why = why;
    Ok(answer)
}

fn from_measurement(
    setup: &Setup,
    method: Method,
    choice: &Choice,
    measurement: Measurement,
) -> Result<Answer, AnswerError> {
    let mut warnings = measurement.warnings.clone();
    let mut sets: Vec<Masslines> = Vec::new();
    let mut fits = Vec::new();
    let mut free_modes = Vec::new();
    for group in groups(&measurement.runs) {
        let condensed = masslines_of(&group, method, &measurement)?;
        sets.push(condensed.masslines);
        fits.extend(condensed.apparent_mass);
        free_modes.extend(condensed.free_modes);
    }
    let question = Question {
        known_mass: setup.known_mass,
        procedure: choice.procedure,
    };
    let dynamic = sets.len();
    let mut statics = add_poses(&measurement.poses, None, &mut sets)?;
    let mut identification = identify::identify(&sets, &question)?;
    if !statics.is_empty() {
        // A second pass weights the poses with what the rigid body of the first leaves.
        sets.truncate(dynamic);
        statics = add_poses(&measurement.poses, Some(&identification), &mut sets)?;
        identification = identify::identify(&sets, &question)?;
    }
    let offsets = statics
        .iter()
        .map(|(name, fit)| (name.clone(), offsets(&identification, fit)))
        .collect();
    notice(&identification, &measurement, &mut warnings);
    Ok(Answer {
        method,
        why: None,
        weighted: choice.weighted && !method.interface_only(),
        procedure: choice.procedure,
        identification,
        measurement,
        fits,
        free_modes,
        offsets,
        warnings,
    })
}

fn add_poses(
    runs: &[MeasuredPoses],
    first: Option<&Identification>,
    sets: &mut Vec<Masslines>,
) -> Result<Vec<(String, StaticFit)>, AnswerError> {
    let matrix = first.map(|i| at_rest(i).mass_matrix(&i.reference));
    let mut fits = Vec::new();
    for poses in runs {
        let fit = poses.poses.masslines(
            poses.geometry.reference,
            &poses.geometry.equations,
            &poses.noise,
            matrix.as_ref(),
        )?;
        sets.push(fit.masslines.clone());
        fits.push((poses.name.clone(), fit));
    }
    Ok(fits)
}

/// The body as far as it matters where nothing turns: unknown terms are zero.
fn at_rest(identification: &Identification) -> RigidBody {
    let value = |e: Option<identify::Estimate>| e.map_or(0.0, |e| e.value);
    RigidBody {
        mass: value(identification.mass),
        centre_of_gravity: identification.centre_of_gravity.map(value).into(),
        inertia: Inertia::default(),
    }
}

/// Runs that share their equations and their way of averaging condense together.
fn groups(runs: &[MeasuredRun]) -> Vec<Vec<&MeasuredRun>> {
    let alike = |a: &MeasuredRun, b: &MeasuredRun| {
        let difference = a.geometry.equations.rows() - b.geometry.equations.rows();
        // Equal up to the rounding of a rotation matrix.
        difference.norm() < 1e-9 && a.responses().is_some() == b.responses().is_some()
    };
    let mut groups: Vec<Vec<&MeasuredRun>> = Vec::new();
    for run in runs {
        match groups.iter_mut().find(|g| alike(g[0], run)) {
            Some(group) => group.push(run),
            None => groups.push(vec![run]),
        }
    }
    groups
}

fn masslines_of(
    group: &[&MeasuredRun],
    method: Method,
    measurement: &Measurement,
) -> Result<Condensed, AnswerError> {
    let responses: Vec<RunResponses<'_>> = group.iter().filter_map(|r| r.responses()).collect();
    if let Some(lines) = DriveLines::new(&responses, WINDOW) {
        return condense(&lines, group[0], method, measurement);
    }
    let settings = *group[0].settings();
    let mut storage: Vec<(Vec<massline_core::spectra::Sum>, u32)> = group
        .iter()
        .filter_map(|r| match &r.spectra {
            Spectra::Cross { sums } => Some((sums.clone(), r.blocks)),
            Spectra::Drive { .. } => None,
        })
        .collect();
    let averages: Vec<CrossAverage<'_>> = storage
        .iter_mut()
        .filter_map(|(sums, blocks)| CrossAverage::resume(&settings, sums, *blocks).ok())
        .collect();
    let maps: Vec<_> = group.iter().map(|r| r.geometry.map.clone()).collect();
    let lines = CrossLines::new(
        &averages,
        settings.grid(),
        measurement.band.clone(),
        WINDOW,
        measurement.hop,
        &maps,
    )
    .ok_or(MasslineError::TooManyPairs)?;
    condense(&lines, group[0], method, measurement)
}

fn condense<L: Lines>(
    lines: &L,
    first: &MeasuredRun,
    method: Method,
    measurement: &Measurement,
) -> Result<Condensed, AnswerError> {
    let geometry = &first.geometry;
    let bands = Bands::new(measurement.band.clone(), lines.count());
    let mut work = vec![Complex::new(0.0, 0.0); 2 * lines.count()];
    Ok(masslines::condense(
        method,
        lines,
        &bands,
        geometry.reference,
        &geometry.equations,
        &mut work,
    )?)
}

/// What the load cells read besides `M (a - g)`.
fn offsets(identification: &Identification, fit: &StaticFit) -> [f64; 6] {
    let matrix = at_rest(identification).mass_matrix(&identification.reference);
    let left: Vector6<f64> = fit.mean_force - matrix * fit.mean_acceleration;
    left.into()
}

/// Adds what the numbers themselves say about the test.
fn notice(identification: &Identification, measurement: &Measurement, warnings: &mut Vec<String>) {
    let missing: Vec<&str> = identification.unobservable().map(|p| p.name()).collect();
    if !missing.is_empty() {
        warnings.push(format!(
            "not observable from this test: {}",
            missing.join(", ")
        ));
    }
    if let Some(reason) = identification.plausibility.first_violation() {
        warnings.push(format!("no real body has these properties: {reason}"));
    }
    if let Some(ratio) = identification.consistency
        && ratio > 4.0
    {
        warnings.push(format!(
            "a rigid body leaves {:.1} times more than the noise explains; error bars were widened. Check sensor positions, directions and scales",
            ratio.sqrt()
        ));
    }
    if identification.attenuation > 0.25 {
        warnings.push(
            "noise in the base acceleration pulls some results towards zero by as much as their error bars say; shake harder in rotation".to_owned(),
        );
    }
    let cross = |r: &MeasuredRun| matches!(r.spectra, Spectra::Cross { .. });
    if measurement.runs.iter().any(cross) {
        warnings.push(
            "without a drive channel (`reference`) the noise of the accelerometers biases the result; record the generator's signal if you can".to_owned(),
        );
    }
}
