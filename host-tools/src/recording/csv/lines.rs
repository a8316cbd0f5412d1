//! Lines of text without quotes, whose fields are found by a scan over large blocks of bytes.

use super::decimal::{self, Field, GROUP, WIDTH, Way, Words};
use super::dialect;
use super::marks::Marks;
use crate::limits;
use crate::recording::input::Broken;
use std::io::{self, Read};
use std::ops::Range;

/// Bytes that are read at a time.
const CHUNK: usize = 64 << 10;

/// Lines that are being read.
pub(super) struct Lines {
    content: Box<dyn Read>,
    delimiter: u8,
    decimal: u8,
    /// Text, with [`WIDTH`] bytes before it and at least [`GROUP`] behind it.
    text: Vec<u8>,
    /// End of the text, and the begin of the next line.
    end: usize,
    next: usize,
    /// Places of delimiters and line ends; the number of that where the next line begins behind, and its number
    /// among those of control characters.
    marks: Marks,
    passed: usize,
    control: usize,
    /// Number of the next line, and of the line behind the row before it: a row is said to begin there, in
    /// front of comments and empty lines.
    line: u64,
    row: u64,
    /// Place of the first quote.
    quote: Option<usize>,
    ended: bool,
    failed: Option<io::Error>,
    /// `true` if the text ends in the middle of a line, which then has been given an end.
    unfinished: bool,
    /// Instructions that look at sixteen characters at once, where the processor has them.
    #[cfg(target_arch = "x86_64")]
    simd: Option<pulp::x86::V3>,
}

/// Form of a row of numbers: its columns, those that are read, and one that is empty.
#[derive(Clone, Copy)]
struct Form<'a> {
    columns: usize,
    selected: &'a [usize],
    empty: Option<usize>,
}

/// [`Lines::numbers`] with these instructions.
#[cfg(target_arch = "x86_64")]
struct Numbers<'a> {
    simd: pulp::x86::V3,
    lines: &'a mut Lines,
    form: Form<'a>,
    into: &'a mut [f64],
}

#[cfg(target_arch = "x86_64")]
impl pulp::NullaryFnOnce for Numbers<'_> {
    type Output = Option<u64>;

    #[inline(always)]
    fn call(self) -> Option<u64> {
        self.lines.numbers_by(self.simd, self.form, self.into)
    }
}

/// [`Lines::mark`] with these instructions.
#[cfg(target_arch = "x86_64")]
struct Mark<'a> {
    simd: pulp::x86::V3,
    lines: &'a mut Lines,
}

#[cfg(target_arch = "x86_64")]
impl pulp::NullaryFnOnce for Mark<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.lines.mark_by(self.simd);
    }
}

/// A step from line to line.
pub(super) enum Step {
    /// A row, without its line end.
    Row(Range<usize>),
    /// The end of the text.
    End,
    /// A line that this reader does not read: with quotes, or carriage returns within.
    Other,
    /// A row that is longer than [`limits::ROW`].
    TooLong,
    /// An error of the reader, due now.
    Failed(io::Error),
}

/// The places before and behind a column.
#[inline(always)]
fn around(row: &[u32], column: usize) -> Option<[u32; 2]> {
    // What cannot overflow needs no check of it.
    let column = column as u32 as usize;
    row.get(column..column + 2)?.first_chunk().copied()
}

/// The field between two places, if it is in the text.
#[inline(always)]
fn enclosed(text: &[u8], [before, end]: [u32; 2]) -> Option<Field<'_>> {
    let start = end.wrapping_sub(WIDTH as u32) as usize;
    Some(Field {
        window: text.get(start..start + WIDTH)?.first_chunk()?,
        length: end.wrapping_sub(before).wrapping_sub(1) as usize,
    })
}

impl Lines {
    /// Lines of `content` from its first byte on, which is that of a line of this number.
    pub(super) fn new(content: Box<dyn Read>, line: u64, delimiter: u8, decimal: u8) -> Self {
        Self {
            content,
            delimiter,
            decimal,
            text: vec![0; WIDTH + CHUNK + GROUP],
            end: WIDTH,
            next: WIDTH,
            marks: Marks::default(),
            passed: 0,
            control: 0,
            line,
            row: line,
            quote: None,
            ended: false,
            failed: None,
            unfinished: false,
            #[cfg(target_arch = "x86_64")]
            simd: pulp::x86::V3::try_new(),
        }
    }

    /// Number of the line behind the row read last, where the next row is said to begin.
    pub(super) fn row(&self) -> u64 {
        self.row
    }

    /// Number of the next line.
    pub(super) fn line(&self) -> u64 {
        self.line
    }

    /// `true` at the end of a text that ends in the middle of a line.
    pub(super) fn unfinished(&self) -> bool {
        self.unfinished
    }

    /// Part of the text.
    pub(super) fn part(&self, range: Range<usize>) -> &[u8] {
        self.text.get(range).unwrap_or(&[])
    }

    /// Reads a row of `columns` numbers: those of the columns `selected`, in this order. `empty`, where it
    /// is given, is a column that has to be. `None`, with nothing read, if the row is not of that form.
    pub(super) fn numbers(
        &mut self,
        columns: usize,
        selected: &[usize],
        empty: Option<usize>,
        into: &mut [f64],
    ) -> Option<u64> {
        let form = Form {
            columns,
            selected,
            empty,
        };
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.simd {
            return simd.vectorize(Numbers {
                simd,
                lines: self,
                form,
                into,
            });
        }
        self.numbers_by(Words, form, into)
    }

    #[inline(always)]
    fn numbers_by(&mut self, way: impl Way, form: Form<'_>, into: &mut [f64]) -> Option<u64> {
        let Form {
            columns,
            selected,
            empty,
        } = form;
        // Behind the place before the row, one for the end of each column.
        let places = self.marks.places().get(self.passed..)?;
        let row = places.get(..=columns)?;
        let controls = self.marks.controls().get(self.control + 1..)?;
        if (*controls.first()? as usize) < self.passed + columns {
            return None;
        }
        let at = |mark: u32| self.text.get(mark as usize).copied();
        // A delimiter at the end of the row, a carriage return, a line feed.
        let mut count = columns;
        let mut end = *row.last()?;
        for ending in [self.delimiter, b'\r'] {
            if at(end) == Some(ending) {
                let next = *places.get(count + 1)?;
                if next != end + 1 {
                    return None;
                }
                (end, count) = (next, count + 1);
            }
        }
        let after = end as usize + 1;
        let comment = self.text.get(self.next) == Some(&b'#');
        if at(end) != Some(b'\n') || comment || self.quote.is_some_and(|quote| quote < after) {
            return None;
        }
        let last = self.passed + count;
        let ends = controls
            .iter()
            .take_while(|number| **number as usize <= last);
        let ends = ends.count();
        let field = |column: usize| {
            let [before, end] = around(row, column)?;
            Some(before as usize + 1..end as usize)
        };
        if let Some(empty) = empty
            && !field(empty)?.is_empty()
        {
            return None;
        }
        let (fours, rest) = selected.as_chunks::<4>();
        let (slots, rest_slots) = into.as_chunks_mut::<4>();
        for (slots, columns) in slots.iter_mut().zip(fours) {
            match self.four(way, row, *columns) {
                Some(values) => *slots = values,
                None => {
                    for (slot, column) in slots.iter_mut().zip(columns) {
                        *slot = self.number(way, field(*column)?)?;
                    }
                }
            }
        }
        for (slot, column) in rest_slots.iter_mut().zip(rest) {
            *slot = self.number(way, field(*column)?)?;
        }
        self.passed = last;
        self.control += ends;
        self.next = after;
        let row = self.row;
        self.line += 1;
        self.row = self.line;
        Some(row)
    }

    /// The numbers of four columns of a row of places; `None` where one of them may be of another form.
    #[inline(always)]
    fn four(&self, way: impl Way, row: &[u32], [a, b, c, d]: [usize; 4]) -> Option<[f64; 4]> {
        let [a, b, c, d] = [
            enclosed(&self.text, around(row, a)?)?,
            enclosed(&self.text, around(row, b)?)?,
            enclosed(&self.text, around(row, c)?)?,
            enclosed(&self.text, around(row, d)?)?,
        ];
        way.four([a, b, c, d], self.decimal)
    }

    /// A field at the end of the characters before its end.
    #[inline(always)]
    fn window(&self, field: &Range<usize>) -> Option<Field<'_>> {
        let window = self.text.get(field.end.checked_sub(WIDTH)?..field.end)?;
        Some(Field {
            window: window.try_into().ok()?,
            length: field.len(),
        })
    }

    /// A finite number in a field, with spaces around it.
    #[inline(always)]
    fn number(&self, way: impl Way, field: Range<usize>) -> Option<f64> {
        let Field { window, length } = self.window(&field)?;
        match decimal::number(way, window, length, self.decimal) {
            Some(value) => Some(value),
            None => self.other_number(field),
        }
    }

    /// The same of other forms: with spaces around it, with an exponent, or with many digits.
    #[inline(never)]
    fn other_number(&self, field: Range<usize>) -> Option<f64> {
        let start = field.end - self.part(field.clone()).trim_ascii_start().len();
        let text = self.part(start..field.end).trim_ascii_end();
        let end = start + text.len();
        let window = |end: usize| {
            let window = self.text.get(end.checked_sub(WIDTH)?..end)?;
            <&[u8; WIDTH]>::try_from(window).ok()
        };
        let found = if let Some((before, exponent)) = decimal::split_exponent(text) {
            window(start + before.len())
                .and_then(|w| decimal::scaled(w, before.len(), self.decimal, exponent))
        } else if end < field.end || start > field.start {
            window(end).and_then(|w| decimal::number(Words, w, text.len(), self.decimal))
        } else {
            None
        };
        if found.is_some() {
            return found;
        }
        let value = dialect::number(text, self.decimal)?;
        (value as f32).is_finite().then_some(value)
    }

    /// The next row, whatever its form; comments and empty lines are passed over, [`limits::ROW`] bytes of them at most.
    pub(super) fn step(&mut self) -> Step {
        let mut skipped = 0;
        loop {
            if skipped > limits::ROW as usize {
                return Step::TooLong;
            }
            let Some(end) = self.line_end() else {
                if self.end - self.next > limits::ROW as usize {
                    return Step::TooLong;
                }
                if !self.ended {
                    self.refill();
                    continue;
                }
                return self.failed.take().map_or(Step::End, Step::Failed);
            };
            let (start, after) = (self.next, end + 1);
            let line = self.part(start..end);
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            if !line.is_empty() && line.first() != Some(&b'#') {
                let quoted = self.quote.is_some_and(|quote| quote < after);
                if quoted || line.contains(&b'\r') {
                    return Step::Other;
                }
                let range = start..start + line.len();
                self.pass(after);
                return Step::Row(range);
            }
            let row = self.row;
            self.pass(after);
            self.row = row;
            skipped += after - start;
        }
    }

    /// Passes over a line.
    fn pass(&mut self, after: usize) {
        let places = self.marks.places();
        let controls = self.marks.controls();
        let passed = controls.get(self.control + 1..).unwrap_or(&[]);
        let passed = passed.iter().take_while(|number| {
            let place = places.get(**number as usize);
            place.is_some_and(|place| (*place as usize) < after)
        });
        self.control += passed.count();
        self.passed = controls.get(self.control).map_or(0, |n| *n as usize);
        self.next = after;
        self.line += 1;
        self.row = self.line;
        if self.quote.is_some_and(|quote| quote < after) {
            self.quote = self.find_quote(after);
        }
    }

    /// The line end of the next line, if it has been read.
    fn line_end(&self) -> Option<usize> {
        let controls = self.marks.controls().get(self.control + 1..)?;
        let mut places = controls.iter().filter_map(|number| {
            let place = self.marks.places().get(*number as usize)?;
            Some(*place as usize)
        });
        places.find(|place| self.text.get(*place) == Some(&b'\n'))
    }

    fn find_quote(&self, from: usize) -> Option<usize> {
        memchr::memchr(b'"', self.part(from..self.end)).map(|place| from + place)
    }

    /// Reads more text behind the part of a line that is left.
    fn refill(&mut self) {
        self.text.copy_within(self.next..self.end, WIDTH);
        self.end = WIDTH + self.end - self.next;
        self.next = WIDTH;
        (self.passed, self.control) = (0, 0);
        // A long line is not looked through for each of its chunks.
        let more = CHUNK.max(self.end / 4);
        self.text.resize(self.end + more + GROUP, 0);
        while !self.ended && self.end < self.text.len() - GROUP {
            let to = self.text.len() - GROUP;
            match self
                .content
                .read(self.text.get_mut(self.end..to).unwrap_or(&mut []))
            {
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => (self.ended, self.failed) = (true, Some(e)),
                Ok(0) => self.ended = true,
                Ok(count) => self.end += count,
            }
        }
        let last = self.part(self.next..self.end).last();
        if self.ended && self.failed.is_none() && !matches!(last, None | Some(b'\n')) {
            self.unfinished = last != Some(&b'\r');
            if let Some(slot) = self.text.get_mut(self.end) {
                *slot = b'\n';
                self.end += 1;
            }
            self.text.resize(self.end + GROUP, 0);
        }
        self.mark();
        self.quote = self.find_quote(WIDTH);
    }

    fn mark(&mut self) {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.simd {
            return simd.vectorize(Mark { simd, lines: self });
        }
        self.mark_by(Words);
    }

    #[inline(always)]
    fn mark_by(&mut self, way: impl Way) {
        self.marks
            .find(way, &self.text, WIDTH, self.end, self.delimiter);
    }

    /// Has more text read where fewer rows than one are left of it.
    pub(super) fn ready(&mut self) {
        if !self.ended && self.line_end().is_none() && self.end - self.next <= limits::ROW as usize
        {
            self.refill();
        }
    }

    /// The text from the next line on, and the number of that line.
    pub(super) fn rest(mut self) -> (Box<dyn Read>, u64) {
        let begun = self.part(self.next..self.end).to_vec();
        let begun = if self.ended && self.failed.is_none() && self.unfinished {
            begun.strip_suffix(b"\n").unwrap_or(&begun).to_vec()
        } else {
            begun
        };
        let failed = Broken(self.failed.take());
        let rest = io::Cursor::new(begun).chain(failed).chain(self.content);
        (Box::new(rest), self.line)
    }
}
