//! The data of a set of dataset 58, number by number.

use super::header::Header;
use super::scan::{Lines, Set, is_delimiter};
use crate::printable::quoted;
use crate::recording::bytes::{Bytes, Part as Bits};
use crate::recording::columns::Series;
use crate::recording::number::{Coding, Kind};
use crate::recording::{Place, RecordingError};
use std::io::Read;
use std::rc::Rc;

/// The part of the points of a set that is a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Part {
    Abscissa,
    /// The ordinate, or its real part.
    Ordinate,
    Imaginary,
}

/// Opens a part of a set. The abscissae of a set that has its own have to be those of the set
/// `shared`.
pub(super) fn open(
    bytes: &Rc<Bytes>,
    set: &Set,
    channel: &str,
    part: Part,
    shared: Option<&Set>,
) -> Result<Box<dyn Series>, RecordingError> {
    if part == Part::Abscissa && set.header.even {
        let header = set.header.clone();
        return Ok(Box::new(Even { header, next: 0 }));
    }
    let shared = shared.filter(|shared| shared.line != set.line);
    let shared = shared
        .map(|shared| Pairs::new(bytes, shared, channel))
        .transpose()?;
    Ok(Box::new(Points {
        pairs: Pairs::new(bytes, set, channel)?,
        shared,
        part,
    }))
}

/// Abscissae of an even set.
struct Even {
    header: Header,
    next: u64,
}

impl Series for Even {
    fn next(&mut self) -> Result<f64, RecordingError> {
        self.next += 1;
        Ok(self.header.even_abscissa(self.next - 1))
    }
}

struct Points {
    pairs: Pairs,
    shared: Option<Pairs>,
    part: Part,
}

impl Series for Points {
    fn next(&mut self) -> Result<f64, RecordingError> {
        let [x, y, imaginary] = self.pairs.next()?;
        if let Some(shared) = &mut self.shared {
            let expected = shared.next()?[0];
            if x != expected {
                let found = format!("abscissa {x}");
                let expected = format!("{expected} as the first dataset 58 has it");
                return Err(self.pairs.wrong(found, expected));
            }
        }
        Ok(match self.part {
            Part::Abscissa => x,
            Part::Ordinate => y,
            Part::Imaginary => imaginary,
        })
    }
}

/// Abscissae, zero where they are even, and ordinates with their imaginary parts.
struct Pairs {
    bytes: Rc<Bytes>,
    channel: String,
    even: bool,
    complex: bool,
    points: u64,
    next: u64,
    data: Data,
}

enum Data {
    Text {
        lines: Lines,
        line: Vec<u8>,
        at: usize,
    },
    Binary {
        part: Bits,
        abscissa: Coding,
        ordinate: Coding,
    },
}

impl Pairs {
    fn new(bytes: &Rc<Bytes>, set: &Set, channel: &str) -> Result<Self, RecordingError> {
        let [at, end] = set.data;
        let header = &set.header;
        let data = match set.binary {
            None => Data::Text {
                lines: Lines::new(bytes, set.data, set.data_line),
                line: Vec::new(),
                at: 0,
            },
            Some(big) => {
                let of = |double: bool| Coding {
                    kind: if double { Kind::F64 } else { Kind::F32 },
                    big,
                };
                // Abscissae have single precision; some programs write them as the ordinates.
                let wide = 8 + if header.is_complex() { 16 } else { 8 };
                let wide = header.is_double() && (end - at) / header.points >= wide;
                Data::Binary {
                    part: bytes.part(at, end),
                    abscissa: of(wide),
                    ordinate: of(header.is_double()),
                }
            }
        };
        Ok(Self {
            bytes: Rc::clone(bytes),
            channel: channel.to_owned(),
            even: header.even,
            complex: header.is_complex(),
            points: header.points,
            next: 0,
            data,
        })
    }

    fn next(&mut self) -> Result<[f64; 3], RecordingError> {
        let x = if self.even { 0.0 } else { self.number(true)? };
        let y = self.number(false)?;
        let imaginary = if self.complex {
            self.number(false)?
        } else {
            0.0
        };
        self.next += 1;
        if self.next == self.points {
            self.end()?;
        }
        Ok([x, y, imaginary])
    }

    fn place(&self) -> Place {
        match &self.data {
            Data::Text { lines, .. } => Place::Line(lines.number),
            Data::Binary { part, .. } => Place::Byte(part.at),
        }
    }

    fn wrong(&self, found: impl Into<String>, expected: impl Into<String>) -> RecordingError {
        self.bytes
            .malformed(self.place(), &self.channel, found, expected)
    }

    fn number(&mut self, of_abscissa: bool) -> Result<f64, RecordingError> {
        let text = match &mut self.data {
            Data::Binary {
                part,
                abscissa,
                ordinate,
            } => {
                let coding = if of_abscissa { abscissa } else { ordinate };
                let mut raw = [0; 8];
                let raw = raw.get_mut(..coding.kind.size()).unwrap_or(&mut []);
                let at = part.at;
                return match part.read_exact(raw) {
                    Ok(()) => Ok(coding.value(raw)),
                    Err(e) => Err(self.bytes.damaged(at, &e)),
                };
            }
            Data::Text { lines, line, at } => loop {
                if let Some((length, end)) = token(line.get(*at..).unwrap_or(&[])) {
                    let begin = *at + end - length;
                    *at += end;
                    break line.get(begin..*at).unwrap_or(&[]);
                }
                match lines.next()? {
                    Some(next) if !is_delimiter(next) => {
                        line.clear();
                        line.extend_from_slice(next);
                        *at = 0;
                    }
                    _ => {
                        let found = format!("the data end behind {} points", self.next);
                        let expected = format!("{} points", self.points);
                        return Err(self.wrong(found, expected));
                    }
                }
            },
        };
        let Some(number) = real(text) else {
            let shown = text.get(..40).unwrap_or(text);
            let found = format!("`{}`", quoted(&String::from_utf8_lossy(shown)));
            return Err(self.wrong(found, "a number"));
        };
        Ok(number)
    }

    /// Looks at the data behind the last point: blanks, or zeros that fill the last line.
    fn end(&mut self) -> Result<(), RecordingError> {
        let Data::Text { lines, line, at } = &mut self.data else {
            return Ok(());
        };
        let mut full = true;
        while let Some((length, end)) = token(line.get(*at..).unwrap_or(&[])) {
            let begin = *at + end - length;
            *at += end;
            full &= line.get(begin..*at).and_then(real) == Some(0.0);
        }
        let mut more = false;
        while let Some(next) = lines.next()?
            && !is_delimiter(next)
        {
            more |= !next.is_empty();
        }
        if full && !more {
            return Ok(());
        }
        let expected = format!("{} points", self.points);
        Err(self.wrong("there are more numbers", expected))
    }
}

/// The next number of a line, as its length and the place behind it: fields touch where the sign
/// of one is in the first column.
fn token(line: &[u8]) -> Option<(usize, usize)> {
    let blank = line
        .iter()
        .take_while(|byte| byte.is_ascii_whitespace())
        .count();
    let text = line.get(blank..).filter(|text| !text.is_empty())?;
    let mut end = text.len();
    let mut exponent = false;
    for (k, byte) in text.iter().enumerate().skip(1) {
        let before = text.get(k - 1).copied().unwrap_or(0);
        match byte {
            b' ' | b'\t' | b'\r' => {
                end = k;
                break;
            }
            b'e' | b'E' | b'd' | b'D' => exponent = true,
            b'+' | b'-' if !b"eEdD".contains(&before) => {
                // Without a letter the first sign is that of an exponent of three digits, which
                // no column is left for one in front of.
                let digits = text.get(k + 1..).unwrap_or(&[]);
                let digits = digits.iter().take_while(|b| b.is_ascii_digit()).count();
                let follows = text.get(k + 1 + digits);
                if !exponent && digits == 3 && follows != Some(&b'.') {
                    exponent = true;
                } else {
                    end = k;
                    break;
                }
            }
            _ => {}
        }
    }
    Some((end, blank + end))
}

/// A number as Fortran and C print it: `1.5`, `1.5E-03`, `1.5D-03`, `1.5-103`.
fn real(text: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(text).ok()?;
    if let Ok(number) = text.parse() {
        return Some(number);
    }
    let letter = text.replace(['d', 'D'], "e");
    if let Ok(number) = letter.parse() {
        return Some(number);
    }
    let at = text.rfind(['+', '-']).filter(|at| *at > 0)?;
    let (digits, exponent) = text.split_at_checked(at)?;
    format!("{digits}e{exponent}").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_a_line_may_touch() {
        let numbers = |line: &str| -> Vec<f64> {
            let (line, mut at, mut all) = (line.as_bytes(), 0, Vec::new());
            while let Some((length, end)) = token(&line[at..]) {
                at += end;
                all.push(real(&line[at - length..at]).unwrap());
            }
            all
        };
        assert_eq!(
            numbers("-1.23456E+00-2.00000E-01 3.00000E+00  "),
            [-1.23456, -0.2, 3.0]
        );
        assert_eq!(numbers(" 1.5D-03-1.5d+02"), [1.5e-3, -150.0]);
        assert_eq!(numbers("-1.23456-103 1.00000+100"), [-1.23456e-103, 1e100]);
        assert_eq!(numbers("-1.23456E-103-2.0E+001"), [-1.23456e-103, -20.0]);
        assert_eq!(numbers("1.5 -2 0.25\t7"), [1.5, -2.0, 0.25, 7.0]);
        assert_eq!(numbers(""), [0.0; 0]);
    }
}
