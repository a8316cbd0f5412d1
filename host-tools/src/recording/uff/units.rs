//! Unit of an ordinate: its label, else its quantity in the units of dataset 164.

use super::header::Header;

/// Units of length and force by the code of dataset 164: SI, foot and pound-force, metre and
/// kilogram-force, foot and poundal, millimetre and millinewton, centimetre and centinewton, inch
/// and pound-force, millimetre and kilogram-force, a user's own (by its factors), millimetre and newton.
const SYSTEMS: [(&str, &str); 10] = [
    ("m", "N"),
    ("ft", "lbf"),
    ("m", "kgf"),
    ("ft", "pdl"),
    ("mm", "mN"),
    ("cm", "cN"),
    ("in", "lbf"),
    ("mm", "kgf"),
    ("", ""),
    ("mm", "N"),
];
/// Code of a user's own units.
const OWN: usize = 9;

/// Units of length and of force.
pub(super) type System = (&'static str, &'static str);

/// Units by their number in a metre and in a newton, for systems of a user's own.
const LENGTHS: [(&str, f64); 5] = [
    ("m", 1.0),
    ("mm", 1000.0),
    ("cm", 100.0),
    ("in", 39.370_078_740_157_48),
    ("ft", 3.280_839_895_013_123),
];
const FORCES: [(&str, f64); 6] = [
    ("N", 1.0),
    ("mN", 1000.0),
    ("cN", 100.0),
    ("kN", 0.001),
    ("lbf", 0.224_808_943_099_710_5),
    ("kgf", 0.101_971_621_297_792_8),
];

/// Units of a dataset 164 by its lines: the code, and for code 9 the factors from SI on the next
/// line. `None` where they are none of those above.
pub(super) fn system(lines: &[String]) -> Option<System> {
    // FORMAT(I10,20A1,I10): the description may follow the code without a space.
    let line = lines.first()?.trim_start();
    let digits = line.find(|c: char| !c.is_ascii_digit());
    let code: usize = line[..digits.unwrap_or(line.len())].parse().ok()?;
    if code != OWN {
        return SYSTEMS.get(code.checked_sub(1)?).copied();
    }
    let line = lines.get(1)?.replace(['d', 'D'], "e");
    let mut factors = line
        .split_whitespace()
        .map_while(|word| word.parse::<f64>().ok());
    let [length, force] = [factors.next()?, factors.next()?];
    // Factors are printed with six digits and more.
    let named = |units: &[(&'static str, f64)], factor: f64| {
        let unit = units
            .iter()
            .find(|(_, own)| (factor / own - 1.0).abs() < 1e-5);
        unit.map(|(name, _)| *name)
    };
    Some((named(&LENGTHS, length)?, named(&FORCES, force)?))
}

/// Unit of the readings of a set; `system` are the units of a dataset 164 above it.
pub(super) fn unit(header: &Header, system: Option<System>) -> Option<String> {
    if let Some(label) = &header.unit {
        return Some(label.clone());
    }
    let (length, force) = system?;
    // Where exponents are given, they go before those that the quantity has by itself.
    Some(match (header.quantity, header.exponents) {
        (8, _) => length.to_owned(),
        (11, _) => format!("{length}/s"),
        (12, _) => format!("{length}/s²"),
        (13, [1, 1, 0]) => format!("{force} {length}"),
        (9 | 13, [0, 0 | 1, 0]) => force.to_owned(),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_by_code_and_by_factors() {
        let system =
            |lines: &[&str]| system(&lines.iter().map(|l| (*l).to_owned()).collect::<Vec<_>>());
        // The example of the format's description.
        let example = "         2Foot (pound f)               2";
        assert_eq!(system(&[example]), Some(("ft", "lbf")));
        assert_eq!(system(&["SI: Meter (newton)"]), None);
        assert_eq!(system(&["         1  SI"]), Some(("m", "N")));
        assert_eq!(system(&["         5  mm"]), Some(("mm", "mN")));
        assert_eq!(system(&["        10  MN"]), Some(("mm", "N")));
        assert_eq!(system(&["        11  ?"]), None);
        let own = "  3.93700787401575D+01  2.24808943099710D-01  1.8D+00";
        assert_eq!(system(&["         9  user", own]), Some(("in", "lbf")));
        assert_eq!(system(&["         9  user", "  2.0D+00  1.0D+00"]), None);
    }
}
