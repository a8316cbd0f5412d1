//! Directions of base acceleration that rise above their noise.

use super::record::Record;
use nalgebra::{DMatrix, DVector, Matrix6};

/// Power of a direction over its noise from which it counts as excited.
const EXCITED: f64 = 3.0;
/// Share of the noisiest component's noise below which a component is rounding.
const ROUNDING: f64 = 1e-20;

/// Directions in which the base moves.
#[derive(Clone, Debug)]
pub(super) struct Excited {
    /// Coordinates of an acceleration along the excited directions, k x 6: noise of one each.
    pub(super) coordinates: DMatrix<f64>,
    /// Acceleration of each coordinate, 6 x k.
    pub(super) directions: DMatrix<f64>,
    /// Mean power of each coordinate over all lines of all records.
    pub(super) power: Vec<f64>,
    /// Accelerations along the other directions that the sensors see, 6 x m: noise of one each.
    pub(super) resting: DMatrix<f64>,
    /// Lines of all records.
    pub(super) lines: f64,
}

impl Excited {
    /// Of all records together; `None` where nothing moves.
    pub(super) fn of(records: &[Record]) -> Option<Self> {
        let (mut power, mut noise) = (Matrix6::zeros(), Matrix6::zeros());
        let mut lines = 0.0;
        for record in records {
            for (k, a) in record.base.iter().enumerate() {
                let level = record.level(k);
                for j in 0..6 {
                    for i in 0..6 {
                        power[(i, j)] += (a[i] * a[j].conj()).re / level;
                    }
                }
                lines += 1.0;
            }
            noise += record.noise.base * record.base.len() as f64;
        }
        if lines == 0.0 {
            return None;
        }
        power /= lines;
        noise /= lines;
        // Noise along directions that no accelerometer sees is zero, but for rounding. Scales make
        // translations and rotations comparable.
        let most = noise.diagonal().max();
        let scale: [f64; 6] = core::array::from_fn(|i| {
            let v: f64 = noise[(i, i)];
            if v > ROUNDING * most {
                1.0 / v.sqrt()
            } else {
                0.0
            }
        });
        let scaled = |m: &Matrix6<f64>| Matrix6::from_fn(|i, j| m[(i, j)] * scale[i] * scale[j]);
        let (power, noise) = (scaled(&power), scaled(&noise));
        let eigen = noise.symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        let seen: Vec<usize> = (0..6)
            .filter(|&i| eigen.eigenvalues[i] > 1e-9 * largest && largest > 0.0)
            .collect();
        if seen.is_empty() {
            return None;
        }
        let white = DMatrix::from_fn(seen.len(), 6, |r, j| {
            let i = seen[r];
            eigen.eigenvectors[(j, i)] / eigen.eigenvalues[i].sqrt()
        });
        let back = DMatrix::from_fn(6, seen.len(), |j, r| {
            let i = seen[r];
            eigen.eigenvectors[(j, i)] * eigen.eigenvalues[i].sqrt()
        });
        let whitened = &white * DMatrix::from_fn(6, 6, |i, j| power[(i, j)]) * white.transpose();
        let moving = whitened.symmetric_eigen();
        let excited: Vec<usize> = (0..seen.len())
            .filter(|&i| moving.eigenvalues[i] > EXCITED)
            .collect();
        if excited.is_empty() {
            return None;
        }
        let k = excited.len();
        let turn = DMatrix::from_fn(seen.len(), k, |i, r| moving.eigenvectors[(i, excited[r])]);
        let mut coordinates = turn.transpose() * white;
        let mut directions = &back * turn;
        let others: Vec<usize> = (0..seen.len()).filter(|i| !excited.contains(i)).collect();
        let still = DMatrix::from_fn(seen.len(), others.len(), |i, r| {
            moving.eigenvectors[(i, others[r])]
        });
        let mut resting = back * still;
        for j in 0..6 {
            for r in 0..others.len() {
                resting[(j, r)] *= if scale[j] > 0.0 { 1.0 / scale[j] } else { 0.0 };
            }
            for r in 0..k {
                coordinates[(r, j)] *= scale[j];
                directions[(j, r)] *= if scale[j] > 0.0 { 1.0 / scale[j] } else { 0.0 };
            }
        }
        Some(Self {
            coordinates,
            directions,
            power: excited.iter().map(|&i| moving.eigenvalues[i]).collect(),
            resting,
            lines,
        })
    }

    /// Coordinates of the motion whose work `vᵀ W v`, at the powers of this excitation, is largest,
    /// for a work of one; `None` where none is positive.
    pub(super) fn strongest(&self, work: &DMatrix<f64>) -> Option<DVector<f64>> {
        let k = self.power.len();
        let root: Vec<f64> = self.power.iter().map(|p| p.sqrt()).collect();
        let symmetric = DMatrix::from_fn(k, k, |i, j| {
            0.5 * (work[(i, j)] + work[(j, i)]) * root[i] * root[j]
        });
        let eigen = symmetric.symmetric_eigen();
        let top = eigen.eigenvalues.imax();
        let v = DVector::from_fn(k, |i, _| eigen.eigenvectors[(i, top)] * root[i]);
        let square = v.dot(&(work * &v));
        (square > 0.0).then(|| v / square.sqrt())
    }

    /// Takes the accelerations along other directions off, with their noise. Nothing changes where
    /// all six are excited.
    pub(super) fn project(&self, records: &mut [Record]) {
        if self.power.len() == 6 {
            return;
        }
        let onto = &self.directions * &self.coordinates;
        let onto = Matrix6::from_fn(|i, j| onto[(i, j)]);
        let complex = onto.map(nalgebra::Complex::from);
        for record in records {
            for a in &mut record.base {
                *a = complex * *a;
            }
            record.noise.base = onto * record.noise.base * onto.transpose();
        }
    }
}
