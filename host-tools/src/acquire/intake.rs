//! Messages to rows.

use super::AcquireError;
use crate::inputs::InputEntry;
use crate::limits;
use massline_firmware::calibration::Channel;
use massline_firmware::wire::{Event, Health, Packed, Samples, Values};

/// Samples at the beginning that may be left out because converters still settle.
const LEAD: u64 = 16;

/// One sample of the chosen inputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row<'a> {
    /// Its number since the converters' start.
    pub number: u64,
    /// SI, input by input; zero where the sample is missing.
    pub si: &'a [f32],
    /// Faults, input by input.
    pub health: &'a [Health],
}

impl Row<'_> {
    /// The faults of all inputs.
    #[must_use]
    pub fn all(&self) -> Health {
        self.health.iter().fold(Health::GOOD, |a, b| a.union(*b))
    }
}

/// Turns messages into rows. The first row is one without a fault, unless there is none among
/// the first samples.
#[derive(Clone, Debug)]
pub struct Intake {
    inputs: Vec<(InputEntry, Channel)>,
    /// Hz.
    rate: f64,
    /// Number of the sample that is expected next.
    next: Option<u64>,
    /// Samples that were left out at the beginning, which is over once there was a row.
    led: Option<u64>,
    si: Vec<f32>,
    health: Vec<Health>,
}

impl Intake {
    /// For these inputs, at a sample rate in Hz.
    #[must_use]
    pub fn new(inputs: &[InputEntry], sample_rate: f64) -> Self {
        let channel = |entry: &InputEntry| entry.certificate.channel(sample_rate as f32);
        Self {
            inputs: inputs.iter().map(|e| (e.clone(), channel(e))).collect(),
            rate: sample_rate,
            next: None,
            led: Some(0),
            si: vec![0.0; inputs.len()],
            health: vec![Health::GOOD; inputs.len()],
        }
    }

    /// Takes an event; shows `take` the rows that it brings, those before it that are missing
    /// included. The number of the last one, if it brings any.
    ///
    /// # Errors
    /// [`AcquireError::Restarted`], [`AcquireError::Gap`], [`AcquireError::Number`],
    /// [`AcquireError::Inputs`].
    pub fn take(
        &mut self,
        event: &Event<'_>,
        take: &mut dyn FnMut(&Row<'_>),
    ) -> Result<Option<u64>, AcquireError> {
        let (samples, faults) = match event {
            Event::Recorded(samples) => (samples, Packed::new(&[])),
            Event::RecordedFaulty(faulty) => (&faulty.samples, faulty.health),
            _ => return Ok(None),
        };
        let channels = usize::from(samples.channels);
        let count = samples.count().unwrap_or(0) as u64;
        let outside = |(e, _): &&(InputEntry, Channel)| usize::from(e.input) >= channels;
        if let Some((entry, _)) = self.inputs.iter().find(outside) {
            return Err(AcquireError::Inputs {
                found: channels,
                input: entry.number(),
            });
        }
        let end = samples.first.checked_add(count);
        let end = end.filter(|&end| end <= limits::LAST_SAMPLE);
        let end = end.ok_or(AcquireError::Number {
            found: samples.first,
        })?;
        let expected = self.next.unwrap_or(samples.first);
        let missing = samples
            .first
            .checked_sub(expected)
            .ok_or(AcquireError::Restarted {
                found: samples.first,
                last: expected.saturating_sub(1),
            })?;
        let seconds = missing as f64 / self.rate;
        // What is no number is too much as well.
        if seconds.is_nan() || seconds > limits::LONGEST_GAP {
            return Err(AcquireError::Gap { missing, seconds });
        }
        for number in expected..samples.first {
            for (k, (_, channel)) in self.inputs.iter_mut().enumerate() {
                // The watch's hold-off goes on.
                (_, self.health[k]) = channel.count(0, Health::MISSING);
                self.si[k] = 0.0;
            }
            self.show(number, take);
        }
        for at in 0..count {
            for (k, (entry, channel)) in self.inputs.iter_mut().enumerate() {
                let input = usize::from(entry.input);
                let known = Health(faults.get(input).unwrap_or(0));
                let value = at as usize * channels + input;
                let (si, health) = read(samples, value, channel, known);
                self.si[k] = si;
                self.health[k] = health;
            }
            self.show(samples.first + at, take);
        }
        self.next = Some(end);
        Ok(end.checked_sub(1).filter(|_| count > 0))
    }

    /// Shows the row that has been read.
    fn show(&mut self, number: u64, take: &mut dyn FnMut(&Row<'_>)) {
        let row = Row {
            number,
            si: &self.si,
            health: &self.health,
        };
        if let Some(led) = &mut self.led {
            if !row.all().is_good() && *led < LEAD {
                *led += 1;
                return;
            }
            self.led = None;
        }
        take(&row);
    }
}

fn read(samples: &Samples<'_>, at: usize, channel: &mut Channel, known: Health) -> (f32, Health) {
    let missing = (0.0, Health::MISSING);
    match samples.values {
        Values::Counts24(list) => list
            .get(at)
            .map_or(missing, |x| channel.count(x.get(), known)),
        Values::Counts(list) => list.get(at).map_or(missing, |x| channel.count(x, known)),
        // SI already. A recording has room for numbers only.
        Values::Readings(list) => match list.get(at) {
            Some(x) if x.is_finite() => (x, known),
            Some(_) => (0.0, known.union(Health::NOT_FINITE)),
            None => missing,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use massline_firmware::calibration::Certificate;

    fn intake() -> Intake {
        let entry = InputEntry {
            input: 0,
            channel: None,
            certificate: Certificate::UNUSED,
        };
        Intake::new(&[entry], 512.0)
    }

    fn take(intake: &mut Intake, first: u64) -> Result<Option<u64>, AcquireError> {
        let samples = Samples {
            first,
            channels: 1,
            values: Values::Counts(Packed::new(&[1, 2, 3, 4, 5])),
        };
        intake.take(&Event::Recorded(samples), &mut |_| ())
    }

    #[test]
    fn a_reading_that_is_no_number_is_a_fault() {
        let samples = Samples {
            first: 0,
            channels: 1,
            values: Values::Readings(Packed::new(&[1.5, f32::NAN, f32::INFINITY, 2.5])),
        };
        let mut rows = Vec::new();
        let taken = intake().take(&Event::Recorded(samples), &mut |row| {
            rows.push((row.si[0], row.all()));
        });
        assert_eq!(taken.unwrap(), Some(3));
        let bad = (0.0, Health::NOT_FINITE);
        assert_eq!(rows, [(1.5, Health::GOOD), bad, bad, (2.5, Health::GOOD)]);
    }

    #[test]
    fn numbers_have_an_end() {
        for first in [
            u64::MAX,
            u64::MAX - 4,
            u64::MAX - 5,
            limits::LAST_SAMPLE - 4,
        ] {
            let error = take(&mut intake(), first).unwrap_err();
            let AcquireError::Number { found } = error else {
                panic!("{error}");
            };
            assert_eq!(found, first);
        }
        let last = take(&mut intake(), limits::LAST_SAMPLE - 5).unwrap();
        assert_eq!(last, Some(limits::LAST_SAMPLE - 1));
    }

    #[test]
    fn a_gap_is_bridged_up_to_a_minute() {
        let mut begun = intake();
        take(&mut begun, 0).unwrap();
        let minute = 60 * 512;
        let error = take(&mut begun.clone(), 5 + minute + 1).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("30721 samples are missing at once"), "{text}");
        assert!(text.contains("at most 60 s"), "{text}");
        assert!(take(&mut begun, 5 + minute).is_ok());
    }
}
