//! The identification, which takes seconds: a job leaves the instrument, is run elsewhere, and
//! comes back.

use super::memory::PAIRS;
use super::setup::{Lines, bit};
use super::storage::Storage;
use super::store::Stored;
use crate::capacity::RUNS;
use crate::wire::{Accelerations, Answer, Findings, Health, NoAnswer, Quality, Question};
use massline_core::geometry::Equations;
use massline_core::identify::{Identification, IdentifyError, identify_in};
use massline_core::masslines::{Bands, DriveLines, MasslineError, Masslines, condense_into};
use massline_core::modes::MAX_MODES;
use massline_core::spectra::RunResponses;
use nalgebra::Vector3;

/// Work that a request has left to be done. It owns all it needs, so that a task of low
/// priority can run it while the instrument goes on.
#[derive(Debug)]
pub struct Job<'m> {
    /// Stored runs; scratch memory, in which the load cells lie; and the place of the answer.
    pub(super) storage: Storage<'m>,
    pub(super) question: Question,
    pub(super) lines: Lines,
    pub(super) accelerations: Accelerations,
    /// Outcome of the identification; `None` before it was run.
    pub(super) outcome: Option<Result<(), NoAnswer>>,
}

impl Job<'_> {
    /// Does the work. It takes seconds on the chip.
    pub fn run(&mut self) {
        self.outcome = Some(self.identify());
    }

    fn identify(&mut self) -> Result<(), NoAnswer> {
        if let Some(solver) = self.storage.scratch.solver() {
            solver.sets.clear();
            solver.findings = Findings::NONE;
            solver.load_cells.equations(&mut solver.equations);
        }
        let mut left = self.question.runs & self.storage.runs.mask();
        while left != 0 {
            self.condense_group(&mut left)?;
        }
        self.solve()
    }

    /// Condenses the runs that share their equations with the first of those that are left.
    #[inline(never)] // What it works with is gone before the next step.
    fn condense_group(&mut self, left: &mut u32) -> Result<(), NoAnswer> {
        let Some(solver) = self.storage.scratch.solver() else {
            return Err(IdentifyError::NoMasslines.into());
        };
        let grid = self.lines.settings.grid();
        let window = self.lines.settings.window();
        let stored = &self.storage.runs;
        let first = left.trailing_zeros() as usize;
        let equations = solver
            .equations
            .get(first)
            .ok_or(IdentifyError::NoMasslines)?;
        let mut group: heapless::Vec<RunResponses<'_>, RUNS> = heapless::Vec::new();
        for run in first..RUNS {
            let others = solver.equations.get(run);
            if *left & 1 << run != 0
                && others.is_some_and(|others| equations.alike(others))
                && let Some(responses) = stored.responses(run, grid)
            {
                *left &= !(1 << run);
                // There is room for every run.
                let _ = group.push(responses);
            }
        }
        *left &= !(1 << first);
        let lines = DriveLines::new(&group, window).ok_or(IdentifyError::NoMasslines)?;
        let mut bands = Bands::new(self.lines.band);
        bands.modes = usize::from(self.question.modes).min(MAX_MODES);
        if let Some(band) = self.question.fit_band {
            // It was checked when the question was asked.
            bands.fit = grid.within(band).unwrap_or(bands.fit);
        }
        let set = add_set(&mut solver.sets, solver.load_cells.reference(), equations)?;
        condense_into(
            self.question.method,
            &lines,
            &bands,
            set,
            &mut solver.methods,
            &mut solver.lines,
        )?;
        if let Some(fit) = solver.methods.apparent_mass() {
            solver.findings.add_fit(fit);
        }
        if let Some(modes) = solver.methods.free_modes() {
            solver.findings.add_modes(modes);
        }
        Ok(())
    }

    #[inline(never)]
    fn solve(&mut self) -> Result<(), NoAnswer> {
        let Some(solver) = self.storage.scratch.solver() else {
            return Err(IdentifyError::NoMasslines.into());
        };
        let question = &self.question.identify;
        let identification = identify_in(&solver.sets, question, &mut solver.identification);
        self.keep(identification.as_ref().map_err(|error| *error)?);
        Ok(())
    }

    #[inline(never)] // The answer is not on the stack while it is looked for.
    fn keep(&mut self, identification: &Identification) {
        let findings = self.storage.scratch.solver().map(|s| s.findings);
        *self.storage.answer = Some(Answer {
            question: self.question,
            accelerations: self.accelerations,
            quality: quality(&self.storage.runs, self.question.runs),
            identification: *identification,
            findings: findings.unwrap_or(Findings::NONE),
        });
    }
}

/// One more set of masslines, empty yet.
#[inline(never)] // It is on the stack until it has its place.
fn add_set<'s>(
    sets: &'s mut heapless::Vec<Masslines<PAIRS>, RUNS>,
    reference: Vector3<f64>,
    equations: &Equations,
) -> Result<&'s mut Masslines<PAIRS>, NoAnswer> {
    let set = Masslines::new(reference, *equations);
    sets.push(set).map_err(|_| MasslineError::TooManyRuns {
        limit: RUNS,
        found: RUNS + 1,
    })?;
    Ok(sets.last_mut().ok_or(IdentifyError::NoMasslines)?)
}

/// Quality of several runs together.
fn quality(store: &Stored<'_>, runs: u32) -> Quality {
    let used = (0..RUNS).filter(|run| runs & bit(*run as u32) != 0);
    let mut all = Quality {
        blocks: 0,
        rejected: 0,
        rejected_by: [0; Health::KINDS],
        missing: 0,
        health: Health::GOOD,
    };
    for quality in used.filter_map(|run| Some(store.kept(run)?.quality)) {
        all.blocks = all.blocks.saturating_add(quality.blocks);
        all.rejected = all.rejected.saturating_add(quality.rejected);
        for (sum, of_run) in all.rejected_by.iter_mut().zip(quality.rejected_by) {
            *sum = sum.saturating_add(of_run);
        }
        all.missing = all.missing.saturating_add(quality.missing);
        all.health = all.health.union(quality.health);
    }
    all
}
