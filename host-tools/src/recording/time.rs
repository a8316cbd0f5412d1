//! The channel of time: its name in several languages, its unit, and how far it is rounded.

use super::source::Channel;

/// Names of a channel of time in lower case, without their unit.
const NAMES: [&str; 24] = [
    "time",
    "zeit",
    "temps",
    "tempo",
    "tiempo",
    "tid",
    "tijd",
    "aika",
    "czas",
    "čas",
    "idő",
    "timp",
    "vreme",
    "zaman",
    "χρόνος",
    "время",
    "час",
    "时间",
    "時間",
    "時刻",
    "시간",
    "timestamp",
    "zeitstempel",
    "elapsed time",
];

/// Units of time with their seconds.
const UNITS: [(&str, f64); 18] = [
    ("s", 1.0),
    ("sec", 1.0),
    ("secs", 1.0),
    ("second", 1.0),
    ("seconds", 1.0),
    ("sek", 1.0),
    ("sekunden", 1.0),
    ("secondes", 1.0),
    ("segundos", 1.0),
    ("secondi", 1.0),
    ("с", 1.0),
    ("秒", 1.0),
    ("ms", 1e-3),
    ("µs", 1e-6),
    ("μs", 1e-6),
    ("us", 1e-6),
    ("ns", 1e-9),
    ("min", 60.0),
];

/// A name and the unit behind it, in brackets or after a slash: `Time (s)`, `Zeit [ms]`, `t / s`,
/// `time_s`.
fn parts(name: &str) -> (&str, Option<&str>) {
    let name = name.trim();
    for (open, close) in [('(', ')'), ('[', ']'), ('{', '}'), ('<', '>')] {
        let inner = name.strip_suffix(close).and_then(|n| n.rsplit_once(open));
        if let Some((before, unit)) = inner {
            return (before.trim(), Some(unit.trim()));
        }
    }
    for between in ['/', ',', ' ', '_'] {
        if let Some((before, unit)) = name.rsplit_once(between)
            && seconds(unit.trim()).is_some()
        {
            return (before.trim(), Some(unit.trim()));
        }
    }
    (name, None)
}

/// Seconds of a unit of time.
fn seconds(unit: &str) -> Option<f64> {
    let unit = unit.trim_matches(|c: char| "()[]{}<>.".contains(c) || c.is_whitespace());
    let unit = unit.to_lowercase();
    UNITS
        .iter()
        .find(|(name, _)| *name == unit)
        .map(|(_, s)| *s)
}

/// Seconds of the unit of a channel of time; 1 where neither name nor file states one.
pub(super) fn unit(channel: &Channel) -> f64 {
    let stated = channel.unit.as_deref().and_then(seconds);
    stated
        .or_else(|| parts(&channel.name).1.and_then(seconds))
        .unwrap_or(1.0)
}

/// `true` if a channel at this position has the name of time. A single `t` may be a temperature
/// or a torque, so that it is time in the first column only, as `X_Value` (LabVIEW's abscissa), `Seconds` and a `T` of
/// so many seconds are.
fn is_time(position: usize, channel: &Channel) -> bool {
    let (name, unit) = parts(&channel.name);
    let of_time = unit.is_none_or(|unit| seconds(unit).is_some());
    let lower = name.to_lowercase();
    if !of_time {
        return false;
    }
    // A channel that is in seconds or parts of them, such as of a header's second line.
    let stated = channel.unit.as_deref().or(unit);
    let in_seconds = || stated.is_some_and(|unit| seconds(unit).is_some());
    let is_first = match lower.as_str() {
        "x_value" => true,
        "t" => name == "t" || in_seconds(),
        name => name.len() > 2 && seconds(name).is_some(),
    };
    NAMES.contains(&lower.as_str()) || (position == 0 && is_first)
}

/// Position of the channel of time by its name, if it is not one that was asked for.
pub(super) fn find(channels: &[Channel], asked: impl Fn(usize) -> bool) -> Option<usize> {
    let mut all = channels.iter().enumerate().filter(|(i, _)| !asked(*i));
    // The plain name goes before one in another language that is something else there.
    let plain = |(_, c): &(usize, &Channel)| c.name.eq_ignore_ascii_case("time");
    let found = all
        .clone()
        .find(plain)
        .or_else(|| all.find(|(i, c)| is_time(*i, c)));
    found.map(|(i, _)| i)
}

/// Rounding of times, s: the largest power of ten, from a second down to a nanosecond, of which
/// all of them are multiples; 0 if there is none.
fn rounding(times: &[f64]) -> f64 {
    let multiple = |steps: f64| {
        times.iter().all(|time| {
            let scaled = time * steps;
            // Reading and multiplying err by two roundings.
            (scaled - scaled.round()).abs() <= 4.0 * f64::EPSILON * scaled.abs().max(1.0)
        })
    };
    let mut steps = 1.0;
    while steps <= 1e9 {
        if multiple(steps) {
            return 1.0 / steps;
        }
        steps *= 10.0;
    }
    0.0
}

/// Largest distance of times from the straight line through the first and the last of them, s.
fn unevenness(times: &[f64]) -> f64 {
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        return 0.0;
    };
    let step = (last - first) / (times.len().max(2) - 1) as f64;
    let off = |(n, time): (usize, &f64)| (time - first - n as f64 * step).abs();
    times.iter().enumerate().map(off).fold(0.0, f64::max)
}

/// Times of the first samples.
pub(super) struct Times {
    /// First time, s.
    pub(super) first: f64,
    /// Mean rate, Hz.
    pub(super) rate: f64,
    /// Steps from one time to the next.
    pub(super) steps: f64,
    /// Last decimal of the times, s, where it makes them uneven; else 0.
    pub(super) rounding: f64,
}

impl Times {
    /// Times in units of `second` s; `None` if they do not go on.
    pub(super) fn new(mut times: Vec<f64>, second: f64) -> Option<Self> {
        // The last decimal is one of the unit in which the times are written.
        let rounding = second * rounding(&times);
        times.iter_mut().for_each(|time| *time *= second);
        let (first, last) = (*times.first()?, *times.last()?);
        let steps = (times.len() - 1) as f64;
        let rate = steps / (last - first);
        // Times of few decimals that are even are not rounded.
        let uneven = unevenness(&times) * rate > 1e-3;
        (rate.is_finite() && rate > 0.0).then_some(Self {
            first,
            rate,
            steps,
            rounding: if uneven { rounding } else { 0.0 },
        })
    }

    /// Largest relative error of a rate by the rounding of two times that are `steps` apart.
    pub(super) fn rate_error(&self, steps: f64) -> f64 {
        self.rounding * self.rate / steps
    }

    /// The clock of a recording at a rate, Hz.
    pub(super) fn clock(&self, rate: f64) -> Clock {
        Clock {
            start: self.first,
            rate,
            rounding: self.rounding,
        }
    }
}

/// The times that samples should carry.
pub(super) struct Clock {
    start: f64,
    rate: f64,
    rounding: f64,
}

impl Clock {
    /// The time that is due after so many samples, and the distance from it that is allowed, s.
    pub(super) fn due(&self, samples: u64) -> (f64, f64) {
        let since = samples as f64 / self.rate;
        // Half a sample, and the drift of a rate that is known to 1e-4: a lost sample
        // early in the file is a whole one. Where times are rounded by more than that, two of
        // them differ by the whole of their last decimal, and a tenth of it for a rate that is
        // as little known.
        let allowed = (0.6 / self.rate).max(1.1 * self.rounding);
        (self.start + since, allowed + 1e-4 * since)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(name: &str, unit: Option<&str>) -> Channel {
        Channel {
            name: name.to_owned(),
            unit: unit.map(str::to_owned),
            direction: None,
        }
    }

    #[test]
    fn time_is_found_in_several_languages_with_its_unit() {
        for (name, stated, expected) in [
            ("Time (s)", None, 1.0),
            ("Zeit [ms]", None, 1e-3),
            ("TEMPS", Some("s"), 1.0),
            ("tempo", None, 1.0),
            ("Tiempo (µs)", None, 1e-6),
            ("Zeit", Some("ms"), 1e-3),
            ("Zeit", Some("[ms]"), 1e-3),
            ("Время, с", None, 1.0),
            ("time_ms", None, 1e-3),
            ("t / s", None, 1.0),
            ("時間", None, 1.0),
            ("X_Value", None, 1.0),
            ("Seconds", None, 1.0),
            ("T [ms]", None, 1e-3),
            ("T", Some("s"), 1.0),
        ] {
            let channels = [channel(name, stated), channel("a1", None)];
            assert_eq!(find(&channels, |_| false), Some(0), "{name}");
            assert_eq!(unit(&channels[0]), expected, "{name}");
        }
    }

    #[test]
    fn other_channels_are_no_time() {
        for name in [
            "a1",
            "tempo (bpm)",
            "T",
            "time constant",
            "timer",
            "T [N]",
            "T [°C]",
            "ms",
            "X_Value [N]",
        ] {
            let channels = [channel(name, None), channel("b", None)];
            assert_eq!(find(&channels, |_| false), None, "{name}");
        }
        // A torque or a temperature behind the first column, and a channel that a sensor names.
        let channels = [channel("a1", None), channel("t", None)];
        assert_eq!(find(&channels, |_| false), None);
        for (name, stated) in [("X_Value", None), ("Seconds", None), ("T", Some("s"))] {
            let channels = [channel("a1", None), channel(name, stated)];
            assert_eq!(find(&channels, |_| false), None, "{name}");
        }
        let channels = [channel("tempo", None), channel("Time", None)];
        assert_eq!(find(&channels, |_| false), Some(1));
        assert_eq!(find(&channels, |i| i == 1), Some(0));
    }

    #[test]
    fn rounding_is_the_last_decimal() {
        let at = |decimals: i32| -> Vec<f64> {
            let steps = 10_f64.powi(decimals);
            (0..1000)
                .map(|n| (f64::from(n) / 512.0 * steps).round() / steps)
                .collect()
        };
        assert!((rounding(&at(3)) - 1e-3).abs() < 1e-12);
        assert!((rounding(&at(2)) - 1e-2).abs() < 1e-12);
        assert!((rounding(&at(6)) - 1e-6).abs() < 1e-15);
        let thirds: Vec<f64> = (0..1000).map(|n| f64::from(n) / 3.0).collect();
        assert_eq!(rounding(&thirds), 0.0);
        // Half of the rounding at each of the two times that are compared, at most.
        assert!(unevenness(&at(3)) > 4e-4 && unevenness(&at(3)) <= 1e-3);
    }
}
