//! What the instrument takes. What that is on the chip, the firmware's README shows.

use massline_firmware::instrument::{Instrument, Job, Persistent, RunStorage, WorkingStorage};

/// What the chip has, 192 KiB, of which a tenth stays free.
const CHIP: usize = 192 << 10;

#[test]
fn the_memory_fits_the_chip() {
    // On a host pointers and lengths are twice as long; the chip's is never larger.
    assert!(size_of::<WorkingStorage>() <= 51_736);
    assert!(size_of::<RunStorage>() <= 65_240);
    assert!(size_of::<RunStorage>() <= 64 << 10, "core-coupled memory");
    assert!(size_of::<Persistent>() <= 13_160);
    assert!(size_of::<Instrument<'_>>() <= 1_584);
    // A job is moved, from one task to another.
    assert!(size_of::<Job<'_>>() <= 272);
    let lent = size_of::<WorkingStorage>() + size_of::<RunStorage>() + size_of::<Persistent>();
    let link_and_tasks = 12 << 10;
    let left = CHIP * 9 / 10 - lent - size_of::<Instrument<'_>>() - link_and_tasks;
    assert!(left >= 22 << 10, "{left} bytes are left for the stack");
}
