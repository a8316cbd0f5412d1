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
const TO_MAT_5: &str = "save it in MATLAB by save(file, names, \"-v7\"), or export it as CSV";
const EXPORT: &str = "export the recording as CSV, UFF 58, MAT (-v7), TDMS or WAV";

/// Name of a kind, and what to do, by the first bytes.
fn kind(start: &[u8]) -> Option<(&'static str, &'static str)> {
    const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";
    let has = |name: &[u8]| start.windows(name.len()).any(|part| part == name);
    // The signature of HDF5 may come behind 512, 1024, 2048 … bytes of others.
    let hdf5 = [0, 512, 1024, 2048].into_iter();
    let mut hdf5 = hdf5.filter_map(|at| start.get(at..));
    Some(match start {
        s if s.starts_with(b"MATLAB 7.3 MAT-file") => {
            ("a MAT file of version 7.3, which is HDF5", TO_MAT_5)
        }
        _ if hdf5.any(|s| s.starts_with(HDF5)) => ("an HDF5 or netCDF-4 file", EXPORT),
        s if s.starts_with(b"CDF\x01")
            || s.starts_with(b"CDF\x02")
            || s.starts_with(b"CDF\x05") =>
        {
            ("a netCDF file", EXPORT)
        }
        s if s.starts_with(b"PK\x03\x04") && (has(b"xl/") || has(b"[Content_Types].xml")) => {
            ("an Excel workbook (.xlsx)", TO_CSV)
        }
        s if s.starts_with(b"PK\x03\x04") && has(b"opendocument.spreadsheet") => {
            ("a spreadsheet (.ods)", TO_CSV)
        }
        s if s.starts_with(b"PK\x03\x04") => ("a ZIP archive", "unpack it first"),
        s if s.starts_with(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1") => (
            "an Excel workbook (.xls) or another file of Microsoft Office",
            TO_CSV,
        ),
        s if s.starts_with(b"MDF     ") || s.starts_with(b"UnFinMF ") => ("an MDF file", EXPORT),
        s if s.starts_with(b"%PDF-") => ("a PDF document", EXPORT),
        _ => return None,
    })
}
