//! The self-test: the synthetic body through the whole box, and back to its properties.

use super::requests::check_setup;
use super::runs::prepare;
use super::setup::SetUp;
use super::synthetic::{PERIOD, PLACE, SPRUNG, body};
use super::{Activity, Asked, Board, Instrument, Pending, Phase, SelfTest, Transmit};
use crate::models::setup as models;
use crate::wire::{
    Check, Gaps, Health, Method, Problem, Procedure, Processing, Question, Reply, Request,
    Selftest, Source, Start, State, Window,
};
use massline_core::identify::Identification;

/// Runs of the self-test: one an axis.
pub(super) const RUNS: u8 = 3;
/// Samples of each run: the settling of the filters, one block, and two more that overlap.
const SAMPLES: u64 = 2400;
/// Reach of the sensors, m.
const REACH: f64 = 0.15;

/// Largest deviation of the elastic term of the sampled mode from the one that is fitted, in the
/// averaging band: 6.4e-8 by its taps, and 1e-7 by the sums in single precision that move the
/// frequency that is found by 1e-7 of itself, times 2 (ω₀/ω)² |D|² = 0.89 at 20 Hz, and less below.
const DEVIATION: f64 = 1.6e-7;
/// Largest share of a deviation on every line that reaches the rigid body, while the elastic
/// term and one of ω² are eliminated: sum of the magnitudes in the first row of the
/// pseudo-inverse of their columns over the 39 lines.
const AMPLIFICATION: f64 = 1.7;
/// Relative rounding error of a transform of 1024 numbers in `f32`: ten stages, each rounded by
/// 2⁻²⁴.
const ROUNDING: f64 = 1e-6;

impl Instrument<'_> {
    /// Begins a self-test, which [`Self::poll`] goes on with.
    #[inline(never)]
    pub(super) fn begin_selftest(&mut self, id: u16, board: &impl Board) -> Result<(), Problem> {
        self.phase.not_running()?;
        self.phase.not_busy()?;
        self.clear();
        let Phase::Empty(storage) = &mut self.phase else {
            return Err(self.phase.unless(State::Empty));
        };
        set_up(self.setup)?;
        let lines = check_setup(self.setup, storage)?;
        if let Some(storage) = self.phase.take_storage() {
            self.phase = Phase::SelfTesting(SelfTest {
                pending: Pending {
                    id,
                    number: Request::Selftest.number(),
                    since: board.ticks(),
                },
                lines,
                run: 0,
                health: Health::GOOD,
                activity: Activity::Idle(storage),
            });
        }
        Ok(())
    }

    /// The next step of a self-test between its runs; `true` if another one follows at once.
    #[inline(never)] // Not on the stack of what else its caller does.
    pub(super) fn continue_selftest(
        &mut self,
        board: &mut impl Board,
        out: &mut impl Transmit,
    ) -> bool {
        let Phase::SelfTesting(test) = &mut self.phase else {
            return false;
        };
        let storage = match &mut test.activity {
            Activity::Idle(storage) => storage,
            Activity::Running(_) => return true,
            _ => return false,
        };
        let run = test.run;
        test.run = run.saturating_add(1);
        for summary in self.summaries.iter().flatten() {
            test.health = test.health.union(summary.health);
        }
        let (pending, health) = (test.pending, test.health);
        if run < RUNS {
            let start = start(run);
            // Synthetic runs need no input.
            if let Ok(run) = prepare(self.setup, &test.lines, 0, &start, storage, board) {
                test.activity.begin_run(start, run);
                return true;
            }
        } else if let Ok(asked) = Asked::new(&QUESTION, self.setup, &storage.runs) {
            test.activity.ask(pending, asked);
            return false;
        }
        self.clear();
        out.reply(pending.id, &Reply::Selftest(judge(None, health)));
        false
    }
}

/// Sets up the self-test.
pub(super) fn set_up(setup: &mut SetUp) -> Result<(), Problem> {
    setup.begin(&models::plan(RUNS, 0))?;
    setup.set_processing(&Processing {
        block_length: PERIOD,
        // The noise is periodic in the block.
        window: Window::Rectangular,
        kept_band: [1.0, 50.0],
        averaging_band: [1.0, 20.0],
        minimum_weight: 1.0,
        ..models::PROCESSING
    })?;
    for sensor in models::sensors(REACH, 1.0) {
        setup.set_sensor(&sensor)?;
    }
    (0..RUNS).try_for_each(|run| setup.set_run(&models::run(run)))
}

/// Start of a run.
pub(super) const fn start(run: u8) -> Start {
    models::start(run, Source::Synthetic, Gaps::Count, Some(SAMPLES))
}

/// Question to the runs.
pub(super) const QUESTION: Question = models::question(Method::ApparentMass, Procedure::Direct, 1);

/// Compares an answer, if there is one, with the body.
pub(super) fn judge(answer: Option<&Identification>, health: Health) -> Selftest {
    let body = body();
    let place = body.centre_of_gravity;
    let mass = AMPLIFICATION * DEVIATION * SPRUNG + ROUNDING * body.mass;
    // First and second moments are off by as much at the swinging mass's place, and are then
    // taken to the centre of gravity.
    let lever = PLACE.norm() + place.norm();
    let inertia = body.inertia.terms();
    let checks = core::array::from_fn(|k| {
        let (truth, found, bound) = match k {
            0 => (Some(&body.mass), answer.map(|a| a.mass), mass),
            1..4 => {
                let found = answer.and_then(|a| a.centre_of_gravity.get(k - 1).copied());
                (place.as_slice().get(k - 1), found, mass * lever / body.mass)
            }
            _ => {
                let found = answer.and_then(|a| a.inertia_cg.get(k - 4).copied());
                (inertia.get(k - 4), found, mass * lever * lever)
            }
        };
        Check {
            // Without a number the check fails.
            truth: truth.copied().unwrap_or(f64::NAN),
            found: found.flatten().map(|estimate| estimate.value),
            bound,
        }
    });
    let holds = |c: &Check| {
        c.found
            .is_some_and(|found| (found - c.truth).abs() <= c.bound)
    };
    Selftest {
        passed: health.is_good() && checks.iter().all(holds),
        checks,
        health,
    }
}
