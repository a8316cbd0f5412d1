//! Errors of an emulator, with enough detail that a failed test needs no second run.

use std::ffi::OsString;
use std::process::ExitStatus;
use std::time::Duration;
use std::{fmt, io};

use super::QEMU;

/// Bytes of an unfinished answer that an error message shows.
const SHOWN: usize = 240;

/// Why the emulator did not do what was asked.
#[derive(Debug)]
pub enum EmulatorError {
    /// The emulator could not be started.
    Start {
        /// The program that was tried.
        program: OsString,
        /// The system's reason.
        source: io::Error,
    },
    /// The expected text did not come in time.
    Timeout {
        /// The text that was waited for.
        expected: String,
        /// For how long.
        waited: Duration,
        /// Bytes that had come instead; they stay in the queue.
        received: Vec<u8>,
    },
    /// The emulator ended, on its own or because it crashed.
    Ended {
        /// Exit status, where the system tells it.
        status: Option<ExitStatus>,
        /// Text on its standard error.
        stderr: String,
        /// Bytes that had come from the board and were not read.
        received: Vec<u8>,
    },
}

impl fmt::Display for EmulatorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Start { program, source } => write!(
                f,
                "cannot start {}: {source}; install QEMU for Arm (Debian: `apt install \
                 qemu-system-arm`), or name one in {QEMU}",
                program.display()
            ),
            Self::Timeout {
                expected,
                waited,
                received,
            } => write!(
                f,
                "{expected} did not come within {} s; {}",
                waited.as_secs_f32(),
                Received(received)
            ),
            Self::Ended {
                status,
                stderr,
                received,
            } => {
                f.write_str("the emulator ended")?;
                if let Some(status) = status {
                    write!(f, " with {status}")?;
                }
                write!(f, "; {}", Received(received))?;
                if !stderr.is_empty() {
                    write!(f, "\nit said: {}", stderr.trim_end())?;
                }
                Ok(())
            }
        }
    }
}

impl std::error::Error for EmulatorError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Start { source, .. } => Some(source),
            _ => None,
        }
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
