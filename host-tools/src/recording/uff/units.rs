//! Unit of an ordinate: its label, else its quantity in the units of dataset 164.

use super::header::Header;

/// Units of length and force by the code of dataset 164: SI, foot and pound-force, metre and
/// kilogram-force, foot and poundal, millimetre and millinewton, centimetre and centinewton, inch
/// and pound-force, millimetre and kilogram-force.
const SYSTEMS: [(&str, &str); 8] = [
    ("m", "N"),
    ("ft", "lbf"),
    ("m", "kgf"),
    ("ft", "pdl"),
    ("mm", "mN"),
    ("cm", "cN"),
    ("in", "lbf"),
    ("mm", "kgf"),
];

/// Code of the units of a dataset 164 by its first line.
pub(super) fn code(line: &str) -> Option<usize> {
    line.split_whitespace().next()?.parse().ok()
}

/// Unit of the readings of a set; `system` is the code of a dataset 164 above it.
pub(super) fn unit(header: &Header, system: Option<usize>) -> Option<String> {
    if let Some(label) = &header.unit {
        return Some(label.clone());
    }
    let (length, force) = SYSTEMS.get(system?.checked_sub(1)?)?;
    // Where exponents are given, they go before those that the quantity has by itself.
    Some(match (header.quantity, header.exponents) {
        (8, _) => (*length).to_owned(),
        (11, _) => format!("{length}/s"),
        (12, _) => format!("{length}/s²"),
        (13, [1, 1, 0]) => format!("{force} {length}"),
        (9 | 13, [0, 0 | 1, 0]) => (*force).to_owned(),
        _ => return None,
    })
}
