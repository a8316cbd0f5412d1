//! Capacities of the instrument: the sizes of everything it can be asked for.
//!
//! They are the board's: another amount of memory is another file like this one, and nothing
//! else. What follows from them is derived in `instrument/memory.rs`, which refuses to be
//! compiled where they contradict each other or take more than the bytes below.
//!
//! | one more | bytes, beside the others as they are here |
//! | --- | ---: |
//! | channel | 90 |
//! | sensor | 220 |
//! | run | 14,400 |
//! | line | 920 |

/// Channels of a sample.
pub const CHANNELS: usize = 48;
/// Sensors of a set-up.
pub const SENSORS: usize = 48;
/// Runs of a set-up, all of which can be stored.
pub const RUNS: usize = 6;
/// Spectral lines of a run.
pub const LINES: usize = 100;
/// Samples of a block, a power of two.
pub const BLOCK_LENGTH: usize = 1024;

/// Bytes that stored runs may take: the core-coupled memory of the STM32F405 has 65,536.
pub const RUN_BYTES: usize = 64_216;
/// Bytes that a run or an identification may take while it is going on.
pub const WORKING_BYTES: usize = 58_700;
/// Bytes that the set-up and the results, lines aside, may take.
pub const PERSISTENT_BYTES: usize = 13_160;
