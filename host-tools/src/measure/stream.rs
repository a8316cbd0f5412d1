//! Recordings through blocks into averages.

use super::geometry::RunGeometry;
use super::halves::{Half, Halves, SIX, Six};
use super::powers::{Power, Powers};
use super::rejected::{Gate, Rejected};
use super::rows::Rows;
use super::{BlockStorage, MeasureError};
use crate::parallel::Idle;
use crate::recording::Recording;
use massline_core::geometry::RESULTANTS;
use massline_core::spectra::{BlockSettings, BlockSpectra, Complex32};
use massline_firmware::wire::Health;

/// A signal that a consumer has transformed.
pub(super) enum Signal<'a> {
    /// A channel of the recording by its number, times a factor.
    Channel(usize, f32),
    /// A resultant of a geometry by its number.
    Resultant(&'a RunGeometry, usize),
    /// A power of one of the consumer's signals before this one, by its number.
    Power(usize, Power),
}

/// A consumer of a recording: channels made of each sample, and their spectra block by block.
pub(super) trait Sink: Send {
    /// Its channels, behind the drives.
    fn channels(&self) -> Vec<Signal<'_>>;

    /// `true` if the blocks have to hold nothing but its own channels.
    fn is_alone(&self) -> bool {
        false
    }

    /// Takes a block without faults: the drives, then the channels.
    fn add(&mut self, block: &Seen<'_>);
}

/// The spectra of a block as one of its consumers sees them.
pub(super) struct Seen<'a> {
    /// All channels of the block, which are the consumer's own where it [is alone](Sink::is_alone).
    pub(super) block: &'a BlockSpectra<'a>,
    /// Numbers of the consumer's channels.
    channels: &'a [usize],
}

impl<'a> Seen<'a> {
    /// Number of channels behind so many drives.
    pub(super) fn responses(&self, drives: usize) -> usize {
        self.channels.len().saturating_sub(drives)
    }

    /// The kept lines of a channel by its number; empty if there is no such channel.
    pub(super) fn channel(&self, c: usize) -> &'a [Complex32] {
        let own = self.channels.get(c);
        own.map_or(&[], |own| self.block.channel(*own))
    }
}

/// A channel of blocks.
#[derive(Clone, Copy, PartialEq)]
enum Made {
    Scaled(usize, f32),
    /// One of six sums of one of [`Halves`].
    Sum(usize, usize),
    /// A power of a channel before this one.
    Power(usize, Power),
}

/// Channels of blocks that follow one another.
struct Origin {
    /// Number of the first channel, and their number.
    channel: usize,
    count: usize,
    source: Source,
}

/// Source of channels of blocks that follow one another.
enum Source {
    /// The recording's channels from this one on, and the factor of each.
    Scaled(usize, Vec<f32>),
    /// The six sums of one of [`Halves`], from this one on.
    Sums(usize, usize),
}

/// Channels of blocks that several consumers share.
struct Shared {
    made: Vec<Made>,
    /// Where all of them come from, in their order, but for powers of others.
    origins: Vec<Origin>,
    /// Powers of others.
    powers: Vec<Powers>,
    /// Number of each consumer, and of its channels among these.
    consumers: Vec<(usize, Vec<usize>)>,
}

impl Shared {
    /// Number of a channel, which is added if there is none alike.
    fn number(&mut self, made: Made) -> usize {
        let found = self.made.iter().position(|other| *other == made);
        found.unwrap_or_else(|| {
            self.made.push(made);
            self.made.len() - 1
        })
    }

    /// Settles where the channels come from.
    fn settle(&mut self) {
        for (channel, made) in self.made.iter().enumerate() {
            if let Some(last) = self.origins.last_mut()
                && last.goes_on(*made)
            {
                continue;
            }
            let source = match *made {
                Made::Scaled(from, factor) => Source::Scaled(from, vec![factor]),
                Made::Sum(half, sum) => Source::Sums(half, sum),
                Made::Power(of, power) => {
                    Powers::add(&mut self.powers, of, power, channel);
                    continue;
                }
            };
            self.origins.push(Origin {
                channel,
                count: 1,
                source,
            });
        }
    }

    /// Room for the channels of a sample, with some behind them that [`Self::write`] may write.
    fn room(&self) -> Vec<f32> {
        vec![0.0; self.made.len() + SIX]
    }

    /// Writes the channels of a sample, with its sums and powers. In place of one that is not good, those
    /// of the sample before stay: filters remember it longer than its blocks are left out.
    #[inline]
    fn write<'a>(
        &mut self,
        (sample, good): (&[f32], bool),
        sums: impl Fn(usize) -> Six,
        into: &'a mut [f32],
    ) -> &'a [f32] {
        let origins = self.origins.iter();
        for origin in origins.filter(|_| good) {
            let own = into.get_mut(origin.channel..).unwrap_or_default();
            match &origin.source {
                Source::Scaled(from, factors) => {
                    let numbers = sample.get(*from..).unwrap_or_default();
                    for ((slot, number), factor) in own.iter_mut().zip(numbers).zip(factors) {
                        *slot = number * factor;
                    }
                }
                Source::Sums(half, sum) => {
                    let six = sums(*half);
                    match own.first_chunk_mut::<SIX>() {
                        // Those behind its own ones are written later.
                        Some(slots) if *sum == 0 => *slots = six,
                        _ => {
                            let own = own.iter_mut().take(origin.count);
                            own.zip(six.iter().skip(*sum))
                                .for_each(|(slot, x)| *slot = *x);
                        }
                    }
                }
            }
        }
        for own in self.powers.iter_mut().filter(|_| good) {
            own.write(into);
        }
        into.get(..self.made.len()).unwrap_or_default()
    }
}

impl Origin {
    /// `true` if this channel comes next, which then belongs to it.
    fn goes_on(&mut self, made: Made) -> bool {
        let count = self.count;
        let goes_on = match (&mut self.source, made) {
            (Source::Scaled(first, factors), Made::Scaled(from, factor)) => {
                let goes_on = from == *first + count;
                if goes_on {
                    factors.push(factor);
                }
                goes_on
            }
            (Source::Sums(own, first), Made::Sum(half, sum)) => {
                half == *own && sum == *first + count
            }
            _ => false,
        };
        self.count += usize::from(goes_on);
        goes_on
    }
}

/// Blocks that some consumers need, and sums for them.
fn planned(drives: &[usize], sinks: &[&mut dyn Sink]) -> (Vec<Shared>, Halves) {
    let mut halves = Halves::new();
    let mut all: Vec<Shared> = Vec::new();
    let mut common: Option<usize> = None;
    for (number, sink) in sinks.iter().enumerate() {
        let at = common.filter(|_| !sink.is_alone()).unwrap_or(all.len());
        if at == all.len() {
            let made = drives.iter().map(|drive| Made::Scaled(*drive, 1.0));
            all.push(Shared {
                made: made.collect(),
                origins: Vec::new(),
                powers: Vec::new(),
                consumers: Vec::new(),
            });
        }
        if !sink.is_alone() {
            common = Some(at);
        }
        let Some(shared) = all.get_mut(at) else {
            continue;
        };
        let mut channels: Vec<usize> = (0..drives.len()).collect();
        let mut last: Option<(&RunGeometry, [usize; 2])> = None;
        for signal in sink.channels() {
            let made = match signal {
                Signal::Power(own, power) => {
                    let of = channels.get(drives.len() + own);
                    Made::Power(of.copied().unwrap_or_default(), power)
                }
                Signal::Channel(channel, factor) => Made::Scaled(channel, factor),
                Signal::Resultant(geometry, resultant) => {
                    let known = last.filter(|(own, _)| std::ptr::eq(*own, geometry));
                    let numbers = known.map_or_else(
                        || Half::both(geometry).map(|half| halves.number(&half)),
                        |(_, numbers)| numbers,
                    );
                    last = Some((geometry, numbers));
                    let six = RESULTANTS / 2;
                    let [accelerations, forces] = numbers;
                    match resultant.checked_sub(six) {
                        None => Made::Sum(accelerations, resultant),
                        Some(force) => Made::Sum(forces, force),
                    }
                }
            };
            channels.push(shared.number(made));
        }
        shared.consumers.push((number, channels));
    }
    (all, halves)
}

/// Sees good samples only, one or more at a time.
pub(super) type Watch<'w> = &'w mut (dyn FnMut(&[f32]) + Send);

/// Streams a recording through blocks into all of its consumers, in one pass; on two threads as soon as one is `idle`,
/// with the same results. The drives, whose columns are given, come first in the blocks. A block with a faulty sample
/// goes nowhere.
pub(super) fn stream(
    recording: &mut Recording,
    settings: &BlockSettings,
    drives: &[usize],
    sinks: &mut [&mut dyn Sink],
    watch: Watch<'_>,
    idle: &Idle,
    progress: &mut dyn FnMut(f64),
) -> Result<Rejected, MeasureError> {
    let channels = recording.channels();
    let (mut plan, mut halves) = planned(drives, sinks);
    plan.iter_mut().for_each(Shared::settle);
    let store = |shared: &Shared| BlockStorage::new(*settings, shared.made.len());
    let mut stores: Vec<_> = plan.iter().map(store).collect();
    let mut feeds = Vec::with_capacity(stores.len());
    for (storage, shared) in stores.iter_mut().zip(&mut plan) {
        let blocks = storage.blocks().map_err(|source| MeasureError::Spectra {
            file: recording.file().to_owned(),
            source,
        })?;
        feeds.push((blocks, shared.room(), shared));
    }
    let mut gate = Gate::new(settings);
    let mut take = |rows: &[f32], health: Health| {
        if health.is_good() {
            watch(rows);
        }
        halves.take(rows, channels);
        for (n, sample) in rows.chunks_exact(channels.max(1)).enumerate() {
            gate.sample(health);
            // All complete their blocks with the same sample.
            let mut admitted = None;
            for (blocks, input, shared) in &mut feeds {
                let sample = (sample, health.is_good());
                let input = shared.write(sample, |half| halves.of(half, n), input);
                let Some(block) = blocks.push(input) else {
                    continue;
                };
                if !*admitted.get_or_insert_with(|| gate.admits()) {
                    continue;
                }
                for (number, channels) in &shared.consumers {
                    if let Some(sink) = sinks.get_mut(*number) {
                        let block = &block;
                        sink.add(&Seen { block, channels });
                    }
                }
            }
        }
    };
    Rows::new(recording).hand_out(&mut take, idle, progress)?;
    Ok(gate.rejected)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Channels that follow one another in the recording, that do not, that are used twice, and sums.
    #[test]
    fn each_channel_comes_from_its_own_place() {
        let made = vec![
            Made::Scaled(1, 2.0),
            Made::Scaled(2, 3.0),
            Made::Scaled(0, -1.0),
            Made::Sum(1, 4),
            Made::Sum(1, 5),
            Made::Scaled(3, 1.0),
            Made::Scaled(3, 0.5),
            Made::Sum(0, 0),
            // Powers are zero until the variance is known.
            Made::Power(7, Power::Cube),
            Made::Sum(1, 0),
        ];
        let mut shared = Shared {
            made: made.clone(),
            origins: Vec::new(),
            powers: Vec::new(),
            consumers: Vec::new(),
        };
        shared.settle();
        let sample = [10.0, 20.0, 30.0, 40.0];
        let sums: [Six; 2] =
            [0, 1].map(|half| core::array::from_fn(|sum| (100 * half + sum) as f32));
        let mut into = shared.room();
        into.fill(f32::NAN);
        let found = shared.write((&sample, true), |half| sums[half], &mut into);
        assert_eq!(found.len(), made.len());
        for (&found, made) in found.iter().zip(made) {
            let expected = match made {
                Made::Scaled(channel, factor) => sample[channel] * factor,
                Made::Sum(half, sum) => sums[half][sum],
                Made::Power(..) => 0.0,
            };
            assert_eq!(found, expected);
        }
    }

    /// Samples with faults, which may be no numbers, have no part in the mean and the variance behind powers.
    #[test]
    fn powers_are_of_good_samples() {
        let mut shared = Shared {
            made: vec![Made::Scaled(0, 1.0), Made::Power(0, Power::Square)],
            origins: Vec::new(),
            powers: Vec::new(),
            consumers: Vec::new(),
        };
        shared.settle();
        let mut into = shared.room();
        let mut write = |x: f32, good: bool| {
            let sums = |_| Six::default();
            shared.write((&[x], good), sums, &mut into).to_vec()
        };
        for x in [1.0, -1.0].into_iter().cycle().take(200) {
            write(f32::NAN, false);
            write(x, true);
        }
        // x² / √m, of a variance of 1.
        assert_eq!(write(2.0, true), [2.0, 4.0]);
    }
}
