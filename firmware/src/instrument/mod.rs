//! The box as a state machine, without hardware: requests and samples in, replies and
//! events out.
//!
//! The firmware runs this very type, and so does the box that is simulated on a host: their
//! results are the same to the last bit. The protocol is [`crate::wire`].
//!
//! Nothing here waits or takes long: [`Instrument::request`], [`Instrument::sample`] and
//! [`Instrument::poll`] return after the samples of one message, or one block, at the
//! most. An identification, which takes seconds, leaves as a [`Job`], which a task of low
//! priority runs while requests are still answered. The most instructions that a request takes on
//! the chip are in the firmware's README; their number depends on the message's length and on the
//! set-up, never on a number that is sent, such as that of a sample.
//!
//! | file | holds |
//! | --- | --- |
//! | `board` | the traits of the hardware and of the link |
//! | `memory`, `storage` | memory that is lent, its sizes, and its way from phase to phase |
//! | `phase` | phases and activities, and the data of each |
//! | `requests` | requests, one by one |
//! | `runs` | starting, feeding and ending a run |
//! | `question` | a question, checked against the stored runs |
//! | `setup/` | the set-up's pieces, and the checks of the whole |
//! | `limits` | limits of the values in a request |
//! | `readings` | samples of a run to SI, and their faults |
//! | `run` | the run that is going on: blocks, gaps, faults, the average |
//! | `survey` | peaks of single accelerometers, for weights |
//! | `store` | finished runs |
//! | `job` | the identification |
//! | `synthetic`, `selftest` | a body that the box computes, and the test of the box with it |
//! | `live` | levels, and samples on their way to a recording |
//!
//! # Design
//!
//! **States** are those of [`crate::wire::State`]. A request that does not fit is refused
//! before it has changed anything. One that is repeated finds what it asks for done.
//!
//! **Faults.** Every sample carries its faults. A block into which a faulty sample has
//! gone, also by way of a filter's memory, never enters an average. A gap ends the block
//! it lies in, and the next block begins behind it.
//!
//! **A hostile host.** Each request is checked whole before anything is changed. What ends a
//! run is listed in [`crate::wire`]. `firmware/tests/protocol` holds a model of all this against
//! the instrument, by random walks and by malformed frames.
//!
//! **Drive only.** A run needs a channel with the generator's signal. Without one its
//! twelve resultants would have to be correlated with each other, 1152 bytes a line and
//! run: that is the workstation's.

mod board;
mod job;
mod limits;
mod live;
mod memory;
mod phase;
mod question;
mod readings;
mod requests;
mod run;
mod runs;
mod selftest;
mod setup;
mod storage;
mod store;
mod survey;
mod synthetic;

pub use board::{Board, Identity, RawSample, Transmit, Vitals};
pub use job::Job;
pub use memory::{Memory, Persistent, RunStorage, WorkingStorage};

use crate::calibration;
use crate::capacity::{CHANNELS, RUNS};
use crate::wire::{
    Event, Fault, FaultKind, NoAnswer, Outcome, Problem, Refused, Reply, Request, Setting,
    SettingKey, Started, Stream, Subscription, Summary, Telemetry,
};
use live::{LevelMeter, Recorder};
use phase::{Activity, Asked, Pending, Phase, SelfTest, Session};
use readings::Sample;
use run::{Feed, Run};
use setup::SetUp;
use storage::Storage;
use store::Stored;

/// The box.
#[derive(Debug)]
pub struct Instrument<'m> {
    identity: Identity<'m>,
    phase: Phase<'m>,
    setup: &'m mut SetUp,
    summaries: &'m mut [Option<Summary>; RUNS],
    subscription: Subscription,
    levels: &'m mut LevelMeter,
    recorder: &'m mut Recorder,
    /// Ticks at which telemetry and levels were sent last.
    sent: [u64; 2],
    /// Longest that a block took since telemetry was sent last, ticks.
    longest_block: u32,
    /// `true` once the host has been sent [`Event::Started`].
    announced: bool,
}

/// Refuses a request, with the reason.
#[inline(never)] // A reply is 1 KB: not on the stack beside the one there might have been.
fn refuse(id: u16, request: u8, problem: Problem, out: &mut impl Transmit) {
    out.reply(id, &Reply::Error(Refused { request, problem }));
}

impl<'m> Instrument<'m> {
    /// A box that has just started. It says so with its first event
    /// ([`Event::Started`]), at the first [`Self::poll`] or [`Self::request`].
    #[must_use]
    pub fn new(memory: Memory<'m>, identity: Identity<'m>) -> Self {
        let WorkingStorage { scratch } = memory.working;
        let RunStorage {
            responses,
            drive,
            work,
            lines,
            levels,
        } = memory.runs;
        let Persistent {
            setup,
            summaries,
            kept,
            answer,
            recorder,
        } = memory.persistent;
        // The memory may have been lent to another instrument before.
        setup.clear();
        summaries.fill(None);
        kept.fill(None);
        *answer = None;
        recorder.begin(Stream::Off);
        Self {
            identity,
            phase: Phase::Empty(Storage {
                scratch,
                work,
                lines,
                runs: Stored::new(responses, drive, kept),
                answer,
            }),
            setup,
            summaries,
            subscription: Subscription::default(),
            levels,
            recorder,
            sent: [0; 2],
            longest_block: 0,
            announced: false,
        }
    }

    /// Carries out one request, and answers it exactly once: here, or by [`Self::finish`]
    /// where it takes a [`Job`].
    #[inline(never)] // Not on the stack of what else its caller does.
    pub fn request(
        &mut self,
        id: u16,
        request: &Request<'_>,
        board: &mut impl Board,
        out: &mut impl Transmit,
    ) {
        self.announce(out);
        if let Err(problem) = self.dispatch(id, request, board, out) {
            refuse(id, request.number(), problem, out);
        }
    }

    /// `true` if a host has subscribed to the samples of the box's own converters.
    #[must_use]
    pub fn is_recording(&self) -> bool {
        self.subscription.samples != Stream::Off
    }

    /// Takes one sample of the box's own converters, in their order. It goes to the run,
    /// if that is fed by them, and to a host that has subscribed to them.
    pub fn sample(
        &mut self,
        sample: &RawSample<'_>,
        board: &mut impl Board,
        out: &mut impl Transmit,
    ) {
        let si = |input: usize, count: i32| {
            let key = SettingKey::Input(input as u8);
            match board.setting(key) {
                Ok(Setting::Input(input)) => calibration::Scale::new(input.per_count, input.offset)
                    .map_or(count as f32, |scale| scale.count(count)),
                _ => count as f32,
            }
        };
        self.recorder.add(sample, si, out);
        let Some(run) = self.phase.run_mut() else {
            return;
        };
        let Feed::Inputs { origin } = &mut run.feed else {
            return;
        };
        let origin = *origin.get_or_insert(sample.number);
        let Some(index) = sample.number.checked_sub(origin) else {
            return;
        };
        run.skip_to(index, out);
        if index == run.next() && !run.is_complete() {
            let taken = Sample::Counts {
                counts: sample.counts,
                health: sample.health,
                ticks: sample.ticks,
            };
            run.push(&taken, board, out);
            self.meter();
        }
        self.end_if_complete(board, out);
    }

    /// Does what is due without a request. Call it whenever there is time, a hundred times
    /// a second or more; `true` if there is more to do at once.
    #[inline(never)] // Not on the stack of what else its caller does.
    pub fn poll(&mut self, board: &mut impl Board, out: &mut impl Transmit) -> bool {
        self.announce(out);
        let now = board.ticks();
        let second = u64::from(self.identity.tick_hz);
        let due = |sent: u64, every: u16| {
            every > 0 && now.saturating_sub(sent).saturating_mul(1000) >= u64::from(every) * second
        };
        let [telemetry, levels] = self.sent;
        if due(telemetry, self.subscription.telemetry) {
            self.sent[0] = now;
            self.send_telemetry(now, board, out);
        }
        if due(levels, self.subscription.levels) {
            self.sent[1] = now;
            self.levels.send(out);
            self.recorder.send(out);
        }
        if let Phase::SelfTesting(_) = self.phase {
            // The runs of a self-test are not the host's, and it hears nothing of them.
            self.compute(board, &mut Discard);
            return self.continue_selftest(board, out);
        }
        self.compute(board, out)
    }

    /// Computes some samples of a synthetic run; `true` if there is one.
    #[inline(never)] // Not on the stack of what else its caller does.
    fn compute(&mut self, board: &mut impl Board, out: &mut impl Transmit) -> bool {
        for _ in 0..COMPUTED_TOGETHER {
            let Some(run) = self.phase.run_mut() else {
                return false;
            };
            let Feed::Synthetic(body) = &mut run.feed else {
                return false;
            };
            let mut sample = [0.0; CHANNELS];
            let channels = body.sample(&mut sample);
            let sample = sample.get(..channels).unwrap_or(&[]);
            run.push(&Sample::Computed(sample), board, out);
            self.meter();
            self.end_if_complete(board, out);
        }
        true
    }

    /// The job that a request has left to be done, once. It comes back by
    /// [`Self::finish`].
    pub fn take_job(&mut self) -> Option<Job<'m>> {
        let (lines, activity) = match &mut self.phase {
            Phase::SetUp(session, activity) => (&session.lines, activity),
            Phase::SelfTesting(test) => (&test.lines, &mut test.activity),
            _ => return None,
        };
        let (asked, storage) = activity.take_question()?;
        storage.scratch.clear_for_solver();
        if let Some(solver) = storage.scratch.solver() {
            solver.load_cells.take_from(self.setup.arrangement());
        }
        Some(Job {
            storage,
            question: asked.question,
            lines: lines.clone(),
            accelerations: asked.accelerations,
            outcome: None,
        })
    }

    /// Takes a job back and answers the request behind it.
    #[inline(never)] // Not on the stack of what else its caller does.
    pub fn finish(&mut self, job: Job<'m>, board: &mut impl Board, out: &mut impl Transmit) {
        let Job {
            storage, outcome, ..
        } = job;
        let answered = outcome == Some(Ok(()));
        let Some(activity) = self.phase.activity_mut() else {
            return;
        };
        let Some(pending) = activity.finish(storage) else {
            return;
        };
        match &self.phase {
            Phase::SelfTesting(test) => {
                let storage = self.phase.storage().filter(|_| answered);
                let answer = storage.and_then(|storage| storage.answer.as_ref());
                let found = selftest::judge(answer.map(|a| &a.identification), test.health);
                self.clear();
                out.reply(pending.id, &Reply::Selftest(found));
            }
            _ => self.answer_question(pending, outcome, board, out),
        }
    }

    /// Answers the request behind an identification.
    fn answer_question(
        &mut self,
        pending: Pending,
        outcome: Option<Result<(), NoAnswer>>,
        board: &impl Board,
        out: &mut impl Transmit,
    ) {
        let problem = match (outcome, self.phase.session_mut()) {
            (Some(Ok(())), Some(session)) => {
                session.answered = Some(board.ticks().saturating_sub(pending.since));
                match self.read_answer(pending.id, out) {
                    Ok(()) => return,
                    Err(problem) => problem,
                }
            }
            (Some(Err(why)), _) => Problem::NoAnswer(why),
            // The job comes back without having been run.
            _ => Problem::Busy(pending.number),
        };
        refuse(pending.id, pending.number, problem, out);
    }

    /// Takes notice of a fault that the board has found. The host is told, and a converter that
    /// does not answer ends the run that is fed by it: what was averaged until then is kept.
    pub fn fault(
        &mut self,
        kind: FaultKind,
        part: Option<u8>,
        board: &mut impl Board,
        out: &mut impl Transmit,
    ) {
        let run = self.phase.run();
        let sample = run.map_or(board.input_samples(), Run::next);
        let is_fed = run.is_some_and(Run::is_of_inputs);
        out.event(&Event::Fault(Fault { kind, sample, part }));
        if kind == FaultKind::Converter && is_fed {
            self.end_run(Outcome::Fault, board, out);
        }
    }

    fn announce(&mut self, out: &mut impl Transmit) {
        if !self.announced {
            self.announced = true;
            out.event(&Event::Started(Started {
                reset: self.identity.reset,
                resets: self.identity.resets,
            }));
        }
    }

    #[inline(never)] // Not on the stack of what else its caller does.
    fn send_telemetry(&mut self, now: u64, board: &mut impl Board, out: &mut impl Transmit) {
        let vitals = board.vitals();
        out.event(&Event::Telemetry(Telemetry {
            uptime: now.saturating_mul(1000) / u64::from(self.identity.tick_hz.max(1)),
            stack_used: vitals.stack_used,
            stack_size: vitals.stack_size,
            load: vitals.load,
            block_ticks: self.longest_block,
            dropped: vitals.dropped,
            overrun: vitals.overrun,
            link: vitals.link,
            faults: board.faults(),
        }));
        self.longest_block = 0;
    }

    /// Adds the sample that the run has just taken to the levels.
    fn meter(&mut self) {
        if let Some(run) = self.phase.run_mut() {
            self.longest_block = self.longest_block.max(core::mem::take(&mut run.longest));
            if self.subscription.levels > 0 {
                self.levels.add(run.readings(), run.next());
            }
        }
    }

    /// Stops the converters if neither the run nor the host takes their samples.
    fn stop_unused_inputs(&self, board: &mut impl Board) {
        if self.identity.inputs > 0 && !self.uses_inputs() {
            board.stop_inputs();
        }
    }

    /// `true` if the run or the host takes the samples of the converters.
    fn uses_inputs(&self) -> bool {
        let run = self.phase.run();
        run.is_some_and(Run::is_of_inputs) || self.is_recording()
    }
}

/// Samples of a synthetic run that are computed in one go.
const COMPUTED_TOGETHER: usize = 8;

/// Discards all that is sent.
struct Discard;

impl Transmit for Discard {
    fn reply(&mut self, _request: u16, _reply: &Reply<'_>) {}

    fn event(&mut self, _event: &Event<'_>) {}
}
