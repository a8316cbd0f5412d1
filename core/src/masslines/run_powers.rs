//! Powers of each run over a band, summed once: runs are weighed anew while they are fitted, and
//! each sum over a band is as much work as a hundredth of an identification on a small chip.

use super::lines::add_powers;
use super::moments::add_scaled;
use super::{Lines, MAX_RUNS, Powers};
use core::ops::Range;

/// Runs whose powers are kept: all that the box has. Those of others are summed again, in the
/// same order, so that results do not depend on this number.
const KEPT: usize = 8;
/// Elements of what is kept of one: the lower triangle of accelerations, and the forces.
const ELEMENTS: usize = 21 + 6;

/// Powers of the first runs.
#[derive(Clone, Debug)]
pub(super) struct RunPowers {
    kept: [[f64; ELEMENTS]; KEPT],
    count: usize,
}

impl RunPowers {
    /// None kept.
    pub(super) const EMPTY: Self = Self {
        kept: [[0.0; ELEMENTS]; KEPT],
        count: 0,
    };

    /// Keeps those of the lines `band`.
    #[inline(never)] // Sums are off the stack when the caller goes on.
    pub(super) fn keep<L: Lines + ?Sized>(&mut self, lines: &L, band: &Range<usize>) {
        self.count = 0;
        for run in 0..lines.runs().min(KEPT) {
            let powers = summed(lines, band, run);
            let kept = self.kept.get_mut(run).into_iter().flatten();
            for (kept, power) in kept.zip(elements(&powers)) {
                *kept = power;
            }
            self.count = run + 1;
        }
    }

    /// Those of a run.
    pub(super) fn of<L: Lines + ?Sized>(
        &self,
        lines: &L,
        band: &Range<usize>,
        run: usize,
    ) -> Powers {
        let kept = self.kept.get(..self.count).and_then(|kept| kept.get(run));
        let Some(kept) = kept else {
            return summed(lines, band, run);
        };
        let mut powers = Powers::zero();
        let mut kept = kept.iter().copied();
        for i in 0..6 {
            for (j, power) in kept.by_ref().take(i + 1).enumerate() {
                powers.aa[(i, j)] = power;
                powers.aa[(j, i)] = power;
            }
        }
        for (power, kept) in powers.ff.iter_mut().zip(kept) {
            *power = kept;
        }
        powers
    }

    /// Those of all runs, each with its weight.
    #[inline(never)] // One run's powers are off the stack when the caller goes on.
    pub(super) fn weighted<L: Lines + ?Sized>(
        &self,
        lines: &L,
        band: &Range<usize>,
        weights: &[f64; MAX_RUNS],
    ) -> Powers {
        let mut sum = Powers::zero();
        for (run, weight) in weights.iter().enumerate().take(lines.runs()) {
            let powers = self.of(lines, band, run);
            add_scaled(&mut sum.aa, &powers.aa, *weight);
            sum.ff.axpy(*weight, &powers.ff, 1.0);
        }
        sum
    }
}

/// Powers of one run over the lines of the band.
#[inline(never)] // Amplitudes are off the stack when they are summed.
fn summed<L: Lines + ?Sized>(lines: &L, band: &Range<usize>, run: usize) -> Powers {
    if let Some(squares) = lines.driven().and_then(|runs| runs.squares(run, band)) {
        return Powers {
            aa: squares.aa,
            ff: squares.ff.diagonal(),
        };
    }
    let mut powers = Powers::zero();
    for line in band.clone() {
        add_powers(lines, run, line, 1.0, &mut powers);
    }
    powers
}

/// The lower triangle of accelerations, row after row, and the forces.
fn elements(powers: &Powers) -> impl Iterator<Item = f64> + '_ {
    let triangle = (0..6).flat_map(|i| (0..=i).map(move |j| (i, j)));
    let accelerations = triangle.filter_map(|at| powers.aa.get(at));
    accelerations.chain(&powers.ff).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ResultantNoise;
    use crate::masslines::Moments;
    use crate::masslines::lines::{Amplitudes, Internals};
    use nalgebra::{Complex, Vector6};

    /// Two runs more than are kept, of amplitudes that no two lines share.
    struct Runs;

    impl Lines for Runs {
        fn count(&self) -> usize {
            5
        }

        fn frequency(&self, line: usize) -> f64 {
            line as f64
        }

        fn runs(&self) -> usize {
            KEPT + 2
        }

        fn add_moments(&self, run: usize, line: usize, weight: f64, into: &mut Moments) {
            if let Some((a, f)) = self.pair(run, line) {
                into.add_pair(&a, &f, weight);
            }
        }

        fn noise(&self, _run: usize) -> ResultantNoise {
            ResultantNoise::NONE
        }
    }

    impl Internals for Runs {
        fn equations_per_line(&self, _run: usize) -> f64 {
            1.0
        }

        fn correlation(&self) -> f64 {
            1.0
        }

        fn pair(&self, run: usize, line: usize) -> Option<Amplitudes> {
            let z = |k: usize| {
                let x = (run * 60 + line * 12 + k) as f64;
                Complex::new(libm::sin(x), libm::cos(3.0 * x))
            };
            let a = Vector6::from_fn(|k, _| z(k));
            Some((a, Vector6::from_fn(|k, _| z(6 + k))))
        }
    }

    #[test]
    fn what_is_kept_is_what_is_summed() {
        let band = 1..4;
        let mut powers = RunPowers::EMPTY;
        powers.keep(&Runs, &band);
        for run in 0..Runs.runs() {
            // To the last bit: results must not depend on how many runs are kept.
            let kept = powers.of(&Runs, &band, run);
            assert_eq!(kept, RunPowers::EMPTY.of(&Runs, &band, run), "run {run}");
            assert!(kept.aa.trace() > 0.0 && kept.ff.min() > 0.0);
        }
        let weights = core::array::from_fn(|run| 1.0 + run as f64);
        let all = powers.weighted(&Runs, &band, &weights);
        let mut expected = Powers::zero();
        for (run, weight) in weights.iter().enumerate().take(Runs.runs()) {
            for line in band.clone() {
                add_powers(&Runs, run, line, *weight, &mut expected);
            }
        }
        // Thirty numbers of order ten, each of a few roundings.
        assert!((all.aa - expected.aa).abs().max() < 1e-12);
        assert!((all.ff - expected.ff).abs().max() < 1e-12);
    }
}
