//! The weighting strategy of chapter 7: accelerometers that see the first elastic modes
//! most count least.

use crate::spectra::DriveAverage;
use core::ops::Range;

/// Largest amplitude of response `c` per unit of the drive over the lines `lines` of an
/// average.
#[must_use]
pub fn peak_response(average: &DriveAverage<'_>, c: usize, lines: Range<usize>) -> f64 {
    let mut peak = 0.0_f64;
    for line in lines {
        let power = average.drive_power(line);
        if power > 0.0 {
            let (re, im) = average.cross(c, line);
            let (re, im) = (re / power, im / power);
            peak = peak.max(libm::sqrt(re * re + im * im));
        }
    }
    peak
}

/// Smallest weight where none is chosen: the paper's.
pub const MINIMUM_WEIGHT: f64 = 0.25;

/// Turns the largest amplitude of each accelerometer in the mode band into its weight,
/// in place: the largest amplitude gets `minimum`, the smallest gets one, linear between
/// them (figure 5). Amplitudes that are all alike, or not finite, give equal weights.
pub fn weights_from_peaks(peaks: &mut [f64], minimum: f64) {
    let largest = peaks.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let smallest = peaks.iter().copied().fold(f64::INFINITY, f64::min);
    let spread = largest - smallest;
    // Comparisons with what is no number would leave it out.
    let finite = peaks.iter().all(|peak| peak.is_finite());
    for peak in peaks {
        *peak = if finite && spread.is_normal() {
            1.0 - (1.0 - minimum) * (*peak - smallest) / spread
        } else {
            1.0
        };
    }
}

/// Joins the peaks of another run: each accelerometer keeps its largest share of any
/// run's largest amplitude, so that runs of different level and unit count alike.
pub fn join_peaks(joined: &mut [f64], run: &[f64]) {
    let largest = run.iter().copied().fold(0.0, f64::max);
    if largest > 0.0 {
        for (joined, peak) in joined.iter_mut().zip(run) {
            *joined = joined.max(peak / largest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figure_5_is_linear_from_one_to_the_minimum() {
        let mut w = [10.0, 40.0, 25.0];
        weights_from_peaks(&mut w, MINIMUM_WEIGHT);
        assert_eq!(w, [1.0, 0.25, 0.625]);
    }

    #[test]
    fn equal_peaks_weigh_equally() {
        let mut w = [3.0; 4];
        weights_from_peaks(&mut w, 0.25);
        assert_eq!(w, [1.0; 4]);
    }

    #[test]
    fn runs_of_different_level_join_by_shares() {
        let mut joined = [0.0; 3];
        join_peaks(&mut joined, &[1.0, 2.0, 4.0]);
        join_peaks(&mut joined, &[300.0, 100.0, 100.0]);
        assert_eq!(joined, [1.0, 0.5, 1.0]);
    }
}
