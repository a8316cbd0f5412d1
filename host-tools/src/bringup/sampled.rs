//! Mean and noise of each input while samples come, with the faults and the load of the box meanwhile.

use crate::device::{Client, ClientError, Port};
use crate::limits;
use massline_firmware::acquisition::SETTLING;
use massline_firmware::sampling::INPUTS;
use massline_firmware::wire::{
    Conditions, DRDY_LINES, Event, FaultCounters, Health, Packed, Probe, Probed, Problem, Request,
    Samples, Stream, Subscription, Values,
};
use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

/// Time between two looks at the skew of the converters.
const LOOK: Duration = Duration::from_millis(50);
/// Period of telemetry, ms.
const TELEMETRY: u16 = 100;

/// Samples that are to be taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampling {
    /// Conditions under which they are taken.
    pub(super) conditions: Conditions,
    /// Their time, s.
    pub(super) seconds: f64,
    /// Their rate, Hz.
    pub(super) rate: f64,
}

/// Mean and noise of an input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Number of samples without a fault.
    pub samples: u64,
    /// Their mean, counts.
    pub mean: f64,
    /// Sum of squared distances from it.
    squares: f64,
}

impl Statistics {
    /// Takes a count (Welford's update).
    fn take(&mut self, count: i32) {
        let count = f64::from(count);
        self.samples += 1;
        let before = count - self.mean;
        self.mean += before / self.samples as f64;
        self.squares += before * (count - self.mean);
    }

    /// RMS about the mean, counts.
    #[must_use]
    pub fn rms(&self) -> f64 {
        (self.squares / self.samples.max(1) as f64).sqrt()
    }
}

/// Statistics of the samples of a time, with the faults and the load of the box meanwhile.
#[derive(Clone, Debug)]
pub struct Sampled {
    /// Each input.
    pub inputs: [Statistics; INPUTS],
    /// Samples between the first and the last one, those included that did not come.
    pub samples: u64,
    /// Samples of them that did not come over the link.
    pub missing: u64,
    /// Faults that were counted meanwhile.
    pub faults: FaultCounters,
    /// Largest time from the first DRDY line to each of them, ticks; `None` for one without edges.
    pub skew: [Option<u16>; DRDY_LINES],
    /// Load of the processor in the last tenth of a second, thousandths.
    pub load: Option<u16>,
    /// Bytes of samples in a second.
    pub bytes_per_second: f64,
}

/// Statistics of the events so far.
#[derive(Debug)]
struct Heard {
    inputs: [Statistics; INPUTS],
    /// Number of the next sample, and of the first one.
    next: Option<u64>,
    first: u64,
    taken: u64,
    bytes: usize,
    load: Option<u16>,
}

impl Heard {
    fn take(&mut self, event: &Event<'_>) {
        match event {
            Event::Recorded(samples) => self.add(samples, Packed::new(&[])),
            Event::RecordedFaulty(faulty) => self.add(&faulty.samples, faulty.health),
            Event::Telemetry(telemetry) => self.load = Some(telemetry.load),
            _ => {}
        }
    }

    fn add(&mut self, samples: &Samples<'_>, faults: Packed<'_, u16>) {
        let (channels, count) = (usize::from(samples.channels), samples.count());
        let Some(count) = count.filter(|_| channels <= INPUTS) else {
            return;
        };
        let next = samples.first.checked_add(count as u64);
        let Some(next) = next.filter(|next| *next <= limits::LAST_SAMPLE) else {
            return;
        };
        if self.next.is_some_and(|expected| samples.first < expected) {
            return;
        }
        if self.next.is_none() {
            self.first = samples.first;
        }
        self.next = Some(next);
        self.taken += count as u64;
        let bytes = match samples.values {
            Values::Counts24(_) => 3,
            Values::Counts(_) | Values::Readings(_) => 4,
        };
        self.bytes += bytes * samples.values.len();
        for at in 0..count * channels {
            let (number, input) = (samples.first + (at / channels) as u64, at % channels);
            let is_good = Health(faults.get(input).unwrap_or(0)).is_good();
            let count = match samples.values {
                Values::Counts24(list) => list.get(at).map(|x| x.get()),
                Values::Counts(list) => list.get(at),
                Values::Readings(_) => None,
            };
            // The modulators settle after a change of their input.
            if let Some(count) = count
                && is_good
                && number > 2 * u64::from(SETTLING)
            {
                self.inputs[input].take(count);
            }
        }
    }
}

/// Has the box send samples for a time. `None` if it has no inputs; without samples if its converters
/// do not start.
pub(super) fn take<P: Port>(
    client: &mut Client<'_, P>,
    sampling: Sampling,
) -> Result<Option<Sampled>, ClientError> {
    let before = client.hello()?.faults;
    let heard = Rc::new(RefCell::new(Heard {
        inputs: [Statistics::default(); INPUTS],
        next: None,
        first: 0,
        taken: 0,
        bytes: 0,
        load: None,
    }));
    let theirs = Rc::clone(&heard);
    client.on_event(move |event, _| theirs.borrow_mut().take(event));
    let followed = follow(client, sampling);
    client.on_event(|_, _| ());
    let skew = match followed {
        Ok(skew) => skew,
        Err(ClientError::Refused(refused)) => match refused.problem {
            Problem::Unsupported(_) => return Ok(None),
            Problem::Converter { .. } => [None; DRDY_LINES],
            _ => return Err(ClientError::Refused(refused)),
        },
        Err(error) => return Err(error),
    };
    let after = client.hello()?.faults;
    let heard = heard.borrow();
    let samples = heard.next.map_or(0, |next| next - heard.first);
    Ok(Some(Sampled {
        inputs: heard.inputs,
        samples,
        missing: samples - heard.taken,
        faults: since(&before, &after),
        skew,
        load: heard.load,
        bytes_per_second: heard.bytes as f64 * sampling.rate / heard.taken.max(1) as f64,
    }))
}

/// Lets samples come for a time. The largest skews of the DRDY lines.
fn follow<P: Port>(
    client: &mut Client<'_, P>,
    sampling: Sampling,
) -> Result<[Option<u16>; DRDY_LINES], ClientError> {
    client.tell(&Request::Subscribe(Subscription {
        telemetry: TELEMETRY,
        samples: Stream::Test(sampling.conditions),
        ..Subscription::default()
    }))?;
    let end = client.port().seconds() + sampling.seconds;
    let mut skew = [None; DRDY_LINES];
    while client.port().seconds() < end {
        client.listen(LOOK)?;
        let found = super::probe(client, Probe::Skew, |probed| match probed {
            Probed::Skew(found) => Some(found),
            _ => None,
        })?;
        for (slot, found) in skew.iter_mut().zip(found.into_iter().flatten()) {
            *slot = (*slot).max(found);
        }
    }
    client.tell(&Request::Subscribe(Subscription::default()))?;
    Ok(skew)
}

/// Faults between two readings of the counters.
fn since(before: &FaultCounters, after: &FaultCounters) -> FaultCounters {
    let less = u32::saturating_sub;
    FaultCounters {
        converter_checksum: less(after.converter_checksum, before.converter_checksum),
        converter_missed: less(after.converter_missed, before.converter_missed),
        converter_reset: less(after.converter_reset, before.converter_reset),
        out_of_step: less(after.out_of_step, before.out_of_step),
        overrun: less(after.overrun, before.overrun),
        ..FaultCounters::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_noise_are_those_of_the_definition() {
        let counts = [8_388_000, 8_388_007, 8_387_996, 8_388_001];
        let mut statistics = Statistics::default();
        counts.iter().for_each(|count| statistics.take(*count));
        let mean = counts.iter().map(|c| f64::from(*c)).sum::<f64>() / 4.0;
        let squares = counts.iter().map(|c| (f64::from(*c) - mean).powi(2));
        let rms = (squares.sum::<f64>() / 4.0).sqrt();
        assert_eq!(statistics.samples, 4);
        assert!((statistics.mean - mean).abs() < 1e-6);
        assert!((statistics.rms() - rms).abs() < 1e-6);
        assert_eq!(Statistics::default().rms(), 0.0);
    }
}
