//! Storage of runs, which fills the core-coupled memory.
//!
//! DMA does not reach this memory, and nothing here needs it. All other variables are in the SRAM,
//! where the linker puts them.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use massline_firmware::instrument::RunStorage;

use crate::faults;

/// Bytes of the core-coupled memory.
const BANK: usize = 64 << 10;

const _: () = assert!(size_of::<RunStorage>() <= BANK);

struct Place(UnsafeCell<MaybeUninit<RunStorage>>);

// SAFETY: reached by `runs` only, which hands it out once.
unsafe impl Sync for Place {}

#[unsafe(link_section = ".ccm.runs")]
static RUNS: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));

/// Address of those 64 KiB in emulators that know the chip's 192 KiB as one piece (QEMU before 8.0).
const BEHIND_THE_SRAM: *mut u32 = 0x2002_0000 as *mut u32;

/// The storage of runs, all zero. `None` on every later call, and on a chip without that memory.
pub fn runs() -> Option<&'static mut RunStorage> {
    let lent = cortex_m::singleton!(: () = ());
    lent?;
    let place: *mut RunStorage = RUNS.0.get().cast();
    // SAFETY: nothing else uses this memory, and nobody has a reference to it yet.
    let place = if unsafe { faults::is_memory(place.cast()) } {
        place
    // SAFETY: on the chip there is nothing; where there is memory, no program part lies there.
    } else if unsafe { faults::is_memory(BEHIND_THE_SRAM) } {
        BEHIND_THE_SRAM.cast()
    } else {
        return None;
    };
    // SAFETY: `place` is aligned and has room, as the linker or the emulator's memory map see to.
    // All bits zero are the zeros that `RunStorage::new` is made of, without a copy of it on the
    // stack. It is handed out once.
    unsafe {
        place.write_bytes(0, 1);
        Some(&mut *place)
    }
}
