//! Calibrations from numbers of any size are refused, or give finite readings.

use massline_firmware::calibration::{Certificate, Preset, Scale};
use massline_firmware::wire::{Circuit, Health};
use proptest::prelude::*;

#[path = "../../core/tests/numbers/mod.rs"]
mod numbers;
use numbers::number;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn calibrations(
        a in number(),
        b in number(),
        c in number(),
        d in number(),
        count: i32,
        reading: f32,
    ) {
        if let Ok(scale) = Scale::new(a, b) {
            prop_assert!(scale.count(count).is_finite());
            if reading.abs() < 1e9 {
                prop_assert!(scale.reading(reading).is_finite());
            }
        }
        for preset in [
            Preset::bridge(a, b, c).unwrap_or(Preset::adxl355()),
            Preset::charge(a, b, c, d),
            Preset::iepe(a, b, c),
            Preset::voltage(Circuit::Voltage, a, b),
        ] {
            let Ok(certificate) = Certificate::new(&preset.input(0, "", "", None, d)) else {
                continue;
            };
            let mut channel = certificate.channel(512.0);
            prop_assert!(channel.count(count, Health::GOOD).0.is_finite());
        }
    }
}
