//! CSV as it is found.

use crate::bench::{Bench, RECORDINGS};
use crate::{Table, offered, same};

const RATE: f64 = 512.0;

fn utf16(text: &str, mark: [u8; 2], unit: fn(u16) -> [u8; 2]) -> Vec<u8> {
    mark.into_iter()
        .chain(text.encode_utf16().flat_map(unit))
        .collect()
}

/// The test with time in front of each recording, and no sample rate in the setup.
fn timed(name: &str, time: impl Fn(usize) -> String) -> Bench {
    let form = |table: Table| table.timed(name, &time).text(",", "\n").into_bytes();
    offered(form).setup("sample_rate", "# sample_rate")
}

#[test]
fn delimiters_decimals_and_line_ends() {
    for (between, line_end) in [
        (";", "\n"),
        ("\t", "\n"),
        (";", "\r\n"),
        ("\t", "\r\n"),
        (",", "\r\n"),
    ] {
        same(&offered(|table| table.text(between, line_end).into_bytes()));
        if between != "," {
            same(&offered(|table| {
                table.commas().text(between, line_end).into_bytes()
            }));
        }
    }
    // A delimiter behind the last field of each row, or of the header alone.
    same(&offered(|table| table.text(";", ";\r\n").into_bytes()));
    same(&offered(|table| {
        table.text(";", "\n").replacen('\n', ";\n", 1).into_bytes()
    }));
}

#[test]
fn encodings_and_quotes() {
    let text = |table: Table| table.commas().text(";", "\r\n");
    same(&offered(|table| {
        utf16(&text(table), [0xff, 0xfe], u16::to_le_bytes)
    }));
    same(&offered(|table| {
        utf16(&text(table), [0xfe, 0xff], u16::to_be_bytes)
    }));
    same(&offered(|table| {
        [b"\xef\xbb\xbf", text(table).as_bytes()].concat()
    }));
    let quoted = |mut table: Table| {
        let all = table
            .names
            .iter_mut()
            .chain(table.rows.iter_mut().flatten());
        all.for_each(|field| *field = format!("\"{field}\""));
        table
    };
    // A mark, quotes and CRLF; decimal commas within quotes between commas.
    same(&offered(|table| {
        [b"\xef\xbb\xbf", quoted(table).text(",", "\r\n").as_bytes()].concat()
    }));
    same(&offered(|table| {
        quoted(table.commas()).text(",", "\r\n").into_bytes()
    }));
}

#[test]
fn lines_above_and_below_the_names() {
    let above = "Messung;Müller, Prüfstand 2\r\nAbtastrate;512\r\nKanäle;19\r\n\r\n";
    let unit = |name: &String| match name.chars().next() {
        Some('a') => "[m/s²]",
        Some('f') => "[N]",
        Some('t') => "[N m]",
        _ => "[-]",
    };
    let units = |table: &Table| {
        let units: Vec<&str> = table.names.iter().map(unit).collect();
        units.join(";") + "\r\n"
    };
    let with_units = |table: Table| {
        let units = units(&table);
        let text = table.commas().text(";", "\r\n");
        let (names, rows) = text.split_once('\n').unwrap();
        format!("{above}{names}\n{units}{rows}")
    };
    same(&offered(|table| {
        format!("{above}{}", table.commas().text(";", "\r\n")).into_bytes()
    }));
    same(&offered(|table| with_units(table).into_bytes()));
    same(&offered(|table| {
        format!("sep=;\r\n{}", table.text(";", "\r\n")).into_bytes()
    }));
    // Letters of one byte, as programs on Windows write them.
    let latin = |table| {
        with_units(table)
            .chars()
            .map(|c| u8::try_from(c).unwrap())
            .collect()
    };
    same(&offered(latin));
    let finished = offered(|table| with_units(table).into_bytes()).identify(&["--verbose"]);
    finished.says(
        "lateral-x.csv: read as CSV with semicolons between fields and a decimal comma, channel \
         names in line 5, units below them",
    );
}

#[test]
fn lines_are_counted_from_the_top_whatever_stands_there() {
    for line_end in ["\n", "\r\n"] {
        let spoilt = |mut table: Table| {
            table.rows[100][4] = "off".to_owned();
            let text = table.commas().text(";", line_end);
            format!("Rate;512{line_end}{line_end}{text}").into_bytes()
        };
        // Row 100 from 0, below three lines.
        offered(spoilt)
            .refused_input("lateral-x.csv, line 104, channel `a4`: `off` … decimal comma");
    }
}

#[test]
fn times_by_many_names_and_units() {
    let exact = |n: usize| format!("{:.9}", n as f64 / RATE);
    let late = |n: usize| format!("{:.9}", 3600.0 + n as f64 / RATE);
    let milli = |n: usize| format!("{:.6}", n as f64 / RATE * 1e3);
    for name in [
        "time",
        "Time (s)",
        "Zeit",
        "Temps",
        "tempo",
        "Tiempo [s]",
        "t",
    ] {
        same(&timed(name, exact));
    }
    same(&timed("Time (s)", late));
    same(&timed("Zeit [ms]", milli));
}

#[test]
fn time_stamps() {
    let clock = |n: usize, between: &str, sign: &str| {
        let seconds = 86_398.5 + n as f64 / RATE;
        let (day, second) = if seconds < 86_400.0 {
            (2, seconds)
        } else {
            (3, seconds - 86_400.0)
        };
        let (hours, minutes) = ((second / 3600.0).floor(), (second / 60.0).floor() % 60.0);
        let text = format!("{:012.9}", second % 60.0).replace('.', sign);
        format!("2026-03-0{day}{between}{hours:02}:{minutes:02}:{text}")
    };
    same(&timed("time", |n| clock(n, "T", ".") + "Z"));
    same(&timed("Zeitpunkt der Messung", |n| clock(n, " ", ".")));
    let comma = |table: Table| {
        let table = table.commas().timed("Zeit", |n| clock(n, " ", ","));
        table.text(";", "\r\n").into_bytes()
    };
    same(&offered(comma).setup("sample_rate", "# sample_rate"));
}

/// Times of three and of two decimals at 512 Hz: half a sample and five samples. The rate that is
/// stated counts; without one it is the mean over the file, 6 s, which is known to a part in
/// 6000 and in 600.
#[test]
fn rounded_times() {
    let rounded = |decimals: usize| move |n: usize| format!("{:.decimals$}", n as f64 / RATE);
    for decimals in [2, 3] {
        let form = |table: Table| table.timed("Time (s)", rounded(decimals)).text(",", "\n");
        same(&offered(|table| form(table).into_bytes()));
    }
    let finished = timed("time", rounded(3)).identify(&["--verbose"]);
    assert_eq!(finished.code, Some(0), "{finished:?}");
    finished.says("its times are rounded to 0.001 s … is the mean over the file … `sample_rate`");
    // 3071 steps of 1/512 s take 5.998 s when rounded, so that the mean is 512.003 Hz.
    finished.says("3072 samples at 512.00");
}

#[test]
fn a_sample_that_is_lost_is_found_in_rounded_times() {
    let lost = |n: usize| format!("{:.3}", (n + usize::from(n > 1500)) as f64 / RATE);
    timed("time", lost)
        .setup("# sample_rate", "sample_rate")
        .refused_input("lateral-x.csv, line 150 … samples are missing or doubled");
}

#[test]
fn what_the_setup_states_is_not_guessed() {
    let form = |table: Table| {
        let text = table
            .commas()
            .text("|", "\n")
            .replacen('\n', "\nnot|a|sample\n", 1);
        format!("a1|a2\n1|2\n{text}").into_bytes()
    };
    let keys = "[recording]\ndelimiter = \"|\"\ndecimal = \",\"\nheader = 3\nfirst_row = 5\ntime = \"\"\n\n[processing]";
    same(&offered(form).setup("[processing]", keys));
    // All of them are wrong somehow.
    for (key, words) in [
        (
            "delimiter = \"a\"",
            "`delimiter` is \"a\" … expected the character between two fields",
        ),
        (
            "decimal = \";\"",
            "`decimal` is \";\" … expected \".\" or \",\"",
        ),
        (
            "header = 0",
            "`header` is 0 … expected the number of a line",
        ),
        (
            "first = 3",
            "there is no key `first` … did you mean `first_row`?",
        ),
    ] {
        let setup = format!("[recording]\n{key}\n\n[processing]");
        Bench::fork()
            .setup("[processing]", &setup)
            .refused_input(words);
    }
    let setup = "[recording]\ntime = \"Zeit\"\n\n[processing]";
    Bench::fork()
        .setup("[processing]", setup)
        .refused_input("no channel `Zeit`");
}

#[test]
fn a_comma_that_could_be_either_is_refused() {
    let form = |table: Table| {
        let mut table = table.commas();
        for (n, field) in table.rows.iter_mut().flatten().enumerate() {
            *field = format!("{},{:03}", 1 + n % 900, n % 1000);
        }
        table.text("\t", "\n").into_bytes()
    };
    offered(form).refused_input(
        "lateral-x.csv, line 2: `1,000` … decimal comma or thousands … `decimal = \",\"`",
    );
}

/// Head of a matrix `a1` of 100 rows, as `scipy.io.savemat` writes it with `format="4"`.
fn mat_4(bytes: fn(u32) -> [u8; 4]) -> Vec<u8> {
    let big = bytes(1) == 1_u32.to_be_bytes();
    let words = [if big { 1000 } else { 0 }, 100, 1, 0, 3].map(bytes);
    [words.as_flattened(), b"a1\0", &[0; 800]].concat()
}

#[test]
fn files_of_other_kinds_are_refused_with_the_way_out() {
    let zip = |name: &str| {
        [
            b"PK\x03\x04\x14\0\x06\0\x08\0".as_slice(),
            &[0; 20],
            name.as_bytes(),
            &[7; 90],
        ]
        .concat()
    };
    for (bytes, words) in [
        (
            zip("[Content_Types].xml"),
            "Excel workbook (.xlsx) … save the sheet as CSV",
        ),
        (
            b"CDF\x01\0\0\0\0".to_vec(),
            "netCDF file of version 3 … nccopy -k nc4",
        ),
        (zip("a.npy"), "archive of NumPy (.npz) … as CSV"),
        (
            b"\x93NUMPY\x01\0v\0".to_vec(),
            "array of NumPy (.npy) … as CSV",
        ),
        (
            b"BZh91AY&SY".to_vec(),
            "compressed by bzip2; unpack it first",
        ),
        (
            b"\xfd7zXZ\0\0".to_vec(),
            "compressed by xz; unpack it first",
        ),
        (mat_4(u32::to_le_bytes), "MAT file of version 4 … '-v7'"),
        (mat_4(u32::to_be_bytes), "MAT file of version 4 … '-v7'"),
    ] {
        Bench::fork()
            .write(RECORDINGS[0], bytes)
            .refused_input(&format!("lateral-x.csv: this is … {words}"));
    }
}
