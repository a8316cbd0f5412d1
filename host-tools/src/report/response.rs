//! Apparent mass, entry by entry, as measured and as fitted.
//!
//! With as many independent runs as directions of motion, `M = F A⁻¹` line by line. With
//! fewer, no entry is measured on its own; then each run shows its resultants per its own
//! strongest base acceleration, and the fit is asked for the same ratio.

use super::lines::{Excited, Fit, Fitted, comparable, determined_accelerations, measured_forces};
use super::rigid;
use super::scales::lever;
use crate::result::ResultDocument;
use massline_core::geometry::{ACCELERATION_NAMES, RESULTANT_NAMES};
use massline_core::masslines::{Lines, Moments};
use nalgebra::{Complex, Matrix6};

/// A complex 6 x 6 matrix.
type Complex6 = Matrix6<Complex<f64>>;

/// A frequency, Hz, and a complex ratio of force to acceleration.
pub(super) type Point = (f64, Complex<f64>);

/// One panel's data.
pub(super) struct Entry {
    /// Symbol of the entry for a rigid body, such as `m z`, or the force and the acceleration.
    pub title: String,
    /// The force and the acceleration, or the run.
    pub detail: String,
    pub unit: &'static str,
    /// `true` if force and acceleration belong to the same direction.
    pub direct: bool,
    /// Line by line.
    pub measured: Vec<Point>,
    /// Real part of what the fit ascribes to elasticity, at the measured lines.
    pub elastic: Vec<f64>,
    /// The fit, at as many frequencies as it takes to draw it.
    pub fit: Vec<Point>,
    /// The entry of the identified rigid body over frequency.
    pub rigid: Vec<[f64; 2]>,
}

/// The entries of a group of runs.
pub(super) struct Entries {
    /// `true` for entries of the matrix, `false` for ratios of single runs.
    pub solved: bool,
    pub list: Vec<Entry>,
    /// Runs of the group that were left out because there are so many.
    pub left_out: usize,
}

/// More runs than this are not drawn one by one.
const MOST_RUNS: usize = 6;
/// Points of a fitted curve.
const FIT_POINTS: usize = 600;
/// Share of the strongest resultant's power below which one is not drawn.
const FAINT: f64 = 1e-4;

/// Entries of one group.
pub(super) fn entries(group: &Fitted<'_>, result: &ResultDocument) -> Entries {
    let solved = group.read(None, |lines| matrix_entries(group, lines, result));
    if let Ok(Some(list)) = solved {
        return Entries {
            solved: true,
            list,
            left_out: 0,
        };
    }
    let projector = group.read(None, |lines| Excited::new(lines, group.band).projector);
    let rigid = rigid::matrix(result) * projector.unwrap_or_else(|_| Matrix6::identity());
    let names = group.names();
    let mut list = Vec::new();
    for (k, name) in names.iter().enumerate().take(MOST_RUNS) {
        let ratios = group.read(Some(k), |lines| ratios(group, name, lines, &rigid, result));
        list.extend(ratios.into_iter().flatten());
    }
    Entries {
        solved: false,
        list,
        left_out: names.len().saturating_sub(MOST_RUNS),
    }
}

/// The upper triangle of M, if the runs determine it line by line.
fn matrix_entries(
    group: &Fitted<'_>,
    lines: &dyn Lines,
    result: &ResultDocument,
) -> Option<Vec<Entry>> {
    let excited = Excited::new(lines, group.band);
    let count = excited.count();
    if count == 0 || excited.rank != count || (group.is_paired() && lines.runs() < count) {
        return None;
    }
    let forces = measured_forces(group.geometry());
    let places = places(&excited.components, &forces);
    let mut measured: Vec<Vec<Point>> = vec![Vec::with_capacity(lines.count()); places.len()];
    for line in 0..lines.count() {
        let mut moments = Moments::default();
        for run in 0..lines.runs() {
            lines.add_moments(run, line, 1.0, &mut moments);
        }
        let Some(m) = quotient(&moments, &excited.components) else {
            continue;
        };
        for (points, (i, j)) in measured.iter_mut().zip(&places) {
            points.push((lines.frequency(line), m[(*i, *j)]));
        }
    }
    let top = lines.frequency(lines.count().saturating_sub(1));
    let elastic = |i: usize, j: usize, points: &[Point]| -> Vec<f64> {
        let Some(fit) = group.fit else {
            return Vec::new();
        };
        let part = |f: f64| fit.at(f)[(i, j)].re - fit.rigid()[(i, j)];
        points.iter().map(|(f, _)| part(*f)).collect()
    };
    let entry = |((i, j), measured): ((usize, usize), Vec<Point>)| Entry {
        elastic: elastic(i, j, &measured),
        title: rigid::SYMBOLS[i][j].to_owned(),
        detail: format!("{} per {}", RESULTANT_NAMES[i], ACCELERATION_NAMES[j]),
        unit: rigid::unit(i, j),
        direct: i == j,
        measured,
        fit: group.fit.map_or_else(Vec::new, |fit| curve(fit, top, i, j)),
        rigid: rigid::entry(result, i, j).map_or_else(Vec::new, |v| vec![[0.0, v], [top, v]]),
    };
    Some(places.into_iter().zip(measured).map(entry).collect())
}

/// Entries to show: none that is zero for every rigid body, and of two that mirror each other
/// the upper one, if it was measured.
fn places(accelerations: &[bool; 6], forces: &[bool; 6]) -> Vec<(usize, usize)> {
    let there = |i: usize, j: usize| forces[i] && accelerations[j];
    let mut places = Vec::new();
    // The diagonal first, then mass moments, then products of inertia.
    for kind in 0..3 {
        for i in 0..6 {
            for j in i..6 {
                let this = match (i == j, i < 3) {
                    (true, _) => 0,
                    (false, true) => 1,
                    (false, false) => 2,
                };
                if this != kind || rigid::SYMBOLS[i][j].is_empty() {
                    continue;
                }
                if there(i, j) {
                    places.push((i, j));
                } else if there(j, i) {
                    places.push((j, i));
                }
            }
        }
    }
    places
}

/// `Σ f a* (Σ a a*)⁻¹` on the excited components, zero elsewhere.
pub(super) fn quotient(moments: &Moments, components: &[bool; 6]) -> Option<Complex6> {
    let zero = Complex::new(0.0, 0.0);
    let size = |j: usize| moments.aa[(j, j)].re.sqrt();
    // Every component in units of its own size, so that rotations do not look singular.
    let scaled = Complex6::from_fn(|i, j| {
        if i == j {
            Complex::new(1.0, 0.0)
        } else if components[i] && components[j] {
            moments.aa[(i, j)] / (size(i) * size(j))
        } else {
            zero
        }
    });
    let right = Complex6::from_fn(|i, j| {
        if components[j] {
            moments.fa[(i, j)] / size(j)
        } else {
            zero
        }
    });
    let factor = scaled.cholesky()?;
    let left = factor.solve(&right.adjoint()).adjoint();
    let m = Complex6::from_fn(|i, j| {
        if components[j] {
            left[(i, j)] / size(j)
        } else {
            zero
        }
    });
    m.iter()
        .all(|z| z.re.is_finite() && z.im.is_finite())
        .then_some(m)
}

/// One entry of the fit, dense enough for its peaks.
fn curve(fit: Fit<'_>, top: f64, i: usize, j: usize) -> Vec<Point> {
    let mut at: Vec<f64> = (0..=FIT_POINTS)
        .map(|k| top * k as f64 / FIT_POINTS as f64)
        .collect();
    for [frequency, damping] in fit.poles() {
        // Five half-widths on either side of each peak.
        let width = frequency * damping;
        at.extend((-10..=10).map(|k| frequency + 0.5 * width * f64::from(k)));
    }
    at.retain(|f| f.is_finite() && (0.0..=top).contains(f));
    at.sort_by(f64::total_cmp);
    at.into_iter().map(|f| (f, fit.at(f)[(i, j)])).collect()
}

/// Every resultant of a run that its excitation moves, per its strongest acceleration.
fn ratios(
    group: &Fitted<'_>,
    name: &str,
    lines: &dyn Lines,
    rigid: &Matrix6<f64>,
    result: &ResultDocument,
) -> Vec<Entry> {
    let lever = lever(result);
    let excited = Excited::new(lines, group.band);
    let accelerations = comparable(&excited.accelerations, lever, false);
    let determined = determined_accelerations(group.geometry());
    let strongest = (0..6)
        .filter(|j| determined[*j] && excited.components[*j])
        .max_by(|a, b| accelerations[*a].total_cmp(&accelerations[*b]));
    let Some(d) = strongest else {
        return Vec::new();
    };
    let forces = comparable(&excited.forces, lever, true);
    let faint = FAINT * forces.max();
    let rigid_matrix = rigid.map(|x| Complex::new(x, 0.0));
    let shown: Vec<usize> = (0..6)
        .filter(|i| measured_forces(group.geometry())[*i] && forces[*i] > faint)
        .collect();
    let mut list: Vec<Entry> = shown
        .iter()
        .map(|&i| Entry {
            title: format!("{} per {}", RESULTANT_NAMES[i], ACCELERATION_NAMES[d]),
            detail: name.to_owned(),
            unit: rigid::unit(i, d),
            direct: i == d,
            measured: Vec::new(),
            elastic: Vec::new(),
            fit: Vec::new(),
            rigid: Vec::new(),
        })
        .collect();
    for line in 0..lines.count() {
        let mut m = Moments::default();
        lines.add_moments(0, line, 1.0, &mut m);
        let power = m.aa[(d, d)].re;
        if power.is_nan() || power <= 0.0 {
            continue;
        }
        let f = lines.frequency(line);
        let fitted = group.fit.map(|fit| {
            let whole = fit.at(f);
            let rigid = fit.rigid().map(|x| Complex::new(x, 0.0));
            (whole * m.aa, (whole - rigid) * m.aa)
        });
        let rigid = rigid_matrix * m.aa;
        for (entry, &i) in list.iter_mut().zip(&shown) {
            entry.measured.push((f, m.fa[(i, d)] / power));
            entry.rigid.push([f, rigid[(i, d)].re / power]);
            if let Some((whole, elastic)) = &fitted {
                entry.fit.push((f, whole[(i, d)] / power));
                entry.elastic.push(elastic[(i, d)].re / power);
            }
        }
    }
    list
}
