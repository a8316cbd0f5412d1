//! Choices that the paper leaves open, and the levels of noise that are studied.

use super::StudyError;
use massline_core::modes::MAX_MODES;
use massline_core::weighting::MINIMUM_WEIGHT;
use serde::Serialize;

/// Everything about the study that somebody may want otherwise.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Options {
    /// Amplitude of the two lateral runs, m/s²: RMS of the random drive where recordings
    /// are simulated.
    pub translation: f64,
    /// Amplitude of the rotational run, rad/s².
    pub rotation: f64,
    /// Distance of the frequency lines, Hz; the first line lies at this frequency.
    pub spacing: f64,
    /// Highest line, Hz.
    pub highest: f64,
    /// Ends of the averaging ranges I and II as shares of the first natural frequency of
    /// the fixed structure; the nearest line counts.
    pub ranges: [f64; 2],
    /// W_min of chapter 7.
    pub minimum_weight: f64,
    /// Band in which the weighting looks for the first elastic modes, Hz.
    pub mode_band: [f64; 2],
    /// Runs that share weights.
    pub weights: WeightRule,
    /// Band in which methods d and e fit elastic modes, Hz; all lines if null.
    pub fit_band: Option<[f64; 2]>,
    /// Band in which the apparent mass looks for the poles of the fixed structure, Hz: around the
    /// first modes, as `massline identify` does with lines up to the mode band's end.
    pub pole_band: [f64; 2],
    /// Most elastic modes that methods d and e fit.
    pub modes: usize,
    /// Distance of CG and reference point at which the iteration ends, m.
    pub tolerance: f64,
    /// Most iterations.
    pub iterations: u32,
    /// Signals that noise is added to.
    pub noise_kind: NoiseKind,
    /// Levels of noise, shares of each channel's RMS over all runs.
    pub noise: Vec<f64>,
    /// Draws per level.
    pub draws: usize,
    /// Seed of the first draw; each next one has the next seed.
    pub seed: u64,
    /// Length of a simulated recording, s.
    pub duration: f64,
    /// Amplitude of the rotational run under noise, rad/s².
    pub noise_rotation: f64,
}

/// Runs that share the weights of chapter 7.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum WeightRule {
    /// Each run its own for method a, which uses the runs one by one; one set for all
    /// runs for b to e, which combine them line by line
    #[default]
    ByMethod,
    /// Each run its own, whatever the method
    PerRun,
    /// One set for all runs, from the responses to unit interface forces
    Joined,
}

/// Signals that noise is added to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseKind {
    /// Time recordings of every channel, then averaged as a measurement would be
    #[default]
    Recordings,
    /// Exact frequency responses with complex Gaussian noise on every line
    Responses,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            translation: 1.0,
            rotation: 1.0,
            spacing: 0.5,
            highest: 200.0,
            ranges: [0.45, 0.80],
            minimum_weight: MINIMUM_WEIGHT,
            mode_band: [28.0, 50.0],
            weights: WeightRule::ByMethod,
            fit_band: None,
            pole_band: [0.5, 50.0],
            modes: MAX_MODES,
            tolerance: 1e-7,
            iterations: 50,
            noise_kind: NoiseKind::Recordings,
            noise: vec![0.001, 0.01, 0.03],
            draws: 20,
            seed: 1,
            duration: 51.0,
            noise_rotation: 10.0,
        }
    }
}

impl Options {
    /// Checks that the numbers make sense together.
    ///
    /// # Errors
    /// [`StudyError::Option`] that names the option and what it may be.
    pub fn check(&self) -> Result<(), StudyError> {
        let positive = [
            ("translation", self.translation),
            ("rotation", self.rotation),
            ("noise-rotation", self.noise_rotation),
            ("spacing", self.spacing),
            ("tolerance", self.tolerance),
            ("duration", self.duration),
        ];
        for (option, found) in positive {
            if !(found.is_finite() && found > 0.0) {
                return Err(wrong(option, found, "a number above 0"));
            }
        }
        if !(self.minimum_weight > 0.0 && self.minimum_weight <= 1.0) {
            return Err(wrong(
                "minimum-weight",
                self.minimum_weight,
                "a weight above 0 and up to 1",
            ));
        }
        let [first, second] = self.ranges;
        if !(first > 0.0 && first < second && second < 1.0) {
            return Err(wrong("ranges", second, "two rising shares between 0 and 1"));
        }
        let bands = [
            ("mode-band", Some(self.mode_band)),
            ("pole-band", Some(self.pole_band)),
            ("fit-band", self.fit_band),
        ];
        for (option, band) in bands {
            if let Some([low, high]) = band
                && !(low >= 0.0 && low < high && high <= self.highest)
            {
                return Err(wrong(
                    option,
                    high,
                    "two rising frequencies up to the highest line",
                ));
            }
        }
        if !(1..=MAX_MODES).contains(&self.modes) {
            return Err(wrong("modes", self.modes as f64, "a number from 1 to 4"));
        }
        for &level in &self.noise {
            if !(level.is_finite() && level > 0.0) {
                return Err(wrong("noise", level, "shares of the RMS above 0"));
            }
        }
        Ok(())
    }
}

fn wrong(option: &'static str, found: f64, expected: &'static str) -> StudyError {
    StudyError::Option {
        option,
        found,
        expected,
    }
}
