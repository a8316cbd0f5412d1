//! The eleven lines above the data of dataset 58.

use crate::printable::printable;

/// Number at the beginning of a line that is one of a dataset, behind the delimiter: `58`, `58b`.
pub(super) fn number(line: &[u8]) -> Option<u32> {
    let line = line.trim_ascii_start();
    let digits = line.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let sound = (1..=6).contains(&digits);
    let rest = line.get(digits..)?;
    let ends = rest
        .first()
        .is_none_or(|b| b.is_ascii_whitespace() || *b == b'b');
    let digits = std::str::from_utf8(line.get(..digits)?).ok()?;
    digits.parse().ok().filter(|_| sound && ends)
}

/// Records 1 to 11.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Header {
    /// ID line 1, unless it says nothing.
    pub(super) description: Option<String>,
    /// ID line 4, unless it says nothing.
    pub(super) remark: Option<String>,
    pub(super) function: i64,
    pub(super) response: Point,
    /// The point that a response is referred to.
    pub(super) reference: Point,
    /// 2 and 4 for real, 5 and 6 for complex numbers; 4 and 6 have double precision.
    pub(super) ordinate: i64,
    pub(super) points: u64,
    pub(super) even: bool,
    start: f64,
    /// Distance of two abscissae, in the unit of the abscissa.
    pub(super) step: f64,
    pub(super) abscissa_type: i64,
    /// Specific data type, exponents of length, force and temperature, and label of the unit, of
    /// the ordinate.
    pub(super) quantity: i64,
    pub(super) exponents: [i64; 3],
    pub(super) unit: Option<String>,
    /// The same of the quantity that the ordinate is divided by; `None` where it is not given.
    pub(super) denominator: Option<(i64, [i64; 3], Option<String>)>,
}

/// A node, and the direction at it: 1 to 3 along, 4 to 6 about x, y and z.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Point {
    entity: Option<String>,
    pub(super) node: i64,
    direction: i64,
}

/// A part of a header that cannot be read: number of its line from one, the part, what was found
/// and what was expected.
pub(super) type Wrong = (u64, String, &'static str);

impl Header {
    pub(super) const LINES: usize = 11;

    pub(super) fn read(lines: &[String]) -> Result<Self, Wrong> {
        let line = |n: usize| lines.get(n - 1).map_or("", String::as_str);
        let wrong = |n: usize, expected| (n as u64, shown(line(n)), expected);
        let point = line(6);
        let columns = |from: usize, to: usize| -> String {
            point.chars().skip(from).take(to - from).collect()
        };
        let whole = |text: String| text.trim().parse::<i64>().ok();
        let identity = "function type and, from column 42 on, node and direction of the response";
        let function = whole(columns(0, 5)).ok_or_else(|| wrong(6, identity))?;
        // Files that do not keep to columns have ten fields between blanks.
        let fields: Vec<&str> = point.split_whitespace().collect();
        let by_columns = |from: usize| {
            let numbers =
                whole(columns(from + 10, from + 20)).zip(whole(columns(from + 20, from + 24)));
            numbers.map(|(n, d)| (columns(from, from + 10), n, d))
        };
        let by_fields = |from: usize| match fields.get(from..)? {
            [entity, node, direction, ..] => {
                let numbers = node.parse().ok().zip(direction.parse().ok());
                numbers.map(|(node, direction)| ((*entity).to_owned(), node, direction))
            }
            _ => None,
        };
        let at = |column, field| {
            let found = by_columns(column).or_else(|| by_fields(field));
            found.map(|(entity, node, direction)| Point {
                entity: given(&entity),
                node,
                direction,
            })
        };
        let response = at(31, 4).ok_or_else(|| wrong(6, identity))?;
        let reference = at(56, 7).unwrap_or_default();

        let form = "kind of number, number of points, spacing, first abscissa and step";
        let mut fields = line(7).split_whitespace();
        let mut next = || fields.next().ok_or_else(|| wrong(7, form));
        let whole = |text: &str| text.parse::<i64>().map_err(|_| wrong(7, form));
        let real = |text: &str| {
            let text = text.replace(['d', 'D'], "e");
            text.parse::<f64>()
                .ok()
                .filter(|x| x.is_finite())
                .ok_or_else(|| wrong(7, form))
        };
        let ordinate = whole(next()?)?;
        let points = whole(next()?)?;
        let even = whole(next()?)? != 0;
        let (start, step) = (real(next()?)?, real(next()?)?);
        let points = u64::try_from(points).ok().filter(|n| *n > 0);
        let points = points.ok_or_else(|| wrong(7, "at least one point"))?;
        if even && step <= 0.0 {
            return Err(wrong(7, "a step of more than 0"));
        }
        if ![2, 4, 5, 6].contains(&ordinate) {
            return Err(wrong(7, "a kind of number: 2, 4, 5 or 6"));
        }
        let axis = |n: usize| {
            let form = "specific data type and exponents of an axis";
            let mut fields = line(n).split_whitespace();
            let mut next = || {
                let field = fields.next().and_then(|field| field.parse::<i64>().ok());
                field.ok_or_else(|| wrong(n, form))
            };
            let quantity = next()?;
            let exponents = [next()?, next()?, next()?];
            let unit: String = line(n).chars().skip(47).take(20).collect();
            Ok((quantity, exponents, given(&unit)))
        };
        let (abscissa_type, _, _) = axis(8)?;
        let (quantity, exponents, unit) = axis(9)?;
        let denominator = axis(10).ok();
        Ok(Self {
            description: given(line(1)),
            remark: given(line(4)),
            function,
            response,
            reference,
            ordinate,
            points,
            even,
            start,
            step,
            abscissa_type,
            quantity,
            exponents,
            unit,
            denominator,
        })
    }

    /// `true` if it is of real samples over time: by its type, or where this is not given by its
    /// abscissa.
    pub(super) fn is_time_history(&self) -> bool {
        let over_time = self.abscissa_type == 17;
        let function = self.function == 1 || (self.function == 0 && over_time);
        function && !self.is_complex() && (over_time || self.abscissa_type == 0)
    }

    /// `true` if it is of complex responses over frequency: frequency responses, transmissibilities
    /// or spectra.
    pub(super) fn is_response(&self) -> bool {
        let over_frequency = matches!(self.abscissa_type, 0 | 18);
        matches!(self.function, 4 | 5 | 12) && self.is_complex() && over_frequency
    }

    pub(super) fn is_complex(&self) -> bool {
        self.ordinate >= 5
    }

    pub(super) fn is_double(&self) -> bool {
        matches!(self.ordinate, 4 | 6)
    }

    /// Number of points, and of even ones the bits of the first abscissa and of the step: the
    /// channels of one recording share them.
    pub(super) fn abscissa(&self) -> (u64, Option<[u64; 2]>) {
        let even = [self.start.to_bits(), self.step.to_bits()];
        (self.points, self.even.then_some(even))
    }

    pub(super) fn described(&self) -> String {
        if self.even {
            let Self {
                points,
                start,
                step,
                ..
            } = self;
            let unit = if self.is_complex() { "Hz" } else { "s" };
            format!("{points} points every {step} {unit} from {start} {unit} on")
        } else {
            format!("{} points with an abscissa each", self.points)
        }
    }

    /// Abscissa of a point of an even set, counted from zero.
    pub(super) fn even_abscissa(&self, number: u64) -> f64 {
        self.start + number as f64 * self.step
    }
}

impl Point {
    /// `12:+Z`, `wing:12:+Z`, `12` for a scalar; `None` without a node.
    pub(super) fn name(&self) -> Option<String> {
        const AXES: [&str; 6] = ["X", "Y", "Z", "RX", "RY", "RZ"];
        if self.node == 0 {
            return None;
        }
        let entity = self
            .entity
            .as_ref()
            .map_or_else(String::new, |e| format!("{e}:"));
        let axis = usize::try_from(self.direction.unsigned_abs()).ok();
        let axis = axis.and_then(|a| AXES.get(a.checked_sub(1)?));
        let sign = if self.direction < 0 { '-' } else { '+' };
        let direction = axis.map_or_else(String::new, |axis| format!(":{sign}{axis}"));
        Some(format!("{entity}{}{direction}", self.node))
    }

    /// Direction of a translation as a unit vector.
    pub(super) fn direction(&self) -> Option<[f64; 3]> {
        let sign = self.direction.signum() as f64;
        match self.direction.abs() {
            1 => Some([sign, 0.0, 0.0]),
            2 => Some([0.0, sign, 0.0]),
            3 => Some([0.0, 0.0, sign]),
            _ => None,
        }
    }
}

/// A text, unless it says nothing.
fn given(text: &str) -> Option<String> {
    let text = text.trim();
    let says = !text.is_empty() && !text.eq_ignore_ascii_case("none") && text != "0";
    says.then(|| printable(text).into_owned())
}

/// The beginning of a line, for a message.
pub(super) fn shown(line: &str) -> String {
    let start: String = line.trim().chars().take(60).collect();
    format!("`{}`", printable(&start))
}
