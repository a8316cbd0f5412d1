//! The question: whether it can be asked of the stored runs.

use super::limits::within;
use super::memory::RUNS;
use super::requests::missing;
use super::setup::lines_of;
use super::{Asked, Board, Instrument, Pending};
use crate::wire::{
    Accelerations, Field, Item, Method, Problem, Procedure, Question, Request, State,
};
use massline_core::masslines;
use massline_core::modes::MAX_MODES;

/// Most iterations that may be asked for: each takes some milliseconds on the chip.
const ITERATIONS_MAX: u32 = 1000;

impl Instrument<'_> {
    /// Leaves a job behind, if the question can be asked.
    pub(super) fn identify(
        &mut self,
        id: u16,
        question: &Question,
        board: &impl Board,
    ) -> Result<(), Problem> {
        self.only(State::Ready)?;
        self.not_busy()?;
        if let Some(mass) = question.known_mass {
            within(Field::KnownMass, 0, mass, f64::MIN_POSITIVE, f64::MAX)?;
        }
        if let Procedure::Iterative { tolerance, limit } = question.procedure {
            within(Field::Tolerance, 0, tolerance, f64::MIN_POSITIVE, f64::MAX)?;
            let most = f64::from(ITERATIONS_MAX);
            within(Field::Iterations, 0, f64::from(limit), 1.0, most)?;
        }
        within(
            Field::Modes,
            0,
            f64::from(question.modes),
            0.0,
            MAX_MODES as f64,
        )?;
        if let Some([low, high]) = question.fit_band {
            within(Field::FitBand, 0, low, 0.0, f64::MAX)?;
            within(Field::FitBand, 0, high, low, f64::MAX)?;
            if let Some(lines) = &self.lines {
                lines_of(&lines.settings.grid(), Field::FitBand, [low, high])?;
            }
        }
        self.leave_job(question)?;
        self.pending = Some(Pending {
            id,
            number: Request::Identify(*question).number(),
            since: board.ticks(),
        });
        Ok(())
    }

    /// Leaves a job to be taken.
    pub(super) fn leave_job(&mut self, question: &Question) -> Result<(), Problem> {
        let runs = self.asked_runs(question)?;
        let accelerations = self.accelerations_of(runs, question.method)?;
        self.asked = Some(Asked {
            question: Question { runs, ..*question },
            accelerations,
        });
        Ok(())
    }

    /// The runs that a question is about, all of which are stored.
    fn asked_runs(&self, question: &Question) -> Result<u32, Problem> {
        let runs = match question.runs {
            0 => self.stored,
            some => some,
        };
        for run in 0..u32::BITS as u8 {
            if runs & 1 << run != 0 {
                let at = self.setup.run_index(run)?;
                if self.stored & 1 << run == 0 {
                    return Err(missing(Item::Run, at));
                }
            }
        }
        if runs == 0 {
            return Err(missing(Item::Run, 0));
        }
        Ok(runs)
    }

    /// The accelerometers behind all of these runs, which must be those that the method
    /// needs.
    fn accelerations_of(&self, runs: u32, method: Method) -> Result<Accelerations, Problem> {
        let interface_only = masslines::Method::from(method).interface_only();
        let mut common = None;
        for run in (0..RUNS as u8).filter(|run| runs & 1 << run != 0) {
            let kept = self
                .archive
                .as_ref()
                .and_then(|s| s.runs.kept(usize::from(run)));
            let Some(found) = kept.map(|k| k.accelerations) else {
                continue;
            };
            let expected = match common {
                Some(common) => common,
                None if interface_only => Accelerations::Interface,
                None if found == Accelerations::Interface => Accelerations::All,
                None => found,
            };
            if found != expected {
                return Err(Problem::Accelerations {
                    found,
                    expected,
                    run,
                });
            }
            common = Some(found);
        }
        Ok(common.unwrap_or(Accelerations::Interface))
    }
}
