//! Numbers as an engineer would write them: as many digits as the error bar supports.

/// `value` and `std` rounded to two significant digits of `std`, without units.
///
/// Without an error bar (zero or no number) six significant digits are given; an infinite one
/// is shown as such.
#[must_use]
pub fn with_std(value: f64, std: f64) -> (String, String) {
    if !value.is_finite() {
        return ("-".to_owned(), "-".to_owned());
    }
    if std == f64::INFINITY {
        return (significant(value, 2), "∞".to_owned());
    }
    if !(std.is_finite() && std > 0.0) {
        return (significant(value, 6), "0".to_owned());
    }
    let decimals = decimals_of(std, 2);
    (fixed(value, decimals), fixed(std, decimals))
}

/// `value` with so many significant digits, without an exponent where that is readable.
#[must_use]
pub fn significant(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    fixed(value, decimals_of(value, digits))
}

/// The same without zeros at the end of decimals, for numbers without an error.
#[must_use]
pub fn plain(value: f64, digits: i32) -> String {
    let text = significant(value, digits);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// Decimals that show so many significant digits of a number.
fn decimals_of(number: f64, digits: i32) -> i32 {
    let magnitude = number.abs().log10().floor() as i32;
    let decimals = digits - 1 - magnitude;
    // 0.0996 rounds up to 0.10: one digit less is meant.
    let rounded = format!("{:.*}", decimals.max(0) as usize, number.abs());
    let carried = rounded
        .parse::<f64>()
        .is_ok_and(|r| r > 0.0 && r.log10().floor() as i32 > magnitude);
    if carried { decimals - 1 } else { decimals }
}

fn fixed(value: f64, decimals: i32) -> String {
    if (0..=9).contains(&decimals) {
        let text = format!("{value:.*}", decimals as usize);
        // No negative zero.
        match text.strip_prefix('-') {
            Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
            _ => text,
        }
    } else if decimals < 0 {
        let unit = 10_f64.powi(-decimals);
        format!("{:.0}", (value / unit).round() * unit)
    } else if value == 0.0 {
        "0".to_owned()
    } else {
        format!("{value:.1e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_numbers_end_where_they_end() {
        assert_eq!(plain(512.0, 6), "512");
        assert_eq!(plain(0.5, 4), "0.5");
        assert_eq!(plain(1200.0, 2), "1200");
        assert_eq!(plain(0.0, 3), "0");
    }

    #[test]
    fn digits_follow_the_error_bar() {
        let pair = |v, s| {
            let (v, s) = with_std(v, s);
            format!("{v} {s}")
        };
        assert_eq!(pair(101.118_46, 0.114_82), "101.12 0.11");
        assert_eq!(pair(0.020_774_7, 0.000_021_18), "0.020775 0.000021");
        assert_eq!(pair(12345.6, 99.6), "12350 100");
        assert_eq!(pair(1.234, 0.0996), "1.23 0.10");
        assert_eq!(pair(-0.000_01, 0.1), "0.00 0.10");
        assert_eq!(pair(0.63076, 0.0), "0.630760 0");
        assert_eq!(pair(0.63076, f64::INFINITY), "0.63 ∞");
    }
}
