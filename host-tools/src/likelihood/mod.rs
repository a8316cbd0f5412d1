//! Maximum likelihood: the apparent mass fitted through the resonances, line by line of the
//! record's unwindowed transform.
//!
//! | file | does |
//! | --- | --- |
//! | `record` | lines of a run and their noise |
//! | `model` | apparent mass, leakage of a mode, derivatives |
//! | `about` | the same about another point |
//! | `lanes` | numbers of neighbouring lines side by side |
//! | `resonances`, `batch` | a mode, and a whole model, beside neighbouring lines |
//! | `leakage` | misfit, with what the ends of a record add |
//! | `columns`, `products` | derivatives at neighbouring lines, and sums over these |
//! | `normal` | gradient and information of one record |
//! | `solve` | symmetric systems of equations |
//! | `descent` | Levenberg-Marquardt |
//! | `excited` | directions in which the base moves |
//! | `tilt` | uncertainty of these directions |
//! | `guess` | inertia that the test does not tell |
//! | `shrinkage` | estimates of many terms that may all be zero |
//! | `search`, `start` | start values, mode by mode |
//! | `fit` | all steps, covariance |
//! | `doubt` | tests of whether it holds |
//! | `bound` | Cramér-Rao bound of a model and a test |
//! | `transform`, `noise` | records to lines, and what the drive does not explain |
//! | `rigid` | σ to mass, centre of gravity and inertia |

mod about;
mod batch;
pub mod bound;
mod columns;
mod descent;
mod doubt;
mod excited;
mod fit;
mod guess;
mod lanes;
mod leakage;
mod model;
pub mod noise;
mod normal;
mod products;
mod record;
mod resonances;
mod rigid;
mod search;
mod shrinkage;
mod solve;
mod start;
#[cfg(test)]
mod tests;
mod tilt;
mod transform;

pub use doubt::{DISAGREEMENT, Doubt};
pub use fit::{Covariance10, Fit, FitError, Options, fit};
pub(crate) use model::rigid_columns;
pub use model::{FittedMode, Model, RIGID};
pub use record::{Complex6, Noise, Record, highest, real_equations};
pub use rigid::{covariance_of, numbers, sigma_of};
pub use start::{MOST_MODES, RATIO};
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
