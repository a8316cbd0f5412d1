//! Where each byte lies. The table in the crate's description has these numbers.

use massline_core::instrument::{Instrument, Job, Notebook, RunStorage, WorkingStorage};

/// What the chip has, 192 KiB, of which a tenth stays free.
const CHIP: usize = 192 << 10;

#[test]
fn the_memory_fits_the_chip() {
    assert!(size_of::<WorkingStorage>() <= 56_600);
    assert_eq!(size_of::<RunStorage>(), 64_448);
    assert!(size_of::<RunStorage>() <= 64 << 10, "core-coupled memory");
    // On a host pointers and lengths are twice as long; the chip's is smaller.
    assert!(size_of::<Notebook>() <= 21_248);
    assert!(size_of::<Instrument<'_>>() <= 1_664);
    // A job is moved, from one task to another.
    assert!(size_of::<Job<'_>>() <= 352);
    let lent = size_of::<WorkingStorage>() + size_of::<RunStorage>() + size_of::<Notebook>();
    let link_and_tasks = 12 << 10;
    let left = CHIP * 9 / 10 - lent - size_of::<Instrument<'_>>() - link_and_tasks;
    assert!(left >= 22 << 10, "{left} bytes are left for the stack");
}
