//! From a band in Hz to the lines in it: one rule for all kinds of lines.
//!
//! A line belongs to a band if it lies between the band's ends, both included; a thousandth
//! of the distance to the next line forgives the rounding of an end that is meant to be a
//! line. A band whose ends leave out nothing but what lies between two lines is good; one
//! that asks for lines that there are not is an error, since a result from fewer lines than
//! were asked for looks like any other.

use core::ops::Range;

/// Share of the distance of two lines by which an end of a band may miss a line.
const FORGIVEN: f64 = 1e-3;
/// Share of a frequency that rounding may take from it, where there is no second line.
const ROUNDING: f64 = 1e-9;

/// Lines in a row, as indices from zero, none of which lies beyond the lines they were chosen
/// from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LineRange {
    // 32 bits each: some of them are kept on a chip.
    start: u32,
    end: u32,
    count: u32,
}

/// Why a band is no range of lines.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum BandError {
    /// The ends (Hz) are not finite, negative, or the upper one lies below the lower one.
    Ends([f64; 2]),
    /// The band reaches beyond the lines.
    Beyond {
        /// The band, Hz.
        band: [f64; 2],
        /// First and last line, Hz; `None` if there is no line.
        lines: Option<[f64; 2]>,
    },
    /// Indices that do not ascend, or lie beyond the last line.
    Indices {
        /// First line.
        start: usize,
        /// One beyond the last line.
        end: usize,
        /// Number of lines there are.
        count: usize,
    },
}

impl core::fmt::Display for BandError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Ends([low, high]) => write!(
                f,
                "the band from {low} to {high} Hz is none; expected two frequencies, the lower one first and not negative"
            ),
            Self::Beyond {
                band: [low, high],
                lines: Some([first, last]),
            } => write!(
                f,
                "the band from {low} to {high} Hz reaches beyond the lines, which lie from {first} to {last} Hz"
            ),
            Self::Beyond {
                band: [low, high],
                lines: None,
            } => write!(f, "there is no line for the band from {low} to {high} Hz"),
            Self::Indices { start, end, count } => write!(
                f,
                "lines {start} to {end} (not included) asked for, but there are {count}"
            ),
        }
    }
}

impl core::error::Error for BandError {}

impl LineRange {
    /// All of `count` lines, of which there are never as many as 2³².
    #[must_use]
    pub const fn all(count: usize) -> Self {
        let count = if count > u32::MAX as usize {
            u32::MAX
        } else {
            count as u32
        };
        Self {
            start: 0,
            end: count,
            count,
        }
    }

    /// The lines `range` out of `count`.
    ///
    /// # Errors
    /// [`BandError::Indices`] if it does not lie within them.
    pub(crate) const fn new(range: Range<usize>, count: usize) -> Result<Self, BandError> {
        let Range { start, end } = range;
        if start > end || end > count || count > u32::MAX as usize {
            return Err(BandError::Indices { start, end, count });
        }
        Ok(Self {
            start: start as u32,
            end: end as u32,
            count: count as u32,
        })
    }

    /// The lines from `low` to `high` Hz, both ends included, out of `count` that lie at
    /// `frequency(line)` Hz, ascending. `frequency(count)`, one step beyond the last line, tells
    /// the distance of lines there. The range is empty where the band lies between two lines.
    ///
    /// # Errors
    /// [`BandError::Ends`], or [`BandError::Beyond`] if the band would hold the next line
    /// before the first one (and above 0 Hz) or after the last one, if there were any.
    pub(crate) fn between(
        count: usize,
        frequency: impl Fn(usize) -> f64,
        [low, high]: [f64; 2],
    ) -> Result<Self, BandError> {
        if !(low >= 0.0 && low <= high && high.is_finite()) {
            return Err(BandError::Ends([low, high]));
        }
        let band = [low, high];
        let Some(last) = count.checked_sub(1) else {
            return Err(BandError::Beyond { band, lines: None });
        };
        let gap = |line: usize| frequency(line + 1) - frequency(line);
        let slack = |line: usize| (FORGIVEN * gap(line)).max(ROUNDING * frequency(line));
        let before = frequency(0) - gap(0);
        // At 0 Hz there is no motion: that line is nobody's loss.
        let below = before > 0.5 * gap(0) && before + slack(0) >= low;
        let above = frequency(count) - slack(last) <= high;
        // A single line by itself tells no distance: it lies in the band or the band is beyond.
        let alone = gap(last) <= 0.0;
        let (below, above) = if alone {
            let inside = frequency(0) + slack(0) >= low && frequency(0) - slack(0) <= high;
            (!inside, false)
        } else {
            (below, above)
        };
        if below || above {
            return Err(BandError::Beyond {
                band,
                lines: Some([frequency(0), frequency(last)]),
            });
        }
        let start = first_line(count, |line| frequency(line) + slack(line) >= low);
        let end = first_line(count, |line| frequency(line) - slack(line) > high);
        Self::new(start.min(end)..end, count)
    }

    /// The lines from `low` to `high` Hz, both ends included, out of those at `frequencies`, Hz,
    /// ascending. The range is empty where the band lies between two lines.
    ///
    /// # Errors
    /// [`BandError::Ends`], or [`BandError::Beyond`] if the band would hold the next line
    /// before the first one (and above 0 Hz) or after the last one, if there were any.
    pub fn among(frequencies: &[f64], band: [f64; 2]) -> Result<Self, BandError> {
        Self::between(frequencies.len(), |line| listed(frequencies, line), band)
    }

    /// First line.
    #[must_use]
    pub(crate) const fn start(&self) -> usize {
        self.start as usize
    }

    /// One beyond the last line.
    #[must_use]
    pub(crate) const fn end(&self) -> usize {
        self.end as usize
    }

    /// Number of lines.
    #[must_use]
    pub(crate) const fn len(&self) -> usize {
        (self.end - self.start) as usize
    }

    /// Number of lines that they were chosen from.
    #[must_use]
    pub(crate) const fn count(&self) -> usize {
        self.count as usize
    }

    /// The indices.
    #[must_use]
    pub const fn indices(&self) -> Range<usize> {
        self.start()..self.end()
    }
}

impl IntoIterator for LineRange {
    type Item = usize;
    type IntoIter = Range<usize>;

    fn into_iter(self) -> Range<usize> {
        self.indices()
    }
}

/// Frequency of a listed line, Hz; one step beyond the last, as far as the step before.
pub(crate) fn listed(frequencies: &[f64], line: usize) -> f64 {
    match (frequencies.get(line), frequencies) {
        (Some(f), _) => *f,
        (None, [.., before, last]) => {
            let steps = line.saturating_sub(frequencies.len()) as f64 + 1.0;
            last + (last - before) * steps
        }
        (None, [only]) => *only,
        (None, []) => 0.0,
    }
}

/// First of `count` lines for which `holds`, as it does for all after it; `count` if none.
fn first_line(count: usize, holds: impl Fn(usize) -> bool) -> usize {
    let (mut from, mut to) = (0, count);
    while from < to {
        let middle = from + (to - from) / 2;
        if holds(middle) {
            to = middle;
        } else {
            from = middle + 1;
        }
    }
    from
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    fn halves(line: usize) -> f64 {
        0.5 * (line as f64 + 1.0)
    }

    #[test]
    fn a_band_includes_both_of_its_ends() {
        let band = LineRange::between(60, halves, [0.5, 14.5]).unwrap();
        assert_eq!(band.indices(), 0..29);
        assert_eq!((halves(band.end() - 1), band.count()), (14.5, 60));
        // Ends that miss their lines by rounding, and a band that lies between two lines.
        let rounded = LineRange::between(60, halves, [0.5 + 1e-12, 14.5 - 1e-12]);
        assert_eq!(rounded.unwrap(), band);
        let between = LineRange::between(60, halves, [1.1, 1.4]).unwrap();
        assert_eq!(between.len(), 0);
    }

    #[test]
    fn a_band_beyond_the_lines_is_none() {
        // Up to just below the line after the last, and from 0 Hz, where no line can be.
        assert_eq!(
            LineRange::between(60, halves, [0.0, 30.4]),
            Ok(LineRange::all(60))
        );
        let beyond = |band| {
            Err(BandError::Beyond {
                band,
                lines: Some([0.5, 30.0]),
            })
        };
        for band in [[1.0, 30.5], [40.0, 50.0], [0.0, 1e300]] {
            assert_eq!(LineRange::between(60, halves, band), beyond(band));
        }
        // Lines from 5 Hz: those from 2 Hz are missing.
        let from_five = |line: usize| 5.0 + 0.5 * line as f64;
        assert!(LineRange::between(60, from_five, [2.0, 10.0]).is_err());
        assert!(LineRange::between(60, from_five, [4.6, 10.0]).is_ok());
        for ends in [
            [1.0, f64::INFINITY],
            [-1.0, 2.0],
            [2.0, 1.0],
            [f64::NAN, 1.0],
        ] {
            let refused = LineRange::between(60, halves, ends);
            assert!(matches!(refused, Err(BandError::Ends(_))), "{refused:?}");
        }
    }

    #[test]
    fn listed_lines_go_by_the_same_rule() {
        let listed: Vec<f64> = (0..60).map(halves).collect();
        for band in [
            [0.5, 14.5],
            [0.0, 30.4],
            [1.1, 1.4],
            [1.0, 30.5],
            [7.0, 7.0],
        ] {
            assert_eq!(
                LineRange::among(&listed, band),
                LineRange::between(60, halves, band)
            );
        }
        assert_eq!(LineRange::among(&[5.0], [1.0, 9.0]), Ok(LineRange::all(1)));
        assert!(LineRange::among(&[5.0], [6.0, 9.0]).is_err());
        assert!(LineRange::among(&[], [6.0, 9.0]).is_err());
        // Unevenly spaced: the step at either end tells what is missing there.
        let sweep = [1.0, 2.0, 4.0, 8.0];
        assert_eq!(
            LineRange::among(&sweep, [1.5, 11.9]).unwrap().indices(),
            1..4
        );
        assert!(LineRange::among(&sweep, [1.5, 12.0]).is_err());
    }

    #[test]
    fn indices_beyond_the_lines_are_refused() {
        assert!(LineRange::new(0..41, 40).is_err());
        assert!(LineRange::new(usize::MAX - 1..usize::MAX, 40).is_err());
        let (end, start) = (3, 4);
        assert!(LineRange::new(start..end, 40).is_err());
        assert_eq!(LineRange::new(0..40, 40), Ok(LineRange::all(40)));
    }
}
