//! The numbers of Schedlinski and Link's tables 1 to 4, as they were printed.

use super::rows::{Range, Row};
use massline_core::masslines::Method;

/// Table 1: natural frequencies of the fixed system, Hz.
pub const FIXED: [f64; 5] = [32.52, 41.08, 114.27, 126.05, 215.22];
/// Table 2, elastic modes 4 to 7: natural frequencies of the free system, Hz.
pub const FREE: [f64; 4] = [43.17, 97.45, 148.93, 173.17];
/// The true body of table 3: mm, mm, g m², %.
pub const IDEAL: Printed = Printed::new([101.13, 107.33, 20.78, 100.0], [0.0; 3]);
/// The true Θ about S of table 4, g m².
pub const IDEAL_THETA_S: f64 = 7.06;

/// Footnote to one row.
pub const FOOTNOTE: &str = "the paper's row a II with W contradicts itself: 113.64 mm for z is \
    an error of 5.88 %, the printed 24.50 % would be 133.63 mm";

/// `true` for the row of the footnote.
#[must_use]
pub fn contradicts_itself(row: &Row) -> bool {
    row.method == Method::FrequencyResponses && row.range == Range::II && row.weighted
}

/// One row as it was printed: values, and errors in per cent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Printed {
    /// x (ξ_S) and z (ζ_S) in mm, Θ about A (table 3) or S (table 4) in g m², and Δ in %
    /// (table 3; not a number in table 4).
    pub values: [f64; 4],
    /// Errors of x, z and Θ, per cent.
    pub errors: [f64; 3],
}

impl Printed {
    const fn new(values: [f64; 4], errors: [f64; 3]) -> Self {
        Self { values, errors }
    }
}

/// Table 3.
#[must_use]
pub fn table_3(row: &Row) -> Option<Printed> {
    use Method::{
        CurveFit, FreeResponses, FrequencyResponses, PowerSpectra, PowerSpectraCholesky, Synthesis,
    };
    use Range::{Fit, I, II};
    let (values, errors) = match (row.method, row.range, row.weighted) {
        (FrequencyResponses, I, false) => ([100.93, 108.77, 21.54, 99.68], [-0.19, 1.34, 3.68]),
        (FrequencyResponses, I, true) => ([101.54, 112.08, 21.87, 100.66], [0.41, 4.42, 5.26]),
        (FrequencyResponses, II, false) => ([100.07, 114.63, 26.18, 98.21], [-1.04, 6.80, 26.00]),
        (FrequencyResponses, II, true) => ([103.24, 113.64, 26.81, 103.51], [2.09, 24.50, 29.05]),
        (PowerSpectra, I, false) => ([101.04, 86.41, 132.10, 99.82], [-0.09, -19.49, 535.8]),
        (PowerSpectra, I, true) => ([101.06, 108.17, 42.82, 100.04], [-0.06, 0.77, 106.1]),
        (PowerSpectra, II, false) => ([100.80, 17.68, 275.92, 99.63], [-0.32, -83.53, 1228.0]),
        (PowerSpectra, II, true) => ([100.54, 101.34, 126.35, 100.26], [-0.58, -5.58, 508.1]),
        (PowerSpectraCholesky, I, false) => ([100.93, 108.37, 22.03, 99.68], [-0.19, 0.97, 6.03]),
        (PowerSpectraCholesky, I, true) => ([101.15, 107.44, 21.88, 100.09], [0.02, 0.10, 5.29]),
        (PowerSpectraCholesky, II, false) => ([100.21, 112.01, 33.12, 98.18], [-0.91, 4.36, 59.39]),
        (PowerSpectraCholesky, II, true) => ([101.14, 109.29, 32.42, 100.37], [0.01, 1.82, 56.05]),
        (FreeResponses, I, false) => ([100.66, 105.53, 21.30, 99.54], [-0.46, -1.68, 2.52]),
        (FreeResponses, I, true) => ([100.59, 105.97, 21.23, 99.50], [-0.53, -1.27, 2.18]),
        (FreeResponses, II, false) => ([97.84, 94.27, 24.81, 96.75], [-3.25, -12.17, 19.40]),
        (FreeResponses, II, true) => ([98.15, 98.91, 23.98, 97.22], [-2.95, -7.85, 15.41]),
        (CurveFit, Fit, false) => ([101.38, 108.83, 19.98, 100.25], [0.25, 1.40, -3.86]),
        (CurveFit, Fit, true) => ([101.76, 108.71, 20.09, 100.58], [0.63, 1.28, -3.31]),
        (Synthesis, I, false) => ([101.00, 106.92, 20.82, 99.88], [-0.12, -0.38, 0.22]),
        (Synthesis, I, true) => ([101.03, 107.02, 20.82, 99.90], [-0.10, -0.30, 0.20]),
        (Synthesis, II, false) => ([100.54, 105.42, 20.99, 99.42], [-0.58, -1.78, 1.02]),
        (Synthesis, II, true) => ([100.67, 105.87, 20.97, 99.56], [-0.46, -1.36, 0.94]),
        _ => return None,
    };
    Some(Printed::new(values, errors))
}

/// Table 4: direct, then iterative.
#[must_use]
pub fn table_4(row: &Row) -> Option<[Printed; 2]> {
    if row.range == Range::II || !row.weighted {
        return None;
    }
    let printed = |x, z, theta, errors| Printed::new([x, z, theta, f64::NAN], errors);
    let pair = match row.method {
        Method::FrequencyResponses => [
            printed(101.54, 112.08, 7.44, [0.41, 4.42, 5.41]),
            printed(101.12, 111.06, 7.66, [0.00, 3.47, 8.52]),
        ],
        Method::PowerSpectraCholesky => [
            printed(101.15, 107.44, 8.14, [0.02, 0.10, 15.31]),
            printed(101.15, 107.44, 8.54, [0.02, 0.10, 20.88]),
        ],
        Method::FreeResponses => [
            printed(100.59, 105.97, 7.77, [-0.53, -1.27, 9.98]),
            printed(101.10, 106.51, 7.70, [-0.03, -0.77, 9.01]),
        ],
        Method::CurveFit => [
            printed(101.76, 108.71, 6.10, [0.63, 1.28, -13.55]),
            printed(101.18, 108.08, 6.18, [0.05, 0.70, -12.41]),
        ],
        Method::Synthesis => [
            printed(101.03, 107.02, 7.16, [-0.10, -0.30, 1.39]),
            printed(101.12, 107.12, 7.15, [0.00, -0.20, 1.20]),
        ],
        _ => return None,
    };
    Some(pair)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The printed errors follow from the printed values but for the row of the footnote,
    /// which guards against a slip of ours in copying them.
    #[test]
    fn printed_errors_follow_from_printed_values() {
        let consistent = |value: f64, ideal: f64, error: f64, digits: f64| {
            // The ideal and the value are rounded to half a unit of their last digit, the
            // error to half of 0.01 (0.1 or 1 where it is large).
            let slack = 100.0 * digits / ideal * (1.0 + value / ideal) + 0.005;
            let coarse = if error.abs() >= 1000.0 { 0.5 } else { 0.05 };
            let slack = if error.abs() >= 100.0 {
                slack + coarse
            } else {
                slack
            };
            (100.0 * (value / ideal - 1.0) - error).abs() <= slack * 1.001
        };
        let mut wrong = Vec::new();
        for row in Row::of_the_paper() {
            let printed = table_3(&row).unwrap();
            for i in 0..3 {
                let (value, ideal) = (printed.values[i], IDEAL.values[i]);
                if !consistent(value, ideal, printed.errors[i], 0.005) {
                    wrong.push((row.name(), i));
                }
            }
            for printed in table_4(&row).into_iter().flatten() {
                let ideals = [IDEAL.values[0], IDEAL.values[1], IDEAL_THETA_S];
                for (i, ideal) in ideals.into_iter().enumerate() {
                    if !consistent(printed.values[i], ideal, printed.errors[i], 0.005) {
                        wrong.push((row.name(), 4 + i));
                    }
                }
            }
        }
        assert_eq!(wrong, [("a II with W".to_owned(), 1)]);
    }
}
