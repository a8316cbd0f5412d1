//! Requests, one by one: each is checked whole before it changes anything.

use super::setup::{self, SetUp};
use super::{Activity, Board, Instrument, Phase, Session, Storage, Transmit};
use crate::capacity::{BLOCK_LENGTH, CHANNELS, LINES, RUNS, SENSORS};
use crate::wire::{
    Capacity, Grid, Identified, Info, Item, MethodSet, NAME_MAX, PANIC_MAX, Packed, Peaks, Pong,
    Probe, Problem, Provoke, Reply, Request, Saved, Setting, SettingKey, State, Status, Stream,
    Subscription, Weights,
};
use massline_core::masslines::Method;

impl<'m> Instrument<'m> {
    /// Carries out a request: the reply has been sent, or will be by [`Self::finish`], unless
    /// a problem is returned. Then nothing was changed.
    pub(super) fn dispatch(
        &mut self,
        id: u16,
        request: &Request<'_>,
        board: &mut impl Board,
        out: &mut impl Transmit,
    ) -> Result<(), Problem> {
        let reply = match request {
            Request::Hello => {
                self.send_info(id, board, out);
                return Ok(());
            }
            Request::Ping(ping) => Reply::Pong(Pong {
                stamp: ping.stamp,
                ticks: board.ticks(),
                samples: board.input_samples(),
            }),
            Request::Status => Reply::Status(self.status(board)),
            Request::Subscribe(subscription) => {
                self.subscribe(subscription, board, out)?;
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
                if *fault == Provoke::TestPattern {
                    // The others end the box. This one replaces the samples, which a run or a
                    // recording must not see.
                    self.phase.not_running()?;
                    self.not_streaming()?;
                }
                if !board.provoke(*fault) {
                    return Err(Problem::Unsupported(Item::Provoke));
                }
                Reply::Done
            }
            Request::Selftest => return self.begin_selftest(id, board),
            Request::Probe(probe) => {
                if !matches!(probe, Probe::Crystal | Probe::Skew) {
                    self.phase.not_running()?;
                    self.not_streaming()?;
                }
                Reply::Probed(board.probe(*probe)?)
            }
            Request::BeginSetup(plan) => {
                self.phase.not_running()?;
                self.phase.not_busy()?;
                self.setup.begin(plan)?;
                self.restart(Phase::SettingUp);
                Reply::Done
            }
            Request::SetProcessing(processing) => {
                self.pieces()?.set_processing(processing)?;
                Reply::Done
            }
            Request::SetSensor(sensor) => {
                self.pieces()?.set_sensor(sensor)?;
                Reply::Done
            }
            Request::SetRun(run) => {
                self.pieces()?.set_run(run)?;
                Reply::Done
            }
            Request::SetWeights(weights) => {
                match self.phase.state() {
                    State::SettingUp | State::Ready => self.setup.set_weights(weights)?,
                    _ => return Err(self.phase.unless(State::SettingUp)),
                }
                Reply::Done
            }
            Request::EndSetup => Reply::Grid(self.end_setup()?),
            Request::Start(start) => {
                self.start(start, board)?;
                Reply::Done
            }
            Request::Samples(samples) => Reply::Progress(self.take_samples(samples, board, out)?),
            Request::Stop => Reply::Summary(self.stop(board)?),
            Request::Abort => {
                self.abort(board);
                Reply::Done
            }
            Request::ReadSummary(run) => {
                let at = self.run_index(*run)?;
                let summary = self.summaries.get(at).copied().flatten();
                Reply::Summary(summary.ok_or(Problem::missing(Item::Summary, at))?)
            }
            Request::ReadLines(read) => return self.read_lines(id, read, out),
            Request::ReadPeaks(run) => return self.read_peaks(id, *run, out),
            Request::ReadWeights(run) => return self.read_weights(id, *run, out),
            Request::Identify(question) => return self.identify(id, question, board),
            Request::ReadAnswer => return self.read_answer(id, out),
            Request::ReadSetting(key) => return read_setting(id, *key, board, out),
            Request::WriteSetting(setting) => {
                self.phase.not_running()?;
                if matches!(setting, Setting::Input(_) | Setting::SampleRate(_)) {
                    self.not_streaming()?;
                }
                board.write_setting(setting)?;
                Reply::Done
            }
            Request::SaveSettings => {
                self.phase.not_running()?;
                self.not_streaming()?;
                self.phase.not_busy()?;
                let storage = board.save_settings()?;
                Reply::Saved(Saved { storage })
            }
            Request::ResetSettings => {
                self.phase.not_running()?;
                self.not_streaming()?;
                board.reset_settings();
                Reply::Done
            }
        };
        out.reply(id, &reply);
        Ok(())
    }

    // A reply is 1 KB. Those that a reference keeps from being the one above are made apart.

    #[inline(never)]
    fn read_peaks(&self, id: u16, run: u8, out: &mut impl Transmit) -> Result<(), Problem> {
        let at = self.run_index(run)?;
        let peaks = self
            .setup
            .peaks(at)
            .ok_or(Problem::missing(Item::Survey, at))?;
        let peaks = Packed::new(peaks);
        out.reply(id, &Reply::Peaks(Peaks { run, peaks }));
        Ok(())
    }

    #[inline(never)]
    fn read_weights(&self, id: u16, run: u8, out: &mut impl Transmit) -> Result<(), Problem> {
        let at = self.run_index(run)?;
        let weights = Packed::new(self.setup.weights(at));
        out.reply(id, &Reply::Weights(Weights { run, weights }));
        Ok(())
    }

    /// The set-up, while its pieces come in.
    fn pieces(&mut self) -> Result<&mut SetUp, Problem> {
        match &self.phase {
            Phase::SettingUp(_) => Ok(self.setup),
            other => Err(other.unless(State::SettingUp)),
        }
    }

    /// Refuses what would change the converters' samples, or their calibration, in the middle of
    /// a recording.
    pub(super) fn not_streaming(&self) -> Result<(), Problem> {
        match self.subscription.samples {
            Stream::Off => Ok(()),
            _ => Err(Problem::Busy(
                Request::Subscribe(self.subscription).number(),
            )),
        }
    }

    /// Forgets set-up and runs.
    pub(super) fn clear(&mut self) {
        self.setup.clear();
        self.restart(Phase::Empty);
    }

    /// Forgets all runs, in favour of a phase without any.
    fn restart(&mut self, to: fn(Storage<'m>) -> Phase<'m>) {
        self.summaries.fill(None);
        if let Some(mut storage) = self.phase.take_storage() {
            storage.runs.clear();
            self.phase = to(storage);
        }
    }

    /// Number of a run as an index into the set-up.
    pub(super) fn run_index(&self, run: u8) -> Result<usize, Problem> {
        match self.phase.state() {
            State::Empty => Err(self.phase.unless(State::Ready)),
            _ => self.setup.run_index(run),
        }
    }

    #[inline(never)]
    fn send_info(&self, id: u16, board: &impl Board, out: &mut impl Transmit) {
        out.reply(id, &Reply::Info(self.info(board)));
    }

    /// Sends the stored answer.
    #[inline(never)]
    pub(super) fn read_answer(&self, id: u16, out: &mut impl Transmit) -> Result<(), Problem> {
        let answered = self.phase.session().and_then(|session| session.answered);
        let ticks = answered.ok_or(Problem::missing(Item::Answer, 0))?;
        let Some(storage) = self.phase.storage() else {
            return self.phase.not_busy();
        };
        let answer = storage.answer.ok_or(Problem::missing(Item::Answer, 0))?;
        out.reply(id, &Reply::Identified(Identified { ticks, answer }));
        Ok(())
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
                methods: MethodSet::of(&Method::ALL),
            },
        }
    }

    fn status(&self, board: &impl Board) -> Status {
        let state = self.phase.state();
        let known = state != State::Empty;
        let session = self.phase.session();
        Status {
            state,
            busy: self.phase.pending().map(|pending| pending.number),
            fingerprint: known.then(|| self.setup.fingerprint()),
            running: match &self.phase {
                Phase::SetUp(_, Activity::Running(run)) => Some(run.running()),
                _ => None,
            },
            stored: session.map_or(0, |session| session.stored),
            surveyed: if known { self.setup.surveyed() } else { 0 },
            answer: session.is_some_and(|session| session.answered.is_some()),
            unsaved: board.unsaved(),
        }
    }

    fn subscribe(
        &mut self,
        subscription: &Subscription,
        board: &mut impl Board,
        out: &mut impl Transmit,
    ) -> Result<(), Problem> {
        if subscription.samples != Stream::Off && self.identity.inputs == 0 {
            return Err(Problem::Unsupported(Item::Input));
        }
        let conditions = subscription.samples.conditions();
        if conditions != self.subscription.samples.conditions() {
            // A run has the usual ones.
            self.phase.not_running()?;
            self.recorder.send(out);
            self.recorder.begin(Stream::Off);
            self.subscription.samples = Stream::Off;
            self.stop_unused_inputs(board);
        }
        if subscription.samples != Stream::Off && !self.uses_inputs() {
            let rate = match board.setting(SettingKey::SampleRate)? {
                Setting::SampleRate(rate) => rate,
                _ => return Err(Problem::Unsupported(Item::Setting)),
            };
            board.start_inputs(rate, conditions)?;
        }
        if subscription.samples != self.subscription.samples {
            // The samples gathered so far belong to the subscription before.
            self.recorder.send(out);
            self.recorder.begin(subscription.samples);
        }
        self.subscription = *subscription;
        self.stop_unused_inputs(board);
        Ok(())
    }

    /// Completes the set-up; where it is complete, nothing is changed.
    #[inline(never)] // Lines are not on the stack beside a reply.
    fn end_setup(&mut self) -> Result<Grid, Problem> {
        let storage = match &mut self.phase {
            Phase::SettingUp(storage) => storage,
            Phase::SetUp(_, Activity::Running(_)) => {
                return Err(self.phase.unless(State::SettingUp));
            }
            Phase::SetUp(session, _) => return Ok(session.lines.grid()),
            other => return Err(other.unless(State::SettingUp)),
        };
        let lines = check_setup(self.setup, storage)?;
        let grid = lines.grid();
        if let Some(storage) = self.phase.take_storage() {
            self.phase = Phase::SetUp(Session::new(lines), Activity::Idle(storage));
        }
        Ok(grid)
    }
}

/// Checks a set-up as a whole. `storage` serves for trying.
pub(super) fn check_setup(
    setup: &SetUp,
    storage: &mut Storage<'_>,
) -> Result<setup::Lines, Problem> {
    storage.scratch.clear_for_run();
    let room = storage.scratch.run_mut();
    let room = room.ok_or(Problem::Busy(Request::EndSetup.number()))?;
    setup.end(&mut room.geometry)
}

#[inline(never)]
fn read_setting(
    id: u16,
    key: SettingKey,
    board: &impl Board,
    out: &mut impl Transmit,
) -> Result<(), Problem> {
    out.reply(id, &Reply::Setting(board.setting(key)?));
    Ok(())
}

/// The beginning of a text, at most `most` bytes of it.
fn cut(text: &str, most: usize) -> &str {
    text.get(..text.floor_char_boundary(most)).unwrap_or("")
}
