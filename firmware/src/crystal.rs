//! Frequency of a board's crystal, from a measurement against the chip's internal oscillator.

/// Crystals that boards carry, Hz.
pub const KNOWN: [u32; 3] = [8_000_000, 12_000_000, 16_000_000];
/// Largest deviation of the measurement, as a share: the internal oscillator of the STM32F405 is
/// within 8 % of its frequency from -40 to 105 °C.
const DEVIATION: f64 = 0.1;

/// Frequency of a crystal, Hz, of which `periods` took `ticks` of a clock of `tick_hz`; `None` without
/// ticks, or beyond 4 GHz.
///
/// ```
/// use massline_firmware::crystal;
///
/// // 248 periods, counted by 16 MHz: a crystal of 12 MHz takes 331 ticks for them.
/// let found = crystal::measured(331, 248, 16_000_000);
/// assert_eq!(found, Some(11_987_915));
/// assert_eq!(found.and_then(crystal::nominal), Some(12_000_000));
/// ```
#[must_use]
pub fn measured(ticks: u32, periods: u32, tick_hz: u32) -> Option<u32> {
    let all = u64::from(periods) * u64::from(tick_hz);
    let hz = all.checked_div(ticks.into())?;
    u32::try_from(hz).ok()
}

/// Nominal frequency, Hz, of a crystal of a measured one; `None` if it is none of those [`KNOWN`].
#[must_use]
pub fn nominal(measured: u32) -> Option<u32> {
    let found = f64::from(measured);
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
                let found = measured(ticks(known.into(), deviation), 248, 16_000_000);
                assert_eq!(found.and_then(nominal), Some(known), "{percent} %");
            }
        }
        for other in [4e6, 6e6, 10e6, 24e6, 25e6, 50e6] {
            let found = measured(ticks(other, 0.0), 248, 16_000_000);
            assert_eq!(found.and_then(nominal), None, "{other}");
        }
        assert_eq!(measured(0, 248, 16_000_000), None);
        assert_eq!(measured(1, u32::MAX, 16_000_000), None);
        assert_eq!(nominal(0), None);
    }
}
