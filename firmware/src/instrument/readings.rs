//! Samples of one run: the role, the calibration and the faults of each channel.

use super::Transmit;
use crate::calibration::Channel;
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

/// Calibration and role of a channel.
#[derive(Clone, Copy, Debug)]
struct Route {
    channel: Channel,
    carries: ChannelRole,
}

/// Channels of a run at work.
#[derive(Debug)]
pub(super) struct Channels {
    routes: heapless::Vec<Route, CHANNELS>,
    /// SI by channel.
    readings: [f32; CHANNELS],
    /// SI by sensor.
    sensors: [f32; SENSORS],
    sensors_used: usize,
    drive: f32,
    /// Faults of each channel at the last sample.
    health: [u16; CHANNELS],
}

impl Channels {
    /// No channels yet.
    pub(super) const fn new() -> Self {
        Self {
            routes: heapless::Vec::new(),
            readings: [0.0; CHANNELS],
            sensors: [0.0; SENSORS],
            sensors_used: 0,
            drive: 0.0,
            health: [0; CHANNELS],
        }
    }

    /// Forgets all channels; there will be `sensors` sensors behind the next ones.
    pub(super) fn begin(&mut self, sensors: usize) {
        self.routes.clear();
        self.readings.fill(0.0);
        self.sensors.fill(0.0);
        self.sensors_used = sensors;
        self.drive = 0.0;
        self.health.fill(0);
    }

    /// Adds the next channel of a sample; one that finds no room is left out.
    pub(super) fn add(&mut self, carries: ChannelRole, channel: Channel) {
        let _ = self.routes.push(Route { channel, carries });
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
        let mut all = 0;
        let mut changed = false;
        let routes = self.routes.iter_mut().zip(&mut self.readings);
        for (c, ((route, reading), last)) in (0..CHANNELS).zip(routes.zip(&mut self.health)) {
            let (si, health) = read(sample, c, &mut route.channel);
            let si = if si.is_finite() { si } else { 0.0 };
            *reading = si;
            match route.carries {
                ChannelRole::Sensor(sensor) => {
                    if let Some(slot) = self.sensors.get_mut(usize::from(sensor)) {
                        *slot = si;
                    }
                }
                ChannelRole::Drive => self.drive = si,
                // A channel without a role is not used, so its faults do not count.
                ChannelRole::Unused => continue,
            }
            changed |= *last != health.0;
            *last = health.0;
            all |= health.0;
        }
        if changed {
            let known = self.health.get(..self.routes.len()).unwrap_or(&[]);
            out.event(&Event::Health(ChannelHealth {
                sample: index,
                channels: Packed::new(known),
            }));
        }
        Health(all)
    }

    /// SI by channel.
    pub(super) fn readings(&self) -> &[f32] {
        self.readings.get(..self.routes.len()).unwrap_or(&[])
    }

    /// SI by sensor.
    pub(super) fn sensors(&self) -> &[f32] {
        self.sensors.get(..self.sensors_used).unwrap_or(&[])
    }

    /// The drive signal, in its own unit.
    pub(super) fn drive(&self) -> f32 {
        self.drive
    }
}

fn read(sample: &Sample<'_>, c: usize, channel: &mut Channel) -> (f32, Health) {
    let missing = (0.0, Health::MISSING);
    // A value's place in a message is below the message's length, which is one frame at most.
    let place = |at: &usize| at.wrapping_add(c);
    match sample {
        Sample::Host(Values::Readings(list), at) => list
            .get(place(at))
            .map_or(missing, |x| channel.reading(x, Health::GOOD)),
        Sample::Host(Values::Counts(list), at) => list
            .get(place(at))
            .map_or(missing, |x| channel.count(x, Health::GOOD)),
        Sample::Host(Values::Counts24(list), at) => list
            .get(place(at))
            .map_or(missing, |x| channel.count(x.get(), Health::GOOD)),
        Sample::Counts { counts, health, .. } => {
            let known = health.get(c).copied().unwrap_or(Health::GOOD);
            counts.get(c).map_or(missing, |x| channel.count(*x, known))
        }
        Sample::Computed(list) => list.get(c).map_or(missing, |x| (*x, Health::GOOD)),
    }
}
