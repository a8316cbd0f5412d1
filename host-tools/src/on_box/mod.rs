//! A test on a box, wherever its samples come from: recordings that are sent
//! ([`crate::replay`]), or its own inputs ([`crate::box_runs`]).
//!
//! | file | holds |
//! | --- | --- |
//! | `plan` | the set-up in the box's words, and the check that it fits |
//! | `passes` | surveys and weights, and the trait of the two ends |
//! | `stored` | results that a box has stored |

mod error;
pub(crate) mod passes;
pub(crate) mod plan;
pub(crate) mod stored;

pub use error::PlanError;
pub use plan::Base;
