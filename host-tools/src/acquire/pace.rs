//! Whether samples come as fast as the box's rate says.

use super::AcquireError;
use crate::limits;
use massline_core::wire::Event;

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
        if !(nominal <= most) {
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
