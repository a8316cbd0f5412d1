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
