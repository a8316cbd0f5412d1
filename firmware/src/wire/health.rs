//! What can be wrong with a channel.

use super::Packed;
use serde::{Deserialize, Serialize};

/// Faults of a channel or of a block, as a set. Bits that this side does not know are
/// kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Health(pub u16);

impl Health {
    /// No fault.
    pub const GOOD: Self = Self(0);
    /// Beyond the sensor's or the converter's range, or within the hold-off after it.
    pub const OVERLOAD: Self = Self(1 << 0);
    /// Samples that never came.
    pub const MISSING: Self = Self(1 << 1);
    /// The converter's checksum did not match.
    pub const CHECKSUM: Self = Self(1 << 2);
    /// No sensor, or a broken lead.
    pub const OPEN: Self = Self(1 << 3);
    /// The reading does not move.
    pub const STUCK: Self = Self(1 << 4);
    /// This converter's samples are not taken together with the others'.
    pub const OUT_OF_STEP: Self = Self(1 << 5);
    /// The converter has reset itself.
    pub const CONVERTER_RESET: Self = Self(1 << 6);
    /// A reading that is not a finite number.
    pub const NOT_FINITE: Self = Self(1 << 7);

    /// Number of faults that have a name, which are the lowest bits.
    pub const KINDS: usize = 8;

    /// Whether all faults of `other` are among these.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// The faults of both.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether there is no fault.
    #[must_use]
    pub const fn is_good(self) -> bool {
        self.0 == 0
    }
}

/// The faults of all channels, sent whenever one of them changes: the whole state, so
/// that a lost event is made up for by the next one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChannelHealth<'a> {
    /// Index of the sample at which they changed.
    pub sample: u64,
    /// Bits of [`Health`] for each channel of a sample.
    #[serde(borrow)]
    pub channels: Packed<'a, u16>,
}

/// Live levels of the channels since the last such event.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Levels<'a> {
    /// Index of the sample after the last one that went in.
    pub sample: u64,
    /// Samples that went in.
    pub samples: u32,
    /// Mean of each channel, m/s², N, N m or the drive's unit.
    #[serde(borrow)]
    pub mean: Packed<'a, f32>,
    /// Root mean square about that mean.
    #[serde(borrow)]
    pub rms: Packed<'a, f32>,
    /// Largest distance from zero.
    #[serde(borrow)]
    pub peak: Packed<'a, f32>,
}
