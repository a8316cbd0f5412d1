//! The places in a firmware where it can panic, from its ELF, crate by crate.
//!
//! # Design
//!
//! Whatever panics (an index out of range, an overflow that is checked, an assertion, an `unwrap`)
//! hands over a `core::panic::Location`: a constant of four words, which are the address and the
//! length of the source file's name, the line and the column. The linker keeps those that some
//! code still refers to, and no others. So they are looked for in what is loaded: four words in a
//! row, the first two of which name a text in the ELF that ends in `.rs`. Disassembly would count
//! calls, which the compiler merges and splits as it likes. A place in the source is one place, also
//! where generic code of it was compiled in several units, each of which has its own constant.
//!
//! The numbers are held against [`BUDGET`]. A crate that is not in it has none.

use std::collections::BTreeMap;

use object::read::{Object, ObjectSegment};

use super::image::Elf;

/// Places where the firmware may panic, by crate: one is lowered freely, and raised only with the
/// reason in the commit.
///
/// Of those that are left, no input reaches one that is not checked before. They are the HAL's
/// about clocks and pins, at the start; postcard's about its own state;
/// nalgebra's about shapes, which are the same in every call; and the firmware's own at the start,
/// where the host asks for a failure, and, for most of them, sums that are checked for overflow.
pub const BUDGET: [(&str, usize); 9] = [
    ("massline-core", 0),
    ("massline-firmware", 14),
    ("defmt-rtt", 2),
    ("heapless", 7),
    ("libm", 6),
    ("nalgebra", 9),
    ("postcard", 4),
    ("stm32f4xx-hal", 35),
    (STANDARD, 8),
];

/// Name of the standard library in the budget: `core` is ours.
const STANDARD: &str = "the standard library";

/// A place in a source file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// The file, as the compiler was given it.
    pub file: String,
    /// Its line.
    pub line: u32,
    /// Its column.
    pub column: u32,
}

/// The places where a program of the chip can panic, by crate.
///
/// # Errors
///
/// [`object::Error`] if the bytes are no whole 32-bit little-endian ELF.
pub fn places(elf: &[u8]) -> object::Result<BTreeMap<String, Vec<Place>>> {
    let file = Elf::parse(elf)?;
    let mut segments = Vec::new();
    for segment in file.segments() {
        segments.push((segment.address() as u32, segment.data()?));
    }
    let text = |address: u32, length: u32| -> Option<&str> {
        segments.iter().find_map(|(origin, bytes)| {
            let from = address.checked_sub(*origin)? as usize;
            let bytes = bytes.get(from..)?.get(..length as usize)?;
            std::str::from_utf8(bytes).ok()
        })
    };
    let mut found: BTreeMap<String, Vec<Place>> = BTreeMap::new();
    for (_, bytes) in &segments {
        let words: Vec<u32> = bytes
            .chunks_exact(4)
            .filter_map(|word| Some(u32::from_le_bytes(*word.first_chunk()?)))
            .collect();
        for window in words.windows(4) {
            let &[address, length, line, column] = window else {
                continue;
            };
            // Longer than any path, further down or across than any source goes.
            if length > 500 || !(1..100_000).contains(&line) || !(1..1000).contains(&column) {
                continue;
            }
            let name = text(address, length).filter(|name| name.ends_with(".rs"));
            let Some(file) = name.map(str::to_owned) else {
                continue;
            };
            let of_crate = found.entry(crate_of(&file)).or_default();
            of_crate.push(Place { file, line, column });
        }
    }
    for places in found.values_mut() {
        places.sort();
        places.dedup();
    }
    Ok(found)
}

/// The crate that a source file belongs to, without its version.
fn crate_of(file: &str) -> String {
    let file = file.replace('\\', "/");
    if file.starts_with("/rustc/") || file.contains("/rustlib/src/rust/library/") {
        return STANDARD.to_owned();
    }
    // The folder of a package is the one above its sources: `core` and `firmware` are ours, and
    // others carry their version.
    let folder = file.split("/src/").next().unwrap_or(&file);
    let folder = match file.rfind("/src/") {
        Some(at) if file.contains("/registry/src/") => &file[..at],
        _ => folder,
    };
    let folder = folder.rsplit('/').next().unwrap_or(folder);
    match folder {
        "core" | "firmware" => format!("massline-{folder}"),
        other => match other.rsplit_once('-') {
            Some((name, version)) if version.starts_with(|c: char| c.is_ascii_digit()) => {
                name.to_owned()
            }
            _ => other.to_owned(),
        },
    }
}

/// Holds the places against the budget: a line of text, or what is beyond it, place by place.
///
/// # Errors
///
/// The places of each crate that has too many.
pub fn judge(
    found: &BTreeMap<String, Vec<Place>>,
    budget: &[(&str, usize)],
) -> Result<String, String> {
    let allowed = |name: &str| {
        let entry = budget.iter().find(|(known, _)| *known == name);
        entry.map_or(0, |(_, most)| *most)
    };
    let mut beyond = String::new();
    for (name, places) in found {
        if places.len() <= allowed(name) {
            continue;
        }
        let most = allowed(name);
        beyond += &format!(
            "{name} can panic in {} places, {most} are allowed:\n",
            places.len()
        );
        for Place { file, line, column } in places {
            beyond += &format!("    {file}:{line}:{column}\n");
        }
    }
    if !beyond.is_empty() {
        return Err(beyond);
    }
    let counts: Vec<String> = budget
        .iter()
        .map(|(name, _)| format!("{name} {}", found.get(*name).map_or(0, Vec::len)))
        .collect();
    Ok(format!("places that can panic: {}", counts.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF of one segment at this address.
    fn elf(origin: u32, bytes: &[u8]) -> Vec<u8> {
        let length = bytes.len() as u32;
        crate::xtask::image::tests::elf(&[[1, origin, origin, length, length]], bytes)
    }

    #[test]
    fn finds_places_and_whose_they_are() {
        let files = [
            ("core/src/algebra.rs", "massline-core"),
            ("firmware/src/main.rs", "massline-firmware"),
            (
                "/home/a-1/.cargo/registry/src/index-1949cf8c6b5b557f/stm32f4xx-hal-0.23.0/src/flash.rs",
                "stm32f4xx-hal",
            ),
            ("/rustc/5980/library/core/src/slice/index.rs", STANDARD),
            (
                "/usr/lib/rustlib/src/rust/library/core/src/option.rs",
                STANDARD,
            ),
        ];
        let origin = 0x0800_0000;
        let mut texts = Vec::new();
        let mut words = Vec::new();
        for (file, _) in files {
            words.push([origin + texts.len() as u32, file.len() as u32, 57, 16]);
            texts.extend(file.bytes());
        }
        // One more copy of the first.
        words.push(words[0]);
        // A text that is no source's name, an address of nothing, and no line.
        words.push([origin, 4, 57, 16]);
        words.push([origin - 4, 19, 57, 16]);
        words.push([origin, 19, 0, 16]);
        texts.resize(texts.len().next_multiple_of(4), 0);
        texts.extend(
            words
                .as_flattened()
                .iter()
                .flat_map(|word| word.to_le_bytes()),
        );
        let found = places(&elf(origin, &texts)).unwrap();
        let counts: Vec<_> = found
            .iter()
            .map(|(name, p)| (name.as_str(), p.len()))
            .collect();
        let expected = [
            ("massline-core", 1),
            ("massline-firmware", 1),
            ("stm32f4xx-hal", 1),
            (STANDARD, 2),
        ];
        assert_eq!(counts, expected);
        let place = &found["massline-core"][0];
        assert_eq!(
            (place.file.as_str(), place.line, place.column),
            (files[0].0, 57, 16)
        );
        let wide: Vec<(&str, usize)> = expected.to_vec();
        assert!(judge(&found, &wide).unwrap().contains("massline-core 1, "));
        let error = judge(&found, &wide[1..]).unwrap_err();
        assert!(error.contains("core/src/algebra.rs:57:16"), "{error}");
        assert!(!error.contains("stm32f4xx-hal"), "{error}");
    }

    #[test]
    fn refuses_what_is_no_elf_or_cut_short() {
        assert!(places(b"MZ").is_err());
        let whole = elf(0, &[0; 40]);
        assert!(places(&whole).is_ok());
        assert!(places(&whole[..100]).is_err());
    }
}
