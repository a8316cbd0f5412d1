//! Settings of the spectral analysis: blocks, window and kept lines.

use crate::capacity::{BLOCK_LENGTH, LINES};
use crate::instrument::limits::{fits, within};
use crate::wire::{Field, Grid, Item, Problem, Processing};
use massline_core::masslines::MIN_LINES;
use massline_core::spectra::{BandError, BlockSettings, LineGrid, LineRange, SpectraError};

/// Highest accepted sample rate, Hz.
const SAMPLE_RATE_MAX: f64 = 1e6;

/// Decimations of a block whose lines begin at the bottom of the spectrum: each halves it, as
/// long as the last line stays within 25/64 of what is left.
pub(in crate::instrument) const DECIMATIONS: usize = {
    let mut count = 0;
    while count < 4 && 64 * LINES <= 25 * (BLOCK_LENGTH >> (count + 1)) {
        count += 1;
    }
    count
};
/// Decimated samples of a block.
pub(in crate::instrument) const TRANSFORM: usize = BLOCK_LENGTH >> DECIMATIONS;

/// Settings of the spectral analysis, checked.
#[derive(Clone, Debug)]
pub(in crate::instrument) struct Lines {
    /// Blocks, window and kept lines.
    pub(in crate::instrument) settings: BlockSettings,
    /// The averaging band, as kept lines.
    pub(in crate::instrument) band: LineRange,
    /// The mode band, as kept lines.
    pub(in crate::instrument) modes: Option<LineRange>,
}

impl Lines {
    /// Checks a processing and computes its lines.
    pub(super) fn new(p: &Processing) -> Result<Self, Problem> {
        within(
            Field::SampleRate,
            0,
            p.sample_rate,
            f64::MIN_POSITIVE,
            SAMPLE_RATE_MAX,
        )?;
        let length = p.block_length as usize;
        if length > BLOCK_LENGTH || !length.is_power_of_two() || length < 16 {
            let most = BLOCK_LENGTH as f64;
            return Err(Problem::range(
                Field::BlockLength,
                0,
                length as f64,
                [16.0, most],
            ));
        }
        let nyquist = p.sample_rate / 2.0;
        let bands = [
            (Field::KeptBand, Some(p.kept_band)),
            (Field::AveragingBand, Some(p.averaging_band)),
            (Field::ModeBand, p.mode_band),
        ];
        for (field, band) in bands {
            if let Some([low, high]) = band {
                within(field, 0, low, 0.0, nyquist)?;
                within(field, 0, high, low, nyquist)?;
            }
        }
        let settings = BlockSettings::new(length, p.overlap, p.window, p.sample_rate, p.kept_band);
        let settings = settings.map_err(|e| match e {
            SpectraError::BlockLength(found) => {
                let most = BLOCK_LENGTH as f64;
                Problem::range(Field::BlockLength, 0, found as f64, [16.0, most])
            }
            SpectraError::Overlap(found) => Problem::range(Field::Overlap, 0, found, [0.0, 0.95]),
            SpectraError::Band { last, usable, .. } => {
                let spacing = p.sample_rate / length as f64;
                let [found, high] = [last, usable].map(|line| line as f64 * spacing);
                Problem::range(Field::KeptBand, 0, found, [spacing, high])
            }
            SpectraError::BandEnds([_, high]) => {
                Problem::range(Field::KeptBand, 0, high, [0.0, nyquist])
            }
            SpectraError::SampleRate(found) => Problem::range(
                Field::SampleRate,
                0,
                found,
                [f64::MIN_POSITIVE, SAMPLE_RATE_MAX],
            ),
            SpectraError::OtherLines { band, lines } => Problem::count(Item::Line, band, lines),
            SpectraError::Storage { needed, given } => Problem::capacity(Item::Line, needed, given),
            _ => Problem::missing(Item::Line, 0),
        })?;
        let grid = settings.grid();
        fits(Item::Line, grid.count, LINES)?;
        // Lines far up in the spectrum leave less to decimate, so that a block takes more room.
        fits(Item::Sample, settings.transform_length(), TRANSFORM)?;
        let band = lines_of(&grid, Field::AveragingBand, p.averaging_band)?;
        if band.indices().len() < MIN_LINES {
            return Err(Problem::count(Item::Line, band.indices().len(), MIN_LINES));
        }
        let modes = match p.mode_band {
            Some(band) => Some(lines_of(&grid, Field::ModeBand, band)?),
            None => None,
        };
        if modes.as_ref().is_some_and(|band| band.indices().is_empty()) {
            return Err(Problem::missing(Item::ModeBand, 0));
        }
        Ok(Self {
            settings,
            band,
            modes,
        })
    }

    /// The lines as a message to the host.
    pub(in crate::instrument) fn grid(&self) -> Grid {
        Grid {
            lines: self.settings.grid(),
            hop: self.settings.hop() as u32,
            band: [
                self.band.indices().start as u32,
                self.band.indices().end as u32,
            ],
        }
    }
}

/// The kept lines of a band, Hz.
pub(in crate::instrument) fn lines_of(
    grid: &LineGrid,
    field: Field,
    band: [f64; 2],
) -> Result<LineRange, Problem> {
    grid.within(band).map_err(|why| {
        let [low, high] = match why {
            BandError::Beyond {
                lines: Some(lines), ..
            } => lines,
            // The ends were checked before.
            _ => [0.0, f64::MAX],
        };
        let found = if band[1] > high { band[1] } else { band[0] };
        Problem::range(field, 0, found, [low, high])
    })
}
