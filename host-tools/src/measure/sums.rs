//! Running sums of a consumer's channels, whatever the number of drives.

use super::drives::DrivesAverage;
use super::stream::Seen;
use massline_core::spectra::{
    Average, BlockSettings, CrossAverage, CrossSums, DriveAverage, SpectraError, Sum,
};

/// Storage of running sums, of which one list is filled.
#[derive(Default)]
pub(super) struct SumStorage {
    /// Those without a drive, line by line.
    pub cross: Vec<CrossSums>,
    driven: Vec<Sum>,
}

/// Running sums.
pub(super) enum Sums<'s> {
    /// The cross-spectral matrix of the twelve resultants, without a drive.
    Cross(CrossAverage<'s>),
    /// Referred to one drive.
    One(DriveAverage<'s>),
    /// Referred to several drives.
    Several(DrivesAverage),
}

impl<'s> Sums<'s> {
    /// Sums of `channels` channels, which are the twelve resultants where there is no drive; `storage` becomes as
    /// large as they need.
    ///
    /// # Errors
    /// [`SpectraError`] where they do not suit.
    pub(super) fn new(
        settings: &BlockSettings,
        drives: usize,
        channels: usize,
        storage: &'s mut SumStorage,
    ) -> Result<Self, SpectraError> {
        Ok(match drives {
            0 => {
                storage.cross = vec![CrossSums::default(); settings.grid().count];
                Self::Cross(CrossAverage::new(settings, &mut storage.cross)?)
            }
            1 => {
                storage.driven = vec![Sum::ZERO; DriveAverage::storage_len(settings, channels)];
                Self::One(DriveAverage::new(settings, channels, &mut storage.driven)?)
            }
            several => Self::Several(DrivesAverage::new(settings, several, channels)),
        })
    }

    /// `true` where every channel of a block enters: none may be another consumer's.
    pub(super) fn are_of_whole_blocks(&self) -> bool {
        matches!(self, Self::Cross(_))
    }

    /// Takes a block.
    pub(super) fn add(&mut self, block: &Seen<'_>) {
        match self {
            Self::Cross(average) => average.add(block.block),
            Self::One(average) => {
                let drive = block.channel(0);
                average.add_drive(drive);
                for c in 0..block.responses(1) {
                    average.add_response(c, drive, block.channel(1 + c));
                }
            }
            Self::Several(average) => average.add_channels(&|c| block.channel(c)),
        }
    }

    /// Blocks so far.
    pub(super) fn blocks(&self) -> u32 {
        match self {
            Self::Cross(average) => average.blocks(),
            Self::One(average) => average.blocks(),
            Self::Several(average) => average.blocks(),
        }
    }
}
