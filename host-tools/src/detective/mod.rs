//! The detective: which sensor of a set-up has which fault, from the recordings alone.
//!
//! At low frequency the interface is rigid, every accelerometer follows it, and the load cells
//! balance one rigid body. A sensor that is inverted, exchanged, turned, scaled or shifted
//! contradicts all others, and of the changes that would mend the set-up usually a single one
//! explains the data.
//!
//! | file | step |
//! | --- | --- |
//! | `table` | products of the channels to rows: responses at 0 Hz to the motions of the interface |
//! | `model` | contradiction of the rows with one rigid interface and one rigid body |
//! | `hypothesis` | faults as changes of rows and sensors |
//! | `search` | the faults that explain the contradiction |

mod hypothesis;
mod model;
mod search;
mod table;
#[cfg(test)]
mod tests;

pub use hypothesis::{Fault, Mistake};
