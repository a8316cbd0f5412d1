//! A test from the box's own inputs: the box measures the runs, and identifies.
//!
//! | file | holds |
//! | --- | --- |
//! | `wiring` | which input each channel of the set-up is read by |
//! | `run` | one run, from its start to its summary |
//! | `found` | the answer of the box, and the result document made of it |
//!
//! # Design
//!
//! The set-up goes to the box as a replay sends it ([`crate::replay`]), but for its channels:
//! channel k of a sample is input k, and counts become SI by the calibrations that the box
//! keeps, times `scale` of the set-up where that is not one. Runs stay stored on the box. It is
//! asked for a mark of the set-up it holds, so that a test may be done run by run, by as many
//! calls of this program as one likes.

mod error;
mod found;
mod run;
#[cfg(test)]
mod tests;
mod wiring;

pub use error::BoxRunError;
pub use found::{Found, StoredRun};
pub use run::{Ended, Operator, Progress, Stage};
pub use wiring::Wiring;

use crate::acquire::sample_rate;
use crate::device::{BoxInfo, Client, Port};
use crate::inputs::InputEntry;
use crate::measure::settings_at;
use crate::on_box::passes::{self, End};
use crate::on_box::{Base, PlanError, plan};
use crate::setup::Setup;
use massline_core::masslines::Method;
use massline_core::spectra::BlockSettings;
use massline_firmware::wire::{CRC32, Pass, State, Status, Summary};

/// A test that is to be done on a box.
#[derive(Debug)]
pub struct BoxTest<'s> {
    setup: &'s Setup,
    method: Method,
    base: Base,
    wiring: Wiring,
    settings: BlockSettings,
    rate: f64,
    device: BoxInfo,
}

/// Order of a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Measuring {
    /// Runs, by their numbers in the set-up from zero.
    pub runs: Vec<usize>,
    /// Length of each, s; until the operator ends it if `None`.
    pub seconds: Option<f64>,
}

impl<'s> BoxTest<'s> {
    /// Plans a test for a method: which input reads what, and whether the box can do it.
    ///
    /// # Errors
    /// [`BoxRunError`] that says what does not fit.
    pub fn new<P: Port>(
        client: &mut Client<'_, P>,
        setup: &'s Setup,
        wired: &[InputEntry],
        method: Method,
        weighted: bool,
    ) -> Result<Self, BoxRunError> {
        let device = client.hello()?;
        if device.capacity.inputs == 0 {
            return Err(BoxRunError::NoInputs);
        }
        let processing = setup.processing.as_ref();
        let processing = processing.ok_or(PlanError::NoProcessing)?;
        let rate = match processing.sample_rate {
            Some(rate) => rate,
            None => sample_rate(client)?,
        };
        let unfit = |reason: String| BoxRunError::Processing { rate, reason };
        let bands = processing.check_bands(rate);
        bands.map_err(|error| unfit(error.to_string()))?;
        let settings = settings_at(processing, rate);
        let settings = settings.map_err(|error| unfit(error.to_string()))?;
        plan::check(setup, &[method], &settings, &device)?;
        let alike = setup.are_coupled_alike();
        alike.map_err(|channels| BoxRunError::Coupled {
            channels: channels.map(str::to_owned),
        })?;
        Ok(Self {
            setup,
            method,
            base: Base::of(method, setup, weighted),
            wiring: Wiring::new(setup, wired)?,
            settings,
            rate,
            device,
        })
    }

    /// The box that measures.
    #[must_use]
    pub const fn device(&self) -> &BoxInfo {
        &self.device
    }

    /// A mark of all that decides what the box stores: what it is told, and the input that each channel is read by.
    fn fingerprint(&self, base: Base) -> Result<u32, PlanError> {
        let told = plan::mark_of(self.setup, &self.settings, base, &self.wiring)?;
        let wired = format!("{told:08x} {base:?} {:?}", self.wiring);
        Ok(CRC32.checksum(wired.as_bytes()))
    }

    fn holds(&self, status: &Status, base: Base) -> bool {
        let known = matches!(status.state, State::Ready | State::Running);
        known
            && self
                .fingerprint(base)
                .is_ok_and(|own| status.fingerprint == Some(own))
    }

    /// Has the box hold the set-up, if it does not yet. The number of runs of another set-up
    /// that it has forgotten.
    ///
    /// # Errors
    /// [`BoxRunError`].
    pub fn load<P: Port>(&self, client: &mut Client<'_, P>) -> Result<u32, BoxRunError> {
        let status = client.status()?;
        if self.holds(&status, self.base) {
            return Ok(0);
        }
        if status.state == State::Running {
            client.tell(&massline_firmware::wire::Request::Abort)?;
        }
        plan::upload(
            client,
            self.setup,
            &self.settings,
            self.base,
            &self.wiring,
            self.fingerprint(self.base)?,
        )?;
        Ok(status.stored.count_ones())
    }

    /// Has the box measure runs, each when the operator says so. Weights that come from surveys
    /// are surveyed before.
    ///
    /// # Errors
    /// [`BoxRunError`]. Runs that were measured before it stay stored.
    pub fn measure<P: Port>(
        &self,
        client: &mut Client<'_, P>,
        order: &Measuring,
        operator: &mut dyn Operator,
    ) -> Result<(), BoxRunError> {
        let joined = self.base == Base::WeightedJoined;
        let mut inputs = FromInputs {
            test: self,
            seconds: order.seconds,
            operator,
            step: 0,
            steps: order.runs.len() * (1 + usize::from(self.base.surveys())),
        };
        if joined {
            for &number in &order.runs {
                passes::survey(client, number, &mut inputs)?;
            }
            self.check_all_surveyed(client)?;
        }
        for &number in &order.runs {
            if self.base == Base::WeightedEachRun {
                passes::survey(client, number, &mut inputs)?;
            }
            passes::weigh(client, self.setup, self.base, number)?;
            inputs.pass(client, number, Pass::Measure)?;
        }
        Ok(())
    }

    fn check_all_surveyed<P: Port>(&self, client: &mut Client<'_, P>) -> Result<(), BoxRunError> {
        let surveyed = client.status()?.surveyed;
        let runs = self.missing_of(surveyed);
        if runs.is_empty() {
            return Ok(());
        }
        Err(BoxRunError::Unsurveyed { runs })
    }

    /// Names of the runs whose bits are not set.
    fn missing_of(&self, mask: u32) -> Vec<String> {
        let runs = self.setup.runs.iter().enumerate();
        let missing = runs.filter(|(number, _)| mask >> number & 1 == 0);
        missing.map(|(_, run)| run.name.clone()).collect()
    }

    /// Has the box identify from the runs that it has stored.
    ///
    /// # Errors
    /// [`BoxRunError::NothingStored`], [`BoxRunError::OtherBase`], [`BoxRunError::NoAnswer`].
    pub fn identify<P: Port>(
        &self,
        client: &mut Client<'_, P>,
        iterative: bool,
    ) -> Result<Found, BoxRunError> {
        let status = client.status()?;
        if !self.holds(&status, self.base) || status.stored == 0 {
            let other = Base::ALL.into_iter().find(|&b| self.holds(&status, b));
            let other = other.filter(|b| *b != self.base && status.stored != 0);
            return Err(match other {
                Some(found) => BoxRunError::OtherBase {
                    found: found.description(),
                    expected: self.base.description(),
                },
                None => BoxRunError::NothingStored {
                    base: self.base.description(),
                },
            });
        }
        let question = plan::question(self.setup, self.method, iterative);
        let identified = client.identify(question)?;
        let mut runs = Vec::new();
        for (number, run) in self.setup.runs.iter().enumerate() {
            if status.stored >> number & 1 == 1 {
                runs.push(StoredRun {
                    name: run.name.clone(),
                    summary: client.summary(number as u8)?,
                    calibration: self
                        .wiring
                        .inputs(self.setup, number)
                        .map(|(entry, name, _)| {
                            (name.to_owned(), crate::acquire::traceability(entry))
                        })
                        .collect(),
                });
            }
        }
        let ticks = identified.ticks as f64;
        Ok(Found {
            method: self.method,
            weighted: self.base.is_weighted(),
            iterative,
            answer: identified.answer,
            seconds: ticks / f64::from(self.device.tick_hz.max(1)),
            runs,
            unmeasured: self.missing_of(status.stored),
        })
    }
}

/// The inputs of the box, as the end of a test.
struct FromInputs<'t, 's> {
    test: &'t BoxTest<'s>,
    /// Length of each run, s; until the operator ends it if `None`.
    seconds: Option<f64>,
    operator: &'t mut dyn Operator,
    /// Passes done, and to be done in all.
    step: usize,
    steps: usize,
}

impl<P: Port> End<P> for FromInputs<'_, '_> {
    type Error = BoxRunError;

    fn pass(
        &mut self,
        client: &mut Client<'_, P>,
        run: usize,
        pass: Pass,
    ) -> Result<Summary, BoxRunError> {
        self.step += 1;
        let stage = Stage {
            number: run,
            name: &self.test.setup.runs[run].name,
            pass,
            step: self.step,
            steps: self.steps,
        };
        run::run(self.test, client, &stage, self.seconds, self.operator)
    }

    fn no_survey(&self, run: usize) -> BoxRunError {
        BoxRunError::Survey {
            run: self.test.setup.runs[run].name.clone(),
        }
    }
}
