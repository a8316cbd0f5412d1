//! FLASH: keys, programming, erasing, the cache of data, option bytes (RM0090, 3).
//!
//! The sectors of the settings are here; the program's are memory that only the processor reads.

use massline_firmware::models::random::Random;

use crate::{Moment, SECOND, flag};

/// First byte of the settings, and their number.
pub const SETTINGS: std::ops::Range<u32> = 0x080C_0000..0x0810_0000;
/// Bytes of a sector there.
const SECTOR: usize = 128 << 10;
/// Number of the first of them.
const FIRST_SECTOR: u32 = 10;
/// Bytes of a line of the cache of data, and number of its lines (3.5.2).
const LINE: u32 = 16;
const LINES: usize = 8;

/// Time to program a byte: 16 µs (data sheet, 5.3.12).
const PROGRAM: u64 = 16 * SECOND / 1_000_000;
/// Time to erase a sector of 128 KiB a byte at a time: 2 s (there).
const ERASE: u64 = 2 * SECOND;

const ACR: u32 = 0x00;
const KEYR: u32 = 0x04;
const OPTKEYR: u32 = 0x08;
const SR: u32 = 0x0C;
const CR: u32 = 0x10;
const OPTCR: u32 = 0x14;

const DATA_CACHE: u32 = 1 << 10;
const RESET_DATA: u32 = 1 << 12;
const FINISHED: u32 = 1;
const PARALLELISM: u32 = 1 << 6;
const SEQUENCE: u32 = 1 << 7;
const ERRORS: u32 = 0xF2;
const BUSY: u32 = 1 << 16;
const PROGRAMMING: u32 = 1;
const SECTOR_ERASE: u32 = 1 << 1;
const MASS_ERASE: u32 = 1 << 2;
const START: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
const OPTION_LOCK: u32 = 1;
const OPTION_START: u32 = 1 << 1;

/// Content that lasts without the supply.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cells {
    /// Bytes of the settings' sectors.
    pub settings: Vec<u8>,
    /// Option bytes, as OPTCR has them.
    pub options: u32,
}

impl Default for Cells {
    fn default() -> Self {
        Self {
            settings: vec![0xFF; 2 * SECTOR],
            // As delivered: no level of the supply's watch.
            options: 0x0FFF_AAEC,
        }
    }
}

/// An operation that takes time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Operation {
    Program { offset: usize, before: u8 },
    Erase { sector: usize },
    Options,
}

/// The controller.
#[derive(Clone, Debug)]
pub struct Flash {
    cells: Cells,
    acr: u32,
    status: u32,
    control: u32,
    options: u32,
    keys: usize,
    option_keys: usize,
    operation: Option<(Operation, u64)>,
    /// Lines of the cache: number and content.
    cache: Vec<(u32, Vec<u8>)>,
    /// Bytes programmed and sectors erased since the start.
    pub counts: [u64; 2],
}

impl Flash {
    /// After a reset.
    #[must_use]
    pub fn new(cells: Cells) -> Self {
        Self {
            options: cells.options | OPTION_LOCK,
            cells,
            acr: 0,
            status: 0,
            control: LOCK,
            keys: 0,
            option_keys: 0,
            operation: None,
            cache: Vec::new(),
            counts: [0; 2],
        }
    }

    /// A reset; the operation that goes on is aborted, and leaves cells of any content.
    #[must_use]
    pub fn reset(mut self, random: &mut Random) -> Self {
        match self.operation.take() {
            Some((Operation::Program { offset, before }, _)) => {
                if let Some(cell) = self.cells.settings.get_mut(offset) {
                    // Some of the bits that go to zero have got there.
                    *cell |= before & random.below(256) as u8;
                }
            }
            Some((Operation::Erase { sector }, _)) => {
                let cells = self.cells.settings.chunks_mut(SECTOR).nth(sector);
                for cell in cells.into_iter().flatten() {
                    *cell |= random.below(256) as u8;
                }
            }
            _ => {}
        }
        Self::new(self.cells)
    }

    /// Content that lasts without the supply.
    #[must_use]
    pub const fn cells(&self) -> &Cells {
        &self.cells
    }

    /// Wait states.
    #[must_use]
    pub const fn wait_states(&self) -> u32 {
        self.acr & 7
    }

    /// Time until which nothing can be read, the program included; `None` if no operation goes on.
    #[must_use]
    pub fn busy_until(&self) -> Option<u64> {
        self.operation.map(|(_, ends)| ends)
    }

    /// Advances to a time.
    pub fn pass(&mut self, now: u64) {
        if let Some((operation, _)) = self.operation.take_if(|(_, ends)| *ends <= now) {
            self.status |= FINISHED;
            if let Operation::Erase { sector } = operation
                && let Some(cells) = self.cells.settings.chunks_mut(SECTOR).nth(sector)
            {
                cells.fill(0xFF);
                self.counts[1] += 1;
            }
        }
    }

    /// Reads a register.
    #[must_use]
    pub const fn read(&self, offset: u32) -> u32 {
        match offset {
            ACR => self.acr,
            SR => self.status | flag(BUSY, self.operation.is_some()),
            CR => self.control,
            OPTCR => self.options,
            _ => 0,
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, at: &mut Moment<'_>) {
        match offset {
            ACR => {
                if value & RESET_DATA != 0 {
                    if self.acr & DATA_CACHE != 0 {
                        at.forbid("3.9.1: the cache of data is reset while it is on");
                    } else {
                        self.cache.clear();
                    }
                }
                self.acr = value;
            }
            KEYR if next_key(&mut self.keys, value, [0x4567_0123, 0xCDEF_89AB]) => {
                self.control &= !LOCK;
            }
            OPTKEYR if next_key(&mut self.option_keys, value, [0x0819_2A3B, 0x4C5D_6E7F]) => {
                self.options &= !OPTION_LOCK;
            }
            SR => self.status &= !(value & (ERRORS | FINISHED)),
            CR => self.control(value, at),
            OPTCR => self.set_options(value, at),
            _ => {}
        }
    }

    fn control(&mut self, value: u32, at: &mut Moment<'_>) {
        if self.operation.is_some() {
            at.forbid("3.9.5: the control register is written while the flash is busy");
        }
        if self.control & LOCK != 0 {
            if value & !LOCK != self.control & !LOCK {
                at.forbid("3.6.1: the control register is written while it is locked");
            }
            return;
        }
        if value & LOCK != 0 {
            self.keys = 0;
        }
        self.control = value & !START;
        if value & START == 0 {
            return;
        }
        if value & MASS_ERASE != 0 {
            at.forbid("3.6.3: all of the flash is erased");
        } else if value & SECTOR_ERASE != 0 {
            self.begin_erase(value >> 3 & 0xF, at);
        }
    }

    fn begin_erase(&mut self, sector: u32, at: &mut Moment<'_>) {
        if self.status & ERRORS != 0 {
            at.forbid("3.6.3: an erase begins with an error of before in the status");
            return;
        }
        let Some(own) = sector.checked_sub(FIRST_SECTOR).filter(|own| *own < 2) else {
            at.forbid(format!("sector {sector} of the program is erased"));
            return;
        };
        let sector = own as usize;
        self.operation = Some((Operation::Erase { sector }, at.now + ERASE));
    }

    fn set_options(&mut self, value: u32, at: &mut Moment<'_>) {
        if self.options & OPTION_LOCK != 0 {
            at.forbid("3.7.2: option bytes are written while they are locked");
            return;
        }
        if value & OPTION_LOCK != 0 {
            self.option_keys = 0;
        }
        self.options = value & !OPTION_START;
        if value & OPTION_START != 0 {
            if self.status & ERRORS != 0 {
                at.forbid("3.7.2: option bytes are written with an error of before in the status");
            }
            self.cells.options = value & !(OPTION_START | OPTION_LOCK);
            self.operation = Some((Operation::Options, at.now + 100 * PROGRAM));
        }
    }

    /// Reads data from the settings' sectors, through the cache. `false` if they come from a line that
    /// an erase has made stale.
    pub fn load(&mut self, offset: u32, bytes: &mut [u8]) -> bool {
        let mut is_fresh = true;
        for (address, slot) in (offset..).zip(bytes) {
            let cell = |cells: &[u8]| cells.get(address as usize).copied().unwrap_or(0);
            if self.acr & DATA_CACHE == 0 {
                *slot = cell(&self.cells.settings);
                continue;
            }
            let line = address / LINE;
            if self.cache.iter().all(|(number, _)| *number != line) {
                let first = (line * LINE) as usize;
                let content = self.cells.settings.get(first..first + LINE as usize);
                if self.cache.len() == LINES {
                    self.cache.remove(0);
                }
                self.cache.push((line, content.unwrap_or(&[]).to_vec()));
            }
            let cached = self.cache.iter().find(|(number, _)| *number == line);
            let within = (address % LINE) as usize;
            *slot = cached
                .and_then(|(_, c)| c.get(within).copied())
                .unwrap_or(0);
            is_fresh &= *slot == cell(&self.cells.settings);
        }
        is_fresh
    }

    /// Programs the settings' sectors.
    pub fn store(&mut self, offset: u32, bytes: &[u8], at: &mut Moment<'_>) {
        let parallelism = 1_usize << (self.control >> 8 & 3);
        if self.control & LOCK != 0 || self.control & PROGRAMMING == 0 {
            self.status |= SEQUENCE;
            at.forbid("3.6.4: the flash is written without PG");
        } else if self.operation.is_some() {
            at.forbid("3.6.4: the flash is written while it is busy");
        } else if self.status & ERRORS != 0 {
            self.status |= SEQUENCE;
            at.forbid("3.6.4: the flash is written with an error of before in the status");
        } else if bytes.len() != parallelism {
            self.status |= PARALLELISM;
            at.forbid(format!(
                "3.6.2: {} bytes are written where PSIZE says {parallelism}",
                bytes.len()
            ));
        } else {
            for (address, byte) in (offset as usize..).zip(bytes) {
                let Some(cell) = self.cells.settings.get_mut(address) else {
                    continue;
                };
                let before = *cell;
                *cell &= byte;
                let programmed = *cell;
                if programmed != *byte {
                    at.forbid("3.6.4: bits are programmed to 1 without an erase");
                }
                let operation = Operation::Program {
                    offset: address,
                    before,
                };
                self.operation = Some((operation, at.now + PROGRAM));
                self.counts[0] += 1;
                // Programming goes through the cache (3.5.2).
                let line = address as u32 / LINE;
                let cached = self.cache.iter_mut().find(|(number, _)| *number == line);
                if let Some((_, content)) = cached
                    && let Some(slot) = content.get_mut(address % LINE as usize)
                {
                    *slot = programmed;
                }
            }
        }
    }
}

/// `true` if the second of two keys has come behind the first; a wrong one locks until the next reset.
fn next_key(at: &mut usize, value: u32, keys: [u32; 2]) -> bool {
    *at = match keys.get(*at) {
        Some(key) if *key == value => *at + 1,
        _ => usize::MAX,
    };
    *at == 2
}
