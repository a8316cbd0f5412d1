//! Sizes of what is moved. The lent memory is held against its bytes when it is compiled
//! (`firmware/src/capacity.rs`); the firmware's README shows what all of it takes on the chip.

use massline_firmware::instrument::{Instrument, Job, Persistent, RunStorage, WorkingStorage};

#[test]
fn the_instrument_and_its_jobs_stay_small() {
    println!(
        "lent: {} bytes of stored runs, {} of scratch memory, {} of set-up and results",
        size_of::<RunStorage>(),
        size_of::<WorkingStorage>(),
        size_of::<Persistent>()
    );
    // On a host pointers and lengths are twice as long; the chip's are never larger. One channel
    // more takes eight bytes of the instrument, for its part in a synthetic run; the filters of a
    // band are 200 of them.
    println!("instrument: {} bytes", size_of::<Instrument<'_>>());
    assert!(size_of::<Instrument<'_>>() <= 1_616);
    // A job is moved, from one task to another.
    println!("job: {} bytes", size_of::<Job<'_>>());
    assert!(size_of::<Job<'_>>() <= 280);
}
