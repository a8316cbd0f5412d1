//! One trait for all that a box can be reached through.

use super::{Emulator, EmulatorError};
use crate::limits;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// An end of the link to a box: bytes go out, bytes come in, and neither side knows frames.
pub trait Port {
    /// Name in messages: `serial port /dev/ttyACM0`.
    fn name(&self) -> String;

    /// Hands bytes over, to go out in their order. May return before they are out.
    ///
    /// # Errors
    /// [`PortError`] if there is nobody at the other end any more.
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError>;

    /// Appends what has come to `into`. If nothing has, waits for it, but not longer than
    /// `timeout`. The number of bytes; zero says that time is up.
    ///
    /// # Errors
    /// [`PortError`] if there is nobody at the other end any more, and all that came before
    /// was taken.
    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError>;

    /// Time after which a reply counts as lost: the longest that a request and its
    /// reply are on their way behind a full window of others, several times over.
    fn patience(&self) -> Duration;

    /// Longest that the box may work at one request.
    fn longest_work(&self) -> Duration {
        limits::LONGEST_WORK
    }

    /// The time, s since any instant, by the clock that samples are to be held against: this
    /// computer's. It is asked when something has come.
    fn seconds(&self) -> f64 {
        static START: LazyLock<Instant> = LazyLock::new(Instant::now);
        START.elapsed().as_secs_f64()
    }
}

/// Why an end of the link does not work.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// A serial port that cannot be opened.
    #[error(
        "{path}: {reason}; {}, try --emulator for a box without hardware",
        listed(.present)
    )]
    Open {
        /// As it was named.
        path: String,
        /// The system's reason.
        reason: String,
        /// The ports there are.
        present: Vec<String>,
    },
    /// It was unplugged, or the driver failed.
    #[error(
        "{name}: the connection is lost ({reason}); a run on the box goes on without it, plug the box in again and ask `massline board info`"
    )]
    Gone {
        /// Name of the port.
        name: String,
        /// The system's reason.
        reason: String,
    },
    /// The emulator.
    #[error(transparent)]
    Emulator(#[from] EmulatorError),
}

fn listed(ports: &[String]) -> String {
    if ports.is_empty() {
        "this machine shows no serial port".to_owned()
    } else {
        format!("this machine has {}", ports.join(", "))
    }
}

impl Port for Emulator {
    fn name(&self) -> String {
        "emulator".to_owned()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        Ok(Self::send(self, bytes)?)
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        Ok(Self::receive(self, into, timeout)?)
    }

    /// It carries some 17 kB/s, a window of a few kilobytes in half a second; but emulated time
    /// stands still while the machine is busy otherwise.
    fn patience(&self) -> Duration {
        Duration::from_secs(20)
    }

    /// An emulated processor is some ten times slower than the real one on an idle machine.
    fn longest_work(&self) -> Duration {
        10 * limits::LONGEST_WORK
    }
}

/// Answers what is asked of a [`Port`] about itself by the end of the link within it.
macro_rules! ask_within {
    ($this:ident, $within:expr) => {
        fn patience(&$this) -> std::time::Duration {
            $within.patience()
        }

        fn longest_work(&$this) -> std::time::Duration {
            $within.longest_work()
        }

        fn seconds(&$this) -> f64 {
            $within.seconds()
        }
    };
}
pub(crate) use ask_within;

macro_rules! pointers {
    ($($pointer:ty)*) => {$(
        impl<P: Port + ?Sized> Port for $pointer {
            fn name(&self) -> String {
                (**self).name()
            }

            fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
                (**self).send(bytes)
            }

            fn receive(&mut self, into: &mut Vec<u8>, time: Duration) -> Result<usize, PortError> {
                (**self).receive(into, time)
            }

            ask_within!(self, (**self));
        }
    )*};
}

pointers!(Box<P> &mut P);
