//! Lanes whose frames end when they are told to.

use embedded_hal::spi::{Operation, SpiDevice};

use crate::drivers::lanes::{Lanes, Progress, Step};

/// Bytes of the longest request.
const BYTES: usize = 32;

/// Lanes over the SPI devices of `N` converters, with their requests.
#[derive(Debug)]
pub struct Model<A, D, const N: usize> {
    /// Devices of the first converters.
    pub devices: [A; N],
    /// Device of the converter behind them.
    pub follower: D,
    requests: &'static [&'static [u8]],
    running: [Option<Step>; 3],
    /// Bit k: the frame on lane k has ended, and its interrupt has not been served.
    ended: u32,
    /// Bit k: the frame on lane k has failed.
    failed: u32,
    received: [[u8; BYTES]; 5],
    /// Frames that were begun while another one ran on their lane: a mistake.
    pub collisions: u32,
}

impl<A: SpiDevice, D: SpiDevice, const N: usize> Model<A, D, N> {
    /// Lanes at rest.
    pub const fn new(devices: [A; N], follower: D, requests: &'static [&'static [u8]]) -> Self {
        Self {
            devices,
            follower,
            requests,
            running: [None; 3],
            ended: 0,
            failed: 0,
            received: [[0; BYTES]; 5],
            collisions: 0,
        }
    }

    /// A lane whose frame runs, the first one of them.
    pub fn running(&self) -> Option<usize> {
        self.running.iter().position(Option::is_some)
    }

    /// Exchanges the bytes of the frame that runs on a lane.
    pub fn finish(&mut self, lane: usize) {
        let Some(Some(step)) = self.running.get(lane).copied() else {
            return;
        };
        let place = usize::from(step.converter);
        let part = usize::from(step.first)..usize::from(step.first) + usize::from(step.bytes);
        let request = self.requests.get(place).and_then(|r| r.get(part.clone()));
        let bytes = self.received.get_mut(place).and_then(|b| b.get_mut(part));
        let (Some(request), Some(bytes)) = (request, bytes) else {
            return;
        };
        bytes.copy_from_slice(request);
        let exchange = &mut [Operation::TransferInPlace(bytes)];
        let is_good = match self.devices.get_mut(place) {
            Some(device) => device.transaction(exchange).is_ok(),
            None => self.follower.transaction(exchange).is_ok(),
        };
        self.ended |= 1 << lane;
        self.failed |= u32::from(!is_good) << lane;
    }
}

impl<A: SpiDevice, D: SpiDevice, const N: usize> Lanes for Model<A, D, N> {
    fn begin(&mut self, lane: usize, step: Step) -> Progress {
        let Some(running) = self.running.get_mut(lane) else {
            return Progress::Failed;
        };
        self.collisions += u32::from(running.is_some());
        *running = Some(step);
        let bit = !(1 << lane);
        (self.ended, self.failed) = (self.ended & bit, self.failed & bit);
        Progress::Running
    }

    fn progress(&mut self, lane: usize) -> Progress {
        if self.ended >> lane & 1 == 0 {
            return Progress::Running;
        }
        if let Some(running) = self.running.get_mut(lane) {
            *running = None;
        }
        match self.failed >> lane & 1 {
            0 => Progress::Done,
            _ => Progress::Failed,
        }
    }

    fn abort(&mut self, lane: usize) {
        if let Some(running) = self.running.get_mut(lane) {
            *running = None;
        }
    }

    /// The drivers of a model read in no time.
    fn is_edge_noted(&self) -> bool {
        false
    }

    fn received(&self, converter: usize) -> &[u8] {
        self.received.get(converter).map_or(&[], |bytes| bytes)
    }
}
