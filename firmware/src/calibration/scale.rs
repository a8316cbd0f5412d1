//! Linear conversion of counts or readings to SI.

use crate::wire::{Field, Problem, ScaleSource};

/// `SI = per_unit * (reading - offset)`, in `f32`.
///
/// Counts of 24 bits and integer offsets are subtracted as integers, so that a large offset costs a
/// small signal no resolution. The rest of the offset, less than half a count, is subtracted in
/// `f32`. The same operations in the same order round alike on a host and on the chip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    per_unit: f32,
    /// The offset, rounded to a whole count, and the rest of it.
    whole: i32,
    rest: f32,
    /// The whole offset, for readings that are not counts.
    offset: f32,
}

/// Largest magnitude of a sensitivity, and the inverse of its smallest: products with 24 bits are
/// well within the range of `f32`.
const SENSITIVITY_MAX: f64 = 1e20;
/// Largest magnitude of an offset: below half of the counts that an `i32` holds.
const OFFSET_MAX: f64 = (1 << 30) as f64;

impl Scale {
    /// Readings that are SI already.
    pub const ONE: Self = Self {
        per_unit: 1.0,
        whole: 0,
        rest: 0.0,
        offset: 0.0,
    };

    /// Creates a conversion from the sensitivity in SI per unit of the reading, and the reading at
    /// zero. The sensitivity is negative if the sensor is turned round.
    ///
    /// # Errors
    ///
    /// [`Problem::Range`], with index zero: a sensitivity that is zero, not a number, above 1e20 or
    /// below 1e-20 in magnitude; an offset beyond 2^30.
    pub fn new(per_unit: f64, offset: f64) -> Result<Self, Problem> {
        let size = per_unit.abs();
        if !(1.0 / SENSITIVITY_MAX..=SENSITIVITY_MAX).contains(&size) {
            let end = SENSITIVITY_MAX;
            return Err(Problem::range(Field::Scale, 0, per_unit, [-end, end]));
        }
        if !(-OFFSET_MAX..=OFFSET_MAX).contains(&offset) {
            return Err(Problem::range(
                Field::Offset,
                0,
                offset,
                [-OFFSET_MAX, OFFSET_MAX],
            ));
        }
        let whole = libm::round(offset);
        Ok(Self {
            per_unit: per_unit as f32,
            whole: whole as i32,
            rest: (offset - whole) as f32,
            offset: offset as f32,
        })
    }

    /// The conversion that a set-up gives for a sensor; `None` if the box has it stored.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::new`].
    pub fn given(scale: &ScaleSource) -> Result<Option<Self>, Problem> {
        match *scale {
            ScaleSource::Given { per_unit, offset } => Self::new(per_unit, offset).map(Some),
            ScaleSource::Stored => Ok(None),
        }
    }

    /// Converts a count to SI.
    #[must_use]
    #[inline]
    pub fn count(&self, count: i32) -> f32 {
        (count.saturating_sub(self.whole) as f32 - self.rest) * self.per_unit
    }

    /// Converts a reading in any other unit to SI.
    #[must_use]
    pub fn reading(&self, reading: f32) -> f32 {
        (reading - self.offset) * self.per_unit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against f64. Three roundings to f32 are left (difference, sensitivity, product), each
        /// of half an ulp, 2^-24 of its value. The difference of two integers of up to 26 bits is
        /// rounded twice, before and after the rest is taken off.
        #[test]
        fn counts_become_si(
            count in -(1 << 23)..(1 << 23),
            offset in -8_388_608.0..8_388_608.0_f64,
            per_unit in prop_oneof![1e-9..1e-3_f64, -1e-3..-1e-9_f64],
        ) {
            let si = f64::from(Scale::new(per_unit, offset).unwrap().count(count));
            let exact = per_unit * (f64::from(count) - offset);
            // Where the difference is small, rounding the rest to f32 is what remains: 2^-25 of
            // a count.
            let bound = 4.0 * 2_f64.powi(-24) * exact.abs() + per_unit.abs() * 2_f64.powi(-24);
            prop_assert!((si - exact).abs() <= bound, "{si} {exact}");
        }

        #[test]
        fn any_count_gives_a_number(count: i32, per_unit in -1e20..1e20_f64, offset in -1e9..1e9) {
            if let Ok(scale) = Scale::new(per_unit, offset) {
                prop_assert!(scale.count(count).is_finite());
            }
        }
    }

    #[test]
    fn a_large_offset_takes_nothing_from_a_small_signal() {
        let scale = Scale::new(1.0, 8_000_000.25).unwrap();
        assert_eq!(scale.count(8_000_001), 0.75);
        assert_eq!(scale.count(8_000_000), -0.25);
    }

    #[test]
    fn what_is_no_line_is_refused() {
        for per_unit in [0.0, -0.0, f64::NAN, f64::INFINITY, 1e-30, 1e30] {
            let refused = Scale::new(per_unit, 0.0).unwrap_err();
            let Problem::Range { field, found, .. } = refused else {
                panic!("{refused:?}")
            };
            let found = found.to_bits();
            assert_eq!((field, found), (Field::Scale, per_unit.to_bits()));
        }
        for offset in [f64::NAN, f64::NEG_INFINITY, 2e9] {
            let refused = Scale::new(1.0, offset).unwrap_err();
            assert!(matches!(
                refused,
                Problem::Range {
                    field: Field::Offset,
                    ..
                }
            ));
        }
    }

    #[test]
    fn stored_lines_are_stored_elsewhere() {
        assert_eq!(Scale::given(&ScaleSource::Stored), Ok(None));
        let given = ScaleSource::Given {
            per_unit: 2.0,
            offset: 1.0,
        };
        assert_eq!(Scale::given(&given).unwrap().unwrap().reading(3.0), 4.0);
    }
}
