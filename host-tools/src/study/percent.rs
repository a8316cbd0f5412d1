//! Errors in per cent as text: as many digits as say something.

/// Below this digits give way to an exponent, so that a column of nine characters holds it.
const TINY: f64 = 1e-4;

/// Two decimals, more where it takes them to show two digits, `-` where there is none.
#[must_use]
pub fn text(error: f64) -> String {
    let size = error.abs();
    if !error.is_finite() {
        "-".to_owned()
    } else if error == 0.0 {
        "0".to_owned()
    } else if size < TINY {
        format!("{error:.1e}")
    } else if size >= 100.0 {
        format!("{error:.1}")
    } else if size >= 0.1 {
        format!("{error:.2}")
    } else {
        // The position of the first digit, and one more.
        let decimals = (1.0 - size.log10().floor()) as usize;
        format!("{error:.decimals$}")
    }
}

/// The same with a unit.
#[must_use]
pub fn with_unit(error: f64) -> String {
    format!("{} %", text(error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_follow_the_size() {
        let shown = [535.84, 19.574, -0.5622, 0.0573, -0.00176, 4.2e-5, 3e-7].map(text);
        assert_eq!(
            shown,
            [
                "535.8", "19.57", "-0.56", "0.057", "-0.0018", "4.2e-5", "3.0e-7"
            ]
        );
        assert_eq!(text(f64::NAN), "-");
        assert_eq!(text(0.0), "0");
    }
}
