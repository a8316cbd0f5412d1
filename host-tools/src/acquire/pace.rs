//! Check that samples come at the rate that the box states.

use super::AcquireError;
use crate::limits;
use massline_firmware::wire::Event;

/// Compares the numbers of samples with the time at which they come.
#[derive(Clone, Debug)]
pub(super) struct Pace {
    /// Hz.
    rate: f64,
    /// Number and time of the first sample that came.
    first: Option<(u64, f64)>,
    /// Time since then, s.
    elapsed: f64,
}

impl Pace {
    /// For converters that are set to a rate in Hz.
    pub(super) const fn new(rate: f64) -> Self {
        Self {
            rate,
            first: None,
            elapsed: 0.0,
        }
    }

    /// Takes note of an event that came at a time, s.
    ///
    /// # Errors
    /// [`AcquireError::Lead`]: rows for its samples, and for those that are missing before them,
    /// would be more than that time can have brought.
    pub(super) fn take(&mut self, event: &Event<'_>, seconds: f64) -> Result<(), AcquireError> {
        let number = match event {
            Event::Recorded(samples) => samples.first,
            Event::RecordedFaulty(faulty) => faulty.samples.first,
            _ => return Ok(()),
        };
        let (first, since) = *self.first.get_or_insert((number, seconds));
        self.elapsed = seconds - since;
        let samples = number.saturating_sub(first);
        let nominal = samples as f64 / self.rate;
        let most = limits::LONGEST_LEAD + (1.0 + limits::CLOCK) * self.elapsed;
        // What is no number is too much as well.
        if nominal.is_nan() || nominal > most {
            return Err(AcquireError::Lead {
                samples,
                nominal,
                rate: self.rate,
                seconds: self.elapsed,
            });
        }
        Ok(())
    }

    /// # Errors
    /// [`AcquireError::Overtime`]: so many seconds of samples should be here by now.
    pub(super) fn check(&self, wanted: Option<f64>) -> Result<(), AcquireError> {
        match wanted {
            Some(wanted) if self.elapsed > limits::overtime(wanted) => {
                Err(AcquireError::Overtime {
                    wanted,
                    seconds: self.elapsed,
                })
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use massline_firmware::wire::{Packed, Samples, Values};

    fn sample(first: u64) -> Event<'static> {
        Event::Recorded(Samples {
            first,
            channels: 1,
            values: Values::Counts(Packed::new(&[0])),
        })
    }

    #[test]
    fn a_lead_is_one_beyond_a_minute_and_what_a_clock_is_off() {
        let mut pace = Pace::new(512.0);
        pace.take(&sample(1000), 5.0).unwrap();
        // After a hundred seconds: these, a minute more, and five percent of them.
        let most = 1000 + 512 * (60 + 105);
        assert!(pace.take(&sample(most), 105.0).is_ok());
        let error = pace.take(&sample(most + 1), 105.0).unwrap_err();
        assert!(matches!(error, AcquireError::Lead { .. }), "{error}");
        // A rate that is no number lets nothing through.
        let mut pace = Pace::new(f64::NAN);
        assert!(pace.take(&sample(1000), 5.0).is_err());
    }

    #[test]
    fn overtime_is_counted_from_the_first_sample() {
        let mut pace = Pace::new(512.0);
        pace.take(&sample(7), 1000.0).unwrap();
        pace.take(&sample(8), 1050.0).unwrap();
        // Twice ten seconds and thirty are fifty.
        assert!(pace.check(Some(10.0)).is_ok() && pace.check(None).is_ok());
        pace.take(&sample(9), 1050.1).unwrap();
        let error = pace.check(Some(10.0)).unwrap_err();
        assert!(matches!(error, AcquireError::Overtime { .. }), "{error}");
        assert!(pace.check(None).is_ok());
    }
}
