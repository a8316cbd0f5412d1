//! The memory that is lent to the instrument, and the sizes that follow from its
//! [capacities](crate::capacity).
//!
//! Three structures: a chip's memory may come in two pieces, and two of the three are all
//! zero at the start, which takes no flash. None is touched by DMA. On the STM32F405
//! [`RunStorage`] fills the core-coupled memory; [`WorkingStorage`] and [`Persistent`] lie in
//! the SRAM.

use super::live::{LevelMeter, Recorder};
use super::readings::{Channels, PLACES};
use super::setup::{DECIMATIONS, LoadCells, SetUp, TRANSFORM};
use super::store::Kept;
use crate::calibration::Alignment;
use crate::capacity::{self, BLOCK_LENGTH, CHANNELS, LINES, RUNS, SENSORS};
use crate::wire::{Answer, Findings, Summary};
use massline_core::geometry::{Equations, RESULTANTS, RunGeometry};
use massline_core::identify;
use massline_core::masslines::{Masslines, Workspace};
use massline_core::spectra::{Complex32, Sum};
use nalgebra::Complex;

/// The drive and the twelve resultants.
pub(super) const AVERAGED: usize = 1 + RESULTANTS;
/// Numbers that four channels have in the filters: samples that wait, and memory of each stage. One
/// decimation more adds 20, and takes more samples off.
const FILTERS: usize = 4 * (64 + 8 + 5 * DECIMATIONS.saturating_sub(1));

/// Samples and filters of the blocks that are under way. All channels share a place between the stages.
const HISTORY: usize = AVERAGED * TRANSFORM
    + match DECIMATIONS {
        0 => 0,
        _ => 4 * 64 + AVERAGED.div_ceil(4) * FILTERS,
    };
/// Lines of the drive and of the channel that is transformed.
const BLOCK_LINES: usize = 2 * LINES;
/// Running sums: the drive's power, and three numbers for each resultant.
pub(super) const SUMS: usize = (1 + 3 * RESULTANTS) * LINES;
/// Lines of all stored runs.
const STORED_LINES: usize = RUNS * LINES;
/// Pairs that runs with the same equations are condensed to: one a direction, or one a run.
pub(super) const PAIRS: usize = if RUNS > 6 { RUNS } else { 6 };

// Numbers of runs are bits of 32, those of channels and sensors bytes, of which the highest mean
// something else, and numbers of lines have 16 bits.
const _: () = assert!(RUNS <= 32 && CHANNELS <= 250 && SENSORS <= 250 && LINES <= 1 << 15);
const _: () = assert!(BLOCK_LENGTH.is_power_of_two());
const _: () = assert!(size_of::<RunStorage>() <= capacity::RUN_BYTES);
const _: () = assert!(size_of::<WorkingStorage>() <= capacity::WORKING_BYTES);
const _: () = assert!(size_of::<Persistent>() <= capacity::PERSISTENT_BYTES);

const NOTHING: Complex32 = Complex32::new(0.0, 0.0);

/// Memory of a run while it is going on, and of the identification when none is.
#[derive(Debug)]
pub struct WorkingStorage {
    pub(super) scratch: Scratch,
}

/// Scratch memory of a run, or of an identification: neither may begin before the other has
/// ended.
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "one memory for both, and no allocator to put either elsewhere"
)]
// A tag without padding behind it: the rest is then cleared where it lies, rather than
// on the stack and copied.
#[repr(u64)]
pub(super) enum Scratch {
    Run(Averaging),
    Solver(Solver),
}

/// Memory of a run, its spectra aside.
#[derive(Debug)]
pub(super) struct Averaging {
    pub(super) history: [f32; HISTORY],
    pub(super) sums: [Sum; SUMS],
    pub(super) channels: Channels,
    pub(super) alignment: Alignment<PLACES>,
    /// Geometry of a measuring pass: from its sensors to resultants.
    pub(super) geometry: RunGeometry,
}

/// Memory of an identification, which would lie on the stack otherwise. It takes none of its own
/// where it is smaller than a run's, as it is with the capacities of the STM32F405.
#[derive(Debug)]
pub(super) struct Solver {
    pub(super) load_cells: LoadCells,
    /// One a run.
    pub(super) equations: [Equations; RUNS],
    pub(super) methods: Workspace,
    pub(super) sets: heapless::Vec<Masslines<PAIRS>, RUNS>,
    pub(super) identification: identify::Workspace,
    pub(super) findings: Findings,
    /// Two numbers a line: the trace and the weights in which poles are found.
    pub(super) lines: [Complex<f64>; 2 * LINES],
}

impl Averaging {
    const ZERO: Self = Self {
        history: [0.0; HISTORY],
        sums: [Sum::ZERO; SUMS],
        channels: Channels::new(),
        alignment: Alignment::new(),
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

/// The stored runs, and beside them in 64 KiB: the work space of the
/// transform, and levels.
#[derive(Debug)]
pub struct RunStorage {
    pub(super) responses: [[Complex32; RESULTANTS]; STORED_LINES],
    pub(super) drive: [f32; STORED_LINES],
    pub(super) work: [Complex32; TRANSFORM / 2],
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
            work: [NOTHING; TRANSFORM / 2],
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

/// Set-up and results, lines and blocks aside. It is written where it lies: nothing of it is ever
/// moved over a stack.
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
    /// Memory of the run or identification that is going on.
    pub working: &'m mut WorkingStorage,
    /// Lines of finished runs.
    pub runs: &'m mut RunStorage,
    /// Set-up and results.
    pub persistent: &'m mut Persistent,
}

#[cfg(test)]
mod tests {
    use super::*;
    use massline_core::spectra::{BlockSettings, Window};

    #[test]
    fn blocks_of_the_most_lines_fit_and_leave_nothing() {
        let lines = |first: usize, count: usize| {
            let band = [first as f64, (first + count - 1) as f64];
            BlockSettings::new(BLOCK_LENGTH, 0.5, Window::Hann, BLOCK_LENGTH as f64, band)
        };
        let settings = lines(1, LINES).expect("lines from the bottom of the spectrum");
        assert_eq!(settings.transform_length(), TRANSFORM);
        assert_eq!(settings.history_len(AVERAGED), HISTORY);
        // What needs less room in one way does not need more in another.
        for first in 1..BLOCK_LENGTH / 2 {
            let Ok(settings) = lines(first, LINES.min(16)) else {
                continue;
            };
            if settings.transform_length() <= TRANSFORM {
                assert!(settings.history_len(AVERAGED) <= HISTORY, "{first}");
            }
        }
    }
}
