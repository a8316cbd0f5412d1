//! Requests: which are dealt with in which state, and how.

use super::memory::{BLOCK_LENGTH, CHANNELS, LINES, RUNS, SENSORS};
use super::run::Run;
use super::{Board, Instrument, Transmit, cut};
use crate::wire::{
    Capacity, Identified, Info, Item, Method, NAME_MAX, PANIC_MAX, Packed, Peaks, Pong, Problem,
    Provoke, Reply, Request, Saved, Setting, SettingKey, State, Status, Stream, Subscription,
    Weights,
};

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
    pub(super) fn dispatch(
        &mut self,
        id: u16,
        request: &Request<'_>,
        board: &mut impl Board,
        out: &mut impl Transmit,
    ) -> Result<(), Problem> {
        let reply = match request {
            Request::Hello => {
                self.introduce_to(id, board, out);
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
                if *fault == Provoke::Rehearsal {
                    // The others end the box. This one would take the samples from under
                    // whoever is at work on them.
                    self.not_running()?;
                    self.not_streaming()?;
                }
                if !board.provoke(*fault) {
                    return Err(Problem::Unsupported(Item::Provoke));
                }
                Reply::Done
            }
            Request::Selftest => return self.begin_selftest(id, board),
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
            Request::ReadPeaks(run) => return self.read_peaks(id, *run, out),
            Request::ReadWeights(run) => return self.read_weights(id, *run, out),
            Request::Identify(question) => return self.identify(id, question, board),
            Request::ReadAnswer => return self.read_answer(id, out),
            Request::ReadSetting(key) => return read_setting(id, *key, board, out),
            Request::WriteSetting(setting) => {
                self.not_running()?;
                if matches!(setting, Setting::Input(_) | Setting::SampleRate(_)) {
                    self.not_streaming()?;
                }
                board.write_setting(setting)?;
                Reply::Done
            }
            Request::SaveSettings => {
                self.not_running()?;
                self.not_streaming()?;
                self.not_busy()?;
                let storage = board.save_settings()?;
                Reply::Saved(Saved { storage })
            }
            Request::ResetSettings => {
                self.not_running()?;
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
        let peaks = self.setup.peaks(at).ok_or(missing(Item::Survey, at))?;
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

    pub(super) fn only(&self, expected: State) -> Result<(), Problem> {
        if self.state == expected {
            return Ok(());
        }
        Err(Problem::State {
            found: self.state,
            expected,
        })
    }

    pub(super) fn not_running(&self) -> Result<(), Problem> {
        if self.state == State::Running {
            return self.only(State::Ready);
        }
        Ok(())
    }

    /// Whether nobody records the converters' samples: what makes SI of them, and when they are
    /// taken, must not change in the middle of a recording.
    pub(super) fn not_streaming(&self) -> Result<(), Problem> {
        match self.subscription.samples {
            Stream::Off => Ok(()),
            _ => Err(Problem::Busy(
                Request::Subscribe(self.subscription).number(),
            )),
        }
    }

    pub(super) fn not_busy(&self) -> Result<(), Problem> {
        match self.pending {
            Some(pending) => Err(Problem::Busy(pending.number)),
            None => Ok(()),
        }
    }

    /// Forgets set-up and runs.
    pub(super) fn clear(&mut self) {
        self.setup.clear();
        self.lines = None;
        self.forget_runs();
        self.state = State::Empty;
    }

    pub(super) fn run_index(&self, run: u8) -> Result<usize, Problem> {
        if self.state == State::Empty {
            return self.only(State::Ready).map(|()| 0);
        }
        self.setup.run_index(run)
    }

    fn forget_runs(&mut self) {
        self.lines = None;
        self.summaries.fill(None);
        self.ended = None;
        self.answered = None;
        self.stored = 0;
        if let Some(store) = &mut self.archive {
            store.runs.clear();
        }
    }

    #[inline(never)]
    fn introduce_to(&self, id: u16, board: &impl Board, out: &mut impl Transmit) {
        out.reply(id, &Reply::Info(self.info(board)));
    }

    /// The stored answer, sent again.
    #[inline(never)]
    fn read_answer(&self, id: u16, out: &mut impl Transmit) -> Result<(), Problem> {
        let ticks = self.answered.ok_or(missing(Item::Answer, 0))?;
        let Some(store) = &self.archive else {
            return self.not_busy();
        };
        let answer = store.answer.ok_or(missing(Item::Answer, 0))?;
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
            answer: self.answered.is_some(),
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
        if subscription.samples != Stream::Off && !self.wants_inputs() {
            let rate = match board.setting(SettingKey::SampleRate)? {
                Setting::SampleRate(rate) => rate,
                _ => return Err(Problem::Unsupported(Item::Setting)),
            };
            board.start_inputs(rate)?;
        }
        if subscription.samples != self.subscription.samples {
            // What was gathered belongs to the subscription before.
            self.recorder.send(out);
            self.recorder.begin(subscription.samples);
        }
        self.subscription = *subscription;
        self.tend_inputs(board);
        Ok(())
    }

    /// Checks the set-up as a whole, and makes lines of it.
    pub(super) fn check_setup(&mut self) -> Result<super::setup::Lines, Problem> {
        // They are lent to a run only, and then there is a set-up.
        let scratch = self.buffers.as_mut().map(|buffers| &mut *buffers.scratch);
        let scratch = scratch.ok_or(Problem::Busy(Request::EndSetup.number()))?;
        scratch.clear_for_run();
        let run = scratch.run_mut();
        let run = run.ok_or(Problem::Busy(Request::EndSetup.number()))?;
        self.setup.end(&mut run.geometry)
    }

    fn end_setup(&mut self) -> Result<crate::wire::Grid, Problem> {
        // Said again, it is still so.
        if self.state == State::Ready
            && let Some(lines) = &self.lines
        {
            return Ok(lines.grid());
        }
        self.only(State::SettingUp)?;
        let lines = self.check_setup()?;
        let grid = lines.grid();
        self.lines = Some(lines);
        self.state = State::Ready;
        Ok(grid)
    }
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

pub(super) fn missing(item: Item, index: usize) -> Problem {
    Problem::Missing {
        item,
        index: index as u32,
    }
}
