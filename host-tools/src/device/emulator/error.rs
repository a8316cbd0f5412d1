//! Errors of an emulator, with enough detail that a failed test needs no second run.

use std::ffi::OsString;
use std::process::ExitStatus;
use std::time::Duration;
use std::{fmt, io};

use super::QEMU;

/// Bytes of an unfinished answer that an error message shows.
const SHOWN: usize = 240;

/// Why the emulator did not do what was asked.
#[derive(Debug, thiserror::Error)]
pub enum EmulatorError {
    /// The emulator could not be started.
    #[error(
        "cannot start {}: {source}; install QEMU for Arm (Debian: `apt install qemu-system-arm`), \
         or name one in {QEMU}", program.display()
    )]
    Start {
        /// The program that was tried.
        program: OsString,
        /// The system's reason.
        source: io::Error,
    },
    /// The expected text did not come in time.
    #[error(
        "{expected} did not come within {} s; {}", waited.as_secs_f32(), Received(received)
    )]
    Timeout {
        /// The text that was waited for.
        expected: String,
        /// For how long.
        waited: Duration,
        /// Bytes that had come instead; they stay in the queue.
        received: Vec<u8>,
    },
    /// The emulator ended, on its own or because it crashed.
    #[error(
        "the emulator ended{}; {}{}",
        status.map_or_else(String::new, |status| format!(" with {status}")),
        Received(received),
        said(stderr)
    )]
    Ended {
        /// Exit status, where the system tells it.
        status: Option<ExitStatus>,
        /// Text on its standard error.
        stderr: String,
        /// Bytes that had come from the board and were not read.
        received: Vec<u8>,
    },
}

fn said(stderr: &str) -> String {
    match stderr {
        "" => String::new(),
        text => format!("\nit said: {}", text.trim_end()),
    }
}

/// The end of what came, for an error message.
struct Received<'a>(&'a [u8]);

impl fmt::Display for Received<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let tail = &self.0[self.0.len().saturating_sub(SHOWN)..];
        match (self.0.len(), tail.len()) {
            (0, _) => f.write_str("nothing came"),
            (all, shown) if all == shown => write!(f, "{all} bytes came: {}", tail.escape_ascii()),
            (all, shown) => write!(
                f,
                "{all} bytes came, the last {shown}: {}",
                tail.escape_ascii()
            ),
        }
    }
}
