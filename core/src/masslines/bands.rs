//! The lines that a method works on, and the weights of its equations.

use crate::modes::MAX_MODES;
use crate::spectra::LineRange;

/// Weights of the six equations of motion of a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EquationWeights {
    /// By the noise of the run. The answer does not depend on the reference point.
    #[default]
    Noise,
    /// All alike, newtons and newton metres, about the given reference point: as the paper
    /// has it. The apparent mass does not know this.
    Unit,
}

/// Ranges of the kept lines by their use, and the weights of equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Bands {
    /// The averaging band: the rigid body is read from these.
    pub averaging: LineRange,
    /// Lines in which elastic modes are looked for and fitted.
    pub fit: LineRange,
    /// Most elastic modes that methods d and e take account of.
    pub modes: usize,
    /// Weights of the equations in methods a to e.
    pub equations: EquationWeights,
}

impl Bands {
    /// The averaging band, with modes looked for in all the lines it was chosen from.
    #[must_use]
    pub fn new(averaging: LineRange) -> Self {
        Self {
            averaging,
            fit: LineRange::all(averaging.count()),
            modes: MAX_MODES,
            equations: EquationWeights::Noise,
        }
    }
}
