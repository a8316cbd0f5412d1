//! A run from its start to its end, and its lines afterwards.

use super::limits::range;
use super::memory::SUMS;
use super::readings::{Channels, Sample};
use super::requests::missing;
use super::run::{Run, Task};
use super::setup::SetUp;
use super::survey::Survey;
use super::synthetic::Synthetic;
use super::{Board, Ended, Instrument, Transmit};
use crate::calibration::{self, Certificate, Channel, Watch};
use crate::wire::{
    Carries, Circuit, Field, Gaps, Item, Line, Lines, Outcome, Packed, Pass, Problem, ReadLines,
    Reply, Request, Samples, Setting, SettingKey, Source, Start, State, Taken,
};

impl Instrument<'_> {
    pub(super) fn start(&mut self, start: &Start, board: &mut impl Board) -> Result<(), Problem> {
        let same = self.run.as_ref().is_some_and(|run| run.start == *start);
        if same && self.state == State::Running {
            return Ok(());
        }
        self.only(State::Ready)?;
        self.not_busy()?;
        self.begin(start, board)
    }

    /// Begins a run.
    #[inline(never)]
    pub(super) fn begin(&mut self, start: &Start, board: &mut impl Board) -> Result<(), Problem> {
        let number = self.setup.run_index(start.run)?;
        if start.limit == Some(0) {
            return Err(range(Field::Limit, 0, 0.0, 1.0, u64::MAX as f64));
        }
        let Some(lines) = self.lines.clone() else {
            return self.only(State::SettingUp);
        };
        // They are lent to a run, and there is none.
        let Some(buffers) = &mut self.buffers else {
            return self.only(State::Ready);
        };
        buffers.scratch.clear_for_run();
        let Some(room) = buffers.scratch.run_mut() else {
            return self.only(State::Ready);
        };
        let task = match start.pass {
            Pass::Survey => {
                let modes = lines.modes.ok_or(missing(Item::ModeBand, 0))?;
                let room = SUMS;
                Task::Survey(Survey::new(
                    self.setup.arrangement().accelerometers(),
                    modes.indices(),
                    room,
                )?)
            }
            Pass::Measure => {
                self.setup.may_measure(number)?;
                let accelerations = self.setup.accelerations();
                self.setup
                    .geometry(number, accelerations, &mut room.geometry)?;
                Task::Measure(accelerations)
            }
        };
        let channels = &mut room.channels;
        route(self.setup, number, start.source, board, channels)?;
        match start.source {
            Source::Host => {}
            Source::Inputs => {
                let inputs = usize::from(self.identity.inputs);
                if inputs == 0 {
                    return Err(Problem::Unsupported(Item::Source));
                }
                if channels.count() > inputs {
                    return Err(Problem::Capacity {
                        item: Item::Input,
                        found: channels.count() as u32,
                        limit: inputs as u32,
                    });
                }
                board.start_inputs(self.setup.sample_rate())?;
            }
            Source::Synthetic => {
                self.synthetic = Some(Synthetic::new(self.setup.arrangement(), number))
            }
        }
        // `end_setup` has seen that the blocks fit.
        self.run = self
            .buffers
            .take()
            .and_then(|buffers| Run::new(*start, lines, task, buffers));
        self.state = State::Running;
        Ok(())
    }

    /// Takes the samples of a request.
    pub(super) fn take(
        &mut self,
        samples: &Samples<'_>,
        board: &mut impl Board,
        out: &mut impl Transmit,
    ) -> Result<Taken, Problem> {
        let Some(run) = &mut self.run else {
            return match &self.ended {
                Some(ended) if ended.has(samples) => Ok(ended.taken),
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
        if samples.first > run.next() {
            if run.start.gaps == Gaps::Refuse {
                return Err(Problem::Gap {
                    found: samples.first,
                    expected: run.next(),
                });
            }
            run.skip_to(samples.first, out);
        }
        // Those that the box has are passed over. What is left to do is one message's samples
        // at the most, however far ahead or behind it is numbered.
        let known = run.next().saturating_sub(samples.first).min(count as u64);
        for sample in known as usize..count {
            let Some(run) = &mut self.run else { break };
            if run.is_complete() {
                break;
            }
            // Values that are in one message.
            let at = sample.wrapping_mul(channels);
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

    pub(super) fn stop(&mut self, board: &mut impl Board) -> Result<crate::wire::Summary, Problem> {
        if self.selftest.is_some() {
            // Its runs are its own: the host has none that could be stopped, or has ended.
            return Err(missing(Item::Summary, 0));
        }
        if let Some(summary) = self.conclude(Outcome::Stopped, board) {
            return Ok(summary);
        }
        let ended = self.ended.ok_or(missing(Item::Summary, 0))?;
        let at = usize::from(ended.start.run);
        let summary = self.summaries.get(at).copied().flatten();
        summary.ok_or(missing(Item::Summary, at))
    }

    #[inline(never)]
    pub(super) fn read_lines(
        &self,
        id: u16,
        read: &ReadLines,
        out: &mut impl Transmit,
    ) -> Result<(), Problem> {
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

    /// Throws the run away, unless it is one of a self-test, of which nobody knows.
    pub(super) fn abort(&mut self, board: &mut impl Board) {
        if self.selftest.is_none()
            && let Some(run) = self.run.take()
        {
            self.buffers = Some(run.into_buffers());
            self.synthetic = None;
            self.state = State::Ready;
            self.tend_inputs(board);
        }
    }
}

impl Ended {
    /// Whether a run that is over would have taken these samples as it did before: it has them,
    /// or it has all that it was started for. A request whose reply was lost comes again.
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

/// Readies the channels of a run.
fn route(
    setup: &SetUp,
    run: usize,
    source: Source,
    board: &impl Board,
    channels: &mut Channels,
) -> Result<(), Problem> {
    let arrangement = setup.arrangement();
    channels.begin(arrangement.sensors());
    let rate = setup.sample_rate() as f32;
    for (number, code) in arrangement.channels(run).iter().enumerate() {
        let carries = Carries::from_code(*code);
        let scale = match carries {
            Carries::Sensor(sensor) => arrangement.scale(usize::from(sensor)),
            Carries::Drive | Carries::Nothing => Some(calibration::Scale::ONE),
        };
        let channel = match (scale, source) {
            // What the converters deliver is watched, whoever says how it becomes SI.
            (Some(scale), Source::Inputs) => {
                let input = stored(board, number)?;
                // Boards leave out what nothing is wired to.
                if carries != Carries::Nothing && input.circuit() == Circuit::Unused {
                    return Err(missing(Item::Input, number));
                }
                Channel::watched(scale, Watch::new(input.limits(), rate))
            }
            (Some(scale), _) => Channel::unwatched(scale),
            (None, Source::Synthetic) => Channel::unwatched(calibration::Scale::ONE),
            (None, _) => stored(board, number)?.channel(rate),
        };
        channels.add(carries, channel);
    }
    Ok(())
}

/// What the settings say of an input.
fn stored(board: &impl Board, input: usize) -> Result<Certificate, Problem> {
    match board.setting(SettingKey::Input(input as u8))? {
        Setting::Input(input) => Certificate::new(&input),
        _ => Err(Problem::Unsupported(Item::Setting)),
    }
}
