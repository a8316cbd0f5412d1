//! Choices that the paper leaves open, and the levels of noise that are studied.

use super::StudyError;
use massline_core::modes::MAX_MODES;
use massline_core::weighting::MINIMUM_WEIGHT;
use serde::Serialize;

/// Heading in the help of the command.
const OPEN: &str = "What the paper leaves open";

/// Conditions of the study.
#[derive(Clone, Debug, PartialEq, Serialize, clap::Args)]
pub struct Options {
    /// Amplitude of runs X and Z, m/s²
    #[arg(long, value_name = "A", default_value_t = Self::default().translation, help_heading = OPEN)]
    pub translation: f64,
    /// Amplitude of the rotational run in the noise-free rows, rad/s²
    #[arg(long, value_name = "A", default_value_t = Self::default().rotation, help_heading = OPEN)]
    pub rotation: f64,
    /// Distance of the frequency lines and the first of them, Hz
    #[arg(long, value_name = "HZ", default_value_t = Self::default().spacing, help_heading = OPEN)]
    pub spacing: f64,
    /// Highest line, Hz
    #[arg(long, value_name = "HZ", default_value_t = Self::default().highest, help_heading = OPEN)]
    pub highest: f64,
    // The nearest line counts.
    /// Ends of ranges I and II, shares of the fixed system's first natural frequency
    #[arg(long, value_name = "I,II", value_parser = pair, default_value = "0.45,0.8", help_heading = OPEN)]
    pub ranges: [f64; 2],
    /// W_min, the weight of the accelerometer that sees the first modes most
    #[arg(long, value_name = "W", default_value_t = Self::default().minimum_weight, help_heading = OPEN)]
    pub minimum_weight: f64,
    /// Band in which the weighting looks for the first modes, Hz
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, default_value = "28,50", help_heading = OPEN)]
    pub mode_band: [f64; 2],
    /// Runs that share weights: by-method (each its own for a, one set for b to e), per-run,
    /// joined
    #[arg(long, value_enum, hide_possible_values = true, value_name = "RULE", default_value_t, help_heading = OPEN)]
    pub weights: WeightRule,
    /// Band in which methods d and e fit elastic modes, Hz [default: all lines]
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, help_heading = OPEN)]
    pub fit_band: Option<[f64; 2]>,
    // Around the first modes, as `massline identify` does with lines up to the mode band's end.
    /// Band in which the apparent mass looks for the fixed system's poles, Hz
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, default_value = "0.5,50", help_heading = OPEN)]
    pub pole_band: [f64; 2],
    /// Most elastic modes that methods d and e fit
    #[arg(long, value_name = "N", default_value_t = Self::default().modes, help_heading = OPEN)]
    pub modes: usize,
    /// Distance of A and S at which the iteration ends, m
    #[arg(long, value_name = "M", default_value_t = Self::default().tolerance, help_heading = OPEN)]
    pub tolerance: f64,
    /// Most iterations
    #[arg(long, value_name = "N", default_value_t = Self::default().iterations, help_heading = OPEN)]
    pub iterations: u32,
    /// Signals that noise is added to: recordings of every channel, or responses line by line
    #[arg(
        long = "noise-on",
        value_enum,
        hide_possible_values = true,
        value_name = "WHERE",
        default_value_t,
        display_order = 3
    )]
    pub noise_kind: NoiseKind,
    /// Levels of noise, each a share of a channel's RMS over all runs
    #[arg(long, value_name = "R,R,…", value_delimiter = ',', default_values_t = Self::default().noise, display_order = 1)]
    pub noise: Vec<f64>,
    /// Draws per level of noise; 0 for the noise-free rows only
    #[arg(long, value_name = "N", default_value_t = Self::default().draws, display_order = 0)]
    pub draws: usize,
    /// Draws per level of noise that are fitted by maximum likelihood, too, which takes seconds each;
    /// all of them if absent
    #[arg(long, value_name = "N", display_order = 0)]
    pub fits: Option<usize>,
    /// Seed of the first draw; each next one has the next
    #[arg(long, value_name = "N", default_value_t = Self::default().seed, display_order = 2)]
    pub seed: u64,
    /// Length of a simulated recording, s
    #[arg(long, value_name = "S", default_value_t = Self::default().duration, help_heading = OPEN)]
    pub duration: f64,
    /// Amplitude of the rotational run under noise, rad/s²; `massline simulate fork` has as much
    #[arg(long, value_name = "A", default_value_t = Self::default().noise_rotation, help_heading = OPEN)]
    pub noise_rotation: f64,
}

/// Two numbers in one value, `0.5,50`: with several values to an option, the word after it
/// would be taken for one.
fn pair(text: &str) -> Result<[f64; 2], String> {
    let two = text
        .split_once(',')
        .ok_or("two numbers are expected, such as 0.5,50")?;
    let number = |t: &str| {
        let t = t.trim();
        t.parse::<f64>()
            .map_err(|_| format!("`{t}` is not a number"))
    };
    Ok([number(two.0)?, number(two.1)?])
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
            fits: None,
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
