//! NASTRAN: the bulk data entry `CONM2` in large fields.
//!
//! A large field has sixteen characters, of which a number with sign and exponent leaves twelve
//! digits or so: `-1.23456789012-5`. The exponent has no letter, as the format allows, which
//! makes room for one digit more.

use super::body::Body;
use super::{Export, ExportError, Form, Kind, View};
use crate::result::ResultDocument;
use std::io::Write;

/// The format `nastran`. `I21` and its like are `∫ x y dm`, whose minus sign in the matrix is
/// NASTRAN's own.
#[derive(Debug)]
pub(super) struct Nastran;

/// Characters of a large field.
const FIELD: usize = 16;
/// Share by which a number in a large field may differ: half of the last of ten digits, which is
/// what sign and an exponent of three digits leave.
const ROUNDING: f64 = 0.5e-9;

impl Export for Nastran {
    fn form(&self) -> Form {
        Form {
            name: "nastran",
            description: "NASTRAN: `CONM2*` in the basic coordinate system, offset from the grid point; `I21` is +∫ x y dm",
            extension: "bdf",
            kind: Kind::Element,
        }
    }

    fn write(
        &self,
        result: &ResultDocument,
        view: &View,
        out: &mut dyn Write,
    ) -> Result<(), ExportError> {
        let body = Body::of(result, view)?;
        let (grid, element) = identifiers(view);
        for remark in Body::remarks(result, view) {
            for line in wrapped(&remark) {
                writeln!(out, "$ {line}")?;
            }
        }
        let signs = "I21, I31, I32 are the integrals of x y dm, x z dm, y z dm with a plus sign; NASTRAN itself enters them into the matrix with a minus sign";
        let place = format!(
            "grid point {grid} has to lie at that origin, CID 0 to have those axes; X1, X2, X3 lead from the grid point to the centre of gravity"
        );
        for line in wrapped(&place).into_iter().chain(wrapped(signs)) {
            writeln!(out, "$ {line}")?;
        }
        let [x, y, z] = body.centre.map(field);
        let [xx, yy, zz, xy, xz, yz] = body.inertia.map(field);
        let (mass, blank) = (field(body.mass), String::new());
        let whole = |number: u32| number.to_string();
        let lines: [(&str, [String; 4]); 4] = [
            ("CONM2*", [whole(element), whole(grid), whole(0), mass]),
            ("*", [x, y, z, blank.clone()]),
            // I11, I21, I22, I31, then I32, I33.
            ("*", [xx, xy, yy, xz]),
            ("*", [yz, zz, blank.clone(), blank]),
        ];
        for (name, fields) in lines {
            let line = fields.map(|text| format!("{text:>FIELD$}")).concat();
            writeln!(out, "{}", format!("{name:<8}{line}").trim_end())?;
        }
        Ok(())
    }

    fn compare(&self, result: &ResultDocument, view: &View, bytes: &[u8]) -> Result<(), String> {
        let was = Body::of(result, view).map_err(|e| e.to_string())?;
        let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
        let mut fields = Vec::new();
        for line in text.lines().filter(|line| !line.starts_with('$')) {
            let head = ["CONM2*", "*"][usize::from(!fields.is_empty())];
            if line.get(..8).map(str::trim_end) != Some(head) {
                return Err(format!("the line `{line}`"));
            }
            for place in 0..4 {
                let from = 8 + FIELD * place;
                let to = line.len().min(from + FIELD);
                fields.push(line.get(from..to).unwrap_or("").trim());
            }
        }
        let (grid, element) = identifiers(view);
        if fields.len() != 16 || fields[..3] != [&*element.to_string(), &*grid.to_string(), "0"] {
            return Err("the identifiers".to_owned());
        }
        let number = |k: usize| read(fields[k]).ok_or_else(|| format!("field `{}`", fields[k]));
        let of = |places: [usize; 6]| -> Result<[f64; 6], String> {
            let mut values = [0.0; 6];
            for (value, place) in values.iter_mut().zip(places) {
                *value = number(place)?;
            }
            Ok(values)
        };
        let is = Body {
            mass: number(3)?,
            centre: [number(4)?, number(5)?, number(6)?],
            inertia: of([8, 10, 13, 9, 11, 12])?,
        };
        was.difference(&is, ROUNDING)
    }
}

/// Grid point and element.
fn identifiers(view: &View) -> (u32, u32) {
    (view.grid.unwrap_or(1), view.element.unwrap_or(1))
}

/// A real number in at most sixteen characters, with as many digits as they hold.
fn field(value: f64) -> String {
    if value == 0.0 {
        return "0.0".to_owned();
    }
    let shortest = format!("{value:?}");
    if shortest.len() <= FIELD && !shortest.contains('e') {
        return shortest;
    }
    // Seventeen digits are all that a number has.
    for digits in (0..17).rev() {
        let text = format!("{value:.digits$e}");
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        let point = if mantissa.contains('.') { "" } else { "." };
        let sign = if exponent.starts_with('-') { "" } else { "+" };
        let text = format!("{mantissa}{point}{sign}{exponent}");
        if text.len() <= FIELD {
            return text;
        }
    }
    shortest
}

/// A real number as NASTRAN reads it: the exponent may stand without a letter.
fn read(text: &str) -> Option<f64> {
    if text.contains(['e', 'E', 'd', 'D']) {
        return text.replace(['d', 'D'], "e").parse().ok();
    }
    let sign = text.get(1..)?.rfind(['+', '-']).map(|place| place + 1);
    match sign {
        Some(place) => format!("{}e{}", &text[..place], &text[place..])
            .parse()
            .ok(),
        None => text.parse().ok(),
    }
}

/// A remark in lines of at most 70 characters, all of them ASCII.
fn wrapped(remark: &str) -> Vec<String> {
    let plain: String = remark
        .chars()
        .map(|c| if c.is_ascii() { c } else { '?' })
        .collect();
    let mut lines = vec![String::new()];
    for word in plain.split_whitespace() {
        if let Some(line) = lines.last_mut() {
            if line.is_empty() || line.len() + word.len() < 70 {
                if !line.is_empty() {
                    line.push(' ');
                }
                line.push_str(word);
            } else {
                lines.push(word.to_owned());
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn fields_have_the_form_of_the_format() {
        for (value, text) in [
            (0.0, "0.0"),
            (-0.0, "0.0"),
            (1.0, "1.0"),
            (812.5, "812.5"),
            (-1.234_567_890_123_456_7e-5, "-1.23456789012-5"),
            (1e22, "1.0+22"),
            (std::f64::consts::PI, "3.1415926535898+0"),
        ] {
            let field = field(value);
            assert!(field.len() <= FIELD, "{field}");
            assert!((read(&field).unwrap() - value).abs() <= ROUNDING * value.abs());
            if field.len() < FIELD || value == -1.234_567_890_123_456_7e-5 {
                assert_eq!(field, text);
            }
        }
    }

    proptest! {
        #[test]
        fn every_number_fits_a_field(value in proptest::num::f64::NORMAL | proptest::num::f64::ZERO) {
            let field = field(value);
            prop_assert!(field.len() <= FIELD && field.contains('.'), "{field}");
            let back = read(&field).unwrap();
            prop_assert!((back - value).abs() <= ROUNDING * value.abs(), "{value} {field} {back}");
        }
    }
}
