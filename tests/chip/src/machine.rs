//! The processor with its memories on the chip's registers, time, resets, and the link's other end.

use std::collections::VecDeque;
use std::fmt;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use massline::device::{Port, PortError};
use massline_firmware::models::random::Random;
use object::read::elf::{ElfFile32, ProgramHeader as _};
use rsemu::core::space::{AddressSpace, MemAttrs, MemOps, MemResult, Perms, RamStore, Region};
use rsemu::core::{BusError, Width};
use rsemu::cpu::arm::v7m::sys::{Exception, Sys, fpccr};
use rsemu::cpu::arm::v7m::{ArmV7m, Config};

use crate::bench::Bench;
use crate::bus::{Chip, INTERRUPTS};
use crate::flash::{Cells, SETTINGS};
use crate::rcc::{Oscillators, Reset};
use crate::{SECOND, counted, periods};

/// First byte of the program, and bytes of its sectors.
const PROGRAM: (u32, u64) = (0x0800_0000, 768 << 10);
/// Memories: first byte, size.
const SRAM: (u32, u64) = (0x2000_0000, 128 << 10);
const CCM: (u32, u64) = (0x1000_0000, 64 << 10);
/// Serial number and size of the flash (RM0090, 39).
const SIGNATURE: u32 = 0x1FFF_7A10;

/// Parts of a box.
pub struct Parts<'a> {
    /// The ELF that is flashed.
    pub elf: &'a Path,
    /// Content of the flash, of the sectors of the settings alone.
    pub cells: Cells,
    /// Crystal and PLL.
    pub oscillators: Oscillators,
    /// Converters and what they measure.
    pub bench: Bench,
    /// Bit rate of the host.
    pub baud: u32,
    /// Seed of what memories hold when the supply comes.
    pub seed: u64,
}

/// A chip that runs.
pub struct Machine {
    cpu: ArmV7m,
    /// NVIC, SysTick and system control as a reset leaves them.
    system: Sys,
    chip: Arc<Mutex<Chip>>,
    now: Arc<AtomicU64>,
    /// `true` if a register was accessed since the last look at it.
    is_touched: Arc<AtomicBool>,
    /// Time, and fractions of 2^-32 ps.
    time: (u64, u64),
    /// Picoseconds of a cycle, in 2^-32 ps, and cycles of a second.
    cycle: (u64, u32),
    /// Time of the next event.
    next: u64,
    /// Time until which the flash cannot be read.
    stalled: Option<u64>,
    asked: [bool; INTERRUPTS],
    /// `true` if an interrupt was asked for since the last step.
    is_asked: bool,
    random: Random,
    /// Resets since the supply came, and their causes.
    pub resets: Vec<Reset>,
    /// Bytes from the chip that nobody has received yet.
    received: VecDeque<u8>,
    /// Instructions and begins of exceptions since the supply came.
    instructions: u64,
}

fn lock(chip: &Mutex<Chip>) -> MutexGuard<'_, Chip> {
    chip.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Machine {
    /// The supply comes.
    ///
    /// # Panics
    ///
    /// If the ELF cannot be read or does not fit.
    #[must_use]
    pub fn start(parts: Parts<'_>) -> Self {
        let mut random = Random::new(parts.seed);
        let program = Arc::new(RamStore::new(PROGRAM.1));
        program.fill(0, PROGRAM.1, 0xFF).expect("within the flash");
        let file = std::fs::read(parts.elf).expect("the firmware's ELF");
        let elf: ElfFile32<'_> = ElfFile32::parse(&*file).expect("an ELF");
        for segment in elf.elf_program_headers() {
            let endian = elf.endian();
            let bytes = segment.data(endian, &*file).expect("a segment");
            if segment.p_type(endian) == object::elf::PT_LOAD && !bytes.is_empty() {
                let offset = segment.p_paddr(endian) - PROGRAM.0;
                program
                    .write_at(offset.into(), bytes)
                    .expect("within the flash");
            }
        }
        let memory = |size: u64, random: &mut Random| {
            let store = Arc::new(RamStore::new(size));
            for offset in (0..size).step_by(8) {
                let bytes = random.below(u64::MAX).to_le_bytes();
                store.write_at(offset, &bytes).expect("within the memory");
            }
            store
        };
        let [sram, ccm] = [SRAM, CCM].map(|(_, size)| memory(size, &mut random));
        let chip = Chip::new(
            parts.cells,
            parts.oscillators,
            parts.bench,
            parts.baud,
            &sram,
        );
        let chip = Arc::new(Mutex::new(chip));
        let now = Arc::new(AtomicU64::new(0));
        let is_touched = Arc::new(AtomicBool::new(true));
        let registers = |base: u32| {
            Arc::new(Registers {
                chip: Arc::clone(&chip),
                now: Arc::clone(&now),
                is_touched: Arc::clone(&is_touched),
                base,
            })
        };
        let space = AddressSpace::new("chip", 32);
        {
            let mut map = space.topology();
            let program = Region::ram("program", program);
            map.map_with_perms(program, PROGRAM.0.into(), Perms::RX)
                .expect("a place");
            for (name, (base, _), store) in [("sram", SRAM, sram), ("ccm", CCM, ccm)] {
                map.map(Region::ram(name, store), base.into())
                    .expect("a place");
            }
            let signature = Arc::new(RamStore::new(20));
            let bytes = b"modelledchip\xFF\xFF\xFF\xFF\xFF\xFF\x00\x04";
            signature.write_at(0, bytes).expect("twenty bytes");
            let signature = Region::ram("signature", signature);
            map.map_with_perms(signature, SIGNATURE.into(), Perms::READ)
                .expect("a place");
            for (name, base, size) in [
                (
                    "settings",
                    SETTINGS.start,
                    u64::from(SETTINGS.end - SETTINGS.start),
                ),
                ("peripherals", 0x4000_0000, 0x8_0000),
                ("debug", 0xE004_2000, 0x400),
            ] {
                let region = Region::io(name, size, registers(base));
                map.map(region, base.into()).expect("a place");
            }
        }
        let mut config = Config::CORTEX_M4F;
        // RM0090, 12.1: four bits of priority. The boot pins lead address 0 to the flash.
        config.priority_bits = 4;
        config.reset_vtor = PROGRAM.0;
        let cpu = ArmV7m::new(config);
        cpu.attach_space(Arc::new(space));
        let mut machine = Self {
            system: cpu.with_sys(|system| system.clone()),
            cpu,
            chip,
            now,
            is_touched,
            time: (0, 0),
            cycle: (0, 0),
            next: 0,
            stalled: None,
            asked: [false; INTERRUPTS],
            is_asked: false,
            random,
            resets: vec![Reset::Power],
            received: VecDeque::new(),
            instructions: 0,
        };
        machine.begin();
        machine
    }

    /// The first step after a reset, which loads the vectors.
    fn begin(&mut self) {
        // The emulator's own reset keeps which interrupts are enabled, and their priorities.
        self.cpu.with_sys(|system| system.clone_from(&self.system));
        self.cpu.step();
        // The emulator (rsemu 0.0.7) forgets flags of floating-point comparisons where their registers are
        // preserved lazily (ARMv7-M, B3.2.21).
        self.cpu.with_sys(|system| system.fpccr &= !fpccr::LSPEN);
        self.is_touched.store(true, Ordering::Relaxed);
        self.look();
    }

    /// The chip's registers and what is wired to them.
    pub fn chip(&mut self) -> MutexGuard<'_, Chip> {
        self.is_touched.store(true, Ordering::Relaxed);
        lock(&self.chip)
    }

    /// The same for whoever has lent the machine to a client of the link.
    #[must_use]
    pub fn shared(&self) -> Arc<Mutex<Chip>> {
        Arc::clone(&self.chip)
    }

    /// Time since the supply came, ps.
    #[must_use]
    pub const fn time(&self) -> u64 {
        self.time.0
    }

    /// Instructions and begins of exceptions since the supply came.
    #[must_use]
    pub const fn instructions(&self) -> u64 {
        self.instructions
    }

    /// The supply is cut; what lasts without it.
    #[must_use]
    pub fn cut(mut self) -> Cells {
        let random = &mut self.random;
        let mut chip = lock(&self.chip);
        chip.reset(Reset::Power, random);
        chip.flash.cells().clone()
    }

    /// Accesses that the manual forbids, in words.
    #[must_use]
    pub fn forbidden(&self) -> Vec<String> {
        lock(&self.chip).forbidden.clone()
    }

    /// Runs until `is_done`, or for a time in ps at most. `true` if it is done.
    pub fn run_until(&mut self, time: u64, is_done: impl Fn(&Self) -> bool) -> bool {
        let end = self.time.0 + time;
        while self.time.0 < end {
            let is_event = self.advance(end);
            if is_event && is_done(self) {
                return true;
            }
        }
        false
    }

    /// `true` if bytes have come from the chip that nobody has received.
    #[must_use]
    pub fn has_bytes(&self) -> bool {
        !self.received.is_empty()
    }

    /// Lets a time in ps pass.
    pub fn run(&mut self, time: u64) {
        self.run_until(time, |_| false);
    }

    /// Advances by an instruction or up to the next event. `true` if there was an event.
    fn advance(&mut self, end: u64) -> bool {
        if self.is_touched.swap(false, Ordering::Relaxed) {
            self.look();
            if let Some(until) = self.stalled {
                // Program and data are in the flash, which cannot be read.
                self.stand_still(until);
                return true;
            }
        }
        // What was asked for before it fell asleep, or in that very cycle, wakes it at once.
        let is_asked = std::mem::take(&mut self.is_asked);
        let is_pending = || self.cpu.with_sys(|sys| sys.highest_pending().is_some());
        if self.cpu.is_asleep() && !is_asked && !is_pending() || self.cpu.is_locked_up() {
            let to = self.next.min(end).min(self.time.0 + self.until_systick());
            self.stand_still(to.max(self.time.0 + 1));
        }
        let used = self.step();
        self.instructions += 1;
        let fraction = self.time.1 + used * self.cycle.0;
        self.time = (
            self.time.0 + (fraction >> 32),
            fraction & u64::from(u32::MAX),
        );
        self.now.store(self.time.0, Ordering::Relaxed);
        let is_event = self.time.0 >= self.next;
        if is_event {
            self.look();
        }
        if self.cpu.reset_requested() {
            self.reset(Reset::Software);
        }
        is_event
    }

    /// Executes an instruction, or begins an exception; cycles.
    ///
    /// The emulator (rsemu 0.0.7) leaves the state of an IT block out of the frame of an exception, so
    /// that what is left of the block would be executed whatever its condition. It is put into the
    /// frame here, from where the return takes it.
    fn step(&mut self) -> u64 {
        /// Bits of that state in the program status register.
        const IT: u32 = 0x0600_FC00;
        /// Place of the register in a frame.
        const STATUS: u64 = 0x1C;
        let status = self.cpu.xpsr();
        if status & IT == 0 {
            return self.cpu.step();
        }
        let stack = self.cpu.reg(13);
        let used = self.cpu.step();
        let frame = self.cpu.reg(13);
        if self.cpu.xpsr() & 0x1FF != status & 0x1FF
            && frame < stack
            && let Some(space) = self.cpu.space()
        {
            let place = u64::from(frame) + STATUS;
            let attributes = MemAttrs::default();
            let saved = space.read(place, Width::U32, attributes).unwrap_or(0);
            let whole = saved | u64::from(status & IT);
            // The frame has just been written.
            let _ = space.write(place, Width::U32, whole, attributes);
        }
        used
    }

    /// Time until SysTick comes to zero, less a cycle.
    fn until_systick(&self) -> u64 {
        /// SYST_CVR (ARMv7-M, B3.3.5).
        const CURRENT: u32 = 0xE000_E018;
        let left = self.cpu.with_sys(|sys| sys.read_word(CURRENT, true));
        let left = left.unwrap_or(0).saturating_sub(1);
        periods(left.into(), self.cycle.1)
    }

    /// Time passes without instructions.
    fn stand_still(&mut self, until: u64) {
        let before = self.time.0;
        let ticks = counted(until - before, self.cycle.1);
        let is_enabled = |sys: &Sys| sys.syst_csr & 0b11 == 0b11;
        self.cpu.with_sys(|sys| {
            if sys.tick_systick(ticks) && is_enabled(sys) {
                sys.set_pending(Exception::SYSTICK, true);
            }
        });
        while self.next <= until {
            self.time = (self.next.max(self.time.0), 0);
            self.look();
        }
        self.time = (until, 0);
        self.now.store(until, Ordering::Relaxed);
    }

    /// Lets the chip catch up, and asks it for interrupts.
    fn look(&mut self) {
        let mut chip = lock(&self.chip);
        chip.pass(self.time.0);
        self.next = chip.next().max(self.time.0 + 1);
        self.stalled = chip.flash.busy_until();
        let hz = chip.core_hz();
        if hz != self.cycle.1 {
            let picoseconds = (u128::from(SECOND) << 32) / u128::from(hz);
            self.cycle = (picoseconds as u64, hz);
        }
        for ((number, asks), before) in chip.interrupts().into_iter().zip(&mut self.asked) {
            if asks != *before {
                *before = asks;
                self.is_asked |= asks;
                self.cpu.set_irq(number, asks);
            }
        }
        self.received.extend(chip.usart.sent.drain(..));
        let bites = chip.watchdog.ends.is_some_and(|ends| ends <= self.time.0);
        drop(chip);
        if bites {
            self.reset(Reset::Watchdog);
        }
    }

    fn reset(&mut self, cause: Reset) {
        self.resets.push(cause);
        self.cpu.clear_reset_request();
        self.cpu.request_reset();
        lock(&self.chip).reset(cause, &mut self.random);
        self.begin();
    }
}

impl Port for Machine {
    fn name(&self) -> String {
        "modelled chip".to_owned()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let now = self.time.0;
        self.chip().usart.send(bytes, now);
        Ok(())
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        let end = self.time.0.saturating_add(timeout.as_nanos() as u64 * 1000);
        while self.received.is_empty() && self.time.0 < end {
            self.advance(end);
        }
        let count = self.received.len();
        into.extend(self.received.drain(..));
        Ok(count)
    }

    /// Time of the chip passes more slowly than that of the host.
    fn patience(&self) -> Duration {
        Duration::from_secs(30)
    }

    fn longest_work(&self) -> Duration {
        Duration::from_secs(600)
    }

    fn seconds(&self) -> f64 {
        self.time.0 as f64 / SECOND as f64
    }
}

/// Registers, and the settings' sectors, as the processor's bus reaches them.
struct Registers {
    chip: Arc<Mutex<Chip>>,
    now: Arc<AtomicU64>,
    is_touched: Arc<AtomicBool>,
    base: u32,
}

impl fmt::Debug for Registers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "registers from {:#010x} on", self.base)
    }
}

impl Registers {
    fn access(&self) -> MutexGuard<'_, Chip> {
        self.is_touched.store(true, Ordering::Relaxed);
        let mut chip = lock(&self.chip);
        chip.now = self.now.load(Ordering::Relaxed);
        chip
    }
}

impl MemOps for Registers {
    fn read(&self, offset: u64, bytes: &mut [u8], attrs: MemAttrs) -> MemResult {
        if attrs.debug {
            bytes.fill(0);
            return Ok(());
        }
        let offset = offset as u32;
        if self.base == SETTINGS.start {
            // No register is touched, and no event follows.
            lock(&self.chip).load(offset, bytes);
            return Ok(());
        }
        let address = self.base + offset;
        let word = self.access().read(address).ok_or(BusError::Unassigned)?;
        let lanes = word.to_le_bytes();
        for (slot, lane) in bytes
            .iter_mut()
            .zip(lanes.iter().skip((address & 3) as usize))
        {
            *slot = *lane;
        }
        Ok(())
    }

    fn write(&self, offset: u64, bytes: &[u8], attrs: MemAttrs) -> MemResult {
        if attrs.debug {
            return Ok(());
        }
        let offset = offset as u32;
        let mut chip = self.access();
        if self.base == SETTINGS.start {
            chip.store(offset, bytes);
            return Ok(());
        }
        let address = self.base + offset;
        let mut lanes = [0; 4];
        for (lane, byte) in lanes.iter_mut().skip((address & 3) as usize).zip(bytes) {
            *lane = *byte;
        }
        if chip.write(address, u32::from_le_bytes(lanes)) {
            Ok(())
        } else {
            Err(BusError::Unassigned)
        }
    }
}
