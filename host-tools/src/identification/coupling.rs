//! Forces and accelerations whose sensors do not reach equally far down: one of both is coupled to alternating
//! current.
//!
//! # Design
//!
//! A coupling with the corner frequency `c` passes `1 / (1 - i c/f)`: what it holds leads what is measured down to
//! 0 Hz by an angle of the tangent `c/f`, and is too small by half of its square. No rigid or elastic body does that; a
//! body's damping turns the forces by an angle that grows like `f³`, and a delay by one like `f`. These three make
//! the tangent of the angle between the forces and those that the numbers predict, line by line of the averaging
//! band; what remains tells how well `c` is known.
//!
//! A damper between the structure and the ground, beside the load cells, turns the forces alike: `c` is then its
//! constant over 2 π times the mass, and looks like a coupling of the accelerations.

use super::WARNED;
use super::mean::{Mean, NEIGHBOURS};
use super::predicted::{Line, is_predicted, matrix, measured};
use super::refusal::Refusal;
use crate::format::{plain, with_std};
use crate::measure::{MeasuredRun, Measurement};
use crate::setup::Setup;
use massline_core::identify::{Estimate, Identification};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// Share by which the coupling makes the lowest line too small or too large from which numbers are refused.
const REFUSED: f64 = 0.05;

/// Share of the lowest line's frequency from which a corner is said: 1° there, and a hundredth of a per cent of
/// amplitude.
const SAID: f64 = 0.02;

/// Share of a force's power that is coherent with an acceleration that it follows.
const COHERENT: f64 = 0.9;

/// Times the corner frequency from which amplitudes are right to half a per cent.
const ABOVE: f64 = 10.0;

/// A coupling of all forces or of all accelerations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Coupling {
    /// Corner frequency of the forces' coupling, Hz; negative: of the accelerations'.
    corner: Mean,
    /// Lowest line, Hz.
    lowest: f64,
    /// Keys `ac_corner` of the accelerometers and of the load cells, Hz; `None` where those of either kind differ.
    stated: Option<[f64; 2]>,
}

/// The coupling that the runs tell together, beside those that the setup states; `None` where chance explains what
/// there is.
pub(super) fn coupling(
    setup: &Setup,
    measurement: &Measurement,
    found: &Identification,
) -> Option<Coupling> {
    let of = |of_run: &dyn Fn(&MeasuredRun) -> Vec<(usize, Mean)>| {
        let runs = measurement.runs.iter();
        Mean::of_runs(
            &runs
                .filter_map(|run| Mean::of_run(&of_run(run)))
                .collect::<Vec<_>>(),
        )
    };
    let matrix = matrix(found);
    let predicted = of(&|run| corners(run, &matrix, &is_predicted));
    // Numbers that predict nothing may be bent by the coupling itself: the force of a translation follows its own
    // acceleration at least.
    let corner = predicted.or_else(|| of(&|run| corners(run, &translations(), &follows)))?;
    let first = measurement.band.indices().start;
    let lowest = measurement.grid?.frequency(first);
    let is_one = corner.probability() < WARNED && corner.value.abs() > SAID * lowest;
    let motion = one(setup.accelerometers.iter().map(|a| a.ac_corner));
    let force = one(setup.load_cells.iter().map(|c| c.ac_corner));
    is_one.then_some(Coupling {
        corner,
        lowest,
        stated: motion.zip(force).map(<[f64; 2]>::from),
    })
}

impl Coupling {
    /// Share by which amplitudes are off at the lowest line.
    fn share(&self) -> f64 {
        let angle = self.corner.value / self.lowest;
        1.0 - 1.0 / (1.0 + angle * angle).sqrt()
    }

    /// The fact in words.
    fn fact(&self) -> String {
        let estimate = Estimate {
            value: self.corner.value.abs(),
            std: self.corner.std,
        };
        let (corner, half) = with_std(estimate.value, estimate.interval(self.corner.freedom));
        let (these, others) = if self.corner.value > 0.0 {
            ("forces", "accelerations")
        } else {
            ("accelerations", "forces")
        };
        let degrees = (estimate.value / self.lowest).atan().to_degrees();
        format!(
            "the {these} lead the {others} by {}° at {} Hz and by ever less above, as behind a coupling of theirs to alternating current with a corner of {corner} ± {half} Hz{}, which takes {} % of them there",
            plain(degrees, 2),
            plain(self.lowest, 4),
            self.or_damper(),
            plain(100.0 * self.share(), 2)
        )
    }

    /// What to do about it.
    fn remedy(&self) -> String {
        let above = ABOVE * self.corner.value.abs();
        let mut ways = Vec::new();
        if let Some([motion, force]) = self.stated {
            let further = force - motion + self.corner.value;
            let (list, corner) = if further > 0.0 {
                ("load_cell", motion + further)
            } else {
                ("accelerometer", force - further)
            };
            let corner = plain(corner, 3);
            ways.push(format!(
                "write `ac_corner = {corner}` into every [[{list}]] if its data sheet agrees"
            ));
        }
        ways.push("couple both alike".to_owned());
        if above > self.lowest {
            ways.push(format!("begin `averaging_band` at {} Hz", plain(above, 2)));
        }
        ways.join(", or ")
    }

    /// A warning.
    pub(super) fn warning(&self) -> String {
        format!("{}; {}", self.fact(), self.remedy())
    }

    /// The other cause of the same angle.
    fn or_damper(&self) -> &'static str {
        if self.corner.value > 0.0 {
            ""
        } else {
            " (or behind a damper between structure and ground, beside the load cells)"
        }
    }

    /// The reason why numbers must not be believed, where it takes much of the lowest line.
    pub(super) fn refusal(&self) -> Option<Refusal> {
        (self.share() > REFUSED).then(|| Refusal {
            fact: self.fact(),
            remedy: self.remedy(),
        })
    }
}

/// The number that all are.
fn one(mut all: impl Iterator<Item = f64>) -> Option<f64> {
    let first = all.next()?;
    all.all(|other| other == first).then_some(first)
}

/// One kilogram without any inertia.
fn translations() -> Matrix6<f64> {
    Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
}

/// `true` if a force is coherent with the prediction, and has its sign.
fn follows(lines: &[Line]) -> bool {
    let sum = |of: &dyn Fn(&Line) -> f64| lines.iter().map(of).sum::<f64>();
    let together = sum(&|line| line.cross.norm_sqr() / line.predicted.max(f64::MIN_POSITIVE));
    together > COHERENT * sum(&|line| line.force) && sum(&|line| line.cross.re) > 0.0
}

/// Corner frequencies by the forces of a run that are measured and, by this test, predicted.
fn corners(
    run: &MeasuredRun,
    matrix: &Matrix6<f64>,
    is_predicted: &dyn Fn(&[Line]) -> bool,
) -> Vec<(usize, Mean)> {
    let Some(halves) = &run.early_late else {
        return Vec::new();
    };
    let settings = run.settings();
    let grid = settings.grid();
    let frequencies: Vec<f64> = run.band.indices().map(|k| grid.frequency(k)).collect();
    let corners = measured(run).filter_map(|force| {
        let halves = halves.early.iter().zip(&halves.late);
        let lines: Vec<Line> = halves
            .map(|(early, late)| Line::of(force, &(early + late), matrix))
            .collect();
        if !is_predicted(&lines) {
            return None;
        }
        Some((force, corner(&lines, &frequencies, NEIGHBOURS)?))
    });
    corners.collect()
}

/// Corner frequency of the coupling of a force, Hz, by lines that resemble their neighbours so much; `None` where
/// they tell none.
fn corner(lines: &[Line], frequencies: &[f64], correlation: f64) -> Option<Mean> {
    let middle = frequencies.get(frequencies.len() / 2)?;
    let lines = lines.iter().zip(frequencies);
    let lines: Vec<(f64, Vector3<f64>, f64)> = lines
        .filter(|(line, f)| line.predicted > 0.0 && line.cross.re > 0.0 && **f > 0.0)
        .map(|(line, f)| {
            let f = f / middle;
            (
                line.cross.im / line.cross.re,
                Vector3::new(1.0 / f, f, f.powi(3)),
                line.predicted,
            )
        })
        .collect();
    let freedom = lines.len() as f64 / correlation - 3.0;
    if freedom < 2.0 {
        return None;
    }
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (tangent, row, weight) in &lines {
        normal += row * row.transpose() * *weight;
        right += row * (tangent * weight);
    }
    let inverse = normal.try_inverse()?;
    let found = inverse * right;
    let left = lines
        .iter()
        .map(|(tangent, row, weight)| weight * (tangent - row.dot(&found)).powi(2));
    let scatter = left.sum::<f64>() / (lines.len() as f64 - 3.0 * correlation);
    let std = (correlation * scatter * inverse[(0, 0)]).sqrt() * middle;
    (std > 0.0 && std.is_finite()).then_some(Mean {
        value: found.x * middle,
        std,
        freedom,
        noise: 0.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::Draws;
    use nalgebra::Complex;

    /// Forces behind a coupling with a corner in Hz, of a body with a mode at 40 Hz and 2 % of damping, late by a tenth of a
    /// millisecond, with as much noise.
    fn lines(corner: f64, noise: f64, rng: &mut Draws) -> (Vec<Line>, Vec<f64>) {
        let frequencies: Vec<f64> = (4..40).map(|k| 0.5 * f64::from(k)).collect();
        let lines = frequencies.iter().map(|f| {
            let r = f / 40.0;
            let elastic = 1.0 + 0.3 * r * r / Complex::new(1.0 - r * r, 0.04 * r);
            let late = Complex::new(0.0, -std::f64::consts::TAU * f * 1e-4).exp();
            let coupled = Complex::new(1.0, -corner / f).inv();
            let cross = elastic * late * coupled + noise * Complex::new(rng.normal(), rng.normal());
            Line {
                force: cross.norm_sqr(),
                cross,
                predicted: 1.0,
            }
        });
        (lines.collect(), frequencies)
    }

    #[test]
    fn a_corner_is_found_where_it_is() {
        let mut rng = Draws::new(4711);
        let mut squares = 0.0;
        let draws = 400;
        for _ in 0..draws {
            let (lines, frequencies) = lines(0.1, 0.01, &mut rng);
            let found = corner(&lines, &frequencies, 1.0).unwrap();
            squares += ((found.value - 0.1) / found.std).powi(2);
        }
        // Student's t of 33 degrees of freedom has a variance of 33/31; four standard deviations of a mean of squares.
        let mean = squares / f64::from(draws);
        let bound = 4.0 * (2.0 / f64::from(draws)).sqrt();
        assert!((mean - 33.0 / 31.0).abs() < bound, "{mean}");
        // At half of the lowest line's frequency, and of the accelerations. What damping and delay turn adds to the angle,
        // not to its tangent: by 1e-3 of one.
        for sign in [1.0, -1.0] {
            let (lines, frequencies) = lines(sign, 0.001, &mut rng);
            let found = corner(&lines, &frequencies, 1.0).unwrap();
            assert!((found.value - sign).abs() < 0.02, "{found:?}");
        }
    }

    #[test]
    fn much_of_it_is_refused() {
        let of = |corner: f64| Coupling {
            corner: Mean {
                value: corner,
                std: 0.01,
                freedom: 100.0,
                noise: 0.0,
            },
            lowest: 2.0,
            stated: Some([0.0, 0.0]),
        };
        assert!(of(0.5).refusal().is_none());
        let refused = of(-1.0).refusal().unwrap();
        assert!(
            refused
                .fact
                .starts_with("the accelerations lead the forces by 27° at 2 Hz"),
            "{refused}"
        );
        assert!(
            refused
                .fact
                .contains("corner of 1.000 ± 0.020 Hz (or behind a damper"),
            "{refused}"
        );
        assert_eq!(
            refused.remedy,
            "write `ac_corner = 1` into every [[accelerometer]] if its data sheet agrees, or couple both alike, or begin `averaging_band` at 10 Hz"
        );
        // Beside what is stated: too high a corner of either kind looks like a coupling of the other.
        for (stated, value, expected) in [
            (
                [0.3, 0.0],
                -0.1,
                "ac_corner = 0.4` into every [[accelerometer]]",
            ),
            (
                [0.3, 0.0],
                0.1,
                "ac_corner = 0.2` into every [[accelerometer]]",
            ),
            ([0.3, 0.0], 0.4, "ac_corner = 0.4` into every [[load_cell]]"),
            ([0.3, 0.5], 0.1, "ac_corner = 0.6` into every [[load_cell]]"),
        ] {
            let told = Coupling {
                stated: Some(stated),
                ..of(value)
            };
            assert!(told.remedy().contains(expected), "{}", told.remedy());
        }
        let differing = Coupling {
            stated: None,
            ..of(0.1)
        };
        assert_eq!(differing.remedy(), "couple both alike");
    }
}
