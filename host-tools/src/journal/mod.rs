//! Rows of a recording on their way to a file that cannot be read before it is whole.
//!
//! | file | holds |
//! | --- | --- |
//! | `frame` | frames with checksums |
//! | `write` | a journal that grows |
//! | `read` | a journal that is read, past what is damaged in it |
//! | `recover` | a journal, or the lines of a CSV file, to a recording |
//!
//! # Design
//!
//! The index of a Parquet file stands at its end: if the program that writes it is killed, nothing of it
//! can be read. So rows go to a journal, in frames that can be read one by one: each has its length, its
//! checksum, and the number of its first row. What is damaged or cut costs the rows of that frame, and
//! since the next one tells its number, none behind it shifts. The head, which holds the
//! names of the channels, stands at the beginning and before every 64th frame of rows.

mod frame;
mod read;
mod recover;
#[cfg(test)]
mod tests;
mod write;

pub(crate) use read::{Part, Reader, rows};
pub use recover::{Lost, RecoverError, Recovered, recover};
pub(crate) use write::Journal;
