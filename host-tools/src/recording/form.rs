//! The form of recordings, where the setup states it.

/// Form of text recordings, as the section `[recording]` of a setup states it; `None`: seen from
/// the file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Form {
    /// Character between two fields.
    pub delimiter: Option<u8>,
    /// Character before the decimals of a number: `.` or `,`.
    pub decimal: Option<u8>,
    /// Line of the channels' names, counted from one.
    pub header: Option<u64>,
    /// Line of the first sample, counted from one.
    pub first_row: Option<u64>,
    /// Name of the column of time; empty: no column is read as time.
    pub time: Option<String>,
}

/// Characters that may stand between two fields, with their names.
pub(super) const DELIMITERS: [(u8, &str); 4] = [
    (b',', "commas"),
    (b';', "semicolons"),
    (b'\t', "tabs"),
    (b' ', "blanks"),
];

/// Name of a character between fields.
pub(super) fn delimiter_name(delimiter: u8) -> String {
    let known = DELIMITERS.iter().find(|(byte, _)| *byte == delimiter);
    known.map_or_else(
        || format!("`{}`", char::from(delimiter)),
        |(_, name)| (*name).to_owned(),
    )
}
