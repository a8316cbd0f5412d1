//! Memory of the chip that a firmware takes, from its ELF and its memory map.

/// A memory of the chip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region {
    /// Name in the memory map.
    pub name: String,
    /// First address.
    pub origin: u64,
    /// Size, bytes.
    pub length: u64,
}

/// Use of one memory by a firmware.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Usage {
    /// The memory.
    pub region: Region,
    /// Bytes taken.
    pub used: u64,
}

/// The memories that a linker script declares, in its order.
///
/// Reads lines such as `FLASH : ORIGIN = 0x08000000, LENGTH = 1024K`, and ignores others.
pub fn regions(script: &str) -> Vec<Region> {
    script.lines().filter_map(region).collect()
}

fn region(line: &str) -> Option<Region> {
    let (name, rest) = line.split_once(':')?;
    let (origin, length) = rest.split_once(',')?;
    let value = |text: &str, key| {
        let (found, value) = text.split_once('=')?;
        (found.trim() == key).then(|| number(value.trim()))?
    };
    Some(Region {
        // Attributes such as `(rx)` may follow the name.
        name: name.split_whitespace().next()?.to_owned(),
        origin: value(origin, "ORIGIN")?,
        length: value(length, "LENGTH")?,
    })
}

fn number(text: &str) -> Option<u64> {
    let (digits, unit) = match text.strip_suffix(['K', 'k']) {
        Some(digits) => (digits, 1024),
        None => match text.strip_suffix(['M', 'm']) {
            Some(digits) => (digits, 1024 * 1024),
            None => (text, 1),
        },
    };
    let value = match digits.strip_prefix("0x") {
        Some(hex) => u64::from_str_radix(hex, 16).ok()?,
        None => digits.parse().ok()?,
    };
    value.checked_mul(unit)
}

/// Use of each memory by a 32-bit little-endian ELF; `None` if the bytes are no such ELF.
///
/// Loaded bytes count at the addresses of both storage and run: initialised variables take flash
/// and RAM.
pub fn usage(elf: &[u8], regions: &[Region]) -> Option<Vec<Usage>> {
    const LOADED: u32 = 1;
    let half = |at: usize| Some(u16::from_le_bytes(*elf.get(at..)?.first_chunk()?));
    let word = |at: usize| Some(u32::from_le_bytes(*elf.get(at..)?.first_chunk()?));

    if !elf.starts_with(b"\x7fELF\x01\x01") {
        return None;
    }
    let (table, size, count) = (word(28)? as usize, half(42)? as usize, half(44)? as usize);
    let mut usages: Vec<Usage> = regions
        .iter()
        .map(|region| Usage {
            region: region.clone(),
            used: 0,
        })
        .collect();
    for header in (0..count).map(|n| table + n * size) {
        if word(header)? != LOADED {
            continue;
        }
        let (runs_at, stored_at) = (word(header + 8)?, word(header + 12)?);
        let (stored, taken) = (word(header + 16)?, word(header + 20)?);
        for Usage { region, used } in &mut usages {
            let holds = |address: u32| {
                (region.origin..region.origin + region.length).contains(&u64::from(address))
            };
            if holds(runs_at) {
                *used += u64::from(taken);
            } else if holds(stored_at) {
                *used += u64::from(stored);
            }
        }
    }
    Some(usages)
}

/// A line of text about the memories in use.
pub fn summary(usages: &[Usage]) -> String {
    usages
        .iter()
        .filter(|usage| usage.used > 0)
        .map(|Usage { region, used }| {
            let kib = |bytes: u64| bytes as f64 / 1024.0;
            format!(
                "{} {:.1} of {:.0} KiB",
                region.name,
                kib(*used),
                kib(region.length)
            )
        })
        .collect::<Vec<_>>()
        .join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP: &str = "/* a chip: */\nMEMORY\n{\n  FLASH : ORIGIN = 0x08000000, LENGTH = 1M\n  \
        RAM (rwx) : ORIGIN = 0x20000000, LENGTH = 128K\n  \
        CCM : ORIGIN = 0x10000000, LENGTH = 65536\n}\n";

    /// An ELF of a header and these segments: type, address, load address, bytes stored, bytes
    /// taken.
    fn elf(segments: &[[u32; 5]]) -> Vec<u8> {
        let mut bytes = b"\x7fELF\x01\x01".to_vec();
        bytes.resize(52, 0);
        bytes[28] = 52;
        bytes[42] = 32;
        bytes[44] = segments.len() as u8;
        for [kind, runs_at, stored_at, stored, taken] in segments {
            for value in [kind, &0, runs_at, stored_at, stored, taken, &0, &0] {
                bytes.extend(value.to_le_bytes());
            }
        }
        bytes
    }

    #[test]
    fn reads_the_memory_map_of_the_board() {
        let named = |name: &str, origin, length| Region {
            name: name.into(),
            origin,
            length,
        };
        let expected = [
            named("FLASH", 0x0800_0000, 1 << 20),
            named("RAM", 0x2000_0000, 128 << 10),
            named("CCM", 0x1000_0000, 64 << 10),
        ];
        assert_eq!(regions(MAP), expected);
        let board = regions(include_str!("../../../memory.x"));
        let names: Vec<_> = board.iter().map(|region| region.name.as_str()).collect();
        assert_eq!(names, ["FLASH", "STACK", "RAM", "CCM"]);
        let (stack, ram) = (&board[1], &board[2]);
        assert_eq!(
            stack.origin, 0x2000_0000,
            "an overflow must leave the memory"
        );
        assert_eq!(stack.origin + stack.length, ram.origin);
        assert_eq!(stack.length + ram.length, 128 << 10);
    }

    #[test]
    fn counts_initialised_variables_in_flash_and_in_ram() {
        let elf = elf(&[
            [1, 0x0800_0000, 0x0800_0000, 1000, 1000],
            [1, 0x2000_0000, 0x0800_03e8, 24, 24],
            [1, 0x2000_0018, 0x2000_0018, 0, 512],
            // Not loaded: a note for the linker.
            [0x6474_e551, 0x0800_0000, 0x0800_0000, 77, 77],
        ]);
        let usages = usage(&elf, &regions(MAP)).unwrap();
        assert_eq!(
            usages.iter().map(|usage| usage.used).collect::<Vec<_>>(),
            [1024, 536, 0]
        );
        assert_eq!(
            summary(&usages),
            "FLASH 1.0 of 1024 KiB, RAM 0.5 of 128 KiB"
        );
    }

    #[test]
    fn refuses_bytes_that_are_no_whole_elf() {
        let whole = elf(&[[1, 0, 0, 1, 1]]);
        assert!(usage(&whole, &[]).is_some());
        assert_eq!(usage(&whole[..60], &[]), None);
        assert_eq!(usage(b"MZ", &[]), None);
    }
}
