//! Means over lines and runs, with their chance.

use super::WARNED;
use super::consistency::exceeded;

/// Variance of a mean over neighbouring lines relative to that over independent ones: that of the Hann window,
/// `N Σw⁴ / (Σw²)²`.
pub(super) const NEIGHBOURS: f64 = 35.0 / 18.0;

/// A mean over lines, with the standard deviation that their scatter gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mean {
    pub(super) value: f64,
    pub(super) std: f64,
    /// Degrees of freedom of the standard deviation.
    pub(super) freedom: f64,
    /// Difference that noise may make.
    pub(super) noise: f64,
}

impl Mean {
    /// Probability that chance alone gives as much or more, of either sign.
    pub(super) fn probability(&self) -> f64 {
        let beyond = (self.value.abs() - self.noise).max(0.0);
        exceeded((beyond / self.std).powi(2), 1.0, self.freedom)
    }

    /// Mean of those of one run. Their errors may be the same, if those of the accelerations are most of them.
    pub(super) fn of_run(all: &[(usize, Self)]) -> Option<Self> {
        let inverse = |power: i32| all.iter().map(|(_, c)| c.std.powi(-power)).sum::<f64>();
        let squares = inverse(2);
        let weighted = |of: &dyn Fn(&Self) -> f64| {
            all.iter()
                .map(|(_, c)| of(c) / (c.std * c.std))
                .sum::<f64>()
                / squares
        };
        (squares > 0.0 && squares.is_finite()).then(|| Self {
            value: weighted(&|c| c.value),
            std: inverse(1) / squares,
            freedom: weighted(&|c| c.freedom),
            noise: weighted(&|c| c.noise),
        })
    }

    /// Mean of those of several runs, whose errors are independent.
    pub(super) fn of_runs(all: &[Self]) -> Option<Self> {
        let squares: f64 = all.iter().map(|c| c.std.powi(-2)).sum();
        let weighted = |of: &dyn Fn(&Self) -> f64| {
            all.iter().map(|c| of(c) / (c.std * c.std)).sum::<f64>() / squares
        };
        (squares > 0.0 && squares.is_finite()).then(|| Self {
            value: weighted(&|c| c.value),
            std: squares.powf(-0.5),
            freedom: all.iter().map(|c| c.freedom).sum(),
            noise: weighted(&|c| c.noise),
        })
    }

    /// `true` if those of one run may be one and the same.
    pub(super) fn is_of_all(&self, all: &[(usize, Self)]) -> bool {
        let squares = all
            .iter()
            .map(|(_, c)| ((c.value - self.value) / c.std).powi(2));
        let surplus = all.len().saturating_sub(1) as f64;
        let freedom = self.freedom * all.len() as f64;
        surplus == 0.0 || exceeded(squares.sum::<f64>() / surplus, surplus, freedom) > WARNED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_those_of_the_window() {
        assert_eq!(crate::setup::WINDOW, massline_core::spectra::Window::Hann);
        let count = 1024;
        let weight = |n: i32| {
            (std::f64::consts::PI * f64::from(n) / f64::from(count))
                .sin()
                .powi(2)
        };
        let sum = |power: i32| (0..count).map(|n| weight(n).powi(power)).sum::<f64>();
        let found = f64::from(count) * sum(4) / sum(2).powi(2);
        assert!((found - NEIGHBOURS).abs() < 1e-12, "{found}");
    }

    const SOUND: Mean = Mean {
        value: 0.01,
        std: 0.002,
        freedom: 20.0,
        noise: 1e-6,
    };

    /// Two equal changes of one run tell no more than one, of two runs √2 times as much.
    #[test]
    fn changes_are_averaged() {
        let of_run = Mean::of_run(&[(0, SOUND), (4, SOUND)]).unwrap();
        assert!((of_run.std / SOUND.std - 1.0).abs() < 1e-12);
        assert!((of_run.value / SOUND.value - 1.0).abs() < 1e-12);
        let of_runs = Mean::of_runs(&[SOUND, SOUND]).unwrap();
        assert!((of_runs.std / SOUND.std - 0.5_f64.sqrt()).abs() < 1e-12);
        assert!((of_runs.freedom / SOUND.freedom - 2.0).abs() < 1e-12);
        assert_eq!(Mean::of_run(&[]), None);
        assert_eq!(Mean::of_runs(&[]), None);
        let other = Mean {
            value: -0.01,
            ..SOUND
        };
        assert!(of_run.is_of_all(&[(0, SOUND), (4, SOUND)]));
        let mixed = [(0, SOUND), (4, other)];
        assert!(!Mean::of_run(&mixed).unwrap().is_of_all(&mixed));
    }
}
