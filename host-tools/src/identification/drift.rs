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

use super::WARNED;
use super::mean::{Mean, NEIGHBOURS};
use super::predicted::{FORCES, Line, is_predicted, matrix, measured};
use crate::format::with_std;
use crate::measure::{EarlyLate, ForceGain, MeasuredRun, Measurement};
use massline_core::geometry::RESULTANT_NAMES;
use massline_core::identify::{Estimate, Identification};
use nalgebra::Matrix6;

/// Share of a force that single precision may change.
const ROUNDING: f64 = 1e-6;

/// A change from the first half of a run to its second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Drift {
    /// Number of the run in the setup; `None` for all runs.
    run: Option<usize>,
    /// 0 to 5: forces, then moments; `None` for all of them.
    force: Option<usize>,
    change: Mean,
}

/// Such as `+1.52 ± 0.08 %`, with half of its 95 % interval.
fn percent(change: &Mean) -> String {
    let estimate = Estimate {
        value: change.value,
        std: change.std,
    };
    let half = estimate.interval(change.freedom);
    let (share, half) = with_std(100.0 * change.value, 100.0 * half);
    let sign = if change.value > 0.0 { "+" } else { "" };
    format!("{sign}{share} ± {half} %")
}

/// The changes that chance does not explain, in the order of the runs.
pub(super) fn drifts(measurement: &Measurement, found: &Identification) -> Vec<Drift> {
    let matrix = matrix(found);
    let halves = measurement
        .runs
        .iter()
        .filter_map(|run| Some((run, run.early_late.as_deref()?)))
        .filter(|(_, halves)| halves.tell_changes());
    let runs: Vec<(usize, Vec<(usize, Mean)>)> = halves
        .map(|(run, halves)| (run.number, of_run(run, halves, &matrix)))
        .collect();
    let tests = runs.iter().map(|(_, all)| all.len()).sum::<usize>() as f64;
    let is_drift = |change: &Mean| change.probability() * tests < WARNED;
    let mut drifts = Vec::new();
    for (run, all) in &runs {
        if !all.iter().any(|(_, change)| is_drift(change)) {
            continue;
        }
        let mean = Mean::of_run(all).filter(|mean| mean.is_of_all(all));
        let changes: Vec<(Option<usize>, Mean)> = match mean {
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
        let means: Vec<Mean> = runs
            .iter()
            .filter_map(|(_, all)| Mean::of_run(all))
            .collect();
        let mean = Mean::of_runs(&means).filter(|mean| mean.probability() < WARNED);
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
                share: drift.change.value / 3.0_f64.sqrt(),
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
            format!("{} {}", name.unwrap_or(&"all"), percent(&drift.change))
        });
        Some(format!("{run}: {}", forces.collect::<Vec<_>>().join(", ")))
    });
    Some(format!(
        "for the same acceleration the forces in the second half of a recording are not those in the first: {}. A gain that drifts does this, a range that is switched, a bolt that works loose, or a structure that changes; let the electronics warm up, check the fixing, and record again",
        words.collect::<Vec<_>>().join("; ")
    ))
}

/// If intervals hold an error, in words: those with type B uncertainty.
pub(super) fn held(held: bool) -> &'static str {
    if held {
        "the intervals with type B uncertainty hold it"
    } else {
        "the error bars do not know of it"
    }
}

/// A warning of all changes, and if intervals hold them: those with type B uncertainty.
pub(super) fn notice(
    drifts: &[Drift],
    measurement: &Measurement,
    held: bool,
    warnings: &mut Vec<String>,
) {
    let held = self::held(held);
    warnings.extend(in_words(drifts, measurement).map(|words| format!("{words}; {held}")));
}

/// The changes of the forces of a run that are measured and predicted.
fn of_run(run: &MeasuredRun, halves: &EarlyLate, matrix: &Matrix6<f64>) -> Vec<(usize, Mean)> {
    let found = measured(run).filter_map(|force| {
        let [early, late] = [&halves.early, &halves.late].map(|half| {
            half.iter()
                .map(|products| Line::of(force, products, matrix))
                .collect::<Vec<_>>()
        });
        Some((force, change(&early, &late, NEIGHBOURS)?))
    });
    found.collect()
}

/// Change of `f / p` from one half to the other, of lines that resemble their neighbours so much; `None` where they
/// tell none.
fn change(early: &[Line], late: &[Line], correlation: f64) -> Option<Mean> {
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
    let change = Mean {
        value: mean,
        std: (correlation * scatter / whole).sqrt(),
        freedom,
        noise: (noise(early) - noise(late)).abs().max(ROUNDING),
    };
    (change.std > 0.0 && change.std.is_finite()).then_some(change)
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
    use crate::draws::Draws;
    use nalgebra::Complex;

    /// Lines on which force and prediction are these, with as much noise of the force as signal times `noise`.
    fn lines(gain: f64, noise: f64, rng: &mut Draws) -> Vec<Line> {
        (0..40)
            .map(|k| {
                let predicted = 1.0 + 0.1 * f64::from(k);
                let elastic = 1.0 + 0.005 * f64::from(k);
                let error = Complex::new(rng.normal(), rng.normal()) * noise * predicted.sqrt();
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
        let mut rng = Draws::new(1);
        let mut below = [0.0; 2];
        let draws = 4000;
        for _ in 0..draws {
            let [a, b] = [(); 2].map(|()| lines(1.0, 0.02, &mut rng));
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
        let [a, b] = [1.0, 1.03].map(|gain| lines(gain, 0.002, &mut rng));
        let found = change(&a, &b, 1.0).unwrap();
        // Of the mean of both.
        assert!(
            (found.value - 0.03 / 1.015).abs() < 4.0 * found.std,
            "{found:?}"
        );
        assert!(found.probability() < 1e-12);
    }

    #[test]
    fn a_change_is_said_with_its_interval() {
        let change = Mean {
            value: 0.01,
            std: 0.002,
            freedom: 20.0,
            noise: ROUNDING,
        };
        assert_eq!(percent(&change), "+1.00 ± 0.42 %");
    }

    /// Three lines tell nothing, nor do lines that are one another's copies, nor a force that is not predicted.
    #[test]
    fn too_little_tells_no_change() {
        let mut rng = Draws::new(7);
        let all = lines(1.0, 0.01, &mut rng);
        assert!(change(&all[..2], &all[..2], 1.0).is_none());
        assert!(change(&all[..8], &all[..8], 35.0 / 18.0).is_none());
        assert!(change(&all, &all, 1.0).is_none(), "no scatter at all");
        let other = lines(1.6, 0.01, &mut rng);
        assert!(change(&other, &lines(1.6, 0.01, &mut rng), 1.0).is_none());
        assert!(change(&[], &[], 1.0).is_none());
    }

    /// Without a drive noise takes a share of the ratio: what its own change may do is no drift.
    #[test]
    fn other_noise_in_one_half_is_no_drift() {
        let mut rng = Draws::new(99);
        let early = lines(1.0, 0.001, &mut rng);
        // One part of a hundred more is noise of the accelerations.
        let late: Vec<Line> = lines(1.0, 0.001, &mut rng)
            .into_iter()
            .map(|line| Line {
                predicted: 1.01 * line.predicted,
                ..line
            })
            .collect();
        let found = change(&early, &late, 1.0).unwrap();
        assert!(found.value < -20.0 * found.std, "{found:?}");
        assert!(found.probability() > 0.1, "{found:?}");
    }
}
