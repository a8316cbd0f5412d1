//! Failure of the program: the cause goes into memory that outlives the reset, and the chip is
//! reset. The box reports it at every hello until the host has it forgotten. The log has it too.

use core::arch::naked_asm;
use core::cell::UnsafeCell;
use core::fmt;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::SCB;
use massline_firmware::retained::{Cause, Record, ResetFlags, SIZE};
use massline_firmware::wire::{CRC32, ResetReason};

use crate::stack;

/// Memory that the start-up code does not initialise.
struct Retained(UnsafeCell<MaybeUninit<[u8; SIZE]>>);

// SAFETY: all access is in `bytes` and `write`, byte by byte and volatile, on the only core.
unsafe impl Sync for Retained {}

#[unsafe(link_section = ".uninit.retained")]
static RETAINED: Retained = Retained(UnsafeCell::new(MaybeUninit::uninit()));

/// The bytes of that memory: a record, or noise after power-on.
fn bytes() -> [u8; SIZE] {
    let mut bytes = [0; SIZE];
    let from: *const u8 = RETAINED.0.get().cast();
    for (i, byte) in bytes.iter_mut().enumerate() {
        // SAFETY: `i` is below `SIZE`. The compiler may not assume what it reads, as the memory
        // was last written by the program before the reset: hence volatile.
        *byte = unsafe { from.add(i).read_volatile() };
    }
    bytes
}

fn write(record: &Record) {
    let to: *mut u8 = RETAINED.0.get().cast();
    for (i, byte) in record.to_bytes().into_iter().enumerate() {
        // SAFETY: `i` is below `SIZE`.
        unsafe { to.add(i).write_volatile(byte) };
    }
}

/// Opens the record of this session, and returns it with the reason of the reset.
pub fn start(flags: ResetFlags) -> (Record, ResetReason) {
    let bytes = bytes();
    let noise = CRC32.checksum(&bytes);
    let (record, reason) = Record::start(
        Record::from_bytes(&bytes),
        flags,
        (noise ^ (noise >> 16)) as u16,
    );
    write(&record);
    (record, reason)
}

/// The record as it is now.
fn record() -> Record {
    // It was written at the start. Should a stray pointer have hit it, an empty one is honest.
    Record::from_bytes(&bytes()).unwrap_or_else(|| Record::start(None, ResetFlags::default(), 0).0)
}

/// Changes the record, which takes some 100 µs.
///
/// Interrupts go on meanwhile, as a sample cannot wait that long. Only the task of
/// requests changes the record of a box that works; a failure in between finds half a record, which
/// its checksum tells, and does not return here.
pub fn amend(change: impl FnOnce(&mut Record)) {
    let mut record = record();
    change(&mut record);
    write(&record);
}

/// Notes the cause with its last words, and resets the chip.
pub fn end(cause: Cause, words: fmt::Arguments<'_>) -> ! {
    cortex_m::interrupt::disable();
    amend(|record| record.end(cause, words));
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    static PANICKED: AtomicBool = AtomicBool::new(false);

    cortex_m::interrupt::disable();
    // A message that panics while it is formatted must not go round in circles.
    if PANICKED.swap(true, Ordering::Relaxed) {
        SCB::sys_reset();
    }
    defmt::error!("{}", defmt::Display2Format(info));
    match info.location() {
        Some(at) => end(
            Cause::Panic,
            format_args!("{}:{}: {}", at.file(), at.line(), info.message()),
        ),
        None => end(Cause::Panic, format_args!("{}", info.message())),
    }
}

/// 1 while [`read_if_there`] tries an address, 2 after a fault.
static TRYING: AtomicU32 = AtomicU32::new(0);

/// The word at an address, or `None` if the bus says that there is nothing.
///
/// # Safety
///
/// The address is aligned to 4 bytes, and reading there has no effect.
pub unsafe fn read_if_there(address: *const u32) -> Option<u32> {
    let word: u32;
    TRYING.store(1, Ordering::SeqCst);
    // SAFETY: on a fault, which is precise for a read, the handler below notes it and steps over
    // the instruction, which has 16 bits with low registers. The caller vouches for the address.
    unsafe {
        core::arch::asm!(
            "ldr r0, [r0]",
            inlateout("r0") address => word,
            options(nostack, readonly),
        );
    }
    (TRYING.swap(0, Ordering::SeqCst) == 1).then_some(word)
}

/// `true` if there is memory at an address: it reads back what is written. The word is lost.
///
/// # Safety
///
/// The address is that of an aligned word which no part of the program uses, or of nothing.
pub unsafe fn is_memory(address: *mut u32) -> bool {
    [0x5AA5_0FF0, 0xA55A_F00F].into_iter().all(|pattern| {
        // SAFETY: read before it is written, so that an address of nothing is never written
        // to; the caller vouches for the rest.
        unsafe {
            if read_if_there(address).is_none() {
                return false;
            }
            address.write_volatile(pattern);
            read_if_there(address) == Some(pattern)
        }
    })
}

/// The handler of all faults of the processor.
///
/// While [`read_if_there`] is trying, the fault is the answer: the handler notes it and returns
/// behind the instruction. Else the program has ended. The stack may be what failed, so the rest
/// runs from the stack's top, whose contents nobody will need again.
///
/// # Safety
///
/// For the processor to call, by the vector table.
#[unsafe(naked)]
#[unsafe(export_name = "HardFault")]
unsafe extern "C" fn hard_fault() {
    naked_asm!(
        "movw r1, #:lower16:{trying}",
        "movt r1, #:upper16:{trying}",
        "ldr  r2, [r1]",
        "cbnz r2, 2f",
        "mov  r0, sp",
        "movw r1, #:lower16:_stack_start",
        "movt r1, #:upper16:_stack_start",
        "msr  msp, r1",
        "b    {report}",
        "2:",
        "movs r2, #2",
        "str  r2, [r1]",
        "ldr  r2, [sp, #24]",
        "adds r2, #2",
        "str  r2, [sp, #24]",
        "bx   lr",
        trying = sym TRYING,
        report = sym report,
    )
}

/// Bytes below the stack that a fault may be at to count as an overflow: a frame may be larger
/// than a guard of a page, but none here is larger than this.
const GUARD: u32 = 64 << 10;

/// Tells an overflow of the stack from other faults, and ends the program.
extern "C" fn report(sp: u32) -> ! {
    // SAFETY: fixed addresses of the processor's own registers, read only.
    let (cfsr, address) = unsafe {
        let scb = &*SCB::PTR;
        (scb.cfsr.read(), scb.bfar.read())
    };
    const ADDRESS_IS_VALID: u32 = 1 << 15;
    const WHILE_STACKING: u32 = 1 << 12;
    let bottom = stack::bottom();
    let below = |address: u32| (bottom.saturating_sub(GUARD)..bottom).contains(&address);
    let hit = cfsr & ADDRESS_IS_VALID != 0 && below(address);
    if below(sp) || hit || (cfsr & WHILE_STACKING != 0 && sp < bottom) {
        end(
            Cause::StackOverflow,
            format_args!("stack overflow: sp {sp:#010x}, the stack ends at {bottom:#010x}"),
        );
    }
    // The frame that the processor has put on the stack; its seventh word is where it happened.
    let at = if sp >= bottom && sp.saturating_add(32) <= stack::top() {
        // SAFETY: within the stack, aligned as the processor aligns it.
        unsafe { (sp as *const u32).add(6).read_volatile() }
    } else {
        0
    };
    end(
        Cause::HardFault,
        format_args!("hard fault at {at:#010x}, status {cfsr:#010x}, address {address:#010x}"),
    )
}
