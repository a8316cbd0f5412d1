//! Change of the forces for a given acceleration between the first and the second half of a run.
//!
//! # Design
//!
//! Gains that drift, bolts that work loose and ranges that are switched leave averages that no test of the balance
//! tells from another body: half of a run with a gain of 1 and half with 1.03 balance like a run with 1.015. What
//! tells them is time.
//!
//! * The numbers found predict the forces `p = M a` of each half from its own accelerations, so that a table that
//!   moves otherwise in the second half contradicts nothing. The ratio `f / p` of a line holds the structure's
//!   elasticity, too, which is the same in both halves.
//! * The change of the ratio from half to half is a number a line. Its mean over the lines of the averaging band is
//!   judged by its own scatter, by Student's t: no statement on noise is needed. Lines resemble their neighbours as
//!   the window makes them.
//! * Without a drive the noise of the accelerations takes its share from the ratio. As far as the shares of both
//!   halves differ, nothing is made of a change.
//! * Where all forces of a run change alike, one gain did it, and where no run tells a change by itself, the mean
//!   over all runs may.
//! * A change is one source of type B uncertainty: nothing tells at which moment the gains were those of the
//!   calibration. From the beginning of a steady drift to its mean is half of what it drifts, which is the
//!   difference of both halves; any moment is as likely as any other (GUM 4.3.7).
//!
//! A change that all lines together tell with less than four standard deviations stays unseen, and what comes and
//! goes within a half.

use super::{WARNED, consistency};
use crate::format::with_std;
use crate::measure::{EarlyLate, ForceGain, MeasuredRun, Measurement, Products};
use massline_core::geometry::RESULTANT_NAMES;
use massline_core::identify::{Estimate, Identification};
use nalgebra::{Complex, Matrix3, Matrix6, Vector3};

/// Number of forces and moments.
const FORCES: usize = 6;

/// Mean distance of `f / p` from one beyond which the numbers do not predict the force.
const UNPREDICTED: f64 = 0.5;

/// Share of a force that single precision may change.
const ROUNDING: f64 = 1e-6;

/// A change from the first half of a run to its second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Drift {
    /// Number of the run in the setup; `None` for all runs.
    run: Option<usize>,
    /// 0 to 5: forces, then moments; `None` for all of them.
    force: Option<usize>,
    change: Change,
}

/// A change as a share of the force.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Change {
    share: f64,
    std: f64,
    /// Degrees of freedom of the standard deviation.
    freedom: f64,
    /// Difference that noise may make.
    noise: f64,
}

impl Change {
    /// Probability that chance alone changes as much or more.
    fn probability(&self) -> f64 {
        let beyond = (self.share.abs() - self.noise).max(0.0);
        consistency::exceeded((beyond / self.std).powi(2), 1.0, self.freedom)
    }

    /// Mean of changes of one run. Their errors may be the same, if those of the accelerations are most of them.
    fn of_run(all: &[(usize, Self)]) -> Option<Self> {
        let inverse = |power: i32| all.iter().map(|(_, c)| c.std.powi(-power)).sum::<f64>();
        let squares = inverse(2);
        let weighted = |of: &dyn Fn(&Self) -> f64| {
            all.iter()
                .map(|(_, c)| of(c) / (c.std * c.std))
                .sum::<f64>()
                / squares
        };
        (squares > 0.0 && squares.is_finite()).then(|| Self {
            share: weighted(&|c| c.share),
            std: inverse(1) / squares,
            freedom: weighted(&|c| c.freedom),
            noise: weighted(&|c| c.noise),
        })
    }

    /// Mean of changes of several runs, whose errors are independent.
    fn of_runs(all: &[Self]) -> Option<Self> {
        let squares: f64 = all.iter().map(|c| c.std.powi(-2)).sum();
        let weighted = |of: &dyn Fn(&Self) -> f64| {
            all.iter().map(|c| of(c) / (c.std * c.std)).sum::<f64>() / squares
        };
        (squares > 0.0 && squares.is_finite()).then(|| Self {
            share: weighted(&|c| c.share),
            std: squares.powf(-0.5),
            freedom: all.iter().map(|c| c.freedom).sum(),
            noise: weighted(&|c| c.noise),
        })
    }

    /// `true` if changes of one run may be one and the same.
    fn is_of_all(&self, all: &[(usize, Self)]) -> bool {
        let squares = all
            .iter()
            .map(|(_, c)| ((c.share - self.share) / c.std).powi(2));
        let surplus = all.len().saturating_sub(1) as f64;
        let freedom = self.freedom * all.len() as f64;
        surplus == 0.0
            || consistency::exceeded(squares.sum::<f64>() / surplus, surplus, freedom) > WARNED
    }

    /// Such as `+1.52 ± 0.08 %`, with half of its 95 % interval.
    fn in_words(&self) -> String {
        let estimate = Estimate {
            value: self.share,
            std: self.std,
        };
        let half = estimate.interval(self.freedom);
        let (share, half) = with_std(100.0 * self.share, 100.0 * half);
        let sign = if self.share > 0.0 { "+" } else { "" };
        format!("{sign}{share} ± {half} %")
    }
}

/// The changes that chance does not explain, in the order of the runs.
pub(super) fn drifts(measurement: &Measurement, found: &Identification) -> Vec<Drift> {
    let matrix = matrix(found);
    let halves = measurement
        .runs
        .iter()
        .filter_map(|run| Some((run, run.early_late.as_deref()?)));
    let runs: Vec<(usize, Vec<(usize, Change)>)> = halves
        .map(|(run, halves)| (run.number, of_run(run, halves, &matrix)))
        .collect();
    let tests = runs.iter().map(|(_, all)| all.len()).sum::<usize>() as f64;
    let is_drift = |change: &Change| change.probability() * tests < WARNED;
    let mut drifts = Vec::new();
    for (run, all) in &runs {
        if !all.iter().any(|(_, change)| is_drift(change)) {
            continue;
        }
        let mean = Change::of_run(all).filter(|mean| mean.is_of_all(all));
        let changes: Vec<(Option<usize>, Change)> = match mean {
            Some(mean) => vec![(None, mean)],
            None => {
                let own = all.iter().filter(|(_, change)| is_drift(change));
                own.map(|(force, change)| (Some(*force), *change)).collect()
            }
        };
        let run = Some(*run);
        drifts.extend(
            changes
                .into_iter()
                .map(|(force, change)| Drift { run, force, change }),
        );
    }
    if drifts.is_empty() {
        let means: Vec<Change> = runs
            .iter()
            .filter_map(|(_, all)| Change::of_run(all))
            .collect();
        let mean = Change::of_runs(&means).filter(|mean| mean.probability() < WARNED);
        drifts.extend(mean.map(|change| Drift {
            run: None,
            force: None,
            change,
        }));
    }
    drifts
}

/// Standard uncertainties of the gains that change.
pub(super) fn gains(drifts: &[Drift], measurement: &Measurement) -> Vec<ForceGain> {
    let mut gains = Vec::new();
    let mut runs: Vec<usize> = measurement.runs.iter().map(|run| run.number).collect();
    runs.dedup();
    for run in runs {
        for drift in drifts.iter().filter(|d| d.run.is_none_or(|own| own == run)) {
            let forces = (0..FORCES).filter(|f| drift.force.is_none_or(|own| own == *f));
            gains.extend(forces.map(|force| ForceGain {
                run,
                force,
                share: drift.change.share / 3.0_f64.sqrt(),
            }));
        }
    }
    gains
}

/// All changes in words; `None` without any.
pub(super) fn in_words(drifts: &[Drift], measurement: &Measurement) -> Option<String> {
    if drifts.is_empty() {
        return None;
    }
    let runs = drifts.chunk_by(|a, b| a.run == b.run);
    let words = runs.filter_map(|of_run| {
        let number = of_run.first()?.run;
        let mut runs = measurement.runs.iter();
        let run = runs.find(|run| Some(run.number) == number);
        let run = run.map_or_else(
            || "all runs together".to_owned(),
            |run| format!("run \"{}\"", run.name),
        );
        let forces = of_run.iter().map(|drift| {
            let name = drift.force.and_then(|force| RESULTANT_NAMES.get(force));
            format!("{} {}", name.unwrap_or(&"all"), drift.change.in_words())
        });
        Some(format!("{run}: {}", forces.collect::<Vec<_>>().join(", ")))
    });
    Some(format!(
        "for the same acceleration the forces in the second half of a recording are not those in the first: {}. A gain that drifts does this, a range that is switched, a bolt that works loose, or a structure that changes; let the electronics warm up, check the fixing, and record again",
        words.collect::<Vec<_>>().join("; ")
    ))
}

/// A warning of all changes, and if intervals hold them: those with type B uncertainty.
pub(super) fn notice(
    drifts: &[Drift],
    measurement: &Measurement,
    held: bool,
    warnings: &mut Vec<String>,
) {
    let held = if held {
        "the intervals with type B uncertainty hold it"
    } else {
        "the error bars do not know of it"
    };
    warnings.extend(in_words(drifts, measurement).map(|words| format!("{words}; {held}")));
}

/// M of equation (1) about A, with zero for what is not known.
fn matrix(found: &Identification) -> Matrix6<f64> {
    let value = |e: Option<Estimate>| e.map_or(0.0, |e| e.value);
    let weighed = value(found.mass);
    let mass = weighed * found.indicator.map_or(1.0, |delta| delta.value);
    let first = Vector3::from_fn(|i, _| {
        let known = found.centre_of_gravity[i];
        known.map_or(0.0, |s| weighed * (s.value - found.reference[i]))
    });
    let [xx, yy, zz, xy, xz, yz] = found.inertia_reference.map(value);
    let mut m = Matrix6::identity() * mass;
    let cross = first.cross_matrix();
    m.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross);
    m.fixed_view_mut::<3, 3>(3, 0).copy_from(&cross);
    m.fixed_view_mut::<3, 3>(3, 3)
        .copy_from(&Matrix3::new(xx, -xy, -xz, -xy, yy, -yz, -xz, -yz, zz));
    m
}

/// Products of a force with itself, with its prediction, and of the prediction with itself.
#[derive(Clone, Copy)]
struct Line {
    force: f64,
    cross: Complex<f64>,
    predicted: f64,
}

/// The changes of the forces of a run that are measured and predicted.
fn of_run(run: &MeasuredRun, halves: &EarlyLate, matrix: &Matrix6<f64>) -> Vec<(usize, Change)> {
    let correlation = run.settings().window().line_correlation();
    let measured = (0..FORCES).filter(|j| run.geometry.equations.measured(*j) > 0.5);
    let found = measured.filter_map(|force| {
        let [early, late] = [&halves.early, &halves.late].map(|half| {
            half.iter()
                .map(|products| Line::of(force, products, matrix))
                .collect::<Vec<_>>()
        });
        Some((force, change(&early, &late, correlation)?))
    });
    found.collect()
}

impl Line {
    fn of(force: usize, products: &Products, matrix: &Matrix6<f64>) -> Self {
        let row = |i: usize| Complex::from(matrix[(force, i)]);
        let f = FORCES + force;
        let mut line = Self {
            force: products[(f, f)].re,
            cross: Complex::default(),
            predicted: 0.0,
        };
        for i in 0..FORCES {
            line.cross += products[(f, i)] * row(i);
            for k in 0..FORCES {
                line.predicted += (row(i) * products[(i, k)] * row(k)).re;
            }
        }
        line
    }
}

/// Change of `f / p` from one half to the other, of lines that resemble their neighbours so much; `None` where they
/// tell none.
fn change(early: &[Line], late: &[Line], correlation: f64) -> Option<Change> {
    let lines: Vec<(f64, f64)> = early
        .iter()
        .zip(late)
        .filter(|(a, b)| a.predicted > 0.0 && b.predicted > 0.0)
        .map(|(a, b)| {
            let ratios = [a, b].map(|half| half.cross / half.predicted);
            let sum = ratios[0] + ratios[1];
            // Noise of the forces is alike in all lines, and harms those most that move least.
            let weight = 1.0 / (1.0 / a.predicted + 1.0 / b.predicted);
            ((2.0 * (ratios[1] - ratios[0]) / sum).re, weight)
        })
        .filter(|(change, weight)| change.is_finite() && weight.is_finite())
        .collect();
    let freedom = lines.len() as f64 / correlation - 1.0;
    let whole: f64 = lines.iter().map(|(_, weight)| weight).sum();
    if freedom < 2.0 || whole <= 0.0 || !is_predicted(early) || !is_predicted(late) {
        return None;
    }
    let mean = lines.iter().map(|(x, weight)| x * weight).sum::<f64>() / whole;
    let squares = lines.iter().map(|(x, w)| w * (x - mean).powi(2));
    let scatter = squares.sum::<f64>() / (lines.len() as f64 - correlation);
    let change = Change {
        share: mean,
        std: (correlation * scatter / whole).sqrt(),
        freedom,
        noise: (noise(early) - noise(late)).abs().max(ROUNDING),
    };
    (change.std > 0.0 && change.std.is_finite()).then_some(change)
}

/// `true` if the prediction is about what the force is.
fn is_predicted(half: &[Line]) -> bool {
    let cross: Complex<f64> = half.iter().map(|line| line.cross).sum();
    let predicted: f64 = half.iter().map(|line| line.predicted).sum();
    (cross / predicted - 1.0).norm() < UNPREDICTED
}

/// Share of a force and its prediction that do not belong together: none with a drive.
fn noise(half: &[Line]) -> f64 {
    let sum = |of: &dyn Fn(&Line) -> f64| half.iter().map(of).sum::<f64>();
    let together = sum(&|line| line.cross.norm_sqr() / line.predicted.max(f64::MIN_POSITIVE));
    (1.0 - together / sum(&|line| line.force)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOUND: Change = Change {
        share: 0.01,
        std: 0.002,
        freedom: 20.0,
        noise: ROUNDING,
    };

    /// Lines on which force and prediction are these, with as much noise of the force as signal times `noise`, by a
    /// generator of 64 bits.
    fn lines(gain: f64, noise: f64, state: &mut u64) -> Vec<Line> {
        let mut uniform = || {
            *state ^= *state << 13;
            *state ^= *state >> 7;
            *state ^= *state << 17;
            (*state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        // A sum of twelve is normal but for its far tails.
        let mut normal = || (0..12).map(|_| uniform()).sum::<f64>();
        (0..40)
            .map(|k| {
                let predicted = 1.0 + 0.1 * f64::from(k);
                let elastic = 1.0 + 0.005 * f64::from(k);
                let error = Complex::new(normal(), normal()) * noise * predicted.sqrt();
                let cross = Complex::from(gain * elastic * predicted) + error;
                Line {
                    force: cross.norm_sqr() / predicted,
                    cross,
                    predicted,
                }
            })
            .collect()
    }

    /// Probabilities of sound halves are spread evenly, and a change is found as large as it is.
    #[test]
    fn chance_is_judged_as_it_is() {
        let mut state = 1_234_567;
        let mut below = [0.0; 2];
        let draws = 4000;
        for _ in 0..draws {
            let [a, b] = [(); 2].map(|()| lines(1.0, 0.02, &mut state));
            let probability = change(&a, &b, 1.0).unwrap().probability();
            below[0] += f64::from(u8::from(probability < 0.1));
            below[1] += f64::from(u8::from(probability < 0.01));
        }
        for (found, expected) in below.into_iter().zip([0.1, 0.01]) {
            // Four standard deviations of a count.
            let std = (f64::from(draws) * expected * (1.0 - expected)).sqrt();
            assert!(
                (found - f64::from(draws) * expected).abs() < 4.0 * std,
                "{expected}: {found} of {draws}"
            );
        }
        let [a, b] = [1.0, 1.03].map(|gain| lines(gain, 0.002, &mut state));
        let found = change(&a, &b, 1.0).unwrap();
        // Of the mean of both.
        assert!(
            (found.share - 0.03 / 1.015).abs() < 4.0 * found.std,
            "{found:?}"
        );
        assert!(found.probability() < 1e-12);
    }

    /// Three lines tell nothing, nor do lines that are one another's copies, nor a force that is not predicted.
    #[test]
    fn too_little_tells_no_change() {
        let mut state = 7;
        let all = lines(1.0, 0.01, &mut state);
        assert!(change(&all[..2], &all[..2], 1.0).is_none());
        assert!(change(&all[..8], &all[..8], 35.0 / 18.0).is_none());
        assert!(change(&all, &all, 1.0).is_none(), "no scatter at all");
        let other = lines(1.6, 0.01, &mut state);
        assert!(change(&other, &lines(1.6, 0.01, &mut state), 1.0).is_none());
        assert!(change(&[], &[], 1.0).is_none());
    }

    /// Without a drive noise takes a share of the ratio: what its own change may do is no drift.
    #[test]
    fn other_noise_in_one_half_is_no_drift() {
        let mut state = 99;
        let early = lines(1.0, 0.001, &mut state);
        // One part of a hundred more is noise of the accelerations.
        let late: Vec<Line> = lines(1.0, 0.001, &mut state)
            .into_iter()
            .map(|line| Line {
                predicted: 1.01 * line.predicted,
                ..line
            })
            .collect();
        let found = change(&early, &late, 1.0).unwrap();
        assert!(found.share < -20.0 * found.std, "{found:?}");
        assert!(found.probability() > 0.1, "{found:?}");
    }

    /// Two equal changes of one run tell no more than one, of two runs √2 times as much.
    #[test]
    fn changes_are_averaged() {
        let of_run = Change::of_run(&[(0, SOUND), (4, SOUND)]).unwrap();
        assert!((of_run.std / SOUND.std - 1.0).abs() < 1e-12);
        assert!((of_run.share / SOUND.share - 1.0).abs() < 1e-12);
        let of_runs = Change::of_runs(&[SOUND, SOUND]).unwrap();
        assert!((of_runs.std / SOUND.std - 0.5_f64.sqrt()).abs() < 1e-12);
        assert!((of_runs.freedom / SOUND.freedom - 2.0).abs() < 1e-12);
        assert_eq!(Change::of_run(&[]), None);
        assert_eq!(Change::of_runs(&[]), None);
        let other = Change {
            share: -0.01,
            ..SOUND
        };
        assert!(of_run.is_of_all(&[(0, SOUND), (4, SOUND)]));
        let mixed = [(0, SOUND), (4, other)];
        assert!(!Change::of_run(&mixed).unwrap().is_of_all(&mixed));
        assert_eq!(SOUND.in_words(), "+1.00 ± 0.42 %");
    }
}
