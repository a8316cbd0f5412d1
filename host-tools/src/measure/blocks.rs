//! Storage of blocks on a workstation, whose processor calculates with eight channels at once.

use massline_core::spectra::{BlockSettings, Blocks, Complex32, SpectraError};

/// Samples of eight channels.
type Eight = [f32; 8];

/// Storage of the blocks of a stream of samples.
pub struct BlockStorage {
    settings: BlockSettings,
    channels: usize,
    history: Vec<f32>,
    work: Vec<nalgebra::Complex<Eight>>,
    lines: Vec<Complex32>,
}

impl BlockStorage {
    /// That of blocks of `channels` channels.
    #[must_use]
    pub fn new(settings: BlockSettings, channels: usize) -> Self {
        let [history, work, lines] = Blocks::<Eight>::storage_len(&settings, channels);
        Self {
            settings,
            channels,
            history: vec![0.0; history],
            work: vec![Default::default(); work],
            lines: vec![Complex32::default(); lines],
        }
    }

    /// Blocks from their beginning.
    ///
    /// # Errors
    /// [`SpectraError`] if the settings do not suit.
    pub fn blocks(&mut self) -> Result<Blocks<'_, Eight>, SpectraError> {
        let Self {
            settings,
            channels,
            history,
            work,
            lines,
        } = self;
        Blocks::new(*settings, *channels, history, work, lines)
    }
}
