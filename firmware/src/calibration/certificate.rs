//! Calibration of one input: sensitivity, uncertainty, laboratory and date.

use super::{Channel, Limits, Scale, Watch};
use crate::wire::{Circuit, Date, Field, Input, Item, NAME_MAX, Problem};
use heapless::String;

/// A text of the protocol, at most [`NAME_MAX`] bytes.
pub type Text = String<NAME_MAX>;

/// Calibration of one input: its numbers and their origin.
///
/// It has the content of [`Input`], owns its texts and has been checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Certificate {
    circuit: Circuit,
    serial: Text,
    certificate: Text,
    calibrated: Option<Date>,
    per_count: f64,
    offset: f64,
    uncertainty: f64,
    gain: u8,
    limits: Limits,
}

impl Certificate {
    /// Calibration of an input to which nothing is wired: counts are not converted.
    pub const UNUSED: Self = Self {
        circuit: Circuit::Unused,
        serial: Text::new(),
        certificate: Text::new(),
        calibrated: None,
        per_count: 1.0,
        offset: 0.0,
        uncertainty: 0.0,
        gain: 1,
        limits: Limits::CONVERTER,
    };

    /// Checks a calibration from the host.
    ///
    /// # Errors
    ///
    /// [`Problem::Range`] with the input's number: sensitivity or offset that [`Scale::new`]
    /// refuses, an uncertainty that is negative or not below one, a gain that is not a power of
    /// two up to 128, limits that do not lie in order within 24 bits, no day of the calendar.
    /// [`Problem::Capacity`]: a text that is too long.
    pub fn new(input: &Input) -> Result<Self, Problem> {
        Self::check(input).map_err(|problem| problem.about(input.input.into()))
    }

    fn check(input: &Input) -> Result<Self, Problem> {
        Scale::new(input.per_count, input.offset)?;
        if !(0.0..1.0).contains(&input.uncertainty) {
            return Err(Problem::range(
                Field::Uncertainty,
                0,
                input.uncertainty,
                [0.0, 1.0],
            ));
        }
        if !input.gain.is_power_of_two() {
            return Err(Problem::range(
                Field::Gain,
                0,
                f64::from(input.gain),
                [1.0, 128.0],
            ));
        }
        let [low, high] = input.limits;
        let ends = Limits::CONVERTER;
        if low < ends.low || low >= high {
            let highest = f64::from(high.min(ends.high)) - 1.0;
            let lowest = f64::from(ends.low);
            return Err(Problem::range(
                Field::CountLimit,
                0,
                f64::from(low),
                [lowest, highest],
            ));
        }
        if high > ends.high {
            let [found, low, end] = [high, low, ends.high].map(f64::from);
            return Err(Problem::range(
                Field::CountLimit,
                0,
                found,
                [low + 1.0, end],
            ));
        }
        if let Some(date) = input.calibrated {
            check_date(date)?;
        }
        Ok(Self {
            circuit: input.circuit,
            serial: text(input.serial)?,
            certificate: text(input.certificate)?,
            calibrated: input.calibrated,
            per_count: input.per_count,
            offset: input.offset,
            uncertainty: input.uncertainty,
            gain: input.gain,
            limits: Limits { low, high },
        })
    }

    /// The calibration as a setting of the input of this number.
    #[must_use]
    pub fn input(&self, number: u8) -> Input<'_> {
        Input {
            input: number,
            circuit: self.circuit,
            serial: &self.serial,
            certificate: &self.certificate,
            calibrated: self.calibrated,
            per_count: self.per_count,
            offset: self.offset,
            uncertainty: self.uncertainty,
            gain: self.gain,
            limits: [self.limits.low, self.limits.high],
        }
    }

    /// Circuit of the sensor.
    #[must_use]
    pub const fn circuit(&self) -> Circuit {
        self.circuit
    }

    /// Gain of the converter's amplifier.
    #[must_use]
    pub const fn gain(&self) -> u8 {
        self.gain
    }

    /// Counts at which a sample is an overload.
    #[must_use]
    pub const fn limits(&self) -> Limits {
        self.limits
    }

    /// Conversion of counts to SI.
    #[must_use]
    pub fn scale(&self) -> Scale {
        // The values were checked by the constructor.
        Scale::new(self.per_count, self.offset).unwrap_or(Scale::ONE)
    }

    /// The channel at a sample rate in Hz. An input to which nothing is wired is not supervised.
    #[must_use]
    pub fn channel(&self, sample_rate: f32) -> Channel {
        match self.circuit {
            Circuit::Unused => Channel::unwatched(self.scale()),
            _ => Channel::watched(self.scale(), Watch::new(self.limits, sample_rate)),
        }
    }
}

impl Default for Certificate {
    fn default() -> Self {
        Self::UNUSED
    }
}

fn text(found: &str) -> Result<Text, Problem> {
    Text::try_from(found).map_err(|_| Problem::capacity(Item::Byte, found.len(), NAME_MAX))
}

fn check_date(date: Date) -> Result<(), Problem> {
    let leap = date.year.is_multiple_of(4)
        && (!date.year.is_multiple_of(100) || date.year.is_multiple_of(400));
    let days = match date.month {
        1 | 3 | 5 | 7 | 8 | 10 | 12 => 31,
        4 | 6 | 9 | 11 => 30,
        2 if leap => 29,
        2 => 28,
        month => {
            return Err(Problem::range(
                Field::Date,
                0,
                f64::from(month),
                [1.0, 12.0],
            ));
        }
    };
    if (1..=days).contains(&date.day) {
        Ok(())
    } else {
        let [found, last] = [date.day, days].map(f64::from);
        Err(Problem::range(Field::Date, 0, found, [1.0, last]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::Health;

    fn bridge() -> Input<'static> {
        Input {
            input: 7,
            circuit: Circuit::Bridge,
            serial: "LC-0815",
            certificate: "D-K-15183 2026-03",
            calibrated: Some(Date {
                year: 2024,
                month: 2,
                day: 29,
            }),
            per_count: -1.25e-3,
            offset: 1042.5,
            uncertainty: 2e-3,
            gain: 64,
            limits: [-8_000_000, 8_000_000],
        }
    }

    #[test]
    fn what_is_written_comes_out_again() {
        let kept = Certificate::new(&bridge()).unwrap();
        assert_eq!(kept.input(7), bridge());
        assert_eq!(Certificate::UNUSED.input(3).circuit, Circuit::Unused);
        let unused = Certificate::new(&Certificate::UNUSED.input(3)).unwrap();
        assert_eq!(unused, Certificate::UNUSED);
    }

    #[test]
    fn offset_and_polarity_reach_the_samples() {
        let mut channel = Certificate::new(&bridge()).unwrap().channel(512.0);
        assert_eq!(channel.count(1042, Health::GOOD).0, 0.5 * 1.25e-3);
        assert_eq!(channel.count(9042, Health::GOOD).0, -7999.5 * 1.25e-3);
        assert_eq!(channel.count(8_000_000, Health::GOOD).1, Health::OVERLOAD);
    }

    #[test]
    fn an_unused_input_has_no_faults_of_its_own() {
        let mut channel = Certificate::UNUSED.channel(512.0);
        for _ in 0..2000 {
            assert_eq!(channel.count(-(1 << 23), Health::GOOD).1, Health::GOOD);
        }
    }

    #[test]
    fn each_value_out_of_range_is_refused_by_its_name() {
        type Change = fn(&mut Input<'_>);
        let values: [(Change, Field, f64); 6] = [
            (|i| i.per_count = 0.0, Field::Scale, 0.0),
            (|i| i.offset = f64::NAN, Field::Offset, f64::NAN),
            (|i| i.uncertainty = -0.1, Field::Uncertainty, -0.1),
            (|i| i.uncertainty = 1.0, Field::Uncertainty, 1.0),
            (|i| i.gain = 0, Field::Gain, 0.0),
            (|i| i.gain = 3, Field::Gain, 3.0),
        ];
        let values = values.map(|(change, field, value)| {
            let mut input = bridge();
            change(&mut input);
            (input, field, value)
        });
        let bad_limits = |limits| Input { limits, ..bridge() };
        let limits = [
            ([5, 5], 5),
            ([i32::MIN, 5], i32::MIN),
            ([0, i32::MAX], i32::MAX),
        ];
        let limits =
            limits.map(|(limits, value)| (bad_limits(limits), Field::CountLimit, f64::from(value)));
        let days = [
            (2023, 2, 29),
            (1900, 2, 29),
            (2024, 4, 31),
            (2024, 13, 1),
            (2024, 1, 0),
        ];
        let days = days.map(|(year, month, day)| {
            let calibrated = Some(Date { year, month, day });
            let found = if month > 12 { month } else { day };
            let input = Input {
                calibrated,
                ..bridge()
            };
            (input, Field::Date, f64::from(found))
        });
        for (input, field, value) in values.into_iter().chain(limits).chain(days) {
            let refused = Certificate::new(&input).unwrap_err();
            let Problem::Range {
                field: named,
                index,
                found,
                ..
            } = refused
            else {
                panic!("{refused:?}")
            };
            let found = found.to_bits();
            assert_eq!((named, index, found), (field, 7, value.to_bits()));
        }
        // What is said to be expected is.
        for (limits, expected) in [
            ([i32::MIN, 5], [-8_388_608, 4]),
            ([9, 5], [-8_388_608, 4]),
            ([0, i32::MAX], [1, 8_388_607]),
        ] {
            let Err(Problem::Range { low, high, .. }) = Certificate::new(&bad_limits(limits))
            else {
                panic!("{limits:?}");
            };
            assert_eq!([low, high], expected.map(f64::from));
            let [at, end] = expected;
            let mended = match limits {
                [low, _] if low == 0 => [[low, at], [low, end]],
                [_, high] => [[at, high], [end, high]],
            };
            for limits in mended {
                assert!(Certificate::new(&bad_limits(limits)).is_ok(), "{limits:?}");
            }
        }
    }

    #[test]
    fn a_text_that_is_too_long_is_refused() {
        let serial = "0123456789012345678901234567890123";
        let refused = Certificate::new(&Input { serial, ..bridge() });
        let problem = Problem::capacity(Item::Byte, 34, 32);
        assert_eq!(refused, Err(problem));
    }
}
