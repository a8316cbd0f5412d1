//! The box on a serial port, most often the virtual one of its debug probe.

use super::{Port, PortError};
use std::io::{ErrorKind, Read, Write};
use std::time::Duration;

/// Rate of the link as boxes are delivered, baud; 8 data bits, no parity, one stop bit.
pub const BAUD: u32 = 921_600;

/// Longest that a write may take: the other side never makes us wait, so this only ends a
/// driver that hangs.
const WRITE: Duration = Duration::from_secs(5);

/// An open serial port.
pub struct Serial {
    path: String,
    port: Box<dyn serialport::SerialPort>,
}

impl Serial {
    /// Opens a port: `/dev/ttyACM0`, `COM3`.
    ///
    /// # Errors
    /// [`PortError::Open`] with the ports there are.
    pub fn open(path: &str, baud: u32) -> Result<Self, PortError> {
        let port = serialport::new(path, baud).timeout(WRITE).open();
        let port = port.map_err(|error| PortError::Open {
            path: path.to_owned(),
            reason: error.to_string(),
            present: names(),
        })?;
        Ok(Self {
            path: path.to_owned(),
            port,
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
        self.port
            .set_timeout(WRITE)
            .map_err(std::io::Error::from)
            .and_then(|()| self.port.write_all(bytes))
            .map_err(|error| self.gone(&error))
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
        let here = Serial {
            path: "pair".to_owned(),
            port: Box::new(here),
        };
        (here, there)
    }

    #[cfg(unix)]
    #[test]
    fn bytes_of_all_values_go_both_ways() {
        let (mut here, mut there) = pair();
        let all: Vec<u8> = (0..=255).collect();
        here.send(&all).unwrap();
        let mut heard = [0; 256];
        serialport::SerialPort::set_timeout(&mut there, WRITE).unwrap();
        there.read_exact(&mut heard).unwrap();
        assert_eq!(heard[..], all);
        there.write_all(&all).unwrap();
        let mut back = Vec::new();
        while back.len() < all.len() {
            assert_ne!(here.receive(&mut back, WRITE).unwrap(), 0);
        }
        assert_eq!(back, all);
        assert_eq!(here.receive(&mut back, Duration::ZERO).unwrap(), 0);
    }

    #[cfg(unix)]
    #[test]
    fn an_unplugged_port_is_gone() {
        let (mut here, there) = pair();
        drop(there);
        let error = here.receive(&mut Vec::new(), WRITE).unwrap_err();
        assert!(matches!(error, PortError::Gone { .. }), "{error}");
    }
}
