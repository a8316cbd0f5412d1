//! Files of kinds that are not read, by name and with the way out.

use super::{Format, RecordingError};

/// The format of these files, which opens none of them.
pub(super) const FORMAT: Format = Format {
    recognises: |start| kind(start).is_some(),
    open: |input, _| {
        let (name, advice) = kind(&input.start).unwrap_or_default();
        Err(RecordingError::OtherKind {
            file: input.file,
            kind: name.to_owned(),
            advice,
        })
    },
};

const TO_CSV: &str = "open it in its program and save the sheet as CSV";
const TO_NETCDF_4: &str = "write it as netCDF-4: `nccopy -k nc4 IN OUT`";
const TO_GZIP: &str = "unpack it first; CSV and WAV may be packed by gzip";
const FROM_NUMPY: &str = "write it as CSV with the names of its channels above: from pandas by DataFrame(data, columns=names).to_csv(…, index=False), or by to_parquet";
const AS_V7: &str = "load it in MATLAB and save it by `save(name, '-v7')`, from Python by scipy.io.savemat with format='5'";
const EXPORT: &str = "export the recording as CSV, UFF 58, MAT (-v7), TDMS or WAV";

/// Name of a kind, and what to do, by the first bytes.
fn kind(start: &[u8]) -> Option<(&'static str, &'static str)> {
    let has = |name: &[u8]| start.windows(name.len()).any(|part| part == name);
    Some(match start {
        s if s.starts_with(b"CDF\x01")
            || s.starts_with(b"CDF\x02")
            || s.starts_with(b"CDF\x05") =>
        {
            ("a netCDF file of version 3", TO_NETCDF_4)
        }
        s if s.starts_with(b"PK\x03\x04") && (has(b"xl/") || has(b"[Content_Types].xml")) => {
            ("an Excel workbook (.xlsx)", TO_CSV)
        }
        s if s.starts_with(b"PK\x03\x04") && has(b"opendocument.spreadsheet") => {
            ("a spreadsheet (.ods)", TO_CSV)
        }
        s if s.starts_with(b"PK\x03\x04") && has(b".npy") => {
            ("an archive of NumPy (.npz)", FROM_NUMPY)
        }
        s if s.starts_with(b"PK\x03\x04") => ("a ZIP archive", "unpack it first"),
        s if s.starts_with(b"7z\xbc\xaf\x27\x1c") || s.starts_with(b"Rar!\x1a\x07") => {
            ("an archive", "unpack it first")
        }
        s if s.starts_with(b"BZh") => ("compressed by bzip2", TO_GZIP),
        s if s.starts_with(b"\xfd7zXZ\0") => ("compressed by xz", TO_GZIP),
        s if s.starts_with(b"\x28\xb5\x2f\xfd") => ("compressed by Zstandard", TO_GZIP),
        s if s.starts_with(b"\x93NUMPY") => ("an array of NumPy (.npy)", FROM_NUMPY),
        s if s.starts_with(b"ARROW1") => (
            "an Arrow file (Feather)",
            "write it as Parquet: from pandas by read_feather(IN).to_parquet(OUT)",
        ),
        s if s.starts_with(b"|CF,") => ("a FAMOS file of imc", EXPORT),
        s if is_mat_4(s) => ("a MAT file of version 4", AS_V7),
        s if s.starts_with(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1") => (
            "an Excel workbook (.xls) or another file of Microsoft Office",
            TO_CSV,
        ),
        s if s.starts_with(b"MDF     ") || s.starts_with(b"UnFinMF ") => ("an MDF file", EXPORT),
        s if s.starts_with(b"%PDF-") => ("a PDF document", EXPORT),
        _ => return None,
    })
}

/// `true` of the head of a matrix in a MAT file of version 4, of either order of bytes: its type, rows, columns, parts,
/// and the length of its name with a zero at the end, which stands behind them.
fn is_mat_4(start: &[u8]) -> bool {
    let (words, _) = start.as_chunks::<4>();
    let Some(words) = words.first_chunk::<5>() else {
        return false;
    };
    [u32::from_le_bytes, u32::from_be_bytes].iter().any(|of| {
        let [kind, rows, columns, complex, length] = words.map(of);
        // Thousands: order of bytes; tens: type of numbers; ones: full, text or sparse.
        let is_kind = kind / 1000 <= 1 && kind % 1000 < 60 && kind % 10 <= 2;
        let name = start.get(20..).unwrap_or(&[]);
        let Some([name @ .., 0]) = name.get(..length as usize) else {
            return false;
        };
        let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
        let is_name = name.first().is_some_and(u8::is_ascii_alphabetic) && name.iter().all(is_word);
        is_kind && rows > 0 && columns > 0 && complex <= 1 && is_name
    })
}
