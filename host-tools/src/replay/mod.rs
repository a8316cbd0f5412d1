//! Recordings through a box, and through the same core on this machine: what comes out has
//! to be the same, to the last bit.
//!
//! # Design
//!
//! The box gets the set-up and the samples that `identify` reads, measures the runs, and
//! identifies. The host's side is `identify` itself, not a second program for the purpose:
//! [`crate::measure`] and [`crate::identification`] share the core with the box and nothing
//! above it.
//!
//! Weights are the box's own. Its surveys look at twelve accelerometers at a time, where the
//! host looks at all of them at once, so they find slightly other weights than `identify`
//! does. A second box, in this program, is surveyed with the same samples and has to find
//! the same; the host then measures with these weights.
//!
//! A sample that a recording calls faulty goes to the box as what is no number. It keeps its
//! place in time, and the box leaves the same blocks out as the host does: filters have a
//! finite memory, so that blocks without it are the same to the last bit on both sides,
//! whatever stands in its place.

mod compare;
mod document;
mod error;
mod flip;
mod leaves;
mod outcome;
mod transfer;

pub use compare::{Comparison, Difference, Leaf};
pub use document::{ComparisonEntry, LinkEntry, ReplayDocument, SCHEMA};
pub use error::ReplayError;
pub use flip::Flip;
pub use outcome::{AnswerOutcome, BaseOutcome, Outcome, RunOutcome};

use crate::device::{Client, ClientError, ClientMemory, HostBox, HostBoxMemory, Port};
use crate::identification::{AnswerError, Choice, Session};
use crate::measure::{Accelerations, Measurement, block_settings};
use crate::on_box::passes::{self, End};
use crate::on_box::plan::{self, Columns};
use crate::on_box::{Base, PlanError, stored};
use crate::setup::Setup;
use massline_core::masslines::Method;
use massline_core::spectra::BlockSettings;
use massline_firmware::wire::{Grid, NoAnswer, Pass, Problem, Running, State, Summary};
use transfer::Feed;

/// Order of a replay.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// The methods to identify by.
    pub methods: Vec<Method>,
    /// `true` if the reference point is iterated to the CG.
    pub iterative: bool,
    /// `true` if weights of the accelerometers are used.
    pub weighted: bool,
    /// Blocks of each run, from its beginning; all there are if `None`.
    pub blocks: Option<u32>,
    /// A bit to be flipped on the way to the box.
    pub flip: Option<Flip>,
    /// `true` if a replay that was cut off is taken up at the box's state.
    pub resume: bool,
}

/// Progress of a replay.
pub struct Progress<'a> {
    /// Present step.
    pub what: &'a str,
    /// Name of the run.
    pub run: &'a str,
    /// Share of all that goes over the link, 0 to 1.
    pub share: f64,
}

/// Replays a setup's recordings through a box.
///
/// # Errors
/// [`ReplayError`] if it cannot be done. Differences are no error: see
/// [`Outcome::identical`].
pub fn replay<P: Port>(
    client: &mut Client<'_, P>,
    setup: &Setup,
    order: &Order,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Outcome, ReplayError> {
    let device = client.hello()?;
    let settings = block_settings(setup)?.ok_or(PlanError::NoProcessing)?;
    plan::check(setup, &order.methods, &settings, &device)?;
    let limit = order.blocks.map(|blocks| samples_of(&settings, blocks));
    let bases = plan::bases(&order.methods, setup, order.weighted);
    let transfers = |base: &Base| setup.runs.len() * (1 + usize::from(base.surveys()));
    let all: usize = bases.iter().map(|(base, _)| transfers(base)).sum();
    let mut replay = Replay {
        setup,
        order,
        settings,
        feed: Feed {
            setup,
            limit,
            flip: order.flip,
            window: device.capacity.window,
        },
        session: Session::of_first(setup, limit),
        tick_hz: device.tick_hz,
        done: 0,
        all,
        progress,
    };
    let mut outcome = Outcome {
        device,
        limit,
        bases: Vec::new(),
        link: client.link(),
    };
    for (base, methods) in bases {
        outcome.bases.push(replay.base(client, base, &methods)?);
    }
    // Frames that were lost last show with the next one.
    client.ping(0)?;
    outcome.link = client.link();
    Ok(outcome)
}

/// Samples that give so many blocks.
fn samples_of(settings: &BlockSettings, blocks: u32) -> u64 {
    let hops = u64::from(blocks.saturating_sub(1)) * settings.hop() as u64;
    settings.support() as u64 + hops
}

/// Weights as the box has them, run by run, one a sensor.
#[derive(Default)]
struct Weighed {
    peaks: Vec<Vec<f64>>,
    weights: Vec<Vec<f64>>,
}

struct Replay<'s, 'p> {
    setup: &'s Setup,
    order: &'s Order,
    settings: BlockSettings,
    feed: Feed<'s>,
    session: Session<'s>,
    tick_hz: u32,
    /// Recordings sent, and to be sent in all.
    done: usize,
    all: usize,
    progress: &'p mut dyn FnMut(Progress<'_>),
}

impl<'s, 'p> Replay<'s, 'p> {
    fn base<P: Port>(
        &mut self,
        client: &mut Client<'_, P>,
        base: Base,
        methods: &[Method],
    ) -> Result<BaseOutcome, ReplayError> {
        let mark = format!("{:?} {:?}", self.feed.limit, self.feed.flip);
        let fingerprint = plan::fingerprint(self.setup, base, &mark);
        let held = if self.order.resume {
            Some(held(client, fingerprint)?)
        } else {
            None
        };
        let (stored, running) = held.unwrap_or_default();
        let resumes_measuring = running.is_some_and(|r| r.pass == Pass::Measure) || stored != 0;
        let mut grid = None;
        if held.is_none() {
            let found = plan::upload(
                client,
                self.setup,
                &self.settings,
                base,
                &Columns,
                fingerprint,
            )?;
            grid = Some(found);
        }
        let weighed = if resumes_measuring {
            let runs = 0..self.setup.runs.len();
            let weights: Result<_, _> = runs.map(|run| stored::weights(client, run)).collect();
            Weighed {
                peaks: Vec::new(),
                weights: weights?,
            }
        } else {
            self.weigh(client, base, running)?
        };
        let weights = if base.surveys() && !resumes_measuring {
            Some(self.check_weights(base, &weighed)?)
        } else {
            None
        };
        let accelerations = self.accelerations(base, &weighed);
        let measurement = self.measure(&accelerations)?;

        let mut runs = Vec::new();
        for (number, host) in measurement.runs.iter().enumerate() {
            let goes_on = running.is_some_and(|r| usize::from(r.run) == number);
            let summary = if !goes_on && stored >> number & 1 == 1 {
                self.done += 1;
                client.summary(number as u8)?
            } else {
                self.sending(running).pass(client, number, Pass::Measure)?
            };
            let lines = stored::lines(client, number, self.settings.grid().count)?;
            let comparison = Comparison::of_run(host, &self.settings.grid(), &summary, &lines);
            runs.push(RunOutcome {
                name: host.name.clone(),
                samples: summary.samples,
                blocks: summary.blocks,
                faulty: host.rejected.samples,
                rejected: summary.rejected,
                lines: lines.len(),
                comparison,
            });
        }
        let mut answers = Vec::new();
        for &method in methods {
            self.tell("asking the box", method.name(), 0.0);
            answers.push(self.answer(client, method, &accelerations)?);
        }
        Ok(BaseOutcome {
            base,
            grid: self.compare_grid(grid, &measurement),
            weights,
            runs,
            answers,
        })
    }

    fn tell(&mut self, what: &str, run: &str, share: f64) {
        (self.progress)(Progress {
            what,
            run,
            share: (self.done as f64 + share) / self.all.max(1) as f64,
        });
    }

    /// Sends one recording.
    fn send<P: Port>(
        &mut self,
        client: &mut Client<'_, P>,
        number: usize,
        pass: Pass,
        from: Option<u64>,
        what: &str,
    ) -> Result<Summary, ReplayError> {
        let run = &self.setup.runs[number].name;
        let (done, all) = (self.done as f64, self.all.max(1) as f64);
        let progress = &mut *self.progress;
        let summary = self.feed.run(client, number, pass, from, &mut |share| {
            progress(Progress {
                what,
                run,
                share: (done + share) / all,
            });
        })?;
        self.done += 1;
        Ok(summary)
    }

    /// Has the box find its weights, and overrules them by those given by hand.
    fn weigh<P: Port>(
        &mut self,
        client: &mut Client<'_, P>,
        base: Base,
        running: Option<Running>,
    ) -> Result<Weighed, ReplayError> {
        let mut weighed = Weighed::default();
        if base.surveys() {
            for number in 0..self.setup.runs.len() {
                let peaks = passes::survey(client, number, &mut self.sending(running))?;
                weighed.peaks.push(peaks);
            }
        }
        for number in 0..self.setup.runs.len() {
            weighed
                .weights
                .extend(passes::weigh(client, self.setup, base, number)?);
        }
        Ok(weighed)
    }

    /// The end of this replay, at a box that may have a run going on.
    fn sending(&mut self, running: Option<Running>) -> Sending<'_, 's, 'p> {
        Sending {
            replay: self,
            running,
        }
    }

    /// Surveys a box in this program, and compares.
    fn check_weights(&mut self, base: Base, device: &Weighed) -> Result<Comparison, ReplayError> {
        let (mut own, mut memory) = (HostBoxMemory::new(), ClientMemory::new());
        let mut client = Client::new(HostBox::new(&mut own, 1), &mut memory);
        plan::upload(&mut client, self.setup, &self.settings, base, &Columns, 0)?;
        let (done, flip) = (self.done, self.feed.flip.take());
        let host = self.weigh(&mut client, base, None);
        (self.done, self.feed.flip) = (done, flip);
        let host = host?;
        let mut comparison = Comparison::default();
        for (what, host, device) in [
            ("peak", &host.peaks, &device.peaks),
            ("weight", &host.weights, &device.weights),
        ] {
            for ((host, device), run) in host.iter().zip(device).zip(&self.setup.runs) {
                comparison.list(
                    &format!("run \"{}\", {what} of sensor", run.name),
                    host,
                    device,
                );
            }
        }
        Ok(comparison)
    }

    fn accelerations(&self, base: Base, weighed: &Weighed) -> Accelerations {
        let count = self.setup.accelerometers.len();
        match base {
            Base::Interface => Accelerations::Interface,
            Base::All => Accelerations::All(None),
            _ => {
                let of_run = |all: &Vec<f64>| all.iter().copied().take(count).collect();
                Accelerations::All(Some(weighed.weights.iter().map(of_run).collect()))
            }
        }
    }

    /// The host's run of the same recordings.
    fn measure(
        &mut self,
        accelerations: &Accelerations,
    ) -> Result<std::rc::Rc<Measurement>, ReplayError> {
        let (done, all) = (self.done as f64, self.all.max(1) as f64);
        let progress = &mut *self.progress;
        let measurement = self.session.measurement(accelerations, &mut |p| {
            progress(Progress {
                what: "on this machine",
                run: p.name,
                share: done / all,
            });
        })?;
        Ok(measurement)
    }

    fn compare_grid(&self, device: Option<Grid>, measurement: &Measurement) -> Comparison {
        let host = Grid {
            lines: self.settings.grid(),
            hop: self.settings.hop() as u32,
            band: [
                measurement.band.indices().start,
                measurement.band.indices().end,
            ]
            .map(|line| line as u32),
        };
        let mut comparison = Comparison::default();
        // One that goes on has compared them when it began.
        comparison.values("grid.", &host, &device.unwrap_or(host));
        comparison
    }

    fn answer<P: Port>(
        &mut self,
        client: &mut Client<'_, P>,
        method: Method,
        accelerations: &Accelerations,
    ) -> Result<AnswerOutcome, ReplayError> {
        let choice = Choice {
            method: Some(method),
            iterative: self.order.iterative,
            weighted: self.order.weighted,
        };
        let host = self
            .session
            .answer_with(method, &choice, accelerations, &mut |_| ());
        let question = plan::question(self.setup, method, self.order.iterative);
        let device = client.identify(question);
        let device = match device {
            Ok(identified) => Ok(identified),
            Err(ClientError::Refused(refused)) => match refused.problem {
                Problem::NoAnswer(why) => Err(why),
                _ => return Err(ClientError::Refused(refused).into()),
            },
            Err(error) => return Err(error.into()),
        };
        let host = match host {
            Ok(answer) => Ok(answer),
            Err(AnswerError::Masslines { source, .. }) => Err(NoAnswer::from(source)),
            Err(AnswerError::Identify { source, .. }) => Err(NoAnswer::from(source)),
            Err(error) => return Err(error.into()),
        };
        Ok(AnswerOutcome {
            method,
            no_answer: host.as_ref().err().map(ToString::to_string),
            seconds: device
                .as_ref()
                .ok()
                .map(|d| d.ticks as f64 / f64::from(self.tick_hz.max(1))),
            comparison: Comparison::of_answers(&host, &device),
        })
    }
}

/// Recordings that are sent, as the end of a test.
struct Sending<'r, 's, 'p> {
    replay: &'r mut Replay<'s, 'p>,
    /// The pass that the box had been taking when the connection was lost.
    running: Option<Running>,
}

impl<P: Port> End<P> for Sending<'_, '_, '_> {
    type Error = ReplayError;

    fn pass(
        &mut self,
        client: &mut Client<'_, P>,
        run: usize,
        pass: Pass,
    ) -> Result<Summary, ReplayError> {
        let same = |r: &Running| usize::from(r.run) == run && r.pass == pass;
        let from = self.running.filter(same).map(|r| r.next);
        let what = match pass {
            Pass::Survey => "surveyed by the box",
            Pass::Measure => "to the box",
        };
        self.replay.send(client, run, pass, from, what)
    }

    fn no_survey(&self, run: usize) -> ReplayError {
        ReplayError::Survey {
            run: self.replay.setup.runs[run].name.clone(),
        }
    }
}

/// Runs of this replay that a box holds: those that are stored, and the one that is going on.
fn held<P: Port>(
    client: &mut Client<'_, P>,
    fingerprint: u32,
) -> Result<(u32, Option<Running>), ReplayError> {
    let status = client.status()?;
    let known = matches!(status.state, State::Ready | State::Running);
    if known && status.fingerprint == Some(fingerprint) {
        Ok((status.stored, status.running))
    } else {
        Err(ReplayError::NothingToResume)
    }
}
