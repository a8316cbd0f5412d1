//! Maximum likelihood: the apparent mass fitted through the resonances, line by line of the
//! record's unwindowed transform.
//!
//! | file | does |
//! | --- | --- |
//! | `record` | lines of a run and their noise |
//! | `model` | apparent mass, leakage of a mode, derivatives |
//! | `normal` | misfit, gradient and information of one record |
//! | `descent` | Levenberg-Marquardt |
//! | `rigid` | σ to mass, centre of gravity and inertia |

mod descent;
mod model;
mod normal;
mod record;
mod rigid;
#[cfg(test)]
mod tests;

pub use model::{FittedMode, Model, RIGID};
pub use record::{Complex6, Noise, Record, highest, real_equations};
pub use rigid::{covariance_of, numbers, sigma_of};
