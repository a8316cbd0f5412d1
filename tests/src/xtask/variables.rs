//! The static variables of a firmware, from its ELF: names, memories and sizes.

use object::SymbolKind;
use object::read::{Object, ObjectSymbol};

use super::image::{Elf, Region};

/// A static variable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variable {
    /// Path in the program, without the firmware's own crate.
    pub name: String,
    /// Memory that holds it.
    pub region: String,
    /// Size, bytes.
    pub size: u64,
}

/// Crate that is left out of the names.
const OWN: &str = "massline_firmware::";
/// Prefixes of the variables that RTIC defines in its module.
const RTIC: [&str; 3] = [
    "board::tasks::app::__rtic_internal_local_init_",
    "board::tasks::app::__rtic_internal_local_resource_",
    "board::tasks::app::__rtic_internal_shared_resource_",
];

/// The variables of a program of the chip in these memories, largest first.
///
/// # Errors
///
/// [`object::Error`] if the bytes are no 32-bit little-endian ELF. One without symbols has no
/// variables.
pub fn variables(elf: &[u8], regions: &[Region]) -> object::Result<Vec<Variable>> {
    let file = Elf::parse(elf)?;
    let mut variables = Vec::new();
    for symbol in file.symbols() {
        let region = regions.iter().find(|r| r.contains(symbol.address()));
        if let (Some(region), SymbolKind::Data) = (region, symbol.kind())
            && symbol.size() > 0
        {
            variables.push(Variable {
                name: name(symbol.name()?),
                region: region.name.clone(),
                size: symbol.size(),
            });
        }
    }
    variables.sort_by(|a, b| b.size.cmp(&a.size).then_with(|| a.name.cmp(&b.name)));
    Ok(variables)
}

/// The path of a compiler's symbol, or the symbol if it is not one of Rust's.
fn name(symbol: &str) -> String {
    // Without the hash of the crate. A closure has no name: `{{closure}}`, `{closure#0}`.
    let path = format!("{:#}", rustc_demangle::demangle(symbol));
    let parts = path.split("::").filter(|part| !part.starts_with('{'));
    let path = parts.collect::<Vec<_>>().join("::");
    let path = path.strip_prefix(OWN).unwrap_or(&path);
    let own = RTIC.iter().find_map(|prefix| path.strip_prefix(prefix));
    own.unwrap_or(path).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::xtask::image;

    #[test]
    fn reads_both_kinds_of_symbols() {
        for (symbol, expected) in [
            (
                "_ZN17massline_firmware5board6memory4RUNS17h81a6f64c414e7edbE",
                "board::memory::RUNS",
            ),
            (
                "_RNvNtNtCshafcQwUwCFo_17massline_firmware5board6memory4RUNS",
                "board::memory::RUNS",
            ),
            (
                "_ZN17massline_firmware5board5tasks3app34__rtic_internal_local_init_working17h4c45b15882a980c3E",
                "working",
            ),
            (
                "_RNvNtNtNtCshafcQwUwCFo_17massline_firmware5board5tasks3app34___rtic_internal_local_init_working",
                "working",
            ),
            (
                "_ZN17massline_firmware5board5tasks3app4init28_$u7b$$u7b$closure$u7d$$u7d$3VAR17hd27cbfb8026489e2E",
                "board::tasks::app::init::VAR",
            ),
            (
                "_RNvNCNvNtNtNtCshafcQwUwCFo_17massline_firmware5board5tasks3app4inits_03VAR",
                "board::tasks::app::init::VAR",
            ),
            (
                "_ZN9defmt_rtt6BUFFER17h900b04e2c8b63873E",
                "defmt_rtt::BUFFER",
            ),
            ("__INTERRUPTS", "__INTERRUPTS"),
            ("_RINvXs_not_of_this_kind", "_RINvXs_not_of_this_kind"),
        ] {
            assert_eq!(name(symbol), expected, "{symbol}");
        }
    }

    /// An ELF of a table of symbols and its texts: name, address, size, type.
    fn elf(symbols: &[(&str, u32, u32, u8)]) -> Vec<u8> {
        let mut texts = vec![0];
        let mut table = Vec::new();
        for (name, address, size, kind) in symbols {
            for value in [texts.len() as u32, *address, *size, u32::from(*kind)] {
                table.extend(value.to_le_bytes());
            }
            texts.extend(name.bytes().chain([0]));
        }
        let mut bytes = b"\x7fELF\x01\x01\x01".to_vec();
        bytes.resize(52, 0);
        // Three sections, of which the last has the texts of symbols and of sections.
        (bytes[32], bytes[46], bytes[48], bytes[50]) = (52, 40, 3, 2);
        let data = 52 + 3 * 40;
        for [kind, offset, size, link, each] in [
            [0; 5],
            [2, data, table.len() as u32, 2, 16],
            [3, data + table.len() as u32, texts.len() as u32, 0, 0],
        ] {
            for value in [0, kind, 0, 0, offset, size, link, 0, 4, each] {
                bytes.extend(value.to_le_bytes());
            }
        }
        bytes.extend(table);
        bytes.extend(texts);
        bytes
    }

    #[test]
    fn finds_variables_and_nothing_else() {
        let regions = image::regions(
            "RAM : ORIGIN = 0x20000000, LENGTH = 1K\nCCM : ORIGIN = 0x10000000, LENGTH = 1K",
        );
        let bytes = elf(&[
            ("", 0, 0, 0),
            ("small", 0x2000_0000, 8, 1),
            ("a_function", 0x2000_0010, 80, 2),
            ("in_flash", 0x0800_0000, 800, 1),
            ("a_label", 0x2000_0020, 0, 1),
            ("large", 0x1000_0000, 80, 1),
        ]);
        let found = variables(&bytes, &regions).unwrap();
        let found: Vec<_> = found
            .iter()
            .map(|v| (v.name.as_str(), v.region.as_str(), v.size))
            .collect();
        assert_eq!(found, [("large", "CCM", 80), ("small", "RAM", 8)]);
    }

    #[test]
    fn refuses_bytes_that_are_no_whole_elf() {
        assert!(variables(b"MZ", &[]).is_err());
        let whole = elf(&[("a", 1, 1, 1)]);
        assert!(variables(&whole, &[]).is_ok());
        assert!(variables(&whole[..60], &[]).is_err());
    }
}
