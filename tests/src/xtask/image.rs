//! Memory of the chip that a firmware takes, from its ELF and its memory map.

use object::LittleEndian;
use object::elf::FileHeader32;
use object::read::elf::{ElfFile, ProgramHeader};
use object::read::{Object, ObjectSegment};

/// A program of the chip.
pub type Elf<'d> = ElfFile<'d, FileHeader32<LittleEndian>>;

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

impl Region {
    /// `true` if an address is in this memory.
    pub fn contains(&self, address: u64) -> bool {
        (self.origin..self.origin + self.length).contains(&address)
    }
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

/// Use of each memory by a program of the chip.
///
/// Loaded bytes count at the addresses of both storage and run: initialised variables take flash
/// and RAM.
///
/// # Errors
///
/// [`object::Error`] if the bytes are no 32-bit little-endian ELF.
pub fn usage(elf: &[u8], regions: &[Region]) -> object::Result<Vec<Usage>> {
    let file = Elf::parse(elf)?;
    let mut usages: Vec<Usage> = regions
        .iter()
        .map(|region| Usage {
            region: region.clone(),
            used: 0,
        })
        .collect();
    for segment in file.segments() {
        let stored_at = segment.elf_program_header().p_paddr(LittleEndian);
        let (_, stored) = segment.file_range();
        for Usage { region, used } in &mut usages {
            if region.contains(segment.address()) {
                *used += segment.size();
            } else if region.contains(stored_at.into()) {
                *used += stored;
            }
        }
    }
    Ok(usages)
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
pub(super) mod tests {
    use super::*;

    const MAP: &str = "/* a chip: */\nMEMORY\n{\n  FLASH : ORIGIN = 0x08000000, LENGTH = 1M\n  \
        RAM (rwx) : ORIGIN = 0x20000000, LENGTH = 128K\n  \
        CCM : ORIGIN = 0x10000000, LENGTH = 65536\n}\n";

    /// An ELF of these segments: type, address, load address, bytes stored, bytes taken. All of them
    /// begin with the first byte of `data`.
    pub fn elf(segments: &[[u32; 5]], data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x7fELF\x01\x01\x01".to_vec();
        bytes.resize(52, 0);
        (bytes[28], bytes[42], bytes[44]) = (52, 32, segments.len() as u8);
        let offset = 52 + 32 * segments.len() as u32;
        for [kind, runs_at, stored_at, stored, taken] in segments {
            for value in [kind, &offset, runs_at, stored_at, stored, taken, &0, &0] {
                bytes.extend(value.to_le_bytes());
            }
        }
        bytes.extend(data);
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
        let segments = [
            [1, 0x0800_0000, 0x0800_0000, 1000, 1000],
            [1, 0x2000_0000, 0x0800_03e8, 24, 24],
            [1, 0x2000_0018, 0x2000_0018, 0, 512],
            // Not loaded: a note for the linker.
            [0x6474_e551, 0x0800_0000, 0x0800_0000, 77, 77],
        ];
        let usages = usage(&elf(&segments, &[]), &regions(MAP)).unwrap();
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
        let whole = elf(&[[1, 0, 0, 1, 1]], &[0]);
        assert!(usage(&whole, &[]).is_ok());
        assert!(usage(&whole[..60], &[]).is_err());
        assert!(usage(b"MZ", &[]).is_err());
    }
}
