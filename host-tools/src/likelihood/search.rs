//! A first look for a resonance: the frequency and damping at which a free 6 x 6 residue explains
//! most of what rigid body, term in ω² and known modes leave.

use super::excited::Excited;
use super::model::{FittedMode, Model, response, rest_of};
use super::record::Record;
use super::solve::{scaled, to_unit_diagonal};
use nalgebra::{Complex, DMatrix, DVector, Matrix6, Vector6};
use pulp::{Arch, Simd, WithSimd};

type C = Complex<f64>;

/// Ratio of neighbouring frequencies of the grid, less one.
const STEP: f64 = 0.004;
/// Dampings of the grid.
const DAMPINGS: [f64; 2] = [0.004, 0.015];
/// The grid ends at this share of the highest line.
const BEYOND: f64 = 1.35;
/// Distance from a known mode, as a share of its frequency, that counts as away from it.
const NEAR: f64 = 0.04;
/// Share of the highest line from which on a mode is sought by itself.
const LAST: f64 = 0.97;
/// Candidates whose sums are made together, while the products of a group are at hand.
const TOGETHER: usize = 4;
/// Least width of a group of lines, Hz.
const WIDTH: f64 = 0.15;

/// Gain, frequency in Hz, damping and residue of a candidate.
type Candidate = (f64, f64, f64, DMatrix<f64>);

/// Sums of products over a group of lines, along the excited directions.
struct Group {
    frequency: f64,
    /// Σ y y*, k x k.
    base: DMatrix<C>,
    /// Σ f y*, 6 x k, with resultants whose noise is one.
    cross: DMatrix<C>,
}

/// Groups of lines of all records.
pub(super) struct Groups {
    groups: Vec<Group>,
    highest: f64,
    /// From resultants whose noise is one to those of the sensors.
    unwhiten: Matrix6<f64>,
    force_information: Matrix6<f64>,
    base_noise: Matrix6<f64>,
    excited: Excited,
}

impl Groups {
    /// Of records that measure the same equations; `None` where the noise of these is singular.
    pub(super) fn new(records: &[Record], excited: &Excited) -> Option<Self> {
        let rows = &records.first()?.equations;
        let lines: f64 = records.iter().map(|r| r.frequencies.len() as f64).sum();
        let mean = |of: &dyn Fn(&Record) -> Matrix6<f64>| {
            let each = records
                .iter()
                .map(|r| of(r) * (r.frequencies.len() as f64 / lines));
            each.fold(Matrix6::zeros(), |sum, m| sum + m)
        };
        let mut noise = rows * mean(&|r| r.noise.force) * rows.transpose();
        for i in 0..6 {
            if rows.row(i).norm_squared() == 0.0 {
                noise[(i, i)] = 1.0;
            }
        }
        let factor = noise.cholesky()?.l();
        let whiten = factor.try_inverse()? * rows;
        let complex = whiten.map(Complex::from);
        let k = excited.power.len();
        let coordinates = excited.coordinates.map(Complex::from);
        let highest = super::record::highest(records);
        let mut groups: Vec<Group> = Vec::new();
        let mut cells: std::collections::BTreeMap<usize, Group> = std::collections::BTreeMap::new();
        for record in records {
            for (n, &frequency) in record.frequencies.iter().enumerate() {
                let group = cells.entry(cell(frequency)).or_insert_with(|| Group {
                    frequency: middle(cell(frequency)),
                    base: DMatrix::zeros(k, k),
                    cross: DMatrix::zeros(6, k),
                });
                let weight = 1.0 / record.level(n);
                let y = &coordinates * DVector::from_fn(6, |i, _| record.base[n][i]);
                let f = complex * record.force[n];
                for j in 0..k {
                    let c = y[j].conj() * weight;
                    for i in 0..k {
                        group.base[(i, j)] += y[i] * c;
                    }
                    for i in 0..6 {
                        group.cross[(i, j)] += f[i] * c;
                    }
                }
            }
        }
        groups.extend(cells.into_values());
        Some(Self {
            groups,
            highest,
            unwhiten: rows.transpose() * factor,
            force_information: whiten.transpose() * whiten,
            base_noise: mean(&|r| r.noise.base),
            excited: excited.clone(),
        })
    }

    /// Modes that explain most beside those of a model: of all, of those away from known modes, and of
    /// those around the last line and beyond it. Leakage, which this search leaves out, makes
    /// candidates next to a strong resonance look better than they are.
    pub(super) fn best(&self, model: &Model) -> Vec<FittedMode> {
        let found = self.candidates(model).unwrap_or_default();
        let mut modes: Vec<FittedMode> = Vec::new();
        for (_, frequency, damping, residue) in found.into_iter().flatten() {
            let same = |m: &FittedMode| (m.frequency() / frequency - 1.0).abs() < STEP;
            if let Some(l) = self.participation(&residue)
                && !modes.iter().any(same)
            {
                modes.push(FittedMode::new(frequency, damping, l));
            }
        }
        modes
    }

    /// The best candidate of each kind.
    fn candidates(&self, model: &Model) -> Option<[Option<Candidate>; 3]> {
        let known = Known::new(self, model)?;
        let mut best: [Option<Candidate>; 3] = [None, None, None];
        for together in self.poles()?.chunks(TOGETHER) {
            let found = Arch::new().dispatch(Candidates {
                poles: together,
                groups: &self.groups,
                blocks: &known.blocks,
            });
            for (&[frequency, damping], sums) in together.iter().zip(found) {
                let Some((gain, residue)) = known.gain(&sums) else {
                    continue;
                };
                let away = |m: &FittedMode| (m.frequency() / frequency - 1.0).abs() > NEAR;
                let kinds = [
                    true,
                    model.modes.iter().all(away),
                    frequency > LAST * self.highest,
                ];
                for (slot, kind) in best.iter_mut().zip(kinds) {
                    if kind && slot.as_ref().is_none_or(|b| gain > b.0) {
                        *slot = Some((gain, frequency, damping, residue.clone()));
                    }
                }
            }
        }
        Some(best)
    }

    /// Frequencies in Hz and dampings of the candidates.
    fn poles(&self) -> Option<Vec<[f64; 2]>> {
        let lowest = 4.0 * self.groups.first()?.frequency;
        let steps = (self.highest * BEYOND / lowest).ln() / STEP.ln_1p();
        let frequencies =
            (0..=(steps.max(0.0) as usize)).map(|step| lowest * (step as f64 * STEP.ln_1p()).exp());
        Some(
            frequencies
                .flat_map(|frequency| DAMPINGS.map(|damping| [frequency, damping]))
                .collect(),
        )
    }

    /// Functions of frequency of the known terms.
    fn functions(&self, model: &Model, frequency: f64) -> Vec<C> {
        let ratio = frequency / self.highest;
        let modes = (model.modes.iter())
            .map(|mode| response(frequency / mode.frequency(), mode.damping(), mode.exponent));
        [Complex::from(1.0), Complex::from(rest_of(ratio))]
            .into_iter()
            .chain(modes)
            .collect()
    }

    /// Weight of lines whose accelerations' noise appears in the forces through the model.
    fn weight(&self, model: &Model, frequency: f64) -> f64 {
        let m = model.at(usize::MAX, frequency);
        let spread = m * self.base_noise.map(Complex::from) * m.adjoint();
        let information = self.force_information.map(Complex::from);
        1.0 / (1.0 + (spread * information).trace().re / 6.0)
    }

    /// L of the residue that is nearest to rank one: from the direction of most power.
    fn participation(&self, residue: &DMatrix<f64>) -> Option<Vector6<f64>> {
        let k = self.excited.power.len();
        // Forces per coordinate, 6 x k.
        let whitened = residue.transpose();
        let forces = DMatrix::from_fn(6, k, |i, j| {
            (0..6)
                .map(|l| self.unwhiten[(i, l)] * whitened[(l, j)])
                .sum()
        });
        let work = self.excited.directions.transpose() * &forces;
        let l = forces * self.excited.strongest(&work)?;
        Some(Vector6::from_fn(|i, _| l[i]))
    }
}

/// Rigid body, term in ω² and known modes, whose share is taken off before a candidate is judged.
struct Known {
    /// Cholesky's factor of their normal matrix, whose diagonal was scaled to one by `scale`.
    lower: DMatrix<f64>,
    scale: DVector<f64>,
    /// The factor's inverse times the resultants.
    right: DMatrix<f64>,
    /// Products of each group with their functions of frequency.
    blocks: Vec<Blocks>,
    /// Number of excited directions.
    k: usize,
}

impl Known {
    /// Those of a model; `None` where they cannot be told apart.
    fn new(lines: &Groups, model: &Model) -> Option<Self> {
        let k = lines.excited.power.len();
        let functions: Vec<Vec<C>> = (lines.groups.iter())
            .map(|group| lines.functions(model, group.frequency))
            .collect();
        let weights: Vec<f64> = (lines.groups.iter())
            .map(|group| lines.weight(model, group.frequency))
            .collect();
        let size = k * (2 + model.modes.len());
        let mut normal = DMatrix::<f64>::zeros(size, size);
        let mut right = DMatrix::<f64>::zeros(size, 6);
        for ((group, of), weight) in lines.groups.iter().zip(&functions).zip(&weights) {
            for (b, phi) in of.iter().enumerate() {
                add_right(&mut right, b * k, group, *phi, *weight);
                for (c, psi) in of.iter().enumerate() {
                    let product = phi.conj() * psi * *weight;
                    add_product(&mut normal, (b * k, c * k), group, product);
                }
            }
        }
        let scale = to_unit_diagonal(&mut normal);
        for j in 0..size {
            normal[(j, j)] += 1e-10;
        }
        let lower = normal.cholesky()?.l();
        let blocks = (lines.groups.iter().zip(&functions).zip(&weights))
            .map(|((group, of), weight)| Blocks::new(group, of, *weight))
            .collect();
        let right = lower.solve_lower_triangular(&scaled(right, &scale))?;
        Some(Self {
            lower,
            scale,
            right,
            blocks,
            k,
        })
    }

    /// What a candidate explains beside them, and its residue; `None` where it cannot be told from them.
    fn gain(&self, sums: &Candidated) -> Option<(f64, DMatrix<f64>)> {
        let (k, size) = (self.k, self.lower.nrows());
        let (cross, rest) = sums.of.split_at(size * k);
        let cross = scaled(DMatrix::from_column_slice(size, k, cross), &self.scale);
        let cross = self.lower.solve_lower_triangular(&cross)?;
        let mut own = DMatrix::from_column_slice(k, k, &sums.own);
        let mut rest = DMatrix::from_column_slice(k, 6, rest);
        let diagonal: f64 = own.trace();
        own -= cross.transpose() * &cross;
        rest -= cross.transpose() * &self.right;
        for j in 0..k {
            own[(j, j)] += 1e-9 * diagonal / k as f64;
        }
        let residue = own.cholesky()?.solve(&rest);
        Some((residue.dot(&rest), residue))
    }
}

/// Products of one group, column after column: with the known functions, and with the resultants. A
/// candidate's sums are these, times real and imaginary part of its response.
struct Blocks {
    re: Vec<f64>,
    im: Vec<f64>,
    /// Products of base accelerations, which go with the square of its response.
    own: Vec<f64>,
}

impl Blocks {
    fn new(group: &Group, of: &[C], weight: f64) -> Self {
        let k = group.base.nrows();
        let count = of.len() * k * k + k * 6;
        let mut blocks = Self {
            re: Vec::with_capacity(count),
            im: Vec::with_capacity(count),
            own: Vec::with_capacity(k * k),
        };
        for j in 0..k {
            for phi in of {
                for i in 0..k {
                    let product = phi.conj() * group.base[(j, i)] * weight;
                    blocks.re.push(product.re);
                    blocks.im.push(-product.im);
                }
            }
            for i in 0..k {
                blocks.own.push(group.base[(j, i)].re * weight);
            }
        }
        for i in 0..6 {
            for j in 0..k {
                let product = group.cross[(i, j)] * weight;
                blocks.re.push(product.re);
                blocks.im.push(product.im);
            }
        }
        blocks
    }
}

/// Sums of some candidates, compiled for the widest lanes that the processor has.
struct Candidates<'a> {
    /// Frequency in Hz and damping.
    poles: &'a [[f64; 2]],
    groups: &'a [Group],
    blocks: &'a [Blocks],
}

/// Sums of one candidate, in the order of [`Blocks`].
struct Candidated {
    of: Vec<f64>,
    own: Vec<f64>,
}

impl WithSimd for Candidates<'_> {
    type Output = Vec<Candidated>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let [of, own] = (self.blocks.first()).map_or([0; 2], |b| [b.re.len(), b.own.len()]);
        let mut all: Vec<Candidated> = Vec::with_capacity(self.poles.len());
        for _ in self.poles {
            all.push(Candidated {
                of: vec![0.0; of],
                own: vec![0.0; own],
            });
        }
        for (group, blocks) in self.groups.iter().zip(self.blocks) {
            for ([frequency, damping], sums) in self.poles.iter().zip(&mut all) {
                let d = response(group.frequency / frequency, *damping, 1.0);
                for ((sum, re), im) in sums.of.iter_mut().zip(&blocks.re).zip(&blocks.im) {
                    *sum += d.re * re + d.im * im;
                }
                let square = d.norm_sqr();
                for (sum, x) in sums.own.iter_mut().zip(&blocks.own) {
                    *sum += square * x;
                }
            }
        }
        all
    }
}

/// Number of the group that a frequency belongs to: groups are 0.4 % wide, or 0.15 Hz.
fn cell(frequency: f64) -> usize {
    let corner = WIDTH / STEP;
    if frequency < corner {
        (frequency / WIDTH) as usize
    } else {
        (corner / WIDTH + (frequency / corner).ln() / STEP) as usize
    }
}

/// Frequency in the middle of a group, Hz.
fn middle(cell: usize) -> f64 {
    let (corner, place) = (WIDTH / STEP, cell as f64 + 0.5);
    let straight = corner / WIDTH;
    if place < straight {
        place * WIDTH
    } else {
        corner * ((place - straight) * STEP).exp()
    }
}

/// Adds Re(product · Σ y y*) transposed, so that rows belong to the conjugated factor.
fn add_product(into: &mut DMatrix<f64>, at: (usize, usize), group: &Group, product: C) {
    let k = group.base.nrows();
    for j in 0..k {
        for i in 0..k {
            let s = group.base[(j, i)];
            into[(at.0 + i, at.1 + j)] += product.re * s.re - product.im * s.im;
        }
    }
}

/// Adds Re(conj(φ) f y*) transposed.
fn add_right(into: &mut DMatrix<f64>, at: usize, group: &Group, phi: C, weight: f64) {
    let k = group.base.nrows();
    let phi = phi.conj() * weight;
    for i in 0..6 {
        for j in 0..k {
            let s = group.cross[(i, j)];
            into[(at + j, i)] += phi.re * s.re - phi.im * s.im;
        }
    }
}
