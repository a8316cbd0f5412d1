//! The firmware in QEMU: the very ELF that is flashed, with its link on a pipe.
//!
//! The second serial port of the emulated board is USART2, the link to the host. It is connected
//! to the emulator's standard input and output, so there is no port to choose, nothing to race
//! for, and nothing left behind. A thread on each side keeps both directions moving: a caller may
//! queue a megabyte with [`Emulator::send`] and read the answers at leisure.
//!
//! The emulated port takes and gives bytes without loss, whatever the baud rate says, at about
//! 17 to 20 kB/s. Emulated time is not real time: the waits here are there so that a test ends,
//! nothing may be concluded from how long anything took.
//!
//! ```no_run
//! use std::time::Duration;
//! use massline::device::{Emulator, firmware};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut board = Emulator::start(&firmware::find(None)?)?;
//! board.send(&[0x00])?;
//! let frame = board.read_until(0x00, Duration::from_secs(20))?;
//! # Ok(()) }
//! ```

use std::collections::VecDeque;
use std::env;
use std::ffi::OsString;
use std::io::{self, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdin, Command, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

mod error;

pub use error::EmulatorError;

/// Environment variable that names another QEMU than [`DEFAULT_PROGRAM`].
pub const QEMU: &str = "MASSLINE_QEMU";

/// The QEMU to use unless told otherwise; Debian's package of it has the same name.
pub const DEFAULT_PROGRAM: &str = "qemu-system-arm";

/// The emulated board with an STM32F405 that every QEMU since 5.0 knows.
const MACHINE: &str = "netduinoplus2";

/// The emulator to use: what [`QEMU`] names, else [`DEFAULT_PROGRAM`].
pub fn program() -> OsString {
    env::var_os(QEMU)
        .filter(|program| !program.is_empty())
        .unwrap_or_else(|| DEFAULT_PROGRAM.into())
}

/// A running emulator with a board in it; dropping it ends it.
#[derive(Debug)]
pub struct Emulator {
    child: Child,
    to_board: Sender<Vec<u8>>,
    from_board: Receiver<Vec<u8>>,
    received: VecDeque<u8>,
    stderr: Option<JoinHandle<String>>,
}

impl Emulator {
    /// Boots a firmware.
    ///
    /// # Errors
    ///
    /// [`EmulatorError::Start`] when there is no emulator.
    pub fn start(elf: &Path) -> Result<Self, EmulatorError> {
        Self::start_with(elf, &[])
    }

    /// Boots a firmware with more arguments for QEMU, for example `["-icount", "shift=0"]`, with
    /// which instruction counts repeat exactly.
    ///
    /// # Errors
    ///
    /// [`EmulatorError::Start`] when there is no emulator.
    pub fn start_with(elf: &Path, arguments: &[&str]) -> Result<Self, EmulatorError> {
        let mut command = Command::new(program());
        command
            .args(["-M", MACHINE, "-display", "none", "-monitor", "none"])
            .args(["-chardev", "stdio,id=link,signal=off"])
            .args(["-serial", "null", "-serial", "chardev:link"])
            .args(arguments)
            .arg("-kernel")
            .arg(elf);
        Self::spawn(command)
    }

    fn spawn(mut command: Command) -> Result<Self, EmulatorError> {
        let spawned = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        let failed = |source| EmulatorError::Start {
            program: command.get_program().to_owned(),
            source,
        };
        let mut child = spawned.map_err(failed)?;
        let (Some(stdin), Some(stdout), Some(stderr)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err(failed(io::Error::other("it has no pipes")));
        };
        let (to_board, queue) = mpsc::channel();
        let (chunks, from_board) = mpsc::channel();
        thread::spawn(move || pump_in(stdin, &queue));
        thread::spawn(move || pump_out(stdout, &chunks));
        Ok(Self {
            child,
            to_board,
            from_board,
            received: VecDeque::new(),
            stderr: Some(thread::spawn(move || read_all(stderr))),
        })
    }

    /// Queues bytes for the board and returns at once; they go out as fast as the board reads.
    ///
    /// # Errors
    ///
    /// [`EmulatorError::Ended`] when the emulator is known to be gone.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), EmulatorError> {
        match self.to_board.send(bytes.to_vec()) {
            Ok(()) => Ok(()),
            Err(_) => Err(self.ended()),
        }
    }

    /// Appends what has come from the board to `into`; if nothing has, waits for it, but no
    /// longer than `timeout`. The number of bytes; zero is a timeout.
    ///
    /// # Errors
    ///
    /// [`EmulatorError::Ended`] when the emulator is gone and all it sent was taken.
    pub fn receive(
        &mut self,
        into: &mut Vec<u8>,
        timeout: Duration,
    ) -> Result<usize, EmulatorError> {
        if self.received.is_empty() {
            match self.from_board.recv_timeout(timeout) {
                Ok(chunk) => self.received.extend(chunk),
                Err(RecvTimeoutError::Timeout) => return Ok(0),
                Err(RecvTimeoutError::Disconnected) => return Err(self.ended()),
            }
        }
        self.received.extend(self.from_board.try_iter().flatten());
        let count = self.received.len();
        into.extend(self.received.drain(..));
        Ok(count)
    }

    /// The next `count` bytes from the board.
    ///
    /// # Errors
    ///
    /// [`EmulatorError::Timeout`] or [`EmulatorError::Ended`]; what has come stays in the queue.
    pub fn read_exact(
        &mut self,
        count: usize,
        timeout: Duration,
    ) -> Result<Vec<u8>, EmulatorError> {
        self.wait(
            timeout,
            |received, _| (received.len() >= count).then_some(count),
            || format!("{count} bytes"),
        )
    }

    /// Everything up to and with the next `delimiter`, for example a frame and its end mark.
    ///
    /// # Errors
    ///
    /// [`EmulatorError::Timeout`] or [`EmulatorError::Ended`]; what has come stays in the queue.
    pub fn read_until(
        &mut self,
        delimiter: u8,
        timeout: Duration,
    ) -> Result<Vec<u8>, EmulatorError> {
        self.wait(
            timeout,
            |received, seen| {
                let new = received.iter().skip(seen);
                new.clone()
                    .position(|&byte| byte == delimiter)
                    .map(|at| seen + at + 1)
            },
            || format!("a byte 0x{delimiter:02x}"),
        )
    }

    /// The next line, with its end mark.
    ///
    /// # Errors
    ///
    /// As [`Emulator::read_until`].
    pub fn read_line(&mut self, timeout: Duration) -> Result<String, EmulatorError> {
        let line = self.read_until(b'\n', timeout)?;
        Ok(String::from_utf8_lossy(&line).into_owned())
    }

    /// Waits until `complete` says how many bytes make the answer, and takes them.
    ///
    /// `complete` is given all that has come and how much of it it has seen before, so that a
    /// long answer is not searched again with each piece.
    fn wait(
        &mut self,
        timeout: Duration,
        complete: impl Fn(&VecDeque<u8>, usize) -> Option<usize>,
        expected: impl Fn() -> String,
    ) -> Result<Vec<u8>, EmulatorError> {
        let deadline = Instant::now() + timeout;
        let mut seen = 0;
        loop {
            if let Some(count) = complete(&self.received, seen) {
                return Ok(self.received.drain(..count).collect());
            }
            seen = self.received.len();
            let left = deadline.saturating_duration_since(Instant::now());
            match self.from_board.recv_timeout(left) {
                Ok(chunk) => self.received.extend(chunk),
                Err(RecvTimeoutError::Timeout) => {
                    return Err(EmulatorError::Timeout {
                        expected: expected(),
                        waited: timeout,
                        received: self.received.iter().copied().collect(),
                    });
                }
                Err(RecvTimeoutError::Disconnected) => return Err(self.ended()),
            }
        }
    }

    /// Collects what can be said about an emulator that closed its side.
    fn ended(&mut self) -> EmulatorError {
        let _ = self.child.kill();
        let status = self.child.wait().ok();
        let stderr = self.stderr.take().and_then(|reader| reader.join().ok());
        EmulatorError::Ended {
            status,
            stderr: stderr.unwrap_or_default(),
            received: self.received.iter().copied().collect(),
        }
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Carries queued bytes to the board until either side closes.
fn pump_in(mut stdin: ChildStdin, queue: &Receiver<Vec<u8>>) {
    while let Ok(bytes) = queue.recv() {
        if stdin.write_all(&bytes).is_err() {
            return;
        }
    }
}

/// Carries bytes from the board until either side closes.
fn pump_out(mut stdout: impl Read, chunks: &Sender<Vec<u8>>) {
    let mut buffer = [0; 4096];
    while let Ok(count @ 1..) = stdout.read(&mut buffer) {
        if chunks.send(buffer[..count].to_vec()).is_err() {
            return;
        }
    }
}

/// Reads complaints, as far as they are text.
fn read_all(mut stderr: ChildStderr) -> String {
    let mut text = Vec::new();
    let _ = stderr.read_to_end(&mut text);
    String::from_utf8_lossy(&text).into_owned()
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    const LONG: Duration = Duration::from_secs(20);
    const SHORT: Duration = Duration::from_millis(50);

    /// A shell in place of the emulator.
    fn stand_in(script: &str) -> Emulator {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        Emulator::spawn(command).unwrap()
    }

    #[test]
    fn carries_more_than_a_pipe_holds_both_ways() {
        let mut board = stand_in("cat");
        let sent: Vec<u8> = (0..1_000_000_u32).map(|n| (n % 251) as u8).collect();
        board.send(&sent).unwrap();
        assert_eq!(board.read_exact(sent.len(), LONG).unwrap(), sent);
    }

    #[test]
    fn splits_at_the_delimiter_and_keeps_the_rest() {
        let mut board = stand_in("cat");
        board.send(b"one\0two").unwrap();
        board.send(b"\0\0three\r\n").unwrap();
        assert_eq!(board.read_until(0, LONG).unwrap(), b"one\0");
        assert_eq!(board.read_until(0, LONG).unwrap(), b"two\0");
        assert_eq!(board.read_until(0, LONG).unwrap(), b"\0");
        assert_eq!(board.read_line(LONG).unwrap(), "three\r\n");
    }

    #[test]
    fn a_timeout_tells_what_came_and_does_not_lose_it() {
        let mut board = stand_in("printf half; exec cat");
        assert_eq!(board.read_exact(2, LONG).unwrap(), b"ha");
        assert_eq!(board.read_exact(2, LONG).unwrap(), b"lf");
        board.send(b"more").unwrap();
        assert_eq!(board.read_exact(4, LONG).unwrap(), b"more");
        board.send(b"left").unwrap();
        let error = loop {
            // The four bytes may take longer than SHORT to come round.
            match board.read_line(SHORT).unwrap_err() {
                EmulatorError::Timeout { received, .. } if received.is_empty() => continue,
                error => break error.to_string(),
            }
        };
        assert_eq!(
            error,
            "a byte 0x0a did not come within 0.05 s; 4 bytes came: left"
        );
        assert_eq!(board.read_exact(4, LONG).unwrap(), b"left");
    }

    #[test]
    fn a_crash_is_told_from_a_timeout() {
        let mut board = stand_in("printf abc; echo bad reset >&2; exit 3");
        match board.read_line(LONG).unwrap_err() {
            EmulatorError::Ended {
                status,
                stderr,
                received,
            } => {
                assert_eq!(status.and_then(|status| status.code()), Some(3));
                assert_eq!(stderr, "bad reset\n");
                assert_eq!(received, b"abc");
            }
            other => panic!("{other}"),
        }
    }

    #[test]
    fn a_missing_emulator_is_named() {
        let error = Emulator::spawn(Command::new("no-such-emulator")).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("cannot start no-such-emulator")
        );
    }
}
