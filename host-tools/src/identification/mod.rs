//! From averaged spectra to the answer: chooses the method, condenses groups of runs to
//! masslines and asks the core for the ten numbers.

mod condense;
mod consistency;
mod coupling;
mod distortion;
mod drift;
mod error;
mod likelihood;
mod mean;
mod notice;
mod odd_run;
mod plausible;
mod predicted;
mod recommended;
mod refusal;
mod second_order;
mod statics;
mod type_b;
mod weights;

pub use consistency::{Consistency, REFUSED, WARNED};
pub(crate) use coupling::Coupling;
pub(crate) use distortion::Distorted;
pub(crate) use drift::Drift;
pub use error::{AnswerError, ExamineError};
pub(crate) use likelihood::{DESCRIPTION as LIKELIHOOD_IN_WORDS, fit_records, told_of};
pub use likelihood::{Likelihood, NAME as LIKELIHOOD, widest_band};
pub(crate) use notice::notice_numbers;
pub use odd_run::OddRun;
pub use recommended::{LIKELIHOOD_PASSES, Wanted, recommended};
pub use refusal::Refusal;
pub(crate) use refusal::refusal;
pub(crate) use second_order::{TERMS, with_second_order};
pub use type_b::{Combined, Contribution, NUMBERS, TypeB, estimates, number};

use crate::detective::{self, Findings, Undecided};
use crate::measure::{self, Accelerations, Measurement, Progress, SensorDistortions, Survey};
pub mod modal;
use crate::setup::{Mount, Setup};
use massline_core::identify::{self, Covariance, Identification, Procedure, Question, Workspace};
use massline_core::masslines::{ApparentMass, FixedMode, FreeModes, Masslines, Method};
use modal::Modal;
use std::rc::Rc;

/// Choices of the user.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// `None`: the recommended one of those that the box has, too.
    pub method: Option<Method>,
    /// `true` if the reference point is iterated to the CG.
    pub iterative: bool,
    /// `true` if weights of the accelerometers are used.
    pub weighted: bool,
}

impl Default for Choice {
    fn default() -> Self {
        Self {
            method: None,
            iterative: false,
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
    /// Weights of the accelerometers, one list a run, where the method used any.
    pub weights: Option<Vec<Vec<f64>>>,
    /// Direct or iterative.
    pub procedure: Procedure,
    /// The ten numbers.
    pub identification: Identification,
    /// Covariance of mass (or Δ), CG and inertia about S.
    pub covariance: Covariance,
    /// Test of the hypothesis that a rigid body explains the data; `None` where there are no more
    /// equations than unknowns.
    pub consistency: Option<Consistency>,
    /// Type B uncertainty from errors of calibrations, positions and directions, where the setup or
    /// certificates state any and the session was asked for it.
    pub type_b: Option<TypeB>,
    /// Why the numbers must not be believed, and what to do, where the data contradict them.
    pub refused: Option<Refusal>,
    /// Averaged spectra.
    pub measurement: Rc<Measurement>,
    /// The fit of each group of runs, where the method is the apparent mass.
    pub fits: Vec<ApparentMass>,
    /// The modes of the free structure behind each group of runs, where the method fits
    /// them.
    pub free_modes: Vec<FreeModes>,
    /// Modal data, where they were asked for.
    pub modal: Option<Modal>,
    /// Constant offsets of the six resultants of each static run, N and N m.
    pub offsets: Vec<(String, [f64; 6])>,
    /// Changes of the forces within runs.
    pub(crate) drifts: Vec<Drift>,
    /// Forces that are no linear functions of the motion.
    pub(crate) distorted: Distorted,
    /// A coupling of forces or accelerations to alternating current.
    pub(crate) coupling: Option<Coupling>,
    /// The maximum likelihood fit, or why there is none, where it was asked for or recommended.
    pub likelihood: Option<Likelihood>,
    /// Warnings to the user.
    pub warnings: Vec<String>,
}

/// Name and description of what gives the masslines where every run is static.
pub(crate) const STATIC_POSES: (&str, &str) = (
    "static-poses",
    "static poses, specific force in place of acceleration",
);

impl Answer {
    /// `true` if any run shook the table; otherwise all of them are static poses.
    #[must_use]
    pub fn is_dynamic(&self) -> bool {
        !(self.measurement.runs.is_empty() && self.measurement.sines.is_empty())
    }

    /// Short name of what gave the numbers.
    #[must_use]
    pub fn method_name(&self) -> &'static str {
        if self.likelihood.as_ref().is_some_and(Likelihood::is_used) {
            LIKELIHOOD
        } else if self.is_dynamic() {
            self.method.name()
        } else {
            STATIC_POSES.0
        }
    }

    /// `true` if no elastic mode was found where `mode_band` expects some, and nothing else found any.
    #[must_use]
    pub fn misses_modes(&self, setup: &Setup) -> bool {
        let fitted = self.likelihood.as_ref().is_some_and(Likelihood::is_used);
        !fitted && notice::misses_modes(setup, &self.fits).is_some()
    }

    /// `true` if accelerometer weights were used.
    #[must_use]
    pub fn weighted(&self) -> bool {
        self.weights.is_some()
    }
}

/// Told how far the reading of recordings is.
pub type OnProgress<'a> = &'a mut dyn FnMut(Progress<'_>);

/// Answers about one setup. Recordings are read once for each selection and weighting of
/// accelerometers, however many methods ask; [`Session::read_ahead`] joins passes.
pub struct Session<'s> {
    setup: &'s Setup,
    limit: Option<u64>,
    threads: Option<usize>,
    with_type_b: bool,
    survey: Option<Rc<Survey>>,
    measurements: Vec<(Accelerations, Rc<Measurement>)>,
    sensors: Option<Rc<[SensorDistortions]>>,
}

impl<'s> Session<'s> {
    /// A session that has read nothing yet.
    #[must_use]
    pub fn new(setup: &'s Setup) -> Self {
        Self::of_first(setup, None)
    }

    /// The same from at most the first `limit` samples of each random run.
    #[must_use]
    pub fn of_first(setup: &'s Setup, limit: Option<u64>) -> Self {
        Self {
            setup,
            limit,
            threads: None,
            with_type_b: false,
            survey: None,
            measurements: Vec::new(),
            sensors: None,
        }
    }

    /// The same with type B uncertainty in its answers, where the setup or certificates state
    /// what it comes from: one more pass over random recordings and two identifications for each
    /// source.
    #[must_use]
    pub fn with_type_b(self) -> Self {
        Self {
            with_type_b: true,
            ..self
        }
    }

    /// The same on so many threads, where it works on several; as many as there are processors if `None`. Results do
    /// not depend on it.
    #[must_use]
    pub fn on_threads(self, threads: Option<usize>) -> Self {
        Self { threads, ..self }
    }

    /// Reads each random recording once for an answer and the modal data beside it, several at a time. What cannot
    /// be read so is read when it is asked for, which gives the errors, too.
    pub fn read_ahead(&mut self, choice: &Choice, progress: OnProgress<'_>) {
        let method = choice.method.unwrap_or_else(|| recommended(self.setup).0);
        let has_interface = recommended(self.setup).0 == Method::ApparentMass;
        let interface = method.interface_only() || has_interface;
        let mut selections = vec![Accelerations::All(None)];
        selections.extend(interface.then_some(Accelerations::Interface));
        let read = measure::together(self.setup, &selections, self.limit, self.threads, progress);
        if let Ok(Some((measurements, survey))) = read {
            let measurements = measurements.into_iter().map(Rc::new);
            self.measurements
                .extend(selections.into_iter().zip(measurements));
            self.survey = Some(Rc::new(survey));
        }
    }

    /// A session whose averages are there already: with these accelerations nothing is read, and single sensors are not
    /// looked at.
    #[must_use]
    pub(crate) fn of_measurements(
        setup: &'s Setup,
        measurements: Vec<(Accelerations, Rc<Measurement>)>,
    ) -> Self {
        Self {
            measurements,
            sensors: Some(Rc::from([])),
            ..Self::new(setup)
        }
    }

    /// Reads what is needed and identifies the body.
    ///
    /// # Errors
    /// [`AnswerError`].
    pub fn answer(
        &mut self,
        choice: &Choice,
        progress: OnProgress<'_>,
    ) -> Result<Answer, AnswerError> {
        let (method, why) = match choice.method {
            Some(method) => (method, None),
            None => {
                let (method, why) = recommended(self.setup);
                (method, Some(why))
            }
        };
        let mut warnings = Vec::new();
        let accelerations = if method.interface_only() {
            Accelerations::Interface
        } else if choice.weighted {
            self.weighted(method, &mut warnings, progress)?
        } else {
            Accelerations::All(None)
        };
        let mut answer = self.answer_with(method, choice, &accelerations, progress)?;
        answer.why = why.filter(|_| answer.is_dynamic());
        answer.warnings.splice(0..0, warnings);
        if answer.refused.is_none() && method != Method::ApparentMass {
            answer.refused = self.refused_by_recommended();
        }
        Ok(answer)
    }

    /// The reason why the recommended method finds no rigid body in the data, if it is the apparent mass, and its
    /// averages are there: they are read beside those of any other method.
    fn refused_by_recommended(&self) -> Option<Refusal> {
        let (method, procedure) = (Method::ApparentMass, Procedure::Direct);
        if recommended(self.setup).0 != method {
            return None;
        }
        let interface = self.known(&Accelerations::Interface)?;
        let found = identify_from(self.setup, method, procedure, &interface).ok()?;
        refusal::by_recommended(&Judged {
            identification: &found.identification,
            type_b: None,
            consistency: found.consistency,
            widened: true,
        })
    }

    /// The answer of one method, with the base acceleration from the given accelerometers,
    /// whatever `choice` says of method and weights.
    ///
    /// # Errors
    /// [`AnswerError`].
    pub fn answer_with(
        &mut self,
        method: Method,
        choice: &Choice,
        accelerations: &Accelerations,
        progress: OnProgress<'_>,
    ) -> Result<Answer, AnswerError> {
        let measurement = self.measurement(accelerations, progress)?;
        let estimation = &self.setup.estimation;
        let procedure = if choice.iterative {
            Procedure::Iterative {
                tolerance: estimation.tolerance,
                limit: estimation.iterations,
            }
        } else {
            Procedure::Direct
        };
        let mut found = identify_from(self.setup, method, procedure, &measurement)?;
        let drifts = drift::drifts(&measurement, &found.identification);
        let doubtful = |test: Consistency| test.probability < WARNED;
        let doubtful = found.consistency.is_some_and(doubtful);
        let distorted = self.distorted(&measurement, doubtful, progress)?;
        let type_b = if self.with_type_b {
            let data = (accelerations, &*measurement);
            let gains = [drift::gains(&drifts, &measurement), distorted.gains()];
            let from = (&found, gains);
            self.type_b(method, procedure, data, from, progress)?
        } else {
            None
        };
        let mut warnings = measurement.warnings.clone();
        if let Some(type_b) = &type_b {
            warnings.extend(type_b.gaps(&found.identification));
            found.identification.plausibility =
                plausible::plausibility(&found.identification, &found.covariance, Some(type_b));
        }
        let judged = Judged {
            identification: &found.identification,
            type_b: type_b.as_ref(),
            consistency: found.consistency,
            widened: true,
        };
        let coupling = coupling::coupling(self.setup, &measurement, &found.identification);
        let coupled = coupling.as_ref().and_then(Coupling::refusal);
        let refused = coupled.or_else(|| refusal(&judged));
        notice::notice(&judged, &measurement, &mut warnings);
        if refused.is_none() {
            warnings.extend(coupling.as_ref().map(Coupling::warning));
        }
        let held = type_b.is_some();
        drift::notice(&drifts, &measurement, held, &mut warnings);
        distorted.notice(self.setup, held, &mut warnings);
        if refused.is_none() {
            notice::notice_missing_modes(self.setup, &found.fits, &mut warnings);
        }
        Ok(Answer {
            method,
            why: None,
            weights: match accelerations {
                Accelerations::All(weights) => weights.clone(),
                Accelerations::Interface => None,
            },
            procedure,
            identification: found.identification,
            covariance: found.covariance,
            consistency: found.consistency,
            type_b,
            refused,
            measurement,
            fits: found.fits,
            free_modes: found.free_modes,
            modal: None,
            offsets: found.offsets,
            drifts,
            distorted,
            coupling,
            likelihood: None,
            warnings,
        })
    }

    /// The survey of single accelerometers.
    ///
    /// # Errors
    /// [`AnswerError`].
    pub fn survey(&mut self, progress: OnProgress<'_>) -> Result<Rc<Survey>, AnswerError> {
        if let Some(survey) = &self.survey {
            return Ok(Rc::clone(survey));
        }
        let survey = Rc::new(measure::survey_first(self.setup, self.limit, progress)?);
        self.survey = Some(Rc::clone(&survey));
        Ok(survey)
    }

    /// Examines the sensors: which of them the recordings contradict.
    ///
    /// # Errors
    /// [`ExamineError`].
    pub fn examine(&mut self, progress: OnProgress<'_>) -> Result<Findings, ExamineError> {
        let setup = self.setup;
        let interface = |a: &crate::setup::AccelerometerEntry| a.mount == Mount::Interface;
        if !setup.accelerometers.iter().any(interface) {
            return Err(Undecided::NoInterface.into());
        }
        let measurement = self.measurement(&Accelerations::Interface, progress)?;
        let channels = measure::channels(setup, &measurement, self.limit, progress)
            .map_err(AnswerError::from)?;
        Ok(detective::examine(
            setup,
            &measurement,
            &channels,
            self.threads,
        )?)
    }

    /// `true` if the sensors contradict each other, so that it is worth to [examine](Self::examine) them; `false`
    /// where nothing can be said.
    pub fn is_contradicted(&mut self, progress: OnProgress<'_>) -> bool {
        let setup = self.setup;
        let mut found = || {
            let measurement = self.measurement(&Accelerations::Interface, progress).ok()?;
            let channels = measure::channels(setup, &measurement, self.limit, progress).ok()?;
            Some(detective::is_contradicted(setup, &measurement, &channels))
        };
        found().unwrap_or(false)
    }

    /// What the examination of the sensors does not see, in words: load cells without an entry in the setup, forces that
    /// change within runs, readings that are not linear, and forces or accelerations that are coupled to alternating
    /// current. None where the data allow no answer.
    pub fn notes(&mut self, progress: OnProgress<'_>) -> Vec<String> {
        let Ok(answer) = self.answer(&Choice::default(), progress) else {
            return Vec::new();
        };
        let drift = drift::in_words(&answer.drifts, &answer.measurement);
        let distorted = self.distorted(&answer.measurement, true, progress);
        let distorted = distorted.as_ref().unwrap_or(&answer.distorted);
        let distorted = distorted.in_words(self.setup);
        let coupling = answer.coupling.as_ref().map(Coupling::warning);
        let unlisted = answer.measurement.unlisted_cells();
        let told = [unlisted, drift, distorted, coupling];
        told.into_iter().flatten().collect()
    }

    /// The setup this session is about.
    #[must_use]
    pub fn setup(&self) -> &'s Setup {
        self.setup
    }

    /// Modes of the fixed structure from the interface accelerometers; none without them.
    ///
    /// # Errors
    /// [`AnswerError`] if the recordings cannot be read.
    pub fn fixed_modes(&mut self, progress: OnProgress<'_>) -> Result<Vec<FixedMode>, AnswerError> {
        let measurement = self.of_interface(progress)?;
        measurement.map_or_else(|| Ok(Vec::new()), |m| condense::fixed_modes(self.setup, &m))
    }

    /// Forces that are no linear functions of the motion; with the sensors behind them, for which recordings are
    /// read once more. Where the data are `doubtful` sensors are looked at in any case: faults that are far too large are
    /// not told by the forces.
    fn distorted(
        &mut self,
        measurement: &Measurement,
        doubtful: bool,
        progress: OnProgress<'_>,
    ) -> Result<Distorted, AnswerError> {
        let found = Distorted::of_forces(measurement);
        if found.is_empty() && !doubtful {
            return Ok(found);
        }
        Ok(found.with_sensors(&self.of_sensors(measurement, progress)?))
    }

    /// Readings of single sensors that are no linear functions of the motion.
    fn of_sensors(
        &mut self,
        measurement: &Measurement,
        progress: OnProgress<'_>,
    ) -> Result<Rc<[SensorDistortions]>, AnswerError> {
        if let Some(known) = &self.sensors {
            return Ok(Rc::clone(known));
        }
        let limit = self.limit;
        let sensors = measure::sensor_distortions(self.setup, measurement, limit, progress)?;
        let sensors: Rc<[SensorDistortions]> = sensors.into();
        self.sensors = Some(Rc::clone(&sensors));
        Ok(sensors)
    }

    /// Averages with the base acceleration from the interface accelerometers; `None` without any.
    fn of_interface(
        &mut self,
        progress: OnProgress<'_>,
    ) -> Result<Option<Rc<Measurement>>, AnswerError> {
        if recommended(self.setup).0 != Method::ApparentMass {
            return Ok(None);
        }
        self.measurement(&Accelerations::Interface, progress)
            .map(Some)
    }

    /// Averages of all runs, with the base acceleration from the given accelerometers.
    ///
    /// # Errors
    /// [`AnswerError`] if the recordings cannot be read.
    pub fn measurement(
        &mut self,
        accelerations: &Accelerations,
        progress: OnProgress<'_>,
    ) -> Result<Rc<Measurement>, AnswerError> {
        if let Some(known) = self.known(accelerations) {
            return Ok(known);
        }
        let measured = Rc::new(measure::measure_first(
            self.setup,
            accelerations,
            self.limit,
            progress,
        )?);
        self.measurements
            .push((accelerations.clone(), Rc::clone(&measured)));
        Ok(measured)
    }

    /// The same averages, if they are there already.
    fn known(&self, accelerations: &Accelerations) -> Option<Rc<Measurement>> {
        let mut known = self.measurements.iter();
        let (_, measured) = known.find(|(of, _)| of == accelerations)?;
        Some(Rc::clone(measured))
    }
}

/// The numbers from averages, and the fits behind them.
pub(crate) struct Found {
    pub(crate) identification: Identification,
    pub(crate) covariance: Covariance,
    pub(crate) consistency: Option<Consistency>,
    /// The masslines; none of static poses.
    pub(crate) sets: Vec<Masslines>,
    pub(crate) fits: Vec<ApparentMass>,
    pub(crate) free_modes: Vec<FreeModes>,
    pub(crate) offsets: Vec<(String, [f64; 6])>,
}

/// From averages to the ten numbers.
fn identify_from(
    setup: &Setup,
    method: Method,
    procedure: Procedure,
    measurement: &Measurement,
) -> Result<Found, AnswerError> {
    let mut sets: Vec<Masslines> = Vec::new();
    let (mut fits, mut free_modes) = (Vec::new(), Vec::new());
    for condensed in condense::all(setup, method, measurement)? {
        sets.push(condensed.masslines);
        fits.extend(condensed.apparent_mass);
        free_modes.extend(condensed.free_modes);
    }
    let question = Question::new(setup.known_mass, procedure);
    let mut space = Workspace::EMPTY;
    let (identification, consistency, offsets) = if measurement.poses.is_empty() {
        identify::identify_in(&sets, &question, &mut space)
            .map(|i| (i, Consistency::of(&i, &sets), Vec::new()))
            .map_err(AnswerError::from)
    } else {
        let sets = std::mem::take(&mut sets);
        statics::identify_with(&measurement.poses, sets, &question, &mut space)
    }
    .map_err(|error| error.blame_sensors(measurement))?;
    Ok(Found {
        identification,
        consistency,
        covariance: space.covariance(),
        sets,
        fits,
        free_modes,
        offsets,
    })
}

/// Grounds on which an answer is refused or warned of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Judged<'a> {
    pub(crate) identification: &'a Identification,
    pub(crate) type_b: Option<&'a TypeB>,
    pub(crate) consistency: Option<Consistency>,
    /// `true` if error bars hold what a rigid body leaves.
    pub(crate) widened: bool,
}

/// Reads the recordings of a setup and identifies the body.
///
/// # Errors
/// [`AnswerError`].
pub fn answer(
    setup: &Setup,
    choice: &Choice,
    progress: OnProgress<'_>,
) -> Result<Answer, AnswerError> {
    Session::new(setup).answer(choice, progress)
}
