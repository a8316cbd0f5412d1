//! The serial port of the link: USART2.

use core::sync::atomic::{AtomicBool, Ordering};

use massline_firmware::link::PortEnds;
use massline_firmware::link::rate::LinkRate;
use stm32f4xx_hal::nb;
use stm32f4xx_hal::pac::USART2;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Rx, Tx};
use stm32f4xx_hal::time::Hertz;

/// Bytes each way that one interrupt moves at most. The port has one or two; the emulator's has any
/// number, and must not keep tasks of lower priority waiting.
const AT_ONCE: usize = 8;

/// `true` if the port has more to move than one interrupt does.
static MORE: AtomicBool = AtomicBool::new(false);

/// The port, served by its interrupt.
pub struct Port {
    rx: Rx<USART2>,
    tx: Tx<USART2>,
    queues: PortEnds<'static>,
}

impl Port {
    /// A port that listens for bytes.
    pub fn new((tx, mut rx): (Tx<USART2>, Rx<USART2>), queues: PortEnds<'static>) -> Self {
        rx.listen();
        Self { rx, tx, queues }
    }

    /// Moves the bytes that can be moved without waiting, [`AT_ONCE`] each way at most. `true` if
    /// the task that serves requests has to run: a frame has ended, there is room to send again,
    /// or there is more to move, which that task calls for.
    ///
    /// Has to be called at the port's interrupt and whenever there are bytes to send. It enables
    /// the interrupt that comes when the port can move more.
    pub fn serve(&mut self) -> bool {
        let (ended, is_more_in) = self.receive();
        let (sent, is_more_out) = self.send();
        let is_more = is_more_in || is_more_out;
        MORE.store(is_more, Ordering::Relaxed);
        ended || sent || is_more
    }

    /// The first is `true` if a frame has ended, the second if there is more to receive.
    fn receive(&mut self) -> (bool, bool) {
        let mut ended = false;
        for _ in 0..AT_ONCE {
            match self.rx.read() {
                Ok(byte) => ended |= self.queues.received(byte),
                Err(nb::Error::WouldBlock) => {
                    self.rx.listen();
                    return (ended, false);
                }
                Err(nb::Error::Other(_)) => self.queues.lost(),
            }
        }
        // Its interrupt would come again at once, before any task of lower priority runs.
        self.rx.unlisten();
        (ended, true)
    }

    /// The first is `true` if anything was sent, the second if the port would take more.
    fn send(&mut self) -> (bool, bool) {
        for moved in 0..AT_ONCE {
            let Some(byte) = self.queues.to_send() else {
                self.tx.unlisten();
                return (moved > 0, false);
            };
            if self.tx.write(byte).is_err() {
                self.tx.listen();
                // The interrupt comes when all of it is sent.
                return (false, false);
            }
            self.queues.sent();
        }
        self.tx.unlisten();
        (true, true)
    }
}

/// `true` if [`Port::serve`] has to be called again.
pub fn has_more() -> bool {
    MORE.load(Ordering::Relaxed)
}

/// Waits until the port has sent the byte it is at, or for a thousand bytes' time.
pub fn finish_sending() {
    for _ in 0..200_000 {
        // SAFETY: one read of a status register, which has no effect as no data are read after.
        if unsafe { (*USART2::ptr()).sr().read().tc().bit_is_set() } {
            return;
        }
    }
}

/// The bit rate of the port.
pub struct BitRate {
    choice: LinkRate,
    /// Clock that the port divides.
    clock: Hertz,
}

impl BitRate {
    /// The rate that the port was set to, and the clock that it divides.
    pub const fn new(choice: LinkRate, clock: Hertz) -> Self {
        Self { choice, clock }
    }

    /// Changes the rate if no host has been understood for the time of [`LinkRate`]: `frames` that
    /// were valid and `bytes` that have come since the start.
    pub fn update(&mut self, ticks: u64, frames: u32, bytes: u32) {
        if let Some(baud) = self.choice.look(ticks, frames, bytes) {
            let clock = self.clock.raw();
            let divisor = clock.saturating_add(baud / 2) / baud.max(1);
            // SAFETY: one write of a register that nothing else in the program touches after the
            // start. The HAL has set the port up for 16 clocks a bit, which both rates have.
            unsafe {
                (*USART2::ptr())
                    .brr()
                    .write(|w| w.bits(divisor as u16 as _));
            }
            defmt::warn!("no host was understood, the link is at {} baud now", baud);
        }
    }
}
