//! What a host that listens sees of the samples: levels, and the converters' own samples.

use super::Outbox;
use super::memory::CHANNELS;
use crate::wire::{Event, Levels, Packed, Samples, Stream, Values};

/// Levels of one channel since they were last told.
#[derive(Clone, Copy, Debug, Default)]
struct Level {
    /// The first value: sums are of distances from it, which do not cancel where an offset
    /// is large.
    first: f32,
    sum: f32,
    squares: f32,
    peak: f32,
}

/// Levels of all channels since they were last told.
#[derive(Debug)]
pub(super) struct LevelMeter {
    levels: [Level; CHANNELS],
    channels: usize,
    samples: u32,
    /// Index after the last sample that went in.
    next: u64,
}

impl LevelMeter {
    /// Nothing went in yet.
    pub(super) const fn new() -> Self {
        const NOTHING: Level = Level {
            first: 0.0,
            sum: 0.0,
            squares: 0.0,
            peak: 0.0,
        };
        Self {
            levels: [NOTHING; CHANNELS],
            channels: 0,
            samples: 0,
            next: 0,
        }
    }

    /// Takes the sample before number `next`.
    pub(super) fn add(&mut self, sample: &[f32], next: u64) {
        if sample.len() != self.channels {
            self.channels = sample.len().min(CHANNELS);
            self.samples = 0;
        }
        for (level, &x) in self.levels.iter_mut().zip(sample) {
            if self.samples == 0 {
                *level = Level {
                    first: x,
                    ..Level::default()
                };
            }
            let d = x - level.first;
            level.sum += d;
            level.squares += d * d;
            level.peak = level.peak.max(x.abs());
        }
        self.samples = self.samples.saturating_add(1);
        self.next = next;
    }

    /// Tells of the levels, and begins anew. Without a sample there is nothing to tell.
    pub(super) fn tell(&mut self, out: &mut impl Outbox) {
        if self.samples == 0 {
            return;
        }
        let n = self.samples as f32;
        let (mut mean, mut rms, mut peak) = ([0.0; CHANNELS], [0.0; CHANNELS], [0.0; CHANNELS]);
        for (c, level) in self.levels.iter().enumerate() {
            let distance = level.sum / n;
            mean[c] = level.first + distance;
            rms[c] = libm::sqrtf((level.squares / n - distance * distance).max(0.0));
            peak[c] = level.peak;
        }
        let channels = self.channels;
        out.event(&Event::Levels(Levels {
            sample: self.next,
            samples: self.samples,
            mean: Packed::new(mean.get(..channels).unwrap_or(&[])),
            rms: Packed::new(rms.get(..channels).unwrap_or(&[])),
            peak: Packed::new(peak.get(..channels).unwrap_or(&[])),
        }));
        self.samples = 0;
    }
}

/// Values that fit an event.
const ROOM: usize = 240;

/// The converters' samples on their way to a host that records them.
#[derive(Debug)]
pub(super) struct Recorder {
    values: Recorded,
    channels: usize,
    first: u64,
    /// Values gathered.
    filled: usize,
}

#[derive(Debug)]
enum Recorded {
    Readings([f32; ROOM]),
    Counts([i32; ROOM]),
}

impl Recorder {
    /// A recorder of what was subscribed to, if anything.
    pub(super) fn new(stream: Stream) -> Option<Self> {
        let values = match stream {
            Stream::Off => return None,
            Stream::Readings => Recorded::Readings([0.0; ROOM]),
            Stream::Counts => Recorded::Counts([0; ROOM]),
        };
        Some(Self {
            values,
            channels: 0,
            first: 0,
            filled: 0,
        })
    }

    /// Takes the sample of this number; `si` turns the count of an input into SI.
    pub(super) fn add(
        &mut self,
        number: u64,
        counts: &[i32],
        si: impl Fn(usize, i32) -> f32,
        out: &mut impl Outbox,
    ) {
        let counts = counts.get(..CHANNELS).unwrap_or(counts);
        let gathered = self.filled.checked_div(self.channels).unwrap_or(0) as u64;
        if counts.len() != self.channels || number != self.first + gathered {
            self.send(out);
            self.channels = counts.len();
        }
        if self.filled == 0 {
            self.first = number;
        }
        for (c, &count) in counts.iter().enumerate() {
            match &mut self.values {
                Recorded::Readings(values) => {
                    if let Some(slot) = values.get_mut(self.filled + c) {
                        *slot = si(c, count);
                    }
                }
                Recorded::Counts(values) => {
                    if let Some(slot) = values.get_mut(self.filled + c) {
                        *slot = count;
                    }
                }
            }
        }
        self.filled += counts.len();
        if self.filled + counts.len() > ROOM {
            self.send(out);
        }
    }

    /// Sends what was gathered.
    pub(super) fn send(&mut self, out: &mut impl Outbox) {
        if self.filled > 0 {
            let values = match &self.values {
                Recorded::Readings(v) => {
                    Values::Readings(Packed::new(v.get(..self.filled).unwrap_or(&[])))
                }
                Recorded::Counts(v) => {
                    Values::Counts(Packed::new(v.get(..self.filled).unwrap_or(&[])))
                }
            };
            out.event(&Event::Recorded(Samples {
                first: self.first,
                channels: self.channels as u8,
                values,
            }));
        }
        self.filled = 0;
    }
}
