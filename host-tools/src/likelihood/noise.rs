//! Noise of the twelve resultants from lines that a drive explains.
//!
//! Around each line response and leakage are smooth: polynomials of degree four in 25 lines. What
//! these leave is noise: that of the resultants, and that of the drive's own recording as the
//! structure responds to it, which is taken off.

use super::record::Noise;
use massline_core::geometry::RESULTANTS;
use nalgebra::{Complex, DMatrix, Matrix6, Vector6};

type C = Complex<f64>;

/// Lines of a window.
const WINDOW: usize = 25;
/// Unknowns of a window: five of the response to each drive, five of leakage.
const TERMS: usize = 5;
/// Median over mean of a sum of squares with some thirty degrees of freedom (Wilson-Hilferty).
const MEDIAN: f64 = 0.978;
/// Windows whose median is the level of the middle one.
const SMOOTHED: usize = 15;
/// Least eigenvalue of a covariance, as a share of the largest of its correlations.
const LEAST: f64 = 0.02;
/// Share of the largest noise of accelerations, or of resultants, that is rounding.
const ROUNDING: f64 = 1e-20;
/// Ratio of a run's noise to the mean of all up to which they count as one.
const ALIKE: f64 = 2.0;
/// Ratio of high to low levels from which noise counts as coloured.
const COLOURED: f64 = 1.3;

/// Noise per line and its level line by line, empty where it is white.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// At a level of one.
    pub noise: Noise,
    /// Level of each line.
    pub level: Vec<f64>,
}

/// Noise of a run from its drives and twelve resultants; `None` where there are too few lines.
#[must_use]
pub fn beside_drives(drives: &[&[C]], resultants: &[&[C]; RESULTANTS]) -> Option<Found> {
    beside(drives, None, resultants)
}

/// Noise of a run without a drive, from the known noise of its six base accelerations: their
/// strongest combination takes the drive's place, and what its noise leaves is taken off. Motion
/// that it does not explain counts as noise of the resultants.
#[must_use]
pub fn beside_base(base_noise: &Matrix6<f64>, resultants: &[&[C]; RESULTANTS]) -> Option<Found> {
    let weights = strongest(base_noise, resultants);
    let drive = combined(&weights, resultants);
    let variance = (weights.transpose() * base_noise * weights)[0];
    let mut found = beside(&[&drive], Some(variance), resultants)?;
    found.noise.base = *base_noise;
    Some(found)
}

/// Base accelerations beside their strongest combination.
pub struct BesideStrongest {
    /// Weights w of the combination s = w'b of the accelerations b.
    pub weights: Vector6<f64>,
    /// Windows of lines.
    pub windows: Vec<Beside>,
}

/// One window of lines of [`BesideStrongest`].
pub struct Beside {
    /// Mean response h of the accelerations to the combination: b = h s.
    pub response: Vector6<C>,
    /// Covariance of b - h s, its real part.
    pub left: Matrix6<f64>,
    /// Real values that it is the mean of.
    pub count: f64,
}

/// The base accelerations beside their strongest combination, in the half of the windows that are most alike;
/// `None` where there are too few lines.
#[must_use]
pub fn beside_strongest(
    base_noise: &Matrix6<f64>,
    resultants: &[&[C]; RESULTANTS],
) -> Option<BesideStrongest> {
    let weights = strongest(base_noise, resultants);
    let drive = combined(&weights, resultants);
    let left = windows(&[&drive], resultants)?;
    let powers: [Vec<f64>; 6] =
        core::array::from_fn(|i| left.iter().map(|w| w.left[(i, i)]).collect());
    let medians = powers.map(median);
    let shares = left.iter().map(|w| {
        let seen = (0..6).filter(|&i| medians[i] > 0.0);
        seen.map(|i| w.left[(i, i)] / medians[i]).sum::<f64>()
    });
    let alike = alike(&shares.collect::<Vec<_>>());
    let windows = left.iter().zip(alike).filter(|(_, alike)| *alike);
    let windows = windows.map(|(w, _)| Beside {
        response: w.gains[0],
        left: Matrix6::from_fn(|i, j| w.left[(i, j)]),
        count: (2 * (WINDOW - 2 * TERMS)) as f64,
    });
    Some(BesideStrongest {
        weights,
        windows: windows.collect(),
    })
}

/// Weights of the combination of base accelerations that has the most power over its noise.
fn strongest(base_noise: &Matrix6<f64>, resultants: &[&[C]; RESULTANTS]) -> Vector6<f64> {
    let scale = Vector6::from_fn(|i, _| {
        let v = base_noise[(i, i)];
        if v > 0.0 { 1.0 / v.sqrt() } else { 0.0 }
    });
    let scaled = |i: usize, k: usize| resultants[i][k] * scale[i];
    let mut power = Matrix6::<f64>::zeros();
    for k in 0..resultants[0].len() {
        let a: [C; 6] = core::array::from_fn(|i| scaled(i, k));
        for j in 0..6 {
            for i in 0..6 {
                power[(i, j)] += (a[i] * a[j].conj()).re;
            }
        }
    }
    let eigen = power.symmetric_eigen();
    let top = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    top.component_mul(&scale)
}

/// A combination of the base accelerations, line by line.
fn combined(weights: &Vector6<f64>, resultants: &[&[C]; RESULTANTS]) -> Vec<C> {
    let at = |k: usize| (0..6).map(|i| resultants[i][k] * weights[i]).sum();
    (0..resultants[0].len()).map(at).collect()
}

/// Windows one behind the other; `None` where there are too few lines.
fn windows(drives: &[&[C]], resultants: &[&[C]; RESULTANTS]) -> Option<Vec<Window>> {
    let lines = resultants[0].len();
    let terms = TERMS * (1 + drives.len());
    if drives.is_empty() || lines < 4 * WINDOW || terms + 6 > WINDOW {
        return None;
    }
    let left: Vec<Window> = (0..=lines - WINDOW)
        .step_by(WINDOW)
        .filter_map(|start| Window::new(drives, resultants, start, terms))
        .collect();
    (left.len() >= 4).then_some(left)
}

/// The half of the windows that are most alike: near resonances polynomials leave more, and too much of the drive's
/// noise is taken off or too little.
fn alike(shares: &[f64]) -> Vec<bool> {
    let middle = median(shares.to_vec());
    let far: Vec<f64> = shares.iter().map(|s| (s - middle).abs()).collect();
    let near = median(far.clone());
    far.into_iter().map(|far| far <= near).collect()
}

/// Noise beside drives whose own noise is known, or shows in what accelerations and resultants have
/// in common.
fn beside(drives: &[&[C]], known: Option<f64>, resultants: &[&[C]; RESULTANTS]) -> Option<Found> {
    let lines = resultants[0].len();
    let terms = TERMS * (1 + drives.len());
    let mut left = windows(drives, resultants)?;
    for drive in 0..drives.len() {
        take_drive_noise(&mut left, drive, known);
    }
    let power = |w: &Window, c: usize| w.left[(c, c)].max(0.0);
    let medians: [f64; RESULTANTS] = core::array::from_fn(|c| {
        let all: Vec<f64> = left.iter().map(|w| power(w, c)).collect();
        median(all) / MEDIAN
    });
    let visible = visible(&medians);
    let shares: Vec<f64> = left
        .iter()
        .map(|w| {
            let seen = (0..RESULTANTS).filter(|&c| visible[c]);
            let shares: Vec<f64> = seen.map(|c| power(w, c) / medians[c]).collect();
            shares.iter().sum::<f64>() / shares.len().max(1) as f64
        })
        .collect();
    let mut sum = DMatrix::<f64>::zeros(RESULTANTS, RESULTANTS);
    let mut whole = [0.0; RESULTANTS];
    let mut count = 0.0;
    for (w, alike) in left.iter().zip(alike(&shares)) {
        if alike {
            sum += &w.left;
            for (sum, x) in whole.iter_mut().zip(&w.whole) {
                *sum += x;
            }
            count += 1.0;
        }
    }
    // A difference is known no better than what it is taken from scatters: where a drive's noise is all but the
    // whole of it, the rest may come out as nothing or less.
    let scatter = 1.0 / (count * (WINDOW - terms) as f64).sqrt();
    let half = |first: usize| {
        let mean = Matrix6::from_fn(|i, j| sum[(first + i, first + j)] / count);
        let least = core::array::from_fn(|i| scatter * whole[first + i] / count);
        positive(&mean, &least)
    };
    Some(Found {
        noise: Noise {
            base: half(0),
            force: half(6),
        },
        level: levels(&shares, lines),
    })
}

/// Polynomials of one window, and what they leave.
struct Window {
    /// Covariance of what is left, its real part.
    left: DMatrix<f64>,
    /// Its diagonal before noise of a drive is taken off.
    whole: [f64; RESULTANTS],
    /// Mean of h h* over the window for the response h to each drive, its real part.
    responses: Vec<DMatrix<f64>>,
    /// Mean of h over the window for the base accelerations.
    gains: Vec<Vector6<C>>,
}

impl Window {
    fn new(
        drives: &[&[C]],
        resultants: &[&[C]; RESULTANTS],
        start: usize,
        terms: usize,
    ) -> Option<Self> {
        let power = |n: usize, t: usize| {
            let x = (n as f64 - (WINDOW / 2) as f64) / (WINDOW / 2) as f64;
            x.powi((t % TERMS) as i32)
        };
        let regressors = DMatrix::from_fn(WINDOW, terms, |n, t| match (t / TERMS).checked_sub(1) {
            None => Complex::from(power(n, t)),
            Some(d) => drives[d][start + n] * power(n, t),
        });
        let data = DMatrix::from_fn(WINDOW, RESULTANTS, |n, c| resultants[c][start + n]);
        let qr = regressors.qr();
        let (q, r) = (qr.q(), qr.r());
        let projected = q.adjoint() * &data;
        let left = &data - &q * &projected;
        let coefficients = r.solve_upper_triangular(&projected)?;
        let mut gains = Vec::with_capacity(drives.len());
        let mut responses = Vec::with_capacity(drives.len());
        for d in 1..=drives.len() {
            let mut mean = DMatrix::zeros(RESULTANTS, RESULTANTS);
            let mut gain = Vector6::zeros();
            for n in 0..WINDOW {
                let h: Vec<C> = (0..RESULTANTS)
                    .map(|c| {
                        let of = d * TERMS..(d + 1) * TERMS;
                        of.map(|t| coefficients[(t, c)] * power(n, t)).sum()
                    })
                    .collect();
                for j in 0..RESULTANTS {
                    for i in 0..RESULTANTS {
                        mean[(i, j)] += (h[i] * h[j].conj()).re / WINDOW as f64;
                    }
                }
                gain += Vector6::from_fn(|i, _| h[i] / WINDOW as f64);
            }
            responses.push(mean);
            gains.push(gain);
        }
        let left = (left.adjoint() * &left).map(|x| x.re / (WINDOW - terms) as f64);
        let finite = left.iter().all(|x| x.is_finite());
        let whole = core::array::from_fn(|c| left[(c, c)]);
        finite.then_some(Self {
            left,
            whole,
            responses,
            gains,
        })
    }
}

/// Resultants with noise: one that is not measured is zero, but for rounding.
fn visible(medians: &[f64; RESULTANTS]) -> [bool; RESULTANTS] {
    let largest = |half: &[f64]| half.iter().copied().fold(0.0, f64::max);
    let (base, force) = (largest(&medians[..6]), largest(&medians[6..]));
    core::array::from_fn(|c| medians[c] > ROUNDING * if c < 6 { base } else { force })
}

/// Takes off what noise of a drive's own recording leaves: the response h to it once more, σ² h h*.
/// It shows in what accelerations and resultants have in common, of which their own noise has none.
fn take_drive_noise(windows: &mut [Window], drive: usize, known: Option<f64>) {
    let medians: [f64; RESULTANTS] =
        core::array::from_fn(|c| median(windows.iter().map(|w| w.left[(c, c)]).collect()));
    let visible = visible(&medians);
    let scale: [f64; RESULTANTS] =
        core::array::from_fn(|c| if visible[c] { 1.0 / medians[c] } else { 0.0 });
    let common = |w: &Window| {
        let h = &w.responses[drive];
        let (mut up, mut down) = (0.0, 0.0);
        for j in 0..6 {
            for i in 6..RESULTANTS {
                let weight = scale[i] * scale[j];
                up += h[(i, j)] * w.left[(i, j)] * weight;
                down += h[(i, j)] * h[(i, j)] * weight;
            }
        }
        if down > 0.0 { up / down } else { 0.0 }
    };
    // Window by window: what the drive's noise happens to be there is the same in all resultants.
    for window in windows {
        let variance = known.unwrap_or_else(|| common(window));
        window.left -= &window.responses[drive] * variance;
    }
}

/// The matrix without negative eigenvalues, which taking off the drive's noise may leave, nor diagonal terms
/// below their `least`; rows whose least is zero remain zero.
fn positive(matrix: &Matrix6<f64>, least: &[f64; 6]) -> Matrix6<f64> {
    let root = Vector6::from_fn(|i, _| matrix[(i, i)].max(least[i]).sqrt());
    let scaled = Matrix6::from_fn(|i, j| {
        let norm = root[i] * root[j];
        match norm > 0.0 {
            true if i == j => 1.0,
            true => matrix[(i, j)] / norm,
            false => 0.0,
        }
    });
    let eigen = scaled.symmetric_eigen();
    let least = LEAST * eigen.eigenvalues.max();
    let values = eigen
        .eigenvalues
        .map(|x| if x.abs() < 1e-12 { 0.0 } else { x.max(least) });
    let scaled =
        eigen.eigenvectors * Matrix6::from_diagonal(&values) * eigen.eigenvectors.transpose();
    Matrix6::from_fn(|i, j| scaled[(i, j)] * root[i] * root[j])
}

/// Noise of several runs by the same sensors, together where they agree: their mean at a level of
/// one. Otherwise each keeps its own.
pub fn pool(runs: &mut [Found]) {
    let count = runs.len() as f64;
    let mean = |of: fn(&Noise) -> Matrix6<f64>| {
        let sum = runs
            .iter()
            .fold(Matrix6::zeros(), |sum, r| sum + of(&r.noise));
        sum / count
    };
    let (base, force) = (mean(|n| n.base), mean(|n| n.force));
    let agree = |own: &Matrix6<f64>, mean: &Matrix6<f64>| {
        (0..6).all(|i| {
            let (own, mean) = (own[(i, i)], mean[(i, i)]);
            own <= ALIKE * mean && mean <= ALIKE * own
        })
    };
    if runs
        .iter()
        .all(|r| agree(&r.noise.base, &base) && agree(&r.noise.force, &force))
    {
        for run in runs {
            run.noise = Noise { base, force };
        }
    }
}

/// Smoothed level of each line; empty where it hardly varies.
fn levels(shares: &[f64], lines: usize) -> Vec<f64> {
    let half = SMOOTHED / 2;
    let smooth: Vec<f64> = (0..shares.len())
        .map(|w| {
            let near = &shares[w.saturating_sub(half)..(w + half + 1).min(shares.len())];
            median(near.to_vec())
        })
        .collect();
    let mut sorted = smooth.clone();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize];
    if at(0.9) < COLOURED * at(0.1) {
        return Vec::new();
    }
    let of = |k: usize| {
        let place = (k as f64 - (WINDOW / 2) as f64) / WINDOW as f64;
        let low = (place.max(0.0) as usize).min(smooth.len() - 1);
        let high = (low + 1).min(smooth.len() - 1);
        let part = (place - low as f64).clamp(0.0, 1.0);
        smooth[low] * (1.0 - part) + smooth[high] * part
    };
    (0..lines).map(of).collect()
}

/// The middle one, or the mean of the two middle ones; zero of none.
pub(super) fn median(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    let n = all.len();
    match n {
        0 => 0.0,
        _ => 0.5 * (all[(n - 1) / 2] + all[n / 2]),
    }
}
