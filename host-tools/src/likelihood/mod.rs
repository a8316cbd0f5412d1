//! Maximum likelihood: the apparent mass fitted through the resonances, line by line of the
//! record's unwindowed transform.
//!
//! | file | does |
//! | --- | --- |
//! | `record` | lines of a run and their noise |
//! | `model` | apparent mass, leakage of a mode, derivatives |
//! | `complex` | complex 6 x 6 matrices |
//! | `normal` | misfit, gradient and information of one record |
//! | `descent` | Levenberg-Marquardt |
//! | `excited` | directions in which the base moves |
//! | `search`, `start` | start values, mode by mode |
//! | `tilt` | uncertainty of these directions |
//! | `fit` | all steps, covariance, tests |
//! | `bound` | Cramér-Rao bound of a model and a test |
//! | `transform`, `noise` | records to lines, and what the drive does not explain |
//! | `rigid` | σ to mass, centre of gravity and inertia |

pub mod bound;
mod complex;
mod descent;
mod excited;
mod fit;
mod model;
pub mod noise;
mod normal;
mod record;
mod rigid;
mod search;
mod start;
#[cfg(test)]
mod tests;
mod tilt;
mod transform;

pub use fit::{Covariance10, DISAGREEMENT, Doubt, Fit, FitError, Options, RATIO, fit};
pub use model::{FittedMode, Model, RIGID};
pub use record::{Complex6, Noise, Record, highest, real_equations};
pub use rigid::{covariance_of, numbers, sigma_of};
pub use start::MOST_MODES;
pub use transform::{Lines, transform};

/// Step that a fit is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Modes are looked for.
    Modes,
    /// All lines are fitted.
    Lines,
}

/// State of a fit that is under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Step.
    pub stage: Stage,
    /// Modes found.
    pub modes: usize,
    /// Iteration of the step.
    pub iteration: usize,
    /// V.
    pub misfit: f64,
}
