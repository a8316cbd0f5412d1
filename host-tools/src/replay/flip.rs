//! One flipped bit on the way to the box, to see that a replay notices it.

use super::ReplayError;
use crate::measure::channel_names;
use crate::setup::Setup;

/// The bit that is flipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flip {
    /// Number of the run in the setup.
    pub run: usize,
    /// Index of the sample.
    pub sample: u64,
    /// Index of the channel in the samples.
    pub channel: usize,
    /// Bit of the reading's 32, from the least significant.
    pub bit: u32,
}

impl Flip {
    /// Reads `RUN:SAMPLE:CHANNEL:BIT`: number of the run from one, or its name; index of
    /// the sample from zero; name of the channel; bit from zero.
    ///
    /// # Errors
    /// [`ReplayError::Flip`].
    pub fn parse(text: &str, setup: &Setup) -> Result<Self, ReplayError> {
        let wrong = |reason: String| ReplayError::Flip {
            found: text.to_owned(),
            reason,
            channel: setup
                .accelerometers
                .first()
                .map_or_else(String::new, |a| a.channel.clone()),
        };
        // From the end, so that a run's name may hold a colon.
        let mut parts = text.rsplitn(4, ':');
        let (Some(bit), Some(channel), Some(sample), Some(run)) =
            (parts.next(), parts.next(), parts.next(), parts.next())
        else {
            return Err(wrong("it has not four parts".to_owned()));
        };
        let by_number = run.parse::<usize>().ok().and_then(|n| n.checked_sub(1));
        let number = by_number
            .filter(|&n| n < setup.runs.len())
            .or_else(|| setup.runs.iter().position(|r| r.name == run))
            .ok_or_else(|| wrong(format!("there is no run {run}")))?;
        let channels = channel_names(setup, &setup.runs[number]);
        Ok(Self {
            run: number,
            sample: sample
                .parse()
                .map_err(|_| wrong(format!("{sample} is no index of a sample")))?,
            channel: channels
                .iter()
                .position(|&name| name == channel)
                .ok_or_else(|| wrong(format!("run {run} has no channel {channel}")))?,
            bit: bit
                .parse()
                .ok()
                .filter(|bit| *bit < 32)
                .ok_or_else(|| wrong(format!("{bit} is no bit from 0 to 31")))?,
        })
    }

    /// Flips the bit if it is in this sample.
    pub fn apply(&self, run: usize, index: u64, sample: &mut [f32]) {
        if (run, index) == (self.run, self.sample)
            && let Some(reading) = sample.get_mut(self.channel)
        {
            *reading = f32::from_bits(reading.to_bits() ^ (1 << self.bit));
        }
    }
}
