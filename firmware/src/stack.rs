//! Measurement of the stack's depth.
//!
//! The start-up code paints the whole stack (cortex-m-rt's `paint-stack`); what is no longer
//! painted was used. The stack lies at the bottom of the SRAM, see `memory.x`.

/// The word that the start-up code paints with.
const PAINT: u32 = 0xCCCC_CCCC;

unsafe extern "C" {
    /// Its lowest address, from `memory.x`.
    static _stack_end: u32;
    /// The address above it.
    static _stack_start: u32;
}

/// Lowest address of the stack.
pub fn bottom() -> u32 {
    (&raw const _stack_end) as u32
}

/// The address above the stack.
pub fn top() -> u32 {
    (&raw const _stack_start) as u32
}

/// Size of the stack, bytes.
pub fn size() -> u32 {
    top().wrapping_sub(bottom())
}

/// Deepest that it has ever been, in bytes.
///
/// Takes a few instructions for each word that was never used, from the bottom up.
pub fn used() -> u32 {
    let (mut at, top) = (bottom(), top());
    // SAFETY: aligned words within the stack; volatile, since calls write there.
    while at < top && unsafe { (at as *const u32).read_volatile() } == PAINT {
        at = at.wrapping_add(4);
    }
    top.wrapping_sub(at)
}
