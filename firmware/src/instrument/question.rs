//! The question, checked against the stored runs.

use super::limits::within;
use super::setup::lines_of;
use super::setup::{SetUp, bit};
use super::store::Stored;
use super::{Asked, Board, Instrument, Pending};
use crate::capacity::RUNS;
use crate::wire::{Accelerations, Field, Item, Method, Problem, Procedure, Question, Request};
use massline_core::modes::MAX_MODES;

/// Largest limit of iterations: each takes some milliseconds on the chip.
const ITERATIONS_MAX: u32 = 1000;

impl Instrument<'_> {
    /// Leaves a job behind, if the question can be asked.
    pub(super) fn identify(
        &mut self,
        id: u16,
        question: &Question,
        board: &impl Board,
    ) -> Result<(), Problem> {
        let (session, storage) = self.phase.ready()?;
        if let Some(mass) = question.identify.known_mass {
            within(Field::KnownMass, 0, mass, f64::MIN_POSITIVE, f64::MAX)?;
        }
        if let Procedure::Iterative { tolerance, limit } = question.identify.procedure {
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
            lines_of(&session.lines.settings.grid(), Field::FitBand, [low, high])?;
        }
        let asked = Asked::new(question, self.setup, &storage.runs)?;
        let pending = Pending {
            id,
            number: Request::Identify(*question).number(),
            since: board.ticks(),
        };
        if let Some(activity) = self.phase.activity_mut() {
            activity.ask(pending, asked);
        }
        Ok(())
    }
}

impl Asked {
    /// A question to stored runs.
    pub(super) fn new(
        question: &Question,
        setup: &SetUp,
        stored: &Stored<'_>,
    ) -> Result<Self, Problem> {
        let runs = match question.runs {
            0 => stored.mask(),
            some => some,
        };
        for run in (0..u32::BITS as u8).filter(|run| runs & bit(u32::from(*run)) != 0) {
            let at = setup.run_index(run)?;
            stored.kept(at).ok_or(Problem::missing(Item::Run, at))?;
        }
        if runs == 0 {
            return Err(Problem::missing(Item::Run, 0));
        }
        Ok(Self {
            question: Question { runs, ..*question },
            accelerations: accelerations(stored, runs, question.method)?,
        })
    }
}

/// The accelerometers behind all of these runs, which must be those that the method needs.
fn accelerations(stored: &Stored<'_>, runs: u32, method: Method) -> Result<Accelerations, Problem> {
    let interface_only = method.interface_only();
    let mut common = None;
    for run in (0..RUNS as u8).filter(|run| runs & bit(u32::from(*run)) != 0) {
        let Some(kept) = stored.kept(usize::from(run)) else {
            continue;
        };
        let found = kept.accelerations;
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
