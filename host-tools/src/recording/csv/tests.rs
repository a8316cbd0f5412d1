//! Lines read by the scan and by the reader of any form are the same samples, errors and notes.

use super::*;
use proptest::prelude::*;

/// Bytes that come a few at a time.
struct Slow(Cursor<Vec<u8>>, usize);

impl Read for Slow {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let most = self.1.min(buffer.len());
        self.0.read(&mut buffer[..most])
    }
}

fn open(text: &[u8], step: usize) -> CsvFile {
    let input = Input {
        file: PathBuf::from("x.csv"),
        start: text[..text.len().min(4096)].to_vec(),
        content: Box::new(Slow(Cursor::new(text.to_vec()), step)),
        packed: false,
    };
    CsvFile::open(input, &Form::default()).unwrap()
}

/// All samples by their bits, the error that ends them, and the note on the end.
fn outcome(mut csv: CsvFile, selected: &[usize]) -> String {
    csv.select(selected);
    let mut told = String::new();
    let mut block = Block::default();
    loop {
        block.begin(selected.len(), 5);
        let read = csv.read(&mut block);
        for n in 0..block.len() {
            let (readings, place, health) = block.sample(n).unwrap();
            let bits: Vec<u64> = readings.iter().map(|x| x.to_bits()).collect();
            told += &format!("{place} {health:?} {bits:x?}\n");
        }
        match read {
            Err(error) => return told + &error.to_string(),
            Ok(()) if block.is_empty() => return told + &format!("{:?}", csv.end_note()),
            Ok(()) => {}
        }
    }
}

/// A head by which the dialect is settled, longer than it is looked at, and rows below it.
fn with_head(end: &str, rows: &str) -> Vec<u8> {
    let sample = format!("1.5,-2,3.25,{end}");
    let head = sample.repeat(2 + dialect::HEAD / sample.len());
    format!("a,b,c,health{end}{head}{}", rows.replace('\n', end)).into_bytes()
}

#[track_caller]
fn agree(end: &str, rows: &str, step: usize) {
    let selections = [
        &[0, 1, 2][..],
        &[2, 0],
        &[1, 3],
        &[2, 1, 0, 1, 2, 2, 0],
        &[],
    ];
    agree_on(&with_head(end, rows), step, &selections, rows);
}

#[track_caller]
fn agree_on(text: &[u8], step: usize, selections: &[&[usize]], rows: &str) {
    for selected in selections {
        let mut any = open(text, step);
        assert!(matches!(any.rows, Rows::Lines(_)));
        any.rows.leave_lines(&any.dialect);
        let any = outcome(any, selected);
        let lines = outcome(open(text, step), selected);
        // Only the end differs: thousands of rows of the head come before it.
        let last = |told: &str| told[told.len().saturating_sub(600)..].to_owned();
        assert!(
            lines == any,
            "{rows:?}:\n{}\n---\n{}",
            last(&lines),
            last(&any)
        );
    }
}

#[test]
fn lines_of_every_form_are_read_alike() {
    let long = "9".repeat(3000);
    for rows in [
        "1,2,3,\n4,5,6,\n",
        "1,2,3,\n4,5,6,",
        "1,2,3,missing\n,,,missing\n1,2,3,brocken\n",
        " 1 ,\t2, 3,\n+1,-0,.5,\n1.,1e3,-1E-3,\n",
        "# comment, with, fields, here, and more\n\n\n1,2,3,\n",
        "#\n#\n1,2,x,\n",
        "1,2\n",
        "1,2,3,,\n1,2,3,,,\n",
        "1,nan,3,\n",
        "1,2,1e300,\n",
        "1,2,3.00000000000000000000000000000001,\n",
        "9007199254740993,0.1234567890123456789,123456789.123456789,\n",
        "1,\"2\",3,\n4,5,6,\n7,8,x,\n",
        "1,2,3,\n# \"quoted\n4,5,6,\n\"7\n8\",2,3,\n",
        "1,2,3,\"\n",
        "1,2,3,\r4,5,6,\n7,8,9,\n",
        "1,2,3,\n\n \n",
        "1,2,é,\n",
        "",
        "\n",
    ] {
        for end in ["\n", "\r\n"] {
            // A carriage return alone ends a row, and its reader counts lines at line feeds.
            if end == "\n" || !rows.contains('\r') {
                agree(end, rows, 5000);
            }
        }
    }
    agree("\n", &format!("1,2,{long},\n1,2,3.{long},\n"), 100_000);
}

/// The text is read in parts of 64 KiB from the first row on; these rows begin so many bytes before the end of the
/// first one.
#[test]
fn rows_across_the_ends_of_parts_are_read_alike() {
    for rows in [
        "1.25,-2.5,3.75,\n4,5,6,\n",
        "1.25,-2.5,3.75,\n4,5,6,",
        "1.25,-2.5,3.75,\n4,5",
        "1.25,-2.5\n4,5,6,\n",
        "1.25,-2.5,\n4,5,6,\n",
        "1.25,-2.5,3.75,,\n4,5,6,7,8,\n",
        "\n\n\n1.25,-2.5,3.75,\n\n4,5,x,\n",
        "# comment, \"quoted\"\n1.25,-2.5,3.75,\n\n4,x5,6,\n",
        "1.25,\"-2.5\",3.75,\n\n4,5,6,\n7,nan,9,\n",
        "1.25,-2.5,3.75,missing\n,,,open\n1,2,3,brocken\n",
        "0.0000123456789012345678,1e-3,-1E5,\n4,5,1e300,\n",
    ] {
        for end in ["\n", "\r\n"] {
            for before in [0, 1, 3, 8, 14, 17, 20] {
                let sample = format!("1.5,-2,3.25,{end}");
                let length = (64 << 10) - before;
                let (count, left) = (length / sample.len(), length % sample.len());
                let first = format!("1.5{},-2,3.25,{end}", "0".repeat(left));
                let text = format!("a,b,c,health{end}{first}{}", sample.repeat(count - 1));
                assert_eq!(text.len(), "a,b,c,health".len() + end.len() + length);
                let text = text + &rows.replace('\n', end);
                agree_on(text.as_bytes(), 50_000, &[&[0, 1, 2]], rows);
            }
        }
    }
}

#[test]
fn a_comment_that_ends_with_the_file_is_no_row() {
    let told = outcome(open(&with_head("\n", "#"), 5000), &[0]);
    assert!(
        told.ends_with("delete that row\")"),
        "{}",
        &told[told.len() - 99..]
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]
    #[test]
    fn any_lines_are_read_alike(
        rows in "(([-+]?[0-9]{0,9}[.]?[0-9]{0,11}(e-?[0-9])?,){3}(open)?\n|[0-9,.# \"x\n-]{0,12}\n?){0,30}",
        crlf: bool,
        step in 1000_usize..40_000,
    ) {
        // The reader of any form takes a comment that ends with the file for a row.
        let last = rows.rsplit('\n').next().unwrap();
        let rows = if last.starts_with('#') { format!("{rows}\n") } else { rows };
        agree(if crlf { "\r\n" } else { "\n" }, &rows, step);
    }
}
