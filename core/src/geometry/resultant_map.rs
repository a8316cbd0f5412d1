//! The linear map from a sample of the channels to the twelve resultants, and the covariance that
//! noise of the channels gives those.

use super::{GeometryError, MAX_CHANNELS, ResultantNoise};
use nalgebra::{Matrix6, Vector6};

/// Numbers that a sample becomes: six accelerations of A, then six resultants at A.
pub const RESULTANTS: usize = 12;

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

    /// Two accelerometers that see x only, one of them ten times as strong, and a load cell along
    /// z.
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

    #[test]
    fn no_power_is_no_noise() {
        assert_eq!(small_map().noise(&[0.0; RESULTANTS]), ResultantNoise::NONE);
    }
}
