//! Stored runs: lines of finished runs, and their metadata, for the identification.

use crate::capacity::{LINES, RUNS};
use crate::wire::{Accelerations, Line, Quality};
use massline_core::geometry::{PackedNoise, RESULTANTS, ResultantMap, ResultantNoise};
use massline_core::spectra::{Complex32, DriveAverage, LineGrid, LineRange, RunResponses};

/// Metadata of a stored run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kept {
    pub(super) accelerations: Accelerations,
    pub(super) quality: Quality,
    noise: PackedNoise,
    blocks: u32,
}

/// All stored runs.
#[derive(Debug)]
pub(super) struct Stored<'m> {
    responses: &'m mut [[Complex32; RESULTANTS]],
    drive: &'m mut [f32],
    kept: &'m mut [Option<Kept>; RUNS],
}

impl<'m> Stored<'m> {
    pub(super) fn new(
        responses: &'m mut [[Complex32; RESULTANTS]],
        drive: &'m mut [f32],
        kept: &'m mut [Option<Kept>; RUNS],
    ) -> Self {
        Self {
            responses,
            drive,
            kept,
        }
    }
}

impl Stored<'_> {
    /// Forgets all runs.
    pub(super) fn clear(&mut self) {
        self.kept.fill(None);
    }

    /// Forgets one.
    pub(super) fn forget(&mut self, run: usize) {
        if let Some(slot) = self.kept.get_mut(run) {
            *slot = None;
        }
    }

    /// Keeps a finished run, which replaces the one of its number, and returns the noise
    /// power per line of each resultant.
    #[expect(clippy::too_many_arguments, reason = "all that a run leaves behind")]
    pub(super) fn keep(
        &mut self,
        run: usize,
        average: &DriveAverage<'_>,
        grid: LineGrid,
        band: LineRange,
        block_correlation: f64,
        map: &ResultantMap,
        accelerations: Accelerations,
        quality: Quality,
    ) -> Option<[f32; RESULTANTS]> {
        let responses = self.responses.chunks_exact_mut(LINES).nth(run)?;
        let drive = self.drive.chunks_exact_mut(LINES).nth(run)?;
        let finished = RunResponses::finish(
            average,
            grid,
            band,
            block_correlation,
            map,
            responses,
            drive,
        );
        let (noise, blocks) = finished.map(|r| (r.noise, r.blocks)).ok()?;
        *self.kept.get_mut(run)? = Some(Kept {
            accelerations,
            quality,
            noise,
            blocks,
        });
        Some(
            ResultantNoise::unpacked(&noise)
                .variances()
                .map(|v| v as f32),
        )
    }

    /// Metadata of a stored run.
    pub(super) fn kept(&self, run: usize) -> Option<&Kept> {
        self.kept.get(run)?.as_ref()
    }

    /// Bit k: run k is stored.
    pub(super) fn mask(&self) -> u32 {
        super::setup::mask(self.kept.iter().map(Option::is_some))
    }

    /// A stored run as the estimators read it.
    pub(super) fn responses(&self, run: usize, grid: LineGrid) -> Option<RunResponses<'_>> {
        let kept = self.kept(run)?;
        Some(RunResponses {
            grid,
            responses: lines_of(self.responses, run)?.get(..grid.count)?,
            drive: lines_of(self.drive, run)?.get(..grid.count)?,
            noise: kept.noise,
            blocks: kept.blocks,
        })
    }

    /// One line of a stored run.
    pub(super) fn line(&self, run: usize, line: usize) -> Option<Line> {
        let pair = |z: &Complex32| [z.re, z.im];
        Some(Line {
            drive: *lines_of(self.drive, run)?.get(line)?,
            responses: lines_of(self.responses, run)?
                .get(line)?
                .each_ref()
                .map(pair),
        })
    }
}

/// The lines of one run out of those of all.
fn lines_of<T>(all: &[T], run: usize) -> Option<&[T]> {
    all.chunks_exact(LINES).nth(run)
}
