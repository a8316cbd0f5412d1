//! Data to pixels.

use core::ops::Range;

/// Mapping of values along an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mapping {
    /// Equal differences are equally long.
    #[default]
    Linear,
    /// Equal ratios are equally long. Values at or below zero have no place.
    Log,
    /// `-log10(1 - v)`: 0.9, 0.99 and 0.999 are equally far apart. For shares that
    /// should be one, such as coherences. Values of one and above have no place.
    Nines,
}

impl Mapping {
    fn stretch(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Log => libm::log10(value),
            Self::Nines => -libm::log10(1.0 - value),
        }
    }
}

/// A mapping of a domain of data onto a range of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    mapping: Mapping,
    from: f64,
    per_unit: f64,
    start: f64,
}

impl Scale {
    /// The scale that takes `domain` onto `pixels`, whose second may be the smaller one.
    /// The domain must suit the mapping ([`Extent::domain`] sees to it); an empty one
    /// maps everything to the middle.
    #[must_use]
    pub fn new(mapping: Mapping, domain: [f64; 2], pixels: [f64; 2]) -> Self {
        let [from, to] = domain.map(|v| mapping.stretch(v));
        let span = to - from;
        if span.is_finite() && span != 0.0 {
            Self {
                mapping,
                from,
                per_unit: (pixels[1] - pixels[0]) / span,
                start: pixels[0],
            }
        } else {
            Self {
                mapping,
                from: 0.0,
                per_unit: 0.0,
                start: 0.5 * (pixels[0] + pixels[1]),
            }
        }
    }

    /// Place of a value, pixels; `None` if it has no place on this mapping. Values outside the
    /// domain lie outside the pixels.
    #[must_use]
    pub fn at(&self, value: f64) -> Option<f64> {
        let stretched = self.mapping.stretch(value);
        stretched
            .is_finite()
            .then_some(self.start + (stretched - self.from) * self.per_unit)
    }
}

/// Smallest and largest of what is to be drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    mapping: Mapping,
    low: f64,
    high: f64,
}

impl Extent {
    /// An extent without values.
    #[must_use]
    pub fn new(mapping: Mapping) -> Self {
        Self {
            mapping,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
        }
    }

    /// Takes note of a value; one without a place on the mapping is ignored.
    pub fn see(&mut self, value: f64) {
        if self.mapping.stretch(value).is_finite() {
            self.low = self.low.min(value);
            self.high = self.high.max(value);
        }
    }

    /// All of some values.
    #[must_use]
    pub fn of(mapping: Mapping, values: impl IntoIterator<Item = f64>) -> Self {
        let mut extent = Self::new(mapping);
        values.into_iter().for_each(|v| extent.see(v));
        extent
    }

    /// The extent of the values between two quantiles, so that a few strays do not
    /// squeeze the rest into a line.
    #[must_use]
    pub fn within_quantiles(
        mapping: Mapping,
        values: impl IntoIterator<Item = f64>,
        quantiles: Range<f64>,
    ) -> Self {
        let mut sorted: Vec<f64> = values
            .into_iter()
            .filter(|v| mapping.stretch(*v).is_finite())
            .collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().saturating_sub(1) as f64;
        let at = |q: f64| sorted.get((q * last).round() as usize).copied();
        Self::of(
            mapping,
            [quantiles.start, quantiles.end].into_iter().filter_map(at),
        )
    }

    /// `true` if there is no value yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.low > self.high
    }

    /// A domain that holds everything with a share of it as a margin on both sides.
    /// Never empty, whatever was seen.
    #[must_use]
    pub fn domain(&self, margin: f64) -> [f64; 2] {
        if self.is_empty() {
            return match self.mapping {
                Mapping::Log => [0.1, 10.0],
                Mapping::Linear | Mapping::Nines => [0.0, 1.0 - 1e-3],
            };
        }
        let (low, high) = (self.low, self.high);
        match self.mapping {
            Mapping::Linear => {
                let span = high - low;
                // All the same, up to rounding: a tenth of it, so that ticks tell apart.
                let least = 1e-9 * high.abs().max(low.abs());
                let pad = if span > least {
                    margin * span
                } else if least > 0.0 {
                    0.1 * high.abs().max(low.abs())
                } else {
                    1.0
                };
                [low - pad, high + pad]
            }
            Mapping::Log => {
                let (a, b) = (libm::log10(low), libm::log10(high));
                let pad = if b - a > 1e-6 { margin * (b - a) } else { 0.5 };
                let ten = |e: f64| libm::pow(10.0, e.clamp(-300.0, 300.0));
                [ten(a - pad), ten(b + pad)]
            }
            Mapping::Nines => {
                let nines = (-libm::log10(1.0 - high) + 0.2).clamp(1.0, 9.0);
                [low.clamp(0.0, 0.5), 1.0 - libm::pow(10.0, -nines)]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_of_the_domain_are_ends_of_the_pixels() {
        for (mapping, domain) in [
            (Mapping::Linear, [-3.0, 7.0]),
            (Mapping::Log, [0.01, 100.0]),
            (Mapping::Nines, [0.0, 0.9999]),
        ] {
            let s = Scale::new(mapping, domain, [200.0, 20.0]);
            for (value, pixel) in domain.into_iter().zip([200.0, 20.0]) {
                // Two logarithms and a product of numbers below a thousand.
                assert!((s.at(value).unwrap() - pixel).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn a_value_without_a_place_is_left_out() {
        let log = Scale::new(Mapping::Log, [0.1, 10.0], [0.0, 100.0]);
        assert_eq!(log.at(0.0), None);
        assert_eq!(log.at(-1.0), None);
        assert_eq!(log.at(f64::NAN), None);
        let nines = Scale::new(Mapping::Nines, [0.0, 0.999], [0.0, 100.0]);
        assert_eq!(nines.at(1.0), None);
        let empty = Scale::new(Mapping::Linear, [2.0, 2.0], [0.0, 100.0]);
        assert_eq!(empty.at(5.0), Some(50.0));
    }

    #[test]
    fn a_domain_is_never_empty() {
        for mapping in [Mapping::Linear, Mapping::Log, Mapping::Nines] {
            for values in [vec![], vec![f64::NAN], vec![0.5], vec![0.5; 3], vec![0.0]] {
                let [a, b] = Extent::of(mapping, values.iter().copied()).domain(0.05);
                assert!(
                    a < b && a.is_finite() && b.is_finite(),
                    "{mapping:?} {values:?}"
                );
            }
        }
    }

    #[test]
    fn strays_do_not_stretch_the_domain() {
        let values = (0..1000).map(|i| if i == 500 { 1e6 } else { f64::from(i) / 1000.0 });
        let [low, high] = Extent::within_quantiles(Mapping::Linear, values, 0.01..0.99).domain(0.0);
        assert!(low >= 0.0 && high <= 1.0);
    }
}
