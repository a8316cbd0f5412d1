//! Values of a document's keys, for serde's `deserialize_with`: each with its range, and with the
//! sentence that says what is expected.
//!
//! An error is `is FOUND; expected EXPECTED`, or `expected EXPECTED` where the value as it was
//! written says what was found; `Document::read` adds file, line, section and key.

use std::collections::BTreeMap;
use std::fmt::Display;

use serde::{Deserialize, Deserializer, de};
use toml::Value;

use crate::printable::{quoted, steers};

/// Numbers beyond this are typing errors; below it, products of three of them, mass times
/// length squared, stay finite.
const LARGEST: f64 = 1e100;

/// The error of a value that is outside its range.
pub(crate) fn outside<E: de::Error>(found: impl Display, expected: impl Display) -> E {
    E::custom(format_args!("is {found}; expected {expected}"))
}

/// The error of a value of another kind.
fn unlike<E: de::Error>(expected: impl Display) -> E {
    E::custom(format_args!("expected {expected}"))
}

/// A finite number; integers are numbers too.
fn finite<E: de::Error>(value: &Value, expected: &str) -> Result<f64, E> {
    let number = match value {
        Value::Float(number) => *number,
        Value::Integer(number) => *number as f64,
        _ => return Err(unlike(expected)),
    };
    if !number.is_finite() {
        return Err(outside(number, format_args!("{expected} that is finite")));
    }
    if number.abs() > LARGEST {
        let expected = format_args!("{expected} of a size that exists");
        return Err(outside(number, expected));
    }
    Ok(number)
}

/// A number that satisfies a condition, described by `expected`.
pub(crate) fn number<'de, D: Deserializer<'de>, T: From<f64>>(
    value: D,
    expected: impl Display,
    allowed: impl Fn(f64) -> bool,
) -> Result<T, D::Error> {
    let number = finite(&Value::deserialize(value)?, "a number")?;
    if !allowed(number) {
        return Err(outside(number, expected));
    }
    Ok(number.into())
}

/// Declares functions for `deserialize_with`: the name of each, the expected values in words, and
/// the condition.
macro_rules! numbers {
    ($($name:ident: $expected:expr, $allowed:expr;)*) => {$(
        pub(crate) fn $name<'de, D, T>(value: D) -> Result<T, D::Error>
        where
            D: serde::Deserializer<'de>,
            T: From<f64>,
        {
            $crate::setup::keys::number(value, $expected, $allowed)
        }
    )*};
}
pub(crate) use numbers;

numbers! {
    any: "a number", |_| true;
    positive: "a number more than 0", |x| x > 0.0;
    share: "a share from 0 to 1", |x| (0.0..=1.0).contains(&x);
}

/// One number, or one for each axis of a triaxial sensor.
pub(crate) fn each<'de, D: Deserializer<'de>>(
    value: D,
    expected: &str,
    allowed: impl Fn(f64) -> bool,
) -> Result<Vec<f64>, D::Error> {
    let value = Value::deserialize(value)?;
    let numbers = match &value {
        Value::Array(_) => list::<_, 3>(&value, expected)?.to_vec(),
        one => vec![finite(one, "a number")?],
    };
    match numbers.iter().find(|x| !allowed(**x)) {
        Some(wrong) => Err(outside(wrong, expected)),
        None => Ok(numbers),
    }
}

/// Declares functions as [`numbers`] does for keys that hold one number or three.
macro_rules! lists {
    ($($name:ident: $expected:expr, $allowed:expr;)*) => {$(
        fn $name<'de, D: serde::Deserializer<'de>>(value: D) -> Result<Vec<f64>, D::Error> {
            $crate::setup::keys::each(value, $expected, $allowed)
        }
    )*};
}
pub(crate) use lists;

/// A whole number that satisfies a condition, described by `expected`.
pub(crate) fn whole<'de, D: Deserializer<'de>, T: From<u16>>(
    value: D,
    expected: impl Display,
    allowed: impl Fn(u16) -> bool,
) -> Result<T, D::Error> {
    // The cast is exact where it matters: what it would change fails the comparison.
    let is_allowed = |x: f64| f64::from(x as u16) == x && allowed(x as u16);
    let found: f64 = number(value, expected, is_allowed)?;
    Ok(T::from(found as u16))
}

fn list<E: de::Error, const N: usize>(value: &Value, expected: &str) -> Result<[f64; N], E> {
    let Value::Array(list) = value else {
        return Err(unlike(expected));
    };
    if list.len() != N {
        return Err(outside(
            format_args!("a list of {} values", list.len()),
            expected,
        ));
    }
    let mut numbers = [0.0; N];
    for (slot, item) in numbers.iter_mut().zip(list) {
        *slot = finite(item, expected)?;
    }
    Ok(numbers)
}

/// Two numbers.
pub(crate) fn pair<'de, D: Deserializer<'de>, T: From<[f64; 2]>>(value: D) -> Result<T, D::Error> {
    Ok(list(&Value::deserialize(value)?, "a list of 2 numbers")?.into())
}

/// A vector of three numbers.
pub(crate) fn vector<'de, D: Deserializer<'de>, T: From<[f64; 3]>>(
    value: D,
) -> Result<T, D::Error> {
    Ok(list(&Value::deserialize(value)?, "a list of 3 numbers")?.into())
}

/// Translation and rotation, six numbers.
pub(crate) fn motion<'de, D: Deserializer<'de>, T: From<[f64; 6]>>(
    value: D,
) -> Result<T, D::Error> {
    Ok(list(&Value::deserialize(value)?, "a list of 6 numbers")?.into())
}

/// A list of any number of vectors.
pub(crate) fn vectors<'de, D: Deserializer<'de>, T: From<Vec<[f64; 3]>>>(
    value: D,
) -> Result<T, D::Error> {
    const EXPECTED: &str = "a list of lists of 3 numbers";
    let Value::Array(all) = Value::deserialize(value)? else {
        return Err(unlike(EXPECTED));
    };
    let vectors: Result<Vec<[f64; 3]>, _> = all.iter().map(|one| list(one, EXPECTED)).collect();
    Ok(vectors?.into())
}

/// Two frequencies in Hz.
pub(crate) fn band<'de, D: Deserializer<'de>, T: From<[f64; 2]>>(value: D) -> Result<T, D::Error> {
    let [low, high]: [f64; 2] = pair(value)?;
    if low < 0.0 || high <= low {
        let expected = "two frequencies in Hz, the lower first and not negative";
        return Err(outside(format_args!("[{low}, {high}]"), expected));
    }
    Ok([low, high].into())
}

const DIRECTION: &str =
    "the axis along which it reads positive or moves, for example \"+z\" or [0, 0, 1]";

/// An axis, as a vector of unit length: a vector, or a word such as `-x`.
pub(crate) fn direction<'de, D: Deserializer<'de>, T: From<[f64; 3]>>(
    value: D,
) -> Result<T, D::Error> {
    Ok(axis(&Value::deserialize(value)?)?.into())
}

/// The three axes of a triaxial sensor.
pub(crate) fn directions<'de, D: Deserializer<'de>>(
    value: D,
) -> Result<Option<[[f64; 3]; 3]>, D::Error> {
    const EXPECTED: &str = "a list of 3 directions, such as [\"+x\", \"-y\", \"-z\"]";
    match Value::deserialize(value)? {
        Value::Array(list) => match list.as_slice() {
            [x, y, z] => Ok(Some([axis(x)?, axis(y)?, axis(z)?])),
            _ => Err(outside(
                format_args!("a list of {} values", list.len()),
                EXPECTED,
            )),
        },
        _ => Err(unlike(EXPECTED)),
    }
}

fn axis<E: de::Error>(value: &Value) -> Result<[f64; 3], E> {
    if let Value::String(word) = value {
        return along(word).ok_or_else(|| outside(format_args!("\"{}\"", quoted(word)), DIRECTION));
    }
    let found = unit(list(value, "a list of 3 numbers")?);
    found.ok_or_else(|| outside("the zero vector", DIRECTION))
}

/// The direction that a word such as `+x`, `-Z` or `y` names.
pub(crate) fn along(word: &str) -> Option<[f64; 3]> {
    let (sign, letter) = match word.strip_prefix('-') {
        Some(letter) => (-1.0, letter),
        None => (1.0, word.strip_prefix('+').unwrap_or(word)),
    };
    let axis = ["x", "y", "z"]
        .iter()
        .position(|a| letter.eq_ignore_ascii_case(a))?;
    let mut direction = [0.0; 3];
    direction[axis] = sign;
    Some(direction)
}

/// The vector at unit length, `None` for the zero vector.
///
/// A vector that is a unit vector to rounding is returned untouched, so that a setup
/// that was written and read again is bit for bit the same.
pub(crate) fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    // Scaled by the largest component first: squares of 1e-200 would vanish.
    let largest = vector.iter().fold(0.0_f64, |max, c| max.max(c.abs()));
    if largest == 0.0 {
        return None;
    }
    let square: f64 = vector.iter().map(|c| c * c).sum();
    // Three squares, two sums and the rounding of three components: below 8 ε.
    if (square - 1.0).abs() <= 8.0 * f64::EPSILON {
        return Some(vector);
    }
    let scaled = vector.map(|c| c / largest);
    let length = scaled.iter().map(|c| c * c).sum::<f64>().sqrt();
    Some(scaled.map(|c| c / length))
}

/// Text that is not blank, of one line, and shows as it stands wherever it is printed.
pub(crate) fn text<'de, D: Deserializer<'de>, T: From<String>>(value: D) -> Result<T, D::Error> {
    match Value::deserialize(value)? {
        Value::String(text) => Ok(shown(text)?.into()),
        _ => Err(unlike("text in quotes")),
    }
}

fn shown<E: de::Error>(text: String) -> Result<String, E> {
    if text.trim().is_empty() {
        return Err(outside("empty", "a name"));
    }
    if text.contains(steers) {
        let found = format_args!("the text \"{}\"", quoted(&text));
        return Err(outside(
            found,
            "text of one line without control characters",
        ));
    }
    Ok(text)
}

/// Text that may be blank or steer a terminal, such as a tab.
pub(crate) fn plain<'de, D: Deserializer<'de>>(
    value: D,
    expected: &str,
) -> Result<String, D::Error> {
    match Value::deserialize(value)? {
        Value::String(text) => Ok(text),
        _ => Err(unlike(expected)),
    }
}

/// One text or a list of them.
pub(crate) fn texts<'de, D: Deserializer<'de>>(value: D) -> Result<Vec<String>, D::Error> {
    const EXPECTED: &str = "text in quotes, or a list of such texts";
    match Value::deserialize(value)? {
        Value::String(text) => Ok(vec![shown(text)?]),
        Value::Array(list) if list.is_empty() => Err(outside("an empty list", EXPECTED)),
        Value::Array(list) => {
            let text = |entry| match entry {
                Value::String(text) => shown(text),
                _ => Err(unlike(EXPECTED)),
            };
            list.into_iter().map(text).collect()
        }
        _ => Err(unlike(EXPECTED)),
    }
}

/// One of a few words.
pub(crate) fn word<'de, D: Deserializer<'de>, T: Copy>(
    value: D,
    words: &[(&str, T)],
) -> Result<T, D::Error> {
    let text: String = text(value)?;
    let found = words.iter().find(|(word, _)| *word == text);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let words: Vec<String> = words.iter().map(|(w, _)| format!("\"{w}\"")).collect();
        outside(format_args!("\"{}\"", quoted(&text)), words.join(" or "))
    })
}

/// A table of numbers under names of the user's.
pub(crate) fn numbered<'de, D: Deserializer<'de>>(
    value: D,
) -> Result<BTreeMap<String, f64>, D::Error> {
    let Value::Table(table) = Value::deserialize(value)? else {
        return Err(unlike("a table"));
    };
    let number = |(name, value)| Ok((name, finite(&value, "a number")?));
    table.into_iter().map(number).collect()
}
