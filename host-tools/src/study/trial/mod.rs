//! A simulated test that is identified at several levels of noise by several methods, without
//! recordings on disk where these would be long.
//!
//! # Design
//!
//! * **The door of `massline identify`.** Answers come from [`Session`], with averages that were
//!   made from samples in memory by the core's own blocks: the resultants' map, averages,
//!   masslines, observability and error bars are those of the command. Stepped sine and static
//!   poses, whose recordings are a few rows, are written to a scratch folder and read from it.
//! * **A draw's signals serve every level of noise and every method**, and so does the shape of
//!   its noise: levels and methods are compared on the same draws.
//! * **Weights of accelerometers** (chapter 7) come from the exact responses in the mode band:
//!   those that a survey pass gives without noise.

mod noise;
mod wiring;

use super::responses::surveyed;
use super::scratch::{Scratch, pose_rows, sine_rows};
use crate::detective::{self, Findings, Undecided};
use crate::identification::{Answer, Choice, Session};
use crate::measure::{
    Accelerations, MeasureError, NoRecords, Records, RunGeometry, Samples, Survey,
    channels_of_samples, measure_samples, sampled_records,
};
use crate::setup::{Excitation, Setup};
use crate::simulate::{self, Model, SimulationError, Truth, simulate};
use massline_core::identify::Identification;
use massline_core::masslines::Method;
use massline_core::spectra::LineRange;
use std::path::PathBuf;
use std::rc::Rc;

/// Why there is no trial.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// The model cannot be simulated.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The sensors or bands do not suit.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// The runs do not suit the maximum likelihood fit.
    #[error(transparent)]
    Lines(#[from] NoRecords),
    /// A scratch file cannot be written.
    #[error("{}: cannot be written: {source}", path.display())]
    Scratch {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

/// Recording and disturbances of a trial.
#[derive(Clone, Debug, Default)]
pub(in crate::study) struct Conditions {
    /// Largest ratio of a sensor's share of noise to that of another; 1 for all alike.
    pub(in crate::study) unlike: f64,
    /// Frequencies of a stepped sine test, Hz; empty for a random one.
    pub(in crate::study) sines: Vec<f64>,
    /// `true` if the mass is stated as weighed.
    pub(in crate::study) weighed: bool,
    /// Number of the run whose motion each simulated run belongs to; those of one
    /// number are shaken at once, by drives of their own. Empty where every run is its own.
    pub(in crate::study) together: Vec<usize>,
    /// Factor on the frequency of the first mode in the last run; 1 where `None`.
    pub(in crate::study) moved: Option<f64>,
}

/// Samples of one run, or complex amplitudes in pairs of samples.
#[derive(Clone)]
struct Run {
    drive: Vec<f32>,
    sensors: Vec<Vec<f32>>,
    noise: Vec<Vec<f32>>,
}

/// One draw: a test without noise, and the noise to add.
#[derive(Clone)]
pub(in crate::study) struct Trial {
    /// The test.
    pub(in crate::study) setup: Setup,
    /// True values.
    pub(in crate::study) truth: Truth,
    model: Model,
    seed: u64,
    frequencies: Vec<f64>,
    runs: Vec<Run>,
    /// Noise of each sensor at a level of one, in its unit.
    levels: Vec<f64>,
}

/// The answer of a method, or why there is none.
pub(in crate::study) type Outcome = Result<Identification, String>;

impl Trial {
    /// Simulates a model without noise, and draws the noise of one draw.
    ///
    /// # Errors
    /// [`TrialError::Simulation`] if the model's bands or lengths do not suit each other.
    pub(in crate::study) fn new(
        model: Model,
        seed: u64,
        conditions: &Conditions,
    ) -> Result<Self, TrialError> {
        let options = simulate::Options {
            noise: Some(0.0),
            seed,
            weighed: conditions.weighed,
            // Of a stepped sine only the setup is taken from the simulation.
            duration: (!conditions.sines.is_empty())
                .then(|| model.measurement.block_length as f64 / model.measurement.sample_rate),
            ..simulate::Options::default()
        };
        let mut simulation = simulate(&model, &options, &mut |_| ())?;
        if let (Some(factor), Some(last)) = (conditions.moved, simulation.recordings.last_mut()) {
            let mut other = model.clone();
            if let Some(mode) = other.specimen.modes.first_mut() {
                mode.frequency *= factor;
            }
            // Every signal has its own random stream: nothing but the mode differs.
            let mut moved = simulate(&other, &options, &mut |_| ())?.recordings;
            if let Some(moved) = moved.pop() {
                *last = moved;
            }
        }
        let mut setup = simulation.setup;
        let mut runs = Vec::with_capacity(setup.runs.len());
        if conditions.sines.is_empty() {
            for (run, recording) in setup.runs.iter().zip(simulation.recordings) {
                let mut sensors = recording.samples;
                let drive = if !run.references.is_empty() && !sensors.is_empty() {
                    sensors.remove(0)
                } else {
                    Vec::new()
                };
                runs.push(Run {
                    drive,
                    sensors,
                    noise: Vec::new(),
                });
            }
            join(&mut setup, &mut runs, &conditions.together);
        } else {
            for (number, run) in setup.runs.iter_mut().enumerate() {
                run.excitation = Excitation::Sine;
                run.references.clear();
                let lines = simulate::responses(&model, number, seed, &conditions.sines);
                let channels = lines.first().map_or(0, Vec::len);
                let of = |c: usize| {
                    lines
                        .iter()
                        .flat_map(move |l| [l[c].re as f32, l[c].im as f32])
                };
                runs.push(Run {
                    drive: Vec::new(),
                    sensors: (0..channels).map(|c| of(c).collect()).collect(),
                    noise: Vec::new(),
                });
            }
        }
        let mut trial = Self {
            setup,
            truth: simulation.truth,
            model,
            seed,
            frequencies: conditions.sines.clone(),
            runs,
            levels: Vec::new(),
        };
        trial.draw_noise(conditions.unlike.max(1.0));
        Ok(trial)
    }

    /// Unwindowed lines of all random runs at a level of noise; without noise if `None`.
    pub(in crate::study) fn lines(
        &self,
        level: Option<f64>,
        band: [f64; 2],
    ) -> Result<Records, TrialError> {
        let noisy = self.noisy(level.unwrap_or(0.0));
        let samples = self.samples(&noisy);
        Ok(sampled_records(
            &self.setup,
            band,
            &samples,
            &mut Vec::new(),
        )?)
    }

    /// The seed of its signals.
    pub(in crate::study) fn seed(&self) -> u64 {
        self.seed
    }

    /// The model that was simulated.
    pub(in crate::study) fn model(&self) -> &Model {
        &self.model
    }

    /// The numbers of some methods at one level of noise, a share of each channel's RMS; `None`
    /// is the recommended method.
    pub(in crate::study) fn answers(
        &self,
        level: f64,
        methods: &[Option<Method>],
    ) -> Result<Vec<Outcome>, TrialError> {
        let answers = self.whole_answers(level, methods)?.into_iter();
        Ok(answers.map(|a| a.map(|a| a.identification)).collect())
    }

    /// The same with all that an answer says.
    pub(in crate::study) fn whole_answers(
        &self,
        level: f64,
        methods: &[Option<Method>],
    ) -> Result<Vec<Result<Answer, String>>, TrialError> {
        if self.is_on_disk() {
            self.by_files(level, methods)
        } else {
            self.in_memory(level, methods)
        }
    }

    /// Noisy sensors with the drive of their runs.
    fn samples<'a>(&'a self, noisy: &'a [Vec<Vec<f32>>]) -> Vec<Samples<'a>> {
        (noisy.iter().zip(&self.runs))
            .map(|(sensors, run)| Samples {
                sensors,
                drive: &run.drive,
            })
            .collect()
    }

    /// `true` if some runs are stepped sines or static poses, which are written to disk.
    fn is_on_disk(&self) -> bool {
        let random = |r: &crate::setup::Run| r.excitation == Excitation::Random;
        !self.setup.runs.iter().all(random)
    }

    /// The examination of the sensors at a level of noise.
    pub(in crate::study) fn examine(
        &self,
        level: f64,
    ) -> Result<Result<Findings, Undecided>, TrialError> {
        if self.is_on_disk() {
            let (_scratch, setup) = self.written(level)?;
            let measurement = crate::measure::measure_first(
                &setup,
                &Accelerations::Interface,
                None,
                &mut |_| (),
            )?;
            let channels = crate::measure::channels(&setup, &measurement, None, &mut |_| ())?;
            return Ok(detective::examine(&setup, &measurement, &channels, Some(1)));
        }
        let noisy = self.noisy(level);
        let samples = self.samples(&noisy);
        let setup = &self.setup;
        let measurement = measure_samples(setup, &Accelerations::Interface, &samples)?;
        let channels = channels_of_samples(setup, &measurement, &samples)?;
        Ok(detective::examine(setup, &measurement, &channels, Some(1)))
    }

    fn in_memory(
        &self,
        level: f64,
        methods: &[Option<Method>],
    ) -> Result<Vec<Result<Answer, String>>, TrialError> {
        let noisy = self.noisy(level);
        let samples = self.samples(&noisy);
        let recommended = crate::identification::recommended(&self.setup).0;
        let all = self.weights()?;
        let mut measurements = Vec::new();
        let mut outcomes = Vec::with_capacity(methods.len());
        for method in methods {
            let method = method.unwrap_or(recommended);
            let accelerations = if method.interface_only() {
                Accelerations::Interface
            } else {
                Accelerations::All(all.clone())
            };
            if !measurements.iter().any(|(a, _)| *a == accelerations) {
                let measured =
                    crate::measure::measure_samples(&self.setup, &accelerations, &samples)?;
                measurements.push((accelerations.clone(), Rc::new(measured)));
            }
            let mut session = Session::of_measurements(&self.setup, measurements.clone());
            let choice = Choice {
                method: Some(method),
                ..Choice::default()
            };
            let answer = session.answer_with(method, &choice, &accelerations, &mut |_| ());
            outcomes.push(answer.map_err(|e| e.to_string()));
        }
        Ok(outcomes)
    }

    /// Weights of chapter 7 from the exact responses in the mode band; none where
    /// `massline identify` has none.
    fn weights(&self) -> Result<Option<Vec<Vec<f64>>>, TrialError> {
        let band = self.setup.processing.as_ref().and_then(|p| p.mode_band);
        let driven = self.setup.runs.iter().any(|r| !r.references.is_empty());
        let Some(band) = band.filter(|_| driven) else {
            return Ok(None);
        };
        let spacing =
            self.model.measurement.sample_rate / self.model.measurement.block_length as f64;
        let from = libm::ceil(band[0] / spacing) as usize;
        let to = libm::floor(band[1] / spacing) as usize;
        let frequencies: Vec<f64> = (from..=to).map(|k| k as f64 * spacing).collect();
        let sensors = self.setup.accelerometers.len();
        let mut survey = Survey {
            frequencies: frequencies.clone(),
            runs: Vec::new(),
        };
        for number in 0..self.setup.runs.len() {
            let geometry = RunGeometry::new(&self.setup, number, &Accelerations::Interface)?;
            let lines = simulate::responses(&self.model, number, self.seed, &frequencies);
            survey
                .runs
                .push(surveyed(number, geometry, &lines, sensors));
        }
        let least = self.setup.estimation.minimum_weight;
        // They are the lines of the mode band already.
        let all = LineRange::all(frequencies.len());
        Ok(Some(survey.weights_joined(&self.setup, all, least)))
    }

    fn by_files(
        &self,
        level: f64,
        methods: &[Option<Method>],
    ) -> Result<Vec<Result<Answer, String>>, TrialError> {
        let (_scratch, setup) = self.written(level)?;
        let mut session = Session::new(&setup);
        let mut outcomes = Vec::with_capacity(methods.len());
        for &method in methods {
            let choice = Choice {
                method,
                ..Choice::default()
            };
            let answer = session.answer(&choice, &mut |_| ());
            outcomes.push(answer.map_err(|e| e.to_string()));
        }
        Ok(outcomes)
    }

    /// The recordings at a level of noise in a folder that lasts as long as the first value, with their setup.
    fn written(&self, level: f64) -> Result<(Scratch, Setup), TrialError> {
        let scratch = Scratch::new()?;
        let mut setup = self.setup.clone();
        setup.folder.clone_from(&scratch.0);
        let sensors = setup.accelerometers.iter().map(|a| a.channel.as_str());
        let names: Vec<&str> = sensors
            .chain(setup.load_cells.iter().map(|c| c.channel.as_str()))
            .collect();
        for (run, samples) in self.setup.runs.iter().zip(self.noisy(level)) {
            let text = if run.excitation == Excitation::Sine {
                sine_rows(&names, &self.frequencies, &samples)
            } else {
                pose_rows(&names, &samples)
            };
            scratch.write(&run.recording, &text)?;
        }
        Ok((scratch, setup))
    }
}

/// Adds up the runs of one number: uncorrelated drives at once, none of them recorded.
fn join(setup: &mut Setup, runs: &mut Vec<Run>, together: &[usize]) {
    if together.is_empty() {
        return;
    }
    let mut kept = Vec::new();
    let mut joined: Vec<(usize, Run)> = Vec::new();
    for ((number, run), entry) in together
        .iter()
        .zip(runs.drain(..))
        .zip(setup.runs.drain(..))
    {
        match joined.iter_mut().find(|(n, _)| n == number) {
            Some((_, sum)) => {
                for (into, from) in sum.sensors.iter_mut().zip(&run.sensors) {
                    for (x, y) in into.iter_mut().zip(from) {
                        *x += y;
                    }
                }
            }
            None => {
                joined.push((*number, run));
                kept.push(entry);
            }
        }
    }
    setup.runs = kept;
    *runs = joined.into_iter().map(|(_, run)| run).collect();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::{Options, Twin};

    fn short_fork() -> Model {
        let mut model = Model::fork().unwrap_or_else(|e| panic!("{e}"));
        model.measurement.duration = 6.0;
        model
    }

    /// The trial's way through memory and `massline identify`'s through files, to the last bit.
    #[test]
    fn memory_and_files_give_the_same_bits() {
        let model = short_fork();
        let trial = Trial::new(model.clone(), 5, &Conditions::default()).unwrap();
        let ours = trial.answers(0.0, &[None]).unwrap().remove(0).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let options = simulate::Options {
            noise: Some(0.0),
            seed: 5,
            ..simulate::Options::default()
        };
        let simulation = simulate(&model, &options, &mut |_| ()).unwrap();
        let path = simulation.write(folder.path()).unwrap();
        let setup = Setup::read(&path).unwrap();
        let answer = crate::identification::answer(&setup, &Choice::default(), &mut |_| ());
        assert_eq!(answer.unwrap().identification, ours);
    }

    /// Noise has the level that was asked for, and is that of each sensor, not of each run.
    #[test]
    fn noise_is_the_share_of_the_rms() {
        let trial = Trial::new(short_fork(), 5, &Conditions::default()).unwrap();
        let strengths = trial.strengths();
        assert_eq!(trial.noise(1.0), strengths);
        let noisy = trial.noisy(0.03);
        for (c, strength) in strengths.iter().enumerate() {
            let (mut power, mut count) = (0.0, 0);
            for (run, noisy) in trial.runs.iter().zip(&noisy) {
                for (x, y) in run.sensors[c].iter().zip(&noisy[c]) {
                    power += f64::from(y - x).powi(2);
                    count += 1;
                }
            }
            let level = (power / f64::from(count)).sqrt() / strength;
            // Some 9000 samples tell a standard deviation to 0.75 %; four of those.
            assert!((level / 0.03 - 1.0).abs() < 0.03, "{c}: {level}");
        }
    }

    /// The simulator's responses beside the twin's, which are written out by themselves.
    #[test]
    fn responses_are_those_of_the_twin() {
        let twin = Twin::new(&Options::default(), 1.0).unwrap();
        for run in 0..3 {
            for frequency in [2.0, 20.0, 32.0, 60.0] {
                let ours = simulate::responses(&twin.model, run, 1, &[frequency]).remove(0);
                let theirs = twin.channels(run, frequency);
                assert_eq!(ours.len(), theirs.len());
                let size = theirs.iter().map(|x| x.l1_norm()).fold(0.0, f64::max);
                for (a, b) in ours.iter().zip(&theirs) {
                    // Sums of fifty terms, some large beside their sum.
                    assert!((a - b).l1_norm() < 1e-12 * size, "{a} {b}");
                }
            }
        }
    }

    /// A sensor that nothing moves is as noisy as its kind.
    #[test]
    fn a_resting_sensor_has_noise() {
        let mut model = short_fork();
        model.runs.truncate(1);
        let trial = Trial::new(model, 5, &Conditions::default()).unwrap();
        assert!(trial.noise(0.01).iter().all(|noise| *noise > 0.0));
    }
}
