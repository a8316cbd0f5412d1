//! Writers of the formats that tests offer.

use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::io::Write;

pub const RATE: f64 = 512.0;

/// Form of numbers in a universal file.
#[derive(Clone, Copy, PartialEq)]
pub enum Numbers {
    /// E13.5.
    Single,
    /// E20.12.
    Double,
    /// 58b of single precision, most significant byte first or not.
    Binary { big: bool },
    /// The same of double precision.
    Wide { big: bool },
}

/// As Fortran prints it: ` 1.23450E+00`.
fn exponential(value: f64, width: usize, decimals: usize) -> String {
    let text = format!("{value:.decimals$e}");
    let (digits, exponent) = text.split_once('e').unwrap();
    let exponent: i32 = exponent.parse().unwrap();
    let sign = if exponent < 0 { '-' } else { '+' };
    let number = format!("{digits}E{sign}{:02}", exponent.abs());
    format!("{number:>width$}")
}

/// A dataset 58 with this first line of description, node and direction.
pub fn set58(name: &str, node: i32, direction: i32, readings: &[f32], numbers: Numbers) -> Vec<u8> {
    let double = matches!(numbers, Numbers::Double | Numbers::Wide { .. });
    let mut out = b"    -1\n    58".to_vec();
    match numbers {
        Numbers::Binary { big } | Numbers::Wide { big } => {
            let bytes = readings.len() * if double { 8 } else { 4 };
            let order = if big { 2 } else { 1 };
            out.extend(
                format!(
                    "b{order:6}     2          11{bytes:12}     0     0           0           0\n"
                )
                .bytes(),
            );
        }
        _ => out.push(b'\n'),
    }
    let lines = [
        format!("{name:<80}"),
        "NONE".to_owned(),
        "02-MAR-26 12:00:00".to_owned(),
        "NONE".to_owned(),
        "NONE".to_owned(),
        format!(
            "    1         0    0         0       NONE{node:10}{direction:4}       NONE         0   0"
        ),
        format!(
            "{:10}{:10}         1{}{}{}",
            if double { 4 } else { 2 },
            readings.len(),
            exponential(0.0, 13, 5),
            exponential(1.0 / RATE, 13, 5),
            exponential(0.0, 13, 5)
        ),
        "        17    0    0    0                 Time                    s".to_owned(),
        "         0    0    0    0                 NONE                 NONE".to_owned(),
        "         0    0    0    0                 NONE                 NONE".to_owned(),
        "         0    0    0    0                 NONE                 NONE".to_owned(),
    ];
    out.extend(lines.iter().flat_map(|line| line.bytes().chain([b'\n'])));
    let wide = readings.iter().map(|x| f64::from(*x));
    match numbers {
        Numbers::Single | Numbers::Double => {
            let (width, decimals, across) = if double { (20, 12, 4) } else { (13, 5, 6) };
            for row in readings.chunks(across) {
                let fields = row
                    .iter()
                    .map(|x| exponential(f64::from(*x), width, decimals));
                out.extend(fields.collect::<String>().bytes().chain([b'\n']));
            }
        }
        Numbers::Binary { big: false } => out.extend(readings.iter().flat_map(|x| x.to_le_bytes())),
        Numbers::Binary { big: true } => out.extend(readings.iter().flat_map(|x| x.to_be_bytes())),
        Numbers::Wide { big: false } => out.extend(wide.flat_map(f64::to_le_bytes)),
        Numbers::Wide { big: true } => out.extend(wide.flat_map(f64::to_be_bytes)),
    }
    out.extend(b"    -1\n");
    out
}

/// An element of a MAT file.
fn padded(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut out = kind.to_le_bytes().to_vec();
    out.extend((data.len() as u32).to_le_bytes());
    out.extend(data);
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

/// A matrix of a MAT file: its bytes as an element.
pub fn matrix(name: &str, rows: usize, values: &[f64], single: bool) -> Vec<u8> {
    let word = |n: u32| n.to_le_bytes();
    let across = (values.len() / rows) as u32;
    let mut inner = padded(6, &[word(if single { 7 } else { 6 }), word(0)].concat());
    inner.extend(padded(5, &[word(rows as u32), word(across)].concat()));
    inner.extend(padded(1, name.as_bytes()));
    let data: Vec<u8> = if single {
        values
            .iter()
            .flat_map(|x| (*x as f32).to_le_bytes())
            .collect()
    } else {
        values.iter().flat_map(|x| x.to_le_bytes()).collect()
    };
    inner.extend(padded(if single { 7 } else { 9 }, &data));
    padded(14, &inner)
}

/// An object of a MAT file, such as a table, and the bytes without a name that MATLAB writes behind all variables.
pub fn object(name: &str) -> Vec<u8> {
    let mut inner = padded(6, &[17, 0, 0, 0, 0, 0, 0, 0]);
    for text in [name, "MCOS", "timetable"] {
        inner.extend(padded(1, text.as_bytes()));
    }
    inner.extend(matrix("", 6, &[0.0; 6], false));
    [padded(14, &inner), matrix("", 1, &[7.0; 5000], true)].concat()
}

/// A MAT file of elements.
pub fn mat(elements: &[Vec<u8>], compressed: bool) -> Vec<u8> {
    let mut out = vec![b' '; 124];
    out[..19].copy_from_slice(b"MATLAB 5.0 MAT-file");
    out.extend([0, 1, b'I', b'M']);
    for element in elements {
        if compressed {
            let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
            encoder.write_all(element).unwrap();
            let packed = encoder.finish().unwrap();
            out.extend(15_u32.to_le_bytes());
            out.extend((packed.len() as u32).to_le_bytes());
            out.extend(packed);
        } else {
            out.extend(element);
        }
    }
    out
}

/// Form of raw data in a TDMS file.
#[derive(Clone, Copy)]
pub struct Raw {
    pub interleaved: bool,
    pub big: bool,
    /// Samples of a segment; several of them repeat the metadata of the first.
    pub segment: usize,
}

/// A TDMS file of one group.
pub fn tdms(names: &[String], readings: &[Vec<f32>], raw: Raw) -> Vec<u8> {
    let word = |n: u32| {
        if raw.big {
            n.to_be_bytes()
        } else {
            n.to_le_bytes()
        }
    };
    let long = |n: u64| {
        if raw.big {
            n.to_be_bytes()
        } else {
            n.to_le_bytes()
        }
    };
    let text = |text: &str| [&word(text.len() as u32)[..], text.as_bytes()].concat();
    let mut out = Vec::new();
    let samples = readings[0].len();
    for begin in (0..samples).step_by(raw.segment) {
        let end = (begin + raw.segment).min(samples);
        let mut metadata = Vec::new();
        // The last segment may be shorter, which its metadata say.
        if begin == 0 || end - begin < raw.segment {
            metadata.extend(word(names.len() as u32 + 1));
            metadata.extend([text("/"), word(u32::MAX).to_vec(), word(0).to_vec()].concat());
            for name in names {
                metadata.extend(text(&format!("/'rig'/'{name}'")));
                metadata.extend([word(20), word(9), word(1)].concat());
                metadata.extend(long((end - begin) as u64));
                metadata.extend([&word(1)[..], &text("wf_increment"), &word(10)].concat());
                metadata.extend(long((1.0 / RATE).to_bits()));
            }
        }
        let value = |c: usize, n: usize| word(readings[c][n].to_bits());
        let data: Vec<u8> = if raw.interleaved {
            (begin..end)
                .flat_map(|n| (0..names.len()).flat_map(move |c| value(c, n)))
                .collect()
        } else {
            (0..names.len())
                .flat_map(|c| (begin..end).flat_map(move |n| value(c, n)))
                .collect()
        };
        let metadata_flags = if metadata.is_empty() { 0 } else { 0b110 };
        let flags =
            metadata_flags | 0b1000 | u32::from(raw.interleaved) << 5 | u32::from(raw.big) << 6;
        out.extend(b"TDSm");
        out.extend(flags.to_le_bytes());
        out.extend(word(4713));
        out.extend(long((metadata.len() + data.len()) as u64));
        out.extend(long(metadata.len() as u64));
        out.extend(metadata);
        out.extend(data);
    }
    out
}
