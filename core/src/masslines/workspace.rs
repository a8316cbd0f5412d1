//! The memory of the methods, apart from what grows with the number of lines.

use super::methods::apparent_mass::residuals::Residuals;
use super::regression::{Regression, Solution};
use super::{ApparentMass, FreeModes};
use crate::modes::PoleSearch;

/// Working memory of a method, and its results beside the masslines. It is lent, since the stack of
/// a small chip is too small.
#[derive(Clone, Debug)]
pub struct Workspace {
    pub(super) regression: Regression,
    /// The solution that is looked at, and the best so far.
    pub(super) candidate: Solution,
    pub(super) best: Solution,
    pub(super) residuals: Residuals,
    pub(super) search: PoleSearch,
    pub(super) apparent_mass: ApparentMass,
    pub(super) free_modes: FreeModes,
    /// The one of the two that is there.
    pub(super) found: Found,
}

/// Result of a method beside the masslines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    Nothing,
    ApparentMass,
    FreeModes,
}

impl Workspace {
    /// All zero, which takes no flash, and as good as any other state: methods do not care
    /// what they find.
    pub const EMPTY: Self = Self {
        regression: Regression::EMPTY,
        candidate: Solution::EMPTY,
        best: Solution::EMPTY,
        residuals: Residuals::EMPTY,
        search: PoleSearch::EMPTY,
        apparent_mass: ApparentMass::EMPTY,
        free_modes: FreeModes::EMPTY,
        found: Found::Nothing,
    };

    /// The fit behind the masslines, after [`super::Method::ApparentMass`].
    #[must_use]
    pub fn apparent_mass(&self) -> Option<&ApparentMass> {
        (self.found == Found::ApparentMass).then_some(&self.apparent_mass)
    }

    /// The modes behind the masslines, after [`super::Method::CurveFit`] and
    /// [`super::Method::Synthesis`].
    #[must_use]
    pub fn free_modes(&self) -> Option<&FreeModes> {
        (self.found == Found::FreeModes).then_some(&self.free_modes)
    }
}

impl Default for Workspace {
    fn default() -> Self {
        Self::EMPTY
    }
}
