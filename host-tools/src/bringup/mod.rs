//! Bring-up of a board: its clocks, buses, converters and link, one after the other, before a sensor is
//! wired to it.
//!
//! | file | holds |
//! | --- | --- |
//! | `mod` | the order of the measurements |
//! | `sampled` | mean and noise of each input while samples come |
//! | `judge` | the measurements against those of a sound board |
//!
//! # Design
//!
//! Whatever can be measured without a tool is measured: wires by bytes that come back or do not,
//! converters by their registers, short circuits and test voltages, buses by the checksums of frames at
//! three clocks. A measurement that a board cannot make is listed as not made, and none of them changes
//! what the box has stored, but for [`Order::saves`].
//!
//! The box is left as it was: the sample rate is put back, also after an error. Samples of a test are sent
//! to this subscription alone: a recording that comes after a bring-up that was killed has the usual ones.

mod judge;
mod sampled;

pub use judge::{Check, Verdict};

use crate::device::{BoxInfo, Client, ClientError, Port};
use massline_firmware::sampling::CHIPS;
use massline_firmware::wire::{
    BusClock, Conditions, ConverterFault, Looped, Probe, Probed, Problem, Reply, Request, Setting,
    Signal, Subscription,
};
use sampled::{Sampled, Sampling};

/// Names of the buses of the converters, in the order of their numbers, with their pins of request and
/// answer.
const BUSES: [(&str, &str); 3] = [
    ("SPI2", "PB15 to PB14"),
    ("SPI3", "PB5 to PC11"),
    ("SPI1", "PA7 to PB4"),
];
/// Sample rate of the measurements, Hz: all inputs take 54 of the link's 92 kB/s.
pub const RATE: f64 = 512.0;
/// Longest that samples of a test signal are taken, s.
const LEVELS: f64 = 1.0;
/// Pings of which the median round trip is taken.
const PINGS: usize = 21;

/// Extent of a bring-up.
#[derive(Clone, Debug)]
pub struct Order {
    /// Length of a count of checksum errors at each clock of the buses, s.
    pub seconds: f64,
    /// Bits of the converters that are not soldered yet.
    pub without: u32,
    /// `true` if the settings are saved, to measure how long that takes.
    pub saves: bool,
    /// `true` if ticks of the box are true, unlike an emulator's.
    pub keeps_time: bool,
}

/// Measurements of a board; `None` is one that the box cannot make.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The box.
    pub info: BoxInfo,
    /// Frequency of the crystal by the chip's own oscillator, Hz.
    pub crystal: Option<Option<u32>>,
    /// Loops over the buses.
    pub loops: [Option<Looped>; BUSES.len()],
    /// Faults of the converters.
    pub converters: [Option<Option<ConverterFault>>; CHIPS],
    /// Samples of short circuits, and of the two test voltages.
    pub signals: [Option<Sampled>; 3],
    /// Samples at the usual clock of the buses, at half of it and at twice as much.
    pub buses: [Option<Sampled>; 3],
    /// Median of the times from a request to its reply, s.
    pub round_trip: f64,
    /// Deviation of the box's clock from this computer's, and its largest error, as shares.
    pub clock: Option<[f64; 2]>,
    /// Time of a save of the settings, s.
    pub save: Option<f64>,
}

/// Measures a board. `tell` gets the name of each measurement before it begins.
///
/// # Errors
/// [`ClientError`] if the box does not answer.
pub fn measure<P: Port>(
    client: &mut Client<'_, P>,
    order: &Order,
    tell: &mut dyn FnMut(&str),
) -> Result<Measured, ClientError> {
    let info = client.hello()?;
    let rate = crate::acquire::sample_rate(client)?;
    if rate != RATE {
        client.tell(&Request::WriteSetting(Setting::SampleRate(RATE)))?;
    }
    let measured = measure_all(client, info, order, tell);
    // Neither of these hides what went wrong before.
    let usual = client.tell(&Request::Subscribe(Subscription::default()));
    let usual = match rate == RATE {
        true => usual,
        false => {
            usual.and_then(|()| client.tell(&Request::WriteSetting(Setting::SampleRate(rate))))
        }
    };
    let mut measured = measured?;
    usual?;
    if order.saves {
        tell("settings");
        let since = client.port().seconds();
        client.ask(&Request::SaveSettings, |reply| {
            matches!(reply, Reply::Saved(_)).then_some(())
        })?;
        measured.save = Some(client.port().seconds() - since);
    }
    Ok(measured)
}

fn measure_all<P: Port>(
    client: &mut Client<'_, P>,
    info: BoxInfo,
    order: &Order,
    tell: &mut dyn FnMut(&str),
) -> Result<Measured, ClientError> {
    tell("clock and link");
    let began = instant(client)?;
    let crystal = probe(client, Probe::Crystal, |probed| match probed {
        Probed::Crystal(found) => Some(found),
        _ => None,
    })?;
    let mut trips = Vec::new();
    for stamp in 0..PINGS {
        let since = client.port().seconds();
        client.ping(stamp as u64)?;
        trips.push(client.port().seconds() - since);
    }
    trips.sort_by(f64::total_cmp);
    tell("buses");
    let mut loops = [None; BUSES.len()];
    for (number, slot) in (0..).zip(&mut loops) {
        *slot = probe(client, Probe::Loop(number), |probed| match probed {
            Probed::Loop(found) => Some(found),
            _ => None,
        })?;
    }
    tell("converters");
    let mut converters = [None; CHIPS];
    for (number, slot) in (0..).zip(&mut converters) {
        *slot = probe(client, Probe::Converter(number), |probed| match probed {
            Probed::Converter(found) => Some(found),
            _ => None,
        })?;
    }
    let mut take = |client: &mut Client<'_, P>, signal, bus, seconds: f64, name: &str| {
        tell(name);
        let sampling = Sampling {
            conditions: Conditions { signal, bus },
            seconds,
            rate: RATE,
        };
        sampled::take(client, sampling)
    };
    let usual = BusClock::Usual;
    let level = order.seconds.min(LEVELS);
    let signals = [
        take(client, Signal::Shorted, usual, level, "short circuits")?,
        take(client, Signal::TestPositive, usual, level, "test voltages")?,
        take(client, Signal::TestNegative, usual, level, "test voltages")?,
    ];
    let mut buses = [None, None, None];
    let clocks = [BusClock::Usual, BusClock::Half, BusClock::Double];
    for (slot, bus) in buses.iter_mut().zip(clocks) {
        let name = "checksums of frames";
        *slot = take(client, Signal::Shorted, bus, order.seconds, name)?;
    }
    let ended = instant(client)?;
    let round_trip = trips[PINGS / 2];
    Ok(Measured {
        clock: order
            .keeps_time
            .then(|| deviation(began, ended, info.tick_hz, round_trip)),
        info,
        crystal,
        loops,
        converters,
        signals,
        buses,
        round_trip,
        save: None,
    })
}

/// Time of this computer, s, and of the box, ticks.
fn instant<P: Port>(client: &mut Client<'_, P>) -> Result<(f64, u64), ClientError> {
    let ticks = client.ping(0)?.ticks;
    Ok((client.port().seconds(), ticks))
}

/// Deviation of the box's clock between two instants, and its largest error, as shares.
fn deviation(began: (f64, u64), ended: (f64, u64), tick_hz: u32, round_trip: f64) -> [f64; 2] {
    let seconds = ended.0 - began.0;
    let ticks = ended.1.saturating_sub(began.1) as f64;
    [
        ticks / f64::from(tick_hz) / seconds - 1.0,
        round_trip / seconds,
    ]
}

/// Asks for a measurement; `None` if the box cannot make it.
fn probe<P: Port, T>(
    client: &mut Client<'_, P>,
    probe: Probe,
    read: impl Fn(Probed) -> Option<T>,
) -> Result<Option<T>, ClientError> {
    let asked = client.ask(&Request::Probe(probe), |reply| match reply {
        Reply::Probed(probed) => read(*probed),
        _ => None,
    });
    match asked {
        Ok(found) => Ok(Some(found)),
        Err(ClientError::Refused(refused))
            if matches!(refused.problem, Problem::Unsupported(_)) =>
        {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}
