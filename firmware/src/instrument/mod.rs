//! The box as a state machine, without hardware: requests and samples in, replies and
//! events out.
//!
//! The firmware runs this very type, and so does a host that stands in for a box: what
//! they compute is the same to the last bit. The contract is [`crate::wire`].
//!
//! Nothing here waits or takes long: [`Instrument::request`], [`Instrument::sample`] and
//! [`Instrument::poll`] return after the samples of one message, or one block, at the
//! most. What takes seconds leaves as a [`Job`], which a task of low priority runs while
//! requests are still answered. How many instructions a request may take on the chip is in
//! the firmware's README; it depends on the message's length and on the set-up, never on a
//! number that is sent, such as that of a sample.
//!
//! | file | holds |
//! | --- | --- |
//! | `board` | what the instrument needs of the hardware and of the link |
//! | `memory` | what it is lent, and how much of it |
//! | `requests` | requests, and the states in which they are dealt with |
//! | `runs` | starting, feeding and ending a run |
//! | `question` | what may be asked of the stored runs |
//! | `setup/` | the set-up's pieces, and the checks of the whole |
//! | `limits` | what a request may ask for |
//! | `readings` | samples of a run to SI, and their faults |
//! | `run` | the run that is going on: blocks, gaps, faults, the average |
//! | `survey` | peaks of single accelerometers, for weights |
//! | `store` | finished runs |
//! | `job` | the identification |
//! | `answer` | what was found, in the contract's words |
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
//! the instrument, by random walks and by frames that nobody should send.
//!
//! **Drive only.** A run needs a channel with the generator's signal. Without one its
//! twelve resultants would have to be correlated with each other, 1152 bytes a line and
//! run: that is the workstation's.

mod answer;
mod board;
mod job;
mod limits;
mod live;
pub mod memory;
mod question;
mod readings;
mod requests;
mod run;
mod runs;
mod selftest;
mod setup;
mod store;
mod survey;
mod synthetic;

pub use answer::{Findings, answer};
pub use board::{Board, Identity, RawSample, Transmit, Vitals};
pub use job::Job;
pub use memory::{Memory, Persistent, RunStorage, WorkingStorage};

use crate::calibration;
use crate::wire::{
    Accelerations, Event, Fault, FaultKind, Identified, Outcome, Problem, Question, Refused, Reply,
    Request, Setting, SettingKey, Source, Start, Started, State, Stream, Subscription, Summary,
    Taken, Telemetry,
};
use live::{LevelMeter, Recorder};
use memory::{CHANNELS, RUNS};
use readings::Sample;
use run::{Buffers, Run};
use selftest::Progress;
use setup::{Lines, SetUp};
use store::Store;
use synthetic::Synthetic;

/// A request that is still being worked on.
#[derive(Clone, Copy, Debug)]
struct Pending {
    id: u16,
    number: u8,
    /// Ticks when it came.
    since: u64,
}

/// A question that waits for its job to be taken.
#[derive(Clone, Copy, Debug)]
struct Asked {
    question: Question,
    accelerations: Accelerations,
}

/// A run that has ended.
#[derive(Clone, Copy, Debug)]
struct Ended {
    start: Start,
    taken: Taken,
}

/// The box.
#[derive(Debug)]
pub struct Instrument<'m> {
    identity: Identity<'m>,
    state: State,
    setup: &'m mut SetUp,
    /// What follows from the set-up, once it is complete.
    lines: Option<Lines>,
    /// Storage of a run, while none is going on.
    buffers: Option<Buffers<'m>>,
    run: Option<Run<'m>>,
    /// Where the samples of a synthetic run come from.
    synthetic: Option<Synthetic>,
    /// The self-test that is going on.
    selftest: Option<Progress>,
    summaries: &'m mut [Option<Summary>; RUNS],
    /// The run that ended last.
    ended: Option<Ended>,
    /// The stored runs, unless a job has them.
    archive: Option<Store<'m>>,
    /// What the next job is about.
    asked: Option<Asked>,
    /// Bit k: run k is stored.
    stored: u32,
    pending: Option<Pending>,
    /// Ticks that the stored answer took, if there is one.
    answered: Option<u64>,
    subscription: Subscription,
    levels: &'m mut LevelMeter,
    recorder: &'m mut Recorder,
    /// Ticks at which telemetry and levels were sent last.
    told: [u64; 2],
    /// Longest that a block took since telemetry was sent last, ticks.
    longest_block: u32,
    /// Whether the box has said that it has started.
    introduced: bool,
}

/// Answers a request with what is wrong with it.
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
        // Of whoever it was lent to before.
        setup.clear();
        summaries.fill(None);
        kept.fill(None);
        *answer = None;
        recorder.begin(Stream::Off);
        Self {
            identity,
            state: State::Empty,
            setup,
            lines: None,
            buffers: Some(Buffers {
                scratch,
                work,
                lines,
            }),
            run: None,
            synthetic: None,
            selftest: None,
            summaries,
            ended: None,
            archive: Some(Store::new(responses, drive, kept, answer)),
            asked: None,
            stored: 0,
            pending: None,
            answered: None,
            subscription: Subscription::default(),
            levels,
            recorder,
            told: [0; 2],
            longest_block: 0,
            introduced: false,
        }
    }

    /// Deals with one request, and answers it exactly once: here, or by [`Self::finish`]
    /// where it takes a [`Job`].
    pub fn request(
        &mut self,
        id: u16,
        request: &Request<'_>,
        board: &mut impl Board,
        out: &mut impl Transmit,
    ) {
        self.introduce(out);
        if let Err(problem) = self.dispatch(id, request, board, out) {
            refuse(id, request.number(), problem, out);
        }
    }

    /// Takes one sample of the box's own converters, in their order. They go to the run,
    /// if it takes them, and to a host that has subscribed to them.
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
        let Some(run) = &mut self.run else {
            return;
        };
        if run.start.source != Source::Inputs {
            return;
        }
        let origin = *run.origin.get_or_insert(sample.number);
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
    pub fn poll(&mut self, board: &mut impl Board, out: &mut impl Transmit) -> bool {
        self.introduce(out);
        let now = board.ticks();
        let second = u64::from(self.identity.tick_hz);
        let due = |told: u64, every: u16| {
            every > 0 && now.saturating_sub(told).saturating_mul(1000) >= u64::from(every) * second
        };
        let [telemetry, levels] = self.told;
        if due(telemetry, self.subscription.telemetry) {
            self.told[0] = now;
            self.tell_telemetry(now, board, out);
        }
        if due(levels, self.subscription.levels) {
            self.told[1] = now;
            self.levels.tell(out);
            self.recorder.send(out);
        }
        if self.selftest.is_some() {
            // Nobody has asked for the runs of a self-test.
            self.compute(board, &mut Silence);
            return self.go_on_testing(board, out);
        }
        self.compute(board, out)
    }

    /// Computes some samples of a synthetic run; `true` if there is one.
    fn compute(&mut self, board: &mut impl Board, out: &mut impl Transmit) -> bool {
        for _ in 0..COMPUTED_TOGETHER {
            let (Some(run), Some(synthetic)) = (&mut self.run, &mut self.synthetic) else {
                return false;
            };
            let mut sample = [0.0; CHANNELS];
            let channels = synthetic.sample(&mut sample);
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
        let (Some(asked), Some(lines)) = (self.asked.take(), self.lines.clone()) else {
            return None;
        };
        // A question is not taken during a run, nor a run begun before it is answered.
        let buffers = self.buffers.take()?;
        buffers.scratch.clear_for_solver();
        if let Some(solver) = buffers.scratch.solver() {
            solver.load_cells.take_from(self.setup.arrangement());
        }
        Some(Job {
            store: self.archive.take()?,
            buffers,
            question: asked.question,
            lines,
            accelerations: asked.accelerations,
            outcome: None,
        })
    }

    /// Takes a job back and answers the request behind it.
    pub fn finish(&mut self, job: Job<'m>, board: &mut impl Board, out: &mut impl Transmit) {
        let Job {
            store,
            buffers,
            outcome,
            ..
        } = job;
        self.buffers = Some(buffers);
        let store = self.archive.insert(store);
        let Some(pending) = self.pending.take() else {
            return;
        };
        if let Some(progress) = self.selftest.take() {
            let answer = store.answer.as_ref().filter(|_| outcome == Some(Ok(())));
            let found = selftest::judge(answer, progress.health);
            self.clear();
            out.reply(pending.id, &Reply::Selftest(found));
            return;
        }
        let ticks = board.ticks().saturating_sub(pending.since);
        let problem = match (outcome, store.answer.as_ref()) {
            (Some(Ok(())), Some(answer)) => {
                self.answered = Some(ticks);
                let answer = *answer;
                out.reply(pending.id, &Reply::Identified(Identified { ticks, answer }));
                return;
            }
            (Some(Err(why)), _) => Problem::NoAnswer(why),
            // It comes back without having been run.
            _ => Problem::Busy(pending.number),
        };
        refuse(pending.id, pending.number, problem, out);
    }

    /// A fault of the box that the board has noticed. It is told, and a converter that
    /// does not answer ends the run that lives on it: what was averaged until then is kept.
    pub fn fault(
        &mut self,
        kind: FaultKind,
        part: Option<u8>,
        board: &mut impl Board,
        out: &mut impl Transmit,
    ) {
        let sample = self.run.as_ref().map_or(board.input_samples(), Run::next);
        out.event(&Event::Fault(Fault { kind, sample, part }));
        let lives_on_it = |run: &Run<'_>| run.start.source == Source::Inputs;
        if kind == FaultKind::Converter && self.run.as_ref().is_some_and(lives_on_it) {
            self.end_run(Outcome::Fault, board, out);
        }
    }

    fn introduce(&mut self, out: &mut impl Transmit) {
        if !self.introduced {
            self.introduced = true;
            out.event(&Event::Started(Started {
                reset: self.identity.reset,
                resets: self.identity.resets,
            }));
        }
    }

    fn tell_telemetry(&mut self, now: u64, board: &mut impl Board, out: &mut impl Transmit) {
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

    /// Lets the levels see the sample that the run has just taken.
    fn meter(&mut self) {
        if let Some(run) = &mut self.run {
            self.longest_block = self.longest_block.max(core::mem::take(&mut run.longest));
            if self.subscription.levels > 0 {
                self.levels.add(run.readings(), run.next());
            }
        }
    }

    /// Ends the run if it has all its samples, and says so.
    fn end_if_complete(&mut self, board: &mut impl Board, out: &mut impl Transmit) {
        if self.run.as_ref().is_some_and(Run::is_complete) {
            self.end_run(Outcome::Limit, board, out);
        }
    }

    /// Ends the run by itself, and says so.
    fn end_run(&mut self, outcome: Outcome, board: &mut impl Board, out: &mut impl Transmit) {
        if let Some(summary) = self.conclude(outcome, board) {
            out.event(&Event::RunEnded(summary));
        }
    }

    /// Ends the run and keeps what it has found.
    fn conclude(&mut self, outcome: Outcome, board: &mut impl Board) -> Option<Summary> {
        let run = self.run.take()?;
        let number = usize::from(run.start.run);
        self.ended = Some(Ended {
            start: run.start,
            taken: Taken {
                next: run.next(),
                missing: run.missing(),
            },
        });
        let store = self.archive.as_mut().map(|s| &mut s.runs);
        let (summary, peaks, buffers) = run.finish(outcome, self.identity.tick_hz, store);
        self.buffers = Some(buffers);
        self.synthetic = None;
        self.state = State::Ready;
        if let Some(peaks) = &peaks {
            self.setup.set_peaks(number, peaks);
        }
        if let Some(store) = &self.archive {
            self.stored = store.runs.mask();
        }
        if let Some(slot) = self.summaries.get_mut(number) {
            *slot = Some(summary);
        }
        self.tend_inputs(board);
        Some(summary)
    }

    /// Whether the box's own converters are wanted.
    fn wants_inputs(&self) -> bool {
        let run = self.run.as_ref();
        run.is_some_and(|r| r.start.source == Source::Inputs)
            || self.subscription.samples != Stream::Off
    }

    /// Stops the converters if nobody wants them any more.
    fn tend_inputs(&self, board: &mut impl Board) {
        if self.identity.inputs > 0 && !self.wants_inputs() {
            board.stop_inputs();
        }
    }
}

/// Samples of a synthetic run that are computed in one go.
const COMPUTED_TOGETHER: usize = 8;

/// Where events go that nobody has asked for.
struct Silence;

impl Transmit for Silence {
    fn reply(&mut self, _request: u16, _reply: &Reply<'_>) {}

    fn event(&mut self, _event: &Event<'_>) {}
}

/// The beginning of a text, at most `most` bytes of it.
fn cut(text: &str, most: usize) -> &str {
    let mut end = text.len().min(most);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    text.get(..end).unwrap_or("")
}
