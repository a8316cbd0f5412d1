//! Time stamps: `2026-03-02T12:00:00.125Z`, `2026-03-02 12:00:00,125`, `02.03.2026 12:00:00`,
//! `12:00:00.125`.

/// Seconds of a day.
const DAY: f64 = 86_400.0;

/// A point in time: days since 1 January 1970 (0 without a date), and seconds of that day.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stamp {
    day: i64,
    seconds: f64,
}

impl Stamp {
    /// Seconds since the midnight before another stamp, to some 1e-11 s.
    pub(super) fn since_day_of(&self, first: &Self) -> f64 {
        (self.day - first.day) as f64 * DAY + self.seconds
    }

    /// Reads a stamp; `None` if the text is something else. A zone shifts the stamp.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        let (date, time) = match text.split_once(['T', ' ']) {
            Some((date, time)) => (Some(date), time.trim_start()),
            None => (None, text),
        };
        let day = date.map_or(Some(0), days)?;
        let (clock, offset) = match time.strip_suffix(['Z', 'z']) {
            Some(clock) => (clock.trim_end(), 0.0),
            None => match time.rfind(['+', '-']) {
                Some(at) => (time.get(..at)?.trim_end(), zone(time.get(at..)?)?),
                None => (time, 0.0),
            },
        };
        let mut parts = clock.split(':');
        let hour = whole(parts.next()?, 2).filter(|h| *h < 24)?;
        let minute = whole(parts.next()?, 2).filter(|m| *m < 60)?;
        let seconds = parts.next().map_or(Some(0.0), |text| {
            let (before, after) = text.split_once(['.', ',']).unwrap_or((text, "0"));
            let is_digits = after.len() <= 12 && after.bytes().all(|b| b.is_ascii_digit());
            let number = format!("{}.{after}", whole(before, 2)?);
            // A leap second has the number 60.
            let number = number.parse::<f64>().ok()?;
            (is_digits && !after.is_empty() && number < 61.0).then_some(number)
        })?;
        let seconds = (hour * 3600 + minute * 60) as f64 + seconds - offset;
        parts.next().is_none().then_some(Self { day, seconds })
    }
}

/// `true` for a date, which some files have in a column of its own beside that of the time.
pub(super) fn is_date(text: &str) -> bool {
    days(text.trim()).is_some()
}

/// A whole number of one to `digits` digits.
fn whole(text: &str, digits: usize) -> Option<i64> {
    let is_whole = (1..=digits).contains(&text.len()) && text.bytes().all(|b| b.is_ascii_digit());
    is_whole.then(|| text.parse().ok()).flatten()
}

/// Seconds of `+01:00`, `-0530`, `+02`.
fn zone(text: &str) -> Option<f64> {
    let (sign, digits) = (text.get(..1)?, text.get(1..)?.replace(':', ""));
    let hours = whole(digits.get(..2)?, 2)?;
    let minutes = match digits.get(2..)? {
        "" => 0,
        rest => whole(rest, 2)?,
    };
    let seconds = (hours * 3600 + minutes * 60) as f64;
    Some(if sign == "-" { -seconds } else { seconds })
}

/// Days since 1 January 1970 of `2026-03-02`, `2026/03/02`, `02.03.2026`.
fn days(date: &str) -> Option<i64> {
    let parts: Vec<&str> = date.split(['-', '/', '.']).collect();
    let (year, month, day) = match parts.as_slice() {
        [year, month, day] if year.len() == 4 => (year, month, day),
        [day, month, year] if year.len() == 4 && date.contains('.') => (year, month, day),
        _ => return None,
    };
    let year = whole(year, 4)?;
    let month = whole(month, 2).filter(|m| (1..=12).contains(m))?;
    let day = whole(day, 2).filter(|d| (1..=31).contains(d))?;
    // Years that begin in March, so that a leap day is the last one.
    let (y, m) = if month > 2 {
        (year, month - 3)
    } else {
        (year - 1, month + 9)
    };
    let leaps = y.div_euclid(4) - y.div_euclid(100) + y.div_euclid(400);
    Some(365 * y + leaps + (153 * m + 2) / 5 + day - 1 - 719_468)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(text: &str) -> (i64, f64) {
        let stamp = Stamp::parse(text).unwrap_or_else(|| panic!("{text}"));
        (stamp.day, stamp.seconds)
    }

    #[test]
    fn stamps_are_read() {
        assert_eq!(at("1970-01-01T00:00:00Z"), (0, 0.0));
        // 20514 days: 56 years of 365, and 14 leap days from 1972 to 2024, and 31 + 28 + 1.
        assert_eq!(at("2026-03-02 12:00:00,125"), (20_514, 43_200.125));
        assert_eq!(at("02.03.2026 12:00:00.125"), (20_514, 43_200.125));
        assert_eq!(at("2026-03-02T12:00:00.125+01:00"), (20_514, 39_600.125));
        assert_eq!(at("2026-03-02T12:00:00-0030"), (20_514, 45_000.0));
        assert_eq!(at("2024-02-29T00:00:00"), (19_782, 0.0));
        assert_eq!(at("12:00:00.5"), (0, 43_200.5));
        let first = Stamp::parse("2026-03-02T23:59:59.5").unwrap();
        let next = Stamp::parse("2026-03-03T00:00:00.25").unwrap();
        let step = next.since_day_of(&first) - first.since_day_of(&first);
        assert_eq!(step, 0.75);
    }

    #[test]
    fn other_texts_are_no_stamps() {
        for text in [
            "",
            "12",
            "1.5",
            "-3e5",
            "2026-03-02",
            "25:00:00",
            "12:61:00",
            "2026-13-02T00:00:00",
            "12:00:00:00",
            "a:b:c",
            "12:00:é",
            "é12:00:00",
            "12:00:00+é",
            "1:2:3.",
            "::",
            "03/02/2026 12:00:00",
        ] {
            assert_eq!(Stamp::parse(text), None, "{text}");
        }
    }
}
