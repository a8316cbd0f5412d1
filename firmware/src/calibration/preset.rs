//! Values from the data sheet of a sensor: sensitivity, amplifier gain and limits.

use super::Limits;
use crate::wire::{Circuit, Date, Input};

/// Full scale of the ADS131M08 at gain 1, V: its reference is 1.2 V, and 2^23 counts stand for it.
pub const FULL_SCALE_VOLTS: f64 = 1.2;
/// Counts of full scale.
const FULL_SCALE: f64 = (1 << 23) as f64;
/// Share of full scale up to which a delta-sigma converter is linear enough.
const LINEAR: f64 = 0.98;
/// Sensitivity of the ADXL355 per count, in units of standard gravity: 3.9 µg in its 2 g range,
/// 256000 counts per g.
pub const ADXL355_COUNTS_PER_G: f64 = 256_000.0;
/// Highest supply of a bridge, V. From a gain of 8 on, both inputs must stay 1.8 V below the analog
/// supply (SBAS950, 6.3): 1.33 V where its 3.3 V are 5 % low. A bridge's outputs lie at half of its
/// supply, give or take half of its signal: 1.26 V at 2.5 V and 4 mV/V.
pub const BRIDGE_SUPPLY_MAX: f64 = 2.5;
/// Standard gravity, m/s².
const STANDARD_GRAVITY: f64 = 9.806_65;

/// A kind of sensor at an input that has not been calibrated.
///
/// The sensitivity is that of the data sheet, accurate to a few percent; a calibration replaces
/// [`Input::per_count`] and has its own uncertainty.
///
/// ```
/// use massline_firmware::calibration::Preset;
///
/// // A 500 N load cell of 2 mV/V, fed with 2.5 V: 10 µV/N.
/// let cell = Preset::bridge(500.0, 2e-3, 2.5)?;
/// // 5 mV at 500 N use half of the 9.375 mV that gain 128 leaves.
/// assert_eq!(cell.gain, 128);
/// let newton_per_count = 1.2 / 128.0 / 8388608.0 / 10e-6;
/// assert!((cell.per_count / newton_per_count - 1.0).abs() < 1e-12);
/// # Ok::<(), massline_firmware::calibration::SupplyTooHigh>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preset {
    /// Circuit of the sensor.
    pub circuit: Circuit,
    /// SI per count.
    pub per_count: f64,
    /// Gain of the converter's amplifier: the largest that takes the sensor's range.
    pub gain: u8,
    /// Counts at which a sample is an overload: the sensor's range, or 98 % of the converter's.
    pub limits: Limits,
}

impl Preset {
    /// A strain-gauge bridge: rated load in N or N m, output at rated load in V per V of supply,
    /// supply in V. Overload is at 120 % of the rated load, where load cells end.
    ///
    /// # Errors
    ///
    /// [`SupplyTooHigh`] beyond [`BRIDGE_SUPPLY_MAX`].
    pub fn bridge(rated_load: f64, rated_output: f64, supply: f64) -> Result<Self, SupplyTooHigh> {
        if supply.is_nan() || supply.abs() > BRIDGE_SUPPLY_MAX {
            return Err(SupplyTooHigh { found: supply });
        }
        let volts_per_unit = rated_output * supply / rated_load;
        Ok(Self::voltage(
            Circuit::Bridge,
            volts_per_unit,
            1.2 * rated_load,
        ))
    }

    /// A piezoelectric sensor with a charge amplifier: sensor in C per SI unit, amplifier in V
    /// per C, the share of the amplifier's output that a divider leads to the input, and the
    /// largest value to be measured, SI.
    #[must_use]
    pub fn charge(sensor: f64, amplifier: f64, divider: f64, range: f64) -> Self {
        Self::voltage(Circuit::Charge, sensor * amplifier * divider, range)
    }

    /// A sensor with its own amplifier, fed by a constant current: V per SI unit, the share of it
    /// that the coupling network leads to the input, and the largest value to be measured, SI.
    #[must_use]
    pub fn iepe(sensor: f64, divider: f64, range: f64) -> Self {
        Self::voltage(Circuit::Iepe, sensor * divider, range)
    }

    /// The ADXL355 in its 2 g range, m/s².
    #[must_use]
    pub fn adxl355() -> Self {
        // 20 bits: 2.048 g at the ends.
        let end = (1 << 19) as f64 * LINEAR;
        Self {
            circuit: Circuit::Digital,
            per_count: STANDARD_GRAVITY / ADXL355_COUNTS_PER_G,
            gain: 1,
            limits: within(end),
        }
    }

    /// Any voltage: V per SI unit, and the largest value to be measured, SI. Negative where the
    /// sensor is turned round.
    #[must_use]
    pub fn voltage(circuit: Circuit, volts_per_unit: f64, range: f64) -> Self {
        let peak = (volts_per_unit * range).abs();
        let room = |gain: u8| LINEAR * FULL_SCALE_VOLTS / f64::from(gain);
        let gain = (1..8)
            .map(|k| 1_u8 << k)
            .take_while(|&gain| peak <= room(gain))
            .last()
            .unwrap_or(1);
        let per_count = FULL_SCALE_VOLTS / f64::from(gain) / FULL_SCALE / volts_per_unit;
        Self {
            circuit,
            per_count,
            gain,
            limits: within((range / per_count).abs().min(LINEAR * FULL_SCALE)),
        }
    }

    /// The setting of the input of this number.
    #[must_use]
    pub const fn input<'a>(
        &self,
        number: u8,
        serial: &'a str,
        certificate: &'a str,
        calibrated: Option<Date>,
        uncertainty: f64,
    ) -> Input<'a> {
        Input {
            input: number,
            circuit: self.circuit,
            serial,
            certificate,
            calibrated,
            per_count: self.per_count,
            offset: 0.0,
            uncertainty,
            gain: self.gain,
            limits: [self.limits.low, self.limits.high],
        }
    }
}

/// A supply at which the outputs of a bridge lie above the converter's inputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupplyTooHigh {
    /// The supply, V.
    pub found: f64,
}

impl core::fmt::Display for SupplyTooHigh {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "a bridge on {} V has its outputs above the converter's inputs; feed it with {} V or less",
            self.found, BRIDGE_SUPPLY_MAX
        )
    }
}

impl core::error::Error for SupplyTooHigh {}

/// Limits at a distance from zero.
fn within(counts: f64) -> Limits {
    let end = libm::round(counts) as i32;
    Limits {
        low: -end,
        high: end,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Certificate;
    use crate::wire::Health;

    /// Volts at the input as the converter counts them.
    fn counts(volts: f64, preset: &Preset) -> i32 {
        (volts * f64::from(preset.gain) / FULL_SCALE_VOLTS * FULL_SCALE).round() as i32
    }

    /// Half a count of rounding, and what f32 leaves of 24 bits.
    fn agree(si: f32, expected: f64, preset: &Preset) {
        let bound = 0.5 * preset.per_count.abs() + 4.0 * 2_f64.powi(-24) * expected.abs();
        let si = f64::from(si);
        assert!((si - expected).abs() <= bound, "{si} {expected}");
    }

    #[test]
    fn what_the_sensor_feels_comes_out() {
        // 100 mV/g behind a divider by ten; 4 pC/N behind 1 mV/pC and a divider; 2 mV/V.
        let iepe = Preset::iepe(0.1 / STANDARD_GRAVITY, 0.1, 50.0 * STANDARD_GRAVITY);
        let charge = Preset::charge(4e-12, 1e9, 0.1, 2500.0);
        let bridge = Preset::bridge(500.0, -2e-3, 2.5).unwrap();
        let cases = [
            (
                iepe,
                30.0 * STANDARD_GRAVITY,
                30.0 * 0.1 * 0.1,
                Circuit::Iepe,
            ),
            (charge, -1200.0, -1200.0 * 4e-3 * 0.1, Circuit::Charge),
            (bridge, 400.0, -400.0 / 500.0 * 2e-3 * 2.5, Circuit::Bridge),
        ];
        for (preset, si, volts, circuit) in cases {
            assert_eq!(preset.circuit, circuit);
            let input = preset.input(0, "", "", None, 0.05);
            let mut channel = Certificate::new(&input).unwrap().channel(512.0);
            let (found, health) = channel.count(counts(volts, &preset), Health::GOOD);
            agree(found, si, &preset);
            assert_eq!(health, Health::GOOD);
        }
    }

    #[test]
    fn a_bridge_whose_outputs_lie_above_the_inputs_is_refused() {
        for supply in [2.5, -2.5, 1.2] {
            assert!(Preset::bridge(500.0, 2e-3, supply).is_ok(), "{supply} V");
        }
        for supply in [2.6, 3.3, 5.0, -3.3, f64::INFINITY, f64::NAN] {
            let refused = Preset::bridge(500.0, 2e-3, supply);
            assert!(refused.is_err(), "{supply} V");
        }
    }

    #[test]
    fn the_gain_is_the_largest_that_takes_the_range() {
        for (volts, gain) in [
            (2.0, 1),
            (1.17, 1),
            (0.58, 2),
            (0.1, 8),
            (0.009, 128),
            (1e-4, 128),
        ] {
            let preset = Preset::voltage(Circuit::Voltage, 1.0, volts);
            assert_eq!(preset.gain, gain, "{volts} V");
            let end = volts.min(LINEAR * FULL_SCALE_VOLTS / f64::from(gain));
            assert_eq!(preset.limits.high, counts(end, &preset));
        }
    }

    #[test]
    fn one_g_of_a_digital_sensor() {
        let preset = Preset::adxl355();
        let input = preset.input(0, "", "", None, 0.05);
        let mut channel = Certificate::new(&input).unwrap().channel(500.0);
        agree(
            channel.count(256_000, Health::GOOD).0,
            STANDARD_GRAVITY,
            &preset,
        );
        assert_eq!(
            channel.count((1 << 19) - 1, Health::GOOD).1,
            Health::OVERLOAD
        );
    }
}
