//! The static variables of a firmware, from its ELF: names, memories and sizes.

use super::image::Region;

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
const OWN: &str = "massline_firmware";
/// Prefixes of the variables that RTIC defines in its module.
const RTIC: [&str; 3] = [
    "board::tasks::app::__rtic_internal_local_init_",
    "board::tasks::app::__rtic_internal_local_resource_",
    "board::tasks::app::__rtic_internal_shared_resource_",
];

/// The variables of a 32-bit little-endian ELF in these memories, largest first; `None` if the
/// bytes are no such ELF, or have no symbols.
pub fn variables(elf: &[u8], regions: &[Region]) -> Option<Vec<Variable>> {
    const SYMBOLS: u32 = 2;
    const OBJECT: u8 = 1;
    let half = |at: usize| Some(u16::from_le_bytes(*elf.get(at..)?.first_chunk()?));
    let word = |at: usize| Some(u32::from_le_bytes(*elf.get(at..)?.first_chunk()?) as usize);

    if !elf.starts_with(b"\x7fELF\x01\x01") {
        return None;
    }
    let (table, size, count) = (word(32)?, usize::from(half(46)?), usize::from(half(48)?));
    let section = |n: usize| table + n * size;
    let symbols = (0..count)
        .map(section)
        .find(|at| word(at + 4) == Some(SYMBOLS as usize))?;
    let (begin, length, each) = (
        word(symbols + 16)?,
        word(symbols + 20)?,
        word(symbols + 36)?,
    );
    let texts = word(section(word(symbols + 24)?) + 16)?;
    let mut variables = Vec::new();
    for at in (begin..begin + length).step_by(each.max(1)) {
        let (text, address, size) = (word(at)?, word(at + 4)? as u64, word(at + 8)? as u64);
        let region = regions
            .iter()
            .find(|r| (r.origin..r.origin + r.length).contains(&address));
        if let (Some(region), OBJECT) = (region, elf.get(at + 12)? & 0xF)
            && size > 0
        {
            let text = elf.get(texts + text..)?.split(|byte| *byte == 0).next()?;
            variables.push(Variable {
                name: name(std::str::from_utf8(text).ok()?),
                region: region.name.clone(),
                size,
            });
        }
    }
    variables.sort_by(|a, b| b.size.cmp(&a.size).then_with(|| a.name.cmp(&b.name)));
    Some(variables)
}

/// The path of a compiler's symbol, or the symbol if it is not one of Rust's.
fn name(symbol: &str) -> String {
    let path = match (symbol.strip_prefix("_ZN"), symbol.strip_prefix("_R")) {
        (Some(legacy), _) => old_path(legacy),
        (_, Some(new)) => path(&mut { new }),
        _ => None,
    };
    let Some(mut parts) = path else {
        return symbol.to_owned();
    };
    if parts.first().is_some_and(|part| part == OWN) {
        parts.remove(0);
    }
    let path = parts.join("::");
    let own = RTIC.iter().find_map(|prefix| path.strip_prefix(prefix));
    own.map_or(path.clone(), str::to_owned)
}

/// A path in the legacy mangling: `<length><part>…17h<16 digits>E`, with braces of closures
/// encoded.
fn old_path(mut rest: &str) -> Option<Vec<String>> {
    let mut parts = Vec::new();
    while !rest.starts_with('E') {
        parts.push(identifier(&mut rest, "")?);
    }
    // The last part is a hash.
    parts.pop();
    parts.retain(|part| !part.contains("$u7b$"));
    Some(parts)
}

/// A path in the v0 mangling: `N<namespace><path><identifier>` or `C<identifier>`, with a
/// disambiguator before an identifier, and a `_` after its length if it begins with one or with a
/// digit. Other kinds of paths have no variables.
fn path(rest: &mut &str) -> Option<Vec<String>> {
    let mut parts = match first(rest)? {
        'C' => Vec::new(),
        'N' => {
            first(rest)?;
            path(rest)?
        }
        _ => return None,
    };
    if let Some(disambiguated) = rest.strip_prefix('s') {
        *rest = disambiguated.split_once('_')?.1;
    }
    let part = identifier(rest, "_")?;
    // A closure has no name.
    if !part.is_empty() {
        parts.push(part);
    }
    Some(parts)
}

fn first(rest: &mut &str) -> Option<char> {
    let mut chars = rest.chars();
    let first = chars.next();
    *rest = chars.as_str();
    first
}

/// An identifier, `<length><part>`, with an optional sign between them.
fn identifier(rest: &mut &str, sign: &str) -> Option<String> {
    // No length begins with a zero, except zero itself.
    let digits = match rest.starts_with('0') {
        true => 1,
        false => rest.find(|c: char| !c.is_ascii_digit())?,
    };
    let length: usize = rest.get(..digits)?.parse().ok()?;
    let text = rest.get(digits..)?;
    let text = text.strip_prefix(sign).unwrap_or(text);
    let (part, after) = text.split_at_checked(length)?;
    *rest = after;
    Some(part.to_owned())
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
        let mut bytes = b"\x7fELF\x01\x01".to_vec();
        bytes.resize(52, 0);
        bytes[32] = 52;
        bytes[46] = 40;
        bytes[48] = 2;
        let data = 52 + 2 * 40;
        for [kind, offset, size, link, each] in [
            [2, data, table.len() as u32, 1, 16],
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
    fn refuses_bytes_that_are_no_elf_with_symbols() {
        assert_eq!(variables(b"MZ", &[]), None);
        let whole = elf(&[("a", 1, 1, 1)]);
        assert!(variables(&whole, &[]).is_some());
        assert_eq!(variables(&whole[..60], &[]), None);
        let mut stripped = whole;
        stripped[48] = 0;
        assert_eq!(variables(&stripped, &[]), None);
    }
}
