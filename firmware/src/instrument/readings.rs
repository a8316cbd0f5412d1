//! Samples of one run: the role, the calibration and the faults of each channel.

use super::Transmit;
use crate::calibration::{Alignment, Channel};
use crate::capacity::{CHANNELS, SENSORS};
use crate::wire::{ChannelHealth, ChannelRole, Event, Health, Packed, Values};

/// One sample of all channels.
#[derive(Clone, Copy, Debug)]
pub(super) enum Sample<'a> {
    /// Sample number `0` of the host's, counted from the first one of a message.
    Host(Values<'a>, usize),
    /// One of the box's own converters, and when it was taken.
    Counts {
        counts: &'a [i32],
        health: &'a [Health],
        ticks: u64,
    },
    /// One that the box has computed, in SI.
    Computed(&'a [f32]),
}

/// Places of the sensors, and the drive's behind them.
pub(super) const PLACES: usize = SENSORS + 1;
const DRIVE: usize = SENSORS;
/// Place of channels without a role.
const UNUSED: usize = PLACES;
/// Places in all: a power of two, so that the remainder of any number by it is one of them at no cost.
const ALL_PLACES: usize = (UNUSED + 1).next_power_of_two();

/// Calibration and role of a channel.
#[derive(Clone, Copy, Debug)]
struct Route {
    channel: Channel,
    /// Place of its readings: the number of a sensor, [`DRIVE`] or [`UNUSED`].
    place: u8,
    /// Faults that count: none of a channel without a role.
    faults: u16,
}

impl Route {
    /// Takes a count that is not common, and returns the faults that count.
    #[cold]
    #[inline(never)] // Takes registers from the common case otherwise.
    fn faults(&mut self, count: i32) -> u16 {
        let (_, Health(found)) = self.channel.count(count, Health::GOOD);
        found & self.faults
    }
}

/// Channels of a run at work.
#[derive(Debug)]
pub(super) struct Channels {
    routes: heapless::Vec<Route, CHANNELS>,
    /// SI by channel.
    readings: [f32; CHANNELS],
    /// SI by place.
    places: [f32; ALL_PLACES],
    sensors_used: usize,
    /// Faults of each channel at the last sample.
    health: [u16; CHANNELS],
    /// All of them together.
    all: u16,
}

impl Channels {
    /// No channels yet.
    pub(super) const fn new() -> Self {
        Self {
            routes: heapless::Vec::new(),
            readings: [0.0; CHANNELS],
            places: [0.0; ALL_PLACES],
            sensors_used: 0,
            health: [0; CHANNELS],
            all: 0,
        }
    }

    /// Forgets all channels; there will be `sensors` sensors behind the next ones.
    pub(super) fn begin(&mut self, sensors: usize) {
        self.routes.clear();
        self.readings.fill(0.0);
        self.places.fill(0.0);
        self.sensors_used = sensors.min(SENSORS);
        self.health.fill(0);
        self.all = 0;
    }

    /// Adds the next channel of a sample, and returns its place among the sensors and the drive; one that
    /// finds no room is left out.
    pub(super) fn add(&mut self, carries: ChannelRole, channel: Channel) -> usize {
        // Counts without a role have no faults, and those of a converter that is left out never change.
        let channel = match carries {
            ChannelRole::Unused => Channel::unwatched(channel.scale()),
            _ => channel,
        };
        let place = match carries {
            ChannelRole::Sensor(sensor) if usize::from(sensor) < SENSORS => usize::from(sensor),
            ChannelRole::Drive => DRIVE,
            ChannelRole::Sensor(_) | ChannelRole::Unused => UNUSED,
        };
        let _ = self.routes.push(Route {
            channel,
            place: place as u8,
            faults: if carries == ChannelRole::Unused {
                0
            } else {
                u16::MAX
            },
        });
        place
    }

    /// Brings the sensors and the drive into step. `false` if that takes more samples since the last gap.
    #[inline]
    pub(super) fn align(&mut self, alignment: &mut Alignment<PLACES>) -> bool {
        let used = self.sensors_used;
        let places = self.places.first_chunk_mut();
        places.is_none_or(|places| alignment.align(places, used))
    }

    /// Number of channels.
    pub(super) fn count(&self) -> usize {
        self.routes.len()
    }

    /// Takes notice that so many samples are missing: the time after an overload does not shrink
    /// by them.
    pub(super) fn skip(&mut self, missing: u64) {
        for route in &mut self.routes {
            route.channel.skip(missing);
        }
    }

    /// Takes one sample and returns its faults. A reading that is no number counts as
    /// zero, so that it cannot outlive its block in a filter.
    pub(super) fn take(
        &mut self,
        sample: &Sample<'_>,
        index: u64,
        out: &mut impl Transmit,
    ) -> Health {
        // Those of the converters come thousands of times a second, and counts are numbers always.
        let (all, changed) = match sample {
            Sample::Counts { counts, health, .. } => self.take_counts(counts, health),
            // A value's place in a message is below the message's length, which is one frame at most.
            Sample::Host(values, at) => {
                self.take_by(|c, channel| finite(value(values, at.wrapping_add(c), channel)))
            }
            Sample::Computed(list) => {
                self.take_by(|c, _| finite(list.get(c).map_or(MISSING, |x| (*x, Health::GOOD))))
            }
        };
        if changed != 0 {
            let known = self.health.get(..self.routes.len()).unwrap_or(&[]);
            out.event(&Event::Health(ChannelHealth {
                sample: index,
                channels: Packed::new(known),
            }));
        }
        self.all = all;
        Health(all)
    }

    /// Takes a sample of the converters. The faults that it has, and those of any channel that have come or
    /// gone.
    fn take_counts(&mut self, counts: &[i32], known: &[Health]) -> (u16, u16) {
        let n = self.routes.len();
        let lists = (
            counts
                .get(..n)
                .filter(|_| known.is_empty() && self.all == 0),
            self.readings.get_mut(..n),
            self.health.get_mut(..n),
        );
        let (Some(counts), Some(readings), Some(health)) = lists else {
            return self.take_by(|c, channel| {
                let known = known.get(c).copied().unwrap_or(Health::GOOD);
                counts.get(c).map_or(MISSING, |x| channel.count(*x, known))
            });
        };
        // The common case: no channel has a fault or had one.
        let mut all = 0;
        let routes = self.routes.as_mut_slice().iter_mut().zip(counts);
        for ((route, count), (reading, last)) in routes.zip(readings.iter_mut().zip(health)) {
            if !route.channel.take_common(*count) {
                *last = route.faults(*count);
                all |= *last;
            }
            let si = route.channel.scale().count(*count);
            *reading = si;
            if let Some(place) = self.places.get_mut(usize::from(route.place) % ALL_PLACES) {
                *place = si;
            }
        }
        (all, all)
    }

    /// Takes the sample whose channels `read` reads. The faults that it has, and those of any channel that
    /// have come or gone.
    #[inline(always)]
    fn take_by(&mut self, read: impl Fn(usize, &mut Channel) -> (f32, Health)) -> (u16, u16) {
        let (mut all, mut changed) = (0, 0);
        // One list and numbers: lists side by side are slow where code is small.
        for (c, route) in (0..CHANNELS).zip(self.routes.as_mut_slice()) {
            let (Some(reading), Some(last)) = (self.readings.get_mut(c), self.health.get_mut(c))
            else {
                break;
            };
            let (si, Health(health)) = read(c, &mut route.channel);
            let found = health & route.faults;
            changed |= *last ^ found;
            all |= found;
            *last = found;
            *reading = si;
            if let Some(place) = self.places.get_mut(usize::from(route.place) % ALL_PLACES) {
                *place = si;
            }
        }
        (all, changed)
    }

    /// SI by channel.
    pub(super) fn readings(&self) -> &[f32] {
        self.readings.get(..self.routes.len()).unwrap_or(&[])
    }

    /// SI by sensor.
    pub(super) fn sensors(&self) -> &[f32] {
        self.places.get(..self.sensors_used).unwrap_or(&[])
    }

    /// The drive signal, in its own unit.
    pub(super) fn drive(&self) -> f32 {
        self.places.get(DRIVE).copied().unwrap_or(0.0)
    }
}

/// Of a channel that the sample does not have.
const MISSING: (f32, Health) = (0.0, Health::MISSING);

/// A reading that is no number counts as zero.
fn finite((si, health): (f32, Health)) -> (f32, Health) {
    (if si.is_finite() { si } else { 0.0 }, health)
}

/// The value at a place of a message.
fn value(values: &Values<'_>, place: usize, channel: &mut Channel) -> (f32, Health) {
    let read = match values {
        Values::Readings(list) => list.get(place).map(|x| channel.reading(x, Health::GOOD)),
        Values::Counts(list) => list.get(place).map(|x| channel.count(x, Health::GOOD)),
        Values::Counts24(list) => list
            .get(place)
            .map(|x| channel.count(x.get(), Health::GOOD)),
    };
    read.unwrap_or(MISSING)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::{Limits, Scale, Watch};
    use crate::models::random::Random;
    use crate::wire::Reply;
    use std::vec::Vec;

    /// Keeps the faults of the last event.
    struct Heard(Vec<u16>);

    impl Transmit for Heard {
        fn reply(&mut self, _: u16, _: &Reply<'_>) {}

        fn event(&mut self, event: &Event<'_>) {
            if let Event::Health(ChannelHealth { channels, .. }) = event {
                self.0 = channels.iter().collect();
            }
        }
    }

    #[test]
    fn counts_of_all_channels_are_those_of_each() {
        const INPUTS: usize = 12;
        const LIMITS: Limits = Limits { low: -9, high: 9 };
        let mut random = Random::new(5);
        let mut each: Vec<Channel> = (0..INPUTS)
            .map(|c| match c {
                3 => Channel::unwatched(Scale::ONE),
                _ => Channel::watched(Scale::ONE, Watch::new(LIMITS, 100.0)),
            })
            .collect();
        let mut channels = Channels::new();
        channels.begin(INPUTS);
        for (c, channel) in (0..).zip(&each) {
            let role = match c {
                5 => ChannelRole::Unused,
                _ => ChannelRole::Sensor(c),
            };
            channels.add(role, *channel);
        }
        let (mut good, mut bad) = (0, 0);
        let mut heard = Heard(std::vec![0; INPUTS]);
        for n in 0..20_000 {
            // Seldom a sample of fewer channels; often a fault of one, and seldom a limit.
            let given = if random.chance(0.01) { 7 } else { INPUTS };
            let counts: Vec<i32> = (0..given)
                .map(|_| {
                    let span = if random.chance(0.02) { 20 } else { 8 };
                    random.below(span) as i32 - 4
                })
                .collect();
            let health: Vec<Health> = (0..given)
                .map(|_| Health(if random.chance(0.01) { 2 } else { 0 }))
                .collect();
            let mut expected = Vec::new();
            for (c, channel) in each.iter_mut().enumerate() {
                let (si, Health(found)) = match counts.get(c) {
                    Some(count) => channel.count(*count, health[c]),
                    None => MISSING,
                };
                expected.push((si, if c == 5 { 0 } else { found }));
            }
            // Channels that are left out have no fault.
            let is_good = health.iter().all(|h| h.is_good());
            let sample = Sample::Counts {
                counts: &counts,
                health: if is_good { &[] } else { &health },
                ticks: 0,
            };
            let Health(all) = channels.take(&sample, n, &mut heard);
            assert_eq!(all, expected.iter().fold(0, |all, (_, found)| all | found));
            assert!(heard.0.iter().eq(expected.iter().map(|(_, found)| found)));
            let si = expected.iter().map(|(si, _)| si);
            assert!(channels.readings().iter().eq(si));
            *(if all == 0 { &mut good } else { &mut bad }) += 1;
        }
        assert!(good > 1000 && bad > 1000, "{good} {bad}");
    }
}
