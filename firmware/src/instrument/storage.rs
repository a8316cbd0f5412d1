//! The lent storage that passes from phase to phase.

use super::memory::Scratch;
use super::store::Stored;
use crate::wire::Answer;
use massline_core::spectra::Complex32;

/// Storage of a run, of an identification, and of their results.
#[derive(Debug)]
pub(super) struct Storage<'m> {
    pub(super) scratch: &'m mut Scratch,
    /// Work space of the transform.
    pub(super) work: &'m mut [Complex32],
    /// Lines of the drive and of two channels.
    pub(super) lines: &'m mut [Complex32],
    /// Finished runs.
    pub(super) runs: Stored<'m>,
    /// The answer of the last identification.
    pub(super) answer: &'m mut Option<Answer>,
}
