//! The memory of the instrument: what is lent to it, and how much of it a chip needs.
//!
//! Three structures: a chip's memory may come in two pieces, and two of the three are all
//! zero at the start, which takes no flash. None is touched by DMA. On the STM32F405
//! [`RunStorage`] fills the core-coupled memory; [`WorkingStorage`] and [`Persistent`] lie in
//! the SRAM.

use super::answer::Findings;
use super::live::{LevelMeter, Recorder};
use super::readings::Channels;
use super::setup::{LoadCells, SetUp};
use super::store::Kept;
use crate::wire::{Answer, Summary};
use massline_core::geometry::{Equations, RESULTANTS, RunGeometry};
use massline_core::identify;
use massline_core::masslines::{Masslines, Workspace};
use massline_core::spectra::{Complex32, Sum};
use nalgebra::Complex;

/// Channels of a sample.
pub const CHANNELS: usize = 48;
/// Sensors of a set-up.
pub const SENSORS: usize = 48;
/// Runs of a set-up, all of which can be stored.
pub const RUNS: usize = 6;
/// Lines of a run.
pub const LINES: usize = 100;
/// Samples of a block.
pub const BLOCK_LENGTH: usize = 1024;

/// The drive and the twelve resultants.
const AVERAGED: usize = 1 + RESULTANTS;
/// Decimated samples of a block. 100 lines of 1024 samples are decimated by four.
pub const TRANSFORM: usize = BLOCK_LENGTH / 4;
/// States of the filters that decimate by four.
const FILTERS: usize = 70;

/// Samples and filter states of the blocks that are under way.
pub const HISTORY: usize = AVERAGED * (TRANSFORM + FILTERS);
/// Lines of the drive and of the two channels that are transformed together.
pub const BLOCK_LINES: usize = 3 * LINES;
/// Running sums: the drive's power, and three numbers for each resultant.
pub const SUMS: usize = (1 + 3 * RESULTANTS) * LINES;
/// Lines of all stored runs.
pub const STORED_LINES: usize = RUNS * LINES;

const NOTHING: Complex32 = Complex32::new(0.0, 0.0);

/// What a run needs while it is going on, and the identification when none is.
#[derive(Debug)]
pub struct WorkingStorage {
    pub(super) scratch: Scratch,
}

/// What is on the scratch: a run, or an identification. Never both, as neither may begin
/// before the other has ended.
#[derive(Debug)]
// A tag without padding behind it: what follows is then cleared where it lies, rather than
// on the stack and copied.
#[repr(u64)]
pub(super) enum Scratch {
    Run(Averaging),
    Solver(Solver),
}

/// What a run works with, its spectra aside.
#[derive(Debug)]
pub(super) struct Averaging {
    pub(super) history: [f32; HISTORY],
    pub(super) sums: [Sum; SUMS],
    /// Its channels.
    pub(super) channels: Channels,
    /// From its sensors to resultants, in a measuring pass.
    pub(super) geometry: RunGeometry,
}

/// What an identification works with. What would lie on the stack meanwhile lies here, and
/// takes no memory: nine tenths of a run's room, of which 5 KB are left.
#[derive(Debug)]
pub(super) struct Solver {
    pub(super) load_cells: LoadCells,
    /// Of each run.
    pub(super) equations: [Equations; RUNS],
    pub(super) methods: Workspace,
    pub(super) sets: heapless::Vec<Masslines<PAIRS>, RUNS>,
    pub(super) identification: identify::Workspace,
    pub(super) findings: Findings,
    /// Two numbers a line: the trace and the weights in which poles are found.
    pub(super) lines: [Complex<f64>; 2 * LINES],
}

/// Pairs that runs with the same equations are condensed to: one a direction, or one a run.
pub(super) const PAIRS: usize = 6;

const _: () = assert!(PAIRS >= RUNS && size_of::<Solver>() <= size_of::<Averaging>());

impl Averaging {
    const ZERO: Self = Self {
        history: [0.0; HISTORY],
        sums: [Sum::ZERO; SUMS],
        channels: Channels::new(),
        geometry: RunGeometry::empty(),
    };
}

impl Solver {
    const ZERO: Self = Self {
        load_cells: LoadCells::ZERO,
        equations: [Equations::none(); RUNS],
        methods: Workspace::EMPTY,
        sets: heapless::Vec::new(),
        identification: identify::Workspace::EMPTY,
        findings: Findings::NONE,
        lines: [Complex::new(0.0, 0.0); 2 * LINES],
    };
}

impl Scratch {
    /// Clears it for a run.
    pub(super) fn clear_for_run(&mut self) {
        // All zero, so that it takes neither flash nor stack.
        *self = Self::Run(Averaging::ZERO);
    }

    /// Clears it for an identification.
    pub(super) fn clear_for_solver(&mut self) {
        *self = Self::Solver(Solver::ZERO);
    }

    /// The run, if it was cleared for one.
    pub(super) fn run(&self) -> Option<&Averaging> {
        match self {
            Self::Run(run) => Some(run),
            Self::Solver(_) => None,
        }
    }

    /// The run, if it was cleared for one.
    pub(super) fn run_mut(&mut self) -> Option<&mut Averaging> {
        match self {
            Self::Run(run) => Some(run),
            Self::Solver(_) => None,
        }
    }

    /// The identification, if it was cleared for one.
    pub(super) fn solver(&mut self) -> Option<&mut Solver> {
        match self {
            Self::Solver(solver) => Some(solver),
            Self::Run(_) => None,
        }
    }
}

impl WorkingStorage {
    /// All zero.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            scratch: Scratch::Run(Averaging::ZERO),
        }
    }
}

impl Default for WorkingStorage {
    fn default() -> Self {
        Self::new()
    }
}

/// The stored runs, and what fits into what they leave of 64 KiB: the work space of the
/// transform, and levels.
#[derive(Debug)]
pub struct RunStorage {
    pub(super) responses: [[Complex32; RESULTANTS]; STORED_LINES],
    pub(super) drive: [f32; STORED_LINES],
    pub(super) work: [Complex32; TRANSFORM],
    pub(super) lines: [Complex32; BLOCK_LINES],
    pub(super) levels: LevelMeter,
}

impl RunStorage {
    /// All zero.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            responses: [[NOTHING; RESULTANTS]; STORED_LINES],
            drive: [0.0; STORED_LINES],
            work: [NOTHING; TRANSFORM],
            lines: [NOTHING; BLOCK_LINES],
            levels: LevelMeter::new(),
        }
    }
}

impl Default for RunStorage {
    fn default() -> Self {
        Self::new()
    }
}

/// What the instrument has been told and what it has found, lines and blocks aside. It is
/// written where it lies: nothing of it is ever moved over a stack.
#[derive(Debug)]
pub struct Persistent {
    pub(super) setup: SetUp,
    pub(super) summaries: [Option<Summary>; RUNS],
    pub(super) kept: [Option<Kept>; RUNS],
    pub(super) answer: Option<Answer>,
    pub(super) recorder: Recorder,
}

impl Persistent {
    /// An empty one.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            setup: SetUp::new(),
            summaries: [None; RUNS],
            kept: [None; RUNS],
            answer: None,
            recorder: Recorder::new(),
        }
    }
}

impl Default for Persistent {
    fn default() -> Self {
        Self::new()
    }
}

/// Storage that is lent to an instrument for its life.
#[derive(Debug)]
pub struct Memory<'m> {
    /// For the run that is going on.
    pub working: &'m mut WorkingStorage,
    /// For the lines of those that are done.
    pub runs: &'m mut RunStorage,
    /// For all else.
    pub persistent: &'m mut Persistent,
}
