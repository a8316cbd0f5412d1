//! A run from its start to its end, and its lines afterwards.

use super::memory::{Averaging, SUMS};
use super::readings::Sample;
use super::run::{Ended, Feed, Prepared, Run, Task};
use super::setup::{self, SetUp, TRANSFORM};
use super::survey::Survey;
use super::synthetic::Synthetic;
use super::{Activity, Board, Instrument, Phase, Storage, Transmit};
use crate::calibration::{self, Certificate, Channel, Watch};
use crate::wire::{
    ChannelRole, Circuit, Conditions, Event, Field, Gaps, Item, Line, Lines, Outcome, Packed, Pass,
    Problem, Progress, ReadLines, Reply, Request, Samples, Setting, SettingKey, Source, Start,
    State, Summary,
};
use massline_core::geometry::RESULTANTS;
use massline_core::spectra::Rings;

impl Instrument<'_> {
    /// Starts a run; where the same is going on, nothing is changed.
    #[inline(never)] // A run is not on the stack beside a reply.
    pub(super) fn start(&mut self, start: &Start, board: &mut impl Board) -> Result<(), Problem> {
        if let Phase::SetUp(_, Activity::Running(run)) = &self.phase
            && run.start == *start
        {
            return Ok(());
        }
        if start.source == Source::Inputs
            && self.subscription.samples.conditions() != Conditions::default()
        {
            // Samples of a test signal are none of a body.
            self.not_streaming()?;
        }
        let inputs = usize::from(self.identity.inputs);
        let (session, storage) = self.phase.ready()?;
        let run = prepare(self.setup, &session.lines, inputs, start, storage, board)?;
        if let Some(activity) = self.phase.activity_mut() {
            activity.begin_run(*start, run);
        }
        Ok(())
    }

    /// Takes the samples of a request.
    pub(super) fn take_samples(
        &mut self,
        samples: &Samples<'_>,
        board: &mut impl Board,
        out: &mut impl Transmit,
    ) -> Result<Progress, Problem> {
        let Some(run) = self.phase.run_mut() else {
            let ended = self.phase.session().and_then(|session| session.ended);
            return match ended {
                Some(ended) if ended.has(samples) => Ok(ended.taken),
                _ => Err(self.phase.unless(State::Running)),
            };
        };
        if !matches!(run.feed, Feed::Host) {
            // Its samples come from elsewhere: the box is still at work on that start.
            return Err(Problem::Busy(Request::Start(run.start).number()));
        }
        let channels = run.channels();
        let count = samples.count();
        let (Some(count), true) = (count, usize::from(samples.channels) == channels) else {
            return Err(Problem::count(
                Item::Channel,
                usize::from(samples.channels),
                channels,
            ));
        };
        if samples.first.checked_add(count as u64).is_none() {
            return Err(Problem::range(
                Field::Limit,
                0,
                samples.first as f64,
                [0.0, (u64::MAX - count as u64) as f64],
            ));
        }
        if samples.first > run.next() {
            if run.start.gaps == Gaps::Refuse {
                return Err(Problem::Gap {
                    found: samples.first,
                    expected: run.next(),
                });
            }
            run.skip_to(samples.first, out);
        }
        // Those that the box has are passed over. The rest are one message's samples at the most,
        // however far ahead or behind they are numbered.
        let known = run.next().saturating_sub(samples.first).min(count as u64);
        for sample in known as usize..count {
            let Some(run) = self.phase.run_mut() else {
                break;
            };
            if run.is_complete() {
                break;
            }
            // Values that are in one message.
            let at = sample.wrapping_mul(channels);
            run.push(&Sample::Host(samples.values, at), board, out);
            self.meter();
        }
        let run = self.phase.run();
        let taken = run.map(Run::taken).ok_or(Problem::missing(Item::Run, 0))?;
        self.end_if_complete(board, out);
        Ok(taken)
    }

    /// Ends the run, or repeats the summary of the one that has ended.
    pub(super) fn stop(&mut self, board: &mut impl Board) -> Result<Summary, Problem> {
        if let Phase::SetUp(_, Activity::Running(_)) = self.phase
            && let Some(summary) = self.conclude(Outcome::Stopped, board)
        {
            return Ok(summary);
        }
        let ended = self.phase.session().and_then(|session| session.ended);
        let run = ended.ok_or(Problem::missing(Item::Summary, 0))?.start.run;
        let at = usize::from(run);
        let summary = self.summaries.get(at).copied().flatten();
        summary.ok_or(Problem::missing(Item::Summary, at))
    }

    /// Discards the run, unless it is one of a self-test.
    pub(super) fn abort(&mut self, board: &mut impl Board) {
        if let Phase::SetUp(_, activity @ Activity::Running(_)) = &mut self.phase {
            activity.leave_run();
            self.stop_unused_inputs(board);
        }
    }

    /// Ends the run if it has all its samples, and reports its end.
    pub(super) fn end_if_complete(&mut self, board: &mut impl Board, out: &mut impl Transmit) {
        if self.phase.run().is_some_and(Run::is_complete) {
            self.end_run(Outcome::Limit, board, out);
        }
    }

    /// Ends the run without a request, and reports its end.
    pub(super) fn end_run(
        &mut self,
        outcome: Outcome,
        board: &mut impl Board,
        out: &mut impl Transmit,
    ) {
        if let Some(summary) = self.conclude(outcome, board) {
            out.event(&Event::RunEnded(summary));
        }
    }

    /// Ends the run and keeps its results.
    fn conclude(&mut self, outcome: Outcome, board: &mut impl Board) -> Option<Summary> {
        let run = self.phase.run_mut()?;
        let number = usize::from(run.start.run);
        let ended = Ended {
            start: run.start,
            taken: run.taken(),
        };
        let (summary, peaks) = run.finish(outcome, self.identity.tick_hz);
        let stored = run.storage.runs.mask();
        if let Some(activity) = self.phase.activity_mut() {
            activity.leave_run();
        }
        if let Some(session) = self.phase.session_mut() {
            session.ended = Some(ended);
            session.stored = stored;
        }
        if let Some(peaks) = &peaks {
            self.setup.set_peaks(number, peaks);
        }
        if let Some(slot) = self.summaries.get_mut(number) {
            *slot = Some(summary);
        }
        self.stop_unused_inputs(board);
        Some(summary)
    }

    /// Sends lines of a stored run.
    #[inline(never)]
    pub(super) fn read_lines(
        &self,
        id: u16,
        read: &ReadLines,
        out: &mut impl Transmit,
    ) -> Result<(), Problem> {
        let at = self.run_index(read.run)?;
        let Some(storage) = self.phase.storage() else {
            return self.phase.not_busy();
        };
        let count = match (self.phase.session(), storage.runs.kept(at)) {
            (Some(session), Some(_)) => session.lines.settings.grid().count,
            _ => return Err(Problem::missing(Item::Run, at)),
        };
        let first = usize::from(read.first);
        if first >= count {
            return Err(Problem::index(Item::Line, usize::from(read.first), count));
        }
        let wanted = usize::from(read.count).min(Lines::FIT).min(count - first);
        let lines: heapless::Vec<Line, { Lines::FIT }> = (first..first + wanted)
            .filter_map(|line| storage.runs.line(at, line))
            .collect();
        let reply = Reply::Lines(Lines {
            run: read.run,
            first: read.first,
            lines: Packed::new(&lines),
        });
        out.reply(id, &reply);
        Ok(())
    }
}

impl Ended {
    /// `true` if the run has these samples, or all that it was started for, so that it would
    /// have taken them as it did before. A request whose reply was lost comes again.
    fn has(&self, samples: &Samples<'_>) -> bool {
        let Some(count) = samples.count() else {
            return false;
        };
        let Self { start, taken } = self;
        let is_full = start.limit.is_some_and(|limit| taken.next >= limit);
        let joins = start.gaps == Gaps::Count || samples.first <= taken.next;
        let end = samples.first.checked_add(count as u64);
        start.source == Source::Host
            && (is_full && joins && end.is_some() || end.is_some_and(|end| end <= taken.next))
    }
}

/// Prepares a run in the storage: its channels, its geometry, the source of its samples. Where
/// it returns a problem, no run was begun.
#[inline(never)]
pub(super) fn prepare(
    setup: &SetUp,
    lines: &setup::Lines,
    inputs: usize,
    start: &Start,
    storage: &mut Storage<'_>,
    board: &mut impl Board,
) -> Result<Prepared, Problem> {
    let number = setup.run_index(start.run)?;
    if start.limit == Some(0) {
        return Err(Problem::range(Field::Limit, 0, 0.0, [1.0, u64::MAX as f64]));
    }
    storage.scratch.clear_for_run();
    let room = storage.scratch.run_mut();
    let room = room.ok_or(Problem::Busy(Request::Start(*start).number()))?;
    let task = match start.pass {
        Pass::Survey => {
            let modes = lines.modes.ok_or(Problem::missing(Item::ModeBand, 0))?;
            let accelerometers = setup.arrangement().accelerometers();
            Task::Survey(Survey::new(accelerometers, modes.indices(), SUMS)?)
        }
        Pass::Measure => {
            setup.may_measure(number)?;
            let accelerations = setup.accelerations();
            setup.geometry(number, accelerations, &mut room.geometry)?;
            Task::Measure(accelerations)
        }
    };
    route(setup, number, start.source, board, room)?;
    let rings = Rings::new(lines.settings, 1 + RESULTANTS, &mut room.history);
    // `EndSetup` has seen that blocks fit.
    let rings = rings.map_err(|_| {
        Problem::capacity(Item::Sample, lines.settings.transform_length(), TRANSFORM)
    })?;
    let feed = match start.source {
        Source::Host => Feed::Host,
        Source::Inputs => {
            if inputs == 0 {
                return Err(Problem::Unsupported(Item::Source));
            }
            if room.channels.count() > inputs {
                return Err(Problem::capacity(
                    Item::Input,
                    room.channels.count(),
                    inputs,
                ));
            }
            board.start_inputs(setup.sample_rate(), Conditions::default())?;
            Feed::Inputs { origin: None }
        }
        Source::Synthetic => Feed::Synthetic(Synthetic::new(setup.arrangement(), number)),
    };
    Ok(Prepared {
        lines: lines.clone(),
        rings,
        task,
        feed,
    })
}

/// Readies the channels of a run.
fn route(
    setup: &SetUp,
    run: usize,
    source: Source,
    board: &impl Board,
    room: &mut Averaging,
) -> Result<(), Problem> {
    let arrangement = setup.arrangement();
    let Averaging {
        channels,
        alignment,
        ..
    } = room;
    alignment.clear();
    channels.begin(arrangement.sensors());
    let rate = setup.sample_rate() as f32;
    let mut first = None;
    for (number, code) in arrangement.channels(run).iter().enumerate() {
        let carries = ChannelRole::from_code(*code);
        let scale = match carries {
            ChannelRole::Sensor(sensor) => arrangement.scale(usize::from(sensor)),
            ChannelRole::Drive | ChannelRole::Unused => Some(calibration::Scale::ONE),
        };
        let channel = match (scale, source) {
            // Counts of the converters are watched, wherever their calibration comes from.
            (Some(scale), Source::Inputs) => {
                let input = stored(board, number)?;
                // Boards leave out inputs that nothing is wired to.
                if carries != ChannelRole::Unused && input.circuit() == Circuit::Unused {
                    return Err(Problem::missing(Item::Input, number));
                }
                Channel::watched(scale, Watch::new(input.limits(), rate))
            }
            (Some(scale), _) => Channel::unwatched(scale),
            (None, Source::Synthetic) => Channel::unwatched(calibration::Scale::ONE),
            (None, _) => stored(board, number)?.channel(rate),
        };
        let place = channels.add(carries, channel);
        if source == Source::Inputs
            && carries != ChannelRole::Unused
            && let Some(own) = board.lowpass(number, setup.sample_rate())
        {
            let others = *first.get_or_insert(own);
            if own != others && !alignment.add(place, own, others, setup.sample_rate()) {
                return Err(Problem::Unsupported(Item::Input));
            }
        }
    }
    Ok(())
}

/// The certificate of an input, out of the settings.
fn stored(board: &impl Board, input: usize) -> Result<Certificate, Problem> {
    match board.setting(SettingKey::Input(input as u8))? {
        Setting::Input(input) => Certificate::new(&input),
        _ => Err(Problem::Unsupported(Item::Setting)),
    }
}
