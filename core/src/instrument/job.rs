//! What takes seconds: it leaves the instrument, is run elsewhere, and comes back.

use super::answer::{Findings, answer};
use super::memory::RUNS;
use super::setup::Lines;
use super::store::{Store, Stored};
use crate::identify::{self, identify};
use crate::masslines::{self, Bands, DriveLines, Masslines, condense, lines_between};
use crate::modes::MAX_MODES;
use crate::spectra::RunResponses;
use crate::wire::{Accelerations, Answer, Health, NoAnswer, Problem, Quality, Question};
use nalgebra::Vector3;

/// Work that a request has left to be done. It owns all it needs, so that a task of low
/// priority can run it while the instrument goes on.
#[derive(Debug)]
pub struct Job<'m> {
    pub(super) store: Store<'m>,
    pub(super) question: Question,
    pub(super) lines: Lines,
    pub(super) reference: Vector3<f64>,
    pub(super) accelerations: Accelerations,
    pub(super) answer: Option<Result<Answer, Problem>>,
}

impl Job<'_> {
    /// Does the work. It takes seconds on the chip.
    pub fn run(&mut self) {
        let found = self.identify().map_err(Problem::NoAnswer);
        self.answer = Some(found);
    }

    fn identify(&mut self) -> Result<Answer, NoAnswer> {
        let grid = self.lines.settings.grid();
        let window = self.lines.settings.window();
        let mut sets: heapless::Vec<Masslines, RUNS> = heapless::Vec::new();
        let mut findings = Findings::default();
        let mut left = self.question.runs & self.store.runs.mask();
        let stored = &self.store.runs;
        while left != 0 {
            // The runs that share their equations with the first of those that are left.
            let first = left.trailing_zeros() as usize;
            let Some(equations) = stored.kept(first).map(|k| k.equations) else {
                break;
            };
            let mut group: heapless::Vec<RunResponses<'_>, RUNS> = heapless::Vec::new();
            for run in first..RUNS {
                let alike = stored
                    .kept(run)
                    .is_some_and(|k| equations.alike(&k.equations));
                if left & 1 << run != 0
                    && alike
                    && let Some(responses) = stored.responses(run, grid)
                {
                    left &= !(1 << run);
                    // There is room for every run.
                    let _ = group.push(responses);
                }
            }
            left &= !(1 << first);
            let lines = DriveLines::new(&group, window).ok_or(NoAnswer::NoMasslines)?;
            let mut bands = Bands::new(self.lines.band.clone(), grid.count);
            bands.modes = usize::from(self.question.modes).min(MAX_MODES);
            if let Some(band) = self.question.fit_band {
                bands.fit = lines_between(&lines, band);
            }
            let condensed = condense(
                masslines::Method::from(self.question.method),
                &lines,
                &bands,
                self.reference,
                &equations,
                self.store.solver,
            )?;
            if let Some(fit) = &condensed.apparent_mass {
                findings.add_fit(fit);
            }
            if let Some(modes) = &condensed.free_modes {
                findings.add_modes(modes);
            }
            sets.push(condensed.masslines)
                .map_err(|_| NoAnswer::TooManyPairs)?;
        }
        let question = identify::Question {
            known_mass: self.question.known_mass,
            procedure: self.question.procedure.into(),
        };
        let identification = identify(&sets, &question)?;
        Ok(answer(
            self.question,
            self.accelerations,
            quality(&self.store.runs, self.question.runs),
            &identification,
            &findings,
        ))
    }
}

/// What the runs suffered, all together.
fn quality(store: &Stored<'_>, runs: u32) -> Quality {
    let used = (0..RUNS).filter(|run| runs & 1 << run != 0);
    let mut all = Quality {
        blocks: 0,
        rejected: 0,
        missing: 0,
        health: Health::GOOD,
    };
    for quality in used.filter_map(|run| Some(store.kept(run)?.quality)) {
        all.blocks = all.blocks.saturating_add(quality.blocks);
        all.rejected = all.rejected.saturating_add(quality.rejected);
        all.missing = all.missing.saturating_add(quality.missing);
        all.health = all.health.union(quality.health);
    }
    all
}
