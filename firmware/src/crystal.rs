//! Frequency of a board's crystal, from a measurement against the chip's internal oscillator.

/// Crystals that boards carry, Hz.
pub const KNOWN: [u32; 3] = [8_000_000, 12_000_000, 16_000_000];
/// Largest deviation of the measurement, as a share: the internal oscillator of the STM32F405 is
/// within 8 % of its frequency from -40 to 105 °C.
const DEVIATION: f64 = 0.1;

/// Nominal frequency of a crystal, Hz, of which `periods` took `ticks` of a clock of `tick_hz`;
/// `None` if it is none of those [`KNOWN`].
///
/// ```
/// use massline_firmware::crystal;
///
/// // 248 periods, counted by 16 MHz: a crystal of 12 MHz takes 331 ticks for them.
/// assert_eq!(crystal::nominal(331, 248, 16_000_000), Some(12_000_000));
/// ```
#[must_use]
pub fn nominal(ticks: u32, periods: u32, tick_hz: u32) -> Option<u32> {
    let found = f64::from(periods) * f64::from(tick_hz) / f64::from(ticks);
    let near = |hz: &u32| (found / f64::from(*hz) - 1.0).abs() <= DEVIATION;
    KNOWN.into_iter().find(near)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crystals_are_told_apart_at_every_deviation_of_the_oscillator() {
        let ticks = |hz: f64, deviation: f64| (248.0 / hz * 16e6 * (1.0 + deviation)) as u32;
        for percent in -8..=8 {
            let deviation = f64::from(percent) / 100.0;
            for known in KNOWN {
                let found = nominal(ticks(known.into(), deviation), 248, 16_000_000);
                assert_eq!(found, Some(known), "{percent} %");
            }
        }
        for other in [4e6, 6e6, 10e6, 24e6, 25e6, 50e6] {
            assert_eq!(nominal(ticks(other, 0.0), 248, 16_000_000), None, "{other}");
        }
        assert_eq!(nominal(0, 248, 16_000_000), None);
        assert_eq!(nominal(331, 0, 16_000_000), None);
    }
}
