//! Tests of whether a fit holds.

use super::Fit;
use super::fit::WANDERING;
use super::model::OVERDAMPED;
use super::start::RATIO;

/// Squared distance of the fits of low and of all lines from which they disagree.
pub const DISAGREEMENT: f64 = 30.0;
/// Share by which natural frequencies of a run may differ from those of the others, in the median: offsets between runs
/// take in a recording of another sample rate, too, by 25 % where load cells lock in no forces.
const APART: f64 = 0.05;
/// Share of its deviation beforehand that a guess has left, below which the lines tell the parameter. By motion near the
/// noise they do not: with the satellite in runs along x and z on a table that leaks by 2 %, a mode beyond the lines that
/// the residuals do not show moved the inertia by ten of its standard deviations, and the centre of gravity by six.
const LEFT_OF_GUESS: f64 = 1.0 / 3.0;

/// Reason why a fit must not be used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Doubt {
    /// V still fell.
    NotConverged,
    /// The residuals are larger than the noise.
    Residuals(f64),
    /// Low and all lines disagree.
    LowLines(f64),
    /// The base moves along directions near its noise, by so many deviations from chance otherwise at each frequency, and
    /// the lines do not tell by how much that bends the numbers.
    Wandering(f64),
    /// The numbers rest on parameters of the body that only motion near the noise tells: what is left of the deviation
    /// beforehand of one of them, a share.
    Guess(f64),
    /// The natural frequencies of a run are those of the others, so many times.
    RunApart(f64),
    /// A mode within the lines is no resonance: its frequency in Hz and damping.
    Overdamped([f64; 2]),
}

impl std::fmt::Display for Doubt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NotConverged => f.write_str("the fit has not converged"),
            Self::Residuals(ratio) => write!(
                f,
                "the residuals have {ratio:.2} times the power of the noise (limit {RATIO})"
            ),
            Self::LowLines(d) => write!(
                f,
                "a fit of the low lines alone gives another body (squared distance {d:.0}, limit {DISAGREEMENT})"
            ),
            Self::Wandering(z) if *z <= WANDERING => f.write_str(
                "the base moves along axes that hardly rise above the accelerometers' noise, and the lines do not tell by how much that bends the numbers: drive them, too",
            ),
            Self::Wandering(z) => write!(
                f,
                "the base moves along axes that hardly rise above the accelerometers' noise, and otherwise at each frequency ({z:.0} standard deviations of chance, limit {WANDERING}): drive them, too"
            ),
            Self::Guess(left) => write!(
                f,
                "the numbers rest on first moments or inertia that only motion near the accelerometers' noise tells (to {:.0} % of a guess, limit {:.0} %), where elasticity that the residuals do not show bends them: drive those axes, too",
                100.0 * left,
                100.0 * LEFT_OF_GUESS
            ),
            Self::RunApart(factor) => write!(
                f,
                "the natural frequencies of one run are {factor:.3} times those of the others (limit {:.0} %)",
                100.0 * APART
            ),
            Self::Overdamped([frequency, damping]) => write!(
                f,
                "a mode at {frequency:.1} Hz, damped by {:.0} %, is no resonance (limit {:.0} %): look for a delay between forces and accelerations with `massline check`",
                100.0 * damping,
                100.0 * OVERDAMPED
            ),
        }
    }
}

impl Fit {
    /// The first test that the fit fails.
    #[must_use]
    pub fn doubt(&self) -> Option<Doubt> {
        if !self.converged {
            return Some(Doubt::NotConverged);
        }
        let ratio = self.ratio();
        if ratio > RATIO {
            return Some(Doubt::Residuals(ratio));
        }
        if let Some(factor) = self.model.run_apart(APART) {
            return Some(Doubt::RunApart(factor));
        }
        if let Some(deviations) = self.untold {
            return Some(Doubt::Wandering(deviations));
        }
        if let Some(left) = self.left_of_guess.filter(|left| *left < LEFT_OF_GUESS) {
            return Some(Doubt::Guess(left));
        }
        let mut modes = self.model.modes.iter();
        if let Some(mode) = modes.find(|mode| mode.is_overdamped(self.band[1])) {
            return Some(Doubt::Overdamped([mode.frequency(), mode.damping()]));
        }
        let far = self.disagreement.filter(|d| *d > DISAGREEMENT);
        far.map(Doubt::LowLines)
    }
}
