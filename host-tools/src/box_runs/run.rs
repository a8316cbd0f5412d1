//! One run of the box's inputs, from its start to its summary.

use super::{BoxRunError, BoxTest};
use crate::device::{Client, Port};
use crate::limits;
use crate::measure::Rejected;
use massline_firmware::wire::{
    Event, Fault, Gaps, Health, Outcome, Pass, RESULTANTS, Request, Source, Start, Subscription,
    Summary,
};
use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Time between two looks at the progress of a run.
const LOOK: Duration = Duration::from_millis(100);
/// Milliseconds between two looks at the levels.
const LEVELS: u16 = 500;

/// The person next to the shaker.
pub trait Operator {
    /// A run is next: returns when the table shakes.
    ///
    /// # Errors
    /// The reason why it cannot be shaken, in the words of a user.
    fn shake(&mut self, stage: &Stage<'_>) -> Result<(), BoxRunError>;

    /// Takes the progress, some times a second; `false` ends the run.
    fn watch(&mut self, stage: &Stage<'_>, progress: &Progress) -> bool;

    /// A run has ended.
    fn ended(&mut self, stage: &Stage<'_>, ended: &Ended);
}

/// A run that is next, or going on.
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a> {
    /// Its number in the set-up, from zero.
    pub number: usize,
    /// Its name.
    pub name: &'a str,
    /// Survey or measurement.
    pub pass: Pass,
    /// Number of this step, from one.
    pub step: usize,
    /// All steps.
    pub steps: usize,
}

/// Progress of a run.
#[derive(Clone, Debug, Default)]
pub struct Progress {
    /// Seconds of samples.
    pub seconds: f64,
    /// Blocks in the average.
    pub averaged: u32,
    /// Blocks left out, and why.
    pub rejected: Rejected,
    /// Coherence of the twelve resultants with the drive.
    pub coherence: Option<[f32; RESULTANTS]>,
    /// Channels with their faults now.
    pub faulty: Vec<(String, Health)>,
    /// The channel that takes the largest share of its range, and that share.
    pub fullest: Option<(String, f64)>,
    /// Faults of the box since the last look.
    pub faults: Vec<Fault>,
}

/// A run that has ended.
#[derive(Clone, Copy, Debug)]
pub struct Ended {
    /// Summary of the box.
    pub summary: Summary,
    /// Nominal sample rate, Hz.
    pub rate: f64,
}

/// Events of a run.
struct Heard {
    /// Channel by channel: name and range, where there is one.
    channels: Vec<Option<(String, f64)>>,
    stage: (u8, Pass),
    progress: Progress,
}

impl Heard {
    fn take(&mut self, event: &Event<'_>) {
        let Self {
            channels,
            stage,
            progress,
        } = self;
        match event {
            Event::Block(block) if (block.run, block.pass) == *stage => {
                progress.averaged = block.averaged;
                progress.coherence = block.coherence.or(progress.coherence);
                if !block.health.is_good() {
                    progress.rejected.blocks += 1;
                    for (kind, blocks) in progress.rejected.by_fault.iter_mut().enumerate() {
                        *blocks += u32::from(block.health.contains(Health(1 << kind)));
                    }
                }
            }
            Event::Health(all) => {
                let faults = channels.iter().zip(all.channels.iter());
                let named = faults.filter_map(|(c, faults)| Some((c.as_ref()?, Health(faults))));
                let faulty = named.filter(|(_, health)| !health.is_good());
                progress.faulty = faulty.map(|((name, _), h)| (name.clone(), h)).collect();
            }
            Event::Levels(levels) => {
                let peaks = channels.iter().zip(levels.peak.iter());
                let named = peaks.filter_map(|(c, peak)| Some((c.as_ref()?, f64::from(peak))));
                let used = named.map(|((name, range), peak)| (name, peak / range));
                let used = used.filter(|(_, share)| share.is_finite());
                let fullest = used.max_by(|a, b| a.1.total_cmp(&b.1));
                progress.fullest = fullest.map(|(name, share)| (name.clone(), share));
            }
            Event::Fault(fault) if progress.faults.len() < limits::LISTED_FAULTS => {
                progress.faults.push(*fault);
            }
            _ => {}
        }
    }
}

/// Has the box take a run. One of the same number that it is at already is taken up.
pub(super) fn run<P: Port>(
    test: &BoxTest<'_>,
    client: &mut Client<'_, P>,
    stage: &Stage<'_>,
    seconds: Option<f64>,
    operator: &mut dyn Operator,
) -> Result<Summary, BoxRunError> {
    let mut channels = Vec::new();
    for (entry, name, range) in test.wiring.inputs(test.setup, stage.number) {
        let input = usize::from(entry.input);
        if channels.len() <= input {
            channels.resize(input + 1, None);
        }
        channels[input] = Some((name.to_owned(), range));
    }
    let own = (stage.number as u8, stage.pass);
    let running = client.status()?.running;
    let goes_on = running.is_some_and(|r| (r.run, r.pass) == own && r.source == Source::Inputs);
    if !goes_on {
        client.tell(&Request::Abort)?;
        operator.shake(stage)?;
    }
    let heard = Rc::new(RefCell::new(Heard {
        channels,
        stage: own,
        progress: Progress::default(),
    }));
    let theirs = Rc::clone(&heard);
    client.on_event(move |event, _| theirs.borrow_mut().take(event));
    client.tell(&Request::Subscribe(Subscription {
        levels: LEVELS,
        ..Subscription::default()
    }))?;
    if !goes_on {
        client.tell(&Request::Start(Start {
            run: own.0,
            pass: own.1,
            source: Source::Inputs,
            gaps: Gaps::Count,
            limit: seconds.map(|s| ((s * test.rate).round() as u64).max(1)),
        }))?;
    }
    let summary = attend(test, client, stage, seconds, &heard, operator);
    client.on_event(|_, _| ());
    let summary = summary?;
    client.tell(&Request::Subscribe(Subscription::default()))?;
    let ended = Ended {
        summary,
        rate: test.rate,
    };
    operator.ended(stage, &ended);
    Ok(summary)
}

fn attend<P: Port>(
    test: &BoxTest<'_>,
    client: &mut Client<'_, P>,
    stage: &Stage<'_>,
    seconds: Option<f64>,
    heard: &RefCell<Heard>,
    operator: &mut dyn Operator,
) -> Result<Summary, BoxRunError> {
    let started = Instant::now();
    let mut last = (0, started);
    loop {
        client.listen(LOOK)?;
        let running = client.status()?.running;
        let running = running.filter(|r| (r.run, r.pass) == heard.borrow().stage);
        if let Some(running) = running
            && running.next > last.0
        {
            last = (running.next, Instant::now());
            heard.borrow_mut().progress.seconds = running.next as f64 / test.rate;
        }
        let mut progress = heard.borrow().progress.clone();
        heard.borrow_mut().progress.faults.clear();
        let Some(running) = running else {
            progress.seconds = progress.seconds.max(0.0);
            operator.watch(stage, &progress);
            // The event of the run's end may be lost, and only replies are checked.
            return Ok(client.summary(stage.number as u8)?);
        };
        if !operator.watch(stage, &progress) {
            return Ok(client.stop()?);
        }
        let elapsed = started.elapsed().as_secs_f64();
        if seconds.is_some_and(|wanted| elapsed > limits::overtime(wanted)) {
            client.tell(&Request::Abort)?;
            return Err(BoxRunError::Overtime {
                run: stage.name.to_owned(),
                seconds: elapsed,
            });
        }
        if last.1.elapsed() > limits::SILENCE {
            client.tell(&Request::Abort)?;
            return Err(BoxRunError::Silence {
                run: stage.name.to_owned(),
                seconds: last.1.elapsed().as_secs_f64(),
            });
        }
        debug_assert_eq!(running.run, stage.number as u8);
    }
}

impl Ended {
    /// `true` if the box ended it for a fault of its own.
    #[must_use]
    pub fn failed(&self) -> bool {
        self.summary.outcome == Outcome::Fault
    }

    /// Blocks that were left out.
    #[must_use]
    pub fn rejected(&self) -> Rejected {
        Rejected {
            blocks: self.summary.rejected,
            by_fault: self.summary.rejected_by,
            samples: 0,
            missing: self.summary.missing,
        }
    }
}
