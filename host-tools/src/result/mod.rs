//! The result document, `massline/result/2`.

mod number;

pub use number::{CombinedDocument, InertiaTerms, Number, TypeBDocument};

use crate::box_runs::StoredRun;
use crate::identification::{Answer, Consistency, TypeB, number as place};
use crate::measure::{MeasuredRun, RunNoise};
use crate::recording::{Traceability, TrueRate, fault_words};
use crate::replay::DeviceEntry;
use crate::setup::Setup;
use massline_core::identify::{Covariance, Estimate, Identification, Procedure};
use massline_core::rigid_body::{Margin, Verdict};
use serde::Serialize;
use std::collections::BTreeMap;

/// Version of the document's form.
pub const SCHEMA: &str = "massline/result/2";

/// Whether a body like this could exist.
#[derive(Clone, Debug, Serialize)]
pub struct Plausible {
    /// True where every condition holds by more than its error bar, false where one is
    /// violated by more than that, null where this test cannot judge.
    pub ok: Option<bool>,
    /// The condition that is violated, or the one that cannot be judged.
    pub reason: Option<&'static str>,
    /// Smallest principal moment over the largest absolute one; negative is not positive
    /// definite. Where only some moments are known, the smallest of these.
    pub positive_definite_margin: Option<f64>,
    /// Half of its 95 % interval.
    pub positive_definite_interval: Option<f64>,
    /// What the two smaller principal moments exceed the largest by, over the largest
    /// absolute one.
    pub triangle_margin: Option<f64>,
    /// Half of its 95 % interval.
    pub triangle_interval: Option<f64>,
}

impl Plausible {
    fn new(i: &Identification) -> Self {
        let p = &i.plausibility;
        let margin = |m: Option<Margin>| m.map(|m| m.relative);
        let half = |m: Option<Margin>| m.map(|m| m.uncertainty).filter(|half| half.is_finite());
        Self {
            ok: match p.verdict() {
                Verdict::Holds => Some(true),
                Verdict::Violated => Some(false),
                Verdict::Undecided => None,
            },
            reason: p.reason(),
            positive_definite_margin: margin(p.positive_definite),
            positive_definite_interval: half(p.positive_definite),
            triangle_margin: margin(p.triangle),
            triangle_interval: half(p.triangle),
        }
    }
}

/// Covariance of the ten numbers, so that others can propagate it.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CovarianceDocument {
    /// What the rows and columns are.
    pub rows: [&'static str; 10],
    /// Their units.
    pub units: [&'static str; 10],
    /// The matrix; null in the row and the column of what is not observable.
    pub matrix: Covariance,
}

impl CovarianceDocument {
    fn new(i: &Identification, matrix: Covariance) -> Self {
        let (first, unit) = match i.indicator {
            Some(_) => ("indicator", "1"),
            None => ("mass", "kg"),
        };
        Self {
            rows: [first, "x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz"],
            units: core::array::from_fn(|k| match k {
                0 => unit,
                1..4 => "m",
                _ => "kg m²",
            }),
            matrix,
        }
    }
}

/// Whether a rigid body explains the data: Fisher's F.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ConsistencyDocument {
    /// Power that a rigid body leaves over power that noise leaves; of static poses the one
    /// against what a free linear fit leaves.
    pub ratio: f64,
    /// Equations beyond the unknowns, and degrees of freedom of the noise; null where infinite.
    pub freedom: [Option<f64>; 2],
    /// Probability that noise alone leaves as much or more.
    pub probability: f64,
}

impl ConsistencyDocument {
    fn new(test: Consistency) -> Self {
        Self {
            ratio: test.ratio,
            freedom: [test.surplus, test.freedom].map(|n| Some(n).filter(|n| n.is_finite())),
            probability: test.probability,
        }
    }
}

/// Deflection of a mode at an accelerometer, largest one.
#[derive(Clone, Debug, Serialize)]
pub struct Deflection {
    /// The accelerometer's channel.
    pub channel: String,
    /// Along its direction.
    pub value: f64,
}

/// A mode of the structure on the fixed interface.
#[derive(Clone, Debug, Serialize)]
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
#[derive(Clone, Debug, Serialize)]
pub struct FreeModeDocument {
    /// Natural frequency, Hz.
    pub frequency: f64,
    /// Share of critical damping.
    pub damping: f64,
    /// Shape at the accelerometers.
    pub shape: Option<Vec<Deflection>>,
}

fn deflections(channels: &[String], shape: Option<&Vec<f64>>) -> Option<Vec<Deflection>> {
    shape.map(|shape| {
        let pairs = channels.iter().zip(shape);
        pairs
            .map(|(channel, value)| Deflection {
                channel: channel.clone(),
                value: *value,
            })
            .collect()
    })
}

/// What the whole body has of each: mass along the axes, inertia about them.
fn whole(identification: &Identification) -> [Option<f64>; 6] {
    let mass = identification.mass.map(|m| m.value);
    let i = identification.inertia_reference;
    [
        mass,
        mass,
        mass,
        i[0].map(|t| t.value),
        i[1].map(|t| t.value),
        i[2].map(|t| t.value),
    ]
}

fn fixed_modes(channels: &[String], answer: &Answer) -> Vec<FixedModeDocument> {
    let whole = whole(&answer.identification);
    let modal = answer.modal.iter().flat_map(|m| &m.fixed);
    modal
        .map(|m| {
            let diagonal = m.mode.effective_mass.diagonal();
            let seen = |j: usize, x: f64| (diagonal[j] > 0.0).then_some(x);
            FixedModeDocument {
                frequency: m.mode.pole.frequency,
                damping: m.mode.pole.damping,
                effective_mass: core::array::from_fn(|j| seen(j, diagonal[j])),
                effective_mass_share: core::array::from_fn(|j| {
                    seen(j, diagonal[j]).zip(whole[j]).map(|(e, w)| e / w)
                }),
                participation: core::array::from_fn(|j| seen(j, m.mode.participation[j])),
                modal_mass: m.modal_mass,
                shape: deflections(channels, m.shape.as_ref()),
                purity: m.mode.rank_one,
            }
        })
        .collect()
}

fn free_modes(channels: &[String], answer: &Answer) -> Vec<FreeModeDocument> {
    let modal = answer.modal.iter().flat_map(|m| &m.free);
    modal
        .map(|m| FreeModeDocument {
            frequency: m.pole.frequency,
            damping: m.pole.damping,
            shape: deflections(channels, m.shape.as_ref()),
        })
        .collect()
}

/// Offsets of the resultants in a static run.
#[derive(Clone, Debug, Serialize)]
pub struct Offsets {
    /// Name of the run.
    pub run: String,
    /// fx, fy, fz (N), tx, ty, tz (N m) at the reference point.
    pub resultants: [f64; 6],
}

/// What a random run gave, and what had to be left out of it.
#[derive(Clone, Debug, Serialize)]
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
    pub rejected_by: BTreeMap<&'static str, u32>,
    /// Faulty samples; null from a box, which counts blocks only.
    pub faulty_samples: Option<u64>,
    /// Samples that never came, among them.
    pub missing_samples: u64,
    /// The true sample rate, where the recording carries it.
    pub true_sample_rate: Option<TrueRate>,
    /// What the sensitivities rest on, for the channels that the recording tells it of.
    pub calibration: BTreeMap<String, Traceability>,
}

impl RunQuality {
    /// What a box tells of a run.
    pub(crate) fn of_stored(run: &StoredRun) -> Self {
        let s = &run.summary;
        let by = fault_words().into_iter().zip(s.rejected_by);
        Self {
            run: run.name.clone(),
            samples: s.samples,
            blocks: s.blocks,
            rejected: s.rejected,
            rejected_by: by.filter(|(_, blocks)| *blocks > 0).collect(),
            faulty_samples: None,
            missing_samples: s.missing,
            true_sample_rate: run.sample_rate(),
            calibration: run.calibration.clone(),
        }
    }

    fn new(run: &MeasuredRun) -> Self {
        let by = fault_words().into_iter().zip(run.rejected.by_fault);
        Self {
            run: run.name.clone(),
            samples: run.samples,
            blocks: run.blocks,
            rejected: run.rejected.blocks,
            rejected_by: by.filter(|(_, blocks)| *blocks > 0).collect(),
            faulty_samples: Some(run.rejected.samples),
            missing_samples: run.rejected.missing,
            true_sample_rate: run.preamble.sample_rate.clone(),
            calibration: run.preamble.channel.clone(),
        }
    }
}

/// Where the noise of a run comes from: `spectra`, `stated`, `repeats`, `neighbours`, `residual`
/// or `assumed`.
#[derive(Clone, Debug, Serialize)]
pub struct NoiseDocument {
    /// Name of the run.
    pub run: String,
    /// Of its accelerations.
    pub accelerations: &'static str,
    /// Of its forces.
    pub forces: &'static str,
}

impl NoiseDocument {
    fn new(noise: &RunNoise) -> Self {
        Self {
            run: noise.run.clone(),
            accelerations: noise.accelerations.word(),
            forces: noise.forces.word(),
        }
    }
}

/// The result document.
#[derive(Clone, Debug, Serialize)]
pub struct ResultDocument {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Heading of the setup.
    pub title: String,
    /// Name of the method.
    pub method: &'static str,
    /// Why this method, where the user left the choice.
    pub recommended_because: Option<&'static str>,
    /// Why the numbers must not be believed, and what to do; null where nothing speaks against
    /// them.
    pub refused: Option<String>,
    /// Whether the reference point was iterated to the CG.
    pub iterative: bool,
    /// Whether accelerometer weights were used.
    pub weighted: bool,
    /// The reference point A, m.
    pub reference_point: [f64; 3],
    /// Overall mass, kg.
    pub mass: Number,
    /// Δ where the mass was known, else null.
    pub indicator: Option<Number>,
    /// Centre of gravity in the global frame, m.
    pub centre_of_gravity: [Number; 3],
    /// How the products of inertia are meant.
    pub products_of_inertia: &'static str,
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
    /// Covariance of mass (or Δ), centre of gravity and inertia about it; null from a box,
    /// which does not tell it.
    pub covariance: Option<CovarianceDocument>,
    /// The same of type B; absent where none is stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub covariance_type_b: Option<CovarianceDocument>,
    /// Of the column-equilibrated normal equations.
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
    /// Whether a body like this could exist.
    pub plausible: Plausible,
    /// Modes of the structure on the fixed interface, with effective masses.
    pub fixed_modes: Vec<FixedModeDocument>,
    /// Modes of the free structure, where enough runs were recorded.
    pub free_modes: Vec<FreeModeDocument>,
    /// Offsets estimated in static runs.
    pub offsets: Vec<Offsets>,
    /// Random runs: what they gave, and what was left out.
    pub runs: Vec<RunQuality>,
    /// Where the noise of each run comes from, which decides what is observable.
    pub noise: Vec<NoiseDocument>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// The box that has measured and identified, where one has.
    #[serde(rename = "box", skip_serializing_if = "Option::is_none")]
    pub device: Option<DeviceEntry>,
}

/// All methods side by side, `massline/comparison/1`.
#[derive(Clone, Debug, Serialize)]
pub struct ComparisonDocument {
    /// Version of the document's form.
    pub schema: &'static str,
    /// Heading of the setup.
    pub title: String,
    /// Name of the recommended method.
    pub recommended: &'static str,
    /// Why it is.
    pub recommended_because: &'static str,
    /// What the methods gave.
    pub results: Vec<ResultDocument>,
    /// The methods that gave nothing, and why.
    pub failed: Vec<FailedMethod>,
}

/// A method that gave no answer.
#[derive(Clone, Debug, Serialize)]
pub struct FailedMethod {
    /// Name of the method.
    pub method: &'static str,
    /// What it lacks.
    pub reason: String,
}

/// What gave the ten numbers, wherever that was.
#[derive(Clone, Copy, Debug)]
pub struct Origin<'a> {
    /// Title of the setup.
    pub title: &'a str,
    /// Name of the method.
    pub method: &'static str,
    /// Why this method, where the user left the choice.
    pub why: Option<&'static str>,
    /// Whether the reference point was iterated to the CG.
    pub iterative: bool,
    /// Whether accelerometer weights were used.
    pub weighted: bool,
}

impl ResultDocument {
    /// The document of an answer to `setup`.
    #[must_use]
    pub fn new(setup: &Setup, answer: &Answer) -> Self {
        let channels: Vec<String> = setup
            .accelerometers
            .iter()
            .map(|a| a.channel.clone())
            .collect();
        let origin = Origin {
            title: &setup.title,
            method: answer.method_name(),
            why: answer.why,
            iterative: matches!(answer.procedure, Procedure::Iterative { .. }),
            weighted: answer.weighted(),
        };
        let offsets = answer.offsets.iter().map(|(run, resultants)| Offsets {
            run: run.clone(),
            resultants: *resultants,
        });
        let runs = answer.measurement.runs.iter();
        let mut document = Self {
            fixed_modes: fixed_modes(&channels, answer),
            free_modes: free_modes(&channels, answer),
            offsets: offsets.collect(),
            runs: runs.map(RunQuality::new).collect(),
            noise: answer
                .measurement
                .noise
                .iter()
                .map(NoiseDocument::new)
                .collect(),
            warnings: answer.warnings.clone(),
            refused: answer.refused.clone(),
            consistency_test: answer.consistency.map(ConsistencyDocument::new),
            covariance: Some(CovarianceDocument::new(
                &answer.identification,
                answer.covariance,
            )),
            ..Self::of_numbers(&origin, &answer.identification)
        };
        if let Some(type_b) = &answer.type_b {
            document.add_type_b(&answer.identification, type_b);
        }
        document
    }

    /// Adds what errors of calibrations, places and directions do to the numbers.
    fn add_type_b(&mut self, i: &Identification, type_b: &TypeB) {
        let known = i.indicator.is_some();
        let covariance = type_b.covariance(known);
        self.covariance_type_b = Some(CovarianceDocument::new(i, covariance));
        let add = |first: usize, numbers: &mut [&mut Number]| {
            for (k, number) in numbers.iter_mut().enumerate() {
                number.add_type_b(first + k, i, type_b);
            }
        };
        add(place::MASS, &mut [&mut self.mass]);
        if let Some(indicator) = &mut self.indicator {
            add(place::INDICATOR, &mut [indicator]);
        }
        add(place::CENTRE, &mut self.centre_of_gravity.each_mut());
        add(place::INERTIA_REFERENCE, &mut self.inertia_reference.each());
        add(place::INERTIA_CG, &mut self.inertia_cg.each());
    }

    /// The document of the ten numbers alone.
    #[must_use]
    pub fn of_numbers(origin: &Origin<'_>, i: &Identification) -> Self {
        let number = |e: Option<Estimate>| Number::new(e, i.freedom);
        Self {
            schema: SCHEMA,
            title: origin.title.to_owned(),
            method: origin.method,
            recommended_because: origin.why,
            refused: None,
            iterative: origin.iterative,
            weighted: origin.weighted,
            reference_point: i.reference.into(),
            mass: number(i.mass),
            indicator: i.indicator.map(|e| number(Some(e))),
            centre_of_gravity: i.centre_of_gravity.map(number),
            products_of_inertia: "integral of x y dm, plus sign",
            inertia_reference: InertiaTerms::new(i.inertia_reference, i.freedom),
            inertia_cg: InertiaTerms::new(i.inertia_cg, i.freedom),
            principal_moments: i.principal.map(|p| p.moments.into()),
            principal_axes: i
                .principal
                .map(|p| core::array::from_fn(|c| p.axes.column(c).into_owned().into())),
            freedom: Some(i.freedom).filter(|freedom| freedom.is_finite()),
            covariance: None,
            covariance_type_b: None,
            condition_number: i.condition_number,
            iterations: i.iterations,
            consistency: i.consistency,
            consistency_test: None,
            misfit: i.misfit,
            plausible: Plausible::new(i),
            fixed_modes: Vec::new(),
            free_modes: Vec::new(),
            offsets: Vec::new(),
            runs: Vec::new(),
            noise: Vec::new(),
            warnings: Vec::new(),
            device: None,
        }
    }
}
