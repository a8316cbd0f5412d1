//! The conversation while samples come.

use super::AcquireError;
use super::pace::Pace;
use crate::device::{Client, ClientError, Port};
use crate::limits;
use massline_firmware::wire::{
    Event, Fault, Reply, Request, Setting, SettingKey, Stream, Subscription,
};
use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Time between two checks of link and receiver.
const LOOK: Duration = Duration::from_millis(100);

/// Receiver of samples and events.
pub(super) trait Taker {
    /// Takes an event that came at a time, s. Whether it had samples.
    fn take(&mut self, event: &Event<'_>, seconds: f64) -> Result<bool, AcquireError>;

    /// Takes a fault of the box.
    fn fault(&mut self, fault: &Fault);

    /// `true` if it needs no more samples.
    fn is_done(&self) -> bool;
}

/// Stream that is followed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Course {
    /// The rate that the converters are set to, Hz.
    pub(super) rate: f64,
    /// The length that is wanted, s of samples; `None`: until it is ended.
    pub(super) seconds: Option<f64>,
}

/// State of a stream.
struct Fate {
    problem: Option<AcquireError>,
    pace: Pace,
    /// `true` if samples have come since the last check.
    came: bool,
}

/// Rate at which the box's settings have its converters sample, Hz.
pub(crate) fn sample_rate<P: Port>(client: &mut Client<'_, P>) -> Result<f64, ClientError> {
    let key = Request::ReadSetting(SettingKey::SampleRate);
    client.ask(&key, |reply| match reply {
        Reply::Setting(Setting::SampleRate(rate)) => Some(*rate),
        _ => None,
    })
}

/// Has the box send its samples to `taker` until that has all it wants, `watch` says `false`,
/// or something goes wrong.
pub(super) fn follow<'c, P: Port, T: Taker + 'c>(
    client: &mut Client<'c, P>,
    course: Course,
    taker: &Rc<RefCell<T>>,
    watch: &mut dyn FnMut(&mut T) -> bool,
) -> Result<(), AcquireError> {
    let fate = Rc::new(RefCell::new(Fate {
        problem: None,
        pace: Pace::new(course.rate),
        came: false,
    }));
    let (theirs, told) = (Rc::clone(taker), Rc::clone(&fate));
    client.on_event(move |event, seconds| {
        let (mut taker, mut fate) = (theirs.borrow_mut(), told.borrow_mut());
        if fate.problem.is_some() || taker.is_done() {
            return;
        }
        if let Event::Fault(fault) = event {
            taker.fault(fault);
        }
        let taken = fate.pace.take(event, seconds);
        match taken.and_then(|()| taker.take(event, seconds)) {
            Ok(came) => fate.came |= came,
            Err(problem) => fate.problem = Some(problem),
        }
    });
    let mut result = attend(client, course, taker, &fate, watch);
    // The last samples come with its answer. A box that is gone cannot be told.
    let gone = matches!(result, Err(AcquireError::Client(_) | AcquireError::Reset));
    if !gone && let Err(error) = client.tell(&Request::Subscribe(Subscription::default())) {
        result = result.and(Err(error.into()));
    }
    client.on_event(|_, _| ());
    let problem = fate.borrow_mut().problem.take();
    problem.map_or(result, Err)
}

fn attend<P: Port, T: Taker>(
    client: &mut Client<'_, P>,
    course: Course,
    taker: &RefCell<T>,
    fate: &RefCell<Fate>,
    watch: &mut dyn FnMut(&mut T) -> bool,
) -> Result<(), AcquireError> {
    client.tell(&Request::Subscribe(Subscription {
        samples: Stream::Counts,
        ..Subscription::default()
    }))?;
    let restarts = client.link().received.restarts;
    let mut last = Instant::now();
    loop {
        client.listen(LOOK)?;
        let (mut taker, mut fate) = (taker.borrow_mut(), fate.borrow_mut());
        let more = watch(&mut taker);
        if fate.problem.is_some() || taker.is_done() || !more {
            return Ok(());
        }
        if client.link().received.restarts > restarts {
            return Err(AcquireError::Reset);
        }
        if std::mem::take(&mut fate.came) {
            last = Instant::now();
        }
        fate.pace.check(course.seconds)?;
        if last.elapsed() > limits::SILENCE {
            let seconds = last.elapsed().as_secs_f64();
            return Err(AcquireError::Silence { seconds });
        }
    }
}
