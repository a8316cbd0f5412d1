//! Round numbers for axes.

use super::Mapping;
use crate::report::number::{fixed, power_of_ten, ten_to};

/// A labelled place on an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// Value at the tick.
    pub value: f64,
    /// Text at the tick.
    pub label: String,
}

/// The ticks of an axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ticks {
    /// With labels, ascending.
    pub major: Vec<Tick>,
    /// Without.
    pub minor: Vec<f64>,
}

/// Ticks for a domain, about `most` labelled ones and never more than twice as many.
#[must_use]
pub fn ticks(mapping: Mapping, domain: [f64; 2], most: usize) -> Ticks {
    let most = most.max(1);
    let [low, high] = domain;
    if !(low.is_finite() && high.is_finite() && low < high) {
        return Ticks::default();
    }
    match mapping {
        Mapping::Linear => linear(low, high, most),
        Mapping::Log => logarithmic(low, high, most),
        Mapping::Nines => nines(low, high),
    }
}

/// Multiples of 1, 2 or 5 times a power of ten.
fn linear(low: f64, high: f64, most: usize) -> Ticks {
    let raw = (high - low) / most as f64;
    let mut exponent = libm::floor(libm::log10(raw)) as i32;
    let ratio = raw / power_of_ten(exponent);
    let digit = if ratio <= 1.0 + 1e-9 {
        1.0
    } else if ratio <= 2.0 + 1e-9 {
        2.0
    } else if ratio <= 5.0 + 1e-9 {
        5.0
    } else {
        exponent += 1;
        1.0
    };
    // Divide by a power of ten that is exact instead of multiplying with one that is not.
    let at = |k: f64| {
        if exponent < 0 {
            k * digit / power_of_ten(-exponent)
        } else {
            k * digit * power_of_ten(exponent)
        }
    };
    let step = at(1.0);
    let slack = 1e-9 * (high - low);
    let first = libm::ceil((low - slack) / step);
    let decimals = (-exponent).clamp(0, 15) as usize;
    let mut major = Vec::new();
    for i in 0..=2 * most {
        let value = at(first + i as f64);
        if value > high + slack {
            break;
        }
        major.push(Tick {
            value,
            label: fixed(value, decimals),
        });
    }
    Ticks {
        major,
        minor: Vec::new(),
    }
}

/// Decades; fewer of them where there are many, 2 and 5 between where there are few.
fn logarithmic(low: f64, high: f64, most: usize) -> Ticks {
    if low <= 0.0 {
        return Ticks::default();
    }
    let slack = 1e-9;
    let first = libm::ceil(libm::log10(low) - slack) as i32;
    let last = libm::floor(libm::log10(high) + slack) as i32;
    let inside = |v: f64| v >= low * (1.0 - slack) && v <= high * (1.0 + slack);
    let decades = last - first + 1;
    if decades < 2 {
        let mut major = Vec::new();
        for e in first - 1..=last + 1 {
            for digit in [1.0, 2.0, 5.0] {
                let value = digit * power_of_ten(e);
                if inside(value) {
                    major.push(Tick {
                        value,
                        label: decade_label(value, e),
                    });
                }
            }
        }
        // Less than a factor of two or so: the axis is almost linear.
        if major.len() < 2 {
            return linear(low, high, most);
        }
        return Ticks {
            major,
            minor: Vec::new(),
        };
    }
    // Either all labels are written out, or none is.
    let written_out = PLAIN_DECADES.contains(&first) && PLAIN_DECADES.contains(&last);
    let label = |e: i32| {
        if written_out {
            decade_label(power_of_ten(e), e)
        } else {
            ten_to(e)
        }
    };
    let stride = (decades as usize).div_ceil(most).max(1) as i32;
    let mut major = Vec::new();
    let mut minor = Vec::new();
    for e in first - 1..=last {
        // Counted from zero, so that panels with different domains label the same decades.
        if e.rem_euclid(stride) == 0 && e >= first {
            major.push(Tick {
                value: power_of_ten(e),
                label: label(e),
            });
        } else if e >= first {
            minor.push(power_of_ten(e));
        }
        if decades <= FEW_DECADES {
            let between = (2..10).map(|d| f64::from(d) * power_of_ten(e));
            minor.extend(between.filter(|v| inside(*v)));
        }
    }
    Ticks { major, minor }
}

/// Up to so many decades have ticks between them.
const FEW_DECADES: i32 = 3;

/// Powers of ten that are written out.
const PLAIN_DECADES: core::ops::RangeInclusive<i32> = -3..=4;

fn decade_label(value: f64, exponent: i32) -> String {
    match exponent {
        e if PLAIN_DECADES.contains(&e) => fixed(value, (-exponent).max(0) as usize),
        _ => {
            let digit = (value / power_of_ten(exponent)).round();
            if digit == 1.0 {
                ten_to(exponent)
            } else {
                format!("{digit}·{}", ten_to(exponent))
            }
        }
    }
}

fn nines(low: f64, high: f64) -> Ticks {
    let mut values = vec![(0.0, 0), (0.5, 1)];
    values.extend((1..=9).map(|n| (1.0 - power_of_ten(-n), n as usize)));
    let inside = |v: &f64| *v >= low - 1e-12 && *v <= high + 1e-12;
    let major = values
        .into_iter()
        .filter(|(v, _)| inside(v))
        .map(|(value, decimals)| Tick {
            value,
            label: fixed(value, decimals),
        });
    Ticks {
        major: major.collect(),
        minor: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(mapping: Mapping, low: f64, high: f64, most: usize) -> Vec<String> {
        let t = ticks(mapping, [low, high], most);
        t.major.into_iter().map(|t| t.label).collect()
    }

    #[test]
    fn linear_ticks_are_multiples_of_1_2_5() {
        let l = |a, b, n| labels(Mapping::Linear, a, b, n);
        assert_eq!(l(0.0, 26.0, 5), ["0", "10", "20"]);
        assert_eq!(l(0.0, 104.0, 6), ["0", "20", "40", "60", "80", "100"]);
        assert_eq!(
            l(-0.3, 0.3, 6),
            ["−0.3", "−0.2", "−0.1", "0.0", "0.1", "0.2", "0.3"]
        );
        assert_eq!(l(0.0206, 0.0219, 4), ["0.0210", "0.0215"]);
        assert_eq!(
            l(1e6, 3e6, 2),
            [
                "1\u{202f}000\u{202f}000",
                "2\u{202f}000\u{202f}000",
                "3\u{202f}000\u{202f}000"
            ]
        );
    }

    #[test]
    fn a_tick_is_the_number_it_says() {
        for t in ticks(Mapping::Linear, [-0.3, 0.7], 10).major {
            let read: f64 = t.label.replace('−', "-").parse().unwrap();
            assert_eq!(t.value, read);
        }
    }

    #[test]
    fn logarithmic_ticks_are_decades() {
        let l = |a, b, n| labels(Mapping::Log, a, b, n);
        assert_eq!(l(0.02, 30.0, 6), ["0.1", "1", "10"]);
        assert_eq!(l(1.5, 8.0, 6), ["2", "5"]);
        assert_eq!(l(1e-9, 1e3, 4), ["10⁻⁸", "10⁻⁴", "10⁰"]);
        assert_eq!(l(2e-7, 9e-7, 4), ["2·10⁻⁷", "5·10⁻⁷"]);
        // Too narrow for 1, 2, 5.
        assert_eq!(l(2.1, 2.9, 4), ["2.2", "2.4", "2.6", "2.8"]);
    }

    #[test]
    fn minor_ticks_lie_between_and_inside() {
        let t = ticks(Mapping::Log, [0.5, 200.0], 6);
        assert!(t.minor.iter().all(|v| (0.5..=200.0).contains(v)));
        assert_eq!(t.minor.first(), Some(&0.5));
        assert_eq!(t.minor.last(), Some(&200.0));
    }

    #[test]
    fn shares_near_one_are_told_apart() {
        let l = labels(Mapping::Nines, 0.0, 0.9995, 5);
        assert_eq!(l, ["0", "0.5", "0.9", "0.99", "0.999"]);
    }

    #[test]
    fn nonsense_has_no_ticks() {
        for domain in [
            [1.0, 1.0],
            [f64::NAN, 1.0],
            [2.0, 1.0],
            [0.0, f64::INFINITY],
        ] {
            assert_eq!(ticks(Mapping::Linear, domain, 5), Ticks::default());
        }
        assert_eq!(ticks(Mapping::Log, [-1.0, 1.0], 5), Ticks::default());
    }

    #[test]
    fn there_are_never_many() {
        for span in [1e-12, 3.7e-3, 1.0, 9.99, 5.5e9] {
            for most in 1..12 {
                assert!(labels(Mapping::Linear, -span / 3.0, span, most).len() <= 2 * most);
            }
        }
    }
}
