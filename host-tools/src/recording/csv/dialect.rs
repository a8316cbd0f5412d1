//! The dialect of a CSV file, seen from its head: delimiter, decimal sign, and the lines of names,
//! units and the first sample.
//!
//! A delimiter and a decimal sign are tried together. They fit if rows of numbers appear below a
//! line of text with as many fields; of those that fit, the one with the most columns is taken.

use super::decode;
use super::stamp::{Stamp, is_date};
use crate::printable::quoted;
use crate::recording::form::{DELIMITERS, Form, delimiter_name};
use crate::recording::{Place, RecordingError, faults};
use csv::{ByteRecord, ReaderBuilder, Trim};
use std::path::Path;

/// Bytes of a file by which its dialect is known, where its rows are short.
pub(super) const HEAD: usize = 64 << 10;

/// Bytes of the head that suffice where names stand in their first quarter, with nothing below but rows of numbers that
/// can be read in one way.
const BEGINNING: usize = 16 << 10;

/// Least number of these rows.
const CERTAIN_ROWS: usize = 16;

/// Units as they stand in a row of units, in lower case and without brackets.
const UNITS: [&str; 62] = [
    "s", "sec", "sek", "ms", "µs", "μs", "us", "hz", "khz", "g", "gn", "g_n", "m/s^2", "m/s²",
    "m/s2", "m/s/s", "m/s**2", "m/(s²)", "mm/s^2", "mm/s²", "mm/s2", "in/s^2", "in/s²", "ft/s^2",
    "ft/s²", "m/s", "mm/s", "n", "kn", "mn", "lbf", "lb", "kgf", "nm", "n m", "n·m", "n*m", "n-m",
    "n.m", "knm", "lbf in", "lbf·in", "lbf ft", "in-lb", "v", "mv", "µv", "μv", "uv", "a", "ma",
    "°c", "k", "%", "-", "m", "mm", "µm", "deg", "°", "rad", "bar",
];

/// A dialect, and the place of the names.
#[derive(Debug, PartialEq)]
pub(super) struct Dialect {
    pub(super) delimiter: u8,
    pub(super) decimal: u8,
    /// First byte and line, counted from zero, of the names.
    pub(super) start: usize,
    pub(super) line: u64,
    /// `true` if units stand in the row below the names.
    pub(super) units: bool,
    /// Column of time stamps.
    pub(super) stamps: Option<usize>,
    /// Fields of the rows without an empty one at their ends, where rows fit.
    pub(super) columns: Option<usize>,
    /// `true` if lines end in CR and LF.
    pub(super) crlf: bool,
}

/// Kind of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Numbers, dates, time stamps, faults in words and nothing else; at least one number.
    Data,
    /// Faults in words and empty fields.
    Faulty,
    /// No number.
    Text,
    /// Numbers and other text.
    Mixed,
}

/// A row of the head.
struct Row {
    record: ByteRecord,
    /// First byte and line, counted from zero.
    start: usize,
    line: u64,
}

impl Row {
    /// Number of fields without an empty one at the end, which a delimiter there makes.
    fn width(&self) -> usize {
        let last = self.record.iter().next_back();
        let ends = self.record.len() > 1 && last == Some(b"");
        self.record.len() - usize::from(ends)
    }

    fn kind(&self, decimal: u8) -> Kind {
        let (mut numbers, mut texts, mut words) = (0, 0, 0);
        for field in self.record.iter().filter(|field| !field.is_empty()) {
            if number(field, decimal).is_some() {
                numbers += 1;
                continue;
            }
            // A time has a colon, a date two of its signs.
            let count = |signs: &[u8]| field.iter().filter(|b| signs.contains(b)).count();
            let (may_be_time, may_be_date) = (count(b":") > 0, count(b"-/.") > 1);
            if texts > 0 && !may_be_time && !may_be_date {
                // Whether it is a word of a fault tells no more.
                continue;
            }
            let text = decode::text(field);
            let is_time = may_be_time && Stamp::parse(&text).is_some();
            if is_time || (may_be_date && is_date(&text)) {
                numbers += 1;
            } else if faults::read(&text).is_ok() {
                words += 1;
            } else {
                texts += 1;
            }
        }
        match (numbers, texts, words) {
            (0, 0, 1..) => Kind::Faulty,
            (0, ..) => Kind::Text,
            (_, 0, _) => Kind::Data,
            _ => Kind::Mixed,
        }
    }

    /// `true` if two fields are alike.
    fn repeats(&self) -> bool {
        let mut fields: Vec<&[u8]> = self.record.iter().filter(|f| !f.is_empty()).collect();
        fields.sort_unstable();
        fields.windows(2).any(|pair| pair[0] == pair[1])
    }

    fn is_units(&self) -> bool {
        let fields = || self.record.iter().filter(|field| !field.is_empty());
        let is_unit = |field: &[u8]| {
            let text = decode::text(field).to_lowercase();
            let inner = bare(&text);
            inner.len() < text.len() || UNITS.contains(&inner)
        };
        fields().next().is_some() && fields().all(is_unit)
    }
}

/// A unit without the brackets around it.
pub(super) fn bare(unit: &str) -> &str {
    let pairs = [('[', ']'), ('(', ')'), ('{', '}'), ('<', '>')];
    let inner = |(open, close)| unit.strip_prefix(open)?.strip_suffix(close);
    pairs.into_iter().find_map(inner).unwrap_or(unit).trim()
}

/// A number with this decimal sign.
pub(super) fn number(field: &[u8], decimal: u8) -> Option<f64> {
    // As long as the longest number that anybody prints.
    const LONGEST: usize = 64;
    let of_fortran = |byte: &u8| matches!(byte, b'd' | b'D');
    if (decimal == b'.' || !field.contains(&decimal)) && !field.iter().any(of_fortran) {
        let has_point = decimal != b'.' && field.contains(&b'.');
        let text = std::str::from_utf8(field).ok().filter(|_| !has_point)?;
        return text.parse().ok();
    }
    let mut copy = [0; LONGEST];
    let copy = copy.get_mut(..field.len())?;
    for (slot, byte) in copy.iter_mut().zip(field) {
        *slot = match *byte {
            byte if byte == decimal => b'.',
            b'.' => return None,
            byte if of_fortran(&byte) => b'e',
            byte => byte,
        };
    }
    std::str::from_utf8(copy).ok()?.parse().ok()
}

/// `true` if a number with a comma may have it between its thousands: `1,234`, not `0,234`.
fn may_be_thousands(field: &[u8]) -> bool {
    let digits = field.strip_prefix(b"-").or(field.strip_prefix(b"+"));
    let mut groups = digits.unwrap_or(field).split(|byte| *byte == b',');
    let first = groups.next().unwrap_or(&[]);
    let is_first = (1..=3).contains(&first.len()) && first.first() != Some(&b'0');
    let all_digits = |group: &[u8]| group.iter().all(u8::is_ascii_digit);
    is_first && all_digits(first) && groups.all(|group| group.len() == 3 && all_digits(group))
}

/// Rows of the head between one delimiter, without a last one that the head cuts.
fn rows(head: &[u8], whole: bool, delimiter: u8) -> Vec<Row> {
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .delimiter(delimiter)
        .trim(Trim::All)
        .from_reader(head);
    let mut rows = Vec::new();
    let (mut seen, mut line) = (0, 0);
    for record in reader.byte_records() {
        // A list in memory can be read.
        let Ok(record) = record else { break };
        let at = record.position().map_or(0, |position| position.byte());
        let start = skip(head, usize::try_from(at).unwrap_or(usize::MAX));
        line += line_ends(head.get(seen..start).unwrap_or(&[]));
        seen = start;
        rows.push(Row {
            record,
            start,
            line,
        });
    }
    let ends = matches!(head.last(), Some(b'\n' | b'\r'));
    if !whole && !ends {
        rows.pop();
    }
    rows
}

/// Place of the first line from here on that is neither empty nor a comment.
fn skip(head: &[u8], mut at: usize) -> usize {
    loop {
        match head.get(at) {
            Some(b'\n' | b'\r') => at += 1,
            Some(b'#') => {
                let rest = head.get(at..).unwrap_or(&[]);
                let end = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
                at += end.unwrap_or(rest.len());
            }
            _ => return at,
        }
    }
}

fn is_crlf(head: &[u8]) -> bool {
    let end = head.iter().position(|byte| *byte == b'\n');
    end.and_then(|end| head.get(end.checked_sub(1)?)) == Some(&b'\r')
}

/// Number of line ends.
pub(super) fn line_ends(text: &[u8]) -> u64 {
    let mut before = 0;
    let mut count = 0;
    for &byte in text {
        count += u64::from(byte == b'\r' || (byte == b'\n' && before != b'\r'));
        before = byte;
    }
    count
}

/// A dialect that fits, with its number of columns and of rows.
struct Fit {
    dialect: Dialect,
    columns: usize,
    rows: usize,
    /// `true` if a decimal comma can fit no better.
    is_sure: bool,
    /// `true` if nothing but rows of numbers stands below the names and units.
    is_even: bool,
    /// A number that could be read in two ways, with its line, where all of them could.
    unclear: Option<(String, u64)>,
}

impl Fit {
    /// The fit of the head's beginning, where the rest cannot be read otherwise.
    fn certain(head: &[u8], form: &Form) -> Option<Self> {
        let fit = Self::best(head.get(..BEGINNING)?, false, form)?;
        // Decimal commas stand beside other delimiters, or in quotes.
        let doubt = match fit.dialect.delimiter {
            b',' => b'"',
            _ => b',',
        };
        let is_early = fit.dialect.start < BEGINNING / 4 && fit.rows >= CERTAIN_ROWS;
        let is_certain = is_early && fit.is_sure && fit.is_even && !head.contains(&doubt);
        is_certain.then_some(fit)
    }

    /// The fit of all delimiters and decimal signs with the most columns, and the most rows among these.
    fn best(head: &[u8], whole: bool, form: &Form) -> Option<Self> {
        let mut best: Option<Fit> = None;
        for delimiter in delimiters(form) {
            // Without it, rows have one field.
            let is_wider = best.as_ref().is_some_and(|best| best.columns > 1);
            if is_wider && !head.contains(&delimiter) {
                continue;
            }
            let rows = rows(head, whole, delimiter);
            // Rows that are all narrower than those of another delimiter cannot fit better.
            let widest = rows.iter().map(|row| row.record.len()).max();
            if best
                .as_ref()
                .is_some_and(|best| widest < Some(best.columns))
            {
                continue;
            }
            for decimal in decimals(form) {
                let Some(fit) = fit(&rows, delimiter, decimal, form) else {
                    continue;
                };
                let better = |b: &Fit| (fit.columns, fit.rows) > (b.columns, b.rows);
                let is_sure = fit.is_sure;
                if best.as_ref().is_none_or(better) {
                    best = Some(fit);
                }
                if is_sure {
                    break;
                }
            }
        }
        best
    }
}

impl Dialect {
    /// The dialect of a file that begins with `head`; `whole` if the head is all of it.
    ///
    /// # Errors
    /// [`RecordingError::Ambiguous`] if all numbers could be read in two ways.
    pub(super) fn of(
        head: &[u8],
        whole: bool,
        form: &Form,
        file: &Path,
    ) -> Result<Self, RecordingError> {
        let best = Fit::certain(head, form).or_else(|| Fit::best(head, whole, form));
        match best {
            None => Ok(Self::without_fit(head, whole, form)),
            Some(Fit {
                unclear: Some((found, line)),
                ..
            }) if form.decimal.is_none() => Err(RecordingError::Ambiguous {
                file: file.to_owned(),
                place: Place::Line(line + 1),
                found: quoted(&found),
            }),
            Some(fit) => Ok(Self {
                crlf: is_crlf(head),
                ..fit.dialect
            }),
        }
    }

    /// The likeliest dialect of a file in which nothing fits, so that the rows that spoil it are
    /// named.
    fn without_fit(head: &[u8], whole: bool, form: &Form) -> Self {
        let start = skip(head, 0);
        let first = head.get(start..).unwrap_or(&[]);
        let first = first.split(|byte| matches!(byte, b'\n' | b'\r')).next();
        let count = |delimiter: &u8| {
            let bytes = first.unwrap_or(&[]).iter();
            bytes.filter(|byte| *byte == delimiter).count()
        };
        // The last of the largest counts, and a comma where there is none of them.
        let delimiters = delimiters(form).into_iter().rev();
        let delimiter = delimiters.max_by_key(count).unwrap_or(b',');
        let rows = rows(head, whole, delimiter);
        let read = |decimal: &u8| {
            let fields = rows.iter().flat_map(|row| row.record.iter());
            fields.filter(|f| number(f, *decimal).is_some()).count()
        };
        let decimal = decimals(form).into_iter().rev().max_by_key(read);
        let named = form.header.and_then(|line| {
            let is_named = |row: &&Row| row.line + 1 == line;
            rows.iter().find(is_named)
        });
        Self {
            delimiter,
            decimal: decimal.unwrap_or(b'.'),
            start: named.map_or(0, |row| row.start),
            line: named.map_or(0, |row| row.line),
            units: false,
            stamps: None,
            columns: None,
            crlf: is_crlf(head),
        }
    }

    /// The dialect in words, for the user; `time` is the column of time stamps.
    pub(super) fn described(&self, time: Option<&str>) -> String {
        let sign = if self.decimal == b',' {
            "comma"
        } else {
            "point"
        };
        let mut text = format!(
            "CSV with {} between fields and a decimal {sign}, channel names in line {}",
            delimiter_name(self.delimiter),
            self.line + 1
        );
        if self.units {
            text += ", units below them";
        }
        if let Some(name) = time {
            text += &format!(", time stamps in column `{}`", quoted(name));
        }
        text
    }
}

fn delimiters(form: &Form) -> Vec<u8> {
    let guessed = DELIMITERS.iter().map(|(byte, _)| *byte);
    let guessed = guessed.filter(|byte| *byte != b' ');
    form.delimiter
        .map_or_else(|| guessed.collect(), |stated| vec![stated])
}

fn decimals(form: &Form) -> Vec<u8> {
    form.decimal.map_or(vec![b'.', b','], |stated| vec![stated])
}

/// Looks for rows of numbers below a line of text with as many fields.
fn fit(rows: &[Row], delimiter: u8, decimal: u8, form: &Form) -> Option<Fit> {
    let kinds: Vec<Kind> = rows.iter().map(|row| row.kind(decimal)).collect();
    let kinds = &kinds;
    let lowest = |i: &usize| {
        let line = rows.get(*i).map_or(0, |row| row.line + 1);
        form.first_row.is_none_or(|first| line >= first)
            && form.header.is_none_or(|header| line > header)
    };
    let data = || (0..rows.len()).filter(|i| kinds.get(*i) == Some(&Kind::Data));
    let data = || data().filter(lowest);
    let count = data().count();
    let width = |i: usize| rows.get(i).map_or(0, Row::width);
    // The number of columns of most rows; an empty last column has no name either.
    let mut widths: Vec<usize> = data().map(width).collect();
    widths.sort_unstable();
    let columns = *widths.get(widths.len() / 2)?;
    let first = data().find(|i| width(*i) == columns)?;
    let fits =
        |i: &usize| width(*i) == columns || rows.get(*i).is_some_and(|r| r.record.len() == columns);
    let of_kind = |kind: Kind| {
        let above = (0..first).rev();
        above
            .filter(fits)
            .filter(move |i| kinds.get(*i) == Some(&kind))
    };
    let mut texts = of_kind(Kind::Text);
    let stated = |line: u64| (0..first).find(|i| rows.get(*i).is_some_and(|r| r.line + 1 == line));
    let (header, units) = match form.header {
        Some(line) => (stated(line).filter(fits)?, None),
        None => match (texts.next(), texts.next()) {
            (Some(last), Some(above)) if above + 1 == last => {
                let (units, names) = (rows.get(last)?, rows.get(above)?);
                // Units that nobody knows repeat each other where names do not.
                if units.is_units() || (units.repeats() && !names.repeats()) {
                    (above, Some(last))
                } else {
                    (last, None)
                }
            }
            (Some(last), _) => (last, None),
            // Names such as `time,1,2`.
            (None, _) => (of_kind(Kind::Mixed).next_back()?, None),
        },
    };
    let below = rows
        .get(header + 1)
        .filter(|row| row.is_units() && header + 1 < first);
    let units = units.is_some() || below.is_some();
    let stamped = |i: usize| {
        let field = rows.get(first).and_then(|row| row.record.get(i))?;
        let is_stamp =
            number(field, decimal).is_none() && Stamp::parse(&decode::text(field)).is_some();
        is_stamp.then_some(i)
    };
    // A comma that never stands before other than three digits tells nothing.
    let commas = || {
        let fields = data().filter_map(|i| rows.get(i));
        let fields = fields.flat_map(|row| row.record.iter().map(move |field| (field, row.line)));
        fields.filter(|(field, _)| field.contains(&b',') && number(field, decimal).is_some())
    };
    let unclear = decimal == b',' && commas().all(|(field, _)| may_be_thousands(field));
    let unclear = unclear.then(|| commas().next()).flatten();
    let named = rows.get(header)?;
    // Without commas, rows of numbers with decimal commas are some of these.
    let is_sure = decimal == b'.'
        && data().all(|i| width(i) == columns)
        && !rows.iter().any(|row| row.record.as_slice().contains(&b','));
    let below = header + 1 + usize::from(units);
    Some(Fit {
        is_even: kinds
            .get(below..)
            .is_some_and(|kinds| kinds.iter().all(|kind| *kind == Kind::Data)),
        dialect: Dialect {
            delimiter,
            decimal,
            start: named.start,
            line: named.line,
            units,
            stamps: (0..columns).find_map(stamped),
            columns: Some(columns),
            crlf: false,
        },
        columns,
        rows: count,
        is_sure,
        unclear: unclear.map(|(field, line)| (decode::text(field), line)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fortran_writes_exponents_with_a_d() {
        for (text, decimal, expected) in [
            ("-1.25D-01", b'.', Some(-0.125)),
            ("1.25d+3", b'.', Some(1250.0)),
            ("-1,25D-01", b',', Some(-0.125)),
            ("1.2.5D1", b'.', None),
            ("1.25D1", b',', None),
            ("1D", b'.', None),
            ("Dead", b'.', None),
            ("1D1D1", b'.', None),
        ] {
            assert_eq!(number(text.as_bytes(), decimal), expected, "{text}");
        }
        check(
            "a,b\n1.5D+00,-2.0D-01\n2.5D+00,3D0\n",
            (',', '.', 1, false, None),
        );
        check(
            "a;b\n1,5D+00;-2,0D-01\n2,5D+00;3D0\n",
            (';', ',', 1, false, None),
        );
    }

    fn of(text: &str, form: &Form) -> Result<Dialect, String> {
        let dialect = Dialect::of(text.as_bytes(), true, form, Path::new("x.csv"));
        dialect.map_err(|e| e.to_string())
    }

    /// Delimiter, decimal sign, line of the names counted from one, units, column of stamps.
    #[track_caller]
    fn check(text: &str, expected: (char, char, u64, bool, Option<usize>)) {
        let d = of(text, &Form::default()).unwrap();
        let found = (
            char::from(d.delimiter),
            char::from(d.decimal),
            d.line + 1,
            d.units,
            d.stamps,
        );
        assert_eq!(found, expected, "{text}");
        // Bytes and lines are those of the same place.
        let line = text.lines().nth(d.line as usize).unwrap_or("");
        assert!(text[d.start..].starts_with(line) || d.start == 0, "{text}");
    }

    #[test]
    fn dialects_are_seen_from_the_head() {
        check("a,b\n1,2\n", (',', '.', 1, false, None));
        check("a;b\n1,5;2\n0;1e-3\n", (';', ',', 1, false, None));
        check("a;b\r\n1.5;2\r\n", (';', '.', 1, false, None));
        check("a\tb\n1,5\t2,25\n", ('\t', ',', 1, false, None));
        check("a\tb\n1.5\t2\n", ('\t', '.', 1, false, None));
        check("a;b;\n1,5;2;\n", (';', ',', 1, false, None));
        check("a;b\n1,5;2;\n", (';', ',', 1, false, None));
        check("a,b\n\"1,5\",\"2,25\"\n", (',', ',', 1, false, None));
        check("Kraft\n1,5\n2,25\n", (';', ',', 1, false, None));
        check("a,b\nm/s²,[N]\n1,2\n", (',', '.', 1, true, None));
        // Units that nobody knows; groups above the names.
        check("a,b,c\nV,EU,EU\n1,2,3\n", (',', '.', 1, true, None));
        check("g,g,h\na,b,c\n1,2,3\n", (',', '.', 2, false, None));
        check(
            "Operator;Müller\nRate;512\n\nZeit;a;b\ns;g;N\n0,5;1,25;2\n1;1;1\n",
            (';', ',', 4, true, None),
        );
        check(
            "time,a\n2026-03-02T12:00:00.5Z,1\n2026-03-02T12:00:00.6Z,2\n",
            (',', '.', 1, false, Some(0)),
        );
        check(
            "Datum;Zeit;a\n02.03.2026;12:00:00,5;0,25\n02.03.2026;12:00:00,6;1\n",
            (';', ',', 1, false, Some(1)),
        );
        check("sep=;\na;b\n1,5;2\n", (';', ',', 2, false, None));
        // Names with numbers, samples with faults, a row that is spoilt.
        check("time,1,2\n0,1,2\n", (',', '.', 1, false, None));
        check("a,b,health\n,,missing\n1,2,\n", (',', '.', 1, false, None));
        check("a,b\n1,x\n1,2\n", (',', '.', 1, false, None));
        check("# remark\n\na,b\n1,2\n", (',', '.', 3, false, None));
        // Nothing fits: the first line is taken for the names.
        check("a;b\n1;x\n", (';', '.', 1, false, None));
        check("1,2\n3,4\n", (',', '.', 1, false, None));
        check("", (',', '.', 1, false, None));
    }

    #[test]
    fn a_head_that_changes_is_looked_at_to_its_end() {
        // Names, a table of whole numbers, and another way to write numbers behind the beginning.
        let row = "0;12;-3\n";
        let whole = row.repeat(BEGINNING / row.len() + CERTAIN_ROWS);
        let head = format!("a;b;c\n{whole}");
        let form = Form::default();
        assert!(Fit::certain(head.as_bytes(), &form).is_some());
        check(&head, (';', '.', 1, false, None));
        let commas = format!("{head}0,5;12,25;-3\n");
        assert!(Fit::certain(commas.as_bytes(), &form).is_none());
        check(&commas, (';', ',', 1, false, None));
        let quotes = head.replace(';', ",") + "\"0,5\",\"12,25\",\"-3,5\"\n";
        assert!(Fit::certain(quotes.as_bytes(), &form).is_none());
        check(&quotes, (',', ',', 1, false, None));
        // Names far below, few rows, a row without any number, one with a number that is none, a longer one.
        for doubt in [
            format!("{}{head}", "remark\n".repeat(BEGINNING / 4 / 7 + 1)),
            format!(
                "a;b;c\n{}",
                format!("{:>1500};1;2\n", 1).repeat(CERTAIN_ROWS)
            ),
            head.replacen("0;12;-3", ";;missing", 1),
            head.replacen("-3", "x", 1),
            head.replacen("-3", "-3;4", 1),
        ] {
            assert!(Fit::certain(doubt.as_bytes(), &form).is_none());
        }
    }

    #[test]
    fn a_number_that_could_be_two_is_refused_unless_the_head_decides() {
        let text = of("a\tb\n1,234\t2,345\n-3,456\t1,000\n", &Form::default()).unwrap_err();
        assert!(
            text.contains("x.csv, line 2: `1,234`") && text.contains("decimal"),
            "{text}"
        );
        // One number with a leading zero, or with other than three decimals, decides.
        check(
            "a\tb\n1,234\t2,345\n0,456\t1,000\n",
            ('\t', ',', 1, false, None),
        );
        check(
            "a\tb\n1,234\t2,345\n3,4567\t1,000\n",
            ('\t', ',', 1, false, None),
        );
        let stated = Form {
            decimal: Some(b','),
            ..Form::default()
        };
        assert_eq!(of("a\tb\n1,234\t2,345\n", &stated).unwrap().decimal, b',');
        // Thousands and decimals beside each other fit nothing, and are named when they are read.
        check("a\tb\n1,234\t0.5\n", ('\t', '.', 1, false, None));
    }

    #[test]
    fn what_is_stated_is_not_guessed() {
        let form = Form {
            delimiter: Some(b'|'),
            header: Some(2),
            first_row: Some(4),
            ..Form::default()
        };
        let d = of("x|y\na|b\nfoo|bar\n1|2\n", &form).unwrap();
        assert_eq!((d.delimiter, d.line, d.units), (b'|', 1, false));
    }

    #[test]
    fn thousands() {
        for text in ["1,234", "-12,345", "+123,456", "1,234,567"] {
            assert!(may_be_thousands(text.as_bytes()), "{text}");
        }
        for text in ["0,234", "1,2345", "1,23", "1234,567", ",234", "1,234e3"] {
            assert!(!may_be_thousands(text.as_bytes()), "{text}");
        }
    }
}
