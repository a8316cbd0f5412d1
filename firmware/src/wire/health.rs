//! Faults of channels.

use super::Packed;
use serde::{Deserialize, Serialize};

/// Set of faults of a channel or of a block. Bits without a name are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Health(pub u16);

impl Health {
    /// No fault.
    pub const GOOD: Self = Self(0);
    /// The reading is beyond the range of the sensor or the converter, or within the hold-off
    /// after that.
    pub const OVERLOAD: Self = Self(1 << 0);
    /// Samples are missing.
    pub const MISSING: Self = Self(1 << 1);
    /// The checksum of the converter did not match.
    pub const CHECKSUM: Self = Self(1 << 2);
    /// The input has no sensor, or a lead is broken.
    pub const OPEN: Self = Self(1 << 3);
    /// The reading does not change.
    pub const STUCK: Self = Self(1 << 4);
    /// The converter does not sample at the same time as the others.
    pub const OUT_OF_STEP: Self = Self(1 << 5);
    /// The converter has reset itself.
    pub const CONVERTER_RESET: Self = Self(1 << 6);
    /// The reading is not a finite number.
    pub const NOT_FINITE: Self = Self(1 << 7);

    /// Number of faults that have a name; they are the lowest bits.
    pub const KINDS: usize = 8;

    /// `true` if this set has all faults of `other`.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Union of two sets.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// `true` if the set is empty.
    #[must_use]
    pub const fn is_good(self) -> bool {
        self.0 == 0
    }
}

/// Faults of all channels. The event is sent whenever one of them changes, and has the whole state,
/// so that the next event makes up for a lost one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChannelHealth<'a> {
    /// Index of the sample at which the faults changed.
    pub sample: u64,
    /// Bits of [`Health`] for each channel of a sample.
    #[serde(borrow)]
    pub channels: Packed<'a, u16>,
}

/// Levels of the channels since the last such event.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Levels<'a> {
    /// Index of the sample after the last one that is included.
    pub sample: u64,
    /// Number of samples that are included.
    pub samples: u32,
    /// Mean of each channel, m/s², N, N m or the unit of the drive.
    #[serde(borrow)]
    pub mean: Packed<'a, f32>,
    /// Root mean square about the mean, same units.
    #[serde(borrow)]
    pub rms: Packed<'a, f32>,
    /// Largest magnitude, same units.
    #[serde(borrow)]
    pub peak: Packed<'a, f32>,
}
