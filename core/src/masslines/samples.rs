//! Runs for tests of sums over driven lines.

use super::MAX_RUNS;
use super::driven::{Functions, MAX_TERMS};
use crate::geometry::RESULTANTS;
use crate::modes::Pole;
use crate::spectra::{Complex32, LineGrid, RunResponses};
use nalgebra::Complex;

pub(super) const LINES: usize = 40;
pub(super) const RUNS: usize = 3;
/// Weights of the runs.
pub(super) fn weights() -> [f64; MAX_RUNS] {
    core::array::from_fn(|run| [1.0, 30.0, 0.2][run % RUNS])
}

/// Responses and drives of runs whose levels differ by a thousand, of channels that differ by
/// a million, with one line a thousand times as large as the others.
pub(super) struct Samples {
    pub responses: [[[Complex32; RESULTANTS]; LINES]; RUNS],
    pub drive: [[f32; LINES]; RUNS],
}

impl Samples {
    pub(super) fn new() -> Self {
        let mut state = 1_u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        let channels = [
            1.0, 1e-3, 1e3, 2.0, 0.1, 10.0, 300.0, 1.0, 1e-2, 1e3, 5.0, 0.7,
        ];
        let levels = [1.0, 1e-3, 30.0];
        let responses = core::array::from_fn(|run| {
            core::array::from_fn(|line| {
                let size = levels[run] * if line == 7 { 1e3 } else { 1.0 };
                channels.map(|c| Complex32::new(random(), random()) * (c * size))
            })
        });
        let drive = core::array::from_fn(|_| core::array::from_fn(|_| 2.0 + random()));
        Self { responses, drive }
    }

    /// The runs, of as many lines as each has.
    pub(super) fn runs(&self) -> [RunResponses<'_>; RUNS] {
        core::array::from_fn(|run| RunResponses {
            grid: LineGrid {
                first: 2,
                count: LINES,
                spacing: 0.5,
            },
            responses: &self.responses[run],
            drive: &self.drive[run],
            noise: [1e-30; 42],
            blocks: 8,
        })
    }
}

pub(super) fn functions(line: usize) -> [Complex<f64>; MAX_TERMS] {
    let mut phi = [Complex::new(0.0, 0.0); MAX_TERMS];
    phi[0] = Complex::new(1.0, 0.0);
    let pole = Pole {
        frequency: 9.0,
        damping: 0.01,
    };
    phi[1] = pole.amplification(1.0 + 0.5 * line as f64);
    phi[2] = Complex::new((line as f64 / 40.0) * (line as f64 / 40.0), 0.0);
    phi
}

pub(super) fn in_single(line: usize) -> Functions {
    functions(line).map(|phi| Complex32::new(phi.re as f32, phi.im as f32))
}
