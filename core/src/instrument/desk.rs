//! Requests: which are dealt with in which state, and how.

use super::intake::{Intake, Sample};
use super::live::Recorder;
use super::memory::{BLOCK_LENGTH, CHANNELS, LINES, RUNS, SENSORS};
use super::run::{Run, Task};
use super::selftest::{self, Progress};
use super::setup::{range, within};
use super::survey::Survey;
use super::synthetic::Synthetic;
use super::{Asked, Board, Ended, Instrument, Outbox, Pending, cut};
use crate::calibration::{self, Certificate, Channel, Watch};
use crate::masslines;
use crate::modes::MAX_MODES;
use crate::wire::{
    Accelerations, Capacity, Carries, Field, Gaps, Health, Info, Item, Line, Lines, Method,
    NAME_MAX, Outcome, PANIC_MAX, Packed, Pass, Peaks, Pong, Problem, Procedure, Question,
    ReadLines, Reply, Request, Samples, Saved, Scale, Setting, SettingKey, Source, Start, State,
    Status, Stream, Subscription, Taken, Weights,
};

/// Most iterations that may be asked for: each takes some milliseconds on the chip.
const ITERATIONS_MAX: u32 = 1000;

/// The methods that fit the box.
const METHODS: [Method; 8] = [
    Method::ApparentMass,
    Method::FrequencyResponses,
    Method::PowerSpectra,
    Method::PowerSpectraCholesky,
    Method::FreeResponses,
    Method::FreeResponsesSquared,
    Method::CurveFit,
    Method::Synthesis,
];

impl<'m> Instrument<'m> {
    /// Deals with a request: has replied, or will by [`Self::finish`], unless it returns a
    /// problem. Then nothing was changed.
    pub(super) fn deal(
        &mut self,
        id: u16,
        request: &Request<'_>,
        board: &mut impl Board,
        out: &mut impl Outbox,
    ) -> Result<(), Problem> {
        let reply = match request {
            Request::Hello => {
                out.reply(id, &Reply::Info(self.info(board)));
                return Ok(());
            }
            Request::Ping(ping) => Reply::Pong(Pong {
                stamp: ping.stamp,
                ticks: board.ticks(),
                samples: board.input_samples(),
            }),
            Request::Status => Reply::Status(self.status(board)),
            Request::Subscribe(subscription) => {
                self.subscribe(subscription, board)?;
                Reply::Done
            }
            Request::ForgetFaults => {
                self.identity.panic = None;
                board.forget_faults();
                Reply::Done
            }
            Request::Reboot => {
                out.reply(id, &Reply::Done);
                board.reboot();
                return Ok(());
            }
            Request::Provoke(fault) => {
                if !board.provoke(*fault) {
                    return Err(Problem::Unsupported(Item::Provoke));
                }
                Reply::Done
            }
            Request::Selftest => {
                self.not_running()?;
                self.not_busy()?;
                self.clear();
                selftest::set_up(&mut self.setup)?;
                self.lines = Some(self.setup.end()?);
                self.selftest = Some(Progress::default());
                self.pending = Some(Pending {
                    id,
                    number: request.number(),
                    since: board.ticks(),
                });
                return Ok(());
            }
            Request::BeginSetup(plan) => {
                self.not_running()?;
                self.not_busy()?;
                self.setup.begin(plan)?;
                self.forget_runs();
                self.state = State::SettingUp;
                Reply::Done
            }
            Request::SetProcessing(processing) => {
                self.only(State::SettingUp)?;
                self.setup.set_processing(processing)?;
                Reply::Done
            }
            Request::SetSensor(sensor) => {
                self.only(State::SettingUp)?;
                self.setup.set_sensor(sensor)?;
                Reply::Done
            }
            Request::SetRun(run) => {
                self.only(State::SettingUp)?;
                self.setup.set_run(run)?;
                Reply::Done
            }
            Request::SetWeights(weights) => {
                if self.state != State::Ready {
                    self.only(State::SettingUp)?;
                }
                self.setup.set_weights(weights)?;
                Reply::Done
            }
            Request::EndSetup => Reply::Grid(self.end_setup()?),
            Request::Start(start) => {
                self.start(start, board)?;
                Reply::Done
            }
            Request::Samples(samples) => Reply::Taken(self.take(samples, board, out)?),
            Request::Stop => Reply::Summary(self.stop(board)?),
            Request::Abort => {
                self.abort(board);
                Reply::Done
            }
            Request::ReadSummary(run) => {
                let at = self.run_index(*run)?;
                let summary = self.summaries.get(at).copied().flatten();
                Reply::Summary(summary.ok_or(missing(Item::Summary, at))?)
            }
            Request::ReadLines(read) => return self.read_lines(id, read, out),
            Request::ReadPeaks(run) => {
                let at = self.run_index(*run)?;
                let peaks = self.setup.peaks(at).ok_or(missing(Item::Survey, at))?;
                let peaks = Packed::new(peaks);
                out.reply(id, &Reply::Peaks(Peaks { run: *run, peaks }));
                return Ok(());
            }
            Request::ReadWeights(run) => {
                let at = self.run_index(*run)?;
                let weights = Packed::new(self.setup.weights(at));
                out.reply(id, &Reply::Weights(Weights { run: *run, weights }));
                return Ok(());
            }
            Request::Identify(question) => return self.identify(id, question, board),
            Request::ReadAnswer => Reply::Identified(self.answer.ok_or(missing(Item::Answer, 0))?),
            Request::ReadSetting(key) => {
                out.reply(id, &Reply::Setting(board.setting(*key)?));
                return Ok(());
            }
            Request::WriteSetting(setting) => {
                self.not_running()?;
                board.write_setting(setting)?;
                Reply::Done
            }
            Request::SaveSettings => {
                self.not_running()?;
                let storage = board.save_settings()?;
                Reply::Saved(Saved { storage })
            }
            Request::ResetSettings => {
                self.not_running()?;
                board.reset_settings();
                Reply::Done
            }
        };
        out.reply(id, &reply);
        Ok(())
    }

    fn only(&self, expected: State) -> Result<(), Problem> {
        if self.state == expected {
            return Ok(());
        }
        Err(Problem::State {
            found: self.state,
            expected,
        })
    }

    fn not_running(&self) -> Result<(), Problem> {
        if self.state == State::Running {
            return self.only(State::Ready);
        }
        Ok(())
    }

    fn not_busy(&self) -> Result<(), Problem> {
        match self.pending {
            Some(pending) => Err(Problem::Busy(pending.number)),
            None => Ok(()),
        }
    }

    /// Throws the run away, unless it is one of a self-test, of which nobody knows.
    fn abort(&mut self, board: &mut impl Board) {
        if self.selftest.is_none()
            && let Some(run) = self.run.take()
        {
            self.buffers = run.into_buffers();
            self.synthetic = None;
            self.state = State::Ready;
            self.tend_inputs(board);
        }
    }

    /// Forgets set-up and runs.
    pub(super) fn clear(&mut self) {
        self.setup.clear();
        self.lines = None;
        self.forget_runs();
        self.state = State::Empty;
    }

    /// The next step of a self-test between its runs; `true` if another one follows at once.
    pub(super) fn go_on_testing(&mut self, board: &mut impl Board, out: &mut impl Outbox) -> bool {
        let Some(progress) = &mut self.selftest else {
            return false;
        };
        // Between the requests the box is empty, whatever it does on its own.
        self.state = State::Empty;
        if self.archive.is_none() || self.asked.is_some() {
            return false;
        }
        if self.run.is_some() {
            return true;
        }
        let run = progress.run;
        progress.run += 1;
        for summary in self.summaries.iter().flatten() {
            progress.health = progress.health.union(summary.health);
        }
        self.state = State::Ready;
        let begun = if run < selftest::RUNS {
            self.begin(&selftest::start(run), board)
        } else {
            self.leave_job(&selftest::QUESTION)
        };
        self.state = State::Empty;
        if begun.is_err() {
            let found = selftest::judge(None, progress_health(self.selftest.take()));
            self.clear();
            if let Some(pending) = self.pending.take() {
                out.reply(pending.id, &Reply::Selftest(found));
            }
        }
        self.run.is_some()
    }

    fn run_index(&self, run: u8) -> Result<usize, Problem> {
        if self.state == State::Empty {
            return self.only(State::Ready).map(|()| 0);
        }
        self.setup.run_index(run)
    }

    fn forget_runs(&mut self) {
        self.lines = None;
        self.summaries = [None; RUNS];
        self.ended = None;
        self.answer = None;
        self.stored = 0;
        if let Some(store) = &mut self.archive {
            store.runs.clear();
        }
    }

    fn info(&self, board: &impl Board) -> Info<'_> {
        let i = &self.identity;
        Info {
            firmware: cut(i.firmware, NAME_MAX),
            version: cut(i.version, NAME_MAX),
            build: cut(i.build, NAME_MAX),
            chip: cut(i.chip, NAME_MAX),
            serial: i.serial,
            clock: i.clock,
            clock_hz: i.clock_hz,
            tick_hz: i.tick_hz,
            storage: i.storage,
            reset: i.reset,
            resets: i.resets,
            panic: i.panic.map(|text| cut(text, PANIC_MAX)),
            faults: board.faults(),
            capacity: Capacity {
                channels: CHANNELS as u8,
                inputs: i.inputs,
                sensors: SENSORS as u8,
                runs: RUNS as u8,
                lines: LINES as u16,
                block_length: BLOCK_LENGTH as u32,
                window: i.window,
                methods: METHODS.iter().fold(0, |bits, m| bits | m.bit()),
            },
        }
    }

    fn status(&self, board: &impl Board) -> Status {
        let known = matches!(self.state, State::Ready | State::Running | State::SettingUp);
        Status {
            state: self.state,
            busy: self.pending.map(|p| p.number),
            fingerprint: known.then(|| self.setup.fingerprint()),
            running: match self.state {
                State::Running => self.run.as_ref().map(Run::running),
                _ => None,
            },
            stored: if known { self.stored } else { 0 },
            surveyed: if known { self.setup.surveyed() } else { 0 },
            answer: self.answer.is_some(),
            unsaved: board.unsaved(),
        }
    }

    fn subscribe(
        &mut self,
        subscription: &Subscription,
        board: &mut impl Board,
    ) -> Result<(), Problem> {
        if subscription.samples != Stream::Off && self.identity.inputs == 0 {
            return Err(Problem::Unsupported(Item::Input));
        }
        if subscription.samples != Stream::Off && !self.wants_inputs() {
            let rate = match board.setting(SettingKey::SampleRate)? {
                Setting::SampleRate(rate) => rate,
                _ => return Err(Problem::Unsupported(Item::Setting)),
            };
            board.start_inputs(rate)?;
        }
        if subscription.samples != self.subscription.samples {
            self.recorder = Recorder::new(subscription.samples);
        }
        self.subscription = *subscription;
        self.tend_inputs(board);
        Ok(())
    }

    fn end_setup(&mut self) -> Result<crate::wire::Grid, Problem> {
        // Said again, it is still so.
        if self.state == State::Ready
            && let Some(lines) = &self.lines
        {
            return Ok(lines.grid());
        }
        self.only(State::SettingUp)?;
        let lines = self.setup.end()?;
        let grid = lines.grid();
        self.lines = Some(lines);
        self.state = State::Ready;
        Ok(grid)
    }

    fn start(&mut self, start: &Start, board: &mut impl Board) -> Result<(), Problem> {
        let same = self.run.as_ref().is_some_and(|run| run.start == *start);
        if same && self.state == State::Running {
            return Ok(());
        }
        self.only(State::Ready)?;
        self.not_busy()?;
        self.begin(start, board)
    }

    /// Begins a run.
    fn begin(&mut self, start: &Start, board: &mut impl Board) -> Result<(), Problem> {
        let number = self.setup.run_index(start.run)?;
        if start.limit == Some(0) {
            return Err(range(Field::Limit, 0, 0.0, 1.0, u64::MAX as f64));
        }
        let Some(lines) = self.lines.clone() else {
            return self.only(State::SettingUp);
        };
        let task = match start.pass {
            Pass::Survey => {
                let modes = lines.modes.clone().ok_or(missing(Item::ModeBand, 0))?;
                let room = self.buffers.sums.len();
                Task::Survey(Survey::new(self.setup.accelerometers(), modes, room)?)
            }
            Pass::Measure => {
                self.setup.may_measure(number)?;
                let accelerations = self.setup.accelerations();
                let geometry = self.setup.geometry(number, accelerations)?;
                Task::Measure(geometry, accelerations)
            }
        };
        let intake = self.intake(number, start.source, board)?;
        match start.source {
            Source::Host => {}
            Source::Inputs => {
                let inputs = usize::from(self.identity.inputs);
                if inputs == 0 {
                    return Err(Problem::Unsupported(Item::Source));
                }
                if intake.channels() > inputs {
                    return Err(Problem::Capacity {
                        item: Item::Input,
                        found: intake.channels() as u32,
                        limit: inputs as u32,
                    });
                }
                board.start_inputs(self.setup.sample_rate())?;
            }
            Source::Synthetic => self.synthetic = Some(Synthetic::new(&self.setup, number)),
        }
        let buffers = core::mem::take(&mut self.buffers);
        // `end_setup` has seen that the blocks fit.
        self.run = Run::new(*start, lines, intake, task, buffers);
        self.state = State::Running;
        Ok(())
    }

    /// The channels of a run at work.
    fn intake(&self, run: usize, source: Source, board: &impl Board) -> Result<Intake, Problem> {
        let rate = self.setup.sample_rate() as f32;
        let mut channels: heapless::Vec<(Carries, Channel), CHANNELS> = heapless::Vec::new();
        for (number, code) in self.setup.channels(run).iter().enumerate() {
            let carries = Carries::from_code(*code);
            let scale = match carries {
                Carries::Sensor(sensor) => self.setup.scale(usize::from(sensor)),
                Carries::Drive | Carries::Nothing => None,
            };
            let unit = Scale::Given {
                per_unit: 1.0,
                offset: 0.0,
            };
            let stored = || match board.setting(SettingKey::Input(number as u8))? {
                Setting::Input(input) => Certificate::new(&input),
                _ => Err(Problem::Unsupported(Item::Setting)),
            };
            let channel = match (calibration::Scale::given(&scale.unwrap_or(unit))?, source) {
                // What the converters deliver is watched, whoever says how it becomes SI.
                (Some(scale), Source::Inputs) => {
                    let limits = stored()?.limits();
                    Channel::watched(scale, Watch::new(limits, rate))
                }
                (Some(scale), _) => Channel::unwatched(scale),
                (None, Source::Synthetic) => Channel::unwatched(calibration::Scale::ONE),
                (None, _) => stored()?.channel(rate),
            };
            // `set_run` has seen that they fit.
            let _ = channels.push((carries, channel));
        }
        Ok(Intake::new(channels.into_iter(), self.setup.sensors()))
    }

    /// Takes the samples of a request.
    fn take(
        &mut self,
        samples: &Samples<'_>,
        board: &mut impl Board,
        out: &mut impl Outbox,
    ) -> Result<Taken, Problem> {
        let Some(run) = &mut self.run else {
            // A run that has ended by itself has them all.
            let count = samples.count().unwrap_or(0) as u64;
            return match &self.ended {
                Some(Ended { start, taken })
                    if start.source == Source::Host
                        && samples.first.saturating_add(count) <= taken.next =>
                {
                    Ok(*taken)
                }
                _ => self.only(State::Running).map(|()| Taken {
                    next: 0,
                    missing: 0,
                }),
            };
        };
        if run.start.source != Source::Host {
            // Its samples come from elsewhere: the box is still at work on that start.
            return Err(Problem::Busy(Request::Start(run.start).number()));
        }
        let channels = run.channels();
        let count = samples.count();
        let (Some(count), true) = (count, usize::from(samples.channels) == channels) else {
            return Err(Problem::Count {
                item: Item::Channel,
                found: u32::from(samples.channels),
                expected: channels as u32,
            });
        };
        let Some(end) = samples.first.checked_add(count as u64) else {
            return Err(range(
                Field::Limit,
                0,
                samples.first as f64,
                0.0,
                (u64::MAX - count as u64) as f64,
            ));
        };
        if samples.first > run.next() && count > 0 {
            if run.start.gaps == Gaps::Refuse {
                return Err(Problem::Gap {
                    found: samples.first,
                    expected: run.next(),
                });
            }
            run.skip_to(samples.first, out);
        }
        for index in run.next()..end {
            let Some(run) = &mut self.run else { break };
            if run.is_complete() {
                break;
            }
            let at = (index - samples.first) as usize * channels;
            run.push(&Sample::Host(samples.values, at), board, out);
            self.meter();
        }
        let taken = self.run.as_ref().map_or(
            Taken {
                next: end,
                missing: 0,
            },
            |run| Taken {
                next: run.next(),
                missing: run.missing(),
            },
        );
        self.end_if_complete(board, out);
        Ok(taken)
    }

    fn stop(&mut self, board: &mut impl Board) -> Result<crate::wire::Summary, Problem> {
        if self.selftest.is_none()
            && let Some(summary) = self.conclude(Outcome::Stopped, board)
        {
            return Ok(summary);
        }
        let ended = self.ended.ok_or(missing(Item::Summary, 0))?;
        let at = usize::from(ended.start.run);
        let summary = self.summaries.get(at).copied().flatten();
        summary.ok_or(missing(Item::Summary, at))
    }

    fn read_lines(&self, id: u16, read: &ReadLines, out: &mut impl Outbox) -> Result<(), Problem> {
        let at = self.run_index(read.run)?;
        let Some(store) = &self.archive else {
            return self.not_busy();
        };
        let count = match (&self.lines, store.runs.kept(at)) {
            (Some(lines), Some(_)) => lines.settings.grid().count,
            _ => return Err(missing(Item::Run, at)),
        };
        let first = usize::from(read.first);
        if first >= count {
            return Err(Problem::Index {
                item: Item::Line,
                found: u32::from(read.first),
                limit: count as u32,
            });
        }
        let wanted = usize::from(read.count).min(Lines::FIT).min(count - first);
        let lines: heapless::Vec<Line, { Lines::FIT }> = (first..first + wanted)
            .filter_map(|line| store.runs.line(at, line))
            .collect();
        let reply = Reply::Lines(Lines {
            run: read.run,
            first: read.first,
            lines: Packed::new(&lines),
        });
        out.reply(id, &reply);
        Ok(())
    }

    /// Leaves a job behind, if the question can be asked.
    fn identify(
        &mut self,
        id: u16,
        question: &Question,
        board: &impl Board,
    ) -> Result<(), Problem> {
        self.only(State::Ready)?;
        self.not_busy()?;
        if let Some(mass) = question.known_mass {
            within(Field::KnownMass, 0, mass, f64::MIN_POSITIVE, f64::MAX)?;
        }
        if let Procedure::Iterative { tolerance, limit } = question.procedure {
            within(Field::Tolerance, 0, tolerance, f64::MIN_POSITIVE, f64::MAX)?;
            let most = f64::from(ITERATIONS_MAX);
            within(Field::Iterations, 0, f64::from(limit), 1.0, most)?;
        }
        within(
            Field::Modes,
            0,
            f64::from(question.modes),
            0.0,
            MAX_MODES as f64,
        )?;
        if let Some([low, high]) = question.fit_band {
            within(Field::FitBand, 0, low, 0.0, f64::MAX)?;
            within(Field::FitBand, 0, high, low, f64::MAX)?;
        }
        self.leave_job(question)?;
        self.pending = Some(Pending {
            id,
            number: Request::Identify(*question).number(),
            since: board.ticks(),
        });
        Ok(())
    }

    /// Leaves a job to be taken.
    fn leave_job(&mut self, question: &Question) -> Result<(), Problem> {
        let runs = self.asked_runs(question)?;
        let accelerations = self.accelerations_of(runs, question.method)?;
        self.asked = Some(Asked {
            question: Question { runs, ..*question },
            accelerations,
        });
        Ok(())
    }

    /// The runs that a question is about, all of which are stored.
    fn asked_runs(&self, question: &Question) -> Result<u32, Problem> {
        let runs = match question.runs {
            0 => self.stored,
            some => some,
        };
        for run in 0..u32::BITS as u8 {
            if runs & 1 << run != 0 {
                let at = self.setup.run_index(run)?;
                if self.stored & 1 << run == 0 {
                    return Err(missing(Item::Run, at));
                }
            }
        }
        if runs == 0 {
            return Err(missing(Item::Run, 0));
        }
        Ok(runs)
    }

    /// The accelerometers behind all of these runs, which must be those that the method
    /// needs.
    fn accelerations_of(&self, runs: u32, method: Method) -> Result<Accelerations, Problem> {
        let interface_only = masslines::Method::from(method).interface_only();
        let mut common = None;
        for run in (0..RUNS as u8).filter(|run| runs & 1 << run != 0) {
            let kept = self
                .archive
                .as_ref()
                .and_then(|s| s.runs.kept(usize::from(run)));
            let Some(found) = kept.map(|k| k.accelerations) else {
                continue;
            };
            let expected = match common {
                Some(common) => common,
                None if interface_only => Accelerations::Interface,
                None if found == Accelerations::Interface => Accelerations::All,
                None => found,
            };
            if found != expected {
                return Err(Problem::Accelerations {
                    found,
                    expected,
                    run,
                });
            }
            common = Some(found);
        }
        Ok(common.unwrap_or(Accelerations::Interface))
    }
}

fn progress_health(progress: Option<Progress>) -> Health {
    progress.map_or(Health::GOOD, |p| p.health)
}

fn missing(item: Item, index: usize) -> Problem {
    Problem::Missing {
        item,
        index: index as u32,
    }
}
