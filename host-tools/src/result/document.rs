//! The form of the document.

use super::{FindingDocument, InertiaTerms, Number};
use crate::frame::Frame;
use crate::recording::{Traceability, TrueRate};
use massline_core::identify::Covariance;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;

/// Physical plausibility of the identified body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plausible {
    /// True where every condition holds by more than its error bar, false where one is
    /// violated by more than that, null where this test cannot judge.
    pub ok: Option<bool>,
    /// The condition that is violated, or the one that cannot be judged.
    pub reason: Option<String>,
    /// Smallest principal moment over the largest absolute one; negative is not positive
    /// definite. Where only some moments are known, the smallest of these.
    pub positive_definite_margin: Option<f64>,
    /// Half of its 95 % interval.
    pub positive_definite_interval: Option<f64>,
    /// Sum of the two smaller principal moments minus the largest, over the largest absolute
    /// one.
    pub triangle_margin: Option<f64>,
    /// Half of its 95 % interval.
    pub triangle_interval: Option<f64>,
}

/// Covariance of the ten numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CovarianceDocument {
    /// Names of rows and columns.
    pub rows: [String; 10],
    /// Their units.
    pub units: [String; 10],
    /// The matrix; null in the row and the column of what is not observable.
    pub matrix: Covariance,
}

/// Fisher's F test of the hypothesis that a rigid body explains the data.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConsistencyDocument {
    /// Power that a rigid body leaves over power that noise leaves; of static poses the one
    /// against what a free linear fit leaves.
    pub ratio: f64,
    /// Equations beyond the unknowns, and degrees of freedom of the noise; null where infinite.
    pub freedom: [Option<f64>; 2],
    /// Probability that noise alone leaves as much or more.
    pub probability: f64,
}

/// Deflection of a mode at an accelerometer, largest one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deflection {
    /// The accelerometer's channel.
    pub channel: String,
    /// Part of the shape along the channel's direction, of a shape whose largest deflection is one.
    pub value: f64,
}

/// A mode of the structure on the fixed interface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FixedModeDocument {
    /// Natural frequency, Hz.
    pub frequency: f64,
    /// Share of critical damping.
    pub damping: f64,
    /// Effective masses along and about x, y, z of the reference point: kg, kg m²; null
    /// where not excited or not measured.
    pub effective_mass: [Option<f64>; 6],
    /// Share of the whole mass or inertia that each is.
    pub effective_mass_share: [Option<f64>; 6],
    /// Participation per square root of modal mass, √kg and √kg m.
    pub participation: [Option<f64>; 6],
    /// Modal mass for a shape whose largest deflection is one, kg.
    pub modal_mass: Option<f64>,
    /// Shape at the accelerometers, relative to the base.
    pub shape: Option<Vec<Deflection>>,
    /// Share of the fitted effective mass matrix that one shape explains.
    pub purity: f64,
}

/// A mode of the free structure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FreeModeDocument {
    /// Natural frequency, Hz.
    pub frequency: f64,
    /// Share of critical damping.
    pub damping: f64,
    /// Shape at the accelerometers.
    pub shape: Option<Vec<Deflection>>,
}

/// Offsets of the resultants in a static run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Offsets {
    /// Name of the run.
    pub run: String,
    /// fx, fy, fz (N), tx, ty, tz (N m) at the reference point.
    pub resultants: [f64; 6],
}

/// Samples and blocks of a random run, and those that were left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunQuality {
    /// Name of the run.
    pub run: String,
    /// Samples read.
    pub samples: u64,
    /// Blocks averaged.
    pub blocks: u32,
    /// Blocks left out for faulty samples.
    pub rejected: u32,
    /// Blocks left out for each fault; one with two faults counts twice.
    pub rejected_by: BTreeMap<String, u32>,
    /// Faulty samples; null from a box, which counts blocks only.
    pub faulty_samples: Option<u64>,
    /// Samples that never came, among them.
    pub missing_samples: u64,
    /// The true sample rate, where the recording carries it.
    pub true_sample_rate: Option<TrueRate>,
    /// Calibrations of the channels that the recording states one for.
    pub calibration: BTreeMap<String, Traceability>,
}

/// Source of the noise of a run: `spectra`, `stated`, `repeats`, `neighbours`, `residual` or
/// `assumed`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NoiseDocument {
    /// Name of the run.
    pub run: String,
    /// Source of the noise of its accelerations.
    pub accelerations: String,
    /// Source of the noise of its forces.
    pub forces: String,
}

/// A mode of a maximum likelihood fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LikelihoodMode {
    /// Undamped natural frequency of the fixed structure, Hz.
    pub frequency: f64,
    /// Its standard deviation, Hz; null where the lines do not tell it.
    pub frequency_std: Option<f64>,
    /// Share of critical damping at resonance.
    pub damping: f64,
    /// Its standard deviation; null where the lines do not tell it.
    pub damping_std: Option<f64>,
    /// Exponent of the damping over frequency: 1 viscous, 0 structural.
    pub damping_exponent: f64,
    /// `true` if the frequency lies among the lines.
    pub among_lines: bool,
}

/// Maximum likelihood fit: lines, modes and tests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LikelihoodDocument {
    /// `true` if the ten numbers are those of the fit.
    pub used: bool,
    /// Reason why they are those of the averaging band.
    pub stepped_back: Option<String>,
    /// First and last line of the fit, Hz.
    pub band: Option<[f64; 2]>,
    /// Lines of all records.
    pub lines: usize,
    /// Modes of the fit, ascending.
    pub modes: Vec<LikelihoodMode>,
    /// Power of the residuals over that of the noise.
    pub residual_ratio: Option<f64>,
    /// The same of each record in stretches of frequency, from low to high.
    pub residuals: Vec<Vec<f64>>,
    /// Squared distance between the fits of low and of all lines; null where it cannot be told.
    pub low_line_distance: Option<f64>,
    /// `true` if the fit has converged.
    pub converged: bool,
    /// Standard deviations over the Cramér-Rao bound of the fitted model and these lines, root mean square.
    pub over_bound: Option<f64>,
    /// Wider bands that were tried, with the reason why they were not used.
    pub rejected: Vec<RejectedBand>,
}

impl LikelihoodDocument {
    /// Words after the ratio of the error bars to the Cramér-Rao bound, which knows the lines and nothing else.
    pub(crate) fn bound_in_words(&self) -> &'static str {
        if self.over_bound.is_some_and(|over| over < 1.0) {
            "what these lines could give by themselves (Cramér-Rao bound of the fitted model), without what is known of base and body beforehand"
        } else {
            "what these lines could give at best (Cramér-Rao bound of the fitted model)"
        }
    }
}

/// A band whose fit was not used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RejectedBand {
    /// Its last line, Hz.
    pub highest: f64,
    /// Reason.
    pub reason: String,
}

/// The result document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResultDocument {
    /// [`SCHEMA`](super::SCHEMA).
    pub schema: String,
    /// Heading of the setup.
    pub title: String,
    /// Name of the method.
    pub method: String,
    /// Reason for this method, where the user left the choice.
    pub recommended_because: Option<String>,
    /// Reason why the numbers must not be believed, and what to do; null where there is none.
    pub refused: Option<String>,
    /// `true` if the reference point was iterated to the CG.
    pub iterative: bool,
    /// `true` if accelerometer weights were used.
    pub weighted: bool,
    /// Frame of all numbers below, in the coordinates of the sensors; absent where it is theirs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<Frame>,
    /// The reference point A, m.
    pub reference_point: [f64; 3],
    /// Overall mass, kg.
    pub mass: Number,
    /// Δ where the mass was known, else null.
    pub indicator: Option<Number>,
    /// Centre of gravity in the global frame, m.
    pub centre_of_gravity: [Number; 3],
    /// Definition of the products of inertia.
    pub products_of_inertia: String,
    /// Inertia about the reference point, kg m².
    pub inertia_reference: InertiaTerms,
    /// Inertia about the centre of gravity, kg m².
    pub inertia_cg: InertiaTerms,
    /// Principal moments about the centre of gravity, ascending, kg m².
    pub principal_moments: Option<[f64; 3]>,
    /// Their axes, one unit vector each.
    pub principal_axes: Option<[[f64; 3]; 3]>,
    /// Degrees of freedom of the estimate of noise behind the error bars; null where the noise
    /// counts as known.
    pub freedom: Option<f64>,
    /// Covariance of mass (or Δ), centre of gravity and inertia about it; null from a box.
    pub covariance: Option<CovarianceDocument>,
    /// Its share of type B; absent where no type B uncertainty is stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub covariance_type_b: Option<CovarianceDocument>,
    /// Condition number of the column-equilibrated normal equations.
    #[serde(deserialize_with = "null_is_infinite")]
    pub condition_number: f64,
    /// Iterations done.
    pub iterations: u32,
    /// Residual of the masslines over what their noise explains; about one is good.
    pub consistency: Option<f64>,
    /// The test that this ratio makes; null where there are no more equations than unknowns, and
    /// from a box.
    pub consistency_test: Option<ConsistencyDocument>,
    /// Share of the forces that a rigid body leaves, as amplitude.
    pub misfit: f64,
    /// Physical plausibility of the body.
    pub plausible: Plausible,
    /// Modes of the structure on the fixed interface, with effective masses.
    pub fixed_modes: Vec<FixedModeDocument>,
    /// Modes of the free structure, where enough runs were recorded.
    pub free_modes: Vec<FreeModeDocument>,
    /// Offsets estimated in static runs.
    pub offsets: Vec<Offsets>,
    /// Random runs with the samples and blocks that were left out.
    pub runs: Vec<RunQuality>,
    /// Source of the noise of each run, which decides what is observable.
    pub noise: Vec<NoiseDocument>,
    /// The maximum likelihood fit; absent where it was not asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub likelihood: Option<LikelihoodDocument>,
    /// Faults of the setup that the recordings contradict; absent where nothing was found.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<FindingDocument>,
    /// Warnings to the user.
    pub warnings: Vec<String>,
    /// The box that has measured and identified; absent where this program did.
    #[serde(rename = "box", skip_serializing_if = "Option::is_none")]
    pub device: Option<DeviceEntry>,
}

/// Identity of a box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceEntry {
    /// Name of the firmware.
    pub firmware: String,
    /// Version of the firmware.
    pub version: String,
    /// Source revision that the firmware was built from.
    pub build: String,
    /// Name of the chip.
    pub chip: String,
}

/// All methods side by side, `massline/comparison/1`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ComparisonDocument {
    /// [`COMPARISON_SCHEMA`](super::COMPARISON_SCHEMA).
    pub schema: String,
    /// Heading of the setup.
    pub title: String,
    /// Name of the recommended method.
    pub recommended: String,
    /// Reason for the recommendation.
    pub recommended_because: String,
    /// Answers of the methods.
    pub results: Vec<ResultDocument>,
    /// Methods without an answer, with the reason.
    pub failed: Vec<FailedMethod>,
}

/// A method that gave no answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FailedMethod {
    /// Name of the method.
    pub method: String,
    /// Reason why there is no answer.
    pub reason: String,
}

/// JSON has no infinity: a condition number that is infinite is written as null.
fn null_is_infinite<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::INFINITY))
}
