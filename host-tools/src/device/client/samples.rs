//! A run's samples, sent ahead of their replies.
//!
//! As many requests as the box allows are on their way at a time. The run refuses gaps, so
//! the box says where it stands whenever it misses one, and sending goes back to there:
//! what it has already, it skips. After that many a lost frame costs a window's worth of
//! time and nothing else.

use super::{Client, ClientError, Waited};
use crate::device::Port;
use massline_firmware::wire::{
    Count24, Packed, Problem, Progress, Reply, Request, Samples, Values,
};
use std::collections::VecDeque;
use std::time::Instant;

/// Times in a row that a window may stay without any answer before the box counts as silent.
const SILENCES: u32 = 8;
/// Times in a row that sending may go back without a sample more being taken.
const RETREATS: u32 = 64;

/// Number of [`Request::Samples`].
const NUMBER: u8 = Request::Samples(Samples {
    first: 0,
    channels: 1,
    values: Values::Counts(Packed::new(&[])),
})
.number();

/// Source of samples: one after the other, all channels each, into `sample`; `false`
/// behind the last one.
pub trait SampleSource {
    /// Why there is no next sample.
    type Error;

    /// The next sample.
    ///
    /// # Errors
    /// The source's own.
    fn next(&mut self, sample: &mut [f32]) -> Result<bool, Self::Error>;
}

impl<E, F: FnMut(&mut [f32]) -> Result<bool, E>> SampleSource for F {
    type Error = E;

    fn next(&mut self, sample: &mut [f32]) -> Result<bool, E> {
        self(sample)
    }
}

/// Consecutive samples that go into one request.
#[derive(Clone, Debug, PartialEq)]
struct Chunk {
    first: u64,
    count: usize,
    values: Chunked,
}

#[derive(Clone, Debug, PartialEq)]
enum Chunked {
    Readings(Vec<f32>),
    /// Readings that are whole numbers of 24 bits: a converter's counts, a quarter shorter.
    Counts(Vec<Count24>),
}

/// The count that a reading is, if it is one to the last bit.
fn count(reading: f32) -> Option<Count24> {
    let whole = reading as i32;
    let same = (whole as f32).to_bits() == reading.to_bits();
    same.then(|| Count24::new(whole)).flatten()
}

impl Chunk {
    fn end(&self) -> u64 {
        self.first + self.count as u64
    }
}

/// Cuts samples into chunks.
struct Cutter<'s, S> {
    source: &'s mut S,
    channels: usize,
    next: u64,
    /// A sample that did not fit the chunk before.
    held: Option<Vec<f32>>,
    ended: bool,
}

impl<S: SampleSource> Cutter<'_, S> {
    fn sample(&mut self) -> Result<Option<Vec<f32>>, S::Error> {
        if let Some(held) = self.held.take() {
            return Ok(Some(held));
        }
        let mut sample = vec![0.0; self.channels];
        self.ended = self.ended || !self.source.next(&mut sample)?;
        Ok((!self.ended).then_some(sample))
    }

    fn chunk(&mut self) -> Result<Option<Chunk>, S::Error> {
        let channels = self.channels as u8;
        let (fit, fit_counts) = (Samples::fit(channels, 4), Samples::fit(channels, 3));
        let mut values: Vec<f32> = Vec::new();
        let mut counts: Option<Vec<Count24>> = Some(Vec::new());
        let mut rows = 0;
        while rows < fit_counts {
            let Some(sample) = self.sample()? else { break };
            let whole: Option<Vec<Count24>> = sample.iter().map(|&x| count(x)).collect();
            if rows >= fit && (counts.is_none() || whole.is_none()) {
                self.held = Some(sample);
                break;
            }
            counts = counts.zip(whole).map(|(mut all, new)| {
                all.extend(new);
                all
            });
            values.extend(sample);
            rows += 1;
        }
        let first = self.next;
        self.next += rows as u64;
        Ok((rows > 0).then(|| Chunk {
            first,
            count: rows,
            values: counts.map_or(Chunked::Readings(values), Chunked::Counts),
        }))
    }
}

/// Why samples did not reach the box.
#[derive(Debug, thiserror::Error)]
pub enum StreamError<E> {
    /// The box, or the way to it.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// The source of the samples.
    #[error("{0}")]
    Source(E),
}

/// Samples on their way.
struct Window {
    /// Not yet known to be taken, in their order.
    chunks: VecDeque<Chunk>,
    /// Number of `chunks` that were sent since sending last went back.
    sent: usize,
    /// Number of `chunks` that were ever sent.
    reached: usize,
    /// Ids of requests that are unanswered.
    open: Vec<u16>,
    /// The sample that the box expects next.
    next: u64,
}

impl Window {
    /// Takes note of what the box expects next. Whether it has a chunk more than before: it takes
    /// them whole.
    fn taken(&mut self, next: u64) -> Result<bool, ClientError> {
        let reached = self.sent.max(self.reached);
        let last = reached.checked_sub(1).and_then(|k| self.chunks.get(k));
        let end = last.map_or(self.next, Chunk::end);
        if next > end {
            return Err(ClientError::Ahead { next, end });
        }
        let first = self.chunks.front().map_or(self.next, |c| c.first);
        if next < first {
            return Err(ClientError::Behind { next, first });
        }
        self.next = self.next.max(next);
        let before = self.chunks.len();
        while self.chunks.front().is_some_and(|c| c.end() <= self.next) {
            self.chunks.pop_front();
            self.sent = self.sent.saturating_sub(1);
            self.reached = self.reached.saturating_sub(1);
        }
        Ok(self.chunks.len() < before)
    }
}

impl<P: Port> Client<'_, P> {
    /// Sends all samples of `source`, `channels` values each, to the run that is going on
    /// and was started with [`massline_firmware::wire::Gaps::Refuse`]. `first` is the index of
    /// the source's first sample; `window` is
    /// [`massline_firmware::wire::Capacity::window`]. `progress` is told the sample that the box
    /// expects next.
    ///
    /// # Errors
    /// [`StreamError`].
    pub fn stream<S: SampleSource>(
        &mut self,
        channels: u8,
        first: u64,
        window: u8,
        source: &mut S,
        progress: &mut dyn FnMut(u64),
    ) -> Result<u64, StreamError<S::Error>> {
        let mut cutter = Cutter {
            source,
            channels: usize::from(channels),
            next: first,
            held: None,
            ended: false,
        };
        let mut flight = Window {
            chunks: VecDeque::new(),
            sent: 0,
            reached: 0,
            open: Vec::new(),
            next: first,
        };
        let (mut silences, mut retreats, mut since) = (0, 0, Instant::now());
        // Samples behind a gap are refused one by one: sending goes back when the last of
        // the requests on their way is answered, not at each refusal.
        let mut back = false;
        loop {
            while !back && flight.open.len() < usize::from(window.max(1)) {
                if flight.sent == flight.chunks.len() {
                    match cutter.chunk().map_err(StreamError::Source)? {
                        Some(chunk) => flight.chunks.push_back(chunk),
                        None => break,
                    }
                }
                let id = self.ids.fresh();
                self.send_chunk(id, channels, &flight.chunks[flight.sent])?;
                flight.open.push(id);
                flight.sent += 1;
                flight.reached = flight.reached.max(flight.sent);
            }
            if flight.open.is_empty() {
                if flight.chunks.is_empty() {
                    return Ok(flight.next);
                }
                retreats += 1;
                if retreats > RETREATS {
                    return Err(self.silent(NUMBER, retreats, since).into());
                }
                back = false;
                self.resent += flight.sent as u32;
                flight.sent = 0;
                continue;
            }
            let waited = self.wait(NUMBER, self.patience, |id, reply| {
                let at = flight.open.iter().position(|&open| open == id)?;
                // Requests are dealt with in their order: what is missing of those before
                // this one is lost.
                flight.open.drain(..=at);
                Some(match reply {
                    Reply::Progress(taken) => Ok(*taken),
                    Reply::Error(refused) => match refused.problem {
                        Problem::Gap { expected, .. } => {
                            back = true;
                            Ok(Progress {
                                next: expected,
                                missing: 0,
                            })
                        }
                        _ => Err(ClientError::Refused(*refused)),
                    },
                    other => Err(ClientError::Unexpected {
                        request: NUMBER,
                        reply: other.number(),
                    }),
                })
            })?;
            match waited {
                Waited::Taken(taken) => {
                    let more = flight.taken(taken?.next)?;
                    silences = 0;
                    if more {
                        (retreats, since) = (0, Instant::now());
                        progress(flight.next);
                    }
                }
                Waited::Restarted => {
                    return Err(self.restarted(NUMBER).into());
                }
                Waited::Silence => {
                    silences += 1;
                    if silences >= SILENCES {
                        return Err(self.silent(NUMBER, silences, since).into());
                    }
                    flight.open.clear();
                }
            }
        }
    }

    fn send_chunk(&mut self, id: u16, channels: u8, chunk: &Chunk) -> Result<(), ClientError> {
        let values = match &chunk.values {
            Chunked::Readings(list) => Values::Readings(Packed::new(list)),
            Chunked::Counts(list) => Values::Counts24(Packed::new(list)),
        };
        let samples = Samples {
            first: chunk.first,
            channels,
            values,
        };
        self.send(id, &Request::Samples(samples))
    }
}
