//! Subscriptions of the host: levels of the channels, and the samples of the converters.

use super::{RawSample, Transmit};
use crate::capacity::CHANNELS;
use crate::wire::{Count24, Event, FaultySamples, Levels, Packed, Samples, Stream, Values, Word};

/// Levels of one channel since they were last sent.
#[derive(Clone, Copy, Debug, Default)]
struct Level {
    /// The first value: sums are of distances from it, which do not cancel where an offset
    /// is large.
    first: f32,
    sum: f32,
    squares: f32,
    peak: f32,
}

/// Levels of all channels since they were last sent.
#[derive(Debug)]
pub(super) struct LevelMeter {
    levels: [Level; CHANNELS],
    channels: usize,
    samples: u32,
    /// Index after the last sample that went in.
    next: u64,
}

impl LevelMeter {
    /// Levels of no sample yet.
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

    /// Sends the levels, and begins anew; without a sample, sends nothing.
    #[inline(never)] // Not on the stack of what else its caller does.
    pub(super) fn send(&mut self, out: &mut impl Transmit) {
        if self.samples == 0 {
            return;
        }
        let n = self.samples as f32;
        let (mut mean, mut rms, mut peak) = ([0.0; CHANNELS], [0.0; CHANNELS], [0.0; CHANNELS]);
        for (c, level) in self.levels.iter().enumerate() {
            let distance = level.sum / n;
            mean[c] = level.first + distance;
            let variance = level.squares / n - distance * distance;
            // Rounding may make it negative; where squares overflow, it stays not a number.
            rms[c] = libm::sqrtf(if variance < 0.0 { 0.0 } else { variance });
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

/// Bytes of values that an event takes: eight samples of 35 inputs as counts.
const ROOM: usize = 840;

const _: () = assert!(ROOM <= FaultySamples::FIT);

/// The converters' samples on their way to a host that records them.
#[derive(Debug)]
pub(super) struct Recorder {
    stream: Stream,
    /// Values gathered, as they are encoded in a message.
    bytes: [u8; ROOM],
    filled: usize,
    /// Faults of each channel, of all samples gathered.
    health: [u16; CHANNELS],
    channels: usize,
    /// Number of the first sample gathered, and of the one that would follow the last.
    first: u64,
    next: u64,
}

impl Recorder {
    /// A recorder without a subscription.
    pub(super) const fn new() -> Self {
        Self {
            stream: Stream::Off,
            bytes: [0; ROOM],
            filled: 0,
            health: [0; CHANNELS],
            channels: 0,
            first: 0,
            next: 0,
        }
    }

    /// Records by this subscription from now on.
    pub(super) fn begin(&mut self, stream: Stream) {
        self.stream = stream;
        self.filled = 0;
    }

    /// Takes a sample; `si` turns the count of an input into SI.
    pub(super) fn add(
        &mut self,
        sample: &RawSample<'_>,
        si: impl Fn(usize, i32) -> f32,
        out: &mut impl Transmit,
    ) {
        if self.stream == Stream::Off {
            return;
        }
        let counts = sample.counts.get(..CHANNELS).unwrap_or(sample.counts);
        let fault = |c: usize| sample.health.get(c).map_or(0, |health| health.0);
        let known = self.health.iter().take(counts.len()).enumerate();
        let is_other = known.clone().any(|(c, health)| *health != fault(c));
        if is_other || counts.len() != self.channels || sample.number != self.next {
            self.send(out);
            self.channels = counts.len();
            for (c, health) in self.health.iter_mut().enumerate() {
                *health = if c < counts.len() { fault(c) } else { 0 };
            }
        }
        if self.filled == 0 {
            self.first = sample.number;
        }
        self.next = sample.number.wrapping_add(1);
        for (c, &count) in counts.iter().enumerate() {
            match self.stream {
                Stream::Readings => self.put(si(c, count)),
                _ => self.put(Count24::nearest(count)),
            }
        }
        let word = match self.stream {
            Stream::Readings => f32::SIZE,
            _ => Count24::SIZE,
        };
        // The next sample is as long.
        let next = self.channels.saturating_mul(word);
        if self.filled.saturating_add(next) > ROOM {
            self.send(out);
        }
    }

    fn put<T: Word>(&mut self, value: T) {
        let rest = self.bytes.get_mut(self.filled..).unwrap_or(&mut []);
        let bytes = value.to_bytes();
        if let Some(slot) = rest.get_mut(..T::SIZE) {
            slot.iter_mut()
                .zip(bytes.as_ref())
                .for_each(|(slot, byte)| *slot = *byte);
            // It fitted, so this is no more than the room.
            self.filled = self.filled.saturating_add(T::SIZE);
        }
    }

    /// Sends the samples gathered so far.
    #[inline(never)] // Not on the stack of what else its caller does.
    pub(super) fn send(&mut self, out: &mut impl Transmit) {
        if self.filled == 0 {
            return;
        }
        let bytes = self.bytes.get(..self.filled).unwrap_or(&[]);
        let samples = Samples {
            first: self.first,
            channels: self.channels as u8,
            values: match self.stream {
                Stream::Readings => Values::Readings(Packed::of_bytes(bytes)),
                _ => Values::Counts24(Packed::of_bytes(bytes)),
            },
        };
        let health = self.health.get(..self.channels).unwrap_or(&[]);
        if health.iter().all(|faults| *faults == 0) {
            out.event(&Event::Recorded(samples));
        } else {
            out.event(&Event::RecordedFaulty(FaultySamples {
                health: Packed::new(health),
                samples,
            }));
        }
        self.filled = 0;
    }
}
