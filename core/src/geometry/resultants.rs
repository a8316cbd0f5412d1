//! From channels to one acceleration and one set of resultants: equations (4) and (5).

use super::{Accelerometer, Equations, GeometryError, LoadCell, MAX_CHANNELS, ResultantNoise};
use crate::algebra::symmetric_eigen;
use core::borrow::Borrow;
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// Numbers that a sample becomes: six accelerations of A, then six resultants at A.
pub const RESULTANTS: usize = 12;

/// A direction counts as seen by the sensors when its share of the normal matrix
/// exceeds this. It is a squared sine: 1e-10 is sensors 10 m from A and 0.1 mm apart.
const RANK: f64 = 1e-10;

/// Equation (4): the weighted least-squares acceleration of A from any number of
/// accelerometers, `a = (Xaᵀ W Xa)⁻¹ Xaᵀ W a_M`.
///
/// If the accelerometers do not determine the motion, the smallest one is taken that explains
/// their readings: first the least rotation, then the least translation. So a single
/// accelerometer on a uniaxial table means translation along its axis, and what a
/// plane set-up does not see is taken as zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AccelerationFit {
    reference: Vector3<f64>,
    /// (Xaᵀ W Xa)⁺ in the sense above.
    inverse: Matrix6<f64>,
    seen_translation: Matrix3<f64>,
    seen_rotation: Matrix3<f64>,
}

impl AccelerationFit {
    /// The fit for pairs of an accelerometer and its weight (1 where none is wanted),
    /// about the reference point A (m).
    ///
    /// # Errors
    /// [`GeometryError::Weight`] for a negative or non-finite weight,
    /// [`GeometryError::NoAccelerometer`] if nothing carries weight,
    /// [`GeometryError::NotFinite`] if positions or weights are too large to compute with.
    #[inline(never)] // One step's matrices at a time.
    pub fn new(
        sensors: impl IntoIterator<Item = (impl Borrow<Accelerometer>, f64)>,
        reference: &Vector3<f64>,
    ) -> Result<Self, GeometryError> {
        let mut normal = Matrix6::zeros();
        let mut total = 0.0;
        for (sensor, weight) in sensors {
            if !(weight.is_finite() && weight >= 0.0) {
                return Err(GeometryError::Weight);
            }
            let row = sensor.borrow().rigid_body_row(reference);
            for j in 0..6 {
                for i in 0..6 {
                    normal[(i, j)] += row[i] * row[j] * weight;
                }
            }
            total += weight;
        }
        if total <= 0.0 {
            return Err(GeometryError::NoAccelerometer);
        }
        let fit = Self::solved(&normal, reference);
        let seen = fit.seen_translation.iter().chain(&fit.seen_rotation);
        if !seen.chain(&fit.inverse).all(|x| x.is_finite()) {
            return Err(GeometryError::NotFinite);
        }
        Ok(fit)
    }

    /// The fit with these normal equations.
    #[inline(never)] // One step's matrices at a time.
    fn solved(normal: &Matrix6<f64>, reference: &Vector3<f64>) -> Self {
        let tt: Matrix3<f64> = normal.fixed_view::<3, 3>(0, 0).into();
        let tr: Matrix3<f64> = normal.fixed_view::<3, 3>(0, 3).into();
        let rr: Matrix3<f64> = normal.fixed_view::<3, 3>(3, 3).into();
        let (tt_inverse, seen_translation) = pseudo_inverse(&tt, tt.trace());
        // What rotation does to the readings beyond what translation could do.
        let schur = rr - tr.transpose() * tt_inverse * tr;
        let schur = (schur + schur.transpose()) * 0.5;
        let (rr_inverse, seen_rotation) = pseudo_inverse(&schur, rr.trace());
        let coupling = tt_inverse * tr * rr_inverse;
        let mut inverse = Matrix6::zeros();
        inverse
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(tt_inverse + coupling * tr.transpose() * tt_inverse));
        inverse.fixed_view_mut::<3, 3>(0, 3).copy_from(&-coupling);
        inverse
            .fixed_view_mut::<3, 3>(3, 0)
            .copy_from(&-coupling.transpose());
        inverse.fixed_view_mut::<3, 3>(3, 3).copy_from(&rr_inverse);
        Self {
            reference: *reference,
            inverse,
            seen_translation,
            seen_rotation,
        }
    }

    /// Acceleration of A per unit reading of this sensor: its
    /// column of `(Xaᵀ W Xa)⁻¹ Xaᵀ W`.
    #[must_use]
    pub fn column(&self, sensor: &Accelerometer, weight: f64) -> Vector6<f64> {
        self.inverse * sensor.rigid_body_row(&self.reference).transpose() * weight
    }

    /// Share of component `j` of the acceleration that the sensors determine: 1 all
    /// of it, 0 none, it is then taken as zero.
    #[must_use]
    pub fn determined(&self, j: usize) -> f64 {
        let (seen, k) = match j.checked_sub(3) {
            None => (&self.seen_translation, j),
            Some(k) => (&self.seen_rotation, k),
        };
        seen.get((k, k)).copied().unwrap_or(0.0)
    }
}

/// Least-norm inverse of a symmetric 3 x 3 matrix and the projector on what it sees.
fn pseudo_inverse(matrix: &Matrix3<f64>, scale: f64) -> (Matrix3<f64>, Matrix3<f64>) {
    let (mut rest, mut vectors) = (*matrix, Matrix3::zeros());
    let values = symmetric_eigen(&mut rest, &mut vectors);
    let mut inverse = Matrix3::zeros();
    let mut projector = Matrix3::zeros();
    for (i, &value) in values.iter().enumerate() {
        if value > RANK * scale {
            let v: Vector3<f64> = vectors.column(i).into();
            inverse += v * v.transpose() / value;
            projector += v * v.transpose();
        }
    }
    (inverse, projector)
}

/// Equation (5): the resultants at A of all load cells, `f = Xfᵀ f_M`, and which of
/// the equations of motion they complete.
///
/// No weights here: every load path must be measured. What lies outside the row space
/// of Xf, taken about the centre of the load cells, is a path without a load cell, and
/// its equations are left out of (8).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ForceResultants {
    reference: Vector3<f64>,
    equations: Equations,
}

impl ForceResultants {
    /// The resultants of `cells` about the reference point A (m).
    ///
    /// # Errors
    /// [`GeometryError::NoLoadCell`] if there is none, [`GeometryError::NotFinite`] if positions
    /// are too large to compute with.
    #[inline(never)] // One step's matrices at a time.
    pub fn new(
        cells: impl IntoIterator<Item = impl Borrow<LoadCell>, IntoIter: Clone>,
        reference: &Vector3<f64>,
    ) -> Result<Self, GeometryError> {
        let cells = cells.into_iter();
        let (mut sum, mut count) = (Vector3::zeros(), 0.0);
        for cell in cells.clone() {
            sum += cell.borrow().position();
            count += 1.0;
        }
        if count == 0.0 {
            return Err(GeometryError::NoLoadCell);
        }
        let centre = sum / count;
        let spread = cells
            .clone()
            .map(|c| (c.borrow().position() - centre).norm())
            .fold(0.0, f64::max);
        let length = if spread > 0.0 { spread } else { 1.0 };
        let mut gram = Matrix6::zeros();
        for cell in cells {
            let mut row = cell.borrow().rigid_body_row(&centre);
            for j in 3..6 {
                row[j] /= length;
            }
            row /= row.norm();
            gram += row.transpose() * row;
        }
        let mut vectors = Matrix6::zeros();
        let values = symmetric_eigen(&mut gram, &mut vectors);
        let mut rows = Matrix6::zeros();
        let mut rank = 0;
        for (i, &value) in values.iter().enumerate() {
            if value > RANK * count {
                let mut row = vectors.column(i).transpose();
                for j in 3..6 {
                    row[j] *= length;
                }
                rows.set_row(rank, &row);
                rank += 1;
            }
        }
        let equations = Equations::spanned(&rows, rank).at(&(reference - centre));
        if !(spread.is_finite() && equations.rows().iter().all(|x| x.is_finite())) {
            return Err(GeometryError::NotFinite);
        }
        Ok(Self {
            reference: *reference,
            equations,
        })
    }

    /// Resultants at A per unit reading of this cell.
    #[must_use]
    pub fn column(&self, cell: &LoadCell) -> Vector6<f64> {
        cell.rigid_body_row(&self.reference).transpose()
    }

    /// The equations of motion these load cells complete, about A.
    #[must_use]
    pub fn equations(&self) -> &Equations {
        &self.equations
    }
}

/// Resultants per unit reading of one channel. An accelerometer adds to the accelerations
/// only, a load cell to forces and moments only.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Column {
    /// Its place in the sample.
    channel: u8,
    gains: [f32; 6],
}

const _: () = assert!(
    MAX_CHANNELS <= u8::MAX as usize,
    "channels are counted in bytes"
);

/// Equations (4) and (5) as one linear map, applied sample by sample in `f32`: SI samples
/// of the channels in, `(a, f)` at A out.
#[derive(Clone, Debug, PartialEq)]
pub struct ResultantMap {
    /// Those of the accelerometers, then those of the load cells.
    columns: heapless::Vec<Column, MAX_CHANNELS, u8>,
    accelerometers: u8,
}

impl ResultantMap {
    /// An empty map; channels are added in the order of the samples.
    #[must_use]
    pub(crate) const fn new() -> Self {
        Self {
            columns: heapless::Vec::new(),
            accelerometers: 0,
        }
    }

    /// Forgets all channels.
    pub(crate) fn clear(&mut self) {
        self.columns.clear();
        self.accelerometers = 0;
    }

    /// Puts the next channel's column at that place among the others.
    fn insert(&mut self, at: usize, contribution: &Vector6<f64>) -> Result<(), GeometryError> {
        let gains: [f32; 6] = core::array::from_fn(|j| contribution[j] as f32);
        if !gains.iter().all(|gain| gain.is_finite()) {
            return Err(GeometryError::NotFinite);
        }
        // As many fit.
        let channel = self.columns.len() as u8;
        self.columns
            .insert(at, Column { channel, gains })
            .map_err(|_| GeometryError::TooManyChannels)
    }

    /// The columns of accelerometers and of load cells, each in the order of the samples.
    fn halves(&self) -> (&[Column], &[Column]) {
        self.columns
            .split_at_checked(self.accelerometers.into())
            .unwrap_or_default()
    }

    /// The next channel is this accelerometer, in m/s².
    ///
    /// # Errors
    /// [`GeometryError::TooManyChannels`]; [`GeometryError::NotFinite`] of a contribution that
    /// is not finite in `f32`.
    pub(crate) fn push_acceleration(
        &mut self,
        contribution: &Vector6<f64>,
    ) -> Result<(), GeometryError> {
        self.insert(self.accelerometers.into(), contribution)?;
        self.accelerometers += 1;
        Ok(())
    }

    /// The next channel is this load cell, in N or N m.
    ///
    /// # Errors
    /// Those of [`Self::push_acceleration`].
    pub(crate) fn push_force(&mut self, contribution: &Vector6<f64>) -> Result<(), GeometryError> {
        self.insert(self.columns.len(), contribution)
    }

    /// One sample of all channels to the twelve resultants. Channels beyond the map,
    /// or missing from the sample, count as zero.
    #[must_use]
    pub fn apply(&self, sample: &[f32]) -> [f32; RESULTANTS] {
        let (accelerometers, cells) = self.halves();
        let [ax, ay, az, bx, by, bz] = sum(accelerometers, sample);
        let [fx, fy, fz, mx, my, mz] = sum(cells, sample);
        [ax, ay, az, bx, by, bz, fx, fy, fz, mx, my, mz]
    }

    /// Power of the rounding errors in each resultant, given the resultants' own powers.
    ///
    /// Coefficients and products are `f32`, so two accelerometers that agree leave a
    /// rotation of a few 1e-8 behind. It is coherent with everything and would pass for
    /// an excitation; below this floor nothing is one. The channels carry at least the
    /// power `P_j / Σc_j²` that any resultant j shows (Cauchy and Schwarz); four epsilons
    /// of amplitude cover coefficient, product and sum.
    #[must_use]
    pub(crate) fn rounding_power(&self, power: &[f64; RESULTANTS]) -> [f64; RESULTANTS] {
        const AMPLITUDE: f64 = 4.0 * f32::EPSILON as f64;
        let gains: [f64; RESULTANTS] = core::array::from_fn(|j| {
            let (accelerometers, cells) = self.halves();
            let half = if j < 6 { accelerometers } else { cells };
            let gains = half.iter().map(|c| f64::from(c.gains[j % 6]));
            gains.map(|g| g * g).sum()
        });
        // Accelerations come from accelerometers, forces from load cells.
        let channels = |skipped: usize| {
            let half = power.iter().zip(&gains).skip(skipped).take(6);
            half.filter(|(_, gain)| **gain > 0.0)
                .map(|(power, gain)| power / gain)
                .fold(0.0, f64::max)
        };
        let (accelerometers, cells) = (channels(0), channels(6));
        let mut number = 0;
        gains.map(|gain| {
            let channel_power = if number < 6 { accelerometers } else { cells };
            number += 1;
            AMPLITUDE * AMPLITUDE * gain * channel_power
        })
    }

    /// The noise of independent sensors that adds up to these powers of the resultants, with
    /// the correlations that the sensors' places and directions give it.
    ///
    /// More sensors than resultants leave open which of them is how noisy. Beginning with all
    /// alike, each is scaled by what the powers it takes part in ask for (the iteration of
    /// Richardson and Lucy), so that no sensor is noisier than the powers need it to be.
    #[must_use]
    pub(crate) fn noise(&self, powers: &[f64; RESULTANTS]) -> ResultantNoise {
        let (accelerometers, cells) = self.halves();
        let half = |at: usize| core::array::from_fn(|j| powers[at + j]);
        ResultantNoise {
            acceleration: noise_of(accelerometers, &half(0)),
            force: noise_of(cells, &half(6)),
        }
    }
}

/// Covariance of the resultants of independent sensors that have these powers.
fn noise_of(columns: &[Column], powers: &[f64; 6]) -> Matrix6<f64> {
    // The powers are known to a tenth; a sensor's share settles within a few of these.
    const ITERATIONS: usize = 16;
    // Ratios, so that translations and rotations are alike.
    let share = |column: &Column, j: usize| {
        let gain = f64::from(column.gains[j]);
        if powers[j] > 0.0 {
            (gain * gain / powers[j]) as f32
        } else {
            0.0
        }
    };
    let mut total = 0.0_f32;
    for column in columns {
        for j in 0..6 {
            total += share(column, j);
        }
    }
    let mut covariance = Matrix6::zeros();
    if !(total > 0.0 && total.is_finite()) {
        return covariance;
    }
    let mut variances: heapless::Vec<f32, MAX_CHANNELS> =
        columns.iter().map(|_| 6.0 / total).collect();
    for _ in 0..ITERATIONS {
        let mut explained = [0.0_f32; 6];
        for (column, variance) in columns.iter().zip(&variances) {
            for (j, sum) in explained.iter_mut().enumerate() {
                *sum += share(column, j) * variance;
            }
        }
        for (column, variance) in columns.iter().zip(&mut variances) {
            let (mut wanted, mut given) = (0.0_f32, 0.0_f32);
            for (j, explained) in explained.iter().enumerate() {
                let share = share(column, j);
                if *explained > 0.0 {
                    wanted += share / explained;
                    given += share;
                }
            }
            if given > 0.0 {
                *variance *= wanted / given;
            }
        }
    }
    for (column, variance) in columns.iter().zip(&variances) {
        let gains = Vector6::from_fn(|j, _| f64::from(column.gains[j]));
        covariance.ger(f64::from(*variance), &gains, &gains, 1.0);
    }
    // The powers themselves were measured and are kept.
    let scale = Vector6::from_fn(|j, _| {
        let power = covariance[(j, j)];
        if power > 0.0 && powers[j] > 0.0 {
            libm::sqrt(powers[j] / power)
        } else {
            0.0
        }
    });
    Matrix6::from_fn(|i, j| covariance[(i, j)] * scale[i] * scale[j])
}

/// Sum of the contributions of these channels of a sample.
fn sum(columns: &[Column], sample: &[f32]) -> [f32; 6] {
    // Written out, since the chip's code is made small rather than fast, and this runs for every
    // reading: six sums stay in registers.
    let [mut a, mut b, mut c, mut d, mut e, mut f] = [0.0; 6];
    for column in columns {
        let Some(x) = sample.get(usize::from(column.channel)) else {
            break;
        };
        let [ga, gb, gc, gd, ge, gf] = column.gains;
        a += ga * x;
        b += gb * x;
        c += gc * x;
        d += gd * x;
        e += ge * x;
        f += gf * x;
    }
    [a, b, c, d, e, f]
}

impl Default for ResultantMap {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Mount, Quantity};

    fn sensor(position: [f64; 3], direction: [f64; 3]) -> Accelerometer {
        Accelerometer::new(position.into(), direction.into(), Mount::Interface).unwrap()
    }

    fn cell(position: [f64; 3], direction: [f64; 3]) -> LoadCell {
        LoadCell::new(position.into(), direction.into(), Quantity::Force).unwrap()
    }

    #[test]
    fn a_single_oblique_accelerometer_means_translation_along_its_axis() {
        let s = sensor([0.3, 0.2, 0.1], [1.0, 0.0, 1.0]);
        let fit = AccelerationFit::new([(&s, 1.0)], &Vector3::zeros()).unwrap();
        let a = fit.column(&s, 1.0);
        let h = core::f64::consts::FRAC_1_SQRT_2;
        let expected = Vector6::new(h, 0.0, h, 0.0, 0.0, 0.0);
        assert!((a - expected).norm() < 1e-15, "{a}");
        assert!((fit.determined(0) - 0.5).abs() < 1e-15);
        assert_eq!(fit.determined(4), 0.0);
    }

    #[test]
    fn a_plane_set_up_takes_the_rest_as_zero() {
        let s = [
            sensor([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
            sensor([-0.04, 0.0, 0.0], [0.0, 0.0, 1.0]),
            sensor([0.04, 0.0, 0.0], [0.0, 0.0, 1.0]),
        ];
        let all = s.iter().map(|s| (s, 1.0));
        let fit = AccelerationFit::new(all, &Vector3::zeros()).unwrap();
        let seen: [f64; 6] = core::array::from_fn(|j| fit.determined(j));
        for (j, expected) in [1.0, 0.0, 1.0, 0.0, 1.0, 0.0].into_iter().enumerate() {
            assert!((seen[j] - expected).abs() < 1e-15, "{j}: {seen:?}");
        }
        let beta = fit.column(&s[1], 1.0)[4] * 0.04 + fit.column(&s[2], 1.0)[4] * -0.04;
        assert!((beta - 1.0).abs() < 1e-14);
    }

    #[test]
    fn four_vertical_cells_measure_three_resultants() {
        let cells = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]]
            .map(|[x, y]| cell([x, y, 0.2], [0.0, 0.0, 1.0]));
        let f = ForceResultants::new(cells, &Vector3::zeros()).unwrap();
        assert_eq!(f.equations().count(), 3);
        // About the centre of the cells they are fz, tx, ty; 0.2 m lower tx and ty
        // would need the lateral forces, which nobody measures.
        let centre = f.equations().at(&Vector3::new(0.0, 0.0, 0.2));
        for (j, share) in [0.0, 0.0, 1.0, 1.0, 1.0, 0.0].into_iter().enumerate() {
            assert!((centre.measured(j) - share).abs() < 1e-14, "{j}");
        }
        assert!(f.equations().measured(3) < 1.0 - 1e-3);
    }

    #[test]
    fn two_triaxial_cells_miss_the_moment_about_their_line() {
        let mut cells = heapless::Vec::<_, 6>::new();
        for x in [-0.5, 0.5] {
            for d in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
                cells.push(cell([x, x, 0.0], d)).unwrap();
            }
        }
        let f = ForceResultants::new(&cells, &Vector3::zeros()).unwrap();
        assert_eq!(f.equations().count(), 5);
        assert!((f.equations().measured(3) - 0.5).abs() < 1e-14);
    }

    #[test]
    fn one_triaxial_cell_measures_no_moment_wherever_a_is() {
        let cells =
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|d| cell([0.0, 0.0, 0.0], d));
        let f = ForceResultants::new(cells, &Vector3::new(1.0, 2.0, 3.0)).unwrap();
        assert_eq!(f.equations().count(), 3);
    }

    #[test]
    fn weighted_least_squares_of_a_rigid_motion_returns_it() {
        let sensors = [
            sensor([0.5, 0.1, 0.0], [1.0, 0.2, 0.0]),
            sensor([-0.5, 0.3, 0.2], [0.0, 1.0, 0.0]),
            sensor([0.1, -0.5, 0.4], [0.0, 0.0, 1.0]),
            sensor([0.4, 0.5, -0.3], [0.3, 0.0, 1.0]),
            sensor([-0.2, -0.4, 0.6], [1.0, 1.0, 0.0]),
            sensor([0.3, 0.2, 0.7], [0.0, 1.0, 1.0]),
            sensor([-0.3, 0.6, -0.4], [1.0, 0.0, 1.0]),
        ];
        let weights = [1.0, 0.25, 0.5, 1.0, 0.7, 0.3, 0.9];
        let reference = Vector3::new(0.2, -0.1, 0.3);
        let a = Vector6::new(1.0, -2.0, 0.5, 3.0, -1.0, 2.0);
        let fit = AccelerationFit::new(sensors.iter().zip(weights), &reference).unwrap();
        let back: Vector6<f64> = sensors
            .iter()
            .zip(weights)
            .map(|(s, w)| fit.column(s, w) * (s.rigid_body_row(&reference) * a)[0])
            .sum();
        // A condition number of about 1e2 on sums of ten roundings.
        assert!((back - a).norm() < 1e-13, "{back}");
    }

    /// Two accelerometers that see x only, one of them ten times as strong, and a load cell along z.
    fn small_map() -> ResultantMap {
        let mut map = ResultantMap::new();
        let x = Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        map.push_acceleration(&x).unwrap();
        map.push_force(&Vector6::new(0.0, 0.0, 2.0, 4.0, 0.0, 0.0))
            .unwrap();
        map.push_acceleration(&(x * 3.0)).unwrap();
        map
    }

    #[test]
    fn rounding_is_four_epsilons_of_the_channels_that_a_resultant_needs() {
        let mut powers = [0.0; RESULTANTS];
        (powers[0], powers[8], powers[9]) = (5.0, 8.0, 80.0);
        let rounding = small_map().rounding_power(&powers);
        let unit = 16.0 * f64::from(f32::EPSILON) * f64::from(f32::EPSILON);
        let mut expected = [0.0; RESULTANTS];
        // Of accelerometers 5 over 1 + 9; of the load cell the larger one of 8/4 and 80/16.
        (expected[0], expected[8], expected[9]) = (10.0 * 0.5, 4.0 * 5.0, 16.0 * 5.0);
        for (found, expected) in rounding.iter().zip(expected) {
            assert!((found / unit - expected).abs() < 1e-12, "{rounding:?}");
        }
    }

    #[test]
    fn noise_has_the_powers_that_were_measured_and_none_where_there_is_none() {
        let mut powers = [0.0; RESULTANTS];
        (powers[0], powers[8]) = (5.0, 8.0);
        let noise = small_map().noise(&powers);
        let mut expected = ResultantNoise::NONE;
        expected.acceleration[(0, 0)] = 5.0;
        // The load cell's moment had no power, so that its noise has none.
        expected.force[(2, 2)] = 8.0;
        assert!(
            (noise.acceleration - expected.acceleration).norm() < 1e-6,
            "{noise:?}"
        );
        assert!((noise.force - expected.force).norm() < 1e-6, "{noise:?}");
    }
}
