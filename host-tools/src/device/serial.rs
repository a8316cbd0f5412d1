//! The box on a serial port, most often the virtual one of its debug probe.

use super::{Port, PortError};
use crate::limits;
use std::io::{ErrorKind, Read, Write};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::time::Duration;

/// Rate of the link as boxes are delivered, baud; 8 data bits, no parity, one stop bit.
pub const BAUD: u32 = 921_600;

/// An open serial port.
pub struct Serial {
    path: String,
    port: Box<dyn serialport::SerialPort>,
    writer: Writer,
}

/// A thread that writes to the port. A driver whose buffer is full, for nobody reads at the other
/// end, may keep a write for ever, whatever its timeout; this program does not wait for it beyond
/// [`limits::SENDING`].
struct Writer {
    bytes: Sender<Vec<u8>>,
    written: Receiver<std::io::Result<()>>,
}

impl Writer {
    fn new(mut port: Box<dyn serialport::SerialPort>) -> std::io::Result<Self> {
        let (bytes, to_write) = mpsc::channel::<Vec<u8>>();
        let (tell, written) = mpsc::channel();
        std::thread::Builder::new().spawn(move || {
            for bytes in to_write {
                if tell.send(port.write_all(&bytes)).is_err() {
                    return;
                }
            }
        })?;
        Ok(Self { bytes, written })
    }

    fn write(&self, bytes: &[u8]) -> std::io::Result<()> {
        let gone = std::io::Error::from(ErrorKind::BrokenPipe);
        self.bytes.send(bytes.to_vec()).map_err(|_| gone)?;
        let full = || std::io::Error::new(ErrorKind::TimedOut, "nothing reads what is sent");
        match self.written.recv_timeout(limits::SENDING) {
            Ok(Err(error)) if error.kind() == ErrorKind::TimedOut => Err(full()),
            Ok(result) => result,
            Err(RecvTimeoutError::Timeout) => Err(full()),
            Err(RecvTimeoutError::Disconnected) => Err(ErrorKind::BrokenPipe.into()),
        }
    }
}

impl Serial {
    /// Opens a port: `/dev/ttyACM0`, `COM3`.
    ///
    /// # Errors
    /// [`PortError::Open`] with the ports there are.
    pub fn open(path: &str, baud: u32) -> Result<Self, PortError> {
        let refused = |reason: String| PortError::Open {
            path: path.to_owned(),
            reason,
            present: names(),
        };
        let port = serialport::new(path, baud).timeout(limits::SENDING).open();
        let port = port.map_err(|error| refused(error.to_string()))?;
        Self::over(path, port).map_err(|error| refused(error.to_string()))
    }

    fn over(path: &str, port: Box<dyn serialport::SerialPort>) -> std::io::Result<Self> {
        let writer = Writer::new(port.try_clone()?)?;
        Ok(Self {
            path: path.to_owned(),
            port,
            writer,
        })
    }

    fn gone(&self, error: &std::io::Error) -> PortError {
        PortError::Gone {
            name: self.name(),
            reason: error.to_string(),
        }
    }
}

/// Names of the serial ports of this machine, as far as the system tells.
#[must_use]
pub fn names() -> Vec<String> {
    let ports = serialport::available_ports().unwrap_or_default();
    ports.into_iter().map(|port| port.port_name).collect()
}

impl Port for Serial {
    fn name(&self) -> String {
        format!("serial port {}", self.path)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let written = self.writer.write(bytes);
        written.map_err(|error| self.gone(&error))
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        let mut chunk = [0; 4096];
        // The driver counts whole milliseconds, and takes zero for none at all.
        let timeout = timeout.max(Duration::from_millis(1));
        let read = self
            .port
            .set_timeout(timeout)
            .map_err(std::io::Error::from)
            .and_then(|()| self.port.read(&mut chunk));
        match read {
            Ok(count @ 1..) => {
                into.extend_from_slice(&chunk[..count]);
                Ok(count)
            }
            // A port that was unplugged reads as at its end.
            Ok(0) => Err(self.gone(&ErrorKind::UnexpectedEof.into())),
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {
                Ok(0)
            }
            Err(error) => Err(self.gone(&error)),
        }
    }

    /// A window of a few kilobytes takes some 50 ms at the usual rate, and a block on the box
    /// less than that.
    fn patience(&self) -> Duration {
        Duration::from_secs(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_that_is_not_there_is_an_error_that_lists_those_that_are() {
        let Err(error) = Serial::open("/dev/no-such-port", BAUD) else {
            panic!("it opened");
        };
        let text = error.to_string();
        assert!(text.starts_with("/dev/no-such-port: "), "{text}");
        assert!(text.contains("--emulator"), "{text}");
    }

    /// A pair of connected ports, as far as the system can pretend them.
    #[cfg(unix)]
    fn pair() -> (Serial, serialport::TTYPort) {
        let (here, there) = serialport::TTYPort::pair().unwrap();
        (Serial::over("pair", Box::new(here)).unwrap(), there)
    }

    #[cfg(unix)]
    #[test]
    fn bytes_of_all_values_go_both_ways() {
        let (mut here, mut there) = pair();
        let all: Vec<u8> = (0..=255).collect();
        here.send(&all).unwrap();
        let mut heard = [0; 256];
        serialport::SerialPort::set_timeout(&mut there, limits::SENDING).unwrap();
        there.read_exact(&mut heard).unwrap();
        assert_eq!(heard[..], all);
        there.write_all(&all).unwrap();
        let mut back = Vec::new();
        while back.len() < all.len() {
            assert_ne!(here.receive(&mut back, limits::SENDING).unwrap(), 0);
        }
        assert_eq!(back, all);
        assert_eq!(here.receive(&mut back, Duration::ZERO).unwrap(), 0);
    }

    #[cfg(unix)]
    #[test]
    fn a_port_that_nothing_reads_from_is_given_up() {
        let (mut here, _there) = pair();
        let since = std::time::Instant::now();
        // More than any driver keeps.
        let error = (0..4096).find_map(|_| here.send(&[7; 1024]).err()).unwrap();
        assert!(error.to_string().contains("nothing reads"), "{error}");
        // Twice the limit, for a machine that is busy otherwise.
        assert!(since.elapsed() < 2 * limits::SENDING);
    }

    #[cfg(unix)]
    #[test]
    fn an_unplugged_port_is_gone() {
        let (mut here, there) = pair();
        drop(there);
        let error = here.receive(&mut Vec::new(), limits::SENDING).unwrap_err();
        assert!(matches!(error, PortError::Gone { .. }), "{error}");
    }
}
