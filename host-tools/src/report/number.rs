//! Numbers as text: proper minus signs, thin spaces, digits that mean something.

/// The minus sign; a hyphen is too short and breaks lines.
pub const MINUS: char = '\u{2212}';
/// Between digits, and between a number and its unit: narrow, and no line breaks there.
pub const THIN: char = '\u{202f}';
/// Text in place of a number that is not finite.
pub const NO_NUMBER: &str = "–";

/// Outside these powers of ten a number is written with an exponent.
const PLAIN: core::ops::RangeInclusive<i32> = -6..=6;
/// Most decimals; a smaller number has an exponent.
const MOST_DECIMALS: i32 = 9;

/// `value` with a number of decimals.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return NO_NUMBER.to_owned();
    }
    typeset(&format!("{value:.decimals$}"))
}

/// `value` rounded to a number of significant digits.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return NO_NUMBER.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = digits.max(1) as i32;
    let exponent = exponent_after_rounding(value, digits);
    if PLAIN.contains(&exponent) {
        rounded(value, digits - 1 - exponent)
    } else {
        let mantissa = value / power_of_ten(exponent);
        format!("{}{}", rounded(mantissa, digits - 1), times_ten(exponent))
    }
}

/// `value` as it was written: no more digits than it takes to read it back.
#[must_use]
pub fn exact(value: f64) -> String {
    if !value.is_finite() {
        return NO_NUMBER.to_owned();
    }
    let size = value.abs();
    if size != 0.0 && !(1e-6..1e7).contains(&size) {
        return significant(value, 6);
    }
    // Twelve digits hide what a change of unit does to the sixteenth.
    let text = format!("{value:.12}");
    typeset(text.trim_end_matches('0').trim_end_matches('.'))
}

/// `value ± std`, both rounded to two significant digits of the standard deviation.
///
/// A standard deviation of zero means that the value is exact.
#[must_use]
pub fn uncertain(value: f64, std: f64) -> String {
    if !value.is_finite() {
        return NO_NUMBER.to_owned();
    }
    if std == 0.0 {
        return exact(value);
    }
    if std == f64::INFINITY {
        return format!("{}{THIN}±{THIN}∞", significant(value, 2));
    }
    if !(std.is_finite() && std > 0.0) {
        return significant(value, 6);
    }
    let of_std = exponent_after_rounding(std, 2);
    let decimals = 1 - of_std;
    let of_value = if value == 0.0 {
        of_std
    } else {
        exponent_after_rounding(value, 1)
    };
    let largest = of_value.max(of_std);
    let pair = |factor: f64, decimals: i32| {
        let value = rounded(value / factor, decimals);
        format!("{value}{THIN}±{THIN}{}", rounded(std / factor, decimals))
    };
    if decimals <= MOST_DECIMALS && largest <= *PLAIN.end() {
        pair(1.0, decimals)
    } else {
        let factor = power_of_ten(largest);
        format!(
            "({}){}",
            pair(factor, decimals + largest),
            times_ten(largest)
        )
    }
}

/// The number of decimals that show a standard deviation with two digits; none for
/// one above ten.
#[must_use]
pub fn decimals_of(std: f64) -> usize {
    if std.is_finite() && std > 0.0 {
        (1 - exponent_after_rounding(std, 2)).clamp(0, 15) as usize
    } else {
        3
    }
}

/// A number and its unit, which stay on one line.
#[must_use]
pub fn with_unit(number: &str, unit: &str) -> String {
    if unit.is_empty() {
        number.to_owned()
    } else {
        format!("{number}{THIN}{unit}")
    }
}

/// `10ⁿ` with the exponent in superscript digits.
#[must_use]
pub fn ten_to(exponent: i32) -> String {
    let mut text = String::from("10");
    for c in exponent.to_string().chars() {
        text.push(match c {
            '0' => '⁰',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            '4' => '⁴',
            '5' => '⁵',
            '6' => '⁶',
            '7' => '⁷',
            '8' => '⁸',
            '9' => '⁹',
            _ => '⁻',
        });
    }
    text
}

/// Ten to an integer power, the nearest `f64`.
#[must_use]
pub fn power_of_ten(exponent: i32) -> f64 {
    // Decimal notation is rounded correctly, unlike powi.
    format!("1e{exponent}").parse().unwrap_or(f64::NAN)
}

/// Spelled up to ten, as prose has it.
#[must_use]
pub fn in_words(count: usize) -> String {
    const WORDS: [&str; 11] = [
        "none", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten",
    ];
    WORDS
        .get(count)
        .map_or_else(|| count.to_string(), |w| (*w).to_owned())
}

fn times_ten(exponent: i32) -> String {
    format!("{THIN}·{THIN}{}", ten_to(exponent))
}

/// The power of ten of the first digit once `value` is rounded to `digits` digits.
fn exponent_after_rounding(value: f64, digits: i32) -> i32 {
    let precision = (digits - 1).max(0) as usize;
    let text = format!("{value:.precision$e}");
    text.split_once('e')
        .and_then(|(_, e)| e.parse().ok())
        .unwrap_or(0)
}

/// Like [`fixed`], where fewer than no decimals round to tens, hundreds and so on.
fn rounded(value: f64, decimals: i32) -> String {
    if decimals >= 0 {
        fixed(value, decimals.min(15) as usize)
    } else {
        let unit = power_of_ten(-decimals);
        fixed((value / unit).round() * unit, 0)
    }
}

fn typeset(plain: &str) -> String {
    let (sign, digits) = match plain.strip_prefix('-') {
        // Rounding leaves a sign on zero that says nothing.
        Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => ("", rest),
        Some(rest) => ("\u{2212}", rest),
        None => ("", plain),
    };
    let (whole, rest) = digits.split_once('.').unwrap_or((digits, ""));
    let mut out = String::from(sign);
    // Four digits are read at a glance; more are grouped.
    let grouped = whole.len() > 4;
    for (i, c) in whole.chars().enumerate() {
        if grouped && i > 0 && (whole.len() - i) % 3 == 0 {
            out.push(THIN);
        }
        out.push(c);
    }
    if !rest.is_empty() {
        out.push('.');
        out.push_str(rest);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(text: &str) -> String {
        text.replace(THIN, " ").replace(MINUS, "-")
    }

    #[test]
    fn error_bars_have_two_digits_and_the_value_as_many_decimals() {
        let shown = |v, s| plain(&uncertain(v, s));
        assert_eq!(shown(101.118_46, 0.114_82), "101.12 ± 0.11");
        assert_eq!(shown(0.930_1, 0.099_6), "0.93 ± 0.10");
        assert_eq!(shown(-0.036_5, 0.107_37), "-0.04 ± 0.11");
        assert_eq!(shown(-0.001, 0.2), "0.00 ± 0.20");
        assert_eq!(
            shown(812_345.0, 1234.0),
            "812 300 ± 1 200".replace("1 200", "1200")
        );
        assert_eq!(shown(20.0, 99.7), "20 ± 100");
        assert_eq!(shown(1.0, 1.0), "1.0 ± 1.0");
        assert_eq!(shown(9.99, 0.5), "9.99 ± 0.50");
    }

    #[test]
    fn extremes_get_an_exponent() {
        assert_eq!(
            plain(&uncertain(1.234_567_8e-9, 1.2e-13)),
            "(1.23457 ± 0.00012) · 10⁻⁹"
        );
        assert_eq!(plain(&uncertain(3.456e9, 1.2e7)), "(3.456 ± 0.012) · 10⁹");
        assert_eq!(plain(&significant(-1.5e-9, 2)), "-1.5 · 10⁻⁹");
        assert_eq!(plain(&significant(6.02e23, 3)), "6.02 · 10²³");
    }

    #[test]
    fn what_is_no_number_is_never_printed_as_one() {
        for text in [
            uncertain(f64::NAN, 1.0),
            fixed(f64::INFINITY, 2),
            significant(f64::NAN, 3),
            exact(f64::NEG_INFINITY),
        ] {
            assert_eq!(text, NO_NUMBER);
        }
        assert_eq!(plain(&uncertain(1.5, f64::NAN)), "1.50000");
        assert_eq!(plain(&uncertain(1.5, -1.0)), "1.50000");
        assert_eq!(plain(&uncertain(1.5, f64::INFINITY)), "1.5 ± ∞");
    }

    #[test]
    fn exact_values_are_as_written() {
        assert_eq!(exact(0.63076), "0.63076");
        assert_eq!(exact(800.0), "800");
        assert_eq!(exact(0.1 + 0.2), "0.3");
        assert_eq!(plain(&uncertain(-12.5, 0.0)), "-12.5");
    }

    #[test]
    fn digits_are_grouped_and_zero_has_no_sign() {
        assert_eq!(plain(&fixed(1_234_567.8, 1)), "1 234 567.8");
        assert_eq!(plain(&fixed(1234.0, 0)), "1234");
        assert_eq!(fixed(-0.0004, 2), "0.00");
        assert_eq!(significant(0.099_96, 3), "0.100");
    }
}
