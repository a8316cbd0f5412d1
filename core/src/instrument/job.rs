//! What takes seconds: it leaves the instrument, is run elsewhere, and comes back.

use super::answer::{Findings, answer};
use super::memory::RUNS;
use super::setup::Lines;
use super::store::{Store, Stored};
use crate::geometry::Equations;
use crate::identify::{self, MasslineSet, identify};
use crate::masslines::{
    self, Bands, DriveLines, MAX_PAIRS, Massline, Masslines, condense, lines_between,
};
use crate::modes::MAX_MODES;
use crate::spectra::RunResponses;
use crate::wire::{Accelerations, Health, NoAnswer, Quality, Question};
use core::ops::Range;
use nalgebra::{Matrix6, Vector3};

/// Work that a request has left to be done. It owns all it needs, so that a task of low
/// priority can run it while the instrument goes on.
#[derive(Debug)]
pub struct Job<'m> {
    pub(super) store: Store<'m>,
    pub(super) question: Question,
    pub(super) lines: Lines,
    pub(super) reference: Vector3<f64>,
    pub(super) accelerations: Accelerations,
    /// Whether there is an answer, once it has been looked for.
    pub(super) outcome: Option<Result<(), NoAnswer>>,
}

impl Job<'_> {
    /// Does the work. It takes seconds on the chip.
    pub fn run(&mut self) {
        self.outcome = Some(self.identify());
    }

    fn identify(&mut self) -> Result<(), NoAnswer> {
        let mut gathered = Gathered::default();
        let mut findings = Findings::default();
        let mut left = self.question.runs & self.store.runs.mask();
        while left != 0 {
            self.condense_group(&mut left, &mut gathered, &mut findings)?;
        }
        self.solve(&gathered, &findings)
    }

    /// Condenses the runs that share their equations with the first of those that are left.
    #[inline(never)] // What a method returns is large, and gone before the next step.
    fn condense_group(
        &mut self,
        left: &mut u32,
        gathered: &mut Gathered,
        findings: &mut Findings,
    ) -> Result<(), NoAnswer> {
        let grid = self.lines.settings.grid();
        let window = self.lines.settings.window();
        let stored = &self.store.runs;
        let first = left.trailing_zeros() as usize;
        let equations = &stored.kept(first).ok_or(NoAnswer::NoMasslines)?.equations;
        let mut group: heapless::Vec<RunResponses<'_>, RUNS> = heapless::Vec::new();
        for run in first..RUNS {
            let alike = stored
                .kept(run)
                .is_some_and(|k| equations.alike(&k.equations));
            if *left & 1 << run != 0
                && alike
                && let Some(responses) = stored.responses(run, grid)
            {
                *left &= !(1 << run);
                // There is room for every run.
                let _ = group.push(responses);
            }
        }
        *left &= !(1 << first);
        let lines = DriveLines::new(&group, window).ok_or(NoAnswer::NoMasslines)?;
        let mut bands = Bands::new(self.lines.band.clone(), grid.count);
        bands.modes = usize::from(self.question.modes).min(MAX_MODES);
        if let Some(band) = self.question.fit_band {
            bands.fit = lines_between(&lines, band);
        }
        // Looked at where it lies: it is eleven kilobytes.
        let condensed = condense(
            masslines::Method::from(self.question.method),
            &lines,
            &bands,
            self.reference,
            equations,
            self.store.solver,
        );
        let condensed = match &condensed {
            Ok(condensed) => condensed,
            Err(why) => return Err(NoAnswer::from(*why)),
        };
        if let Some(fit) = &condensed.apparent_mass {
            findings.add_fit(fit);
        }
        if let Some(modes) = &condensed.free_modes {
            findings.add_modes(modes);
        }
        gathered.add(&condensed.masslines)
    }

    #[inline(never)]
    fn solve(&mut self, gathered: &Gathered, findings: &Findings) -> Result<(), NoAnswer> {
        let question = identify::Question {
            known_mass: self.question.known_mass,
            procedure: self.question.procedure.into(),
        };
        let sets: heapless::Vec<Gathering<'_>, RUNS> = gathered.sets().collect();
        let identification = identify(&sets, &question)?;
        *self.store.answer = Some(answer(
            self.question,
            self.accelerations,
            quality(&self.store.runs, self.question.runs),
            &identification,
            findings,
        ));
        Ok(())
    }
}

/// The masslines of all groups, without the room that each has for more of them: together
/// a quarter of what as many [`Masslines`] take.
#[derive(Default)]
struct Gathered {
    groups: heapless::Vec<Group, RUNS>,
    pairs: heapless::Vec<Massline, MAX_PAIRS>,
}

/// One group of them.
struct Group {
    reference: Vector3<f64>,
    equations: Equations,
    noise: Matrix6<f64>,
    pairs: Range<usize>,
}

impl Gathered {
    fn add(&mut self, set: &Masslines) -> Result<(), NoAnswer> {
        let first = self.pairs.len();
        self.pairs
            .extend_from_slice(&set.pairs)
            .map_err(|_| NoAnswer::TooManyPairs)?;
        let group = Group {
            reference: set.reference,
            equations: set.equations,
            noise: set.noise,
            pairs: first..self.pairs.len(),
        };
        self.groups.push(group).map_err(|_| NoAnswer::TooManyPairs)
    }

    fn sets(&self) -> impl Iterator<Item = Gathering<'_>> {
        self.groups.iter().map(|group| Gathering {
            group,
            pairs: self.pairs.get(group.pairs.clone()).unwrap_or(&[]),
        })
    }
}

/// A group with its pairs.
struct Gathering<'a> {
    group: &'a Group,
    pairs: &'a [Massline],
}

impl MasslineSet for Gathering<'_> {
    fn reference(&self) -> &Vector3<f64> {
        &self.group.reference
    }

    fn equations(&self) -> &Equations {
        &self.group.equations
    }

    fn pairs(&self) -> &[Massline] {
        self.pairs
    }

    fn noise(&self) -> &Matrix6<f64> {
        &self.group.noise
    }
}

/// What the runs suffered, all together.
fn quality(store: &Stored<'_>, runs: u32) -> Quality {
    let used = (0..RUNS).filter(|run| runs & 1 << run != 0);
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
