//! A box in this program that notices faults of its own, for tests.

use super::{HostBox, Port, PortError};
use massline_firmware::wire::FaultKind;
use std::time::Duration;

/// A box that notices faults of its own: each after so many looks at what it says.
pub(crate) struct Failing<'m> {
    pub(crate) inner: HostBox<'m>,
    pub(crate) looks: u32,
    pub(crate) faults: Vec<(u32, FaultKind, Option<u8>)>,
}

impl Port for Failing<'_> {
    fn name(&self) -> String {
        self.inner.name()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
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

    fn patience(&self) -> Duration {
        self.inner.patience()
    }

    fn longest_work(&self) -> Duration {
        self.inner.longest_work()
    }

    fn seconds(&self) -> f64 {
        self.inner.seconds()
    }
}
