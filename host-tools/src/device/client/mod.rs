//! A conversation with a box: requests out, each with its one reply, events beside them.
//!
//! A reply that does not come in time is asked for again, which the protocol allows
//! ([`massline_firmware::wire`], rule 2). What was lost is known to the frame.

mod check;
mod error;
mod info;
mod samples;

pub use error::ClientError;
pub use info::BoxInfo;
pub use samples::{SampleSource, StreamError};

use super::Port;
use crate::inputs::InputEntry;
use crate::limits::{self, ATTEMPTS};
use crate::printable::steers;
use massline_firmware::calibration::Certificate;
use massline_firmware::wire::{
    BODY_MAX, Event, FRAME_MAX, FromBox, Identified, Input, LinkCounters, Ping, Problem, Question,
    Received, Receiver, Refusal, Reply, Request, RequestIds, Selftest, Sender, Setting, SettingKey,
    Status, Summary, ToHost,
};
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::{Duration, Instant, SystemTime};

/// Memory that a [`Client`] is lent.
#[derive(Debug)]
pub struct ClientMemory {
    body: [u8; BODY_MAX],
}

impl ClientMemory {
    /// All zero.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            body: [0; BODY_MAX],
        }
    }
}

impl Default for ClientMemory {
    fn default() -> Self {
        Self::new()
    }
}

/// Counters of the link, as this side knows them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkReport {
    /// Frames that were sent.
    pub sent: u32,
    /// Frames that were sent again, because no reply came in time or because the
    /// box missed one before them.
    pub resent: u32,
    /// Replies that came when nobody waited for them any more.
    pub late: u32,
    /// Counters of the box's frames; `lost` is exact up to the last one that came.
    pub received: LinkCounters,
}

/// Listener to events, with the time when they came, s.
type Listener<'c> = Box<dyn FnMut(&Event<'_>, f64) + 'c>;

/// A conversation with a box over a port.
pub struct Client<'c, P> {
    port: P,
    sender: Sender,
    ids: RequestIds,
    receiver: Receiver<'c, ToHost>,
    /// Bytes that have come, of which the first `taken` were read.
    input: Vec<u8>,
    taken: usize,
    on_event: Listener<'c>,
    /// When the bytes in `input` came, s.
    arrived: f64,
    patience: Duration,
    resent: u32,
    late: u32,
}

/// Outcome of waiting for a reply.
enum Waited<T> {
    /// The caller took a reply.
    Taken(T),
    /// Time is up.
    Silence,
    /// The box is another one than before.
    Restarted,
}

/// Messages that came while a reply was waited for.
enum Heard<T> {
    /// The reply.
    Reply(Result<T, ClientError>),
    /// The box says whether it is still at work on the request.
    Working(bool),
}

/// Sessions of this program, so that two clients in a row differ.
fn fresh_session() -> u16 {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    let clock = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .map_or(0, |t| t.as_millis() as u16);
    let _ = NEXT.compare_exchange(0, clock, Ordering::Relaxed, Ordering::Relaxed);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

impl<'c, P: Port> Client<'c, P> {
    /// A conversation that has not begun: [`Self::hello`] begins it.
    pub fn new(port: P, memory: &'c mut ClientMemory) -> Self {
        let patience = port.patience();
        Self {
            port,
            sender: Sender::new(fresh_session()),
            ids: RequestIds::new(),
            receiver: Receiver::new(&mut memory.body),
            input: Vec::new(),
            taken: 0,
            on_event: Box::new(|_, _| ()),
            arrived: 0.0,
            patience,
            resent: 0,
            late: 0,
        }
    }

    /// Has every event that comes shown to `listener`, from now on, whenever this client
    /// waits for anything; with the time when it came, s ([`Port::seconds`]).
    pub fn on_event(&mut self, listener: impl FnMut(&Event<'_>, f64) + 'c) {
        self.on_event = Box::new(listener);
    }

    /// Counters of the link so far. Frames lost at the very end show only after
    /// another one: see [`Self::ping`].
    #[must_use]
    pub fn link(&self) -> LinkReport {
        LinkReport {
            sent: self.sender.produced(),
            resent: self.resent,
            late: self.late,
            received: *self.receiver.counters(),
        }
    }

    /// The end of the link.
    pub const fn port(&mut self) -> &mut P {
        &mut self.port
    }

    /// Asks `request` and waits for its reply, of which `read` takes what it wants, or
    /// nothing if it is of the wrong kind. Asks again if no reply comes.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn ask<T>(
        &mut self,
        request: &Request<'_>,
        mut read: impl FnMut(&Reply<'_>) -> Option<T>,
    ) -> Result<T, ClientError> {
        let id = self.ids.fresh();
        let number = request.number();
        let started = Instant::now();
        let (mut attempts, mut polls, mut poll) = (1, 0, None);
        self.send(id, request)?;
        loop {
            let heard = self.wait(number, self.patience, |found, reply| match reply {
                Reply::Status(status) if Some(found) == poll => {
                    Some(Heard::Working(status.busy == Some(number)))
                }
                _ if found != id => None,
                // The first of two requests is still worked at; its reply will come.
                Reply::Error(refused) if refused.problem == Problem::Busy(number) => None,
                Reply::Error(refused) => Some(Heard::Reply(Err(ClientError::Refused(*refused)))),
                reply => {
                    let checked = check::reply(number, reply);
                    let taken = checked.and_then(|()| {
                        read(reply).ok_or(ClientError::Unexpected {
                            request: number,
                            reply: reply.number(),
                        })
                    });
                    Some(Heard::Reply(taken))
                }
            })?;
            let worked = started.elapsed();
            match heard {
                // A box that is busy for ever would be asked for ever.
                Waited::Silence | Waited::Taken(Heard::Working(true))
                    if takes_long(request) && worked > self.port.longest_work() =>
                {
                    return Err(ClientError::Busy {
                        request: number,
                        seconds: worked.as_secs_f64(),
                    });
                }
                Waited::Taken(Heard::Reply(reply)) => return reply,
                Waited::Taken(Heard::Working(true)) => polls = 0,
                Waited::Restarted => return Err(self.restarted(number)),
                Waited::Silence if takes_long(request) && polls < ATTEMPTS => {
                    polls += 1;
                    let id = self.ids.fresh();
                    poll = Some(id);
                    self.send(id, &Request::Status)?;
                }
                // It does not say either whether it is at work: it is gone, or the link is.
                Waited::Silence if takes_long(request) => {
                    return Err(self.silent(number, attempts + polls, started));
                }
                Waited::Silence | Waited::Taken(Heard::Working(false)) if attempts < ATTEMPTS => {
                    (attempts, polls) = (attempts + 1, 0);
                    self.resent += 1;
                    self.send(id, request)?;
                }
                Waited::Silence | Waited::Taken(Heard::Working(false)) => {
                    return Err(self.silent(number, attempts, started));
                }
            }
        }
    }

    /// Asks for something that is merely done.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn tell(&mut self, request: &Request<'_>) -> Result<(), ClientError> {
        self.ask(request, |reply| matches!(reply, Reply::Done).then_some(()))
    }

    /// Asks the box for its identity.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn hello(&mut self) -> Result<BoxInfo, ClientError> {
        self.ask(&Request::Hello, |reply| match reply {
            Reply::Info(info) => Some(BoxInfo::from(info)),
            _ => None,
        })
    }

    /// Is somebody there? Also makes frames known that were lost just before.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn ping(&mut self, stamp: u64) -> Result<massline_firmware::wire::Pong, ClientError> {
        self.ask(&Request::Ping(Ping { stamp }), |reply| match reply {
            Reply::Pong(pong) => Some(*pong),
            _ => None,
        })
    }

    /// Asks the box for its state.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn status(&mut self) -> Result<Status, ClientError> {
        self.ask(&Request::Status, |reply| match reply {
            Reply::Status(status) => Some(*status),
            _ => None,
        })
    }

    /// The inputs that something is wired to, of the first `inputs`.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn wired_inputs(&mut self, inputs: u8) -> Result<Vec<InputEntry>, ClientError> {
        let mut wired = Vec::new();
        let started = Instant::now();
        for input in 0..inputs {
            if started.elapsed() > limits::READING_SETTINGS {
                return Err(ClientError::Slow {
                    port: self.port.name(),
                    read: input,
                    inputs,
                    seconds: started.elapsed().as_secs_f64(),
                });
            }
            let key = SettingKey::Input(input);
            let entry = self.ask(&Request::ReadSetting(key), |reply| match reply {
                Reply::Setting(Setting::Input(found)) if found.input == input => {
                    // It was checked when it came; texts show as they stand.
                    let [serial, certificate] = [found.serial, found.certificate].map(shown);
                    let found = Input {
                        serial: &serial,
                        certificate: &certificate,
                        ..*found
                    };
                    Some(InputEntry {
                        input,
                        channel: None,
                        certificate: Certificate::new(&found).ok()?,
                    })
                }
                _ => None,
            })?;
            if entry.is_used() {
                wired.push(entry);
            }
        }
        Ok(wired)
    }

    /// Ends the run.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn stop(&mut self) -> Result<Summary, ClientError> {
        self.ask(&Request::Stop, |reply| match reply {
            Reply::Summary(summary) => Some(*summary),
            _ => None,
        })
    }

    /// The summary of a finished run, by its number from zero.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn summary(&mut self, run: u8) -> Result<Summary, ClientError> {
        self.ask(&Request::ReadSummary(run), |reply| match reply {
            Reply::Summary(summary) => Some(*summary),
            _ => None,
        })
    }

    /// Identifies from the stored runs.
    ///
    /// # Errors
    /// [`ClientError`], among them [`Problem::NoAnswer`] with the reason.
    pub fn identify(&mut self, question: Question) -> Result<Identified, ClientError> {
        self.ask(&Request::Identify(question), |reply| match reply {
            Reply::Identified(identified) => Some(*identified),
            _ => None,
        })
    }

    /// Runs the synthetic body through the box.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn selftest(&mut self) -> Result<Selftest, ClientError> {
        self.ask(&Request::Selftest, |reply| match reply {
            Reply::Selftest(selftest) => Some(*selftest),
            _ => None,
        })
    }

    /// Shows events to the listener for some time.
    ///
    /// # Errors
    /// [`ClientError::Port`], or [`ClientError::Version`].
    pub fn listen(&mut self, time: Duration) -> Result<(), ClientError> {
        let nothing = |_: u16, _: &Reply<'_>| None::<()>;
        self.wait(Request::Status.number(), time, nothing).map(drop)
    }

    /// The box is another one than before: it is asked why, unless that was the question.
    fn restarted(&mut self, request: u8) -> ClientError {
        let info = if request == Request::Hello.number() {
            None
        } else {
            self.hello().ok()
        };
        ClientError::Restarted {
            request,
            reset: info.as_ref().map(|info| info.reset),
            panic: info.and_then(|info| info.panic),
        }
    }

    fn silent(&self, request: u8, attempts: u32, since: Instant) -> ClientError {
        ClientError::Silent {
            port: self.port.name(),
            request,
            attempts,
            waited: since.elapsed(),
            heard: self.receiver.counters().frames > 0,
        }
    }

    /// Sends one request.
    fn send(&mut self, id: u16, request: &Request<'_>) -> Result<(), ClientError> {
        let mut frame = [0; FRAME_MAX];
        let frame = self.sender.request(id, request, &mut frame);
        let frame = frame.map_err(|source| ClientError::Encode {
            request: request.number(),
            source,
        })?;
        Ok(self.port.send(frame)?)
    }

    /// Reads what comes until `take` takes a reply, but no longer than `patience`.
    fn wait<T>(
        &mut self,
        request: u8,
        patience: Duration,
        mut take: impl FnMut(u16, &Reply<'_>) -> Option<T>,
    ) -> Result<Waited<T>, ClientError> {
        let deadline = Instant::now() + patience;
        let mut looked = false;
        loop {
            // What is left of an earlier chunk counts as looked at, too.
            looked = looked || self.taken < self.input.len();
            let mut rest = self.input.get(self.taken..).unwrap_or(&[]);
            let restarts = self.receiver.counters().restarts;
            let received = self.receiver.next(&mut rest);
            self.taken = self.input.len() - rest.len();
            match received {
                Some(Received::Message(_, FromBox::Event(event))) => {
                    (self.on_event)(&event, self.arrived);
                }
                Some(Received::Message(header, FromBox::Reply(reply))) => {
                    match take(header.request, &reply) {
                        Some(taken) => return Ok(Waited::Taken(taken)),
                        None => self.late = self.late.saturating_add(1),
                    }
                }
                Some(Received::Refused(_, Refusal::Version { found })) => {
                    return Err(ClientError::Version { found });
                }
                Some(Received::Refused(header, _)) if header.request != 0 => {
                    return Err(ClientError::Unexpected {
                        request,
                        reply: header.number,
                    });
                }
                // An event of a newer box: nothing depends on it.
                Some(Received::Refused(..)) => {}
                None => {
                    self.input.clear();
                    self.taken = 0;
                    let left = deadline.saturating_duration_since(Instant::now());
                    // A box that talks without end must not keep us here either.
                    if looked && left.is_zero() {
                        return Ok(Waited::Silence);
                    }
                    looked = true;
                    if self.port.receive(&mut self.input, left)? == 0 {
                        return Ok(Waited::Silence);
                    }
                    self.arrived = self.port.seconds();
                }
            }
            if self.receiver.counters().restarts > restarts {
                return Ok(Waited::Restarted);
            }
            // One chunk may hold many messages, and each may have the listener do much.
            if looked && Instant::now() > deadline {
                return Ok(Waited::Silence);
            }
        }
    }
}

/// A text of at most as many bytes that shows as it stands: a character that steers a terminal
/// becomes a question mark.
fn shown(text: &str) -> String {
    text.replace(steers, "?")
}

/// Requests whose replies take seconds.
const fn takes_long(request: &Request<'_>) -> bool {
    matches!(request, Request::Identify(_) | Request::Selftest)
}
