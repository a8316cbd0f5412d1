//! A box in this program with faults of its own and of its line, for tests.

use super::{HostBox, Port, PortError};
use massline_firmware::wire::FaultKind;
use std::time::Duration;

/// A box that notices faults of its own, each after so many receives, on a line that may lose a
/// frame to it.
pub(crate) struct Failing<'m> {
    pub(crate) inner: HostBox<'m>,
    pub(crate) looks: u32,
    pub(crate) faults: Vec<(u32, FaultKind, Option<u8>)>,
    /// Number of the frame to the box that is lost, from one; zero for none.
    pub(crate) lost: u32,
    pub(crate) sent: u32,
}

impl<'m> Failing<'m> {
    /// A box without faults.
    pub(crate) const fn new(inner: HostBox<'m>) -> Self {
        Self {
            inner,
            looks: 0,
            faults: Vec::new(),
            lost: 0,
            sent: 0,
        }
    }
}

impl Port for Failing<'_> {
    fn name(&self) -> String {
        self.inner.name()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.sent += 1;
        if self.sent == self.lost {
            return Ok(());
        }
        self.inner.send(bytes)
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        self.looks += 1;
        let due = self.faults.iter().filter(|(at, ..)| *at == self.looks);
        for &(_, kind, part) in due {
            self.inner.fault(kind, part);
        }
        self.inner.receive(into, timeout)
    }

    super::port::ask_within!(self, self.inner);
}
