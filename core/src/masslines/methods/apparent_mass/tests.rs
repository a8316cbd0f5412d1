use super::*;
use crate::geometry::ResultantNoise;
use crate::masslines::lines::Amplitudes;
use crate::modes::Resonance;

/// The terms times their shares are what the resonances say of the apparent mass, about its value without them, where
/// the lines end at 20 Hz: one mode within the lines, one above them without damping, and all others in ω².
#[test]
fn shares_of_terms_are_those_of_the_resonances() {
    const LAST: f64 = 20.0;
    let mode = |frequency, damping, share| Resonance {
        pole: Pole { frequency, damping },
        share,
    };
    let (within, above, upper) = (mode(30.0, 0.01, 0.3), mode(55.0, 0.0, 0.2), 1e-5);
    let resonances = Resonances {
        found: [within].into_iter().collect(),
        beyond: Some(above),
        upper,
    };
    let basis = Basis {
        poles: resonances.poles(),
        last: LAST,
        per_square: 1.0 / (LAST * LAST),
    };
    let basis = basis.with_pseudo_mode(&resonances);
    let shares = basis.shares(&resonances);
    for f in [2.0, 11.0, LAST] {
        let terms = basis.at(f).into_iter().zip(shares);
        let sum: Complex<f64> = terms.map(|(phi, share)| phi * share).sum();
        let elastic = |mode: Resonance| mode.pole.amplification(f) * mode.share;
        let expected = elastic(within) + elastic(above) + upper * f * f;
        assert!(
            (sum - expected).norm_sqr() < 1e-28,
            "{f} Hz: {sum} {expected}"
        );
    }
}

/// Without a flank the pseudo-mode has its place over the end of the band, and no share.
#[test]
fn a_pseudo_mode_without_a_flank_stands_above_the_band() {
    let basis = Basis {
        poles: heapless::Vec::new(),
        last: 20.0,
        per_square: 1.0 / 400.0,
    };
    let resonances = Resonances {
        found: heapless::Vec::new(),
        beyond: None,
        upper: 1e-5,
    };
    let basis = basis.with_pseudo_mode(&resonances);
    let [pole] = basis.poles[..] else {
        panic!("{:?}", basis.poles);
    };
    assert_eq!((pole.frequency, pole.damping), (30.0, 0.0));
    assert_eq!(basis.shares(&resonances)[1], 0.0);
}

/// Runs whose accelerometers have such noise, of which no line is asked for.
struct Noises([f64; 3]);

impl Lines for Noises {
    fn count(&self) -> usize {
        1
    }

    fn frequency(&self, _line: usize) -> f64 {
        1.0
    }

    fn runs(&self) -> usize {
        self.0.len()
    }

    fn add_moments(&self, _run: usize, _line: usize, _weight: f64, _into: &mut Moments) {}

    fn noise(&self, run: usize) -> ResultantNoise {
        ResultantNoise {
            acceleration: Matrix6::identity() * self.0[run],
            ..ResultantNoise::default()
        }
    }
}

impl Internals for Noises {
    fn equations_per_line(&self, _run: usize) -> f64 {
        1.0
    }

    fn correlation(&self) -> f64 {
        1.0
    }

    fn pair(&self, _run: usize, _line: usize) -> Option<Amplitudes> {
        None
    }
}

/// The noise is that of three runs if all have as much of it, and that of one which alone has any.
#[test]
fn runs_count_by_the_noise_that_they_have() {
    let third = 3.0 / 2.94;
    for (weights, noises, expected) in [
        ([1.0, 1.0, 1.0], [1.0, 1.0, 1.0], 3.0),
        ([0.03, 0.03, 2.94], [1.0, 1.0, 1.0], third),
        ([1.0, 4.0, 0.25], [1.0, 0.25, 4.0], 3.0),
        ([1.0, 1.0, 1.0], [0.0, 0.0, 2.0], 1.0),
        ([1.0, 1.0, 1.0], [0.0, 0.0, 0.0], 3.0),
    ] {
        let mut space = Workspace::EMPTY;
        let mut alike = [0.0; MAX_RUNS];
        alike[..3].copy_from_slice(&weights);
        let fit = Fit {
            regression: &mut space.regression,
            candidate: &mut space.candidate,
            solution: &mut space.best,
            residuals: &mut space.residuals,
            weights: alike,
            runs: 3,
            noise: NO_MATRIX,
            power: Vector6::zeros(),
            columns: None,
        };
        let found = fit.runs_of_noise(&Noises(noises));
        assert!(
            (found - expected).abs() < 1e-12,
            "{weights:?} {noises:?}: {found}"
        );
    }
}
