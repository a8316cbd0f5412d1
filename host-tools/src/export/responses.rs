//! Frequency responses and apparent masses as universal file, datasets 58.
//!
//! Responses are those of the resultants at A to the drive, run by run. The apparent mass is solved
//! line by line from all runs of a group, where six or more of them excite all directions. Both are
//! along the axes of the sensors. Numbers have thirteen digits, which is more than spectra in single
//! precision have; the step of evenly spaced lines has six, as the format wants it.

use super::ExportError;
use crate::identification::Answer;
use crate::measure::{Group, RunGeometry};
use crate::printable::printable;
use massline_core::geometry::RESULTANTS;
use massline_core::masslines::Moments;
use nalgebra::{Complex, Matrix6};
use std::fmt::Write as _;

/// Share of a resultant that has to be measured.
const WHOLE: f64 = 0.99;
const NAMES: [&str; RESULTANTS] = [
    "ax", "ay", "az", "alpha", "beta", "gamma", "fx", "fy", "fz", "tx", "ty", "tz",
];
/// Specific data types of the format.
const UNKNOWN: u8 = 0;
const ACCELERATION: u8 = 12;
const FORCE: u8 = 13;
/// Readings of real and imaginary part on a line.
const IN_A_LINE: usize = 4;

/// One dataset 58.
#[derive(Clone, Debug, PartialEq)]
struct Set {
    /// The five lines of text; what stands in them is not read back.
    name: String,
    run: String,
    response: usize,
    /// The acceleration that the response is referred to; the drive if `None`.
    reference: Option<usize>,
    frequencies: Vec<f64>,
    values: Vec<Complex<f64>>,
}

/// Frequency responses of an answer; each set is read again and compared.
///
/// # Errors
/// [`ExportError::Unsuitable`] if no run has responses, [`ExportError::Differs`].
pub fn responses(answer: &Answer, title: &str) -> Result<Vec<u8>, ExportError> {
    let mut sets = Vec::new();
    let measurement = &answer.measurement;
    for run in &measurement.runs {
        let Some(responses) = run.responses() else {
            continue;
        };
        let grid = responses.grid;
        let lines = 0..responses.responses.len();
        let frequencies: Vec<f64> = lines.map(|k| grid.frequency(k)).collect();
        let value = |line: usize, c: usize| {
            let z = responses.responses[line][c];
            Complex::new(f64::from(z.re), f64::from(z.im))
        };
        add(&mut sets, &run.name, &run.geometry, &frequencies, value);
    }
    for run in &measurement.sines {
        let value = |line: usize, c: usize| run.responses[line][c];
        add(&mut sets, &run.name, &run.geometry, &run.frequencies, value);
    }
    for (number, group) in measurement.groups().iter().enumerate() {
        let whole = answer.fits.get(number).is_some_and(|fit| fit.excited == 6);
        if whole && group.names().len() >= 6 {
            sets.extend(apparent_masses(group));
        }
    }
    if sets.is_empty() {
        return Err(ExportError::Unsuitable {
            reason: "no run has frequency responses: name the generator's signal by `reference` in [[run]], or record stepped sines".to_owned(),
        });
    }
    let title = printable(title);
    let text: String = sets.iter().map(|set| set.text(&title)).collect();
    let read = read(&text).ok_or_else(|| ExportError::Differs {
        difference: "a dataset cannot be read".to_owned(),
    })?;
    if read.len() != sets.len() {
        let difference = format!("{} datasets, not {}", read.len(), sets.len());
        return Err(ExportError::Differs { difference });
    }
    for (set, numbers) in sets.iter().zip(&read) {
        let values = set.values.iter().flat_map(|z| [z.re, z.im]);
        let sound = values.clone().count() == numbers.len()
            // Half of the last of thirteen digits.
            && values.zip(numbers).all(|(was, is)| (is - was).abs() <= 0.5e-12 * was.abs());
        if !sound {
            let difference = format!("{}, run {}", set.name, set.run);
            return Err(ExportError::Differs { difference });
        }
    }
    Ok(text.into_bytes())
}

fn add(
    sets: &mut Vec<Set>,
    run: &str,
    geometry: &RunGeometry,
    frequencies: &[f64],
    value: impl Fn(usize, usize) -> Complex<f64>,
) {
    for (response, name) in NAMES.iter().enumerate() {
        if measured(geometry, response) {
            let values = (0..frequencies.len()).map(|line| value(line, response));
            sets.push(Set {
                name: format!("{name} per drive"),
                run: run.to_owned(),
                response,
                reference: None,
                frequencies: frequencies.to_vec(),
                values: values.collect(),
            });
        }
    }
}

/// `true` if the sensors tell all of a resultant.
fn measured(geometry: &RunGeometry, resultant: usize) -> bool {
    match resultant.checked_sub(6) {
        None => geometry.determined()[resultant] > WHOLE,
        Some(force) => geometry.equations.measured(force) > WHOLE,
    }
}

/// Entries of the apparent mass that the runs of a group tell; none where a line has no inverse.
fn apparent_masses(group: &Group<'_>) -> Vec<Set> {
    let solved = group.read(None, |lines| {
        let solve = |line: usize| -> Option<(f64, Matrix6<Complex<f64>>)> {
            let mut moments = Moments::default();
            for run in 0..lines.runs() {
                lines.add_moments(run, line, 1.0, &mut moments);
            }
            Some((
                lines.frequency(line),
                moments.fa * moments.aa.try_inverse()?,
            ))
        };
        (0..lines.count()).map(solve).collect::<Option<Vec<_>>>()
    });
    let Ok(Some(lines)) = solved else {
        return Vec::new();
    };
    let geometry = group.geometry();
    let known = |c: usize| measured(geometry, c);
    if !(0..6).all(known) {
        return Vec::new();
    }
    let rows = (0..6).filter(|row| known(6 + row));
    let entries = rows.flat_map(|row| (0..6).map(move |column| (row, column)));
    let set = |(row, column): (usize, usize)| Set {
        name: format!("apparent mass {} per {}", NAMES[6 + row], NAMES[column]),
        run: "all".to_owned(),
        response: 6 + row,
        reference: Some(column),
        frequencies: lines.iter().map(|(f, _)| *f).collect(),
        values: lines.iter().map(|(_, m)| m[(row, column)]).collect(),
    };
    entries.map(set).collect()
}

/// A number with an exponent of two digits and more, as FORTRAN has it.
fn scientific(value: f64, decimals: usize, width: usize) -> String {
    let text = format!("{value:.decimals$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let (sign, digits) = match exponent.strip_prefix('-') {
        Some(digits) => ('-', digits),
        None => ('+', exponent),
    };
    format!("{:>width$}", format!("{mantissa}E{sign}{digits:0>2}"))
}

/// Specific data type, exponent of length, label and unit of a resultant.
fn quantity(resultant: Option<usize>) -> (u8, u8, &'static str, &'static str) {
    match resultant {
        None => (UNKNOWN, 0, "drive", "NONE"),
        Some(0..3) => (ACCELERATION, 0, "acceleration", "m/s^2"),
        Some(3..6) => (ACCELERATION, 0, "angular acceleration", "rad/s^2"),
        Some(6..9) => (FORCE, 0, "force", "N"),
        Some(_) => (FORCE, 1, "moment", "N m"),
    }
}

impl Set {
    /// The dataset as text: its lines of text, six records of its form, its numbers.
    fn text(&self, title: &str) -> String {
        let ascii = |text: &str, most: usize| -> String {
            let plain = text
                .chars()
                .map(|c| if c.is_ascii_graphic() { c } else { ' ' });
            let plain: String = plain.take(most).collect();
            let plain = plain.trim().to_owned();
            if plain.is_empty() {
                "NONE".to_owned()
            } else {
                plain
            }
        };
        let step = self.step();
        let first = self.frequencies.first().copied().unwrap_or(0.0);
        let spacing = u8::from(step.is_some());
        // Translations are directions 1 to 3, rotations 4 to 6, of node 1, which is A.
        let direction = |resultant: usize| resultant % 6 + 1;
        let (node, of) = self.reference.map_or((0, 0), |c| (1, direction(c)));
        let mut out = String::from("    -1\n    58\n");
        for line in [
            &*self.name,
            &format!("of {title}"),
            "NONE",
            &format!("run {}", self.run),
            "at A, axes of the sensors, SI",
        ] {
            let _ = writeln!(out, "{}", ascii(line, 80));
        }
        // Frequency response function.
        let _ = writeln!(
            out,
            "{:5}{:10}{:5}{:10} {:<10}{:10}{:4} {:<10}{:10}{:4}",
            4,
            0,
            0,
            0,
            "NONE",
            1,
            direction(self.response),
            "NONE",
            node,
            of
        );
        // Complex numbers of double precision.
        let [start, step, z] = [first, step.unwrap_or(0.0), 0.0].map(|x| scientific(x, 5, 13));
        let count = self.values.len();
        let _ = writeln!(out, "{:10}{count:10}{spacing:10}{start}{step}{z}", 6);
        let axes = [
            (18, 0, "Frequency", "Hz"),
            quantity(Some(self.response)),
            quantity(self.reference),
            (UNKNOWN, 0, "NONE", "NONE"),
        ];
        for (kind, length, label, unit) in axes {
            let _ = writeln!(
                out,
                "{kind:10}{length:5}{:5}{:5} {label:<20} {unit:<20}",
                0, 0
            );
        }
        let number = |x: f64| scientific(x, 12, 20);
        if spacing == 1 {
            let all: Vec<String> = self
                .values
                .iter()
                .flat_map(|z| [number(z.re), number(z.im)])
                .collect();
            for line in all.chunks(IN_A_LINE) {
                let _ = writeln!(out, "{}", line.concat());
            }
        } else {
            for (f, z) in self.frequencies.iter().zip(&self.values) {
                let _ = writeln!(
                    out,
                    "{}{}{}",
                    scientific(*f, 5, 13),
                    number(z.re),
                    number(z.im)
                );
            }
        }
        out.push_str("    -1\n");
        out
    }

    /// Distance of evenly spaced lines, Hz.
    fn step(&self) -> Option<f64> {
        let [first, second, ..] = self.frequencies[..] else {
            return None;
        };
        let step = second - first;
        let even = |(k, f): (usize, &f64)| (f - first - k as f64 * step).abs() <= 1e-9 * f.abs();
        self.frequencies
            .iter()
            .enumerate()
            .all(even)
            .then_some(step)
    }
}

/// Real and imaginary parts of each dataset; `None` where a text is no such file.
fn read(text: &str) -> Option<Vec<Vec<f64>>> {
    let mut lines = text.lines();
    let mut sets = Vec::new();
    while let Some(line) = lines.next() {
        if line != "    -1" || lines.next()? != "    58" {
            return None;
        }
        let form: Vec<&str> = lines.nth(6)?.split_whitespace().collect();
        let (count, even): (usize, usize) =
            (form.get(1)?.parse().ok()?, form.get(2)?.parse().ok()?);
        // Four axes stand before the numbers.
        let mut rest = lines.by_ref().skip(4);
        let mut numbers = Vec::new();
        while numbers.len() < 2 * count {
            let mut line = rest.next()?;
            if even == 0 {
                line = line.get(13..)?;
            }
            for at in (0..line.len()).step_by(20) {
                numbers.push(line.get(at..at + 20)?.trim().parse().ok()?);
            }
        }
        if rest.next()? != "    -1" {
            return None;
        }
        sets.push(numbers);
    }
    Some(sets)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_form_of_fortran() {
        assert_eq!(scientific(0.5, 5, 13), "  5.00000E-01");
        assert_eq!(scientific(-1.5e-123, 12, 20), "-1.500000000000E-123");
        assert_eq!(scientific(0.0, 12, 20), "  0.000000000000E+00");
    }

    #[test]
    fn even_and_uneven_lines_are_read_again() {
        let set = |frequencies: Vec<f64>| Set {
            name: "ax per drive".to_owned(),
            run: "é \n    -1".to_owned(),
            response: 4,
            reference: Some(2),
            values: frequencies
                .iter()
                .map(|f| Complex::new(1.0 / f, -f * f))
                .collect(),
            frequencies,
        };
        let even = set(vec![0.5, 1.0, 1.5]);
        let uneven = set(vec![0.5, 1.0, 2.5]);
        assert_eq!((even.step(), uneven.step()), (Some(0.5), None));
        let read = read(&(even.text("t") + &uneven.text("t"))).unwrap();
        assert_eq!(read[0], [2.0, -0.25, 1.0, -1.0, 0.666_666_666_666_7, -2.25]);
        assert_eq!(read[1], [2.0, -0.25, 1.0, -1.0, 0.4, -6.25]);
        let cut = even.text("t");
        assert_eq!(super::read(&cut[..cut.len() - 10]), None);
    }
}
